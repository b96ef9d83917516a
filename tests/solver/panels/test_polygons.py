"""Measures of polygons with different numbers of corners in one table."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.geometry import cross_2d
from hexwrap_solver.panels.polygons import (
    area_vectors,
    best_plane_distances,
    convex,
    fan_areas,
    interior_angles,
    outlines,
)


def star(rng: np.random.Generator, corners: int) -> np.ndarray:
    """(corners, 3) of a flat polygon that goes once around 0, counter-clockwise from above."""
    angle = 2 * np.pi * (np.arange(corners) + 0.4 * rng.random(corners)) / corners
    return (rng.uniform(0.5, 1.0, corners) * np.array([np.cos(angle), np.sin(angle), 0 * angle])).T


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.lists(st.integers(3, 9), min_size=1, max_size=12))
def test_flat_polygons_of_any_numbers_of_corners(seed: int, counts: list[int]) -> None:
    """Angles add up to (n − 2)π, the area vector is the shoelace sum along the normal, no corner leaves the
    plane, and all of it is as of each polygon alone."""
    rng = np.random.default_rng(seed)
    flat = [star(rng, n) for n in counts]
    turn = Rotation.random(len(counts), rng=rng)
    offsets = np.concatenate([[0], np.cumsum(counts)])
    moved = [one.apply(corner) + rng.normal(size=3) for one, corner in zip(turn, flat, strict=True)]
    polygons, normal = Ragged(np.concatenate(moved), offsets), turn.apply([0.0, 0.0, 1.0])
    angle = interior_angles(polygons, normal)
    shoelace = [float(cross_2d(p, np.roll(p, -1, axis=0)).sum()) / 2 for p in flat]
    np.testing.assert_allclose(np.add.reduceat(angle, offsets[:-1]), np.pi * (np.array(counts) - 2))
    np.testing.assert_allclose(area_vectors(polygons), np.array(shoelace)[:, None] * normal, atol=1e-12)
    assert (fan_areas(polygons) >= np.array(shoelace) - 1e-12).all()
    assert abs(best_plane_distances(polygons)).max() < 1e-12
    assert sorted(np.concatenate([one.row for one in outlines(polygons)])) == list(range(len(counts)))
    np.testing.assert_array_equal(convex(polygons, angle), np.maximum.reduceat(angle, offsets[:-1]) <= np.pi)
    for i, corner in enumerate(moved):
        alone = Ragged.from_table(corner[None])
        np.testing.assert_allclose(fan_areas(alone), fan_areas(polygons)[i], rtol=1e-13)
        own = angle[offsets[i] : offsets[i + 1]]
        np.testing.assert_allclose(interior_angles(alone, normal[i : i + 1]), own, rtol=1e-13)
