"""Cutting a surface open to a disk, from one singularity to all the others and to every loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from hexwrap_solver.arrays import Ints
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.surface.topology import half_edges
from hexwrap_solver.surface.types import Surface


@dataclass(frozen=True)
class Branches:
    """A tree of edges that joins vertex ``root`` to the leaves: singularities, then loops.

    twin: (3m,) half-edges across, −1 at the boundary and at the cut. ways: per leaf, the half-edges from it
    towards the root, as far as it has them for itself. edges: (k,) every half-edge on the cut, one of each
    edge.
    """

    root: int
    twin: Ints
    ways: tuple[Ints, ...]
    edges: Ints


def branches(surface: Surface, root: int, leaves: Ints, loops: tuple[Ints, ...]) -> Branches:
    """Shortest paths that pass through no leaf and along no loop. Raises ConvergenceError where one cannot
    be reached."""
    n = len(surface.vertices)
    ends = np.zeros(n, dtype=bool)
    ends[leaves] = True
    ends[surface.boundary] = True
    tail, head = half_edges(surface.faces)
    inner = surface.twin >= 0
    inner &= ~(ends[tail])  # paths end where they come to one
    length = surface.lengths.ravel()
    graph = csr_matrix((length[inner], (tail[inner], head[inner])), shape=(n, n))
    distances, predecessors = dijkstra(graph, indices=np.array([root]), return_predecessors=True)
    distance, before = distances[0], predecessors[0]
    starts = [int(v) for v in leaves] + [int(loop[np.argmin(distance[loop])]) for loop in loops]
    half_edge = _numbers(surface)
    taken: dict[int, int] = {}
    paths = []
    for start in starts:
        path, at = [], start
        while at != root:
            towards = int(before[at])
            if towards < 0:
                raise ConvergenceError(
                    "The mesh is too coarse for its singularities: no path along its edges joins them all "
                    "without running through another one or along the boundary. Refine it first."
                )
            h = half_edge(at, towards)
            path.append(h)
            taken[h] = taken.get(h, 0) + 1
            at = towards
        paths.append(path)
    ways = tuple(np.array([h for h in path if taken[h] == 1], dtype=np.int64) for path in paths)
    edges = np.array(sorted(taken), dtype=np.int64)
    twin = surface.twin.copy()
    twin[surface.twin[edges]] = -1
    twin[edges] = -1
    return Branches(root, twin, ways, edges)


def _numbers(surface: Surface) -> Callable[[int, int], int]:
    """The half-edge from one vertex to another."""
    tail, head = half_edges(surface.faces)
    n = len(surface.vertices)
    key = tail * n + head
    order = np.argsort(key, kind="stable")
    sorted_ = key[order]

    def number(start: int, end: int) -> int:
        return int(order[np.searchsorted(sorted_, start * n + end)])

    return number
