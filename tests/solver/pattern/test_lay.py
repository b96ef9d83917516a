"""Patterns close up: Euler characteristic, degrees and neighbours on cylinders and cones."""

from __future__ import annotations

import contextlib
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.errors import NotAdaptedError, PatternError
from hexwrap_solver.geometry import lengths
from hexwrap_solver.panels.polygons import fan_areas
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.lay_pattern import area_vectors, mean_edge
from hexwrap_solver.pattern.place.choose import PlacementFamily, place_lattice
from hexwrap_solver.pattern.place.placement import BEARABLE
from hexwrap_solver.pattern.place.size import FREE, width_per_cell
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from hexwrap_solver.surface import surface_from_mesh, with_openings
from hexwrap_solver.surface.types import SentMesh
from tests.solver.conformal.test_conformal_map import ring_with_corners
from tests.solver.pattern import annuli

DEGREE = {"hex": 3, "triangle": 6, "quad": 4}
SIDES = {"hex": 6, "triangle": 3, "quad": 4}
QUANTUM = {"hex": np.pi / 3, "triangle": np.pi / 3, "quad": np.pi / 2}


def check_closed(pattern: Pattern) -> None:
    """Annulus: χ = 0, two boundary loops, every inner node of full degree, neighbours mutual."""
    faces, neighbours = pattern.faces, pattern.neighbours
    sides = SIDES[pattern.kind]
    assert (faces.lengths == sides).all()
    tail = faces.values
    head = tail[faces.next()]
    n = len(pattern.vertices)
    directed = tail * n + head
    assert len(np.unique(directed)) == len(directed)
    edges = np.unique(np.minimum(tail, head) * n + np.maximum(tail, head))
    assert n - len(edges) + faces.n_rows == 0
    open_side = neighbours.values < 0
    following = dict(zip(tail[open_side].tolist(), head[open_side].tolist(), strict=True))
    assert len(following) == open_side.sum()
    loops = 0
    while following:
        start = at = next(iter(following))
        loops += 1
        while at in following:
            at = following.pop(at)
        assert at == start
    assert loops == 2
    degree = np.bincount(np.concatenate([edges // n, edges % n]), minlength=n)
    inner = np.ones(n, dtype=bool)
    inner[tail[open_side]] = False
    assert (degree[inner] == DEGREE[pattern.kind]).all()
    for cell in range(faces.n_rows):
        for other in neighbours[cell].tolist():
            assert other < 0 or cell in neighbours[other].tolist()


@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
@pytest.mark.parametrize("rotation", ["edge", "vertex", 11.0])
@pytest.mark.parametrize("align", ["none", "first", "both"])
def test_pattern_closes_on_a_catenoid(kind, rotation, align):
    cmap = annuli.revolution(np.cosh, np.linspace(-1, 1.5, 25), 40)
    pattern = lay_pattern(cmap, PatternSettings(kind=kind, rotation=rotation, align=align))
    check_closed(pattern)
    assert len(set(pattern.labels())) == pattern.n_cells
    assert (np.diff(np.sort(pattern.ring)) <= 1).all()


@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
@pytest.mark.parametrize("k", [1, 2, 3, 5, 7, 9, 11, -1, -2, -3, -7, -11])
def test_pattern_closes_on_flat_cones(kind, k):
    angle = k * QUANTUM[kind]
    if abs(angle / (2 * np.pi) % 1) < 1e-9:
        pytest.skip("a translation")
    cmap = annuli.flat_cone(angle, 1.0, 2.0, 60, 12, cut=11)
    pattern = lay_pattern(cmap, PatternSettings(kind=kind, around=36 + 6 * abs(k)))
    check_closed(pattern)
    assert len(set(pattern.labels())) == pattern.n_cells


def test_interior_hexagons_have_six_neighbours_in_full_rings():
    cmap = annuli.revolution(np.cosh, np.linspace(-1, 1, 25), 40)
    pattern = lay_pattern(cmap, PatternSettings(around=36))
    assert pattern.around == 36
    assert (np.bincount(pattern.ring)[:-1] == 36).all()
    table = pattern.neighbours.values.reshape(-1, 6)
    inner = (pattern.ring > 0) & (pattern.ring < pattern.rings - 2)
    assert (table[inner] >= 0).all()


def test_cone_angle_off_the_quantum_is_refused_and_the_nearest_named():
    cmap = annuli.flat_cone(1.3, 1.0, 2.0, 60, 12)
    with pytest.raises(NotAdaptedError) as caught:
        lay_pattern(cmap, PatternSettings())
    assert caught.value.data["nearest"] == pytest.approx([np.pi / 3, 2 * np.pi / 3])


def test_too_many_and_too_large_cells_are_refused():
    cmap = annuli.revolution(np.cosh, np.linspace(-1, 1, 25), 40)
    with pytest.raises(PatternError, match="limit"):
        lay_pattern(cmap, PatternSettings(around=2000, max_cells=10_000))
    with pytest.raises(PatternError):
        lay_pattern(cmap, PatternSettings(around=4, align="none"))


@pytest.mark.parametrize("boundary", ["whole", "trim"])
@pytest.mark.parametrize(
    ("kind", "around"), [("triangle", 3), ("triangle", 4), ("quad", 1), ("quad", 2), ("hex", 1)]
)
def test_cells_that_shared_vertices_cannot_tell_apart_are_refused(kind, around, boundary):
    cmap = annuli.revolution(np.cosh, np.linspace(-1, 1.5, 25), 40)
    with pytest.raises(PatternError, match="more cells around"):
        lay_pattern(cmap, PatternSettings(kind=kind, around=around, boundary=boundary))


@pytest.mark.parametrize("align", ["none", "both"])
def test_corner_angles_of_seven_digits_make_the_same_pattern(align):
    exact, typed = (ring_with_corners(off) for off in (0.0, 6 * 4e-8))
    one, other = (lay_pattern(cmap, PatternSettings(around=48, align=align)) for cmap in (exact, typed))
    assert one.n_cells == other.n_cells
    assert one.around == other.around
    assert KDTree(one.vertices).query(other.vertices)[0].max() < 1e-4 * one.edge_length


CYLINDER = annuli.revolution(np.cosh, np.linspace(-1, 1.5, 25), 40)
PHASED = {
    "cylinder": CYLINDER,
    "cone": annuli.flat_cone(np.pi, 1.0, 2.0, 60, 12),
    "flat ring": ring_with_corners(0.0),
}


@pytest.mark.parametrize("name", PHASED)
@pytest.mark.parametrize("kind", ["hex", "triangle"])
def test_whole_phases_change_nothing_however_many(name, kind):
    """Translations of the tiling, and turns by which it is symmetric; places stay near the origin."""
    cmap, lattice = PHASED[name], LATTICES[kind]
    plain = PatternSettings(kind=kind, around=60, align="none")
    one = complex(lattice.position(lattice.basis[0]))
    phase = {
        "cylinder": (2.0, 0.0),  # cells of a ring along their edges stand in zigzag
        "cone": (60 * QUANTUM[kind] / np.pi, 1.0),
        "flat ring": (one.real / lattice.edge / width_per_cell(lattice, 0.0), one.imag / lattice.edge),
    }[name]
    for times in (1, -40_000):
        moved = replace(plain, phase=(times * phase[0], times * phase[1]))
        here, there = (place_lattice(cmap, LATTICES[kind], asked).place for asked in (plain, moved))
        assert abs(there).max() < abs(here).max() + 3
        first, second = lay_pattern(cmap, plain), lay_pattern(cmap, moved)
        assert second.n_cells == first.n_cells
        assert KDTree(first.vertices).query(second.vertices)[0].max() < 1e-6 * first.edge_length


@pytest.mark.parametrize("align", ["none", "both"])
def test_whole_phases_keep_aligned_rows(align):
    one, other = (
        lay_pattern(CYLINDER, PatternSettings(around=24, align=align, phase=phase))
        for phase in ((0.25, 0.0), (1e5 + 0.25, 0.0))
    )
    assert KDTree(one.vertices).query(other.vertices)[0].max() < 1e-8 * one.edge_length


@pytest.mark.parametrize("phase", [(1.1e6, 0.0), (0.0, -1e13), (1e300, 0.0), (np.nan, 0.0)])
def test_phases_without_digits_behind_the_point_are_refused(phase):
    with pytest.raises(PatternError, match="phase"):
        lay_pattern(CYLINDER, PatternSettings(around=24, phase=phase))


def test_the_mean_edge_is_that_of_the_cells_wherever_they_stand():
    """Of two squares with edges 1 and 3: weighted with their areas, 2.8."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    vertices = np.concatenate([square, 3 * square + [5, 0, 0]])
    faces = Ragged(np.arange(8), np.array([0, 4, 8]))
    for offset in (0.0, 1e6, 1e10):
        area = lengths(area_vectors(faces, vertices + offset))
        assert mean_edge(vertices + offset, faces, area) == pytest.approx(2.8, rel=1e-12)


def short_ring(height):
    return annuli.revolution(lambda z: 20 + 0 * z, np.linspace(0, height, 5), 120)


@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
@pytest.mark.parametrize("rotation", ["edge", "vertex"])
@pytest.mark.parametrize("height", [0.3, 1.5, 10.0, 100.0, 1000.0])
def test_the_default_size_suits_short_rings_and_long_pipes(kind, rotation, height):
    pattern = lay_pattern(short_ring(height), PatternSettings(kind=kind, rotation=rotation))
    assert pattern.rings >= 3
    assert pattern.distortion < 0.05
    assert pattern.notes == ()
    # At most ten per cent of freedom in the size; three rows of very short rings may need more.
    assert pattern.n_cells < 1.25 * 3000 or pattern.rings <= 5


def test_smaller_edges_need_more_cells_where_a_single_ring_has_too_many():
    needed = []
    for edge in (1e-3, 1e-6):
        with pytest.raises(PatternError, match="cells with edges of") as refused:
            lay_pattern(short_ring(10.0), PatternSettings(edge_length=edge))
        needed.append(refused.value.data["cells"])
    assert needed[1] == pytest.approx(1e6 * needed[0], rel=0.01)


def test_the_default_size_of_a_cone_counts_its_cells_whatever_its_narrow_end():
    cmap = annuli.flat_cone(2 * np.pi / 3, 1.0, 200.0, 60, 40)
    pattern = lay_pattern(cmap, PatternSettings())
    assert 1000 < pattern.n_cells < 3300
    assert "so narrow" in " ".join(pattern.notes)
    check_closed(pattern)


def test_where_triangles_turn_over_the_distortion_is_a_number_and_told(monkeypatch):
    placed = PlacementFamily.at
    monkeypatch.setattr(PlacementFamily, "at", lambda self, s: replace(placed(self, s), distortion=np.inf))
    pattern = lay_pattern(short_ring(10.0), PatternSettings(around=24))
    assert pattern.distortion == 1e6
    assert any("turn over" in note for note in pattern.notes)


@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
@pytest.mark.parametrize("inner", [1.0, 5.0, 7.0])
def test_whole_cells_of_the_default_size_leave_a_tenth_bare_at_most(kind, inner):
    cmap = annuli.flat_cone(2 * np.pi, inner, 10.0, 90, 20)
    pattern = lay_pattern(cmap, PatternSettings(kind=kind, align="none"))
    bare = 1 - fan_areas(pattern.cells).sum() / cmap.surface.areas.sum()
    assert bare < 0.125  # the tenth is a forecast
    assert pattern.n_cells < 3300
    trimmed = lay_pattern(cmap, PatternSettings(kind=kind, align="none", boundary="trim"))
    # whole cells may be larger by FREE, where that fits
    assert trimmed.edge_length * (1 + FREE) > 0.95 * pattern.edge_length


@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
@pytest.mark.parametrize("rotation", ["edge", "vertex"])
def test_a_size_that_is_too_large_is_refused_with_one_that_fits(kind, rotation):
    wanted = PatternSettings(kind=kind, rotation=rotation, around=12)
    with pytest.raises(PatternError, match="more cells around") as caught:
        lay_pattern(short_ring(1.5), wanted)
    number, length = re.search(
        r"(\d+) cells around, or an edge length of ([\d.]+), fit", str(caught.value)
    ).groups()
    for fitting in (
        replace(wanted, around=int(number)),
        replace(wanted, around=None, edge_length=float(length)),
    ):
        pattern = lay_pattern(short_ring(1.5), fitting)
        assert pattern.rings >= 3
        assert pattern.distortion < 0.2  # half a row of three


def test_a_refusal_says_what_was_asked_and_which_numbers_close_up():
    with pytest.raises(
        PatternError, match=r"2 cells around, the nearest to the 3 asked for \(only multiples of 2"
    ):
        lay_pattern(short_ring(1.5), PatternSettings(around=3))


@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
def test_rows_are_not_stretched_beyond_what_is_bearable(kind):
    """With too few cells around for one row between the loops, one loop is aligned, and that is told."""
    pattern = lay_pattern(short_ring(1.5), PatternSettings(kind=kind, around=20, boundary="trim"))
    assert pattern.distortion == 0
    assert "only one is aligned" in pattern.notes[0]
    laid = []
    for around in (50, 100, 200, 400):
        with contextlib.suppress(PatternError):
            laid.append(lay_pattern(short_ring(1.5), PatternSettings(kind=kind, around=around)).distortion)
    assert laid
    assert max(laid) <= BEARABLE


def test_a_cone_angle_that_does_not_suit_names_the_quantum_as_it_is_asked_for():
    cmap = annuli.flat_cone(1.3, 1.0, 2.0, 60, 12)
    for kind in ("hex", "triangle", "quad"):
        with pytest.raises(NotAdaptedError, match=rf"boundary\.quantum {kind}\b"):
            lay_pattern(cmap, PatternSettings(kind=kind))


def wall(*windows: tuple[int, int, int, int]):
    """A curved facade of 30 × 15 in quads of a half, with windows from column to column and row to row; its
    coordinates have eight decimals, as text files do."""
    x, y = np.meshgrid(np.linspace(0, 30, 61), np.linspace(0, 15, 31), indexing="ij")
    points = np.round(np.stack([x, 4 * np.sin(np.pi * x / 30), y], axis=-1).reshape(-1, 3), 8)
    i, j = (index.ravel() for index in np.meshgrid(np.arange(60), np.arange(30), indexing="ij"))
    quads = np.stack([31 * i + j, 31 * (i + 1) + j, 31 * (i + 1) + j + 1, 31 * i + j + 1], axis=1)
    glass = np.zeros(len(quads), dtype=bool)
    for left, right, low, high in windows:
        glass |= (left <= i) & (i < right) & (low <= j) & (j < high)
    return with_openings(surface_from_mesh(SentMesh(points, Ragged.from_table(quads[~glass]))), "cut")


@pytest.mark.parametrize("windows", [[(24, 36, 1, 12)], [(2, 8, 1, 8), (30, 40, 10, 20)]])
def test_around_a_window_near_the_edge_of_a_facade_no_ring_of_cells_need_go(windows):
    """Between window and edge there is room for half a cell; the others are as large as without it."""
    condition = BoundaryCondition("isometric", quantum="hex")
    found = conformal_map(wall(*windows), condition)
    assert found.deck.is_flat_ring
    pattern = lay_pattern(found, PatternSettings())
    assert 800 < pattern.n_cells < 1300
    area = np.linalg.norm(area_vectors(pattern.faces, pattern.vertices), axis=1).sum() / 2
    assert area > 0.9 * found.surface.areas.sum()
    inner = (pattern.neighbours.values.reshape(-1, 6) >= 0).all(axis=1)
    assert inner.sum() > 0.75 * pattern.n_cells
    assert len(set(pattern.labels())) == pattern.n_cells
    assert 0 < lay_pattern(found, PatternSettings(around=pattern.around)).n_cells < 1300
