"""Which nodes of the lattice lie in the domain: every triangle of the map, filled with lattice points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Bools, Floats, Ints, runs
from hexwrap_solver.errors import PatternError
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.lay.layout import Layout

#: Incidences are told apart by one integer each.
MOST_KEYS = 1 << 62
UNCLEAR = (
    "Rounding error is too large relative to the cell size to decide which cells lie in the domain. Ask for "
    "larger cells."
)


@dataclass(frozen=True)
class Nodes:
    """Nodes, and their incidences: a node and a triangle that touches it.

    face, point: (k,) and (k, 2) of the incidences, sorted by key. node: (k,) which node each is of.
    isometry: (k, 4) carries the point to that of the node's own incidence. own: (n,) position of the
    incidence that stands for the node.
    starts: (n + 1,) and incidence: (k,) those of node i are incidence[starts[i]:starts[i + 1]].
    """

    face: Ints
    point: Ints
    node: Ints
    isometry: Ints
    own: Ints
    starts: Ints
    incidence: Ints
    _keys: Ints
    _low: Ints
    _span: Ints

    @property
    def n(self) -> int:
        return len(self.own)

    def near_edges(self, layout: Layout, distance: float) -> Bools:
        """(k, 3) which edges of its triangle each incidence lies on."""
        place = layout.lattice.stand(self.point)
        return np.asarray(abs(layout.edge_distances(self.face, place)) <= distance).T

    def find(self, face: Ints, point: Ints) -> Ints:
        """Position of an incidence, −1 where there is none."""
        key = _key(face, point, self._low, self._span)
        at = np.minimum(np.searchsorted(self._keys, key), max(len(self._keys) - 1, 0))
        (low_a, low_b), (a, b) = self._low, np.moveaxis(point, -1, 0)
        found = (a >= low_a) & (a < low_a + self._span[0]) & (b >= low_b) & (b < low_b + self._span[1])
        return (
            np.where(found & (self._keys[at] == key), at, -1) if len(self._keys) else np.full(len(face), -1)
        )


def _key(face: Ints, point: Ints, low: Ints, span: Ints) -> Ints:
    return np.asarray((face * span[0] + (point[..., 0] - low[0])) * span[1] + (point[..., 1] - low[1]))


def lattice_points_in_triangles(triangles: Floats, tolerance: float) -> tuple[Ints, Ints]:
    """(triangle, point (·, 2)) of every integer point inside or within about tolerance of a triangle.

    triangles: (m, 3, 2) in lattice coordinates. Row by row, so that slivers cost no more than their rows.
    """
    a, b = np.ascontiguousarray(triangles.T)  # each (3, m)
    first_row = np.ceil(b.min(axis=0) - tolerance).astype(np.int64)
    rows = np.maximum(np.floor(b.max(axis=0) + tolerance).astype(np.int64) - first_row + 1, 0)
    owner, step = runs(rows)
    row = first_row[owner] + step
    low = np.full(len(owner), np.inf)
    high = np.full(len(owner), -np.inf)
    for c in range(3):
        rise, run = b[(c + 1) % 3] - b[c], a[(c + 1) % 3] - a[c]
        flat = rise == 0
        a0, b0, run, steep = (part.take(owner) for part in (a[c], b[c], run, np.where(flat, np.inf, rise)))
        rise = rise.take(owner)
        for margin in (-tolerance, tolerance):  # a shallow edge stays within tolerance of the row for a while
            t = np.minimum(np.maximum((row + margin - b0) / steep, 0.0), 1.0)
            meets = abs(b0 + t * rise - row) <= 1.5 * tolerance
            at = a0 + t * run
            np.minimum(low, at, out=low, where=meets)
            np.maximum(high, at, out=high, where=meets)
    met = low <= high
    owner, row = owner[met], row[met]
    first = np.ceil(low[met] - tolerance).astype(np.int64)
    count = np.maximum(np.floor(high[met] + tolerance).astype(np.int64) - first + 1, 0)
    span, step = runs(count)
    return owner[span], np.stack([first[span] + step, row[span]], axis=1)


def find_nodes(layout: Layout) -> Nodes:
    """All lattice nodes in the domain, each once, also on edges, at vertices and at the cut."""
    lattice = layout.lattice
    face, point = _points_in_faces(layout)
    low = point.min(axis=0, initial=0)
    span = point.max(axis=0, initial=0) - low + 1
    if len(layout.corners) * int(span[0]) * int(span[1]) >= MOST_KEYS:
        raise PatternError(UNCLEAR)
    keys = _key(face, point, low, span)
    order = np.argsort(keys, kind="stable")
    face, point, keys = face[order], point[order], keys[order]
    empty = np.zeros(0, dtype=np.int64)
    found = Nodes(face, point, empty, empty, empty, empty, empty, keys, low, span)
    first, second, step = _same_place(layout, found)
    node, n = _joined(first, second, len(face))
    incidence = np.argsort(node, kind="stable")
    starts = np.append(0, np.cumsum(np.bincount(node, minlength=n)))
    own = incidence[starts[:-1]]
    isometry = _seen_from(own, first, second, layout.isometries[step], lattice, len(face))
    return Nodes(face, point, node, isometry, own, starts, incidence, keys, low, span)


def _joined(first: Ints, second: Ints, k: int) -> tuple[Ints, int]:
    """(k,) number of the part of a graph that each of k is in, in the order of their lowest, and how many
    there are. Few are joined to others."""
    some = np.zeros(k, dtype=bool)
    some[first] = some[second] = True
    place, members = np.cumsum(some) - 1, np.flatnonzero(some)
    graph = coo_array((np.ones(len(first)), (place[first], place[second])), shape=(len(members),) * 2)
    parts, part = connected_components(graph, directed=False)
    lowest, least = np.arange(k), np.full(parts, k)
    np.minimum.at(least, part, members)
    lowest[members] = least[part]
    leads = lowest == np.arange(k)
    return (np.cumsum(leads) - 1).take(lowest), int(np.count_nonzero(leads))


def _points_in_faces(layout: Layout) -> tuple[Ints, Ints]:
    """Every face with every node that stands in it; those that stand off their points are looked for farther
    around."""
    lattice, tolerance = layout.lattice, layout.tolerance
    far = lattice.largest_offset / lattice.unit.imag  # in lattice coordinates
    face, point = lattice_points_in_triangles(lattice.coordinates(layout.corners), tolerance + far)
    wanted = lattice.is_node(point)
    face, point = face[wanted], point[wanted]
    if far:
        inside = (layout.edge_distances(face, lattice.stand(point)) >= -tolerance).all(axis=0)
        face, point = face[inside], point[inside]
    return face, point


def _same_place(layout: Layout, found: Nodes) -> tuple[Ints, Ints, Ints]:
    """Pairs of incidences of one node across an edge it lies on, and what that edge's crossing is."""
    near = found.near_edges(layout, 4 * layout.tolerance)
    at, c = np.nonzero(near & (layout.across[found.face] >= 0))
    across, crossing = layout.across[found.face[at], c], layout.crossing[found.face[at], c]
    point, glued = found.point[at], np.flatnonzero(crossing)
    point[glued] = layout.lattice.apply(layout.into(crossing[glued]), point[glued])
    other = found.find(across, point)
    same = other >= 0
    return at[same], other[same], crossing[same]


def _seen_from(own: Ints, first: Ints, second: Ints, step: Ints, lattice: Lattice, size: int) -> Ints:
    """(size, 4) isometries that carry incidences to their nodes' own ones, composed along the pairs, of which
    step (…, 4) carries the second to the first."""
    isometry = np.zeros((size, 4), dtype=np.int64)
    known = np.ones(size, dtype=bool)
    known[first] = False
    known[own] = True
    while not known.all():
        new = known[first] & ~known[second]
        if not new.any():  # "the same place" was not symmetric: the layout is finer than its rounding
            raise PatternError(UNCLEAR)
        isometry[second[new]] = lattice.compose(isometry[first[new]], step[new])
        known[second[new]] = True
    return isometry
