"""Unrolling a flat Delaunay metric of the mirrored annulus: a place in the plane for every vertex."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.layout import FULL_TURN
from hexwrap_solver.conformal.robust.metric import Metric
from hexwrap_solver.conformal.robust.mirror import MirrorMesh
from hexwrap_solver.conformal.types import Deck


@dataclass(frozen=True)
class Development:
    """uv: (n,) one copy of each vertex. lift: (n,) how many turns lie between that copy and the one that
    ``MirrorMesh.turn`` counts from: along a half-edge from v to w with turn c, from the copy uv[v],
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
    root = int(mesh.origin[live[np.argmin(metric.length[live >> 1])]])
    step = _directions(mesh, metric, cone_angle, live) * np.exp(metric.length[live >> 1])
    tail, head = mesh.origin[live], mesh.origin[live ^ 1]
    turn = mesh.turn[live]

    vertex, above, via = _tree(tail, head, mesh.n, root)
    up = np.full(mesh.n, root)
    up[vertex] = above
    lift = np.zeros(mesh.n, dtype=np.int64)
    lift[vertex] = turn[via]
    lift = _accumulate(lift, up, root)
    step = step * np.exp(1j * cone_angle * lift[tail])
    uv = np.zeros(mesh.n, dtype=complex)
    uv[vertex] = step[via]
    uv = _accumulate(uv, up, root)

    power = lift[tail] + turn - lift[head]
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
    if abs(deck.angle) < FULL_TURN:
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

    Half-edges of one triangle, of neighbouring cells of one edge of the boundary, and the two sides of an
    edge know each other's direction; beyond a boundary vertex lies the back of the double, so no step is made
    there.
    """
    size = len(mesh.origin)
    follows = live[(~mesh.outer[live]) | (mesh.cross[mesh.next[live]] >= 0)]
    following = mesh.next[follows]
    bend = np.pi - metric.end[follows] - np.where(mesh.outer[follows], metric.start[following], 0.0)
    tail = np.concatenate([follows, following, live])
    head = np.concatenate([following, follows, live ^ 1])
    angle = np.concatenate([bend, -bend, np.full(len(live), np.pi)])
    turn = mesh.turn
    angle -= cone_angle * np.concatenate([turn[follows], -turn[follows], turn[live]])

    half_edge, above, via = _tree(tail, head, size, int(live[0]))
    up = np.full(size, live[0])
    up[half_edge] = above
    direction = np.zeros(size)
    direction[half_edge] = angle[via]
    return np.exp(1j * _accumulate(direction, up, int(live[0])))[live]


def _tree(tail: Ints, head: Ints, n: int, root: int) -> tuple[Ints, Ints, Ints]:
    """Breadth-first tree of a graph given by arcs: (vertex, parent, arc from parent to vertex)."""
    order = np.argsort(tail * n + head, kind="stable")
    key = (tail * n + head)[order]
    order = order[
        np.concatenate([[True], key[1:] != key[:-1]])
    ]  # of several arcs between two any one will do
    offsets = np.searchsorted(tail[order], np.arange(n + 1))
    graph = csr_array((np.ones(len(order), dtype=np.int8), head[order], offsets), shape=(n, n))
    found, parent = breadth_first_order(graph, root)
    vertex = found[1:].astype(np.int64)
    above = parent[vertex].astype(np.int64)
    place = np.searchsorted((tail * n + head)[order], above * n + vertex)
    return vertex, above, order[place]


def _accumulate(values: np.ndarray, up: Ints, root: int) -> np.ndarray:
    """Sums along the way to the root, by pointer jumping: log(depth) rounds, and rounding grows no faster."""
    total = values.copy()
    up = up.copy()
    while (up != root).any():
        total += total[up]
        up = up[up]
    return total
