"""Quads split along the diagonal that Delaunay's criterion prefers; larger polygons cut by ears."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.geometry import cross_2d
from hexwrap_solver.tolerances import ANGLE, TINY

#: Polygons with more corners than these are left to whoever made them: the work grows with the third power.
MOST_CORNERS = 256
#: Polygons are cut in bundles whose corners have at most this many pairs.
BUNDLE = 2**20


def cut_polygons(vertices: Floats, faces: Ragged) -> tuple[Ragged, Ints]:
    """The faces with those of 5 to MOST_CORNERS corners cut into triangles, in the order of the faces, and
    (m,) the face each one is from. Faces that name no vertex, or points that are not finite, stay."""
    lengths = faces.lengths
    fits = (faces.values >= 0) & (faces.values < len(vertices))
    fits[fits] = np.isfinite(vertices[faces.values[fits]]).all(axis=1)
    wanted = (lengths > 4) & (lengths <= MOST_CORNERS)
    wanted[faces.row[~fits]] = False
    if not wanted.any():
        return faces, np.arange(faces.n_rows, dtype=np.int64)
    rows: list[Ints] = [np.flatnonzero(~wanted)]
    sizes: list[Ints] = [lengths[~wanted]]
    corners: list[Ints] = [np.asarray(faces.values[np.repeat(~wanted, lengths)], dtype=np.int64)]
    for n in np.unique(lengths[wanted]):
        polygons = np.flatnonzero(wanted & (lengths == n))
        for bundle in np.array_split(polygons, -(-len(polygons) * n * n // BUNDLE)):
            index = np.asarray(faces.values[faces.offsets[bundle][:, None] + np.arange(n)], dtype=np.int64)
            ears = _ears(_flattened(vertices[index]))
            rows.append(np.repeat(bundle, int(n) - 2))
            sizes.append(np.full(len(bundle) * (n - 2), 3, dtype=np.int64))
            corners.append(np.take_along_axis(index, ears.reshape(len(bundle), -1), axis=1).ravel())
    row, size = np.concatenate(rows), np.concatenate(sizes)
    order = np.argsort(row, kind="stable")
    return Ragged.of(np.concatenate(corners), size).take(order), row[order]


def _flattened(polygons: Floats) -> Floats:
    """(k, n, 2) the polygons (k, n, 3) in planes square to their area vectors, which then point up."""
    points = polygons - polygons.mean(axis=1, keepdims=True)
    points = points / np.maximum(np.abs(points).max(axis=(1, 2), keepdims=True), TINY)
    area = np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)
    across = np.eye(3)[np.abs(area).argmin(axis=1)]
    u = np.cross(across, area)
    u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), TINY)
    v = np.cross(area, u)
    v /= np.maximum(np.linalg.norm(v, axis=1, keepdims=True), TINY)
    return np.stack([(points * u[:, None]).sum(axis=2), (points * v[:, None]).sum(axis=2)], axis=2)


def _ears(points: Floats) -> Ints:
    """(k, n-2, 3) corners of triangles that fill the polygons (k, n, 2), anticlockwise.

    An ear is a triangle of three corners in a row that turns left and holds no other corner (Meisters 1975,
    Polygons have ears). Of each polygon's ears the one nearest to equilateral goes first.
    """
    k, n, _ = points.shape
    left = np.tile(np.arange(n), (k, 1))
    ears = []
    for r in range(n, 2, -1):
        ear = np.stack([np.roll(left, 1, axis=1), left, np.roll(left, -1, axis=1)], axis=2)
        a, b, c = (np.take_along_axis(points, ear[:, :, i, None], axis=1) for i in range(3))
        sides = (b - a, c - b, a - c)
        regular = cross_2d(sides[0], sides[1]) / np.maximum(sum((s * s).sum(axis=2) for s in sides), TINY)
        others = np.take_along_axis(points, left[:, :, None], axis=1)[:, None]
        inside = np.ones((k, r, r), dtype=bool)
        for side, corner in zip(sides, (a, b, c), strict=True):
            inside &= cross_2d(side[:, :, None], others - corner[:, :, None]) >= 0
        inside &= (left[:, None, :, None] != ear[:, :, None, :]).all(axis=3)
        best = np.where(inside.any(axis=2), regular - 2, regular).argmax(axis=1)
        ears.append(ear[np.arange(k), best])
        left = left[np.arange(r) != best[:, None]].reshape(k, r - 1)
    return np.stack(ears, axis=1)


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
