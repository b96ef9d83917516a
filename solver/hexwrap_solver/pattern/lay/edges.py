"""Edges of the pattern, from node to node, found by tracing them through the domain.

The edges of a node are numbered counter-clockwise around it: its slots. On the plane the residue of the
node's point says in which direction each leaves. At a node that is a singularity itself the sectors of the
faces around it are walked once: angles add up from face to face, and a slot stands for every direction of the
lattice that is met on the way, five or seven of them where the plane has six. Nobody else needs to know: an
edge is a node and a slot, it has a reverse, and a cell goes on with the slot clockwise from that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, runs
from hexwrap_solver.pattern.lay.layout import Layout
from hexwrap_solver.pattern.lay.nodes import Nodes
from hexwrap_solver.pattern.lay.trace import trace
from hexwrap_solver.tolerances import ANGLE, TINY


@dataclass(frozen=True)
class PatternEdges:
    """Directed edges by node and slot; an edge has the number width·node + slot.

    degree: (n,) slots of each node. way: (n, width) directions of the lattice in which they leave, in the
    node's own coordinates, increasing, −1 beyond the degree; at singularities counted on from sector to
    sector. around: (n,) directions once around the node. head: (n, width) the node at the other end, −1 where
    there is none. back: (n, width) number of the same edge from its other end. exits: (n, width) 3·face +
    half-edge of the boundary edge at which the edge leaves the domain, −1 elsewhere. gluing: (n, width) row
    in the table isometries (g, 4) of what carries the head's own coordinates, or those of the face at the
    exit, to the tail's own; row 0 is the identity. seam: (n, 4) what a walk around the node meets clockwise
    between slot 0 and the last slot, the identity but at singularities.
    """

    degree: Ints
    way: Ints
    around: Ints
    head: Ints
    back: Ints
    exits: Ints
    gluing: Ints
    isometries: Ints
    seam: Ints

    @property
    def width(self) -> int:
        return int(self.head.shape[1])

    def number(self, node: Ints, slot: Ints) -> Ints:
        return np.asarray(node * self.width + slot)

    def isometry(self, tail: Ints, slot: Ints) -> Ints:
        """(…, 4) see gluing."""
        return self.isometries[self.gluing[tail, slot]]

    def both_ways(self) -> PatternEdges:
        """Without those whose way back leads elsewhere: around a vertex of the boundary with more than a full
        turn two lines go straight on, one on either side."""
        n = self.head.size
        back = np.where(self.head >= 0, self.back, np.arange(n).reshape(self.back.shape))
        returns = back.ravel()[back] == np.arange(n).reshape(back.shape)
        return self if returns.all() else replace(self, head=np.where(returns, self.head, -1))

    def clockwise(self, node: Ints, slot: Ints) -> tuple[Ints, Ints, Bools]:
        """The slot clockwise from each; by how many directions; and whether the seam lies between."""
        passed = slot == 0
        following = np.where(passed, self.degree.take(node), slot) - 1
        ways, around = self.way.ravel(), np.where(passed, self.around.take(node), 0)
        turned = ways.take(self.number(node, slot)) - ways.take(self.number(node, following)) + around
        return following, turned, passed

    def slot_before(self, node: Ints, heading: Floats) -> Ints:
        """The slot at or clockwise from a heading, (k,), in directions of the lattice, not whole numbers."""
        ways = np.where(self.way[node] < 0, np.inf, self.way[node])
        before = (ways <= (heading % self.around[node])[:, None]).sum(axis=1) - 1
        return np.where(before < 0, self.degree[node] - 1, before)


@dataclass(frozen=True)
class _Cone:
    """A node at a singularity. incidence: (m,) its faces counter-clockwise, the node's own first. begins:
    (m + 1,) angles at which their sectors begin, counted on. isometry: (m, 4) from their coordinates to the
    node's own, counter-clockwise; seam: the inverse of once around. ways: (degree,)."""

    node: int
    incidence: Ints
    begins: Floats
    isometry: Ints
    seam: Ints
    ways: Ints
    around: int


def find_edges(layout: Layout, nodes: Nodes) -> tuple[PatternEdges, Nodes]:
    """Trace every edge once, from one of its ends. Also the nodes, with isometries at singularities that were
    found counter-clockwise."""
    lattice = layout.lattice
    cones = [cone for at in layout.cones.tolist() if (cone := _cone(layout, nodes, at)) is not None]
    if cones:
        isometry = nodes.isometry.copy()
        for cone in cones:
            isometry[cone.incidence] = cone.isometry
        nodes = replace(nodes, isometry=isometry)
    found = _Found(layout, nodes, cones)
    half = (found.way >= 0) & (found.way < lattice.directions // 2)
    found.follow(*np.nonzero(half))
    # Edges whose two ends both, or neither, count as the first one because a gluing lies between them.
    found.follow(*np.nonzero((found.way >= 0) & (found.head < 0) & (found.exits < 0)))
    return found.edges(), nodes


def _cone(layout: Layout, nodes: Nodes, corner: int) -> _Cone | None:
    """The node that stands at a singularity, None where a cell has its middle there."""
    lattice = layout.lattice
    face, at = np.array([corner // 3]), layout.corners.ravel()[corner]
    point = np.rint(lattice.coordinates(np.array([at]))).astype(np.int64)
    seen = nodes.find(face, point)
    if seen[0] < 0 or abs(complex(lattice.stand(point)[0]) - at) > 4 * layout.tolerance:
        return None
    node = int(nodes.node[seen[0]])
    own = int(nodes.own[node])
    place = complex(lattice.stand(nodes.point[own]))
    corner = 3 * int(nodes.face[own]) + int(np.argmin(abs(layout.corners[nodes.face[own]] - place)))
    incidence: list[int] = []
    begins: list[float] = []
    isometry = [np.zeros(4, dtype=np.int64)]
    at_corner, angle = corner, 0.0
    while True:
        f, c = divmod(at_corner, 3)
        here, following, before = (layout.corners[f, (c + i) % 3] for i in range(3))
        if not begins:
            angle = float(np.angle(following - here))
        begins.append(angle)
        angle += float(np.angle((before - here) / (following - here)))
        entry = 3 * f + (c + 2) % 3  # the half-edge that comes to the node
        if layout.across.ravel()[entry] < 0:  # a fold ends here: the node stands on a boundary
            return None
        crossing = layout.crossing.ravel()[entry]
        point = lattice.rotate(nodes.point[own] - isometry[-1][1:3], -isometry[-1][0])
        incidence.append(int(nodes.find(np.array([f]), point[None])[0]))
        isometry.append(lattice.compose(isometry[-1][None], layout.isometries[crossing][None])[0])
        at_corner = int(layout.twin[entry])
        if at_corner == corner:
            break
    begins.append(angle)
    first = float(np.angle(lattice.headings[0]))
    per_turn = lattice.directions / (2 * np.pi)
    around = round((begins[-1] - begins[0]) * per_turn)
    low = int(np.ceil((begins[0] - first) * per_turn - 1e-6))
    ways = low + np.arange(around)
    ways = ways[lattice.slots[lattice.residue(nodes.point[own])][ways % lattice.directions] >= 0]
    seam = lattice.invert(isometry[-1][None])[0]
    return _Cone(node, np.array(incidence), np.array(begins), np.stack(isometry[:-1]), seam, ways, around)


class _Found:
    """Edges as they are found; what is found last about one holds."""

    def __init__(self, layout: Layout, nodes: Nodes, cones: list[_Cone]) -> None:
        lattice = layout.lattice
        self.layout, self.nodes, self.cones = layout, nodes, cones
        self.residue = lattice.residue(nodes.point[nodes.own])
        width = max([lattice.ways.shape[1], *(len(cone.ways) for cone in cones)])
        self.way = np.full((nodes.n, width), -1, dtype=np.int64)
        self.way[:, : lattice.ways.shape[1]] = lattice.ways[self.residue]
        self.around = np.full(nodes.n, lattice.directions)
        self.seam = np.zeros((nodes.n, 4), dtype=np.int64)
        self.cone_of = np.full(nodes.n, -1, dtype=np.int64)
        for i, cone in enumerate(cones):
            self.way[cone.node] = -1
            self.way[cone.node, : len(cone.ways)] = cone.ways - cone.ways[0]
            self.around[cone.node], self.seam[cone.node] = cone.around, cone.seam
            self.cone_of[cone.node] = i
        self.head = np.full(self.way.shape, -1, dtype=np.int64)
        self.back = np.full(self.way.shape, -1, dtype=np.int64)
        self.exits = np.full(self.way.shape, -1, dtype=np.int64)
        self._row = np.zeros(self.way.size, dtype=np.int64)
        self._rows = [np.zeros((1, 4), dtype=np.int64)]
        self._many = 1

    def glue(self, edge: Ints, isometry: Ints) -> None:
        """edge: numbers."""
        a, b, c, d = isometry.T
        moved = (a | b | c | d) != 0
        self._row[edge] = 0
        self._row[edge[moved]] = self._many + np.arange(np.count_nonzero(moved))
        self._rows.append(isometry[moved])
        self._many += len(self._rows[-1])

    def edges(self) -> PatternEdges:
        different, row = np.unique(np.concatenate(self._rows), axis=0, return_inverse=True)
        row = row.ravel()
        identity = row[0]  # moves to the front
        order = np.concatenate([[identity], np.delete(np.arange(len(different)), identity)])
        gluing = np.argsort(order)[row][self._row].reshape(self.head.shape)
        degree = (self.way >= 0).sum(axis=1)
        return PatternEdges(
            degree,
            self.way,
            self.around,
            self.head,
            self.back,
            self.exits,
            gluing,
            different[order],
            self.seam,
        )

    def follow(self, node: Ints, slot: Ints) -> None:
        """Trace edges from their tails, and enter what was found at both ends."""
        layout, nodes, lattice, width = self.layout, self.nodes, self.layout.lattice, self.way.shape[1]
        seen, way, blocked = self._departure(node, slot)
        start = nodes.point[seen]
        found = trace(layout, nodes.face[seen], lattice.stand(start), start + lattice.steps[way])
        arrival = nodes.find(found.face, found.target)
        arrived = (found.exit < 0) & ~blocked & (arrival >= 0)
        isometry = lattice.compose(nodes.isometry[seen], found.isometry)
        out = np.flatnonzero(~arrived)
        self.glue(node[out] * width + slot[out], isometry[out])
        self.exits[node[out], slot[out]] = 3 * found.face[out] + np.maximum(found.exit[out], 0)
        # On arrival: the direction back, in the coordinates of the last face.
        back = way - found.isometry[:, 0] * lattice.steps_per_turn + lattice.directions // 2
        node, slot, arrival, back = node[arrived], slot[arrived], arrival[arrived], back[arrived]
        head = nodes.node[arrival]
        back_slot, to_own = self._slot(arrival, back % lattice.directions)
        isometry = lattice.compose(isometry[arrived], lattice.invert(to_own))
        self.head[node, slot], self.back[node, slot] = head, head * width + back_slot
        self.glue(node * width + slot, isometry)
        self.head[head, back_slot], self.back[head, back_slot] = node, node * width + slot
        self.glue(head * width + back_slot, lattice.invert(isometry))

    def _slot(self, incidence: Ints, way: Ints) -> tuple[Ints, Ints]:
        """(k,) slots of the nodes, from directions in the coordinates of incidences, and (k, 4) isometries
        from these to the nodes' own."""
        nodes, lattice = self.nodes, self.layout.lattice
        node = nodes.node[incidence]
        own = (way + nodes.isometry[incidence, 0] * lattice.steps_per_turn) % lattice.directions
        slot, to_own = lattice.slots[self.residue[node], own], nodes.isometry[incidence]
        for k in np.flatnonzero(self.cone_of[node] >= 0).tolist():
            cone = self.cones[self.cone_of[node[k]]]
            slot[k], passed = self._slot_at_cone(cone, int(incidence[k]), int(way[k]))
            if passed:
                to_own[k] = lattice.compose(cone.seam[None], to_own[k][None])[0]
        return slot, to_own

    def _slot_at_cone(self, cone: _Cone, incidence: int, way: int) -> tuple[int, bool]:
        """Also whether the direction is that with which the first sector begins, seen from the last one."""
        lattice, layout = self.layout.lattice, self.layout
        sector = int(np.flatnonzero(cone.incidence == incidence)[0])
        corners = layout.corners[self.nodes.face[incidence]]
        c = int(np.argmin(abs(corners - lattice.stand(self.nodes.point[incidence]))))
        off = float(np.angle(lattice.headings[way] / (corners[(c + 1) % 3] - corners[c])))
        angle = cone.begins[sector] + (off if off > -1e-3 else off + 2 * np.pi)
        count = (angle - float(np.angle(lattice.headings[0]))) / (2 * np.pi) * lattice.directions
        counted = round(count) - int(cone.ways[0])
        passed = counted >= cone.around
        return int(np.flatnonzero(cone.ways - cone.ways[0] == counted % cone.around)[0]), passed

    def _departure(self, node: Ints, slot: Ints) -> tuple[Ints, Ints, Bools]:
        """The incidence from which an edge starts into its triangle, the direction there, and whether it
        leads straight out of the domain."""
        layout, nodes, lattice = self.layout, self.nodes, self.layout.lattice
        way = self.way[node, slot]
        seen = nodes.own[node]
        blocked = np.zeros(len(node), dtype=bool)
        several = np.flatnonzero((np.diff(nodes.starts)[node] > 1) & (self.cone_of[node] < 0))
        if len(several):
            best = _best_incidence(layout, nodes, node[several], way[several])
            seen[several], way[several], blocked[several] = best
        for k in np.flatnonzero(self.cone_of[node] >= 0).tolist():
            cone = self.cones[self.cone_of[node[k]]]
            counted = cone.ways[slot[k]]
            angle = np.angle(lattice.headings[0]) + counted / lattice.directions * 2 * np.pi
            sector = int(np.searchsorted(cone.begins, angle + ANGLE, side="right")) - 1
            sector = min(max(sector, 0), len(cone.incidence) - 1)
            seen[k] = cone.incidence[sector]
            way[k] = (counted - cone.isometry[sector, 0] * lattice.steps_per_turn) % lattice.directions
        return seen, way, blocked


def _best_incidence(layout: Layout, nodes: Nodes, node: Ints, direction: Ints) -> tuple[Ints, Ints, Bools]:
    """For nodes on edges or vertices: the triangle into which a direction leads."""
    lattice = layout.lattice
    count = np.diff(nodes.starts)[node]
    line, step = runs(count)
    seen = nodes.incidence[nodes.starts[node[line]] + step]
    way = (direction[line] - nodes.isometry[seen, 0] * lattice.steps_per_turn) % lattice.directions
    corners = layout.corners[nodes.face[seen]]
    along = np.roll(corners, -1, axis=1) - corners
    inward = 1j * along / np.maximum(abs(along), TINY)
    heading = lattice.headings[way][:, None]
    into = heading.real * inward.real + heading.imag * inward.imag
    off_edge = abs(layout.edge_distances(nodes.face[seen], lattice.stand(nodes.point[seen]))).T
    at_edge = off_edge <= 4 * layout.tolerance
    score = np.where(at_edge, into, 1.0).min(axis=1)
    best = np.lexsort((-score, line))[np.cumsum(count) - count]
    outward = at_edge & (into < -1e-6) & (layout.across[nodes.face[seen]] < 0)
    return seen[best], way[best], outward[best].any(axis=1)
