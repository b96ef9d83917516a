"""Triangles of a polygon with holes in the plane, over given points and through given segments.

Delaunay by Qhull; the few segments that are missing in it are forced in by flips (Sloan 1993, A fast
algorithm for generating constrained Delaunay triangulations, Computers & Structures 47).
"""

from __future__ import annotations

import numpy as np
import shapely
from scipy.spatial import Delaunay

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.geometry import cross_2d
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
    area = _areas(everything, faces)
    faces[area < 0] = faces[area < 0][:, [0, 2, 1]]
    if not force(everything, faces, segments):
        return None
    faces = faces[(faces < n).all(axis=1)]
    middle = points[faces].mean(axis=1)
    shapely.prepare(polygon)
    faces = faces[shapely.contains_xy(polygon, middle)]
    return faces if len(np.unique(faces)) == n else None


def _areas(points: Floats, faces: Ints) -> Floats:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return cross_2d(b - a, c - a)


def missing(faces: Ints, segments: Ints, n: int) -> Bools:
    """(k,) which segments are not an edge of any face."""
    start, end = half_edges(faces)
    have = np.minimum(start, end) * n + np.maximum(start, end)
    low, high = segments.min(axis=1), segments.max(axis=1)
    return ~np.isin(low * n + high, have)


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
        c, d = int(faces.flat[_after(_after(h))]), int(faces.flat[_after(_after(int(twin[h])))])
        pa, pb, pc, pd = points[start], points[end], points[c], points[d]
        if cross_2d(pd - pa, pc - pa) <= 0 or cross_2d(pb - pd, pc - pd) <= 0:
            waiting.append((start, end))
            continue
        _flip(faces, twin, h)
        if {c, d} != {a, b} and _crosses(points, a, b, c, d):
            waiting.append((c, d))
    return False


def _crossing(points: Floats, faces: Ints, twin: Ints, a: int, b: int) -> list[tuple[int, int]]:
    """Edges that the segment a–b crosses, in no order."""
    start, end = half_edges(faces)
    h = np.flatnonzero(twin > np.arange(len(twin)))
    s, e = start[h], end[h]
    apart = (s != a) & (s != b) & (e != a) & (e != b)
    s, e = s[apart], e[apart]
    pa, pb, ps, pe = points[a], points[b], points[s], points[e]
    one, two = cross_2d(pb - pa, ps - pa), cross_2d(pb - pa, pe - pa)
    three, four = cross_2d(pe - ps, pa - ps), cross_2d(pe - ps, pb - ps)
    hit = (one * two < 0) & (three * four < 0)
    return list(zip(s[hit].tolist(), e[hit].tolist(), strict=True))


def _crosses(points: Floats, a: int, b: int, c: int, d: int) -> bool:
    if {a, b} & {c, d}:
        return False
    pa, pb, pc, pd = points[a], points[b], points[c], points[d]
    one, two = cross_2d(pb - pa, pc - pa), cross_2d(pb - pa, pd - pa)
    three, four = cross_2d(pd - pc, pa - pc), cross_2d(pd - pc, pb - pc)
    return bool(one * two < 0 and three * four < 0)


def _half_edge(faces: Ints, a: int, b: int) -> int:
    for row in np.flatnonzero((faces == a).any(axis=1)):
        for k in range(3):
            if faces[row, k] == a and faces[row, (k + 1) % 3] == b:
                return int(3 * row + k)
    return -1


def _after(h: int) -> int:
    return h - 2 if h % 3 == 2 else h + 1


def _flip(faces: Ints, twin: Ints, h: int) -> None:
    """Turns the edge a→b of (a, b, c) | (b, a, d) into c–d: (a, d, c) and (d, b, c)."""
    t = int(twin[h])
    bc, ca, ad, db = _after(h), _after(_after(h)), _after(t), _after(_after(t))
    a, b, c, d = (int(faces.flat[x]) for x in (h, bc, ca, db))
    outer = [int(twin[x]) for x in (ad, ca, db, bc)]
    f, g = h // 3, t // 3
    faces[f], faces[g] = (a, d, c), (d, b, c)
    pairs = ((3 * f, outer[0]), (3 * f + 2, outer[1]), (3 * g, outer[2]), (3 * g + 1, outer[3]))
    for own, other in pairs:
        twin[own] = other
        if other >= 0:
            twin[other] = own
    twin[3 * f + 1], twin[3 * g + 2] = 3 * g + 2, 3 * f + 1
