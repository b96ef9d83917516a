"""Quads split along the diagonal that Delaunay's criterion prefers."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.tolerances import ANGLE


def triangulate(vertices: Floats, faces: Ragged) -> tuple[Ints, Ints]:
    """(m, 3) triangles, and (m,) the polygon each one is part of.

    A quad with two equal neighbouring corners is the triangle that Rhino writes so. Triangles come in
    the order of the polygons.
    """
    corners, lengths = np.asarray(faces.values, dtype=np.int64), faces.lengths
    if np.all(lengths == 3):
        return corners.reshape(-1, 3), np.arange(faces.n_rows, dtype=np.int64)
    first = faces.offsets[:-1]
    quad = np.flatnonzero(lengths == 4)
    quads = corners[first[quad][:, None] + np.arange(4)]
    rolled, whole = _repeated_corner_last(quads)
    pieces = np.ones(faces.n_rows, dtype=np.int64)
    pieces[quad[whole]] = 2
    position = np.concatenate([[0], np.cumsum(pieces)])
    triangles = np.zeros((position[-1], 3), dtype=np.int64)
    three = np.flatnonzero(lengths == 3)
    triangles[position[three]] = corners[first[three][:, None] + np.arange(3)]
    triangles[position[quad[~whole]]] = rolled[~whole, :3]
    split = _split(vertices, quads[whole])
    triangles[position[quad[whole]]] = split[:, 0]
    triangles[position[quad[whole]] + 1] = split[:, 1]
    return triangles, np.repeat(np.arange(faces.n_rows, dtype=np.int64), pieces)


def _repeated_corner_last(quads: Ints) -> tuple[Ints, Ints]:
    """Quads turned so that a corner equal to the next one comes last; which quads have none."""
    same = quads == np.roll(quads, -1, axis=1)
    shift = np.where(same.any(axis=1), np.argmax(same, axis=1) + 1, 0)
    turned = np.take_along_axis(quads, (np.arange(4) + shift[:, None]) % 4, axis=1)
    return turned, ~same.any(axis=1)


def _split(vertices: Floats, quads: Ints) -> Ints:
    """(k, 2, 3) triangles. The angles at the two corners that the diagonal does not touch sum up to at
    most π; where both diagonals do equally well, the one through the lowest vertex is taken, so that equal
    quads are split alike in any order."""
    points = vertices[quads]
    angle = _corner_angles(points)
    excess = angle[:, 1] + angle[:, 3] - angle[:, 0] - angle[:, 2]  # > 0: diagonal 0–2 is the worse one
    lowest_is_odd = np.argmin(quads, axis=1) % 2 == 1
    odd = np.where(np.abs(excess) < ANGLE, lowest_is_odd, excess > 0)
    start = odd.astype(np.int64)[:, None]
    turned = np.take_along_axis(quads, (np.arange(4) + start) % 4, axis=1)
    return np.stack([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]], axis=1)


def _corner_angles(points: Floats) -> Floats:
    """(k, 4) angles in which the two triangles beside each corner's opposite diagonal see it."""
    forth = np.roll(points, -1, axis=1) - points
    back = np.roll(points, 1, axis=1) - points
    sine = np.linalg.norm(np.cross(forth, back), axis=2)
    return np.asarray(np.arctan2(sine, (forth * back).sum(axis=2)))
