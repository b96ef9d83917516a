"""Edges of a Brep as curves: points, tangents, curvature, and places where they bend sharply."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.geometry import angles_between
from hexwrap_solver.surface.brep.types import Edge, NurbsCurve
from hexwrap_solver.tolerances import RELATIVE

#: An edge is sampled in at least PLACES places, and PER_SPAN between two knots.
PLACES, PER_SPAN = 16, 2
#: Tangents that turn by more than this at a knot make a corner, radians.
CORNER = np.deg2rad(0.5)


def evaluate_curve(curve: NurbsCurve, t: Floats) -> tuple[Floats, Floats, Floats]:
    """Points, first and second derivatives, each (k, 3), at parameters (k,) inside the domain."""
    x = np.clip(t, *curve.domain)
    a, b, c = (curve.spline(x, nu) for nu in range(3))
    point = a[:, :3] / a[:, 3:]
    tangent = (b[:, :3] - b[:, 3:] * point) / a[:, 3:]
    bend = (c[:, :3] - 2 * b[:, 3:] * tangent - c[:, 3:] * point) / a[:, 3:]
    return point, tangent, bend


def places(edge: Edge) -> Floats:
    """(k,) ascending parameters close enough to show the shape of the edge, knots and ends included."""
    marks = np.concatenate([[edge.interval[0]], _knots_inside(edge), [edge.interval[1]]])
    per_span = max(-(-PLACES // (len(marks) - 1)), 1 if edge.curve.degree == 1 else PER_SPAN)
    steps = marks[:-1, None] + np.diff(marks)[:, None] * np.arange(per_span) / per_span
    return np.append(steps.ravel(), marks[-1])


def corners(edge: Edge) -> Floats:
    """Parameters inside the edge at which its direction jumps."""
    p, knots = edge.curve.degree, edge.curve.knots
    inner = [x for x in _knots_inside(edge) if np.count_nonzero(knots == x) >= p]
    if not inner:
        return np.zeros(0)
    x = np.array(inner)
    nudge = RELATIVE * (edge.interval[1] - edge.interval[0])
    before, after = (evaluate_curve(edge.curve, x + side * nudge)[1] for side in (-1, 1))
    return np.asarray(x[angles_between(before, after) > CORNER])


def curvature(tangent: Floats, bend: Floats) -> Floats:
    """(k,) curvature from first and second derivatives; 0 where the curve stands still."""
    speed = np.linalg.norm(tangent, axis=1)
    cross = np.linalg.norm(np.cross(tangent, bend), axis=1)
    return np.asarray(np.where(speed > 0, cross / np.maximum(speed, 1e-75) ** 3, 0.0))


def _knots_inside(edge: Edge) -> Floats:
    low, high = edge.interval
    margin = RELATIVE * (high - low)
    knots = edge.curve.knots
    return np.unique(knots[(knots > low + margin) & (knots < high - margin)])
