"""Evaluation of tensor-product rational B-spline surfaces: SciPy's splines in homogeneous coordinates, and
the quotient rule (Piegl, Tiller: The NURBS Book, section 4.5)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface.types import NurbsSurface


class Jet(NamedTuple):
    """Points and partial derivatives, each (k, 3)."""

    point: Floats
    du: Floats
    dv: Floats
    duu: Floats
    duv: Floats
    dvv: Floats

    @property
    def normal(self) -> Floats:
        """(k, 3) unit normals du × dv; zero where the surface is singular."""
        cross = np.cross(self.du, self.dv)
        length = np.linalg.norm(cross, axis=1, keepdims=True)
        return cross / np.where(length > 0, length, 1.0)


def domain(nurbs: NurbsSurface, direction: int) -> tuple[float, float]:
    """The interval of parameters in direction 0 (u) or 1 (v)."""
    knots, p = nurbs.knots[direction], nurbs.degree[direction]
    return float(knots[p]), float(knots[len(knots) - 1 - p])


def wrap(nurbs: NurbsSurface, parameters: Floats) -> Floats:
    """(k, 2) parameters taken into the domain: modulo the period where closed, clamped elsewhere."""
    out = np.array(parameters, dtype=float)
    for direction in (0, 1):
        low, high = domain(nurbs, direction)
        x = out[:, direction]
        if nurbs.closed[direction]:
            x = low + np.mod(x - low, high - low)
        out[:, direction] = np.clip(x, low, high)
    return out


def evaluate(nurbs: NurbsSurface, parameters: Floats) -> Jet:
    """The surface at (k, 2) parameters, which are wrapped into the domain first."""
    uv, spline = wrap(nurbs, parameters), nurbs.spline
    orders = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]
    return _project({order: spline(uv, nu=order) for order in orders})


def tangents(nurbs: NurbsSurface, parameters: Floats) -> tuple[Floats, Floats, Floats]:
    """(k, 3) points, ∂u and ∂v; without second derivatives in half the time."""
    uv, spline = wrap(nurbs, parameters), nurbs.spline
    s, su, sv = (spline(uv, nu=order) for order in ((0, 0), (1, 0), (0, 1)))
    point = s[:, :3] / s[:, 3:]
    return (
        point,
        (su[:, :3] - su[:, 3:] * point) / s[:, 3:],
        (sv[:, :3] - sv[:, 3:] * point) / s[:, 3:],
    )


def evaluate_points(nurbs: NurbsSurface, parameters: Floats) -> Floats:
    """(k, 3) the points alone, several times as fast."""
    homogeneous = nurbs.spline(wrap(nurbs, parameters))
    return np.asarray(homogeneous[:, :3] / homogeneous[:, 3:])


def _project(w: dict[tuple[int, int], Floats]) -> Jet:
    """Quotient rule from homogeneous to Cartesian coordinates."""
    weight = {o: a[:, 3:] for o, a in w.items()}
    a = {o: a[:, :3] for o, a in w.items()}
    w0 = weight[0, 0]
    s = a[0, 0] / w0
    su = (a[1, 0] - weight[1, 0] * s) / w0
    sv = (a[0, 1] - weight[0, 1] * s) / w0
    suu = (a[2, 0] - 2 * weight[1, 0] * su - weight[2, 0] * s) / w0
    suv = (a[1, 1] - weight[1, 0] * sv - weight[0, 1] * su - weight[1, 1] * s) / w0
    svv = (a[0, 2] - 2 * weight[0, 1] * sv - weight[0, 2] * s) / w0
    return Jet(s, su, sv, suu, suv, svv)
