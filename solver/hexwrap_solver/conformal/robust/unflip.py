"""The surface's own triangles, drawn straight in a flat metric that was found with flips.

Flips lead from the surface's triangulation to the Delaunay triangulation of the flat metric. Undone one by
one in that metric, they lead back: each flip exchanges the diagonals of a quad, whose four corners have known
places in a frame of its own, so that the other diagonal is a difference of places. In the end every side of
the surface's triangles is a vector in its triangle's frame, for any topology, and around any cone, since no
common frame is needed. A triangle may come out turned over: then it is not drawn by any map of these
vertices.

Vectors of a triangle (i, j, k) sum to zero in its frame. Across edge h of one triangle and t of the other,
the frames differ by the rotation that turns t's vector into minus h's. The frame of a trapezoid is the mirror
line: real numbers run along it, in the direction of the chain of outer half-edges, +i points to the
mirror; all trapezoids of one chain share it.
"""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Complexes, Ints
from hexwrap_solver.conformal.robust.metric import Metric
from hexwrap_solver.conformal.robust.mirror import MirrorMesh, link, lower, raise_


def half_edge_vectors(mesh: MirrorMesh, metric: Metric) -> Complexes:
    """(2e,) the vectors of a Delaunay metric."""
    vector = np.zeros(len(mesh.origin), dtype=complex)
    first, second, third = mesh.triangles()
    size = np.exp(metric.length)
    vector[first] = size[first >> 1]
    vector[second] = size[second >> 1] * np.exp(1j * (np.pi - metric.end[first]))
    vector[third] = -vector[first] - vector[second]
    trapezoids = mesh.chain()
    vector[trapezoids] = size[trapezoids >> 1] * np.exp(1j * (np.pi / 2 - metric.start[trapezoids]))
    return vector


def _turned(vector: Complexes, onto: Ints, other: Ints) -> Complexes:
    """(k,) the rotation that turns the vectors of half-edges ``other`` into minus those of ``onto``."""
    ratio = -vector[onto] * np.conj(vector[other])
    return np.asarray(ratio / np.maximum(np.abs(ratio), np.finfo(float).tiny))


def undo_across(mesh: MirrorMesh, edges: Ints, vector: Complexes) -> None:
    """Triangles (l, k, i) and (k, l, j) become (i, j, k) and (j, i, l) again."""
    h, t = 2 * edges, 2 * edges + 1
    ki, il, lj, jk = mesh.next[h], mesh.prev[h], mesh.next[t], mesh.prev[t]
    rotation = _turned(vector, h, t)
    vector[lj] *= rotation
    vector[jk] *= rotation
    vector[h] = vector[il] + vector[lj]
    vector[t] = -vector[h]
    mesh.origin[h], mesh.origin[t] = mesh.origin[il], mesh.origin[jk]
    mesh.winding[h] = mesh.winding[il] + mesh.winding[lj]
    mesh.winding[t] = -mesh.winding[h]
    link(mesh, h, jk, ki)
    link(mesh, t, il, lj)


def undo_down(mesh: MirrorMesh, below: Ints, vector: Complexes) -> None:
    """Trapezoids (j, x, K) and (x, i, K) become triangle (i, j, x) and trapezoid (j, i, K) again."""
    right = mesh.next[2 * (below >> 1)]
    vector[below] = vector[mesh.prev[right]] + vector[right]
    vector[below ^ 1] = -vector[below]
    raise_(mesh, below)


def undo_up(mesh: MirrorMesh, edges: Ints, vector: Complexes) -> None:
    """Triangle (i, j, x) and trapezoid (j, i, K) become the trapezoids (j, x, K) and (x, i, K) again."""
    h, below = 2 * edges, 2 * edges + 1
    rotation = _turned(vector, below, h)
    vector[mesh.next[h]] *= rotation
    vector[mesh.prev[h]] *= rotation
    lower(mesh, below)
