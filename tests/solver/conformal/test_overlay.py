"""Points carried through flips, and vertices inserted where they lead."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.arrays import Floats, Ints, no_progress
from hexwrap_solver.conformal import boundary, conformal_map
from hexwrap_solver.conformal.energy import opposite_lengths
from hexwrap_solver.conformal.orientation import inverted
from hexwrap_solver.conformal.robust import solve as robust
from hexwrap_solver.conformal.robust.delaunay import make_delaunay
from hexwrap_solver.conformal.robust.flip_sequence import FlipSequence
from hexwrap_solver.conformal.robust.mirror import MirrorMesh, mirror_mesh
from hexwrap_solver.conformal.robust.overlay import Overlay, insert
from hexwrap_solver.conformal.robust.transport import Places
from hexwrap_solver.conformal.types import BoundaryCondition, Cones, ConformalMap, Targets
from hexwrap_solver.surface.types import Surface
from tests.solver.conformal.annuli import bump
from tests.solver.conformal.checks import faults
from tests.solver.conformal.torture import TORTURE, crooked_prism, random_flips, taken_in


def _mirrored(surface: Surface) -> MirrorMesh:
    log_length = np.log(opposite_lengths(surface.vertices, surface.faces))[[2, 0, 1]].T.ravel()
    return mirror_mesh(surface, log_length, robust.winding_of(robust.annulus_sheets(surface)).ravel())


def _everywhere(mesh: MirrorMesh, random: np.random.Generator) -> Places:
    """A point in every triangle, and one on every edge of the boundary."""
    first = mesh.triangles()[0]
    inside = random.dirichlet(np.ones(3), len(first))
    cells = mesh.chain()
    share = random.random(len(cells))
    rim = np.stack([share, 1 - share, np.zeros(len(cells))], axis=1)
    half_edge = np.concatenate([first, cells])
    return Places(half_edge, np.concatenate([inside, rim]), np.zeros(len(half_edge), dtype=np.int64))


def _corners(mesh: MirrorMesh, half_edge: Ints) -> Ints:
    apex = np.where(mesh.outer[half_edge], -1, mesh.origin[mesh.prev[half_edge]])
    return np.stack([mesh.origin[half_edge], mesh.origin[mesh.next[half_edge]], apex], axis=1)


def _norm(mesh: MirrorMesh, at: Places, u: Floats) -> tuple[Floats, Floats]:
    """(k,) Minkowski norm ⟨p, p⟩ of points, and how far they are above the mirror line."""
    length, h = mesh.scaled(u), at.half_edge
    following, before, outer = mesh.next[h], mesh.prev[h], mesh.outer[h]
    a, b, c = at.weight.T
    square = np.exp(2 * length)
    norm = -a * b * square[h >> 1]
    norm -= np.where(outer, 0.0, b * c * square[following >> 1] + c * a * square[before >> 1])
    m, n = (np.exp(mesh.cross_length(x, length)) for x in (h, following))
    norm += np.where(outer, c**2 - c * (a * m + b * n), 0.0)
    return norm, np.where(outer, (a * m + b * n) / 2 - c, 0.0)


def test_flips_of_the_hyperbolic_structure_keep_the_norm_of_every_point() -> None:
    mesh, random = _mirrored(bump(24, 10)), np.random.default_rng(2)
    make_delaunay(mesh, np.zeros(mesh.n), euclidean=True)
    u = random.normal(scale=1.5, size=mesh.n)
    start = _everywhere(mesh, random)
    corners = _corners(mesh, start.half_edge)
    scaled = start.weight * np.where(corners >= 0, np.exp(-u[corners]), 1.0)
    start = Places(start.half_edge, scaled, start.power)
    before, _ = _norm(mesh, start, u)
    flips = FlipSequence(with_points=True)
    assert make_delaunay(mesh, u, do=flips.flip) > 100
    end = flips.transport(start, len(mesh.origin))
    after, above = _norm(mesh, end, u)
    assert mesh.outer[end.half_edge].sum() > 50
    assert (end.weight >= 0).all()
    assert above.min() > -1e-10
    assert np.abs(after - before).max() < 1e-11 * np.abs(before).max()


def test_flips_there_and_back_bring_every_point_back() -> None:
    mesh, random = _mirrored(bump(24, 10)), np.random.default_rng(3)
    make_delaunay(mesh, np.zeros(mesh.n), euclidean=True)
    start = _everywhere(mesh, random)
    flips = FlipSequence(with_points=True)
    u = random.normal(scale=1.0, size=mesh.n)
    before = _by_vertex(mesh, start)
    corners = _corners(mesh, start.half_edge)
    make_delaunay(mesh, u, do=flips.flip)
    scaled = start.weight * np.where(corners >= 0, np.exp(-u[corners]), 1.0)
    there = flips.transport(Places(start.half_edge, scaled, start.power), len(mesh.origin))
    corners = _corners(mesh, there.half_edge)
    back = FlipSequence(with_points=True)
    make_delaunay(mesh, np.zeros(mesh.n), do=back.flip)
    scaled = there.weight * np.where(corners >= 0, np.exp(u[corners]), 1.0)
    again = back.transport(Places(there.half_edge, scaled, there.power), len(mesh.origin))
    assert np.abs(_by_vertex(mesh, again) - before).max() < 1e-9


def _by_vertex(mesh: MirrorMesh, at: Places) -> Floats:
    """(k, n) weights of points for all vertices."""
    weight = np.zeros((len(at.half_edge), mesh.n + 1))
    np.put_along_axis(weight, _corners(mesh, at.half_edge), at.weight, axis=1)
    return weight[:, :-1]


def _overlay(surface: Surface) -> tuple[Overlay, ConformalMap, Targets]:
    problem, cut = robust.uncollapsed(robust.problem_of(surface, boundary.straight(surface), None), True)
    flat = robust.flatten(problem, cut, Cones.none(), no_progress)
    found, lift, _ = robust.draw(problem, flat)
    return Overlay(found, flat.log_length, flat.winding, flat.descent.u, lift), found, problem.targets


def _points(surface: Surface, random: np.random.Generator) -> tuple[Ints, Floats, Ints]:
    face = np.repeat(np.arange(len(surface.faces)), 3)
    weight = random.dirichlet(np.ones(3), len(face))
    owner = surface.faces[face, random.integers(3, size=len(face))]
    return face, weight, owner


def test_a_flat_cylinder_maps_to_itself_between_vertices_too() -> None:
    random = np.random.default_rng(7)
    surface = crooked_prism(24, random)
    overlay, found, _ = _overlay(surface)
    assert found.flips > 20
    face, weight, owner = _points(surface, random)
    uv, u = overlay.place(face, weight, owner)
    sheet = overlay.sheets(face, owner)
    corners = found.corners()[face]
    flat = (corners * weight).sum(axis=1)
    shift = sheet - found.sheet[face, 0]
    assert np.abs(found.deck.apply(uv, shift) - flat).max() < 1e-11 * found.circumference
    assert np.ptp(u) < 1e-11


def test_inserted_vertices_change_nothing_for_the_others() -> None:
    surface = TORTURE["retriangulated"](np.random.default_rng(0))
    overlay, found, targets = _overlay(surface)
    assert inverted(found).sum() > 20
    inserted = insert(overlay, targets)
    assert inserted is not None
    refined = inserted.map
    n = len(found.uv)
    assert len(refined.uv) > n
    assert np.array_equal(refined.uv[:n], found.uv)
    assert np.array_equal(refined.log_scale[:n], found.log_scale)
    assert faults(refined) == []


@pytest.mark.parametrize("name", ["retriangulated", "noisy", "eared"])
def test_faces_lie_side_by_side_but_for_one_cut(name: str) -> None:
    found = conformal_map(TORTURE[name](np.random.default_rng(0)), BoundaryCondition())
    assert found.flips > 100
    surface, corners = found.surface, found.corners()
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    inner = np.flatnonzero(surface.twin >= 0)
    twin = surface.twin[inner]
    apart = np.abs(start[inner] - end[twin]) + np.abs(end[inner] - start[twin]) > 1e-6 * found.circumference
    banks = inner[apart]
    vertices, count = np.unique(surface.faces.ravel()[banks], return_counts=True)
    on_loops = np.isin(vertices, np.concatenate(surface.loops))
    assert (count == np.where(on_loops, 1, 2)).all()  # both banks pass every vertex once
    assert on_loops.sum() == 2


def test_corners_that_open_beyond_a_straight_angle_end_in_few_rounds() -> None:
    random = np.random.default_rng(2)
    tower = bump(8, 6)
    surface = taken_in(tower.vertices, random_flips(tower.faces, len(tower.vertices), random, 1500))
    overlay, found, targets = _overlay(surface)
    assert inverted(found).any()
    refined = insert(overlay, targets)
    assert refined is not None
    assert faults(refined.map) == []
    assert len(refined.map.uv) < 2 * len(surface.vertices)
