"""Triangles without area: corners on one line, as they come from a vertex on another face's edge.

Dropping one would tear a slit. Its longest edge is flipped instead, which gives the vertex in its middle
to the face on the other side; at the boundary the triangle can be dropped, and the boundary runs through
the vertex.
"""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.surface.topology import edge_groups, edge_lengths, next_half_edge, twins_of

#: A triangle with a + b − c below this part of c has no angles in double precision: about 2e-6 degrees at
#: the ends of its longest edge c.
FLAT = 16 * np.finfo(float).eps
#: One pass repairs every second triangle of a row of them at least.
PASSES = 60


def flat(vertices: Floats, faces: Ints) -> Bools:
    """(m,) triangles whose longest edge is as long as the two others together."""
    lengths = edge_lengths(vertices, faces)
    a, b, c = lengths.T
    longest = np.maximum(np.maximum(a, b), c)
    return np.asarray(a + b + c - 2 * longest <= FLAT * longest)


def repair_flat(vertices: Floats, faces: Ints) -> tuple[Ints, Bools, Bools]:
    """Faces of an oriented mesh without flat triangles, as far as that is possible.

    Returns faces (m, 3), which of them remain (the others are dropped), and which are flat still.
    """
    faces = faces.copy()
    keep = np.ones(len(faces), dtype=bool)
    for _ in range(PASSES):
        bad = flat(vertices, faces) & keep
        if not bad.any() or not _pass(vertices, faces, keep, bad):
            break
    return faces, keep, flat(vertices, faces) & keep


def _pass(vertices: Floats, faces: Ints, keep: Bools, bad: Bools) -> bool:
    """Repairs in place what can be repaired independently; False where nothing could."""
    n, alive = len(vertices), np.flatnonzero(keep)
    order, first = edge_groups(faces[alive], n)
    local = twins_of(order, first)
    twin = np.full(3 * len(faces), -1, dtype=np.int64)
    own = _half_edges_of(alive)
    twin[own] = np.where(local >= 0, own[local], -1)
    face = np.flatnonzero(bad)
    h = 3 * face + np.argmax(edge_lengths(vertices, faces[face]), axis=1)
    rim = h[twin[h] < 0]
    droppable = rim[_leaves_no_pinch(faces, twin, keep, rim)]
    inner = h[twin[h] >= 0]
    flips = _independent(inner, twin, len(faces))
    flips = flips[_new_edge(faces, alive, flips, twin, n)]
    keep[droppable // 3] = False
    _flip(faces, flips, twin[flips])
    return bool(len(droppable) + len(flips))


def _leaves_no_pinch(faces: Ints, twin: Ints, keep: Bools, rim: Ints) -> Bools:
    """Whether the vertex opposite to a boundary half-edge is inside, or the triangle an ear."""
    flat_faces = faces.ravel()
    open_edge = np.flatnonzero((twin < 0) & np.repeat(keep, 3))
    on_rim = np.zeros(int(faces.max()) + 1, dtype=bool)
    on_rim[flat_faces[open_edge]] = on_rim[flat_faces[next_half_edge(open_edge)]] = True
    after = next_half_edge(rim)
    opposite = flat_faces[next_half_edge(after)]
    ear = (twin[after] < 0) | (twin[next_half_edge(after)] < 0)
    once = np.zeros(len(rim), dtype=bool)
    once[np.unique(opposite, return_index=True)[1]] = True
    return np.asarray((~on_rim[opposite] | ear) & once)


def _independent(h: Ints, twin: Ints, m: int) -> Ints:
    """Half-edges no two of which touch the same face."""
    owner = np.full(m, len(h), dtype=np.int64)
    for side in (h // 3, twin[h] // 3):
        np.minimum.at(owner, side, np.arange(len(h)))
    mine = np.arange(len(h))
    return np.asarray(h[(owner[h // 3] == mine) & (owner[twin[h] // 3] == mine)])


def _new_edge(faces: Ints, alive: Ints, h: Ints, twin: Ints, n: int) -> Bools:
    """Whether the flipped edge would join vertices that no edge joins yet, nor another flip."""
    corner = faces.ravel()
    a = corner[next_half_edge(next_half_edge(h))]
    b = corner[next_half_edge(next_half_edge(twin[h]))]
    key = np.minimum(a, b) * n + np.maximum(a, b)
    start, end = corner[_half_edges_of(alive)], corner[next_half_edge(_half_edges_of(alive))]
    taken = np.isin(key, np.minimum(start, end) * n + np.maximum(start, end))
    once = np.zeros(len(h), dtype=bool)
    once[np.unique(key, return_index=True)[1]] = True
    return np.asarray(~taken & once & (a != b))


def _half_edges_of(faces: Ints) -> Ints:
    """The half-edges of some faces."""
    return (3 * faces[:, None] + np.arange(3)).ravel()


def _flip(faces: Ints, h: Ints, twin: Ints) -> None:
    """Turns the edges h of oriented faces a→b (apex c) | b→a (apex d) into c–d, in place."""
    corner = faces.ravel().copy()
    a, b = corner[h], corner[next_half_edge(h)]
    c = corner[next_half_edge(next_half_edge(h))]
    d = corner[next_half_edge(next_half_edge(twin))]
    faces[h // 3] = np.stack([a, d, c], axis=1)
    faces[twin // 3] = np.stack([d, b, c], axis=1)
