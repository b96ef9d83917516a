"""Edge flips on oriented triangle meshes, whole independent sets at once."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.geometry import angles_between, dot
from hexwrap_solver.surface.topology import half_edges, next_half_edge, twins

#: Flips to Delaunay end long before on meshes that are not torture.
ROUNDS = 100
#: Opposite angles may sum up to π and this much before an edge is flipped, radians; keeps ties from cycling.
SLACK = 1e-9


def independent(h: Ints, twin: Ints, m: int) -> Ints:
    """Those of the inner half-edges h no two of which touch the same face; the first in order wins."""
    owner = np.full(m, len(h), dtype=np.int64)
    mine = np.arange(len(h))
    for side in (h // 3, twin[h] // 3):
        np.minimum.at(owner, side, mine)
    return np.asarray(h[(owner[h // 3] == mine) & (owner[twin[h] // 3] == mine)])


def diagonal(faces: Ints, h: Ints, twin: Ints) -> tuple[Ints, Ints]:
    """The vertices c, d opposite to the half-edges h, on their own side and on the other."""
    corner = faces.ravel()
    c = corner[next_half_edge(next_half_edge(h))]
    d = corner[next_half_edge(next_half_edge(twin[h]))]
    return c, d


def joins_new(faces: Ints, h: Ints, twin: Ints, n: int) -> Bools:
    """Whether flipping h joins two vertices that neither an edge nor an earlier flip of h joins."""
    c, d = diagonal(faces, h, twin)
    start, end = half_edges(faces)
    key = np.minimum(c, d) * n + np.maximum(c, d)
    existing = np.sort(np.minimum(start, end) * n + np.maximum(start, end))
    taken = existing[np.minimum(np.searchsorted(existing, key), len(existing) - 1)] == key
    once = np.zeros(len(h), dtype=bool)
    once[np.unique(key, return_index=True)[1]] = True
    return np.asarray(~taken & once & (c != d))


def flip(faces: Ints, h: Ints, twin: Ints) -> None:
    """Turns the edges a→b of faces (a, b, c) | (b, a, d) into c–d, in place."""
    start, end = half_edges(faces)
    a, b = start[h], end[h]
    c, d = diagonal(faces, h, twin)
    faces[h // 3] = np.stack([a, d, c], axis=1)
    faces[twin[h] // 3] = np.stack([d, b, c], axis=1)


def flip_to_delaunay(vertices: Floats, faces: Ints, keep: Ints | None = None) -> Ints:
    """Faces over the same vertices in which no two angles opposite to an edge exceed π together.

    In space this shortens obtuse pairs of triangles as in the plane, while the mesh bends little over one
    edge; pairs that would fold are left. keep: (k, 2) pairs of vertices whose edges stay.
    """
    faces, n = faces.copy(), len(vertices)
    kept = None if keep is None else keep.min(axis=1) * n + keep.max(axis=1)
    for _ in range(ROUNDS):
        twin = twins(faces, n)
        h = np.arange(len(twin))
        h = h[(twin > h)]
        if kept is not None:
            start, end = (side[h] for side in half_edges(faces))
            h = h[~np.isin(np.minimum(start, end) * n + np.maximum(start, end), kept)]
        angle = angle_sums_opposite(vertices, faces, h, twin[h])
        order = np.argsort(-angle, kind="stable")
        h = h[order[: int((angle > np.pi + SLACK).sum())]]
        h = independent(h[_stays_unfolded(vertices, faces, h, twin)], twin, len(faces))
        h = h[joins_new(faces, h, twin, n)]
        if len(h) == 0:
            break
        flip(faces, h, twin)
    return faces


def angle_sums_opposite(points: Floats, faces: Ints, one: Ints, other: Ints) -> Floats:
    """(k,) the two angles that edges are seen under from their faces, from both half-edges."""
    return np.asarray(_seen_under(points, faces, one) + _seen_under(points, faces, other))


def _seen_under(points: Floats, faces: Ints, h: Ints) -> Floats:
    tail, head = half_edges(faces)
    apex = points[faces.ravel()[next_half_edge(next_half_edge(h))]]
    a, b = points[tail[h]] - apex, points[head[h]] - apex
    return angles_between(a, b)


def _stays_unfolded(vertices: Floats, faces: Ints, h: Ints, twin: Ints) -> Bools:
    """Whether both triangles after the flip look to the same side as the two before together."""
    start, end = half_edges(faces)
    c, d = diagonal(faces, h, twin)
    pa, pb, pc, pd = (vertices[x] for x in (start[h], end[h], c, d))
    before = np.cross(pb - pa, pc - pa) + np.cross(pa - pb, pd - pb)
    one, two = np.cross(pd - pa, pc - pa), np.cross(pb - pd, pc - pd)
    return np.asarray((dot(one, before) > 0) & (dot(two, before) > 0))
