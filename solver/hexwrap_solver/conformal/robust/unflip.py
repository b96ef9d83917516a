"""The surface's own triangles, drawn straight in a flat metric that was found with flips.

Flips lead from the surface's triangulation to the Delaunay triangulation of the flat metric. Undone one by
one in that metric, they lead back: each flip exchanges the diagonals of a quad, whose four corners have known
places in a frame of its own, so that the other diagonal is a difference of places. In the end every side of
the surface's triangles is a vector in its triangle's frame, for any topology, and around any cone, since no
common frame is needed. A triangle may come out turned over: then it is not drawn by any map of these
vertices.

Vectors of a triangle (i, j, k) sum to zero in its frame. Across edge h of one triangle and t of the other,
the frames differ by the rotation that turns t's vector into minus h's. The frame of a cell is the mirror
line: real numbers run along it, in the direction of the chain of outer half-edges, +i points to the
mirror; all cells of one chain share it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.robust import delaunay
from hexwrap_solver.conformal.robust.metric import Metric
from hexwrap_solver.conformal.robust.mirror import MirrorMesh, link, set_cross


@dataclass(frozen=True)
class _Round:
    """Independent flips: (k,) edges flipped across and up; (k,) half-edges below which others went down."""

    across: Ints
    up: Ints
    down: Ints


@dataclass
class Record:
    """All flips from one triangulation to another, in the order in which they were done."""

    rounds: list[_Round] = field(default_factory=list)

    def flip(self, mesh: MirrorMesh, edges: Ints, length: Floats, euclidean: bool) -> None:
        """``delaunay.flip``, recorded."""
        crossing = mesh.crossing[edges]
        cell = (mesh.outer[2 * edges] | mesh.outer[2 * edges + 1]) & ~crossing
        lower = edges[cell]
        below = np.where(mesh.outer[2 * lower], 2 * lower, 2 * lower + 1)
        self.rounds.append(_Round(edges[~(crossing | cell)], edges[crossing], below))
        delaunay.flip(mesh, edges, length, euclidean)

    def undone(self, mesh: MirrorMesh, metric: Metric) -> Complexes:
        """(2e,) the vector of every half-edge of the first triangulation, in its triangle's frame. Turns the
        last one, with its metric, back into the first."""
        vector = _vectors(mesh, metric)
        for flips in reversed(self.rounds):
            _across(mesh, flips.across, vector)
            _raised(mesh, flips.down, vector)
            _lowered(mesh, flips.up, vector)
        mesh.flipped()
        return vector


def _vectors(mesh: MirrorMesh, metric: Metric) -> Complexes:
    """(2e,) the vectors of a Delaunay metric."""
    vector = np.zeros(len(mesh.origin), dtype=complex)
    first, second, third = mesh.triangles()
    size = np.exp(metric.length)
    vector[first] = size[first >> 1]
    vector[second] = size[second >> 1] * np.exp(1j * (np.pi - metric.end[first]))
    vector[third] = -vector[first] - vector[second]
    cells = mesh.chain()
    vector[cells] = size[cells >> 1] * np.exp(1j * (np.pi / 2 - metric.start[cells]))
    return vector


def _turned(vector: Complexes, onto: Ints, other: Ints) -> Complexes:
    """(k,) the rotation that turns the vectors of half-edges ``other`` into minus those of ``onto``."""
    ratio = -vector[onto] * np.conj(vector[other])
    return np.asarray(ratio / np.maximum(np.abs(ratio), np.finfo(float).tiny))


def _across(mesh: MirrorMesh, edges: Ints, vector: Complexes) -> None:
    """Triangles (l, k, i) and (k, l, j) become (i, j, k) and (j, i, l) again."""
    h, t = 2 * edges, 2 * edges + 1
    ki, il, lj, jk = mesh.next[h], mesh.prev[h], mesh.next[t], mesh.prev[t]
    turn = _turned(vector, h, t)
    vector[lj] *= turn
    vector[jk] *= turn
    vector[h] = vector[il] + vector[lj]
    vector[t] = -vector[h]
    mesh.origin[h], mesh.origin[t] = mesh.origin[il], mesh.origin[jk]
    link(mesh, h, jk, ki)
    link(mesh, t, il, lj)


def _raised(mesh: MirrorMesh, below: Ints, vector: Complexes) -> None:
    """Cells (j, x, K) and (x, i, K) become triangle (i, j, x) and cell (j, i, K) again."""
    edges, h = below >> 1, below ^ 1
    right = mesh.next[2 * edges]
    left = mesh.prev[right]
    before, after = mesh.prev[left], mesh.next[right]
    vector[below] = vector[left] + vector[right]
    vector[h] = -vector[below]
    set_cross(mesh, below, mesh.cross[left])
    mesh.cross[left] = mesh.cross[right] = -1
    mesh.outer[left] = mesh.outer[right] = False
    mesh.outer[below] = True
    mesh.outer[h] = False
    mesh.crossing[edges] = False
    mesh.origin[h], mesh.origin[below] = mesh.origin[after], mesh.origin[left]
    link(mesh, left, right, h)
    mesh.next[before], mesh.prev[below] = below, before
    mesh.next[below], mesh.prev[after] = after, below


def _lowered(mesh: MirrorMesh, edges: Ints, vector: Complexes) -> None:
    """Triangle (i, j, x) and cell (j, i, K) become the cells (j, x, K) and (x, i, K) again."""
    h, below = 2 * edges, 2 * edges + 1
    left, right = mesh.next[h], mesh.prev[h]
    before, after = mesh.prev[below], mesh.next[below]
    turn = _turned(vector, below, h)
    vector[left] *= turn
    vector[right] *= turn
    set_cross(mesh, left, mesh.cross[below])
    set_cross(mesh, right, edges)
    mesh.outer[left] = mesh.outer[right] = True
    mesh.outer[below] = False
    mesh.crossing[edges] = True
    mesh.origin[h] = mesh.origin[below] = mesh.origin[right]
    mesh.next[before], mesh.prev[left] = left, before
    mesh.next[left], mesh.prev[right] = right, left
    mesh.next[right], mesh.prev[after] = after, right
