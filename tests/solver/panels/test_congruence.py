"""Classes of congruent shapes."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.panels.congruence import congruence_classes
from hexwrap_solver.panels.polygons import outlines
from hexwrap_solver.panels.trimmed import plane_normals

KITE = np.array([[0.0, 0, 0], [2, 0, 0], [3, 1, 0], [0, 2, 0]])
HOUSE = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 2, 0], [0, 1, 0]])
BENT = KITE + np.outer([0, 1, 0, 0], [0, 0, 0.2])


def classes(shapes):
    polygons = Ragged(
        np.concatenate(shapes), np.concatenate([[0], np.cumsum([len(s) for s in shapes])]).astype(np.int64)
    )
    return congruence_classes(outlines(polygons, plane_normals(polygons))).tolist()


def mirrored(shape):
    return (shape * [-1, 1, 1])[::-1]


@given(st.integers(0, 10**6))
def test_motions_and_the_starting_corner_do_not_matter(seed):
    rng = np.random.default_rng(seed)
    shapes = []
    for shape in [KITE, HOUSE, BENT] * 3:
        turn = Rotation.random(rng=rng)
        shapes.append(turn.apply(np.roll(shape, rng.integers(5), axis=0)) + rng.normal(size=3))
    assert classes(shapes) == [0, 1, 2] * 3


def test_mirror_images_are_told_apart_unless_symmetric():
    assert classes([KITE, mirrored(KITE), HOUSE, mirrored(HOUSE)]) == [0, 1, 2, 2]
    assert classes([BENT, mirrored(BENT), BENT * [1, 1, -1]]) == [0, 1, 2]


def test_scale_matters():
    assert classes([KITE, 1.001 * KITE, KITE]) == [0, 1, 0]
