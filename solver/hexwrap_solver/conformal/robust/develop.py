"""Unrolling a flat Delaunay metric of the mirrored annulus: a place in the plane for every vertex."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.robust.metric import Metric
from hexwrap_solver.conformal.robust.mirror import MirrorMesh
from hexwrap_solver.conformal.types import Deck
from hexwrap_solver.geometry import stable_order, sums_to_root
from hexwrap_solver.tolerances import is_zero


@dataclass(frozen=True)
class Development:
    """uv: (n,) one copy of each vertex. lift: (n,) how many turns lie between that copy and the one that
    ``MirrorMesh.winding`` counts from: along a half-edge from v to w with winding c, from the copy uv[v],
    lies g^{lift[v] + c − lift[w]}(uv[w]). translation: that of g. gap: greatest disagreement of any edge,
    relative to the length of one turn where it lies."""

    uv: Complexes
    lift: Ints
    translation: complex
    gap: float


def develop(mesh: MirrorMesh, metric: Metric, cone_angle: float) -> Development:
    """Directions over a tree of half-edges, then positions over a tree of vertices.

    The tree starts where edges are shortest: the rounding of a place is then in proportion to its distance
    from there, and tiny triangles keep their digits.
    """
    live = np.flatnonzero(~np.repeat(mesh.crossing, 2))
    live = live[stable_order(mesh.origin[live], mesh.n)]
    root = int(mesh.origin[live[np.argmin(metric.length[live >> 1])]])
    step = _directions(mesh, metric, cone_angle, live) * np.exp(metric.length[live >> 1])
    tail, head = mesh.origin[live], mesh.origin[live ^ 1]
    winding = mesh.winding[live]

    above = _parents(head, np.searchsorted(tail, np.arange(mesh.n + 1)), root)
    on_tree = np.flatnonzero(above[head] == tail)
    via = np.full(mesh.n, -1)
    via[head[on_tree]] = on_tree  # of several edges between two vertices any one will do
    below = np.flatnonzero(above >= 0)
    via, up = via[below], np.where(above >= 0, above, root)
    lift: Ints = np.zeros(mesh.n, dtype=np.int64)
    lift[below] = winding[via]
    lift = sums_to_root(lift, up, root)
    step = step * np.exp(1j * cone_angle * lift[tail])
    uv: Complexes = np.zeros(mesh.n, dtype=np.complex128)
    uv[below] = step[via]
    uv = sums_to_root(uv, up, root)

    power = lift[tail] + winding - lift[head]
    rotation = np.exp(1j * cone_angle)
    translation = _translation(uv, step, tail, head, power, rotation)
    near = np.flatnonzero(np.abs(power) <= 1)
    forward = power[near] >= 0  # compare with g or with nothing; backward edges are the twins of forward ones
    near = near[forward]
    copy = np.where(power[near] == 1, rotation * uv[head[near]] + translation, uv[head[near]])
    around = _around(uv, Deck(cone_angle, translation))
    around = np.maximum(around[tail[near]], around[head[near]])
    gap = float((np.abs(uv[tail[near]] + step[near] - copy) / around).max())
    return Development(uv, lift, translation, gap)


def _around(uv: Complexes, deck: Deck) -> Floats:
    """(n,) length of one turn at each place."""
    apex = deck.apex
    if apex is not None:
        return np.asarray(abs(deck.angle) * np.abs(uv - apex))
    if is_zero(deck.angle):
        return np.full(len(uv), abs(deck.translation))
    return np.full(len(uv), abs(deck.angle) * float(np.abs(uv - uv.mean()).mean()))


def _translation(
    uv: Complexes, step: Complexes, tail: Ints, head: Ints, power: Ints, rotation: complex
) -> complex:
    """What closes the edges that go around once, weighted by the digits that each of them has for it."""
    once = power == 1
    one, other = uv[tail[once]] + step[once], rotation * uv[head[once]]
    size = np.abs(uv[tail[once]]) + np.abs(step[once]) + np.abs(other)
    weight = (size.min() / size) ** 2
    return complex((weight * (one - other)).sum() / weight.sum())


def _directions(mesh: MirrorMesh, metric: Metric, cone_angle: float, live: Ints) -> Complexes:
    """(k,) unit vector along each live half-edge, seen from the copy of its origin that turns count from.

    Found over a tree of triangles and trapezoids: those on both sides of an edge, and neighbouring trapezoids
    of one edge of the boundary, know each other's direction; beyond a boundary vertex lies the back of the
    double, so no step is made there.
    """
    triangles, trapezoids = mesh.triangles(), mesh.chain()
    first, second, third = triangles
    t, k = len(first), len(trapezoids)
    piece = np.zeros(len(mesh.origin), dtype=np.int64)
    piece[triangles] = np.arange(t)
    piece[trapezoids] = t + np.arange(k)

    turned = cone_angle * mesh.winding
    bend = np.pi - metric.end - turned  # from a half-edge to the next one
    within = np.zeros(len(mesh.origin))  # direction, seen from its piece's first half-edge
    within[second] = bend[first]
    within[third] = -bend[third]
    over = within + np.pi - turned
    over -= within.reshape(-1, 2)[:, ::-1].ravel()  # from a half-edge's piece to that of its other side
    following = mesh.next[trapezoids]
    bend = bend[trapezoids] - metric.start[following]
    joined = mesh.cross[following] >= 0
    own = t + np.arange(k)
    after, before = piece[following], own.copy()
    before[after[joined] - t] = own[joined]
    after = np.where(joined, after, own)
    back = np.zeros(k)
    back[after[joined] - t] = -bend[joined]

    beside = np.concatenate(
        [piece[triangles.T ^ 1], np.stack([piece[trapezoids ^ 1], after, before], axis=1)]
    )
    angle = np.concatenate([over[triangles.T], np.stack([over[trapezoids], bend, back], axis=1)])
    parent = _parents(beside.ravel(), np.arange(0, 3 * (t + k) + 1, 3), 0)
    below = np.flatnonzero(parent >= 0)
    up = np.where(parent >= 0, parent, 0)
    via = (beside[up[below]] == below[:, None]).argmax(axis=1)
    direction = np.zeros(t + k)
    direction[below] = angle[up[below], via]
    direction = sums_to_root(direction, up, 0)
    return np.asarray(np.exp(1j * (direction[piece[live]] + within[live])))


def _parents(head: Ints, offsets: Ints, root: int) -> Ints:
    """(n,) parents in a breadth-first tree of a graph, −1 for the root. Arcs from each node stand together,
    from ``offsets`` (n + 1,) on; several between two nodes and from a node to itself do no harm."""
    n = len(offsets) - 1
    graph = csr_array((np.ones(len(head), dtype=np.int8), head, offsets), shape=(n, n))
    _, parent = breadth_first_order(graph, root)
    return np.where(parent >= 0, parent, -1).astype(np.int64)
