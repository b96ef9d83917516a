"""Every file is read back by a program that did not write it, and says what the arrays say."""

from __future__ import annotations

import csv
import io
import json
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
import rhino3dm
import trimesh
from matplotlib.image import imread

from hexwrap_server.cli import main as cli
from hexwrap_server.errors import NotMadeError, SheetError
from hexwrap_server.http import routes
from hexwrap_server.input.bodies import Body
from hexwrap_server.jobs import reading
from hexwrap_server.output import scene, text
from hexwrap_server.output.dxf import object_coordinates
from hexwrap_server.output.flat import lay_flat, pack
from hexwrap_server.output.unrolled import Unrolled
from hexwrap_server.output.wire import result_json
from hexwrap_server.output.writers import WRITERS, Meta, write
from hexwrap_server.settings import Settings
from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.panels import make_components
from hexwrap_solver.panels.types import ComponentSettings, Support
from hexwrap_solver.pipeline import Solution
from hexwrap_solver.surface.types import Origin
from tests.server.analytic import cylinder
from tests.solver.pattern import nets

ODD = Meta("Türme 塔 <&\"'> \n$x^2$")
NEEDS_PANELS = [
    "panels.obj", "panels.3dm", "panels.dxf", "panels.csv", "panels.ifc", "panels.glb", "cutting-list.csv",
    "flat.dxf", "panels.png",
]  # fmt: skip


@pytest.fixture(scope="module")
def solution() -> Solution:
    return cylinder()


@pytest.fixture
def small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"HEIGHT": 400, "WIDTH": 420, "MARGIN": 20, "FINE": 1, "SUN_MAP": 300}.items():
        monkeypatch.setattr(scene, name, value)


def test_server_page_and_command_line_know_the_same_files() -> None:
    assert list(routes.FILES) == list(WRITERS)
    source = Path(__file__).parents[2] / "server" / "viewer" / "src" / "api.ts"
    listed = re.search(r"export const FILES = \[(.*?)\]", source.read_text(encoding="utf-8"), re.DOTALL)
    assert listed
    assert re.findall(r'"([^"]+)"', listed[1]) == list(WRITERS)
    assert {cli.file_kind(f"x{kind}") for kind in cli.kinds()} == WRITERS.keys()


def panels_of(solution: Solution) -> np.ndarray:
    assert solution.panels is not None
    return np.asarray(solution.panels.polygons.values).reshape(-1, 6, 3)


def labels_of(solution: Solution) -> list[str]:
    assert solution.pattern is not None
    return solution.pattern.labels()


def read_dxf(data: bytes) -> ezdxf.document.Drawing:
    document = ezdxf.read(io.StringIO(data.decode()))
    assert not document.audit().errors
    return document


def test_names_are_the_contracts() -> None:
    assert set(WRITERS) == {*NEEDS_PANELS, "domain.svg", "domain.dxf", "result.json", "result.npz"}


@pytest.mark.usefixtures("small_pictures")
@pytest.mark.parametrize("name", WRITERS)
def test_any_name_of_a_job_is_written(solution: Solution, name: str) -> None:
    assert len(write(name, solution, ODD)) > 300


@pytest.mark.parametrize("name", NEEDS_PANELS)
def test_missing_stages_are_told(solution: Solution, name: str) -> None:
    with pytest.raises(NotMadeError, match=r'"pattern": null'):
        write(name, replace(solution, pattern=None, panels=None), ODD)
    with pytest.raises(NotMadeError, match=r'"panels": null'):
        write(name, replace(solution, panels=None), ODD)


@pytest.mark.parametrize("name", NEEDS_PANELS)
def test_a_pattern_without_a_panel_is_told(solution: Solution, name: str) -> None:
    assert solution.panels is not None
    nothing = Ragged(np.zeros((0, 3)), np.zeros(1, dtype=int))
    none = replace(solution, panels=replace(solution.panels, polygons=nothing))
    with pytest.raises(NotMadeError, match="no cell of the pattern became one"):
        write(name, none, ODD)


@pytest.mark.parametrize("name", ["domain.svg", "domain.dxf", "result.npz", "result.json"])
def test_other_files_need_only_the_map(solution: Solution, name: str) -> None:
    for less in (replace(solution, pattern=None, panels=None), replace(solution, panels=None)):
        assert len(write(name, less, ODD)) > 500


def test_obj_holds_every_panel_under_its_label(solution: Solution) -> None:
    lines = write("panels.obj", solution, ODD).decode().splitlines()
    vertices = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)
    faces = {}
    for name, face in pairwise(lines):
        if name.startswith("o "):
            faces[name[2:]] = vertices[np.array(face.split()[1:], dtype=int) - 1]
    assert sorted(faces) == sorted(labels_of(solution))
    ordered = np.array([faces[label] for label in labels_of(solution)])
    assert ordered == pytest.approx(panels_of(solution), rel=1e-14)
    assert [line for line in lines if line.startswith("g ")] == ["g size-00", "g size-01", "g size-02"]


def test_obj_is_read_by_trimesh(solution: Solution) -> None:
    mesh = trimesh.load(io.BytesIO(write("panels.obj", solution, ODD)), file_type="obj", force="mesh")
    assert solution.panels is not None
    assert mesh.area == pytest.approx(float(np.sum(1.5 * np.sqrt(3) * solution.panels.edge_length**2)))


def test_csv_reads_back_to_the_last_digit(solution: Solution) -> None:
    rows = list(csv.DictReader(io.StringIO(write("panels.csv", solution, ODD).decode(), newline="")))
    assert solution.panels is not None
    assert [row["label"] for row in rows] == labels_of(solution)
    assert [float(row["edge_length"]) for row in rows] == solution.panels.edge_length.tolist()
    for axis, letter in enumerate("xyz"):
        assert [float(row[f"center_{letter}"]) for row in rows] == solution.panels.center[:, axis].tolist()


def test_csv_neighbours_name_each_other(solution: Solution) -> None:
    rows = csv.DictReader(io.StringIO(write("panels.csv", solution, ODD).decode(), newline=""))
    names = {row["label"]: row["neighbours"].split() for row in rows}
    for label, around in names.items():
        assert len(around) == 6
        assert all(label in names[other] for other in around if other != "-")
    inner = [around for label, around in names.items() if label[:3] not in ("R00", "R04")]
    assert all("-" not in around for around in inner)


def test_csv_leaves_empty_what_was_not_measured(solution: Solution) -> None:
    assert solution.quality.planarity is not None
    unknown = solution.quality.planarity.copy()
    unknown[0] = np.nan
    less = replace(solution, quality=replace(solution.quality, planarity=unknown, surface_distance=None))
    rows = list(csv.DictReader(io.StringIO(write("panels.csv", less, ODD).decode(), newline="")))
    assert rows[0]["planarity"] == ""
    assert rows[1]["planarity"] == "0.0"
    assert all(row["surface_distance"] == "" for row in rows)


def test_3dm_has_a_coloured_layer_per_size_and_data_on_every_panel(solution: Solution) -> None:
    model = rhino3dm.File3dm.FromByteArray(write("panels.3dm", solution, ODD))
    layers = {layer.Index: layer for layer in model.Layers}
    names = [layer.Name for layer in layers.values()]
    assert names == [
        "panels",
        "size-00 (0.8600)",
        "size-01 (0.8800)",
        "size-02 (0.9000)",
        "labels",
        "surface",
    ]
    assert len({layer.Color for layer in layers.values() if layer.Name.startswith("size")}) == 3
    curves = [o for o in model.Objects if o.Geometry.ObjectType == rhino3dm.ObjectType.Curve]
    assert [o.Attributes.Name for o in curves] == labels_of(solution)
    for item, polygon in zip(curves, panels_of(solution), strict=True):
        points = np.array([[p.X, p.Y, p.Z] for p in item.Geometry.ToPolyline()])
        assert item.Geometry.IsClosed
        assert points[:-1] == pytest.approx(polygon, abs=1e-12)
        assert item.Attributes.GetUserString("label") == item.Attributes.Name
        assert layers[item.Attributes.LayerIndex].Name.startswith(
            f"size-{int(item.Attributes.GetUserString('size')):02d}"
        )
    dots = [o for o in model.Objects if o.Geometry.ObjectType == rhino3dm.ObjectType.TextDot]
    assert [o.Geometry.Text for o in dots] == labels_of(solution)


def named(solution: Solution, unit: str | None) -> Solution:
    """The same, as if it came from a Rhino file."""
    origin = Origin("tower", "Facade::Outer", (("material", "glass"),), 0.02)
    surface = replace(solution.map.surface, unit=unit, origin=origin)
    return replace(solution, map=replace(solution.map, surface=surface))


def test_what_came_in_goes_out(solution: Solution) -> None:
    """Unit, layers, name and user strings of the source, and the source itself, exact far from the origin."""
    made = named(solution, "mm")
    far = replace(made.map.surface, vertices=made.map.surface.vertices + 5e6)
    made = replace(made, map=replace(made.map, surface=far))
    model = rhino3dm.File3dm.FromByteArray(write("panels.3dm", made, ODD))
    assert model.Settings.ModelUnitSystem == rhino3dm.UnitSystem.Millimeters
    assert model.Settings.ModelAbsoluteTolerance == 0.02
    paths = {layer.Index: layer.FullPath for layer in model.Layers}
    assert "Facade::Outer::panels" in paths.values()
    panels = [o for o in model.Objects if o.Geometry.ObjectType == rhino3dm.ObjectType.Curve]
    for item in panels:
        assert paths[item.Attributes.LayerIndex].startswith("Facade::Outer::panels::size")
        assert item.Attributes.GetUserString("material") == "glass"
        assert item.Attributes.GetUserString("source") == "tower"
        assert item.Attributes.GroupCount == 1
    assert [group.Name for group in model.Groups] == ["tower panels"]
    (surface,) = [o for o in model.Objects if o.Geometry.ObjectType == rhino3dm.ObjectType.Mesh]
    assert surface.Attributes.Name == "tower"
    assert surface.Attributes.GetUserString("material") == "glass"
    assert paths[surface.Attributes.LayerIndex] == "Facade::Outer::surface"
    points = [surface.Geometry.Vertices.Point3dAt(i) for i in range(len(surface.Geometry.Vertices))]
    assert [[p.X, p.Y, p.Z] for p in points] == far.vertices.tolist()


@pytest.mark.parametrize(("unit", "code"), [("m", 6), ("mm", 4), ("ft", 2), ("in", 1), ("cm", 5), (None, 0)])
def test_units_in_drawings_tables_and_arrays(solution: Solution, unit: str | None, code: int) -> None:
    made = named(solution, unit)
    for name in ("panels.dxf", "flat.dxf"):
        assert f"$INSUNITS\n 70\n{code}\n" in write(name, made, ODD).decode().replace("\r\n", "\n")
    heading = write("panels.csv", made, ODD).decode().splitlines()[0]
    assert ("edge_length [" in heading) == (unit is not None)
    assert f"edge_length [{unit}]" in heading or unit is None
    assert "planarity," in heading  # a ratio
    assert json.loads(write("result.json", made, ODD))["unit"] == unit
    assert str(np.load(io.BytesIO(write("result.npz", made, ODD)))["unit"]) == (unit or "")


def test_3dm_carries_blocks_and_support(solution: Solution) -> None:
    """A block per size with outline and body in the panel's own plane, and an instance for every panel."""
    assert solution.panels is not None
    panels = solution.panels
    built = make_components(panels, ComponentSettings(inset=0.02, thickness=0.05))
    strips = np.array([[[0, 0, 0], [1, 0, 0], [1, 0, -0.5], [0, 0, -0.5]]], dtype=float)
    support = Support(
        np.array([[0, 0, 0], [1.0, 0, 0]]), np.array([[0, 0, 1.0]] * 2), np.array([[0, 1]]), strips,
        np.zeros(1), np.zeros(2),
    )  # fmt: skip
    data = write("panels.3dm", replace(solution, components=built, support=support), ODD)
    model = rhino3dm.File3dm.FromByteArray(data)
    defined = list(model.InstanceDefinitions)
    assert [block.Name for block in defined] == ["size-00", "size-01", "size-02"]
    layers = {layer.Index: layer.FullPath for layer in model.Layers}
    things = {str(thing.Attributes.Id): thing for thing in model.Objects}
    outline, body = {}, {}
    for block in defined:
        parts = [things[str(key)].Geometry for key in block.GetObjectIds()]
        outline[str(block.Id)] = next(p for p in parts if isinstance(p, rhino3dm.PolylineCurve)).ToPolyline()
        body[str(block.Id)] = next(p for p in parts if isinstance(p, rhino3dm.Mesh))
    assert all(mesh.IsClosed for mesh in body.values())
    instances = [o for o in model.Objects if isinstance(o.Geometry, rhino3dm.InstanceReference)]
    assert [o.Attributes.Name for o in instances] == labels_of(solution)
    for row, thing in enumerate(instances):
        shown = outline[str(thing.Geometry.ParentIdefId)]
        points = [shown[k].Transform(thing.Geometry.Xform) for k in range(6)]
        corners = np.array([[p.X, p.Y, p.Z] for p in points])
        assert corners == pytest.approx(np.asarray(built.outline[row]), abs=1e-9)
        assert layers[thing.Attributes.LayerIndex].startswith(f"components::size-{panels.size[row]:02d}")
    lines = [o.Geometry for o in model.Objects if isinstance(o.Geometry, rhino3dm.LineCurve)]
    assert [line.PointAtEnd.Z for line in lines] == [-0.5, -0.5]


def test_dxf_in_space_has_the_panels_where_they_are(solution: Solution) -> None:
    document = read_dxf(write("panels.dxf", solution, ODD))
    lines = list(document.modelspace().query("POLYLINE"))
    assert all(line.is_closed and line.is_3d_polyline for line in lines)
    points = np.array([[v.dxf.location.xyz for v in line.vertices] for line in lines])
    assert points == pytest.approx(panels_of(solution), abs=1e-9)
    assert solution.panels is not None
    assert [line.dxf.layer[:7] for line in lines] == [f"size-{s:02d}" for s in solution.panels.size]


def test_dxf_labels_stand_at_the_centres(solution: Solution) -> None:
    document = read_dxf(write("panels.dxf", solution, ODD))
    assert solution.panels is not None
    texts = list(document.modelspace().query("TEXT"))
    assert [text.dxf.text for text in texts] == labels_of(solution)
    places = np.array([text.ocs().to_wcs(text.dxf.align_point).xyz for text in texts])
    assert places == pytest.approx(solution.panels.center, abs=1e-9)


def test_object_coordinates_agree_with_ezdxf_on_every_side() -> None:
    rng = np.random.default_rng(3)
    normals = np.vstack([rng.normal(size=(50, 3)), np.eye(3), -np.eye(3), [[0.01, 0.0, 1.0]]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = rng.normal(size=normals.shape)
    expected = [ezdxf.math.OCS(n).from_wcs(p).xyz for n, p in zip(normals.tolist(), points, strict=True)]
    assert object_coordinates(points, normals) == pytest.approx(np.array(expected), abs=1e-12)


def test_flat_outlines_are_congruent_to_the_panels_and_apart(solution: Solution) -> None:
    document = read_dxf(write("flat.dxf", solution, ODD))
    query = document.modelspace().query("LWPOLYLINE")
    outlines = np.array([line.get_points("xy") for line in query if line.dxf.layer.startswith("cut-")])
    assert solution.panels is not None
    radius = np.linalg.norm(outlines - outlines.mean(axis=1, keepdims=True), axis=2)
    assert radius == pytest.approx(np.repeat(solution.panels.edge_length[:, None], 6, 1), rel=1e-9)
    low, high = outlines.min(axis=1), outlines.max(axis=1)
    apart = np.any((low[:, None] > high) | (high[:, None] < low), axis=2)
    assert np.all(apart | np.eye(len(low), dtype=bool))
    sheets = np.array([line.get_points("xy") for line in query if line.dxf.layer == "sheets"])
    inside = np.all((low[:, None] > sheets.min(axis=1)) & (high[:, None] < sheets.max(axis=1)), axis=2)
    assert np.all(inside.sum(axis=1) == 1)


def test_flat_outlines_name_panel_size_and_neighbours(solution: Solution) -> None:
    document = read_dxf(write("flat.dxf", solution, ODD))
    words = [text.dxf.text for text in document.modelspace().query('TEXT[layer=="engrave-label"]')]
    assert words[::2] == labels_of(solution)
    assert words[1] == "00 / 0.8600"
    assert solution.pattern is not None
    neighbours = [text.dxf.text for text in document.modelspace().query('TEXT[layer=="engrave-neighbours"]')]
    across = np.asarray(solution.pattern.neighbours.values)
    assert neighbours == [labels_of(solution)[i] for i in across[across >= 0].tolist()]


def test_flat_outlines_are_seen_from_outside(solution: Solution) -> None:
    assert solution.panels is not None
    corners = np.asarray(lay_flat(solution.panels).corners.values).reshape(-1, 6, 2)
    z = corners[..., 0] + 1j * corners[..., 1]
    assert np.all(np.sum((np.conj(z) * np.roll(z, -1, axis=1)).imag, axis=1) > 0)
    assert z[:, 1] - z[:, 0] == pytest.approx(solution.panels.edge_length)


def test_sheets_that_are_too_small_are_told(solution: Solution) -> None:
    with pytest.raises(SheetError, match=r"60 panels are larger .* the first is R00-P000") as caught:
        write("flat.dxf", solution, Meta(sheet=(1.0, 1.0)))
    assert caught.value.data["panels"] == labels_of(solution)


def test_sheets_of_a_given_size_are_kept_to() -> None:
    extent = np.tile([2.0, 1.0], (7, 1))
    places = pack(extent, np.zeros(7, dtype=int), (4.5, 2.5), ["x"] * 7)
    assert places.sheet.tolist() == [0, 0, 0, 0, 1, 1, 1]
    assert np.all(places.corner + extent <= [4.5, 2.5])


def test_svg_draws_every_cell_once_in_one_piece(solution: Solution) -> None:
    root = ET.fromstring(write("domain.svg", solution, ODD))
    ns = {"s": "http://www.w3.org/2000/svg"}
    paths = {p.attrib["class"]: p.attrib["d"] for p in root.iterfind(".//s:path", ns)}
    cells = "".join(d for name, d in paths.items() if name.startswith("cells")).split("Z")[:-1]
    assert len(cells) == len(labels_of(solution))
    corners = np.array([[p.split() for p in cell[1:].split("L")] for cell in cells], dtype=float)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert sides == pytest.approx(np.full(sides.shape, sides.mean()), abs=0.02)
    assert {"mesh", "cut", "loop loop0", "loop loop1"} <= set(paths)
    assert [t.text for t in root.iterfind(".//s:text[@class='named halo']", ns)] == ["loop 0 →", "← loop 1"]
    words = " ".join(t.text or "" for t in root.iterfind(".//s:text", ns))
    assert "Türme 塔 <&\"'> $x^2$" in words
    assert "cylinder, circumference 18.00; 60 cells" in words


def test_svg_marks_corners_with_their_angles(solution: Solution) -> None:
    bottom = solution.map.boundary_angles[0].copy()
    bottom[[3, 5]] = 4 * np.pi / 3, np.pi / 3
    cornered = replace(solution.map, boundary_angles=(bottom, solution.map.boundary_angles[1]))
    root = ET.fromstring(write("domain.svg", replace(solution, map=cornered), ODD))
    ns = {"s": "http://www.w3.org/2000/svg"}
    assert [t.text for t in root.iterfind(".//s:text[@class='angle halo']", ns)] == ["4π/3", "π/3"]
    assert len(root.findall(".//s:circle[@class='corner']", ns)) == 2


def test_names_of_openings_cross_no_frame(solution: Solution) -> None:
    """Also where the cut reaches an opening, or splits it."""
    net = replace(solution, map=nets.tower(3), pattern=None, panels=None)
    root = ET.fromstring(write("domain.svg", net, ODD))
    ns = {"s": "http://www.w3.org/2000/svg"}
    sides = []
    for path in root.iterfind(".//s:path", ns):
        if path.attrib["class"].startswith("loop"):
            for line in path.attrib["d"].replace("Z", "").split("M")[1:]:
                z = np.array([point.split() for point in line.split("L")], dtype=float) @ [1, 1j]
                sides += [z[:-1] + t * np.diff(z) for t in np.linspace(0, 1, 9)]
    frame = np.concatenate(sides)
    names = root.findall(".//s:text[@class='named halo']", ns)
    assert len(names) == 5
    for name in names:
        size = float(name.attrib["style"].split(":")[1].removesuffix("px"))
        if "transform" in name.attrib:
            x, y, turn = map(float, re.findall(r"-?[\d.]+", name.attrib["transform"]))
        else:
            x, y, turn = float(name.attrib["x"]), float(name.attrib["y"]), 0.0
        local = (frame - (x + 1j * y)) * np.exp(-1j * np.deg2rad(turn))
        over = (abs(local.real) < 0.27 * size * len(name.text or "")) & (abs(local.imag) < 0.35 * size)
        assert not over.any(), name.text


def test_faces_laid_out_in_islands_are_cut_around_each(solution: Solution) -> None:
    """Faces may stand in any sheet: around islands of them the cut runs in circles."""
    faces = solution.map.surface.faces
    inner = np.setdiff1d(faces, np.concatenate(solution.map.surface.loops))
    island = (faces == inner[len(inner) // 2]).any(axis=1)
    beside = np.isin(faces, faces[island]).any(axis=1) & ~island
    sheet = solution.map.sheet + np.where(island, 2, np.where(beside, 1, 0))[:, None]
    cut = Unrolled.of(solution.map.with_domain(sheet=sheet)).cut
    assert len(np.unique(cut)) == len(cut)
    plain = Unrolled.of(solution.map).cut
    assert len(cut) > len(plain) + 2 * island.sum()
    assert b"<path" in write("domain.svg", replace(solution, map=solution.map.with_domain(sheet=sheet)), ODD)


def test_domain_dxf_is_the_domain_in_its_own_units(solution: Solution) -> None:
    bottom = solution.map.boundary_angles[0].copy()
    bottom[4] = np.pi / 3
    cornered = replace(solution.map, boundary_angles=(bottom, solution.map.boundary_angles[1]))
    space = read_dxf(write("domain.dxf", replace(solution, map=cornered), ODD)).modelspace()
    lines = {
        name: space.query(f'LWPOLYLINE[layer=="{name}"]') for name in ("loop-0", "loop-1", "cut", "pattern")
    }
    for number, height in enumerate((0.0, np.sqrt(3) * 5.5)):
        points = np.vstack([line.get_points("xy") for line in lines[f"loop-{number}"]])
        assert points[:, 1] == pytest.approx(np.full(len(points), height))
        assert np.ptp(points[:, 0]) == pytest.approx(solution.map.circumference)
    assert len(lines["pattern"]) == len(labels_of(solution))
    assert len(lines["cut"]) == 2
    (corner,) = space.query('POINT[layer=="corners"]')
    vertex = solution.map.uv[solution.map.surface.loops[0][4]]
    assert corner.dxf.location.xyz == pytest.approx((vertex.real, vertex.imag, 0.0))


def test_a_domain_that_overlaps_itself_is_drawn_apart(solution: Solution, monkeypatch: Any) -> None:
    surface, corners = solution.map.surface, solution.map.corners()
    middle = np.median(corners.imag)
    below = np.where(corners.imag.mean(axis=1) > middle, -1j * middle, 0)  # the upper half over the lower one
    folded = replace(solution.map, domain=Net.of_corners(corners + below[:, None], surface.twin))
    twofold = replace(solution, map=folded, pattern=replace(solution.pattern, sheet=None))
    assert b"drawn in 2 pieces" in write("domain.svg", twofold, ODD)
    assert b"pieces" not in write("domain.svg", solution, ODD)
    lines = read_dxf(write("domain.dxf", twofold, ODD)).modelspace()
    ends = [np.array(lines.query(f'LWPOLYLINE[layer=="loop-{n}"]').first.get_points("xy")) for n in (0, 1)]
    assert abs(ends[0].mean(axis=0) - ends[1].mean(axis=0)).max() > middle
    told = json.loads(result_json(twofold))
    assert told["map"]["apart"] is None  # clients need not know: the net that they get does not overlap
    places = np.array(told["map"]["corners"])
    turned = (corners + below[:, None] - places @ [1, 1j]).T
    assert np.allclose(turned, turned[0])  # each face is moved as a whole
    laid = solution.pattern
    moved = (places @ [1, 1j] - twofold.map.corners())[:, 0]
    uv, cell = np.array(told["pattern"]["uv"]) @ [1, 1j], np.array(told["pattern"]["corners"][0]) @ [1, 1j]
    assert np.allclose(uv - laid.uv, moved[laid.triangle])
    own = moved[laid.triangle[laid.faces.values[0]]]
    assert np.allclose(cell - laid.corners[: len(cell)], own)
    monkeypatch.setattr(reading, "solution_at", lambda path: twofold)
    points = surface.vertices[surface.faces].mean(axis=1)
    flat = carried("flatten", points)["uv"]
    assert np.allclose(carried("lift", flat)["points"], points, atol=1e-9)
    assert np.allclose(carried("lift", places.mean(axis=1))["points"], points, atol=1e-9)


def carried(what: str, points: Any) -> dict[str, Any]:
    """The answer of that route."""
    body = Body(json.dumps({"points": np.asarray(points).tolist()}).encode())
    return json.loads(getattr(reading, what)(lambda *_: None, body, Settings(), ""))


def test_npz_holds_the_arrays_themselves(solution: Solution) -> None:
    arrays = np.load(io.BytesIO(write("result.npz", solution, ODD)), allow_pickle=False)
    assert solution.panels is not None
    assert str(arrays["name"]) == ODD.name
    assert np.array_equal(arrays["panels.polygons.values"], solution.panels.polygons.values)
    assert np.array_equal(arrays["map.uv"][:, 0], solution.map.uv.real)
    assert np.array_equal(arrays["mesh.loops.1"], solution.map.surface.loops[1])


def test_picture_is_large_and_shows_every_size_and_white_around_it(solution: Solution) -> None:
    image = imread(io.BytesIO(write("panels.png", solution, ODD)))
    assert image.shape[0] >= 1600 or image.shape[1] >= 1600
    assert np.all(image[[0, 0, -1], [0, -1, -1], :3] > 0.99)
    hue = image[..., 0] - image[..., 2]
    assert hue.max() > 0.3  # the longest edges are red, the shortest blue
    assert hue.min() < -0.2


@pytest.mark.usefixtures("small_pictures")
@pytest.mark.parametrize("name", WRITERS)
def test_far_from_the_origin_nothing_is_lost(name: str) -> None:
    far = cylinder(around=6, rings=2, origin=(4.5e6, -5.4e6, 1e3))
    assert len(write(name, far, ODD)) > 300


@pytest.mark.usefixtures("small_pictures")
def test_pictures_far_from_the_origin_are_the_same() -> None:
    near, far = (
        imread(io.BytesIO(write("panels.png", cylinder(6, 2, origin=at), Meta())))
        for at in ((0, 0, 0), (4.5e6, -5.4e6, 1e3))
    )
    assert near.shape == far.shape
    assert np.mean(np.abs(near - far) > 0.05) < 0.001


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([0.4186622, 0.4188771, 0.4188902, 1.5], ["0.4187", "0.41888", "0.41889", "1.500"]),
        ([0.0004994, 12.25, 1234.4, 1234.6], ["0.0004994", "12.25", "1234", "1235"]),
        ([1.0, 1.0 + 1e-8], ["1.00000000", "1.00000001"]),
        ([1.0, np.nextafter(1.0, 2.0)], ["1.000", "1.000"]),
        ([], []),
    ],
)
def test_lengths_have_the_digits_that_tell_them_apart(values, words):
    assert text.lengths(values) == words


def test_lengths_of_panels_that_their_sides_tell_apart_need_no_more_digits():
    assert text.lengths([1.332332, 1.332334], [6, 5]) == ["1.332", "1.332"]
    assert text.lengths([1.332332, 1.332334], [6, 6]) == ["1.332332", "1.332334"]


@pytest.mark.usefixtures("small_pictures")
@pytest.mark.parametrize("name", ["tower", "Bürogebäude am Südufer, Bauabschnitt 3, Westfassade", "W" * 120])
def test_titles_of_pictures_are_never_cut_off(solution: Solution, name: str) -> None:
    """Right of the legend's text some ground is left, whatever the name."""
    picture = imread(io.BytesIO(write("panels.png", solution, Meta(name))))
    dark = np.flatnonzero((picture[..., :3].min(axis=2) < 0.5).any(axis=0))
    assert dark.max() < picture.shape[1] - 4
