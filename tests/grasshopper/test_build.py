"""Sources, metadata and built files say the same, and the files are what the sources make now."""

import ast
import io
import json
import re
import shutil
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path
from typing import Any
from uuid import UUID

import pytest

from grasshopper import archive, build, components, draw, icons
from grasshopper.archive import Chunk
from grasshopper.components import Component

FOLDERS = components.folders()
NAMES = [
    "BoundaryAngles", "Collect", "Domain", "Lift", "Panels", "Pattern", "Send", "StartServer", "Support"
]  # fmt: skip
HINTS = {
    "none": "35915213-5534-4277-81b8-1bdc9e7383d2",
    "float": "39fbc626-7a01-46ab-a18e-ec1c0c41685b",
    "bool": "d60527f5-b5af-4ef6-8970-5f96fe412559",
    "int": "48d01794-d3d8-4aef-990e-127168822244",
    "str": "37261734-eec7-4f50-b6a8-b8d1f3c4396b",
}


@pytest.fixture(params=FOLDERS, ids=lambda folder: folder.name)
def component(request: pytest.FixtureRequest) -> Component:
    return components.load(request.param)


def inner(component: Component) -> tuple[Chunk, Chunk]:
    outer = archive.inflate((build.DIST / f"hexwrap-{component.folder}.ghuser").read_bytes())
    return outer, archive.inflate(outer["Object"])


def test_all_components_are_there() -> None:
    assert [folder.name for folder in FOLDERS] == NAMES
    assert sorted(path.stem for path in build.DIST.glob("*.ghuser")) == [f"hexwrap-{n}" for n in NAMES]


def plain(name: str, data: bytes) -> Any:
    """A built file without its compression, which differs between versions of zlib."""
    if name.endswith(".ghuser"):
        outer = archive.inflate(data)
        items = {(i.name, i.index): i.value for i in outer.items if i.name not in ("Object", "Icon")}
        return items, archive.to_binary(archive.inflate(outer["Object"])), pixels(outer["Icon"])
    if name.endswith(".yak"):
        with zipfile.ZipFile(io.BytesIO(data)) as package:
            return {n: plain(n, package.read(n)) for n in package.namelist()}
    return data


def pixels(png: bytes) -> tuple[bytes, bytes]:
    """Header and unpacked scan lines of a PNG with one IDAT chunk."""
    start = png.index(b"IDAT") + 4
    return png[: start - 8], zlib.decompress(png[start : png.index(b"IEND") - 8])


def test_committed_files_are_what_the_sources_make() -> None:
    fresh = build.built()
    assert sorted(fresh) == sorted(path.name for path in build.DIST.iterdir())
    for name, data in fresh.items():
        assert plain(name, (build.DIST / name).read_bytes()) == plain(name, data), (
            f"{name} is out of date: run 'python grasshopper/build.py'"
        )


def test_icons_are_what_their_script_draws(component: Component) -> None:
    assert pixels(component.icon) == pixels(icons.icon(component.folder))
    assert component.icon[:8] == b"\x89PNG\r\n\x1a\n"
    assert component.icon[16:24] == bytes([0, 0, 0, 24, 0, 0, 0, 24])


def test_no_two_icons_are_alike() -> None:
    assert len({pixels(components.load(folder).icon) for folder in FOLDERS}) == len(FOLDERS)


def test_icons_for_unknown_components_are_refused() -> None:
    with pytest.raises(KeyError):
        icons.icon("Unheard")


def test_metadata_is_complete(component: Component) -> None:
    metadata = component.metadata
    assert metadata["category"] == "hexwrap"
    assert metadata["exposure"] in (2, 4, 8)
    assert len(metadata["description"]) > 40
    UUID(metadata["instanceGuid"])
    for spec in component.inputs + component.outputs:
        # GhPython takes the nickname for the variable's name and the name from the nickname.
        assert spec["name"] == spec["nickname"]
        assert re.fullmatch(r"[A-Z][A-Za-z]*", spec["name"])
        assert spec["description"].endswith(".")
        assert len(spec["description"]) > 8
    for spec in component.inputs:
        assert spec["typeHintID"] in HINTS.values()
        assert spec["scriptParamAccess"] in (0, 1)
    names = [spec["name"] for spec in component.inputs + component.outputs]
    assert len(set(names)) == len(names)


def test_guids_are_unique() -> None:
    loaded = [components.load(folder) for folder in FOLDERS]
    guids = [component.guid for component in loaded]
    for component in loaded:
        data = inner(component)[1].find("ParameterData")
        guids += [chunk["InstanceGuid"] for chunk in data.chunks]
    assert len(set(guids)) == len(guids)


def test_built_parameters_agree_with_the_metadata(component: Component) -> None:
    outer, chunk = inner(component)
    assert outer["Name"] == chunk["Name"] == component.metadata["name"]
    assert outer["BaseID"] == UUID("410755b1-224a-4c1e-a407-bf32fb45ea7e")
    assert outer["InstanceGuid"] == component.guid
    assert chunk["HideOutput"] is True
    data = chunk.find("ParameterData")
    assert data["InputCount"] == len(component.inputs)
    assert data["OutputCount"] == len(component.outputs)
    for i, spec in enumerate(component.inputs):
        parameter = data.find(("InputParam", i))
        assert data["InputId", i] == components.INPUT_ID
        assert parameter["NickName"] == spec["name"]
        assert parameter["Description"] == spec["description"]
        assert parameter["TypeHintID"] == UUID(spec["typeHintID"])
        assert parameter["ScriptParamAccess"] == spec["scriptParamAccess"]
        if spec["scriptParamAccess"]:
            assert parameter["Access"] == spec["scriptParamAccess"]
    for i, spec in enumerate(component.outputs):
        assert data["OutputId", i] == components.OUTPUT_ID
        assert data.find(("OutputParam", i))["NickName"] == spec["name"]


def test_code_reads_its_inputs_and_sets_its_outputs(component: Component) -> None:
    code = (components.SOURCE / component.folder / "code.py").read_text(encoding="utf-8")
    for spec in component.inputs:
        assert re.search(rf"\b{spec['name']}\b", code), f"the input {spec['name']} is never read"
    for spec in component.outputs:
        assert re.search(rf"^(?:.*, )?{spec['name']}\b.* = ", code, re.MULTILINE), (
            f"{spec['name']} is never set"
        )


def test_code_does_not_overwrite_its_inputs(component: Component) -> None:
    bound = set()
    for node in ast.walk(ast.parse(component.code)):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                bound.add(name)
            case ast.Name(id=name, ctx=ast.Store()):
                bound.add(name)
            case ast.Import(names=names) | ast.ImportFrom(names=names):
                bound |= {alias.asname or alias.name for alias in names}
    assert not bound & {spec["name"] for spec in component.inputs}


def test_code_is_whole_and_plain(component: Component) -> None:
    code = inner(component)[1]["CodeInput"]
    assert code == component.code
    assert code.isascii()  # GhPython compiles text, in which a coding line would be an error
    assert "# include:" not in code
    assert "hexwrap_s" not in code  # nothing of the server or the solver is imported


def test_unknown_shared_files_are_refused() -> None:
    with pytest.raises(FileNotFoundError):
        components.complete("# include: unheard\n")


def test_code_runs_on_python_2_and_3(component: Component, tmp_path: Path) -> None:
    path = tmp_path / f"{component.folder}.py"
    path.write_text(component.code, encoding="ascii")
    vermin = shutil.which("vermin", path=str(Path(sys.executable).parent)) or shutil.which("vermin")
    assert vermin, "vermin belongs to the test extra"
    done = subprocess.run(
        [vermin, "-t=2.7-", "-t=3.9-", "--violations", "--eval-annotations", str(path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_the_package_holds_every_file() -> None:
    with zipfile.ZipFile(build.DIST / "hexwrap.yak") as package:
        names = package.namelist()
        manifest = package.read("manifest.yml").decode()
        assert all(
            package.read(name) == (build.DIST / name).read_bytes() for name in names if name != "manifest.yml"
        )
    assert names[0] == "manifest.yml"
    assert len(names) == len(NAMES) + 2
    assert f"version: {build.version()}" in manifest
    for field in ("name: hexwrap", "authors:", "description:", "keywords:"):
        assert field in manifest


# --- the example -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def objects() -> list[Chunk]:
    root = archive.from_xml((build.DIST / "hexwrap-example.ghx").read_text(encoding="utf-8"))
    found = root.find("Definition", "DefinitionObjects")
    assert found["ObjectCount"] == len(found.chunks)
    return found.chunks


def test_example_wires_start_at_parameters_that_are_there(objects: list[Chunk]) -> None:
    starts: dict[UUID, str] = {}
    wires: list[tuple[UUID, str]] = []
    for thing in objects:
        container = thing.find("Container")
        for chunk in container.walk():
            names = {item.name for item in chunk.items}
            if chunk.name == "OutputParam" or (chunk is container and "CodeInput" not in names):
                starts[chunk["InstanceGuid"]] = chunk["NickName"]
            sources = [item.value for item in chunk.items if item.name == "Source"]
            if "SourceCount" in names:
                assert chunk["SourceCount"] == len(sources)
            wires += [(source, chunk["NickName"]) for source in sources]
    assert len(wires) >= 17
    named = {(starts[source], end) for source, end in wires}  # KeyError: a wire from nowhere
    for wire in [
        ("Mesh", "Mesh"), ("Run", "Run"), ("Angles", "Angles"), ("Pattern", "Pattern"), ("Panels", "Panels"),
        ("Job", "Job"), ("Report", "Report"), ("Start", "Start"), ("Corners", "Points"), ("Sizes", "Sizes"),
    ]:  # fmt: skip
        assert wire in named


def test_example_objects_have_names_of_their_own_and_do_not_overlap(objects: list[Chunk]) -> None:
    guids = [c["InstanceGuid"] for thing in objects for c in thing.walk() if c.name == "Container"]
    assert len(set(guids)) == len(guids)
    boxes = []
    for thing in objects:
        place = thing.find("Container", "Attributes")
        if place.items:
            boxes.append((thing.find("Container")["NickName"], place["Bounds"]))
    for i, (name, (x, y, w, h)) in enumerate(boxes):
        for other, (a, b, c, d) in boxes[:i]:
            assert x >= a + c or a >= x + w or y >= b + d or b >= y + h, f"{name} lies on {other}"


def test_picture_in_the_readme_is_drawn_from_the_example() -> None:
    drawn = draw.picture(archive.from_xml(draw.EXAMPLE.read_text(encoding="utf-8")))
    assert draw.PICTURE.read_text(encoding="utf-8") == drawn, "run 'python grasshopper/draw.py'"
    assert "docs/grasshopper.svg" in (draw.ROOT / "README.md").read_text(encoding="utf-8")


def test_example_holds_every_component_of_the_figure(objects: list[Chunk]) -> None:
    names = {thing["Name"] for thing in objects}
    assert {"hexwrap Send", "hexwrap Collect", "hexwrap Boundary Angles", "hexwrap Domain"} <= names
    code = {
        thing["Name"]: thing.find("Container")["CodeInput"] for thing in objects if "hexwrap" in thing["Name"]
    }
    for folder in FOLDERS:
        component = components.load(folder)
        if component.metadata["name"] in code:
            assert code[component.metadata["name"]] == component.code


def test_metadata_files_are_plain_json() -> None:
    for folder in FOLDERS:
        assert json.loads((folder / "metadata.json").read_text(encoding="ascii"))
