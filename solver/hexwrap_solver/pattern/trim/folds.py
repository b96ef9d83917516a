"""Cutting the pattern along folds, and joining it again across them.

The layout is cut open along the folds of the surface, so that each becomes boundary on either side, and cells
are cut there as anywhere at the boundary. What stands at one place of a fold then comes once from each side:

             face on the left                Points on an edge of the mesh are paired by their places on it,
        ───•────────•───────•───  a fold     those at a vertex by the vertex, at which more than two sides may
        ───•────────•───────•───             meet. Of each set one stays; an isometry carries its coordinates
             face on the right               to those of every other one.

Sides of cells along a fold that then join the same two points are twins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.lay.cells import Cells
from hexwrap_solver.pattern.lay.layout import Layout
from hexwrap_solver.pattern.place.glued import Glued
from hexwrap_solver.pattern.trim.boundary import Boundary, BoundaryPoints
from hexwrap_solver.surface.features import FeatureEdges

#: Points of the two sides of a fold are one within this many times the tolerance.
SAME = 32.0


@dataclass(frozen=True)
class Seams:
    """Which points of the arrangement are one.

    point: (p,) the one that stands for each; isometry: (p, 4) from that one's own coordinates to each one's.
    on, feature: (f,) points on features, feature after feature, in order; edge: the edge of the feature that
    each lies on, along: where, from 0 to 1."""

    point: Ints
    isometry: Ints
    on: Ints
    feature: Ints
    edge: Ints
    along: Floats

    def any_of(self, flags: Bools) -> Bools:
        """(p,) whether it holds of any of the points that are one."""
        some = np.zeros(len(flags), dtype=bool)
        some[self.point[flags]] = True
        return np.asarray(some[self.point])


def cut_open(layout: Layout, features: FeatureEdges) -> Layout:
    """Without a way across the edges of features."""
    across = layout.across.copy().ravel()
    across[features.half_edge] = -1
    across[layout.twin[features.half_edge]] = -1
    return Layout(**{**vars(layout), "across": across.reshape(-1, 3)})


def seams(
    layout: Layout,
    faces: Ints,
    glued: Glued,
    features: FeatureEdges,
    boundary: Boundary,
    on: BoundaryPoints,
    count: int,
) -> Seams:
    """layout: cut open. faces: (m, 3) of the surface. on: the points on the boundary, of ``count``."""
    lattice = layout.lattice
    face, edge = boundary.face[on.edge], boundary.edge[on.edge]
    half_edge = 3 * face + edge
    at_vertex = on.t == 0
    folded = boundary.surface_loop[on.edge] < 0
    twin = np.where(folded, layout.twin[half_edge], half_edge)
    lower = half_edge <= twin
    place = np.where(lower, on.t, 1 - on.t)
    length = abs(boundary.head - boundary.tail)[on.edge]
    # One number for the vertex or the edge; along an edge, points that are near enough are one.
    n = int(faces.max()) + 1
    name = np.where(at_vertex, faces[face, edge], n + np.minimum(half_edge, twin))
    order = np.lexsort((np.where(at_vertex, 0.0, place), name))
    apart = np.where(at_vertex, 0.0, place * length)[order]
    near = (name[order][1:] == name[order][:-1]) & (np.diff(apart) <= SAME * layout.tolerance)
    group = np.zeros(len(order), dtype=np.int64)
    group[order] = np.concatenate([[0], np.cumsum(~near)]) if len(order) else group
    # From the vertex's own coordinates, or those of the lower half-edge's face, to the point's.
    to_face = np.where(at_vertex[:, None], glued.rows[face, edge], 0)
    upper = np.flatnonzero(~at_vertex & ~lower)
    to_face[upper] = layout.isometries[layout.crossing[face[upper], edge[upper]]]
    isometry = lattice.compose(on.isometry, to_face)
    # A point may be listed once only; of each group its first one stands for all.
    first = np.unique(group, return_index=True)[1]
    point, rows = np.arange(count), np.zeros((count, 4), dtype=np.int64)
    point[on.point] = on.point[first][group]
    rows[on.point] = lattice.compose(isometry, lattice.invert(isometry[first])[group])
    return Seams(point, rows, *_on_features(features, boundary, on, faces))


def _on_features(
    features: FeatureEdges, boundary: Boundary, on: BoundaryPoints, faces: Ints
) -> tuple[Ints, Ints, Ints, Floats]:
    """The points on each feature, in its order."""
    by_half_edge = np.full(faces.size, -1, dtype=np.int64)
    by_half_edge[features.half_edge] = np.arange(len(features.half_edge))
    half_edge = 3 * boundary.face[on.edge] + boundary.edge[on.edge]
    which = by_half_edge[half_edge]
    inside = np.flatnonzero((which >= 0) & (on.t > 0))
    # Points at vertices, whichever edge they are listed at, for all features that come there.
    at_vertex = np.full(int(faces.max()) + 1, -1, dtype=np.int64)
    ends = np.flatnonzero(on.t == 0)
    at_vertex[faces.ravel()[half_edge[ends]]] = on.point[ends]
    first, last = at_vertex[features.tail], np.where(features.last, at_vertex[features.head], -1)
    met, end = np.flatnonzero(first >= 0), np.flatnonzero(last >= 0)
    point = np.concatenate([on.point[inside], first[met], last[end]])
    edge = np.concatenate([which[inside], met, end])
    along = np.concatenate([on.t[inside], np.zeros(len(met)), np.ones(len(end))])
    sort = np.lexsort((along, edge))
    return point[sort], features.feature[edge[sort]], edge[sort], along[sort]


def sewn(lattice: Lattice, cells: Cells, seam: Seams) -> Cells:
    """Cells with one point for each place, and neighbours across the folds."""
    old = cells.corner.values.astype(np.int64)
    corner = seam.point[old]
    own = seam.isometry[old]
    first = own[cells.corner.offsets[:-1]][cells.corner.row]
    isometry = lattice.compose(lattice.invert(first), lattice.compose(cells.isometry, own))
    following = corner[cells.corner.next()]
    open_side = np.flatnonzero(cells.twin < 0)
    a, b = corner[open_side], following[open_side]
    size = int(corner.max(initial=0)) + 1
    pair = np.minimum(a, b) * size + np.maximum(a, b)
    _, group, members = np.unique(pair, return_inverse=True, return_counts=True)
    order = np.argsort(group, kind="stable")
    two = order[members[group[order]] == 2].reshape(-1, 2)
    facing = a[two[:, 0]] == b[two[:, 1]]
    one, other = open_side[two[facing]].T
    twin = cells.twin.copy()
    twin[one], twin[other] = other, one
    return Cells(Ragged(corner, cells.corner.offsets), isometry, twin, cells.index)


def without_ends(lattice: Lattice, cells: Cells) -> tuple[Cells, Bools]:
    """Cells without the pieces of folds that only reach into them and end there, and (c,) those that had
    some.

    Such a piece is walked to its tip and straight back: two successive sides that are twins.
    """
    had = np.zeros(cells.n, dtype=bool)
    while True:
        following = cells.corner.next()
        tip = cells.twin == following
        if not tip.any():
            return cells, had
        had[cells.corner.row[tip]] = True
        keep = ~tip
        keep[following[tip]] = False
        renumber = np.where(keep, np.cumsum(keep) - 1, -1)
        row, twin, isometry = cells.corner.row[keep], cells.twin[keep], cells.isometry[keep]
        corner = Ragged.of(cells.corner.values[keep], np.bincount(row, minlength=cells.n))
        frame = lattice.invert(isometry[corner.offsets[row]])  # the first corner may have gone
        twin = np.where(twin >= 0, renumber[twin], -1)
        cells = Cells(corner, lattice.compose(frame, isometry), twin, cells.index)
