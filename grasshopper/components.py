"""From ``src/<Name>/`` to Grasshopper's chunks: one script component per folder, shared source inlined."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import UUID, uuid5

from grasshopper.archive import Chunk, deflate

SOURCE = Path(__file__).resolve().parent / "src"
SHARED = SOURCE / "shared"
INCLUDE = re.compile(r"^# include: (.+)$", re.MULTILINE)

#: The script component of Rhino 6 and 7; Rhino 8 still loads it.
GHPYTHON = UUID("410755b1-224a-4c1e-a407-bf32fb45ea7e")
INPUT_ID = UUID("84fa917c-1ed8-4db3-8be1-7bdc4a6495a2")
OUTPUT_ID = UUID("8ec86459-bf01-4409-baee-174d0d2b13d0")


@dataclass(frozen=True)
class Component:
    """One folder of ``src``. code: complete, shared source included."""

    folder: str
    metadata: dict[str, Any]
    code: str
    icon: bytes

    @property
    def guid(self) -> UUID:
        return UUID(self.metadata["instanceGuid"])

    @property
    def inputs(self) -> list[dict[str, Any]]:
        return list(self.metadata["ghpython"]["inputParameters"])

    @property
    def outputs(self) -> list[dict[str, Any]]:
        return list(self.metadata["ghpython"]["outputParameters"])


def folders() -> list[Path]:
    """The components' folders, by name."""
    return sorted(path.parent for path in SOURCE.glob("*/metadata.json"))


def load(folder: Path) -> Component:
    """Reads one folder."""
    metadata = json.loads((folder / "metadata.json").read_text(encoding="utf-8"))
    code = complete((folder / "code.py").read_text(encoding="utf-8"))
    return Component(folder.name, metadata, code, (folder / "icon.png").read_bytes())


def complete(code: str) -> str:
    """The code with the shared files that its line ``# include: a b`` names, in that order."""

    def shared(match: re.Match[str]) -> str:
        parts = [(SHARED / f"{name}.py").read_text(encoding="utf-8") for name in match[1].split()]
        return "\n\n".join(part.strip("\n") for part in parts)

    return INCLUDE.sub(shared, code)


def user_object(component: Component) -> bytes:
    """The ``.ghuser`` file."""
    metadata = component.metadata
    chunk = Chunk("UserObject")
    chunk.add("gh_guid", "BaseID", GHPYTHON)
    chunk.add("gh_string", "Category", metadata["category"])
    chunk.add("gh_string", "SubCategory", metadata["subcategory"])
    chunk.add("gh_string", "Description", metadata["description"])
    chunk.add("gh_int32", "Exposure", metadata["exposure"])
    chunk.add("gh_bytearray", "Icon", component.icon)
    chunk.add("gh_guid", "InstanceGuid", component.guid)
    chunk.add("gh_string", "Name", metadata["name"])
    chunk.add("gh_string", "NickName", metadata["nickname"])
    inner = Chunk("UserObject")
    script(inner, component)
    inner.chunks.append(parameters(component, component.guid))
    chunk.add("gh_bytearray", "Object", deflate(inner))
    return deflate(chunk)


def script(chunk: Chunk, component: Component) -> None:
    """The items of a script component itself."""
    metadata, own = component.metadata, component.metadata["ghpython"]
    chunk.add("gh_string", "CodeInput", component.code)
    chunk.add("gh_string", "Description", metadata["description"])
    chunk.add("gh_bool", "HideInput", own["hideInput"])
    chunk.add("gh_bool", "HideOutput", own["hideOutput"])
    chunk.add("gh_int32", "IconDisplay", own["iconDisplay"])
    chunk.add("gh_bool", "IsAdvancedMode", own["isAdvancedMode"])
    chunk.add("gh_bool", "MarshalOutGuids", own["marshalOutGuids"])
    chunk.add("gh_string", "Name", metadata["name"])
    chunk.add("gh_string", "NickName", metadata["nickname"])


def parameter_guid(instance: UUID, side: str, name: str) -> UUID:
    """InstanceGuid of a parameter, the same in every build."""
    return uuid5(instance, f"{side} {name}")


def parameters(component: Component, instance: UUID, sources: dict[str, list[UUID]] | None = None) -> Chunk:
    """ParameterData. sources: per input, the outputs that are wired to it."""
    chunk = Chunk("ParameterData")
    chunk.add("gh_int32", "InputCount", len(component.inputs))
    chunk.add("gh_int32", "OutputCount", len(component.outputs))
    for i, spec in enumerate(component.inputs):
        chunk.add("gh_guid", "InputId", INPUT_ID, index=i)
        _input(chunk.child("InputParam", i), spec, instance, (sources or {}).get(spec["name"], []))
    for i, spec in enumerate(component.outputs):
        chunk.add("gh_guid", "OutputId", OUTPUT_ID, index=i)
        _output(chunk.child("OutputParam", i), spec, instance)
    return chunk


def _input(chunk: Chunk, spec: dict[str, Any], instance: UUID, sources: list[UUID]) -> None:
    _parameter(chunk, spec, parameter_guid(instance, "input", spec["name"]), spec["optional"], len(sources))
    chunk.add("gh_bool", "AllowTreeAccess", True)
    if spec["scriptParamAccess"]:
        chunk.add("gh_int32", "Access", spec["scriptParamAccess"])
    chunk.add("gh_int32", "ScriptParamAccess", spec["scriptParamAccess"])
    chunk.add("gh_bool", "ShowTypeHints", True)
    chunk.add("gh_guid", "TypeHintID", UUID(spec["typeHintID"]))
    chunk.add("gh_int32", "WireDisplay", 0)
    for k, source in enumerate(sources):
        chunk.add("gh_guid", "Source", source, index=k)


def _output(chunk: Chunk, spec: dict[str, Any], instance: UUID) -> None:
    _parameter(chunk, spec, parameter_guid(instance, "output", spec["name"]), False, 0)


def _parameter(chunk: Chunk, spec: dict[str, Any], guid: UUID, optional: bool, sources: int) -> None:
    chunk.add("gh_string", "Description", spec["description"])
    chunk.add("gh_guid", "InstanceGuid", guid)
    chunk.add("gh_string", "Name", spec["name"])
    chunk.add("gh_string", "NickName", spec["nickname"])
    chunk.add("gh_bool", "Optional", optional)
    chunk.add("gh_bool", "ReverseData", False)
    chunk.add("gh_bool", "SimplifyData", False)
    chunk.add("gh_int32", "SourceCount", sources)
