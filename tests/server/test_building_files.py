"""What goes to BIM, viewers and the workshop: read back by programs that did not write it."""

from __future__ import annotations

import csv
import io
import json
import logging
import shutil
import struct
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
import rhino3dm

from hexwrap_server.output import step
from hexwrap_server.output.blocks import Blocks
from hexwrap_server.output.flat import ZONES, groups, sheet_size
from hexwrap_server.output.meta import Meta
from hexwrap_server.output.units import UNITS
from hexwrap_server.output.writers import write
from hexwrap_solver.arrays import Floats, Ragged
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.panels import make_components
from hexwrap_solver.panels.types import ComponentSettings, PanelSettings
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.pipeline import Solution, SolveSettings, solve
from hexwrap_solver.singularities.types import SingularityAt, SingularitySettings
from hexwrap_solver.surface.types import Origin
from tests.server.analytic import cylinder
from tests.server.patience import PATIENCE
from tests.solver.singularities import shapes

# ifcopenshell's rules leave files open.
pytestmark = pytest.mark.filterwarnings(
    "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
)

HERE = Path(__file__).parent
ODD = Meta("Türme 塔 🏢 <&\"'> \n\\x", unit="mm")


@pytest.fixture(scope="module")
def solution() -> Solution:
    """Sixty hexagons of three sizes; of two cells only a piece is left, which has no size."""
    whole = cylinder()
    assert whole.panels is not None
    rows = whole.panels.polygons.to_lists()
    rows[7], rows[20] = rows[7][:4], rows[20][:5]
    lengths = np.array([len(row) for row in rows])
    cut = Ragged(np.concatenate([np.array(row) for row in rows]), np.concatenate([[0], np.cumsum(lengths)]))
    size, whole_flags = whole.panels.size.copy(), whole.panels.whole.copy()
    size[[7, 20]], whole_flags[[7, 20]] = -1, False
    return replace(whole, panels=replace(whole.panels, polygons=cut, size=size, whole=whole_flags))


@pytest.fixture(scope="module")
def regular() -> Solution:
    return cylinder()


@pytest.fixture(scope="module")
def thick(solution: Solution) -> Solution:
    assert solution.panels is not None
    built = make_components(solution.panels, ComponentSettings(inset=0.01, thickness=0.04))
    return replace(solution, components=built)


def polygons(solution: Solution) -> Ragged:
    assert solution.panels is not None
    return solution.panels.polygons if solution.components is None else solution.components.outline


def labels(solution: Solution) -> list[str]:
    assert solution.pattern is not None
    return solution.pattern.labels()


# --- blocks ----------------------------------------------------------------------------------------------


def test_instances_of_blocks_stand_where_the_panels_stand(solution: Solution, thick: Solution) -> None:
    for some in (solution, thick):
        assert some.panels is not None
        blocks = Blocks.of(some.panels, some.components)
        assert blocks.alone.tolist() == [7, 20]
        assert blocks.size.tolist() == [0, 1, 2]
        for panel, block in enumerate(blocks.block.tolist()):
            shown = blocks.shape(blocks.made_from[block] if block >= 0 else panel)
            n = len(polygons(some)[panel])
            points = shown.points[:n] @ blocks.axes[panel] + blocks.origin[panel]
            assert points == pytest.approx(np.asarray(polygons(some)[panel]), abs=1e-9)


def test_bodies_are_closed_and_turned_outward(thick: Solution) -> None:
    assert thick.panels is not None
    blocks = Blocks.of(thick.panels, thick.components)
    for panel in (0, 7, 20):
        shape = blocks.shape(panel)
        edges = np.concatenate([shape.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
        assert len(np.unique(edges, axis=0)) == len(edges)
        assert {tuple(e) for e in edges.tolist()} == {tuple(e[::-1]) for e in edges.tolist()}
        a, b, c = np.moveaxis(shape.points[shape.triangles], 1, 0)
        area = np.sum(np.cross(*(shape.points[1:3] - shape.points[0])) > 0)
        assert area
        volume = np.sum(np.einsum("ij,ij->i", a, np.cross(b, c))) / 6
        outline = shape.points[: len(shape.points) // 2]
        after = np.roll(outline, -1, axis=0)
        flat = np.sum(outline[:, 0] * after[:, 1] - outline[:, 1] * after[:, 0]) / 2
        assert volume == pytest.approx(0.04 * flat)


# --- IFC -------------------------------------------------------------------------------------------------


def ifc_messages(model: Any) -> list[Any]:
    validate = pytest.importorskip("ifcopenshell.validate")
    logger = validate.json_logger()
    validate.validate(model, logger, express_rules=True)
    return list(logger.statements)


def opened(data: bytes) -> Any:
    ifcopenshell = pytest.importorskip("ifcopenshell")
    logging.getLogger("ifcopenshell").setLevel(logging.ERROR)
    return ifcopenshell.file.from_string(data.decode("ascii"))


def plate_corners(plate: Any) -> Floats:
    """Corners of a plate's polygonal face set in the world, through mapped items and placements."""
    placement = pytest.importorskip("ifcopenshell.util.placement")
    (shape,) = plate.Representation.Representations
    (item,) = shape.Items
    if item.is_a("IfcMappedItem"):
        (item,) = item.MappingSource.MappedRepresentation.Items
    points = np.array(item.Coordinates.CoordList)
    motion = placement.get_local_placement(plate.ObjectPlacement)
    return np.asarray(points @ motion[:3, :3].T + motion[:3, 3])


@pytest.mark.parametrize("kind", ["thick", pytest.param("storeys", marks=pytest.mark.long)])
def test_ifc_is_valid_and_has_the_panels_where_they_are(
    solution: Solution, thick: Solution, kind: str
) -> None:
    some = thick if kind == "thick" else solution
    model = opened(write("panels.ifc", some, replace(ODD, storey=3.0 if kind == "storeys" else None)))
    assert ifc_messages(model) == []
    assert model.schema == "IFC4"
    plates = {plate.Name: plate for plate in model.by_type("IfcPlate")}
    assert sorted(plates) == sorted(labels(some))
    for row, label in enumerate(labels(some)):
        expected = np.asarray(polygons(some)[row])
        assert plate_corners(plates[label])[: len(expected)] == pytest.approx(expected, abs=1e-6)


def test_ifc_has_a_type_per_size_and_says_what_is_known(solution: Solution) -> None:
    element = pytest.importorskip("ifcopenshell.util.element")
    model = opened(write("panels.ifc", solution, ODD))
    assert solution.panels is not None
    assert solution.pattern is not None
    types = model.by_type("IfcPlateType")
    assert [t.Name for t in types] == ["size-00", "size-01", "size-02"]
    assert [len(t.RepresentationMaps) for t in types] == [1, 1, 1]
    for size, kind in enumerate(types):
        facts = element.get_psets(kind)["Hexwrap_Size"]
        assert facts["EdgeLength"] == pytest.approx(solution.panels.class_length[size])
        assert facts["Count"] == np.sum(solution.panels.size == size) == len(element.get_types(kind))
        assert facts["Sides"] == 6
    rings = dict(zip(labels(solution), solution.pattern.ring.tolist(), strict=True))
    for plate in model.by_type("IfcPlate"):
        facts = element.get_psets(plate)["Hexwrap"]
        assert facts["Label"] == plate.Name
        assert facts["Ring"] == rings[plate.Name]
    cut = [p.Name for p in model.by_type("IfcPlate") if element.get_psets(p)["Hexwrap"].get("Cut")]
    assert cut == [labels(solution)[7], labels(solution)[20]]
    (wall,) = model.by_type("IfcCurtainWall")
    assert len(element.get_parts(wall)) == len(labels(solution))
    assert wall.Name == "Türme 塔 🏢 <&\"'> \\x"


@pytest.mark.parametrize("unit", [None, *UNITS])
def test_ifc_knows_the_unit(solution: Solution, unit: str | None) -> None:
    measure = pytest.importorskip("ifcopenshell.util.unit")
    model = opened(write("panels.ifc", solution, Meta(unit=unit)))
    assert measure.calculate_unit_scale(model) == pytest.approx(UNITS[unit].metres if unit else 1.0)


def test_ifc_puts_panels_on_storeys(solution: Solution) -> None:
    element = pytest.importorskip("ifcopenshell.util.element")
    model = opened(write("panels.ifc", solution, replace(ODD, storey=3.0)))
    storeys = model.by_type("IfcBuildingStorey")
    assert solution.panels is not None
    heights = dict(zip(labels(solution), solution.panels.center[:, 2].tolist(), strict=True))
    lowest = float(np.asarray(solution.panels.polygons.values)[:, 2].min())
    assert len(storeys) > 2
    for storey in storeys:
        (wall,) = element.get_decomposition(storey, is_recursive=False)
        for plate in element.get_parts(wall):
            above = heights[plate.Name] - storey.Elevation
            assert -1e-6 <= above < 3.0
    assert storeys[0].Elevation == pytest.approx(lowest)


def test_step_writes_what_part_21_asks_for() -> None:
    assert [step.real(v) for v in (1.0, -0.5, 1e-12, 1e20)] == ["1.", "-0.5", "1.E-12", "1.E+20"]
    assert step.text("a'b\\c") == "'a''b\\\\c'"
    assert step.text("ü塔🏢") == "'\\X2\\00FC\\X0\\\\X2\\5854\\X0\\\\X4\\0001F3E2\\X0\\'"
    with pytest.raises(ValueError, match="nan"):
        step.real(float("nan"))


# --- GLB -------------------------------------------------------------------------------------------------


def test_glb_opens_in_the_viewers_own_three(solution: Solution, tmp_path: Path) -> None:
    """One geometry per size, a node per panel, in metres with y up."""
    npm, node = shutil.which("npm"), shutil.which("node")
    if npm is None or node is None:
        pytest.skip("Node.js is not installed")
    package = HERE.parents[1] / "server" / "viewer" / "package.json"
    version = json.loads(package.read_text(encoding="utf-8"))["devDependencies"]["three"]
    got = subprocess.run(
        [npm, "install", "--silent", f"three@{version}"], cwd=tmp_path, capture_output=True, timeout=PATIENCE
    )
    if got.returncode:
        pytest.skip("npm could not install three")
    shutil.copy(HERE / "read_glb.mjs", tmp_path)
    (tmp_path / "panels.glb").write_bytes(write("panels.glb", solution, ODD))
    done = subprocess.run(
        [node, "read_glb.mjs", "panels.glb"], cwd=tmp_path, capture_output=True, timeout=PATIENCE, check=True
    )
    seen = json.loads(done.stdout)
    assert seen["geometries"] == 3 + 2
    shown = {panel["name"]: panel for panel in seen["panels"]}
    assert sorted(shown) == sorted(labels(solution))
    assert solution.panels is not None
    for row, label in enumerate(labels(solution)):
        corners = np.array(shown[label]["corners"])[:, [0, 2, 1]] * [1000, -1000, 1000]
        expected = np.asarray(polygons(solution)[row])
        apart = np.linalg.norm(corners[:, None] - expected, axis=2)
        assert apart.min(axis=1).max() < 1e-4
        assert apart.min(axis=0).max() < 1e-4
        assert shown[label]["data"]["size"] == solution.panels.size[row]


# --- 3DM -------------------------------------------------------------------------------------------------


def test_3dm_keeps_unit_surface_and_what_the_input_said(solution: Solution) -> None:
    origin = Origin("Süd", "Bau A::Hülle", (("Brandschutz", "F30"), ("Nr", "7")))
    known = replace(solution.map.surface, unit="ft", origin=origin)
    known_map = replace(solution.map, surface=known)
    data = write("panels.3dm", replace(solution, map=known_map), Meta("tower"))
    model = rhino3dm.File3dm.FromByteArray(data)
    assert model.Settings.ModelUnitSystem == rhino3dm.UnitSystem.Feet
    layers = {layer.Index: layer.Name for layer in model.Layers}
    (surface,) = [o for o in model.Objects if layers[o.Attributes.LayerIndex] == "surface"]
    mesh = solution.map.surface
    assert len(surface.Geometry.Vertices) == len(mesh.vertices)
    assert surface.Geometry.Faces.Count == len(mesh.faces)
    assert surface.Attributes.Name == "Süd"
    assert surface.Attributes.GetUserString("Brandschutz") == "F30"
    paths = {layer.Index: layer.FullPath for layer in model.Layers}
    assert paths[surface.Attributes.LayerIndex] == "Bau A::Hülle::surface"


# --- the workshop ----------------------------------------------------------------------------------------


def sheets(data: bytes) -> Any:
    return ezdxf.read(io.StringIO(data.decode())).modelspace()


def test_flat_dxf_says_its_unit_and_parts_cutting_from_engraving(regular: Solution) -> None:
    document = ezdxf.read(io.StringIO(write("flat.dxf", regular, ODD).decode()))
    assert document.header["$INSUNITS"] == 4
    kinds = {e.dxf.layer.split("-")[0] for e in document.modelspace()}
    assert kinds == {"cut", "engrave", "sheets"}
    assert not document.modelspace().query('TEXT[layer ? "cut.*"]')


def test_arrows_point_up_and_texts_stand_upright(regular: Solution) -> None:
    """On a cylinder whose rings lie level the upper edge lies opposite to the lower one."""
    assert regular.panels is not None
    space = sheets(write("flat.dxf", regular, ODD))
    arrows = [np.array(line.get_points("xy")) for line in space.query('LWPOLYLINE[layer=="engrave-up"]')]
    assert len(arrows) == regular.panels.n_panels
    blocks = Blocks.of(regular.panels)
    up = blocks.axes[:, :2, 2] / np.linalg.norm(blocks.axes[:, :2, 2], axis=1, keepdims=True)
    for arrow, way in zip(arrows, up, strict=True):
        assert (arrow[1] - arrow[0]) / np.linalg.norm(arrow[1] - arrow[0]) == pytest.approx(way, abs=1e-9)
    words = list(space.query('TEXT[layer=="engrave-label"]'))
    turn = np.radians([t.dxf.rotation for t in words[::2]])
    assert np.stack([-np.sin(turn), np.cos(turn)], axis=1) == pytest.approx(up, abs=1e-9)


def test_sheets_measure_three_by_one_and_a_half_metres_or_the_next_stock_that_holds_a_panel() -> None:
    small = np.full((3, 2), 0.4)
    assert sheet_size(small, Meta(unit="m")) == (3.0, 1.5)
    assert sheet_size(small * 1000, Meta(unit="mm")) == pytest.approx((3000, 1500))
    assert sheet_size(small / 0.3048, Meta(unit="ft")) == pytest.approx((9.8425197, 4.9212598))
    assert sheet_size(np.full((3, 2), 1.7), Meta(unit="m")) == (4.0, 2.0)
    assert sheet_size(np.full((3, 2), 2900.0), Meta(unit="mm")) == pytest.approx((6000, 3210))
    wide, high = sheet_size(np.full((3, 2), 3.3), Meta(unit="m"))
    assert wide > 6 * 3.3
    assert high > 4 * 3.3
    assert sheet_size(small, Meta(sheet=(2.0, 1.0))) == (2.0, 1.0)


@pytest.mark.parametrize("kind", ["ring", "zone"])
def test_groups_do_not_share_a_sheet(regular: Solution, kind: str) -> None:
    assert regular.panels is not None
    assert regular.pattern is not None
    space = sheets(write("flat.dxf", regular, replace(ODD, group=kind)))  # type: ignore[arg-type]
    rims = [np.array(r.get_points("xy")) for r in space.query('LWPOLYLINE[layer=="sheets"]')]
    titles = [t.dxf.text for t in space.query('TEXT[layer=="sheets"]')][::2]
    group = dict(zip(labels(regular), groups(regular.panels, regular.pattern, kind), strict=True))  # type: ignore[arg-type]
    found: list[set[int]] = [set() for _ in rims]
    for word in list(space.query('TEXT[layer=="engrave-label"]'))[::2]:
        x = word.dxf.align_point.x
        (sheet,) = [k for k, r in enumerate(rims) if r[:, 0].min() < x < r[:, 0].max()]
        found[sheet].add(int(group[word.dxf.text]))
    assert all(len(kinds) == 1 for kinds in found)
    for (number,), title in zip(found, titles, strict=True):
        assert title.endswith(f"ring {number}" if kind == "ring" else ZONES[number])


def test_long_names_are_not_cut_off(regular: Solution) -> None:
    """No title is wider than its sheet, no label wider than its panel."""
    space = sheets(write("flat.dxf", regular, replace(ODD, name="Bürogebäude Süd " * 12)))
    rims = [np.array(r.get_points("xy")) for r in space.query('LWPOLYLINE[layer=="sheets"]')]
    width = float(np.ptp(rims[0][:, 0]))
    for title in space.query('TEXT[layer=="sheets"]'):
        assert 0.75 * title.dxf.height * len(title.dxf.text) <= width * (1 + 1e-9)
    assert regular.panels is not None
    for word in space.query('TEXT[layer=="engrave-label"]'):
        inner = np.sqrt(3) / 2 * float(regular.panels.edge_length.max())
        assert 0.75 * word.dxf.height * len(word.dxf.text) <= 1.5 * inner * (1 + 1e-9)


def test_cutting_list_counts_and_adds_up(solution: Solution) -> None:
    assert solution.panels is not None
    rows = list(csv.DictReader(io.StringIO(write("cutting-list.csv", solution, ODD).decode(), newline="")))
    assert [row["size"] for row in rows] == ["size-00", "size-01", "size-02", "no-size", "no-size", "total"]
    assert sum(int(row["count"]) for row in rows[:-1]) == int(rows[-1]["count"]) == solution.panels.n_panels
    assert [int(row["sides"]) for row in rows[:-1]] == [6, 6, 6, 4, 5]
    for size, row in enumerate(rows[:3]):
        edge = float(row["edge_length [mm]"])
        assert edge == pytest.approx(solution.panels.class_length[size])
        assert float(row["area [mm2]"]) == pytest.approx(1.5 * np.sqrt(3) * edge**2)
        assert float(row["perimeter [mm]"]) == pytest.approx(6 * edge)
        assert float(row["total_area [mm2]"]) == pytest.approx(int(row["count"]) * float(row["area [mm2]"]))
    total = sum(float(row["total_area [mm2]"]) for row in rows[:-1])
    assert float(rows[-1]["total_area [mm2]"]) == pytest.approx(total)
    assert [row["label"] for row in rows[3:5]] == [labels(solution)[7], labels(solution)[20]]


def test_panel_table_names_the_unit_of_its_lengths(solution: Solution) -> None:
    first = write("panels.csv", solution, ODD).decode().splitlines()[0].split(",")
    assert {"edge_length [mm]", "center_x [mm]", "planarity", "kink_max", "label"} <= set(first)
    plain = write("panels.csv", solution, Meta()).decode().splitlines()[0].split(",")
    assert "edge_length" in plain
    assert not any("[" in name for name in plain)


# --- singularities ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def singular() -> Solution:
    """A waisted tube with two heptagons and four pentagons, all with bodies and a support."""
    listed = [(620, -1), (600, -1), (980, 1), (960, 1), (220, 1), (200, 1)]
    asked = SingularitySettings(at=tuple(SingularityAt(k, vertex=v) for v, k in listed))
    panels = PanelSettings(sizes=3, joint=0.02, components=ComponentSettings(inset=0.01, thickness=0.02))
    settings = SolveSettings(
        BoundaryCondition("isometric"), PatternSettings(around=16), panels, asked, support=True
    )
    return solve(shapes.waist, settings)


@pytest.mark.long
def test_pentagons_and_heptagons_are_built_like_hexagons(singular: Solution) -> None:
    assert singular.panels is not None
    assert singular.components is not None
    assert singular.support is not None
    panels, outline = singular.panels, singular.components.outline
    odd = np.flatnonzero(panels.polygons.lengths != 6)
    assert sorted(panels.polygons.lengths[odd]) == [5, 5, 5, 5, 7, 7]
    assert np.nanmin(singular.quality.gap_tangential) >= 0.02 - 1e-9
    names = [f"size-{size:02d}" for size in range(len(panels.class_length))]
    for i in odd:
        corner, n = np.asarray(panels.polygons[i]), panels.normal[i]
        edge = np.roll(corner, -1, axis=0) - corner
        assert np.linalg.norm(edge, axis=1) == pytest.approx(panels.edge_length[i], rel=1e-9)
        inward = np.cross(n, edge / panels.edge_length[i])
        assert ((np.asarray(outline[i]) - corner) * inward).sum(axis=1) == pytest.approx(0.01, abs=1e-9)

    model = opened(write("panels.ifc", singular, ODD))
    assert ifc_messages(model) == []
    assert sorted(kind.Name for kind in model.by_type("IfcPlateType")) == names
    plates = {plate.Name: plate for plate in model.by_type("IfcPlate")}
    for i in odd:
        sides = int(panels.polygons.lengths[i])
        corners = plate_corners(plates[labels(singular)[i]])
        assert len(corners) == 2 * sides
        assert corners[:sides] == pytest.approx(np.asarray(outline[i]), abs=1e-6)

    rhino = rhino3dm.File3dm.FromByteArray(write("panels.3dm", singular, ODD))
    assert [block.Name for block in rhino.InstanceDefinitions] == names
    rows = list(csv.DictReader(io.StringIO(write("cutting-list.csv", singular, ODD).decode(), newline="")))
    assert [row["sides"] for row in rows[:-1]] == panels.class_sides.astype(str).tolist()
    cut = [e for e in sheets(write("flat.dxf", singular, ODD)).query("LWPOLYLINE") if "cut" in e.dxf.layer]
    assert sorted(len(line) for line in cut if len(line) != 6) == [5, 5, 5, 5, 7, 7]
    (head,) = struct.unpack("<I", (data := write("panels.glb", singular, ODD))[12:16])
    scene = json.loads(data[20 : 20 + head])
    assert len(scene["meshes"]) == len(names)
    assert sum("mesh" in node for node in scene["nodes"]) == panels.n_panels
    assert len(singular.support.strips) == singular.support.edges.shape[0]
