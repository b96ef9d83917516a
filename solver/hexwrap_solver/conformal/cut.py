"""A cut that opens the surface into a disk: a tree of paths that joins loops and cones, its terminals.

Paths grow one by one, each from a terminal that is joined already to the nearest one that is not. They run
along edges inside the surface, never along its boundary, and do not meet but at terminals, so that each of
them carries one motion; where no such way is left, a path branches off another one, whose motion changes
there. Hubs, at which paths start, are the cones, or else the loops from the third on, or else loop 0: a
loop at which one path ends has its whole holonomy as that path's motion. An annulus is cut along a
shortest path from loop 0 to loop 1.

Around a vertex on the cut the triangles fall into fans, which the cut separates. Seen from a path's start
towards its end, its left side is the image of its right side under the path's motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order

from hexwrap_solver.arrays import Bools, Ints, positions
from hexwrap_solver.geometry import linked
from hexwrap_solver.surface.topology import half_edges, next_half_edge
from hexwrap_solver.surface.types import Surface


@dataclass(frozen=True)
class Cut:
    """left: (k,) half-edges along the paths, path by path and in their direction; their faces are on the
    left.
    piece: (k,) the piece of the cut that each belongs to: a path, or a part of one between branchings.
    beyond: (p, t) the terminals behind each piece, seen from its start: loops first, then cones.
    twin: (3m,) half-edge on the other side of each, −1 at the boundary and across the cut.
    fan: (3m,) the fan of every corner: 0 where a vertex is at home (it is not on the cut, or its triangles
    lie to the right of the first path through it), otherwise 1 … number of the other fans.
    """

    left: Ints
    piece: Ints
    beyond: Bools
    twin: Ints
    fan: Ints


def cut_open(surface: Surface, cones: Ints) -> Cut:
    """The cut that joins all loops and the vertices ``cones``."""
    start, end = half_edges(surface.faces)
    paths = _grow(surface, cones)
    piece, beyond = _pieces(paths, len(surface.loops) + len(cones))
    left = _half_edges_along(paths, start, end, len(surface.vertices))
    twin = surface.twin.copy()
    twin[surface.twin[left]] = -1
    twin[left] = -1
    return Cut(left, piece, beyond, twin, _fans(start, left, surface.twin, twin))


@dataclass(frozen=True)
class _Path:
    """vertices: (p,). terminal: where it ends. parent: the path that it branches off at ``at``, its place
    there, −1 where it starts at a terminal; then that is ``hub``."""

    vertices: Ints
    terminal: int
    parent: int
    at: int
    hub: int


def _grow(surface: Surface, cones: Ints) -> list[_Path]:
    n, loops = len(surface.vertices), len(surface.loops)
    terminal = np.full(n, -1, dtype=np.int64)
    for i, loop in enumerate(surface.loops):
        terminal[loop] = i
    terminal[cones] = loops + np.arange(len(cones))
    count = loops + len(cones)
    if count < 2:
        return []
    hubs = np.arange(count) >= (loops if len(cones) else 2 if loops > 2 else 0)
    if count == 2 and not len(cones):
        hubs[1] = False
    joined = np.zeros(count, dtype=bool)
    joined[int(np.argmax(hubs))] = True
    owner = np.full(n, -1, dtype=np.int64)  # the path of which a vertex is an inner one
    paths: list[_Path] = []
    while not joined.all():
        sources = np.flatnonzero((terminal >= 0) & (joined & hubs)[terminal])
        barred = (owner >= 0) | ((terminal >= 0) & joined[terminal])
        path = _shortest(surface, sources, barred, terminal, joined)
        if path is None:
            path = _shortest(surface, np.flatnonzero(barred), barred, terminal, joined)
        assert path is not None, "the surface is connected"
        reached, first = int(terminal[path[-1]]), int(path[0])
        parent = int(owner[first])
        at = int(np.flatnonzero(paths[parent].vertices == first)[0]) if parent >= 0 else -1
        owner[path[1:-1]] = len(paths)
        paths.append(_Path(path, reached, parent, at, int(terminal[first])))
        joined[reached] = True
    return paths


def _shortest(surface: Surface, sources: Ints, barred: Bools, terminal: Ints, joined: Bools) -> Ints | None:
    """Fewest edges from any of the sources to a terminal that is not joined yet, past barred vertices,
    through an extra vertex n tied to the sources; None where they are not connected."""
    n = len(surface.vertices)
    low, high = surface.edge_ends  # in the order of their lower ends, as rows of a matrix want them
    free = ~barred
    free[sources] = True
    if not free.all():
        open_ = free[low] & free[high]
        low, high = low[open_], high[open_]
    rows = np.concatenate([np.searchsorted(low, np.arange(n + 1)), [len(low) + len(sources)]])
    graph = sparse.csr_matrix(
        (np.ones(rows[-1], dtype=np.int8), np.concatenate([high, sources]), rows), shape=(n + 1, n + 1)
    )
    order, previous = breadth_first_order(graph, n, directed=False)
    found = order[1:]
    goal = found[(terminal[found] >= 0) & ~joined[terminal[found]]]
    if not len(goal):
        return None
    path = [int(goal[0])]
    while previous[path[-1]] != n:
        path.append(int(previous[path[-1]]))
    return np.array(path[::-1], dtype=np.int64)


def _pieces(paths: list[_Path], terminals: int) -> tuple[Ints, Bools]:
    """(k,) piece of every edge of the paths, and (p, t) the terminals beyond each piece."""
    behind = np.zeros((len(paths), terminals), dtype=bool)
    beyond: list[Bools] = []
    pieces: list[list[Ints]] = [[] for _ in paths]
    for i in range(len(paths) - 1, -1, -1):  # what hangs on a path was joined after it
        path = paths[i]
        hanging = [(j, paths[j]) for j in range(i + 1, len(paths))]
        behind[i, path.terminal] = True
        for j, other in hanging:
            if other.parent < 0 and other.hub == path.terminal:
                behind[i] |= behind[j]
        last = len(path.vertices) - 1
        branches = sorted({other.at for _, other in hanging if other.parent == i})
        for place in reversed([0, *branches]):
            pieces[i].append(np.full(last - place, len(beyond)))
            beyond.append(behind[i].copy())
            for j, other in hanging:
                if other.parent == i and other.at == place:
                    behind[i] |= behind[j]
            last = place
        pieces[i].reverse()
    flat = [part for one in pieces for part in one]
    numbers = np.concatenate(flat) if flat else np.zeros(0, dtype=np.int64)
    kept, numbers = np.unique(numbers, return_inverse=True)
    return numbers, np.array(beyond, dtype=bool).reshape(-1, terminals)[kept]


def _half_edges_along(paths: list[_Path], start: Ints, end: Ints, n: int) -> Ints:
    """The half-edges that run along the paths, in their direction."""
    if not paths:
        return np.zeros(0, dtype=np.int64)
    on_path = np.zeros(n, dtype=bool)
    on_path[np.concatenate([path.vertices for path in paths])] = True
    near = np.flatnonzero(on_path[start] & on_path[end])
    key = start[near] * n + end[near]
    order = np.argsort(key)
    wanted = np.concatenate([path.vertices[:-1] * n + path.vertices[1:] for path in paths])
    return np.asarray(near[order[np.searchsorted(key[order], wanted)]])


def _fans(start: Ints, left: Ints, twin: Ints, open_twin: Ints) -> Ints:
    """(3m,) see ``Cut``: corners around vertices of the cut, joined across every edge but those of the
    cut."""
    n = int(start.max()) + 1
    on_cut = np.zeros(n, dtype=bool)
    on_cut[start[left]] = on_cut[start[next_half_edge(left)]] = True
    near = np.flatnonzero(on_cut[start])  # corners, named by the half-edges that leave them
    fan = np.zeros(len(start), dtype=np.int64)
    if not len(near):
        return fan
    place = positions(near, len(start))
    crossed = near[open_twin[near] >= 0]
    other = next_half_edge(open_twin[crossed])
    count, label = linked(place[crossed], place[other], len(near))
    right = twin[left]
    right = np.stack([next_half_edge(right), right], axis=1).ravel()  # at the start and at the end
    _, first = np.unique(start[right], return_index=True)
    away = np.ones(count, dtype=bool)
    away[label[place[right[first]]]] = False
    number = np.where(away, np.cumsum(away), 0)
    fan[near] = number[label]
    return fan
