"""Closed masses lose their flat ends and nothing else."""

from __future__ import annotations

import re

import numpy as np
import pytest

from hexwrap_solver.arrays import Floats, Ragged
from hexwrap_solver.surface import SentMesh, surface_from_mesh
from hexwrap_solver.surface.brep import surface_from_brep
from hexwrap_solver.surface.types import MeshSettings, Surface, SurfaceSettings
from tests.solver.surface.brep_shapes import box

COARSE = MeshSettings(max_edge=4.0)


def prism(
    sides: int = 24, bottom: bool = True, top: bool = True, rise: float = 0.0, rows: int = 6
) -> SentMesh:
    """A round tower of radius 10 and height 30, its ends closed by fans; the upper fan rises to a point."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([10 * np.cos(angle), 10 * np.sin(angle), 0 * angle], axis=1)
    rings = np.concatenate([ring + np.array([0, 0, 30 * k / rows]) for k in range(rows + 1)])
    vertices = np.concatenate([rings, [[0, 0, 0], [0, 0, 30 + rise]]])
    k = np.arange(sides)
    j = (k + 1) % sides
    faces = []
    for row in range(rows):
        a, b, c, d = (x + sides * (row + y) for x, y in ((k, 0), (j, 0), (j, 1), (k, 1)))
        faces += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    if bottom:
        faces.append(np.stack([j, k, np.full(sides, len(rings))], axis=1))
    if top:
        faces.append(np.stack([k + sides * rows, j + sides * rows, np.full(sides, len(rings) + 1)], axis=1))
    return SentMesh(vertices, Ragged.from_table(np.concatenate(faces)))


def ball(steps: int = 12, low: float = -1.0) -> SentMesh:
    """A sphere of radius 5, cut off and closed flat at a height (−1: whole)."""
    z = np.cos(np.linspace(0, np.arccos(low), steps))[1:]
    sides = 2 * steps
    angle = 2 * np.pi * np.arange(sides) / sides
    r = np.sqrt(np.maximum(1 - z**2, 0))
    rows = [
        np.stack([x * np.cos(angle), x * np.sin(angle), h + 0 * angle], axis=1)
        for x, h in zip(r, z, strict=True)
    ]
    if low == -1.0:
        rows = rows[:-1]
    vertices = 5 * np.concatenate([*rows, [[0, 0, 1], [0, 0, low]]])
    k = np.arange(sides)
    j = (k + 1) % sides
    last = (len(rows) - 1) * sides
    top, under = len(vertices) - 2, len(vertices) - 1
    faces = [np.stack([k, j, np.full(sides, top)], axis=1)]
    for row in range(len(rows) - 1):
        a, b, c, d = (x + sides * (row + y) for x, y in ((k, 1), (j, 1), (j, 0), (k, 0)))
        faces += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    faces.append(np.stack([j + last, k + last, np.full(sides, under)], axis=1))
    return SentMesh(vertices, Ragged.from_table(np.concatenate(faces)))


def moved(sent: SentMesh, matrix: Floats) -> SentMesh:
    return SentMesh(sent.vertices @ matrix.T + 100.0, sent.faces)


def heights(surface: Surface) -> list[float]:
    return sorted(float(surface.vertices[loop][:, 2].mean()) for loop in surface.loops)


def house(pitch: float, depth: float = 16.0) -> SentMesh:
    """10 wide, its walls 6 high, the ridge above the middle; pitch in degrees."""
    profile = [(0, 0), (10, 0), (10, 6), (5, 6 + 5 * np.tan(np.deg2rad(pitch))), (0, 6)]
    points = [(x, y, z) for y in (0.0, depth) for x, z in profile]
    ends = [[0, 1, 2, 4], [2, 3, 4], [5, 9, 7, 6], [7, 9, 8]]
    around = [[(i + 1) % 5, i, i + 5, (i + 1) % 5 + 5] for i in range(5)]
    lengths = [len(face) for face in ends + around]
    values = np.array([v for face in ends + around for v in face])
    return SentMesh(np.array(points), Ragged(values, np.cumsum([0, *lengths])))


@pytest.mark.parametrize("pitch", [20.0, 40.0, 60.0])
def test_a_house_loses_its_floor_and_keeps_its_roof(pitch: float) -> None:
    surface = surface_from_mesh(house(pitch))
    assert len(surface.loops) == 1
    assert surface.vertices[surface.loops[0], 2].max() == 0
    assert "A flat cap at the bottom" in surface.repairs[0]


def test_a_hall_as_long_as_a_bar_is_open_at_its_ends() -> None:
    assert len(surface_from_mesh(house(40.0, depth=100.0)).loops) == 2


@pytest.mark.parametrize("bottom", [True, False])
@pytest.mark.parametrize("rise", [0.0, 1.5])
def test_a_tower_is_open_at_both_ends_after_its_caps(bottom: bool, rise: float) -> None:
    sent = prism(bottom=bottom, rise=rise)
    surface = surface_from_mesh(sent)
    assert heights(surface) == pytest.approx([0.0, 30.0])
    assert len(surface.repairs) >= 1
    assert "top" in surface.repairs[-1]
    assert ("bottom" in surface.repairs[-1]) == bottom
    kept = surface_from_mesh(sent, SurfaceSettings(caps="keep"))
    assert len(kept.loops) == (0 if bottom else 1)
    assert not any("cap" in sentence for sentence in kept.repairs)


def test_nothing_is_taken_off_open_tubes_domes_and_balls() -> None:
    for sent, loops in (
        (prism(bottom=False, top=False), 2),
        (prism(bottom=False, rise=12.0), 1),
        (ball(), 0),
    ):
        surface = surface_from_mesh(sent)
        assert len(surface.loops) == loops
        assert surface.repairs == () or "cap" not in " ".join(surface.repairs)


def test_a_closed_dome_loses_its_floor_and_stays_a_dome() -> None:
    surface = surface_from_mesh(ball(low=0.0))
    assert heights(surface) == pytest.approx([0.0], abs=1e-12)
    assert surface.vertices[:, 2].max() == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("size", "axis"),
    [
        ((12.0, 9.0, 30.0), 2),
        ((12.0, 9.0, 8.0), 2),
        ((60.0, 9.0, 8.0), 0),
        ((9.0, 9.0, 9.0), 2),
        ((60.0, 40.0, 4.0), 2),  # a podium has walls, whatever its height
        ((60.0, 4.0, 40.0), 2),
    ],
)
def test_the_ends_of_a_box_are_below_and_above_unless_it_lies(
    size: tuple[float, float, float], axis: int
) -> None:
    surface = surface_from_brep(box(size), SurfaceSettings(COARSE))
    ends = sorted(float(np.ptp(surface.vertices[loop][:, axis])) for loop in surface.loops)
    assert ends == pytest.approx([0.0, 0.0], abs=1e-9)
    assert "one of 3 pairs" in surface.repairs[-1]


def courtyard(height: float = 12.0) -> SentMesh:
    """A closed block of 40 × 40 around a court of 20 × 20."""
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 20.0
    flat = np.concatenate([square, square / 2])
    vertices = np.concatenate([np.column_stack([flat, np.full(8, z)]) for z in (0.0, height)])
    k = np.arange(4)
    j = (k + 1) % 4
    outer, inner = np.stack([k, j, j + 8, k + 8], axis=1), np.stack([j + 4, k + 4, k + 12, j + 12], axis=1)
    under, above = np.stack([j, k, k + 4, j + 4], axis=1), np.stack([k, j, j + 4, k + 4], axis=1) + 8
    return SentMesh(vertices, Ragged.from_table(np.concatenate([outer, inner, under, above])))


@pytest.mark.parametrize("height", [4.0, 12.0, 90.0])
def test_a_block_around_a_courtyard_is_clad_outside(height: float) -> None:
    """Closed, it has a handle; without its flat ends it is two tubes, and the outer one is the facade."""
    surface = surface_from_mesh(courtyard(height))
    assert len(surface.loops) == 2
    assert surface.areas.sum() == pytest.approx(160 * height)
    assert "walls of a courtyard around (0, 0," in surface.repairs[-1]


def test_normals_at_the_ends_are_those_of_the_walls() -> None:
    surface = surface_from_brep(box(), SurfaceSettings(COARSE))
    assert np.abs(surface.normals[:, 2]).max() < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_caps_are_found_at_any_place_and_turn(seed: int) -> None:
    matrix, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    matrix *= 7.0 * np.sign(np.linalg.det(matrix))
    assert len(surface_from_mesh(moved(prism(), matrix)).loops) == 2
    assert len(surface_from_mesh(moved(ball(), matrix)).loops) == 0


def test_creases_are_chains_between_the_ends() -> None:
    surface = surface_from_brep(box(), SurfaceSettings(COARSE))
    assert len(surface.features) == 4
    rim = set(np.concatenate(surface.loops).tolist())
    for feature in surface.features:
        assert not feature.closed
        assert feature.fold == pytest.approx(np.pi / 2)
        line = surface.vertices[feature.vertices]
        assert np.ptp(line[:, :2], axis=0).max() < 1e-9
        assert set(feature.vertices[[0, -1]].tolist()) <= rim
        assert len(np.unique(np.sign(np.diff(line[:, 2])))) == 1


def test_creases_of_meshes_are_their_sharp_folds_split_at_junctions() -> None:
    surface = surface_from_brep(box(), SurfaceSettings(COARSE, caps="keep"))
    assert sorted(len(f.vertices) > 2 for f in surface.features) == [True] * 12
    mesh = SentMesh(surface.vertices, Ragged.from_table(surface.faces))
    again = surface_from_mesh(mesh, SurfaceSettings(caps="keep"))
    assert [f.vertices.tolist() for f in again.features] == [f.vertices.tolist() for f in surface.features]
    ring = surface_from_mesh(prism(sides=64, rise=9.0, bottom=False))
    assert [f.closed for f in ring.features] == [True]
    assert ring.features[0].vertices[0] == ring.features[0].vertices[-1]
    assert len(np.unique(ring.features[0].vertices)) == 64


def test_a_mass_that_is_inside_out_loses_the_same_caps() -> None:
    outward = prism()
    inward = SentMesh(outward.vertices, Ragged.from_table(outward.faces.values.reshape(-1, 3)[:, ::-1]))
    one, other = surface_from_mesh(outward), surface_from_mesh(inward)
    assert one.repairs == other.repairs
    assert len(other.loops) == 2


def plate(lift: Floats, thickness: float, windows: bool = False) -> SentMesh:
    """A square of 12 x 12 quads, 20 wide, lifted (13, 13), with four windows or none, as a mass."""
    x, y = np.meshgrid(np.linspace(-10, 10, 13), np.linspace(-10, 10, 13), indexing="ij")
    upper = np.stack([x, y, lift], axis=2).reshape(-1, 3)
    i, j = np.divmod(np.arange(144), 12)
    quads = np.stack([13 * i + j, 13 * (i + 1) + j, 13 * (i + 1) + j + 1, 13 * i + j + 1], axis=1)
    if windows:
        quads = quads[~(np.isin(i, (3, 8)) & np.isin(j, (3, 8)))]
    edges = np.concatenate([quads[:, [k, (k + 1) % 4]] for k in range(4)])
    inner = {(b, a) for a, b in edges.tolist()}
    a, b = np.array([e for e in edges.tolist() if tuple(e) not in inner]).T
    n = len(upper)
    reveals = np.stack([b, a, a + n, b + n], axis=1)
    faces = np.concatenate([quads, quads[:, ::-1] + n, reveals])
    return SentMesh(np.concatenate([upper, upper - [0, 0, thickness]]), Ragged.from_table(faces))


SQUARES = np.add.outer(np.linspace(-1, 1, 13) ** 2, np.linspace(-1, 1, 13) ** 2)


@pytest.mark.parametrize("rise", [0.0, 4.0])
@pytest.mark.parametrize("windows", [False, True])
def test_of_a_plate_one_side_is_left_with_its_windows(rise: float, windows: bool) -> None:
    """The upper side of a slab or a shell; of one that stands, the larger side."""
    sent = plate(-rise * SQUARES, 0.3, windows)
    surface = surface_from_mesh(sent)
    assert len(surface.loops) == (5 if windows else 1)
    used = surface.input_vertex
    assert used.max() < 169, "the upper ones come first"
    told = re.compile(r"plate, 0\.(3|2\d+) thick, of which the top is panelized")
    assert any(map(told.search, surface.repairs))
    standing = surface_from_mesh(moved(sent, np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])))
    assert len(standing.faces) == len(surface.faces)
    if not windows:
        assert surface_from_mesh(sent, SurfaceSettings(caps="keep")).loops == ()


def test_a_thin_tower_is_no_plate() -> None:
    """A slab 20 wide and 1.5 deep: its walls are wanted all around."""
    surface = surface_from_mesh(
        moved(plate(0 * SQUARES, 1.5), np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]))
    )
    assert len(surface.loops) == 2


def test_of_a_thick_tower_with_windows_the_outside_is_left() -> None:
    """Bent to a tube the plate goes all around: its reveals join the sides into one surface with handles."""
    sent = plate(0 * SQUARES, 0.3, windows=True)
    x, y, z = sent.vertices.T
    angle, radius = np.pi * (x + 10) / 10, 8 + z
    bent = np.stack([radius * np.cos(angle), radius * np.sin(angle), y], axis=1)
    quads = sent.faces.values.reshape(-1, 4)
    quads = quads[~(np.abs(x)[quads] == 10).all(axis=1)]  # where the ends meet
    surface = surface_from_mesh(SentMesh(bent, Ragged.from_table(quads)))
    assert len(surface.loops) == 6
    np.testing.assert_allclose(np.linalg.norm(surface.vertices[:, :2], axis=1), 8)
    assert any("thick, of which the outside is panelized" in note for note in surface.repairs)


@pytest.mark.parametrize(("height", "rims"), [(30.0, [4, 4]), (0.5, [4])])
def test_a_box_without_a_floor_loses_its_roof_unless_that_is_most_of_it(
    height: float, rims: list[int]
) -> None:
    """Its walls touch the boundary, too, but each only a side of it. Of a canopy the fascia would be left."""
    x, y, z = np.array([[0, 0, 0], [20, 0, 0], [20, 14, 0], [0, 14, 0]]).T
    vertices = np.concatenate([np.stack([x, y, z], axis=1), np.stack([x, y, z + height], axis=1)])
    quads = np.array([[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [4, 5, 6, 7]])
    surface = surface_from_mesh(SentMesh(vertices.astype(float), Ragged.from_table(quads)))
    assert [len(loop) for loop in surface.loops] == rims
    assert ("A flat cap at the top" in "".join(surface.repairs)) == (len(rims) == 2)
