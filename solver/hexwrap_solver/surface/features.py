"""Lines on a surface that a pattern should follow: creases, as chains of mesh edges from end to end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.geometry import angles_between, face_normals, linked, normalize
from hexwrap_solver.surface.closest import TriangleTree
from hexwrap_solver.surface.topology import half_edges
from hexwrap_solver.surface.types import Feature, Triangles

#: A chain that turns by more than this at a vertex is two, radians.
CORNER = np.deg2rad(40.0)
#: Edges lie on a line if they are not farther from it than this part of the mesh's size.
NEAR = 1e-3


@dataclass(frozen=True)
class FeatureEdges:
    """The edges of all features, one after the other. half_edge: (k,) of the mesh, along its feature; tail,
    head: (k,) its vertices. feature: (k,); last: (k,) whether an open feature ends with it."""

    half_edge: Ints
    tail: Ints
    head: Ints
    feature: Ints
    last: Bools

    @classmethod
    def of(cls, mesh: Triangles, features: Sequence[Feature]) -> FeatureEdges:
        """Edges that the mesh does not have are left out."""
        if not features:
            none = np.zeros(0, dtype=np.int64)
            return cls(none, none, none, none, np.zeros(0, dtype=bool))
        tail = np.concatenate([f.vertices[:-1] for f in features])
        head = np.concatenate([f.vertices[1:] for f in features])
        count = np.array([len(f.vertices) - 1 for f in features], dtype=np.int64)
        feature = np.repeat(np.arange(len(features)), count)
        last = np.zeros(len(tail), dtype=bool)
        last[np.cumsum(count) - 1] = [not f.closed for f in features]
        n = len(mesh.vertices)
        start, end = half_edges(mesh.faces)
        order = np.argsort(start * n + end)
        keys = (start * n + end)[order]
        at = np.minimum(np.searchsorted(keys, tail * n + head), len(keys) - 1)
        there = (keys[at] == tail * n + head) & (mesh.twin[order[at]] >= 0)
        return cls(order[at][there], tail[there], head[there], feature[there], last[there])

    def __len__(self) -> int:
        return len(self.half_edge)


def folds(mesh: Triangles, angle: float) -> tuple[Ints, Floats]:
    """(k, 2) inner edges at which the mesh folds by more than an angle, radians, and (k,) by how much."""
    normal = normalize(face_normals(mesh.vertices, mesh.faces))
    h = np.flatnonzero(mesh.twin > np.arange(len(mesh.twin)))
    fold = angles_between(normal[h // 3], normal[mesh.twin[h] // 3])
    start, end = half_edges(mesh.faces)
    h, fold = h[fold > angle], fold[fold > angle]
    return np.stack([start[h], end[h]], axis=1), fold


def lie_along(vertices: Floats, edges: Ints, lines: Sequence[Sequence[Sequence[float]]]) -> Bools:
    """(k,) the edges (k, 2) with both ends on some of the polylines, to NEAR of the mesh's size."""
    if not lines or len(edges) == 0:
        return np.zeros(len(edges), dtype=bool)
    points = np.concatenate([np.asarray(line, dtype=float).reshape(-1, 3) for line in lines])
    last = np.cumsum([len(line) for line in lines]) - 1
    start = np.delete(np.arange(len(points)), last)
    segments = TriangleTree.build(points, np.stack([start, start + 1, start + 1], axis=1))
    ends, at = np.unique(edges, return_inverse=True)
    near = segments.nearest(vertices[ends]).distance <= NEAR * np.linalg.norm(np.ptp(vertices, axis=0))
    return np.asarray(near[at.reshape(edges.shape)].all(axis=1))


def chained(vertices: Floats, edges: Ints, fold: Floats, stops: Bools) -> tuple[Feature, ...]:
    """Edges (k, 2) joined end to end, sorted by their lowest vertices.

    Chains end at junctions, at corners, and at stops (n,), such as vertices of the boundary. Closed chains
    name their first vertex again at the end.
    """
    if len(edges) == 0:
        return ()
    k = len(edges)
    incident = edges.ravel()
    order = np.argsort(incident, kind="stable")
    degree = np.bincount(incident, minlength=len(vertices))
    first = np.concatenate([[0], np.cumsum(degree)])
    through = (degree == 2) & ~stops
    v = np.flatnonzero(through)
    one, two = order[first[v]], order[first[v] + 1]
    # Slots are ends of edges, 2 per edge; the direction from v along each edge tells a corner.
    a, b = (vertices[incident[slot ^ 1]] - vertices[v] for slot in (one, two))
    smooth = angles_between(a, -b) <= CORNER
    one, two = one[smooth], two[smooth]
    # Nodes are slots, made one where a chain goes through; edges join their two slots.
    label = np.arange(2 * k)
    label[two] = one
    tail, head = label[0::2], label[1::2]
    _, part = linked(tail, head, 2 * k)
    ends = np.bincount(label, minlength=2 * k)
    beside = _neighbours(tail, head, 2 * k)
    by_chain = np.argsort(part[tail], kind="stable")
    bounds = np.flatnonzero(np.diff(part[tail][by_chain])) + 1
    out = []
    for mine in np.split(by_chain, bounds):
        nodes = np.unique(np.concatenate([tail[mine], head[mine]]))
        tips = nodes[ends[nodes] == 1]
        closed = len(tips) == 0
        among = nodes if closed else tips
        start = int(among[np.argmin(incident[among])])
        line = incident[_path(beside, start)]
        out.append(Feature(np.append(line, line[0]) if closed else line, float(fold[mine].mean()), closed))
    return tuple(sorted(out, key=lambda f: (int(f.vertices.min()), len(f.vertices), f.vertices.tolist())))


def _neighbours(tail: Ints, head: Ints, n: int) -> Ints:
    """(n, 2) the nodes joined to each by an edge, the lower one first; −1: none. No node has three."""
    node, other = np.concatenate([tail, head]), np.concatenate([head, tail])
    order = np.lexsort((other, node))
    node, other = node[order], other[order]
    beside = np.full((n, 2), -1, dtype=np.int64)
    again = np.concatenate([[0], (node[1:] == node[:-1]).astype(np.int64)])
    beside[node, again] = other
    return beside


def _path(beside: Ints, start: int) -> Ints:
    """Nodes of a path from one end to the other, or of a cycle once around. Its steps are those of the chain
    alone, so that any number of chains takes no longer than their edges."""
    path, before, at = [start], start, int(beside[start, 0])
    while at not in (-1, start):
        path.append(at)
        one, two = beside[at].tolist()
        before, at = at, two if one == before else one
    return np.array(path, dtype=np.int64)
