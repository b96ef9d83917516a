"""Edge flips on oriented triangle meshes, whole independent sets at once."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.geometry import cross, cross_2d, dot, lengths, pair_key
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
    key = pair_key(c, d, n)
    ends = np.zeros(n, dtype=bool)
    ends[c] = ends[d] = True
    start, end = half_edges(faces)
    near = ends[start]
    near[near] = ends[end[near]]
    start, end = start[near], end[near]
    taken = np.isin(key, pair_key(start, end, n))
    once = np.zeros(len(h), dtype=bool)
    once[np.unique(key, return_index=True)[1]] = True
    return np.asarray(~taken & once & (c != d))


def flip(faces: Ints, h: Ints, twin: Ints) -> None:
    """Turns the edges a→b of faces (a, b, c) | (b, a, d) into c–d, in place; no two may touch one face.

    twin: (3m,) brought up to date, too.
    """
    corner = faces.ravel()
    t = twin[h]
    f, g = h // 3, t // 3
    bc, ad = next_half_edge(h), next_half_edge(t)
    ca, db = next_half_edge(bc), next_half_edge(ad)
    a, b, c, d = corner[h], corner[bc], corner[ca], corner[db]
    faces[f] = np.stack([a, d, c], axis=1)
    faces[g] = np.stack([d, b, c], axis=1)
    old = np.concatenate([ad, ca, db, bc])
    new = np.concatenate([3 * f, 3 * f + 2, 3 * g, 3 * g + 1])
    place = np.arange(len(twin))
    place[old] = new
    across = twin[old]
    across = np.where(across >= 0, place[across], -1)
    twin[new] = across
    twin[across[across >= 0]] = new[across >= 0]
    twin[3 * f + 1], twin[3 * g + 2] = 3 * g + 2, 3 * f + 1


def flip_to_delaunay(
    vertices: Floats, faces: Ints, keep: Ints | None = None, around: Bools | None = None
) -> Ints:
    """Faces over the same vertices in which no two angles opposite to an edge exceed π together.

    In space this shortens obtuse pairs of triangles as in the plane, while the mesh bends little over one
    edge; pairs that would fold are left. keep: (k, 2) pairs of vertices whose edges stay. around: (n,)
    vertices that have moved or are new since the faces were last Delaunay; None: all.
    """
    faces, n = faces.copy(), len(vertices)
    kept = None if keep is None or len(keep) == 0 else pair_key(keep[:, 0], keep[:, 1], n)
    twin = twins(faces, n)
    changed = np.arange(len(faces)) if around is None else np.flatnonzero(around[faces].any(axis=1))
    waiting = np.zeros(0, dtype=np.int64)
    for _ in range(ROUNDS):
        h = np.concatenate([waiting, 3 * changed, 3 * changed + 1, 3 * changed + 2])
        h = np.minimum(h, twin[h])
        looked_at = np.zeros(len(twin), dtype=bool)
        looked_at[h[h >= 0]] = True
        h = np.flatnonzero(looked_at)
        if kept is not None:
            start, end = faces.ravel()[h], faces.ravel()[next_half_edge(h)]
            h = h[~np.isin(pair_key(start, end, n), kept)]
        angle = angle_sums_opposite(vertices, faces, h, twin[h])
        order = np.argsort(-angle, kind="stable")
        waiting = h[order[: int((angle > np.pi + SLACK).sum())]]
        h = independent(waiting[_stays_unfolded(vertices, faces, waiting, twin)], twin, len(faces))
        h = h[joins_new(faces, h, twin, n)]
        if len(h) == 0:
            break
        changed = np.concatenate([h // 3, twin[h] // 3])
        touched = np.zeros(len(faces), dtype=bool)
        touched[changed] = True
        # An edge of a face that changes is looked at again anyway, and its half-edges move.
        waiting = waiting[~(touched[waiting // 3] | touched[twin[waiting] // 3])]
        flip(faces, h, twin)
    return faces


def angle_sums_opposite(points: Floats, faces: Ints, one: Ints, other: Ints) -> Floats:
    """(k,) the two angles that edges are seen under from their faces, from both half-edges."""
    return np.asarray(_seen_under(points, faces, one) + _seen_under(points, faces, other))


def _seen_under(points: Floats, faces: Ints, h: Ints) -> Floats:
    corner = faces.ravel()
    head = next_half_edge(h)
    apex = points[corner[next_half_edge(head)]]
    a, b = points[corner[h]] - apex, points[corner[head]] - apex
    sine = np.abs(cross_2d(a, b)) if a.shape[1] == 2 else lengths(cross(a, b))
    return np.asarray(np.arctan2(sine, dot(a, b)))


def _stays_unfolded(vertices: Floats, faces: Ints, h: Ints, twin: Ints) -> Bools:
    """Whether both triangles after the flip look to the same side as the two before together."""
    corner = faces.ravel()
    c, d = diagonal(faces, h, twin)
    pa, pb, pc, pd = (vertices[x] for x in (corner[h], corner[next_half_edge(h)], c, d))
    before = cross(pb - pa, pc - pa) + cross(pa - pb, pd - pb)
    one, two = cross(pd - pa, pc - pa), cross(pb - pd, pc - pd)
    return np.asarray((dot(one, before) > 0) & (dot(two, before) > 0))
