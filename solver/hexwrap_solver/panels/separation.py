"""Planes that keep neighbouring panels apart.

Through every edge of the pattern goes the plane that contains the edge and the mean m of the normals of the
two panels beside it. Seen along m this plane is a line. A panel that stays on its own side of the planes of
its edges therefore cannot overlap a neighbour when the two are projected along the mean of their normals,
however their planes are inclined: that holds by construction and needs no check afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.geometry import cross, dot, normalize
from hexwrap_solver.pattern.halfedges import HalfEdges
from hexwrap_solver.pattern.types import Pattern


@dataclass(frozen=True)
class Separation:
    """Per half-edge: the cell's panel must satisfy direction · x ≤ offset.

    direction: (h, 3) unit, pointing out of the cell, perpendicular to the mean normal. offset: (h,).
    """

    direction: Floats
    offset: Floats


def separating_planes(
    pattern: Pattern, edges: HalfEdges, normal: Floats, joint: Floats | float
) -> Separation:
    """normal: (cells, 3) unit normals of the panels' planes.

    joint: between neighbours a slab of this width is left open, (h,) or everywhere the same. Where there is
    no neighbour the plane contains the cell's own normal, and the panel may reach the edge.
    """
    inner = edges.twin >= 0
    mean = normal.take(edges.cell, axis=0)
    mean += np.where(inner[:, None], normal.take(edges.across, axis=0, mode="wrap"), 0.0)
    a, b = (pattern.vertices.take(end, axis=0) for end in (edges.start, edges.end))
    direction = normalize(cross(b - a, mean))
    middle = dot(direction, (a + b) / 2)
    return Separation(direction, middle - np.where(inner, np.asarray(joint) / 2, 0.0))
