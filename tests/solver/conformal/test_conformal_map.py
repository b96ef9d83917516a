"""Theorems about the map: flatness, closed forms, what the contract says of uv, sheets and g."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.arrays import Floats
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import QUANTA, BoundaryCondition, ConformalMap
from tests.solver.conformal.annuli import bump, catenoid, corners_at, flat_cone, grid, revolution
from tests.solver.conformal.checks import faults

CONDITIONS = [
    BoundaryCondition(),
    BoundaryCondition("isometric"),
    BoundaryCondition("isometric", quantum="hex"),
    BoundaryCondition("isometric", quantum="hex", spread="optimal"),
    BoundaryCondition("isometric", quantum="quad"),
]


def assert_honest(cmap: ConformalMap) -> None:
    """Every promise of the contract's paragraph on ``map``, checked from outside."""
    surface, u, corners = cmap.surface, cmap.log_scale, cmap.corners()
    faces = surface.faces
    for k in range(3):
        i, j = faces[:, (k + 1) % 3], faces[:, (k + 2) % 3]
        length = np.linalg.norm(surface.vertices[i] - surface.vertices[j], axis=1) * np.exp((u[i] + u[j]) / 2)
        drawn = np.abs(corners[:, (k + 2) % 3] - corners[:, (k + 1) % 3])
        np.testing.assert_allclose(drawn, length, rtol=1e-8)
    edge_1, edge_2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    assert ((edge_1.conj() * edge_2).imag > 0).all()
    angle = np.stack(
        [
            np.angle((corners[:, (k + 2) % 3] - corners[:, k]) / (corners[:, (k + 1) % 3] - corners[:, k]))
            for k in range(3)
        ],
        1,
    )
    sums = np.bincount(faces.ravel(), weights=angle.ravel())
    inside = np.ones(len(sums), dtype=bool)
    for loop, told in zip(surface.loops, cmap.boundary_angles, strict=True):
        inside[loop] = False
        np.testing.assert_allclose(sums[loop], told, atol=1e-9)
    np.testing.assert_allclose(sums[inside], 2 * np.pi, atol=1e-9)
    assert abs((np.pi - cmap.boundary_angles[0]).sum() - cmap.deck.angle) < 1e-9
    assert abs((np.pi - cmap.boundary_angles[1]).sum() + cmap.deck.angle) < 1e-9
    assert cmap.closing_error < 1e-9


@pytest.mark.parametrize("condition", CONDITIONS)
def test_every_mode_keeps_the_promises_of_the_contract(condition: BoundaryCondition) -> None:
    cmap = conformal_map(bump(40, 20), condition)
    assert_honest(cmap)
    assert cmap.residual < 1e-11
    if quantum := QUANTA.get(condition.quantum):
        assert cmap.deck.angle / quantum == pytest.approx(round(cmap.deck.angle / quantum), abs=1e-14)


def test_straight_loops_lie_on_two_parallels_with_loop_0_below() -> None:
    cmap = conformal_map(bump(40, 20), BoundaryCondition())
    low, high = (cmap.uv[loop] for loop in cmap.surface.loops)
    assert np.abs(low.imag).max() < 1e-11
    assert np.ptp(high.imag) < 1e-11
    assert high.imag.mean() > 0
    assert cmap.kind == "cylinder"


def test_g_is_one_turn_along_loop_0() -> None:
    """Developing loop 0 once around ends at g of where it began."""
    cmap = conformal_map(bump(40, 20), BoundaryCondition("isometric"))
    loop = cmap.surface.loops[0]
    position, corners = cmap.uv[loop[0]], cmap.corners()
    sheet = 0
    for tail, head in zip(loop, np.roll(loop, -1), strict=True):
        [[face, a]] = np.argwhere((cmap.surface.faces == tail) & (np.roll(cmap.surface.faces, -1, 1) == head))
        b = (a + 1) % 3
        step = sheet - cmap.sheet[face, a]
        assert abs(cmap.deck.apply(corners[face, a], step) - position) < 1e-9
        position, sheet = complex(cmap.deck.apply(corners[face, b], step)), step + cmap.sheet[face, b]
    assert sheet == 1
    assert abs(position - cmap.deck.apply(cmap.uv[loop[0]])) < 1e-9


def test_modulus_of_the_catenoid_converges_with_order_two() -> None:
    error = []
    for n in (8, 16, 32):
        cmap = conformal_map(catenoid(4 * n, n), BoundaryCondition())
        height = cmap.uv[cmap.surface.loops[1]].imag.mean()
        error.append(abs(height / cmap.circumference / (1.5 / (2 * np.pi)) - 1))
    order = np.diff(-np.log2(error))
    assert (order > 1.9).all()


def test_a_flat_cone_maps_to_itself() -> None:
    cone = flat_cone(48, 12, 1.0, 2.0, np.pi / 3)
    cmap = conformal_map(cone, BoundaryCondition("isometric"))
    assert np.abs(cmap.log_scale).max() < 1e-12
    # the polygon of 48 sides has slightly less angle than the round cone
    assert cmap.deck.angle == pytest.approx(48 * 2 * np.arcsin(np.sin(np.pi / 48) / 6), rel=1e-12)
    assert np.abs(cmap.uv[cone.loops[0]]) == pytest.approx(2.0, rel=1e-12)
    assert cmap.deck.apex == 0


def test_a_rounded_cone_angle_is_told() -> None:
    cmap = conformal_map(bump(40, 20), BoundaryCondition("isometric", quantum="hex"))
    [note] = cmap.notes
    assert "-60°" in note
    funnel = grid(40, 10, revolution(lambda s: 1 + 0.1 * s, lambda s: 2 * s))
    cylinder = conformal_map(funnel, BoundaryCondition("isometric", quantum="hex"))
    assert cylinder.kind == "cylinder"
    assert "a cylinder" in cylinder.notes[0]


def test_a_cone_angle_that_needs_no_rounding_is_no_news() -> None:
    tube = grid(12, 10, revolution(lambda s: 1 + 0.3 * np.sin(np.pi * s), lambda s: 2 * s))
    cmap = conformal_map(tube, BoundaryCondition("isometric", quantum="hex"))
    assert cmap.kind == "cylinder"
    assert cmap.notes == ()


def test_a_long_tube_on_a_cone_has_a_map() -> None:
    """A tube 160 times as long as around, on a cone: one end is e^167 times as large as the other."""
    tube = grid(8, 200, revolution(lambda s: 0.02 + 0 * s, lambda s: 20 * s))
    corners = corners_at(
        np.array([0, int(tube.loops[1][0])]),
        np.array([2 * np.pi / 3, 4 * np.pi / 3]),
    )
    cone = conformal_map(tube, corners)
    assert faults(cone) == []
    assert np.ptp(cone.log_scale) == pytest.approx(np.pi / 3 * 160, rel=0.03)
    assert_honest(conformal_map(tube, BoundaryCondition()))


def ring_with_corners(off: float) -> ConformalMap:
    """A ring, wider on one side than on the other, between two hexagons; its cone angle is 2π + off, in
    absolute value."""

    def place(phi: Floats, s: Floats) -> Floats:
        r = 1 + s
        x, y = r * np.cos(phi) + 0.3 * s, r * np.sin(phi) * (1 + 0.3 * s)
        return np.stack([x, y, 0.4 * np.sin(2 * phi) * s], axis=1)

    surface = grid(72, 12, place)
    inner, outer = surface.loops
    vertices = np.concatenate([outer[::12], inner[::12]])
    angles = np.repeat([2 * np.pi / 3 - off / 6, 4 * np.pi / 3 + off / 6], 6)
    return conformal_map(surface, corners_at(vertices, angles))


@pytest.mark.parametrize("off", [1e-8, -1e-6, 1e-4, 1e-2])
def test_the_circumference_is_continuous_where_the_apex_goes_away(off: float) -> None:
    exact, near = ring_with_corners(0.0), ring_with_corners(off)
    assert exact.deck.apex is None
    assert near.deck.apex is not None
    assert near.circumference == pytest.approx(exact.circumference, rel=2 * abs(off) + 1e-6)
