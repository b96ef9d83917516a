"""From boundary conditions to targets: Gauss–Bonnet for each mode, and the even spreading of the paper."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hexwrap_solver.arrays import Floats, Ragged
from hexwrap_solver.conformal import boundary, conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.errors import BoundaryError
from hexwrap_solver.surface import SentMesh, surface_from_mesh
from tests.solver.conformal.annuli import bump, grid, revolution, uneven

TOWER = bump(24, 8)
angles = st.lists(st.floats(0.02, 6.0), min_size=3, max_size=40).map(lambda x: np.array(x, dtype=float))


@settings(max_examples=100, deadline=None)
@given(angles, st.floats(-0.5, 0.5))
def test_spreading_adds_the_same_to_every_angle(given_angles: Floats, difference: float) -> None:
    assume(difference > -given_angles.sum() / 2)
    wanted = boundary.cone_angle(given_angles) - difference
    spread = boundary.spread_evenly(given_angles, wanted)
    assert boundary.cone_angle(spread) == pytest.approx(wanted, abs=1e-11)
    change = spread - given_angles
    assert (spread >= given_angles / 2 - 1e-12).all()
    whole = spread > given_angles / 2 + 1e-12  # the others had to keep half of their angle
    if whole.any():
        assert np.ptp(change[whole]) < 1e-12
        assert (change[~whole] >= change[whole].max() - 1e-12).all()


def test_where_little_is_left_all_give_the_same_part() -> None:
    few = np.array([0.5, 0.25, 0.125])
    spread = boundary.spread_evenly(few, boundary.cone_angle(few) + 0.5)
    assert spread.sum() == pytest.approx(0.375, abs=1e-14)
    assert np.ptp(spread / few) < 1e-14


def test_a_loop_cannot_give_more_than_it_has() -> None:
    few = np.array([0.2, 0.1, 0.1])
    with pytest.raises(BoundaryError, match=r"sum to 0\.4 rad"):
        boundary.spread_evenly(few, boundary.cone_angle(few) + 0.5)


@settings(max_examples=100, deadline=None)
@given(st.integers(-12, 12), st.floats(-0.4, 0.4), st.sampled_from([np.pi / 3, np.pi / 2]))
def test_the_nearest_multiple(k: int, off: float, quantum: float) -> None:
    assert boundary.nearest_multiple((k + off) * quantum, quantum) == pytest.approx(k * quantum, abs=1e-14)


def test_cone_angles_lose_their_rounding_and_nothing_else() -> None:
    assert boundary.snapped(np.pi / 3 + 1e-13) == boundary.nearest_multiple(1.0, np.pi / 3)
    assert boundary.snapped(-3e-12) == 0
    assert boundary.snapped(1.0) == 1.0
    assert boundary.snapped(1e-8) == 1e-8


def test_every_target_satisfies_gauss_bonnet() -> None:
    """Σ (2π − Θ) inside + Σ (π − Θ) on the boundary = 0, shared unknowns counted by their totals."""
    loops = TOWER.loops
    inside = len(TOWER.vertices) - len(loops[0]) - len(loops[1])
    straight = boundary.straight(TOWER)
    assert straight.angle.sum() == pytest.approx(2 * np.pi * inside + np.pi * (len(loops[0]) + len(loops[1])))
    tied = boundary.targets(TOWER, (np.pi / 3, -np.pi / 3))
    free = tied.angle[tied.shared < 0].sum()
    loop_0 = len(loops[0]) * np.pi - np.pi / 3  # Σκ = K
    assert free + tied.shared_angle[1] + loop_0 == pytest.approx(np.pi * len(TOWER.faces))


def test_optimal_spreading_keeps_u_constant_on_each_loop() -> None:
    cmap = conformal_map(TOWER, BoundaryCondition("isometric", quantum="hex", spread="optimal"))
    first, second = (cmap.log_scale[loop] for loop in TOWER.loops)
    assert np.ptp(first) == np.ptp(second) == 0
    assert second[0] != first[0]


@pytest.mark.parametrize("spread", ["even", "optimal"])
def test_no_loop_is_preferred(spread: Literal["even", "optimal"]) -> None:
    """Numbered the other way round, the surface has the same map; boundary lengths are kept on average."""
    wide = grid(40, 12, lambda phi, s: uneven(phi, 1.5 * s))
    n = len(wide.vertices)
    condition = BoundaryCondition("isometric", quantum="hex", spread=spread)
    scales = []
    for vertices, faces in ((wide.vertices, wide.faces), (wide.vertices[::-1], n - 1 - wide.faces)):
        surface = surface_from_mesh(SentMesh(vertices, Ragged.from_table(faces)))
        cmap = conformal_map(surface, condition)
        scales.append(cmap.log_scale[surface.vertex_of_input])
        rim = [(loop, np.roll(loop, -1)) for loop in surface.loops]
        length = [np.linalg.norm(surface.vertices[b] - surface.vertices[a], axis=1) for a, b in rim]
        mean = [(cmap.log_scale[a] + cmap.log_scale[b]) / 2 for a, b in rim]
        assert np.concatenate(length) @ np.concatenate(mean) == pytest.approx(0, abs=1e-10)
    np.testing.assert_allclose(scales[1][::-1], scales[0], atol=1e-9)


def test_even_spreading_keeps_boundary_lengths_on_average() -> None:
    cmap = conformal_map(TOWER, BoundaryCondition("isometric", quantum="hex"))
    assert np.abs(np.concatenate([cmap.log_scale[loop] for loop in TOWER.loops])).max() < 0.2
    exact = conformal_map(TOWER, BoundaryCondition("isometric"))
    changes = [(a - b) for a, b in zip(cmap.boundary_angles, exact.boundary_angles, strict=True)]
    for change in changes:
        assert np.ptp(change) < 1e-10


def test_an_isometric_boundary_keeps_every_boundary_length() -> None:
    vase = grid(30, 10, revolution(lambda s: 2 + np.sin(3 * s), lambda s: 4 * s))
    cmap = conformal_map(vase, BoundaryCondition("isometric"))
    for loop in vase.loops:
        drawn = np.abs(np.diff(cmap.deck.apply(cmap.uv[loop], 0)))
        length = np.linalg.norm(np.diff(vase.vertices[loop], axis=0), axis=1)
        same_sheet = drawn < 1.5 * length  # not the one edge across the cut
        assert same_sheet.sum() >= len(loop) - 2
        np.testing.assert_allclose(drawn[same_sheet], length[same_sheet], rtol=1e-11)
