"""Node axes without torsion."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.panels import support
from tests.solver.panels.cells import (
    catenoid,
    cylinder,
    hex_pattern,
    inverted,
    quad_pattern,
    sphere,
    torus,
    triangle_pattern,
)


@pytest.mark.parametrize(
    "chart", [cylinder, catenoid, torus, inverted(torus, (0.3, 0.2, 4.0)), inverted(sphere, (1.9, 0.0, 2.0))]
)
@pytest.mark.parametrize("make", [hex_pattern, quad_pattern])
def test_beams_are_flat_and_nodes_nearly_normal(chart, make):
    made = support(make(chart, 30, 10, -0.6), depth=0.02)
    assert made.torsion.max() < np.radians(1e-9)
    assert np.degrees(made.tilt.max()) < 6
    assert np.allclose(np.linalg.norm(made.axes, axis=1), 1)
    a, b, c, d = made.strips.transpose(1, 0, 2)
    volume = np.einsum("ed,ed->e", np.cross(b - a, c - a), d - a)
    assert np.abs(volume).max() < 1e-12
    assert np.allclose(np.linalg.norm(d - a, axis=1), 0.02)


def test_on_a_sphere_the_normals_need_no_change():
    made = support(hex_pattern(sphere, 24, 8, -0.5), depth=0.1)
    assert made.tilt.max() < 1e-8
    assert made.torsion.max() < 1e-8


def test_every_edge_carries_one_beam():
    pattern = hex_pattern(torus, 24, 8)
    made = support(pattern, depth=0.1)
    inner = (pattern.neighbours.values >= 0).sum()
    assert len(made.edges) == len(pattern.neighbours.values) - inner // 2


def test_triangles_have_more_edges_than_freedom_and_keep_some_torsion():
    made = support(triangle_pattern(torus, 24, 8), depth=0.1)
    assert np.isfinite(made.axes).all()
    assert made.torsion.max() > 1e-6
    assert np.degrees(made.tilt.max()) < 60
