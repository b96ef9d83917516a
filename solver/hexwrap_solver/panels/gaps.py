"""Gaps and kinks between neighbouring panels (paper, conclusion)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.panels.halfedges import HalfEdges
from hexwrap_solver.panels.types import Panels
from hexwrap_solver.pattern.types import Pattern


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


def gaps(pattern: Pattern, edges: HalfEdges, panels: Panels) -> Gaps:
    """Facing edges are those that came from the same edge of the pattern."""
    panel_of = np.full(pattern.n_cells, -1, dtype=np.int64)
    panel_of[panels.face] = np.arange(panels.n_panels)
    once = edges.pairs()  # both sides see the same
    left, right = panel_of[edges.cell[once]], panel_of[edges.across[once]]
    both = (left >= 0) & (right >= 0)
    here, left, right = once[both], left[both], right[both]
    there = edges.twin[here]
    a, b = _edges_of(pattern, panels, edges.cell[here], here, left)
    c, d = _edges_of(pattern, panels, edges.cell[there], there, right)
    n1, n2 = panels.normal[left], panels.normal[right]
    mean = n1 + n2
    mean /= np.linalg.norm(mean, axis=1)[:, None]
    figures = (
        _width(a, b, c, d, mean),
        np.abs(np.einsum("hd,hd->h", (c + d - a - b) / 2, mean)),
        np.arctan2(np.linalg.norm(np.cross(n1, n2), axis=1), np.einsum("hd,hd->h", n1, n2)),
    )
    result = np.full((3, len(edges.cell)), np.nan)
    result[:, here] = result[:, there] = figures
    return Gaps(*result)


def _width(a: Floats, b: Floats, c: Floats, d: Floats, mean: Floats) -> Floats:
    """Least distance of segments ab and cd (which run opposite ways) in the plane across ``mean``."""
    a, b, c, d = (x - np.einsum("hd,hd->h", x, mean)[:, None] * mean for x in (a, b, c, d))
    ends = [(c, a, b), (d, a, b), (a, c, d), (b, c, d)]
    return np.asarray(np.min([_signed_distance(*end, mean) for end in ends], axis=0))


def _signed_distance(point: Floats, a: Floats, b: Floats, mean: Floats) -> Floats:
    """Distance to segment ab, negative on its left (inside the polygon that runs along ab)."""
    along, spoke = b - a, point - a
    squared = np.einsum("hd,hd->h", along, along)
    t = np.einsum("hd,hd->h", spoke, along) / np.where(squared > 0, squared, 1.0)
    distance = np.linalg.norm(spoke - np.clip(t, 0.0, 1.0)[:, None] * along, axis=1)
    inside = np.einsum("hd,hd->h", np.cross(along, spoke), mean) > 0
    return np.asarray(np.where(inside & (t >= 0) & (t <= 1), -distance, distance))


def _edges_of(
    pattern: Pattern, panels: Panels, cell: Ints, half_edge: Ints, panel: Ints
) -> tuple[Floats, Floats]:
    """Ends of the panels' edges that came from the given half-edges."""
    corner = half_edge - pattern.faces.offsets[cell]
    count = panels.polygons.lengths[panel]
    start = panels.polygons.offsets[panel]
    points = np.asarray(panels.polygons.values, dtype=np.float64)
    return points[start + corner], points[start + (corner + 1) % count]
