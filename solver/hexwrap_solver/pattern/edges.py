"""The pattern's edges, each once: the bars of a diagrid (paper, Figure 7, right)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.domain.lift import lift
from hexwrap_solver.pattern.types import Pattern


@dataclass(frozen=True)
class PatternEdges:
    """ends: (e, 2) vertices of the pattern. sheet: (e,) the sheet of the second end, seen from the first.
    cells: (e, 2) the cells to the left and to the right, −1 where there is none."""

    ends: Ints
    sheet: Ints
    cells: Ints


def pattern_edges(pattern: Pattern) -> PatternEdges:
    """Every edge of the pattern once."""
    faces, neighbours = pattern.faces, pattern.neighbours
    following = faces.next()
    tail, head = faces.values.astype(np.int64), faces.values[following].astype(np.int64)
    other = neighbours.values.astype(np.int64)
    once = (other < 0) | (faces.row < other)
    turn = pattern.sheet[following] - pattern.sheet
    return PatternEdges(
        np.stack([tail, head], axis=1)[once], turn[once], np.stack([faces.row, other], axis=1)[once]
    )


def edge_polylines(cmap: ConformalMap, pattern: Pattern, pieces: int = 8) -> Floats:
    """(e, pieces + 1, 3) every edge as a curve on the surface: straight in the domain, lifted in pieces."""
    edges = pattern_edges(pattern)
    start: Complexes = pattern.uv[edges.ends[:, 0]]
    end = cmap.deck.apply(pattern.uv[edges.ends[:, 1]], edges.sheet)
    t = np.linspace(0, 1, pieces + 1)
    lifted = lift(cmap, (start[:, None] * (1 - t) + end[:, None] * t).ravel()).points
    curves = lifted.reshape(len(start), pieces + 1, 3)
    curves[:, 0], curves[:, -1] = pattern.vertices[edges.ends].swapaxes(0, 1)
    return np.asarray(curves)
