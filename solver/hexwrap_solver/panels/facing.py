"""Edges of neighbouring panels that face each other across a joint, and the gap between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.geometry import dot, normalize
from hexwrap_solver.panels.halfedges import HalfEdges


@dataclass(frozen=True)
class Facing:
    """Pairs of edges, all arrays (k,): those of two panels that came from the same edge of the pattern.

    here, there: half-edges of the pattern, here < there. left, right: their panels. start_left, start_right:
    the corner of the panel at which its edge starts.
    """

    here: Ints
    there: Ints
    left: Ints
    right: Ints
    start_left: Ints
    start_right: Ints


def facing_edges(edges: HalfEdges, first_corner: Ints, face: Ints) -> Facing:
    """first_corner: (c,) where each cell's corners start in the pattern. face: (q,) cell of each panel."""
    panel_of = np.full(len(first_corner), -1, dtype=np.int64)
    panel_of[face] = np.arange(len(face))
    here = edges.pairs()
    there = edges.twin[here]
    left, right = panel_of[edges.cell[here]], panel_of[edges.cell[there]]
    both = (left >= 0) & (right >= 0)
    here, there = here[both], there[both]
    starts = (half - first_corner[edges.cell[half]] for half in (here, there))
    return Facing(here, there, left[both], right[both], *starts)


def mean_normals(facing: Facing, normal: Floats) -> Floats:
    """(k, 3) unit mean of the two panels' normals (q, 3)."""
    return normalize(normal[facing.left] + normal[facing.right])


def edge_ends(polygons: Ragged, panel: Ints, corner: Ints) -> tuple[Floats, Floats]:
    """(k, 3) both ends of the panels' edges that start at the given corners."""
    start, count = polygons.offsets[panel], polygons.lengths[panel]
    points = np.asarray(polygons.values, dtype=np.float64)
    return points[start + corner], points[start + (corner + 1) % count]


def widths(polygons: Ragged, facing: Facing, mean: Floats) -> Floats:
    """(k,) least distance of two facing edges, seen along the mean normals (k, 3); negative where an edge has
    crossed the other."""
    a, b = edge_ends(polygons, facing.left, facing.start_left)
    c, d = edge_ends(polygons, facing.right, facing.start_right)
    a, b, c, d = (x - dot(x, mean)[:, None] * mean for x in (a, b, c, d))
    ends = [(c, a, b), (d, a, b), (a, c, d), (b, c, d)]
    return np.asarray(np.min([_signed_distance(*end, mean) for end in ends], axis=0))


def _signed_distance(point: Floats, a: Floats, b: Floats, mean: Floats) -> Floats:
    """Distance to segment ab, negative on its left (inside the polygon that runs along ab)."""
    along, spoke = b - a, point - a
    squared = dot(along, along)
    t = dot(spoke, along) / np.where(squared > 0, squared, 1.0)
    distance = np.linalg.norm(spoke - np.clip(t, 0.0, 1.0)[:, None] * along, axis=1)
    inside = dot(np.cross(along, spoke), mean) > 0
    return np.asarray(np.where(inside & (t >= 0) & (t <= 1), -distance, distance))
