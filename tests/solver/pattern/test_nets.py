"""Patterns on nets: disks, rings with openings, surfaces with singularities, closed ones.

The theorems: the cells' Euler characteristic is the surface's; every node inside has the degree of the
tiling; every interior cell has as many neighbours as corners, and at a singularity of index k these are k
fewer; nothing depends on the numbering.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap, Deck
from hexwrap_solver.domain import flatten, lift
from hexwrap_solver.errors import NotAdaptedError
from hexwrap_solver.geometry import face_normals, normalize
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.place.choose import place_lattice
from hexwrap_solver.pattern.place.net import place_on_net
from hexwrap_solver.pattern.place.placement import edge_angle
from hexwrap_solver.pattern.place.polygons import Polygons
from hexwrap_solver.pattern.place.rows import rows_along
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from hexwrap_solver.surface import surface_from_mesh
from hexwrap_solver.surface.topology import next_half_edge
from hexwrap_solver.surface.types import LEAST_COSINE
from tests.solver.pattern import annuli, nets
from tests.solver.pattern.folded import grid

SIDES = {"hex": 6, "triangle": 3, "quad": 4}
DEGREE = {"hex": 3, "triangle": 6, "quad": 4}

CASES = {
    "roof": nets.roof,
    "dome": nets.dome,
    "pentagon": lambda: nets.dome(((0.0, 0.0, 1),)),
    "heptagon": lambda: nets.dome(((2.0, 1.0, -1),)),
    "three": lambda: nets.dome(((4.0, 0.0, 1), (-4.0, 1.0, 1), (0.0, -4.0, -1))),
    "opening": lambda: nets.tower(1),
    "openings": lambda: nets.tower(3),
    "closed": lambda: nets.ellipsoid("hex"),
}


def euler(pattern: Pattern) -> int:
    inner = np.count_nonzero(pattern.neighbours.values >= 0)
    edges = len(pattern.faces.values) - inner // 2
    return len(pattern.vertices) - edges + pattern.n_cells


def area_vectors(points: np.ndarray, faces: Ragged) -> np.ndarray:
    """(f, 3)"""
    tail, head = points[faces.values], points[faces.values[faces.next()]]
    return np.add.reduceat(np.cross(tail, head), faces.offsets[:-1], axis=0) / 2


def on_boundary(pattern: Pattern) -> np.ndarray:
    """(p,) vertices on the pattern's boundary."""
    at = np.zeros(len(pattern.vertices), dtype=bool)
    side = np.flatnonzero(pattern.neighbours.values < 0)
    corner = pattern.faces.values
    at[corner[side]] = at[corner[pattern.faces.next()[side]]] = True
    return at


def check_theorems(cmap: ConformalMap, pattern: Pattern) -> None:
    assert euler(pattern) == 2 - len(cmap.surface.loops)
    if pattern.whole.all():
        inside = ~on_boundary(pattern)
        degree = np.bincount(pattern.faces.values, minlength=len(pattern.vertices))
        assert (degree[inside] == DEGREE[pattern.kind]).all()
    whole = pattern.whole
    assert (pattern.faces.lengths[whole] == SIDES[pattern.kind] - pattern.index[whole]).all()
    assert (pattern.index[~whole] == 0).all()
    assert sorted(pattern.index[pattern.index != 0]) == sorted(cmap.cones.index)
    # Neighbours are mutual, along the same edge.
    corner, following = pattern.faces.values, pattern.faces.values[pattern.faces.next()]
    edges = {(a, b): f for a, b, f in zip(corner, following, pattern.faces.row, strict=True)}
    assert len(edges) == len(corner)
    across = [edges.get((b, a), -1) for a, b in zip(corner, following, strict=True)]
    assert across == pattern.neighbours.values.tolist()
    assert len(set(pattern.labels())) == pattern.n_cells


@pytest.mark.parametrize("boundary", ["whole", "trim"])
@pytest.mark.parametrize("case", list(CASES))
def test_hexagons_close_up_on_every_surface(case, boundary):
    cmap = CASES[case]()
    pattern = lay_pattern(cmap, PatternSettings(boundary=boundary))
    check_theorems(cmap, pattern)
    assert pattern.distortion < 0.1


@pytest.mark.parametrize("kind", ["triangle", "quad"])
@pytest.mark.parametrize("case", ["roof", "dome"])
def test_disks_take_every_kind(case, kind):
    cmap = CASES[case]()
    for boundary in ("whole", "trim"):
        check_theorems(cmap, lay_pattern(cmap, PatternSettings(kind=kind, boundary=boundary)))


def test_quads_close_around_eight_triangles():
    cmap = nets.ellipsoid("quad")
    check_theorems(cmap, lay_pattern(cmap, PatternSettings(kind="quad")))


def test_a_rectangular_roof_is_filled_by_quads_up_to_its_four_sides():
    """Whole cells and trimmed ones are the same, and cover everything."""
    cmap = nets.roof()
    whole = lay_pattern(cmap, PatternSettings(kind="quad"))
    cut = lay_pattern(cmap, PatternSettings(kind="quad", boundary="trim"))
    assert whole.n_cells == cut.n_cells
    assert cut.whole.all()
    corners = nets.nearest(cmap.surface, [[0, 0, 0], [30, 0, 0], [30, 20, 0], [0, 20, 0]])
    away = np.linalg.norm(whole.vertices[None] - cmap.surface.vertices[corners][:, None], axis=2)
    assert away.min(axis=1).max() < 1e-9
    assert whole.distortion < 0.05


def check_rows(cmap, lattice, settings, loops):
    """Every edge of the loops runs along a row of nodes. Returns the placement."""
    placed = place_lattice(cmap, lattice, settings)
    z = placed.glued.corners(cmap.surface.faces, placed.place).ravel()
    on_loop = np.isin(cmap.surface.faces.ravel(), np.concatenate([cmap.surface.loops[i] for i in loops]))
    rim = np.flatnonzero((cmap.surface.twin < 0) & on_loop)
    along = z[next_half_edge(rim)] - z[rim]
    steps = np.angle(along / lattice.forward) / lattice.quantum
    assert np.abs(steps - np.rint(steps)).max() < 1e-9
    lines = rows_along(lattice, edge_angle(lattice, settings), settings.boundary)
    row = ((np.conj(1j * along / abs(along)) * z[rim]).real - lines.first) / lines.period
    assert np.abs(row - np.rint(row)).max() < 1e-9
    return placed


@pytest.mark.parametrize("kind", ["hex", "quad"])
@pytest.mark.parametrize(("holes", "loops"), [(1, (2,)), (1, (0, 2)), (2, (2, 3))])
def test_straight_openings_are_lattice_lines(holes, loops, kind):
    """Also where several pieces of the cut reach them, so that no single motion is their holonomy."""
    cmap, settings = nets.straightened(holes, loops, kind), PatternSettings(kind=kind, around=60)
    words = Polygons.of(cmap, LATTICES[kind], list(loops)).closed
    assert max(len(word) for _, word in words) > 1
    placed = check_rows(cmap, LATTICES[kind], settings, loops)
    assert placed.distortion < 0.1
    check_theorems(cmap, lay_pattern(cmap, settings))


@pytest.mark.parametrize("doors", [1, 2])
def test_frames_of_doors_are_lattice_lines(doors):
    """Every boundary edge runs along a row of nodes, around each door the motions are a translation of the
    lattice, and quads fill the wall up to its ends and frames."""
    cmap, lattice = nets.doors(doors), LATTICES["quad"]
    settings = PatternSettings(kind="quad", around=40)
    placed = check_rows(cmap, lattice, settings, range(2 + doors))
    assert placed.distortion < 0.2
    assert (placed.isometries[:, 0] == 0).all()
    pattern = lay_pattern(cmap, settings)
    check_theorems(cmap, pattern)
    area = np.linalg.norm(area_vectors(pattern.vertices, pattern.faces), axis=1).sum()
    assert area / cmap.surface.areas.sum() > 0.99


def test_frames_that_would_cost_too_much_are_told():
    """Cells as large as the door."""
    pattern = lay_pattern(nets.doors(1), PatternSettings(kind="quad", around=5))
    assert pattern.distortion <= 0.5
    assert any("smaller cells" in note for note in pattern.notes)


@pytest.mark.parametrize("case", ["dome", "pentagon", "opening"])
def test_trimmed_cells_cover_the_surface(case):
    cmap = CASES[case]()
    pattern = lay_pattern(cmap, PatternSettings(boundary="trim"))
    z, following = pattern.corners, pattern.faces.next()
    plain = pattern.index == 0  # at a singularity the polygon of the plane does not close
    area = np.add.reduceat((z.conj() * z[following]).imag / 2, pattern.faces.offsets[:-1])
    p, q, r = cmap.corners().T
    domain = float((((q - p).conj() * (r - p)).imag / 2).sum())
    assert (area[plain] > 0).all()
    one = float(np.median(area[pattern.whole]))
    singular = sum((6 - k) / 6 for k in pattern.index[~plain])
    assert area[plain].sum() + one * singular == pytest.approx(domain, rel=2e-3)


@pytest.mark.parametrize("case", ["three", "openings"])
def test_cells_are_regular_in_the_domain_but_for_the_distortion_told(case):
    cmap = CASES[case]()
    pattern = lay_pattern(cmap, PatternSettings())
    plain = np.repeat(pattern.index == 0, pattern.faces.lengths)
    side = abs(pattern.corners[pattern.faces.next()] - pattern.corners)[plain]
    assert side.max() / side.min() < (1 + pattern.distortion) ** 3 + 0.05


def shuffled(cmap: ConformalMap, seed: int) -> ConformalMap:
    """The same net with its faces in another order, begun at other corners."""
    rng = np.random.default_rng(seed)
    net, surface = cmap.net, cmap.surface
    m = len(surface.faces)
    order, first = rng.permutation(m), rng.integers(0, 3, m)
    place = np.empty(m, dtype=np.int64)
    place[order] = np.arange(m)
    corner = (first[:, None] + np.arange(3)) % 3

    def moved(table: np.ndarray) -> np.ndarray:
        return np.take_along_axis(table[order], corner, axis=1)

    across = moved(net.across)
    new = Net(
        moved(net.corners),
        np.where(across >= 0, place[across], -1),
        moved(net.crossing),
        net.angle,
        net.translation,
        net.inverse,
    )
    return replace(cmap, surface=replace(surface, faces=moved(surface.faces)), domain=new)


@pytest.mark.parametrize("case", ["dome", "pentagon", "opening"])
def test_nothing_depends_on_the_numbering_of_faces(case):
    cmap = CASES[case]()
    one, two = (lay_pattern(c, PatternSettings()) for c in (cmap, shuffled(cmap, 1)))
    assert one.n_cells == two.n_cells

    away = np.linalg.norm(places_of_cells(one)[:, None] - places_of_cells(two)[None], axis=2)
    assert away.min(axis=1).max() < 1e-5 * one.edge_length


def spiral() -> ConformalMap:
    """A flat ring that does not quite close."""
    cmap = annuli.flat_cone(2 * np.pi, 1.0, 3.0, 48, 10)
    step = 0.5 + 0.3j
    uv = cmap.uv + step * np.tile(np.arange(48) / 48, 11)
    return cmap.with_domain(uv=uv, deck=Deck(2 * np.pi, step))


SHEETS = {
    "cone": lambda: annuli.flat_cone(np.pi, 1.0, 2.0, 48, 10),
    "saddle": lambda: annuli.flat_cone(-np.pi, 1.0, 2.0, 48, 10, cut=5),
    "ring": spiral,
    "tube": lambda: annuli.revolution(np.cosh, np.linspace(-1, 1, 15), 40, cut=3, turn=0.7 + 0.4j),
}


@pytest.mark.parametrize("kind", ["hex", "quad", "trihexagonal"])
@pytest.mark.parametrize("case", SHEETS)
def test_on_one_generator_the_search_of_nets_finds_what_is_solved_for(case, kind):
    """The same lattice up to its symmetries, and as little distortion."""
    cmap, lattice = SHEETS[case](), LATTICES[kind]
    asked = PatternSettings(kind=kind, around=48, align="none")
    solved, searched = place_lattice(cmap, lattice, asked), place_on_net(cmap, lattice, asked)
    p, q = (found.glued.corners(cmap.surface.faces, found.place) for found in (solved, searched))
    turn = (q[:, 1] - q[:, 0]) / (p[:, 1] - p[:, 0])
    np.testing.assert_allclose(turn**lattice.fold, 1, atol=1e-9)
    apart = q - turn[:, None] * p
    np.testing.assert_allclose([lattice.without_translations(z) for z in apart.ravel()], 0, atol=1e-9)
    assert searched.distortion == pytest.approx(solved.distortion, abs=1e-9)


@pytest.mark.parametrize("case", ["dome", "pentagon", "opening", "closed"])
def test_lifted_and_laid_down_again(case):
    cmap = CASES[case]()
    faces = np.arange(0, len(cmap.surface.faces), 7)
    weights = np.random.default_rng(0).dirichlet(np.ones(3), len(faces))
    z = (weights * cmap.corners()[faces]).sum(axis=1)
    up = lift(cmap, z)
    assert up.inside.all()
    down = flatten(cmap, up.points)
    assert down.distance.max() < 1e-9
    again = lift(cmap, down.uv)
    np.testing.assert_allclose(again.points, up.points, atol=1e-7)


def places_of_cells(pattern: Pattern) -> np.ndarray:
    """(c, 3) means of the corners."""
    total = np.add.reduceat(pattern.vertices[pattern.faces.values], pattern.faces.offsets[:-1], axis=0)
    return total / pattern.faces.lengths[:, None]


@pytest.mark.parametrize("boundary", ["whole", "trim"])
def test_beside_windows_the_pattern_is_what_it_would_be_without_them(boundary):
    """Cells over openings are left out or cut; all whole cells are cells of the full pattern."""
    settings = PatternSettings(around=30, boundary=boundary)
    wall, full = lay_pattern(nets.cut_tower(), settings), lay_pattern(nets.filled_tower(), settings)
    assert nets.cut_tower().kind == "cylinder"
    away = np.linalg.norm(
        places_of_cells(wall)[wall.whole][:, None] - places_of_cells(full)[full.whole][None], axis=2
    )
    assert away.min(axis=1).max() < 1e-9 * 30
    assert wall.whole.sum() < full.whole.sum()
    assert wall.around == full.around
    assert wall.distortion == full.distortion
    if boundary == "trim":
        assert euler(wall) == -3
        z, following = wall.corners, wall.faces.next()
        area = float((z.conj() * z[following]).imag.sum() / 2)
        p, q, r = nets.cut_tower().corners().T
        assert area == pytest.approx(float((((q - p).conj() * (r - p)).imag / 2).sum()), rel=2e-3)


@pytest.mark.parametrize("boundary", ["whole", "trim"])
def test_a_cell_around_a_small_opening_is_left_out_and_told(boundary):
    """Wherever the opening lies, no cell covers it."""
    told = 0
    for shift in (0.0, 0.25, 0.5, 0.75):
        settings = PatternSettings(edge_length=2.0, boundary=boundary, phase=(shift, shift), align="none")
        pattern = lay_pattern(nets.tower(1, wide=1), settings)
        inside = any("opening lies inside" in note for note in pattern.notes)
        told += inside
        if inside or boundary == "trim":
            assert euler(pattern) == -1
        else:
            assert euler(pattern) <= -1
    assert told or boundary == "trim"


@pytest.mark.parametrize("seed", range(3))
def test_on_coarse_meshes_that_fold_back_every_cell_looks_outward(seed):
    """Triangles larger than cells, at vertices whose normals look away from some of them."""
    rng = np.random.default_rng(seed)
    turn, height = np.meshgrid(np.arange(9) * 2 * np.pi / 9, np.arange(7.0))
    radius = rng.uniform(1.0, 4.0, turn.shape)
    rings = np.stack([radius * np.cos(turn), radius * np.sin(turn), 2 * height], axis=2)
    surface = surface_from_mesh(grid(rings + rng.normal(0, 0.5, rings.shape)))
    own = normalize(face_normals(surface.vertices, surface.faces))
    middle = np.full((len(own), 3), 1 / 3)
    every = surface.normals_at(np.repeat(np.arange(len(own)), 3), np.tile(np.eye(3), (len(own), 1)))
    rise = np.einsum("kd,kd->k", every, np.repeat(own, 3, axis=0))
    at_vertices = np.einsum("mcd,md->mc", surface.normals[surface.faces], own).ravel()
    assert at_vertices.min() < 0
    assert rise.min() >= LEAST_COSINE - 1e-12
    np.testing.assert_allclose(rise[at_vertices > LEAST_COSINE], at_vertices[at_vertices > LEAST_COSINE])
    assert (np.einsum("kd,kd->k", surface.normals_at(np.arange(len(own)), middle), own) > 0).all()
    pattern = lay_pattern(conformal_map(surface, BoundaryCondition("straight")), PatternSettings(around=60))
    area = area_vectors(pattern.vertices, pattern.faces)
    corner = pattern.faces.values
    side = np.add.reduceat(pattern.normals[corner], pattern.faces.offsets[:-1], axis=0)
    assert (np.einsum("kd,kd->k", area, side) > 0).all()
    assert pattern.n_cells > 1000


def test_a_quantum_that_does_not_suit_the_pattern_is_refused():
    with pytest.raises(NotAdaptedError, match="multiple of π/2"):
        lay_pattern(CASES["pentagon"](), PatternSettings(kind="quad"))
