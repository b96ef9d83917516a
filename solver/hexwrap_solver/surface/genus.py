"""Is a triangle mesh a surface of genus 0: connected, orientable, manifold, without handles?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra, minimum_spanning_tree

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.geometry import linked
from hexwrap_solver.surface.checks import LISTED
from hexwrap_solver.surface.errors import (
    HandlesError,
    NonManifoldEdgeError,
    NotOrientableError,
    SeveralComponentsError,
)
from hexwrap_solver.surface.topology import (
    boundary_loops,
    face_graph,
    half_edges,
    next_half_edge,
    spanning_tree,
)
from hexwrap_solver.words import place

#: A loop around a handle is searched through at most this many vertices.
TRIALS = 24


@dataclass(frozen=True)
class SentNames:
    """Sent indices of the working mesh's elements: vertex (n,), face (m,); and its points (n, 3)."""

    vertex: Ints
    face: Ints
    points: Floats

    def at(self, vertices: Ints) -> str:
        """The middle of vertices of the working mesh."""
        return f"at {place(self.points[vertices].mean(axis=0))}"

    def edges(self, faces: Ints, h: Ints) -> list[list[int]]:
        """Half-edges as pairs of sent vertices."""
        start, end = half_edges(faces)
        pairs: list[list[int]] = self.vertex[np.stack([start[h], end[h]], axis=1)].tolist()
        return pairs


def check_edges(faces: Ints, order: Ints, first: Ints, names: SentNames) -> None:
    """At most two faces per edge. Raises NonManifoldEdgeError."""
    crowded = np.flatnonzero(np.diff(first) > 2)
    if len(crowded) == 0:
        return
    h = order[first[crowded]]
    edges = names.edges(faces, h[:LISTED])
    touching = np.concatenate([order[first[k] : first[k + 1]] for k in crowded[:LISTED]])
    ends = np.array([side[h[0]] for side in half_edges(faces)])
    raise NonManifoldEdgeError(
        f"{_count(len(h), 'edge')} of the surface {'has' if len(h) == 1 else 'have'} more than two faces, "
        f"the first, {names.at(ends)} between vertices {edges[0][0]} and {edges[0][1]}, has "
        f"{np.diff(first)[crowded[0]]}: remove inner walls, double faces and fins (Rhino's ShowEdges finds "
        "non-manifold edges), so that every edge has one or two faces.",
        edges=edges,
        faces=np.unique(names.face[touching // 3])[:LISTED],
    )


def check_connected(twin: Ints, names: SentNames) -> None:
    """One piece, across edges. Raises SeveralComponentsError."""
    m = len(twin) // 3
    order, _ = spanning_tree(twin)
    if len(order) == m:
        return
    count, label = connected_components(face_graph(twin), directed=False)
    size = np.bincount(label)
    largest = int(np.argmax(size))
    others = np.unique(names.face[label != largest])
    raise SeveralComponentsError(
        f"The surface is in {count} pieces, of {_enumerate(np.sort(size)[::-1].tolist())} triangles: send "
        "one piece, or join them so that they share vertices to within 1e-6 of the model's size.",
        faces=others[:LISTED],
        data={"components": count, "sizes": np.sort(size)[::-1][:LISTED].tolist()},
    )


def not_orientable(faces: Ints, h: Ints, names: SentNames) -> NotOrientableError:
    """The error for a surface in which the sides do not match across the half-edges h."""
    edges = names.edges(faces, h[:LISTED])
    return NotOrientableError(
        f"The surface has only one side, like a Möbius band: its sides do not match across the edge between "
        f"vertices {edges[0][0]} and {edges[0][1]}, whichever way faces are turned; the surface must have "
        "two sides, so rejoin the seam without the half twist.",
        edges=edges,
    )


def loops_of(vertices: Floats, faces: Ints, twin: Ints, names: SentNames) -> tuple[Ints, ...]:
    """The boundary loops of a connected, oriented mesh without crowded edges, if it has no handles: where
    there are two, the one that holds the lowest vertex comes first; otherwise the longest.

    Every vertex has one fan of faces (see ``apart``). Raises HandlesError.
    """
    n = len(vertices)
    boundary = np.flatnonzero(twin < 0)
    loops = boundary_loops(faces, twin) if len(boundary) else []
    euler = n - (len(twin) + len(boundary)) // 2 + len(faces)
    if euler != 2 - len(loops):
        raise _handles(vertices, faces, twin, len(loops), euler, names)
    if len(loops) == 2:
        return tuple(loops)
    length = np.array([_length(vertices, loop) for loop in loops])
    return tuple(loops[i] for i in np.argsort(-length, kind="stable"))


def _umbrellas(twin: Ints) -> tuple[int, Ints]:
    """Fans of faces around vertices: their number, and the fan of every corner."""
    h = np.flatnonzero(twin >= 0)
    return linked(h, next_half_edge(twin[h]), len(twin))


def apart(faces: Ints, n: int, twin: Ints) -> tuple[Ints, Ints]:
    """Faces of a mesh in which every vertex has one fan of them, and (k,) of which vertices its vertices from
    n on are copies: one for every further fan around a vertex in which the surface touches itself."""
    count, fan = _umbrellas(twin)
    corner = np.unique(fan, return_index=True)[1]
    centre = faces.ravel()[corner]  # (count,)
    if count == len(np.unique(centre)):
        return faces, np.zeros(0, dtype=np.int64)
    first = np.zeros(count, dtype=bool)
    first[np.unique(centre, return_index=True)[1]] = True
    name = centre.copy()
    name[~first] = n + np.arange(int((~first).sum()))
    return name[fan].reshape(-1, 3), centre[~first]


def _handles(
    vertices: Floats, faces: Ints, twin: Ints, loops: int, euler: int, names: SentNames
) -> HandlesError:
    genus = (2 - loops - euler) // 2
    loop = handle_loop(vertices, faces, twin)
    sent = names.vertex[loop]
    length = _length(vertices, loop)
    edges = np.stack([sent, np.roll(sent, -1)], axis=1)
    shown = ", ".join(str(v) for v in sent[:6]) + (", …" if len(sent) > 6 else "")
    return HandlesError(
        f"The surface has {_count(genus, 'handle')} ({_count(loops, 'boundary loop')}, Euler characteristic "
        f"{euler}): only surfaces without handles have a map. Cut it open along the loop of {len(loop)} "
        f"edges, {length:.4g} long, {names.at(loop)}, through the vertices {shown} (Rhino's Split), or fill "
        "the hole that it goes around.",
        vertices=sent[:LISTED],
        edges=edges[:LISTED],
        data={"loops": loops, "euler_characteristic": euler, "genus": genus, "loop_length": length},
    )


def handle_loop(vertices: Floats, faces: Ints, twin: Ints) -> Ints:
    """(k,) vertices of a loop of edges that runs around or along a handle, and does not separate the surface.

    A short one: the shortest through vertex 0 or through a vertex of the loop found first.
    """
    first = _handle_loop_at(0, vertices, faces, twin)
    some = first[np.linspace(0, len(first), min(len(first), TRIALS), endpoint=False).astype(np.int64)]
    found = [first, *(_handle_loop_at(int(root), vertices, faces, twin) for root in some)]
    return min(found, key=lambda loop: _length(vertices, loop))


def _length(vertices: Floats, loop: Ints) -> float:
    return float(np.linalg.norm(vertices[loop] - vertices[np.roll(loop, -1)], axis=1).sum())


def _handle_loop_at(root: int, vertices: Floats, faces: Ints, twin: Ints) -> Ints:
    """Tree and cotree (Erickson, Whittlesey 2005): shortest paths from the root, and a spanning tree of the
    faces (and of a disk in each boundary loop) that crosses none of their edges. Every edge in neither
    closes a loop, of which the shortest is given."""
    n, m = len(vertices), len(faces)
    tail, head = half_edges(faces)
    lead = np.flatnonzero((twin < 0) | (np.arange(3 * m) < twin))
    a, b = tail[lead], head[lead]
    length = np.linalg.norm(vertices[a] - vertices[b], axis=1)
    graph = csr_array((length, (a, b)), shape=(n, n))
    away, previous = dijkstra(graph, directed=False, indices=np.array([root]), return_predecessors=True)
    distance, before = away[0], previous[0].astype(np.int64)
    crossed = np.flatnonzero((before[a] != b) & (before[b] != a))
    size = m + n
    beyond = np.where(twin[lead] < 0, m + _disks(tail, head, twin)[a], twin[lead] // 3)
    key = (lead[crossed] // 3) * size + beyond[crossed]
    pair, first = np.unique(key, return_index=True)  # of several edges between two faces any one will do
    dual = csr_array((1.0 + first, (pair // size, pair % size)), shape=(size, size))
    left = np.delete(crossed, minimum_spanning_tree(dual).data.astype(np.int64) - 1)
    best = left[np.argmin(distance[a[left]] + length[left] + distance[b[left]])]
    one, other = (_to_root(int(end[best]), before) for end in (a, b))
    while len(one) > 1 and len(other) > 1 and one[-2] == other[-2]:
        one.pop()
        other.pop()
    return np.array(one + other[-2::-1], dtype=np.int64)


def _disks(tail: Ints, head: Ints, twin: Ints) -> Ints:
    """(n,) a number of the boundary loop through each vertex."""
    n = int(tail.max()) + 1
    h = np.flatnonzero(twin < 0)
    return linked(tail[h], head[h], n)[1]


def _to_root(vertex: int, before: Ints) -> list[int]:
    way = [vertex]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return way


def _count(k: int, one: str) -> str:
    return f"{k} {one}{'s' * (k != 1)}"


def _enumerate(items: Sequence[object], most: int = 4) -> str:
    """A few of them, and how many more there are."""
    shown = ", ".join(str(item) for item in items[:most])
    return shown + (f" and {len(items) - most} more" if len(items) > most else "")
