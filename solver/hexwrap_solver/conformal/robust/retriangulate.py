"""Better triangles inside the flat pieces of a refined mesh.

What was one triangle of the sent mesh stays flat however often its edges are split, so the edges inside it
may be flipped without changing the surface.
"""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.surface.flips import angle_sums_opposite, flip, independent
from hexwrap_solver.surface.topology import twins

#: Opposite angles that add up to less than this beyond π are left: rounding must not flip to and fro.
TOLERANCE = 1e-9
MAX_ROUNDS = 200


def flatten_out(vertices: Floats, faces: Ints, parent: Ints) -> Ints:
    """(m, 3) the faces with every edge between two of one parent Delaunay. parent: (m,)."""
    children = np.bincount(parent)
    some = np.flatnonzero(children[parent] > 1)
    used, local = np.unique(faces[some], return_inverse=True)
    points, part, owner = vertices[used], local.reshape(-1, 3), parent[some]
    for _ in range(MAX_ROUNDS):
        twin = twins(part, len(points))
        h = np.flatnonzero(np.arange(part.size) < twin)
        h = h[owner[h // 3] == owner[twin[h] // 3]]
        h = h[angle_sums_opposite(points, part, h, twin[h]) > np.pi + TOLERANCE]
        if not len(h):
            break
        flip(part, independent(h, twin, len(part)), twin)
    improved = faces.copy()
    improved[some] = used[part]
    return improved
