"""Gaps and kinks between neighbouring panels (paper, conclusion)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.geometry import dot_first
from hexwrap_solver.panels.facing import Facing, least_distances


@dataclass(frozen=True)
class Gaps:
    """Aligned with the pattern's neighbours, NaN where there is no neighbour with a panel.

    tangential: least distance between the two facing edges, seen along the mean m of the two normals;
    negative where an edge has crossed the other. normal: how far one edge's middle lies above the other
    along m, ≥ 0. kink: angle between the panels' normals.
    """

    tangential: Floats
    normal: Floats
    kink: Floats


def gaps(facing: Facing, ends: Floats, n_half_edges: int) -> Gaps:
    """ends: the ``sides`` that face each other. n_half_edges: of the pattern."""
    p, q, r = ends
    figures = (
        least_distances(ends, facing),
        np.abs(dot_first(q + r - p, facing.frame[2])) / 2,
        facing.kink,
    )
    result = np.full((3, n_half_edges), np.nan)
    result[:, facing.here] = result[:, facing.there] = figures
    return Gaps(*result)
