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
from typing import Any, get_args
from uuid import UUID

import pytest

from grasshopper import archive, build, components, draw, icons, layout, network
from grasshopper.archive import Chunk
from grasshopper.components import FORMS, RHINO7, RHINO8, Component, Form
from hexwrap_solver.pattern.types import Kind

FOLDERS = components.folders()
NAMES = [
    "Bake", "BoundaryAngles", "Collect", "Domain", "Explore", "Lift", "Panels", "Pattern", "Send",
    "Singularities", "StartServer", "Support",
]  # fmt: skip


@pytest.fixture(params=FOLDERS, ids=lambda folder: folder.name)
def component(request: pytest.FixtureRequest) -> Component:
    return components.load(request.param)


@pytest.fixture(params=FORMS, ids=lambda form: form.name)
def form(request: pytest.FixtureRequest) -> Form:
    return request.param  # type: ignore[no-any-return]


def inner(component: Component, form: Form) -> tuple[Chunk, Chunk]:
    outer = archive.inflate((build.DIST / form.name / f"hexwrap-{component.folder}.ghuser").read_bytes())
    return outer, archive.inflate(outer["Object"])


def test_all_components_are_there(form: Form) -> None:
    assert [folder.name for folder in FOLDERS] == NAMES
    found = sorted(path.stem for path in (build.DIST / form.name).glob("*.ghuser"))
    assert found == [f"hexwrap-{n}" for n in NAMES]


def plain(name: str, data: bytes) -> Any:
    """A built file without its compression, which differs between versions of zlib."""
    if name.endswith(".ghuser"):
        outer = archive.inflate(data)
        items = {(i.name, i.index): i.value for i in outer.items if i.name not in ("Object", "Icon")}
        return items, unpacked_icons(archive.inflate(outer["Object"])), pixels(outer["Icon"])
    if name.endswith(".yak"):
        with zipfile.ZipFile(io.BytesIO(data)) as package:
            return {n: plain(n, package.read(n)) for n in package.namelist()}
    if name.endswith(".gh"):
        return unpacked_icons(archive.inflate(data))
    return data


def unpacked_icons(chunk: Chunk) -> Any:
    """A tree with the pixels of its pictures in place of their files."""
    items = [
        (i.name, i.index, i.type, pixels(i.value) if i.type == "gh_drawing_bitmap" else i.value)
        for i in chunk.items
    ]
    return chunk.name, chunk.index, items, [unpacked_icons(child) for child in chunk.chunks]


def pixels(png: bytes) -> tuple[bytes, bytes]:
    """Header and unpacked scan lines of a PNG with one IDAT chunk."""
    start = png.index(b"IDAT") + 4
    return png[: start - 8], zlib.decompress(png[start : png.index(b"IEND") - 8])


def test_committed_files_are_what_the_sources_make() -> None:
    fresh = build.built()
    assert sorted(fresh) == sorted(
        path.relative_to(build.DIST).as_posix() for path in build.DIST.rglob("*.*")
    )
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
        assert all(spec["typeHintID"] in form.hints for form in FORMS)
        assert spec["scriptParamAccess"] in (0, 1)
    names = [spec["name"] for spec in component.inputs + component.outputs]
    assert len(set(names)) == len(names)


def test_guids_are_unique() -> None:
    loaded = [components.load(folder) for folder in FOLDERS]
    guids = [component.guid(form) for component in loaded for form in FORMS]
    for component in loaded:
        for form in FORMS:
            data = inner(component, form)[1].find("ParameterData")
            guids += [chunk["InstanceGuid"] for chunk in data.chunks]
    assert len(set(guids)) == len(guids)


def test_built_parameters_agree_with_the_metadata(component: Component, form: Form) -> None:
    outer, chunk = inner(component, form)
    assert outer["Name"] == chunk["Name"] == component.metadata["name"]
    assert outer["BaseID"] == form.base
    assert outer["InstanceGuid"] == component.guid(form)
    assert pixels(chunk["IconOverride"]) == pixels(component.icon)
    if form is RHINO7:
        assert chunk["HideOutput"] is True
    else:
        assert chunk["UsingStandardOutputParam"] is False
        language = chunk.find("Script", "LanguageSpec")
        assert (language["Taxon"], language["Version"]) == ("*.*.python", "3.*")
    data = chunk.find("ParameterData")
    assert data["InputCount"] == len(component.inputs)
    assert data["OutputCount"] == len(component.outputs)
    for i, spec in enumerate(component.inputs):
        parameter = data.find(("InputParam", i))
        assert data["InputId", i] == form.input
        assert parameter["Name"] == parameter["NickName"] == spec["name"]
        assert parameter["Description"] == spec["description"]
        assert parameter["TypeHintID"] == form.hints[spec["typeHintID"]]
        assert parameter["ScriptParamAccess"] == spec["scriptParamAccess"]
        if spec["scriptParamAccess"]:
            assert parameter["Access"] == spec["scriptParamAccess"]
    for i, spec in enumerate(component.outputs):
        assert data["OutputId", i] == form.output
        parameter = data.find(("OutputParam", i))
        assert parameter["NickName"] == spec["name"]
        assert ("Hidden" in {item.name for item in parameter.items}) == spec.get("hidden", False)


def test_geometry_comes_as_what_the_code_takes() -> None:
    """A wired circle, line or surface is a structure unless the hint makes a curve or mesh of it."""
    hints = {
        (folder.name, spec["name"]): spec["typeHintID"]
        for folder in FOLDERS
        for spec in components.load(folder).inputs
    }
    assert hints["Lift", "Curves"] == "curve"
    assert hints["BoundaryAngles", "Mesh"] == "mesh"
    assert hints["BoundaryAngles", "Points"] == hints["Singularities", "Points"] == "point"


def test_code_reads_its_inputs_and_sets_its_outputs(component: Component) -> None:
    code = (components.SOURCE / component.folder / "code.py").read_text(encoding="utf-8")
    for spec in component.inputs:
        assert re.search(rf"\b{spec['name']}\b", code), f"the input {spec['name']} is never read"
    stored = {
        node.id
        for statement in ast.parse(component.code).body  # where GhPython looks: at the module's own level
        if isinstance(statement, ast.Assign)
        for node in ast.walk(statement)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }
    assert {spec["name"] for spec in component.outputs} <= stored


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


def test_code_is_whole_and_plain(component: Component, form: Form) -> None:
    code = components.code_of(inner(component, form)[1])
    assert code is not None
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


def test_the_package_holds_every_file(form: Form) -> None:
    """Named as Rhino's package manager names what is for one version of Rhino and for any system."""
    with zipfile.ZipFile(build.DIST / f"hexwrap-{build.version()}-{form.yak}.yak") as package:
        names = package.namelist()
        manifest = package.read("manifest.yml").decode()
        for name in names[1:]:
            assert package.read(name) == (build.DIST / form.name / name).read_bytes()
    assert names[0] == "manifest.yml"
    assert len(names) == 1 + len(NAMES) + len(network.EXAMPLES)
    assert f"version: {build.version()}" in manifest
    for field in ("name: hexwrap", "authors:", "description:", "keywords:"):
        assert field in manifest
    assert {f.yak for f in FORMS} == {"rh7_0-any", "rh8_0-any"}


# --- the examples ----------------------------------------------------------------------------------------


@pytest.fixture(params=[example.name for example in network.EXAMPLES])
def objects(request: pytest.FixtureRequest, form: Form) -> list[Chunk]:
    root = archive.inflate((build.DIST / form.name / f"hexwrap-{request.param}.gh").read_bytes())
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
            alone = chunk is container and components.code_of(chunk) is None
            if chunk.name == "OutputParam" or alone:
                starts[chunk["InstanceGuid"]] = chunk["NickName"]
            sources = [item.value for item in chunk.items if item.name == "Source"]
            if "SourceCount" in names:
                assert chunk["SourceCount"] == len(sources)
            wires += [(source, chunk["Name"]) for source in sources]
    named = {(starts[source], end) for source, end in wires}  # KeyError: a wire from nowhere
    for wire in [
        ("Mesh", "Mesh"), ("Run", "Run"), ("Angles", "Angles"), ("Pattern", "Pattern"), ("Panels", "Panels"),
        ("IP", "IP"), ("Port", "Port"), ("Job", "Job"), ("Start", "Start"), ("Points", "Points"),
        ("Singularities", "Singularities"), ("Shapes", "Geometry"), ("ShapeColours", "Material"),
        ("Bake", "Bake"), ("Sizes", "Sizes"),
    ]:  # fmt: skip
        assert wire in named


def placed(objects: list[Chunk]) -> dict[UUID, tuple[str, layout.Box]]:
    """Each object's name and the box in which Grasshopper draws it, which follows from its Pivot."""
    found = {}
    for thing in objects:
        container = thing.find("Container")
        if thing["Name"] != "Group":
            found[container["InstanceGuid"]] = container["NickName"], draw.place(thing["Name"], container)
    return found


def test_example_objects_do_not_overlap_where_grasshopper_draws_them(objects: list[Chunk]) -> None:
    guids = [c["InstanceGuid"] for thing in objects for c in thing.walk() if c.name == "Container"]
    assert len(set(guids)) == len(guids)
    boxes = list(placed(objects).values())
    assert len(boxes) > 25
    for i, (name, box) in enumerate(boxes):
        for other, another in boxes[:i]:
            assert not layout.overlap(box, another), f"{name} lies on {other}"


def test_groups_hold_their_own_and_nothing_else(objects: list[Chunk]) -> None:
    boxes = placed(objects)
    for thing in objects:
        if thing["Name"] == "Group":
            container = thing.find("Container")
            own = {container["ID", k] for k in range(container["ID_Count"])}
            x0 = min(boxes[guid][1][0] for guid in own)
            y0 = min(boxes[guid][1][1] for guid in own)
            x1 = max(boxes[guid][1][0] + boxes[guid][1][2] for guid in own)
            y1 = max(boxes[guid][1][1] + boxes[guid][1][3] for guid in own)
            for guid, (name, box) in boxes.items():
                frame = (x0, y0, x1 - x0, y1 - y0)
                assert guid in own or not layout.overlap(box, frame), (
                    f"{name} lies in {container['NickName']}"
                )


def test_pivots_mean_what_grasshopper_takes_them_for(objects: list[Chunk]) -> None:
    """The corner of panels, sliders and toggles; the drop-down of a Value List; the icon of a component."""
    kinds = set()
    for thing in objects:
        container = thing.find("Container")
        if thing["Name"] == "Group":
            continue
        kept = container.find("Attributes")
        (x, y, w, h), (px, py) = kept["Bounds"], kept["Pivot"]
        kinds.add(thing["Name"])
        assert draw.place(thing["Name"], container) == pytest.approx((x, y, w, h)), thing["Name"]
        if thing["Name"] in ("Panel", "Number Slider", "Boolean Toggle", "Button"):
            assert (px, py) == (x, y)
        elif thing["Name"] == "Value List":
            assert py == y
            assert x + 10 < px < x + w - 60
        elif components.code_of(container) is not None:
            inputs = [c for c in container.find("ParameterData").chunks if c.name == "InputParam"]
            edge = max(c.find("Attributes")["Bounds"][0] + c.find("Attributes")["Bounds"][2] for c in inputs)
            assert edge <= px <= edge + 24
            assert py == pytest.approx(y + h / 2)
        else:
            assert x < px < x + w
            assert py == pytest.approx(y + h / 2)
    assert {"Panel", "Number Slider", "Boolean Toggle", "Value List", "Mesh", "Point"} <= kinds


def test_panels_have_margins_and_components_their_icons(objects: list[Chunk]) -> None:
    for thing in objects:
        container = thing.find("Container")
        if thing["Name"] == "Panel":
            place = container.find("Attributes")
            assert [place[name] for name in ("MarginLeft", "MarginRight", "MarginTop")] == [0, 0, 0]
        elif components.code_of(container) is not None:
            assert container["IconOverride"][:8] == b"\x89PNG\r\n\x1a\n"


def test_pictures_are_drawn_from_the_examples() -> None:
    said = (draw.ROOT / "docs" / "grasshopper.md").read_text(encoding="utf-8")
    for source, target in draw.PICTURES.items():
        drawn = draw.picture(archive.inflate(source.read_bytes()))
        assert target.read_text(encoding="utf-8") == drawn, "run 'python grasshopper/draw.py'"
    assert "grasshopper.svg" in said


def test_examples_hold_the_components_of_the_figure_and_more(objects: list[Chunk], form: Form) -> None:
    code = {thing["Name"]: components.code_of(thing.find("Container")) for thing in objects}
    wanted = {"Send", "Collect", "Boundary Angles", "Domain", "Singularities", "Bake", "Start Server"}
    assert {f"hexwrap {name}" for name in wanted} <= set(code)
    assert "Custom Preview" in code
    for folder in FOLDERS:
        component = components.load(folder)
        if component.metadata["name"] in code:
            assert code[component.metadata["name"]] == component.code
    kinds = {thing["GUID"] for thing in objects if thing["Name"].startswith("hexwrap")}
    assert kinds == {form.base}
    assert RHINO7.base != RHINO8.base


def test_metadata_files_are_plain_json() -> None:
    for folder in FOLDERS:
        assert json.loads((folder / "metadata.json").read_text(encoding="ascii"))


def test_all_kinds_of_patterns_are_offered() -> None:
    assert components.offered("Pattern", "KINDS") == get_args(Kind)
