"""The rasterizer against geometry: areas, nearest surfaces, planes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_server.output.raster import Camera, Polygons, draw
from hexwrap_solver.arrays import Ragged

#: Looks along z from below; a unit at depth 10 is 100 samples.
CAMERA = Camera(np.array([0.0, 0.0, -10.0]), np.eye(3), 1000.0, (200.0, 200.0), 400, 400)
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def at_depth(outline: np.ndarray, z: float) -> np.ndarray:
    return np.column_stack([outline, np.full(len(outline), z)])


def polygons(*outlines: np.ndarray) -> Polygons:
    offsets = np.cumsum([0, *(len(o) for o in outlines)])
    return Polygons.of(Ragged(np.vstack(outlines), offsets))


def test_a_square_covers_its_area_at_its_depth() -> None:
    owner, inverse = draw(CAMERA, polygons(at_depth(SQUARE, 0.0)))
    assert np.sum(owner == 0) == 200 * 200
    assert np.all(inverse[owner == 0] == pytest.approx(0.1))
    assert np.all(inverse[owner < 0] == 0)


def test_even_odd_leaves_the_notch_of_an_arrow_open() -> None:
    arrow = np.array([[-1.0, -1.0], [0.0, 0.5], [1.0, -1.0], [0.0, 1.0]])
    owner, _ = draw(CAMERA, polygons(at_depth(arrow, 0.0)))
    assert np.sum(owner == 0) == pytest.approx(0.5 * 100**2, rel=0.01)
    assert owner[200 - 50, 200] == -1


@given(order=st.permutations([0, 1, 2]))
@settings(max_examples=6, deadline=None)
def test_the_nearest_wins_in_any_order(order: list[int]) -> None:
    layers = [at_depth(SQUARE, float(z)) for z in order]
    owner, _ = draw(CAMERA, polygons(*layers))
    assert owner[200, 200] == order.index(0)


def test_planes_that_cut_each_other_meet_in_their_line() -> None:
    tilted = at_depth(SQUARE, 0.0)
    tilted[:, 2] = tilted[:, 0]
    owner, _ = draw(CAMERA, polygons(at_depth(SQUARE, 0.0), tilted))
    assert np.all(owner[150:250, 120:199] == 1)
    assert np.all(owner[150:250, 201:280] == 0)


def test_polygons_outside_the_image_or_seen_edge_on_are_no_trouble() -> None:
    edge_on = np.array([[0.0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]])
    owner, inverse = draw(CAMERA, polygons(at_depth(SQUARE + 50, 0.0), edge_on))
    assert np.all(owner == -1)
    assert np.all(inverse == 0)


def test_a_strip_of_triangles_leaves_no_crack() -> None:
    x = np.linspace(-1, 1, 31)
    low, high = np.column_stack([x, -1 + 0 * x, 0 * x]), np.column_stack([x, 1 + 0 * x, 0.3 * x])
    faces = [np.array([low[i], low[i + 1], high[i]]) for i in range(30)]
    faces += [np.array([low[i + 1], high[i + 1], high[i]]) for i in range(30)]
    owner, _ = draw(CAMERA, polygons(*faces))
    assert np.all(owner[105:295, 105:295] >= 0)
