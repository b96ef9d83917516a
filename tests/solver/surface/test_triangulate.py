"""Polygons cut into triangles."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.surface.triangulate import MOST_CORNERS, cut_polygons
from tests.solver.surface.shapes import mesh


def turned(seed: int) -> np.ndarray:
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]


@settings(max_examples=30, deadline=None)
@given(st.integers(5, 40), st.integers(0, 2**32 - 1))
def test_triangles_fill_a_polygon_once_and_keep_its_edges(n: int, seed: int) -> None:
    """Areas with the polygon's own sign add up to its area, so that nothing is covered twice or left open."""
    random = np.random.default_rng(seed)
    angle = 2 * np.pi * (np.arange(n) + random.uniform(0, 0.9, n)) / n
    flat = random.uniform(0.2, 1, n)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices = np.pad(flat, ((0, 0), (0, 1))) @ turned(seed).T + 100
    faces, row = cut_polygons(vertices, Ragged(np.arange(n), np.array([0, n])))
    assert faces.n_rows == n - 2
    assert (row == 0).all()
    a, b, c = (flat[corner] for corner in np.array(faces.to_lists()).T)
    areas = np.linalg.det(np.stack([b - a, c - a], axis=1)) / 2
    assert (areas > 0).all()
    following = np.roll(flat, -1, axis=0)
    whole = np.linalg.det(np.stack([flat, following], axis=1)).sum() / 2
    np.testing.assert_allclose(areas.sum(), whole, rtol=1e-9)
    sides = {(i, j) for face in faces.to_lists() for i, j in zip(face, np.roll(face, -1), strict=True)}
    assert {(i, (i + 1) % n) for i in range(n)} <= sides


def test_faces_keep_their_order_and_those_that_fit_or_are_broken_stay() -> None:
    vertices = np.array([[np.cos(a), np.sin(a), 0] for a in np.linspace(0, 2 * np.pi, 6, endpoint=False)])
    sent = [[0, 1, 2], [0, 1, 2, 3, 4], [0, 2, 4, 5], [0, 1, 2, 3, 99], [5, 4, 3, 2, 1, 0]]
    faces, row = cut_polygons(vertices, mesh(vertices, sent).faces)
    assert row.tolist() == [0, 1, 1, 1, 2, 3, 4, 4, 4, 4]
    lists = faces.to_lists()
    assert [lists[i] for i in (0, 4, 5)] == [sent[i] for i in (0, 2, 3)]
    many = Ragged(np.zeros(MOST_CORNERS + 1, dtype=np.int64), np.array([0, MOST_CORNERS + 1]))
    assert cut_polygons(vertices, many)[0] is many
