"""The closed form is the best regular polygon, whatever the cell."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from hexwrap_solver.panels.limits import inscribed, support_function
from hexwrap_solver.panels.regular import corners, nearest_regular, nearest_regular_in_plane

noise = arrays(np.float64, (6, 3), elements=st.floats(-0.3, 0.3))


def shape(poses, p):
    return poses.center[:, None] + poses.free_length[:, None, None] * poses.spokes(p)


@pytest.mark.parametrize("p", [3, 4, 6, 9])
def test_regular_polygons_are_their_own_nearest(p):
    turn = Rotation.from_rotvec([0.3, -1.2, 2.0]).as_matrix()
    flat = np.concatenate([corners(p) * 2.5, np.zeros((p, 1))], axis=1)
    points = (flat @ turn.T + [100.0, -20.0, 7.0])[None]
    poses = nearest_regular(points)
    assert poses.free_length[0] == pytest.approx(2.5, rel=1e-13)
    assert np.allclose(shape(poses, p), points, atol=1e-12)
    assert np.allclose(poses.normal[0], turn[:, 2], atol=1e-13)


@given(noise)
def test_axes_are_orthonormal_and_the_polygon_is_equivariant(offset):
    cell = np.concatenate([corners(6), np.zeros((6, 1))], axis=1) + offset
    turn = Rotation.from_rotvec([0.4, 0.9, -0.2]).as_matrix()
    poses = nearest_regular(cell[None])
    moved = nearest_regular((3.0 * cell @ turn.T + [5.0, 6.0, -7.0])[None])
    axes = np.stack([poses.x_axis[0], poses.y_axis[0]])
    assert np.allclose(axes @ axes.T, np.eye(2), atol=1e-14)
    assert np.allclose(shape(moved, 6)[0], 3.0 * shape(poses, 6)[0] @ turn.T + [5.0, 6.0, -7.0], atol=1e-9)


def test_no_other_regular_hexagon_is_nearer():
    rng = np.random.default_rng(1)
    cell = np.concatenate([corners(6), np.zeros((6, 1))], axis=1) + rng.normal(size=(6, 3)) * 0.1
    best = shape(nearest_regular(cell[None]), 6)[0]

    def miss(x):
        flat = np.concatenate([corners(6) * x[6], np.zeros((6, 1))], axis=1)
        return ((Rotation.from_rotvec(x[:3]).apply(flat) + x[3:6] - cell) ** 2).sum()

    found = minimize(miss, [0, 0, 0, 0, 0, 0, 1.0], method="BFGS", options={"gtol": 1e-9}).fun
    assert ((best - cell) ** 2).sum() == pytest.approx(found, rel=1e-9)


def test_in_a_given_plane_no_other_rotation_is_nearer():
    rng = np.random.default_rng(2)
    cell = np.concatenate([corners(6), np.zeros((6, 1))], axis=1) + rng.normal(size=(6, 3)) * 0.1
    normal = np.array([[0.1, -0.2, 1.0]]) / np.linalg.norm([0.1, -0.2, 1.0])
    poses = nearest_regular_in_plane(cell[None], normal)
    assert np.allclose(poses.normal, normal, atol=1e-14)
    best = ((shape(poses, 6)[0] - cell) ** 2).sum()
    for angle in np.linspace(-0.5, 0.5, 21)[[i for i in range(21) if i != 10]]:
        turned = Rotation.from_rotvec(angle * normal[0]).apply(shape(poses, 6)[0] - poses.center[0])
        assert ((turned + poses.center[0] - cell) ** 2).sum() > best


def test_planes_that_bound_no_panel_leave_a_finite_one():
    """All on one side: however large, a panel could move away from them."""
    cells = np.concatenate([corners(6), np.zeros((6, 1))], axis=1)[None]
    poses = nearest_regular(cells)
    direction = np.tile([1.0, 0.0, 0.0], (1, 6, 1))
    offset = np.full((1, 6), 0.5)
    length, center = inscribed(poses, direction, offset)
    assert np.isfinite(length).all()
    assert np.isfinite(center).all()
    assert (center[:, 0] + length * support_function(poses, direction)[:, 0] <= 0.5 + 1e-12).all()
