"""Triangles without area: corners on one line, as they come from a vertex on another face's edge.

Dropping one would tear a slit. Its longest edge is flipped instead, which gives the vertex in its middle
to the face on the other side; at the boundary the triangle can be dropped, and the boundary runs through
the vertex.
"""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.surface.flips import flip, independent, joins_new
from hexwrap_solver.surface.topology import edge_lengths, next_half_edge, twins

#: A triangle with a + b − c below this part of c has no angles in double precision: about 2e-6 degrees at
#: the ends of its longest edge c.
FLAT = 16 * np.finfo(float).eps
#: One pass repairs every second triangle of a row of them at least.
PASSES = 60


def flat(lengths: Floats) -> Bools:
    """(m,) triangles, lengths (m, 3), whose longest edge is as long as the two others together."""
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
        bad = flat(edge_lengths(vertices, faces)) & keep
        if not bad.any() or not _pass(vertices, faces, keep, bad):
            break
    return faces, keep, flat(edge_lengths(vertices, faces)) & keep


def _pass(vertices: Floats, faces: Ints, keep: Bools, bad: Bools) -> bool:
    """Repairs in place what can be repaired independently; False where nothing could."""
    alive = np.flatnonzero(keep)
    local = twins(faces[alive], len(vertices))
    twin = np.full(3 * len(faces), -1, dtype=np.int64)
    own = (3 * alive[:, None] + np.arange(3)).ravel()
    twin[own] = np.where(local >= 0, own[local], -1)
    face = np.flatnonzero(bad)
    h = 3 * face + np.argmax(edge_lengths(vertices, faces[face]), axis=1)
    rim = h[twin[h] < 0]
    droppable = rim[_leaves_no_pinch(faces, twin, keep, rim)]
    flips = independent(h[twin[h] >= 0], twin, len(faces))
    flips = flips[joins_new(faces, flips, twin, len(vertices))]
    keep[droppable // 3] = False
    flip(faces, flips, twin)
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
