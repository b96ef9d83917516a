"""Curves of rhino3dm as polylines: corners exact, curved spans within a tolerance."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import rhino3dm

from hexwrap_server.errors import DrawingError
from hexwrap_server.input.readers.drawing import FLATNESS, Curve, curve
from hexwrap_server.input.readers.rhino_model import xyz
from hexwrap_solver.arrays import Floats

#: Places within an interval of parameters where the curve is compared with its chord.
_PLACES = np.array([0.25, 0.5, 0.75])
#: A span is halved at most so often.
_HALVINGS = 16
#: More points are not made of one curve.
MOST_POINTS = 1_000_000


def rhino_curve(geometry: Any, size: float = 0.0, matrix: Floats | None = None) -> Curve:
    """size: that of the drawing; the curve's own counts where it is larger.

    matrix: (4, 4), where its block puts it. Raises DrawingError.
    """
    box = geometry.GetBoundingBox()
    own = max(box.Max.X - box.Min.X, box.Max.Y - box.Min.Y, box.Max.Z - box.Min.Z)
    stretch = 1.0 if matrix is None else float(np.linalg.norm(matrix[:3, :3], 2)) or 1.0
    points = np.array(_points(geometry, max(FLATNESS * max(size / stretch, own), 1e-12)))
    if matrix is not None:
        points = points @ matrix[:3, :3].T + matrix[:3, 3]
    closed = bool(geometry.IsClosed) and len(points) > 2
    return curve(points[:-1] if closed else points, closed)


def _points(geometry: Any, tolerance: float) -> list[list[float]]:
    if isinstance(geometry, rhino3dm.PolylineCurve):
        return [xyz(geometry.Point(i)) for i in range(geometry.PointCount)]
    if isinstance(geometry, rhino3dm.LineCurve):
        return [xyz(geometry.PointAtStart), xyz(geometry.PointAtEnd)]
    if isinstance(geometry, rhino3dm.PolyCurve):
        parts = [_points(geometry.SegmentCurve(i), tolerance) for i in range(geometry.SegmentCount)]
        return [*parts[0], *(point for part in parts[1:] for point in part[1:])]
    nurbs: Any = geometry if isinstance(geometry, rhino3dm.NurbsCurve) else geometry.ToNurbsCurve()
    if nurbs is None:
        raise DrawingError(
            f"A {type(geometry).__name__} of the drawing has no NURBS form: convert it with Rhino's Convert "
            "command."
        )
    low, high = nurbs.Domain.T0, nurbs.Domain.T1
    knots = np.unique([low, *(k for k in nurbs.Knots if low < k < high), high])
    if nurbs.Degree > 1:
        knots = _refined(nurbs, knots, tolerance)
    return [xyz(nurbs.PointAt(t)) for t in knots.tolist()]


def _refined(nurbs: Any, knots: Floats, tolerance: float) -> Floats:
    """Those parameters and further ones, between which the curve stays within the tolerance of its chord."""
    kept = [knots]
    open_ = np.array(list(pairwise(knots)))
    for _ in range(_HALVINGS):
        inside = open_[:, :1] + (open_[:, 1:] - open_[:, :1]) * _PLACES
        ends, middle = _at(nurbs, open_), _at(nurbs, inside)
        along = ends[:, 1] - ends[:, 0]
        length = np.linalg.norm(along, axis=1)
        direction = along / np.where(length > 0, length, 1.0)[:, None]
        off = middle - ends[:, :1]
        off = off - np.einsum("kpi,ki->kp", off, direction)[..., None] * direction[:, None]
        open_ = open_[np.linalg.norm(off, axis=2).max(axis=1) > tolerance]
        if not len(open_):
            break
        halves = open_.mean(axis=1)
        kept.append(halves)
        if sum(map(len, kept)) > MOST_POINTS:
            raise DrawingError(f"A curve of the drawing needs more than {MOST_POINTS} points: split it.")
        open_ = np.concatenate([np.stack([open_[:, 0], halves], 1), np.stack([halves, open_[:, 1]], 1)])
    return np.unique(np.concatenate(kept))


def _at(nurbs: Any, parameters: Floats) -> Floats:
    points = [xyz(nurbs.PointAt(t)) for t in parameters.ravel().tolist()]
    return np.array(points).reshape(*parameters.shape, 3)
