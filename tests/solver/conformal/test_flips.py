"""The route by flips: its theorems, and the meshes it is for."""

from __future__ import annotations

from copy import deepcopy
from typing import Literal

import numpy as np
import pytest

from hexwrap_solver.arrays import Floats, no_progress
from hexwrap_solver.conformal import boundary, conformal_map, newton
from hexwrap_solver.conformal.energy import Energy, opposite_lengths
from hexwrap_solver.conformal.newton import largest
from hexwrap_solver.conformal.robust import solve as robust
from hexwrap_solver.conformal.robust import solve_with_flips
from hexwrap_solver.conformal.robust.delaunay import cosine_sums, flip, make_delaunay
from hexwrap_solver.conformal.robust.descent import RULES, FlipEnergy, FlipPoint, descend
from hexwrap_solver.conformal.robust.flip_sequence import FlipSequence
from hexwrap_solver.conformal.robust.metric import angle_sums, measure, measure_delaunay
from hexwrap_solver.conformal.robust.mirror import MirrorMesh, mirror_mesh
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.surface.types import Surface
from tests.solver.conformal.annuli import annulus, bump, catenoid, grid, uneven
from tests.solver.conformal.checks import faults
from tests.solver.conformal.shared import MESHES, load
from tests.solver.conformal.torture import TORTURE, crooked_prism, random_flips


def _mirrored(surface: Surface) -> MirrorMesh:
    sheet = robust.annulus_sheets(surface)
    turn = (np.roll(sheet, -1, axis=1) - sheet).ravel()
    lengths = opposite_lengths(surface.vertices, surface.faces)
    return mirror_mesh(surface, np.log(lengths)[[2, 0, 1]].T.ravel(), turn)


def _random_u(n: int, size: float, seed: int = 3) -> Floats:
    return np.random.default_rng(seed).normal(scale=size, size=n)


def test_flips_undone_leave_the_first_triangulation() -> None:
    """Links, windings and crossings are those of before, and every triangle's sides add up to zero."""
    mesh = _mirrored(bump(24, 10))
    make_delaunay(mesh, np.zeros(mesh.n), euclidean=True)
    before = deepcopy(mesh)
    flips, u = FlipSequence(), _random_u(mesh.n, 1.5)
    assert make_delaunay(mesh, u, do=flips.flip) > 100
    assert (mesh.crossing != before.crossing).any()
    vector = flips.undo(mesh, measure(mesh, u))
    linked = ~np.repeat(before.crossing, 2)
    for name in ("origin", "outer", "crossing", "winding"):
        assert (getattr(mesh, name) == getattr(before, name)).all()
    for name, of in (("next", linked), ("prev", linked), ("cross", before.outer)):
        assert (getattr(mesh, name)[of] == getattr(before, name)[of]).all()
    sides = vector[mesh.triangles()]
    assert np.abs(sides.sum(axis=0)).max() < 1e-12 * np.abs(sides).max()


def test_where_no_edge_needs_a_flip_both_routes_agree() -> None:
    surface = catenoid(24, 8)
    targets = boundary.straight(surface)
    found = solve_with_flips(surface, targets)
    plain = conformal_map(surface, BoundaryCondition())
    assert found.inserted == 0
    ratio = np.ptp(found.uv.imag) / found.circumference
    assert abs(ratio - np.ptp(plain.uv.imag) / plain.circumference) < 1e-12
    assert faults(found, (targets.angle[surface.loops[0]], targets.angle[surface.loops[1]])) == []


def test_after_flips_every_edge_is_delaunay_and_triangle_inequalities_hold() -> None:
    surface = bump(24, 10)
    mesh = _mirrored(surface)
    u = _random_u(mesh.n, 1.5)
    assert make_delaunay(mesh, u) > 0
    assert mesh.crossing.any()
    cosines, terms = cosine_sums(mesh, np.arange(len(mesh.crossing)), mesh.scaled(u))
    assert (cosines / terms).min() > -1e-13
    sides = mesh.scaled(u)[mesh.triangles() >> 1]
    lengths = np.sort(np.exp(sides - sides.max(axis=0)), axis=0)
    assert (lengths[2] <= lengths[0] + lengths[1]).all()


def test_flips_there_and_back_restore_every_length() -> None:
    surface = bump(24, 10)
    mesh = _mirrored(surface)
    make_delaunay(mesh, np.zeros(mesh.n))
    before = np.sort(mesh.log_length)
    make_delaunay(mesh, _random_u(mesh.n, 1.5))
    assert np.abs(np.sort(mesh.log_length) - before).max() > 1e-3
    make_delaunay(mesh, np.zeros(mesh.n))
    assert np.abs(np.sort(mesh.log_length) - before).max() < 1e-11


@pytest.mark.parametrize("euclidean", [True, False])
def test_flips_over_the_mirror_line_and_back_restore_every_length(euclidean: bool) -> None:

    def staggered(phi: Floats, s: Floats) -> Floats:
        """Apexes stand above the middles of the boundary edges."""
        phi, r = phi - np.pi / 24 * (np.rint(5 * s) % 2), 1 + 0.4 * s
        return np.stack([r * np.cos(phi), r * np.sin(phi), 2 * s], axis=1)

    mesh = _mirrored(grid(24, 5, staggered, alternate=False))
    length = mesh.log_length.copy()
    edges = np.flatnonzero(mesh.outer)[::3] >> 1
    flip(mesh, edges, length, euclidean)
    assert mesh.crossing[edges].all()
    assert np.abs(length - mesh.log_length)[edges].min() > 0.1
    flip(mesh, edges, length, euclidean)
    assert not mesh.crossing.any()
    assert np.abs(length - mesh.log_length).max() < 1e-13


def test_the_surface_has_one_delaunay_triangulation_however_its_faces_are_numbered() -> None:
    """Flips in another order take other ways to it, some of them over the mirror line and back."""
    random = np.random.default_rng(11)
    tower = grid(4, 3, uneven)
    vertices = tower.vertices + random.normal(scale=0.4, size=tower.vertices.shape)
    faces = random_flips(tower.faces, len(vertices), random, 60)
    found = []
    for _ in range(8):
        mesh = _mirrored(annulus(vertices, random.permutation(faces), tower.loops))
        make_delaunay(mesh, np.zeros(mesh.n), euclidean=True)
        found.append(np.sort(mesh.log_length))
    assert np.ptp(found, axis=0).max() < 1e-12


@pytest.mark.parametrize("size", [0.01, 0.3, 2.0])
def test_cotangents_find_every_edge_that_must_be_flipped(size: float) -> None:
    """The metric is that of the mesh on which all edges were looked at: the Delaunay metric is unique."""
    surface = TORTURE["retriangulated"](np.random.default_rng(1))
    quick, slow = _mirrored(surface), _mirrored(surface)
    for seed in range(3):
        u = _random_u(quick.n, size, seed)
        metric, _ = measure_delaunay(quick, u)
        make_delaunay(slow, u)
        assert make_delaunay(quick, u) == 0
        np.testing.assert_allclose(np.sort(metric.length), np.sort(slow.scaled(u)), atol=1e-11)
        np.testing.assert_allclose(angle_sums(quick, metric), angle_sums(slow, measure(slow, u)), atol=1e-10)


def test_gauss_bonnet_holds_in_every_delaunay_metric() -> None:
    surface = bump(24, 10)
    mesh = _mirrored(surface)
    for seed in range(5):
        u = _random_u(mesh.n, 2.0, seed)
        make_delaunay(mesh, u)
        total = angle_sums(mesh, measure(mesh, u)).sum()
        assert total == pytest.approx(np.pi * len(surface.faces), rel=1e-12)


def test_gradient_does_not_jump_across_flips_and_newton_direction_is_its_derivative() -> None:
    surface = bump(16, 6)
    energy = FlipEnergy(Energy(surface, boundary.straight(surface)), _mirrored(surface))
    x = energy.plain.unknowns_of(_random_u(len(surface.vertices), 1.0))
    point = energy.at(x)
    direction = energy.direction(point)
    step = 1e-6 / np.abs(direction).max()
    ahead, behind = (energy.at(x + t * direction).gradient for t in (step, -step))
    assert np.abs((ahead - behind) / (2 * step) + point.gradient).max() < 1e-6 * largest(point.gradient)
    # along a line full of flips the gradient stays continuous, and φ' grows
    far = _random_u(len(x), 2.0, 8)
    gradients = np.array([energy.at(x + t * far).gradient for t in np.linspace(0, 1, 400)])
    assert energy.flips > 20
    assert (np.diff(gradients @ far) > 0).all()


def test_steps_that_were_tried_in_vain_leave_no_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their flips must not stay under the Hessian of the next step."""
    surface = TORTURE["retriangulated"](np.random.default_rng(0))

    def iterations() -> int:
        energy = FlipEnergy(Energy(surface, boundary.straight(surface)), _mirrored(surface))
        return descend(energy, np.zeros(len(surface.vertices)), no_progress).iterations

    def astray(energy: FlipEnergy, point: FlipPoint, _: object) -> None:
        energy.at(point.x + _random_u(len(point.x), 0.5))

    monkeypatch.setattr(newton, "CHORDS", -1)
    expected = iterations()
    monkeypatch.setattr(newton, "CHORDS", np.inf)
    monkeypatch.setattr(newton, "_chord", astray)
    assert iterations() == expected


def test_a_disturbance_in_one_place_is_mended_there() -> None:
    """Local steps change nothing far away, and leave what a step of all unknowns then does at once."""
    surface = bump(60, 30)
    energy = FlipEnergy(Energy(surface, boundary.straight(surface)), _mirrored(surface))
    solution = descend(energy, np.zeros(energy.plain.n), no_progress)
    x = energy.plain.unknowns_of(solution.u)
    away = np.linalg.norm(energy.plain.points - energy.plain.points[len(x) // 2], axis=1)
    near = away < np.sort(away)[5]
    x[near] += [2.0, -1.0, 1.0, 2.0, -2.0]
    disturbed = energy.at(x)
    relaxed = newton.relaxed(energy, disturbed, RULES)
    assert largest(disturbed.gradient) > 1
    assert largest(relaxed.gradient) < RULES.large
    changed = np.flatnonzero(relaxed.x != x)
    assert 5 < len(changed) < newton.FEW * len(x)
    assert away[changed].max() < 0.5 * away.max()
    again = descend(energy, energy.plain.scale_of(relaxed.x), no_progress)
    np.testing.assert_allclose(again.u, solution.u, atol=1e-11)


@pytest.mark.parametrize("name", [name for name in sorted(MESHES) if MESHES[name].stat().st_size < 2e5])
@pytest.mark.parametrize("spread", ["even", "optimal", None])
def test_public_meshes_have_a_map(name: str, spread: Literal["even", "optimal"] | None) -> None:
    """The small ones; all of them in all modes: see ``test_torture``."""
    surface = load(MESHES[name])
    if spread is None:
        found = conformal_map(surface, BoundaryCondition())
        assert all(np.abs(angles - np.pi).max() < 1e-9 for angles in found.boundary_angles)
    else:
        found = conformal_map(surface, BoundaryCondition("isometric", quantum="hex", spread=spread))
        assert abs(found.deck.angle / (np.pi / 3) - np.round(found.deck.angle / (np.pi / 3))) < 1e-12
    assert faults(found) == []


def test_a_flat_cylinder_maps_to_itself_however_it_is_triangulated() -> None:
    surface = crooked_prism(24, np.random.default_rng(5))
    found = solve_with_flips(surface, boundary.straight(surface))
    assert found.flips > 50
    assert found.inserted == 0
    scale = np.exp(found.log_scale.mean())
    assert np.ptp(found.log_scale) < 1e-12
    assert found.circumference / scale == pytest.approx(48 * np.sin(np.pi / 24), rel=1e-12)
    assert (
        np.abs(np.abs(np.diff(found.uv.imag / scale)) - np.abs(np.diff(surface.vertices[:, 2]))).max() < 1e-12
    )
    assert faults(found) == []


def test_refinement_stays_on_the_surface_and_tells() -> None:
    """Ears collapse under straight sides, so edges behind them are split at their middles."""
    surface = TORTURE["eared"](np.random.default_rng(1))
    found = conformal_map(surface, BoundaryCondition())
    n = len(surface.vertices)
    assert found.inserted > 0
    assert any("inserted" in note for note in found.notes)
    assert np.array_equal(found.surface.vertices[:n], surface.vertices)
    assert (found.surface.input_vertex[n:] == -1).all()
    assert np.abs(np.linalg.norm(found.surface.normals, axis=1) - 1).max() < 1e-12
    assert _area(found.surface) == pytest.approx(_area(surface), rel=1e-12)


def _area(surface: Surface) -> float:
    a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_refinement_without_end_is_told_with_the_sent_vertices(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robust, "MAX_ROUNDS", 1)
    monkeypatch.setattr(robust, "insert", lambda *_: None)
    surface = TORTURE["retriangulated"](np.random.default_rng(0))
    with pytest.raises(ConvergenceError, match="remesh it") as caught:
        conformal_map(surface, BoundaryCondition())
    assert caught.value.vertices
    assert set(caught.value.vertices) <= set(surface.input_vertex.tolist())
