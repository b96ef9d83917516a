"""From ``src/<Name>/`` to Grasshopper's chunks: one script component per folder, shared source inlined.

The same sources fill two forms of script component: the one of Rhino 6 and 7 (IronPython), which Rhino 8
still loads, and Rhino 8's own (CPython).
"""

from __future__ import annotations

import ast
import base64
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

#: Type hints that both forms share.
_HINTS = {
    "bool": UUID("d60527f5-b5af-4ef6-8970-5f96fe412559"),
    "int": UUID("48d01794-d3d8-4aef-990e-127168822244"),
    "point": UUID("e1937b56-b1da-4c12-8bd8-e34ee81746ef"),
    "curve": UUID("9ba89ec2-5315-435f-a621-b66c5fa2f301"),
    "mesh": UUID("794a1f9d-21d5-4379-b987-9e8bbf433912"),
}


@dataclass(frozen=True)
class Form:
    """How a kind of Rhino stores script components.

    base: its script component. input, output: its parameters. hints: GUIDs of type hints by the names that
    ``metadata.json`` uses. yak: the part of a package's file name that says which Rhino it is for.
    """

    name: str
    base: UUID
    input: UUID
    output: UUID
    hints: dict[str, UUID]
    yak: str


RHINO7 = Form(
    "rhino7",
    UUID("410755b1-224a-4c1e-a407-bf32fb45ea7e"),
    UUID("84fa917c-1ed8-4db3-8be1-7bdc4a6495a2"),
    UUID("8ec86459-bf01-4409-baee-174d0d2b13d0"),
    {
        **_HINTS,
        "none": UUID("35915213-5534-4277-81b8-1bdc9e7383d2"),
        "float": UUID("39fbc626-7a01-46ab-a18e-ec1c0c41685b"),
        "str": UUID("37261734-eec7-4f50-b6a8-b8d1f3c4396b"),
    },
    "rh7_0-any",
)
RHINO8 = Form(
    "rhino8",
    UUID("719467e6-7cf5-4848-99b0-c5dd57e5442c"),
    UUID("08908df5-fa14-4982-9ab2-1aa0927566aa"),
    UUID("08908df5-fa14-4982-9ab2-1aa0927566aa"),
    {
        **_HINTS,
        "none": UUID("6a184b65-baa3-42d1-a548-3915b401de53"),
        "float": UUID("9d51e32e-c038-4352-9554-f4137ca91b9a"),
        "str": UUID("3aceb454-6dbd-4c5b-9b6b-e71f8c1cdf88"),
    },
    "rh8_0-any",
)
FORMS = (RHINO7, RHINO8)


@dataclass(frozen=True)
class Component:
    """One folder of ``src``. code: complete, shared source included."""

    folder: str
    metadata: dict[str, Any]
    code: str
    icon: bytes

    def guid(self, form: Form) -> UUID:
        """InstanceGuid of the user object; both forms may lie in one folder."""
        legacy = UUID(self.metadata["instanceGuid"])
        return legacy if form is RHINO7 else uuid5(legacy, form.name)

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


def offered(component: str, name: str) -> tuple[str, ...]:
    """The choices that a component's source lists under a name."""
    tree = ast.parse((SOURCE / component / "code.py").read_text(encoding="utf-8"))
    lists = [node for node in tree.body if isinstance(node, ast.Assign)]
    return next(tuple(ast.literal_eval(node.value)) for node in lists if ast.unparse(node.targets[0]) == name)


def user_object(component: Component, form: Form) -> bytes:
    """The ``.ghuser`` file."""
    metadata = component.metadata
    chunk = Chunk("UserObject")
    chunk.add("gh_guid", "BaseID", form.base)
    chunk.add("gh_string", "Category", metadata["category"])
    chunk.add("gh_string", "SubCategory", metadata["subcategory"])
    chunk.add("gh_string", "Description", metadata["description"])
    chunk.add("gh_int32", "Exposure", metadata["exposure"])
    chunk.add("gh_bytearray", "Icon", component.icon)
    chunk.add("gh_guid", "InstanceGuid", component.guid(form))
    chunk.add("gh_string", "Name", metadata["name"])
    chunk.add("gh_string", "NickName", metadata["nickname"])
    inner = Chunk("UserObject")
    script(inner, component, form)
    inner.chunks.insert(0, parameters(component, component.guid(form), form))
    chunk.add("gh_bytearray", "Object", deflate(inner))
    return deflate(chunk)


def script(chunk: Chunk, component: Component, form: Form) -> None:
    """The items of a script component itself, and for Rhino 8 the chunk that holds its code."""
    metadata, own = component.metadata, component.metadata["ghpython"]
    chunk.add("gh_string", "Description", metadata["description"])
    chunk.add("gh_int32", "IconDisplay", own["iconDisplay"])
    chunk.add("gh_drawing_bitmap", "IconOverride", component.icon)
    chunk.add("gh_string", "Name", metadata["name"])
    chunk.add("gh_string", "NickName", metadata["nickname"])
    if form is RHINO7:
        chunk.add("gh_string", "CodeInput", component.code)
        chunk.add("gh_bool", "HideInput", own["hideInput"])
        chunk.add("gh_bool", "HideOutput", own["hideOutput"])
        chunk.add("gh_bool", "IsAdvancedMode", own["isAdvancedMode"])
        chunk.add("gh_bool", "MarshalOutGuids", own["marshalOutGuids"])
        return
    chunk.add("gh_bool", "MarshalGuids", own["marshalOutGuids"])
    chunk.add("gh_bool", "UsingLibraryInputParam", False)
    chunk.add("gh_bool", "UsingScriptInputParam", False)
    chunk.add("gh_bool", "UsingStandardOutputParam", not own["hideOutput"])
    code = chunk.child("Script")
    code.add("gh_string", "Text", base64.b64encode(component.code.encode("utf-8")).decode("ascii"))
    code.add("gh_string", "Title", metadata["name"])
    language = code.child("LanguageSpec")
    language.add("gh_string", "Taxon", "*.*.python").add("gh_string", "Version", "3.*")


def code_of(chunk: Chunk) -> str | None:
    """The code of a stored script component of either form; None if the chunk is none."""
    items = {item.name: item.value for item in chunk.items}
    if "CodeInput" in items:
        return str(items["CodeInput"])
    if any(child.name == "Script" for child in chunk.chunks):
        return base64.b64decode(chunk.find("Script")["Text"]).decode("utf-8")
    return None


def parameter_guid(instance: UUID, side: str, name: str) -> UUID:
    """InstanceGuid of a parameter, the same in every build."""
    return uuid5(instance, f"{side} {name}")


def parameters(
    component: Component, instance: UUID, form: Form, sources: dict[str, list[UUID]] | None = None
) -> Chunk:
    """ParameterData. sources: per input, the outputs that are wired to it."""
    chunk = Chunk("ParameterData")
    chunk.add("gh_int32", "InputCount", len(component.inputs))
    chunk.add("gh_int32", "OutputCount", len(component.outputs))
    for i, spec in enumerate(component.inputs):
        chunk.add("gh_guid", "InputId", form.input, index=i)
        made = chunk.child("InputParam", i)
        _input(made, spec, instance, form, (sources or {}).get(spec["name"], []))
    for i, spec in enumerate(component.outputs):
        chunk.add("gh_guid", "OutputId", form.output, index=i)
        _output(chunk.child("OutputParam", i), spec, instance)
    return chunk


def _input(chunk: Chunk, spec: dict[str, Any], instance: UUID, form: Form, sources: list[UUID]) -> None:
    _parameter(chunk, spec, parameter_guid(instance, "input", spec["name"]), spec["optional"], len(sources))
    chunk.add("gh_bool", "AllowTreeAccess", True)
    if spec["scriptParamAccess"]:
        chunk.add("gh_int32", "Access", spec["scriptParamAccess"])
    chunk.add("gh_int32", "ScriptParamAccess", spec["scriptParamAccess"])
    chunk.add("gh_bool", "ShowTypeHints", True)
    chunk.add("gh_guid", "TypeHintID", form.hints[spec["typeHintID"]])
    chunk.add("gh_int32", "WireDisplay", 0)
    for k, source in enumerate(sources):
        chunk.add("gh_guid", "Source", source, index=k)


def _output(chunk: Chunk, spec: dict[str, Any], instance: UUID) -> None:
    _parameter(chunk, spec, parameter_guid(instance, "output", spec["name"]), False, 0)
    if spec.get("hidden"):
        chunk.add("gh_bool", "Hidden", True)


def _parameter(chunk: Chunk, spec: dict[str, Any], guid: UUID, optional: bool, sources: int) -> None:
    chunk.add("gh_string", "Description", spec["description"])
    chunk.add("gh_guid", "InstanceGuid", guid)
    chunk.add("gh_string", "Name", spec["name"])
    chunk.add("gh_string", "NickName", spec["nickname"])
    chunk.add("gh_bool", "Optional", optional)
    chunk.add("gh_bool", "ReverseData", False)
    chunk.add("gh_bool", "SimplifyData", False)
    chunk.add("gh_int32", "SourceCount", sources)
