"""Closest points on a NURBS surface, by Newton's method for all points at once."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.geometry import dot
from hexwrap_solver.surface.nurbs import Jet, domain, evaluate, evaluate_points, wrap
from hexwrap_solver.surface.topology import edges
from hexwrap_solver.surface.types import NurbsSurface, Surface
from hexwrap_solver.tolerances import RELATIVE

STEPS = 30
#: From the middle of the parameters one step is enough for the component along the normal.
CHORD_STEPS = 1
#: Newton steps below this part of the domain end the iteration.
CONVERGED = 1e-13
#: … and steps below this part end it where the start was good.
SETTLED = 1e-9
#: Rounding of distances, in parts of the coordinates.
NOISE = 1e-15
#: A step that does not bring the point nearer is halved at most this many times.
HALVINGS = 12


def project(
    nurbs: NurbsSurface, points: Floats, start: Floats, steps: int = STEPS
) -> tuple[Floats, Floats, Floats]:
    """The points of the surface nearest to given ones, as far as Newton's method leads from the start.

    points: (k, 3). start: (k, 2) parameters. Returns points (k, 3), parameters (k, 2) in the base period, and
    unit normals (k, 3). The distance vector is parallel to the normal, except at the surface's open ends.
    """
    uv = wrap(nurbs, start)
    jet = evaluate(nurbs, uv)
    active = np.arange(len(uv))
    for _ in range(steps):
        step = newton_step(nurbs, _take(jet, active), points[active], uv[active])
        uv[active], moved = _search(nurbs, points[active], uv[active], jet.point[active], step)
        fresh = evaluate(nurbs, uv[active])
        for whole, part in zip(jet, fresh, strict=True):
            whole[active] = part
        active = active[moved]
        if len(active) == 0:
            break
    return jet.point, uv, jet.normal


def start_parameters(surface: Surface, triangle: Ints, barycentric: Floats) -> Floats:
    """(k, 2) parameters interpolated in triangles of a mesh that was made from its NURBS surface.

    triangle: (k,) faces. barycentric: (k, 3). Corners beyond the seam are taken a period further.
    """
    if surface.nurbs is None:
        raise ValueError("the surface was not made from a NURBS surface")
    corners = parameter_corners(surface, triangle)
    return wrap(surface.nurbs, np.einsum("kc,kcd->kd", barycentric, corners))


def parameter_corners(surface: Surface, triangle: Ints) -> Floats:
    """(k, 3, 2) parameters at the corners of faces, on one side of the seam."""
    if surface.nurbs is None or surface.parameters is None:
        raise ValueError("the surface was not made from a NURBS surface")
    corners = surface.parameters[surface.faces[triangle]]
    return np.asarray(corners[:, :1] + _shortest(surface.nurbs, corners - corners[:, :1]))


def chord_heights(nurbs: NurbsSurface, parameters: Floats, points: Floats, faces: Ints) -> Floats:
    """(e,) distances of the middles of all edges from the surface."""
    ends, _ = edges(faces, len(points))
    a, b = parameters[ends[:, 0]], parameters[ends[:, 1]]
    middle = points[ends].mean(axis=1)
    foot, _, normal = project(nurbs, middle, a + _shortest(nurbs, b - a) / 2, CHORD_STEPS)
    return np.abs(dot(middle - foot, normal))


def _shortest(nurbs: NurbsSurface, difference: Floats) -> Floats:
    """Differences (…, 2) of parameters, modulo the period where the surface is closed."""
    out = difference.copy()
    for direction in (0, 1):
        if nurbs.closed[direction]:
            low, high = domain(nurbs, direction)
            out[..., direction] -= (high - low) * np.round(out[..., direction] / (high - low))
    return out


def settle(nurbs: NurbsSurface, points: Floats, start: Floats, steps: int = 12) -> Floats:
    """(k, 2) parameters of the nearest points, from starts near enough for Newton's method to need no search.

    No step is longer than a quarter of the domain; where the method does not come to rest, its last place
    is returned.
    """
    width = np.array([high - low for low, high in (domain(nurbs, d) for d in (0, 1))])
    uv = wrap(nurbs, start)
    active = np.arange(len(uv))
    for _ in range(steps):
        step = newton_step(nurbs, evaluate(nurbs, uv[active]), points[active], uv[active])
        step = step / np.maximum(1.0, np.abs(step / width).max(axis=1, keepdims=True) * 4)
        moved = wrap(nurbs, uv[active] + step)
        far = np.abs(_shortest(nurbs, moved - uv[active]) / width).max(axis=1) > SETTLED
        uv[active] = moved
        active = active[far]
        if len(active) == 0:
            break
    return uv


def _take(jet: Jet, rows: Ints) -> Jet:
    return Jet(*(part[rows] for part in jet))


def newton_step(nurbs: NurbsSurface, jet: Jet, points: Floats, uv: Floats) -> Floats:
    """(k, 2): Newton's step for half the squared distance; Gauss–Newton's where the Hessian is not positive.

    At open ends it goes to the least of the quadratic model within the domain. Clipped by itself, the step
    would leave a point that stands a rounding error before an end where it is, short of the nearest one.
    """
    r = jet.point - points
    gu, gv = dot(r, jet.du), dot(r, jet.dv)
    e, f, g = dot(jet.du, jet.du), dot(jet.du, jet.dv), dot(jet.dv, jet.dv)
    a, b, c = e + dot(r, jet.duu), f + dot(r, jet.duv), g + dot(r, jet.dvv)
    convex = (a > 0) & (a * c - b * b > RELATIVE * e * g)
    a, b, c = np.where(convex, a, e), np.where(convex, b, f), np.where(convex, c, g)
    a, c = a + 1e-12 * e.max(initial=0), c + 1e-12 * g.max(initial=0)  # singular points stay where they are
    determinant = a * c - b * b
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        u, v = (b * gv - c * gu) / determinant, (b * gu - a * gv) / determinant
        # The least lies on an end that the step crosses: once along each direction, in case it crosses two.
        v_first, u_first = _inside(nurbs, uv, v, 1), _inside(nurbs, uv, u, 0)
        u_then = np.where(v_first == v, u_first, _inside(nurbs, uv, -(gu + b * v_first) / a, 0))
        v_then = np.where(u_first == u, v_first, _inside(nurbs, uv, -(gv + b * u_first) / c, 1))

        def model(u: Floats, v: Floats) -> Floats:
            return np.asarray(gu * u + gv * v + a * u * u / 2 + b * u * v + c * v * v / 2)

        better = model(u_then, v_first) <= model(u_first, v_then)
    step = np.stack([np.where(better, u_then, u_first), np.where(better, v_first, v_then)], axis=1)
    return np.where(np.isfinite(step) & np.isfinite(u + v)[:, None], step, 0.0)


def _inside(nurbs: NurbsSurface, uv: Floats, step: Floats, direction: int) -> Floats:
    """(k,) steps of one parameter, cut at the ends of the domain where that is open."""
    if nurbs.closed[direction]:
        return step
    low, high = domain(nurbs, direction)
    return np.clip(step, low - uv[:, direction], high - uv[:, direction])


def _search(
    nurbs: NurbsSurface, points: Floats, uv: Floats, at: Floats, step: Floats
) -> tuple[Floats, Bools]:
    """Parameters after the step, halved until the distance does not grow, and which ones really moved."""
    width = np.array([high - low for low, high in (domain(nurbs, d) for d in (0, 1))])
    step = step / np.maximum(1.0, np.abs(step / width).max(axis=1, keepdims=True) * 4)
    # Distances near the least differ by less than they are rounded: there every step is taken.
    before = np.linalg.norm(at - points, axis=1) + NOISE * np.abs(points).max(initial=0.0)
    out, waiting = uv.copy(), np.arange(len(uv))
    for _ in range(HALVINGS):
        trial = wrap(nurbs, uv[waiting] + step[waiting])
        after = np.linalg.norm(evaluate_points(nurbs, trial) - points[waiting], axis=1)
        good = after <= before[waiting]
        out[waiting[good]] = trial[good]
        waiting = waiting[~good]
        if len(waiting) == 0:
            break
        step[waiting] /= 2
    moved = np.abs(_shortest(nurbs, out - uv) / width).max(axis=1) > CONVERGED
    return out, moved
