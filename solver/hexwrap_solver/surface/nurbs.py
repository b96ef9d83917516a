"""Evaluation of tensor-product rational B-spline surfaces.

Basis functions by the Cox–de Boor recursion (Piegl, Tiller: The NURBS Book, sections 2.2–2.3 and 4.5),
vectorised over all parameters at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
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


def basis(knots: Floats, p: int, x: Floats) -> tuple[Ints, Floats]:
    """First index (k,) of the p + 1 functions that live at x, and (3, k, p + 1) values, first and second
    derivatives."""
    last = len(knots) - p - 2
    span = np.clip(np.searchsorted(knots, x, side="right") - 1, p, last)
    while np.any(empty := knots[span + 1] <= knots[span]):  # at the upper end of the domain
        span = np.where(empty, span - 1, span)
    rows = [np.ones((len(x), 1))]
    for d in range(1, p + 1):
        rows.append(_raise_degree(knots, span, d, x, rows[-1]))
    out = np.zeros((3, len(x), p + 1))
    out[0] = rows[p]
    if p >= 1:
        out[1] = _differentiate(knots, span, p, rows[p - 1])
    if p >= 2:
        out[2] = _differentiate(knots, span, p, _differentiate(knots, span, p - 1, rows[p - 2]))
    return span - p, out


def _widths(knots: Floats, span: Ints, d: int) -> tuple[Floats, Floats]:
    """Knots before and after x that bound the d supports of degree d − 1."""
    k = np.arange(d)
    return knots[span[:, None] - d + 1 + k], knots[span[:, None] + 1 + k]


def _raise_degree(knots: Floats, span: Ints, d: int, x: Floats, lower: Floats) -> Floats:
    left, right = _widths(knots, span, d)
    share = lower / (right - left)
    out = np.zeros((len(x), d + 1))
    out[:, :-1] += (right - x[:, None]) * share
    out[:, 1:] += (x[:, None] - left) * share
    return out


def _differentiate(knots: Floats, span: Ints, d: int, lower: Floats) -> Floats:
    left, right = _widths(knots, span, d)
    share = d * lower / (right - left)
    out = np.zeros((len(span), d + 1))
    out[:, :-1] -= share
    out[:, 1:] += share
    return out


def evaluate(nurbs: NurbsSurface, parameters: Floats) -> Jet:
    """The surface at (k, 2) parameters, which are wrapped into the domain first."""
    net, bu, bv = _local(nurbs, parameters)
    along = np.einsum("okp,kpqc->okqc", bu, net)
    orders = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]
    return _project({(a, b): np.einsum("kq,kqc->kc", bv[b], along[a]) for a, b in orders})


def evaluate_points(nurbs: NurbsSurface, parameters: Floats) -> Floats:
    """(k, 3) the points alone, several times as fast."""
    net, bu, bv = _local(nurbs, parameters)
    homogeneous = np.einsum("kq,kqc->kc", bv[0], np.einsum("kp,kpqc->kqc", bu[0], net))
    return np.asarray(homogeneous[:, :3] / homogeneous[:, 3:])


def _local(nurbs: NurbsSurface, parameters: Floats) -> tuple[Floats, Floats, Floats]:
    """The control points (k, p + 1, q + 1, 4), premultiplied, and basis functions that live at parameters."""
    uv = wrap(nurbs, parameters)
    homogeneous = nurbs.control_points.copy()
    homogeneous[..., :3] *= homogeneous[..., 3:]
    (i, bu), (j, bv) = (basis(nurbs.knots[d], nurbs.degree[d], uv[:, d]) for d in (0, 1))
    rows = i[:, None] + np.arange(bu.shape[2])
    columns = j[:, None] + np.arange(bv.shape[2])
    return homogeneous[rows[:, :, None], columns[:, None, :]], bu, bv


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
