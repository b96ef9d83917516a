"""Triangles of a polygon with holes in the plane, over given points and through given segments.

Delaunay by Qhull; the few segments that are missing in it are forced in by flips (Sloan 1993, A fast
algorithm for generating constrained Delaunay triangulations, Computers & Structures 47).
"""

from __future__ import annotations

import numpy as np
import shapely
from scipy.spatial import Delaunay

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.geometry import cross_2d, pair_key
from hexwrap_solver.surface.flips import diagonal, flip
from hexwrap_solver.surface.topology import half_edges, twins

#: Points around the outside, so that the polygon's own boundary is inside the triangulation.
FRAME = 12
#: Flips tried per edge that crosses a missing segment.
PATIENCE = 40


def triangulated(points: Floats, segments: Ints, polygon: shapely.Polygon) -> Ints | None:
    """(m, 3) counter-clockwise triangles inside the polygon; None where a segment cannot be had.

    points: (n, 2) all different. segments: (k, 2) pairs of points that become edges; no two of them cross.
    """
    n = len(points)
    low, high = points.min(axis=0), points.max(axis=0)
    turn = 2 * np.pi * np.arange(FRAME) / FRAME
    frame = (low + high) / 2 + 1.5 * float(np.linalg.norm(high - low)) * np.stack(
        [np.cos(turn), np.sin(turn)], axis=1
    )
    everything = np.concatenate([points, frame])
    faces = np.asarray(Delaunay(everything).simplices, dtype=np.int64)
    a, b, c = (everything[faces[:, k]] for k in range(3))
    clockwise = cross_2d(b - a, c - a) < 0
    faces[clockwise] = faces[clockwise][:, [0, 2, 1]]
    if not force(everything, faces, segments):
        return None
    faces = faces[(faces < n).all(axis=1)]
    middle = points[faces].mean(axis=1)
    shapely.prepare(polygon)
    faces = faces[shapely.contains_xy(polygon, middle)]
    return faces if len(np.unique(faces)) == n else None


def missing(faces: Ints, segments: Ints, n: int) -> Bools:
    """(k,) which segments are not an edge of any face."""
    start, end = half_edges(faces)
    have = pair_key(start, end, n)
    return ~np.isin(pair_key(segments[:, 0], segments[:, 1], n), have)


def force(points: Floats, faces: Ints, segments: Ints) -> bool:
    """Flips edges of the faces, in place, until every segment is one; whether that came about."""
    n = len(points)
    lost = np.flatnonzero(missing(faces, segments, n))
    if len(lost) == 0:
        return True
    twin = twins(faces, n)
    return all(_force_one(points, faces, twin, int(a), int(b)) for a, b in segments[lost])


def _force_one(points: Floats, faces: Ints, twin: Ints, a: int, b: int) -> bool:
    """Flips what crosses a–b: an edge that cannot be flipped yet comes back after the others."""
    waiting = _crossing(points, faces, twin, a, b)
    for _ in range(PATIENCE * (len(waiting) + 1)):
        if not waiting:
            return True
        start, end = waiting.pop(0)
        h = _half_edge(faces, start, end)
        if h < 0 or twin[h] < 0:
            return False
        at = np.array([h])
        c, d = (int(end[0]) for end in diagonal(faces, at, twin))
        pa, pb, pc, pd = points[start], points[end], points[c], points[d]
        if cross_2d(pd - pa, pc - pa) <= 0 or cross_2d(pb - pd, pc - pd) <= 0:
            waiting.append((start, end))
            continue
        flip(faces, at, twin)
        if not {a, b} & {c, d} and _crosses(points[a], points[b], pc, pd):
            waiting.append((c, d))
    return False


def _crossing(points: Floats, faces: Ints, twin: Ints, a: int, b: int) -> list[tuple[int, int]]:
    """Edges that the segment a–b crosses, in no order."""
    start, end = half_edges(faces)
    h = np.flatnonzero(twin > np.arange(len(twin)))
    s, e = start[h], end[h]
    apart = (s != a) & (s != b) & (e != a) & (e != b)
    s, e = s[apart], e[apart]
    hit = _crosses(points[a], points[b], points[s], points[e])
    return list(zip(s[hit].tolist(), e[hit].tolist(), strict=True))


def _crosses(a: Floats, b: Floats, c: Floats, d: Floats) -> Bools:
    """(…,) whether segments from a to b and from c to d have a point inside both in common."""
    one, two = cross_2d(b - a, c - a), cross_2d(b - a, d - a)
    three, four = cross_2d(d - c, a - c), cross_2d(d - c, b - c)
    return np.asarray((one * two < 0) & (three * four < 0))


def _half_edge(faces: Ints, a: int, b: int) -> int:
    for row in np.flatnonzero((faces == a).any(axis=1)):
        for k in range(3):
            if faces[row, k] == a and faces[row, (k + 1) % 3] == b:
                return int(3 * row + k)
    return -1
