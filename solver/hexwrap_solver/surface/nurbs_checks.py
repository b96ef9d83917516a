"""What must hold of a NURBS surface so that it is a tube: sound data, closed in exactly one direction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface.checks import LARGEST, SMALLEST, check_extent, check_finite
from hexwrap_solver.surface.errors import HandlesError, NotClosedError, NurbsDataError, PoleError
from hexwrap_solver.surface.nurbs import domain, evaluate_points
from hexwrap_solver.surface.types import NurbsSurface
from hexwrap_solver.tolerances import RELATIVE
from hexwrap_solver.words import place

NAMES = "uv"
HIGHEST_DEGREE = 32
#: Two ends within this part of the surface's size are one seam, and a ring below it is a point.
TOLERANCE = 1e-6
#: Points per knot span at which ends are compared.
PER_SPAN = 5
#: Only where a ring is narrower than this part of the size it may be a point a little further on.
NARROW = 0.2


def checked(nurbs: NurbsSurface) -> tuple[NurbsSurface, list[str]]:
    """The surface with its closed direction verified, or found where none was named; and what was repaired.

    Raises NurbsDataError, NonFiniteError, FlatSurfaceError, NotClosedError, HandlesError, PoleError.
    """
    check_data(nurbs)
    size = nurbs.size
    check_extent(size)
    gap = [end_gap(nurbs, direction) for direction in (0, 1)]
    pole = [any(collapsed(nurbs, d, end, TOLERANCE * size) for end in (0, 1)) for d in (0, 1)]
    for direction in (0, 1):
        if nurbs.closed[direction] and gap[direction] > TOLERANCE * size:
            raise NotClosedError(
                f"The NURBS surface is said to be closed in {NAMES[direction]}, but its ends are up to "
                f"{gap[direction]:.4g} apart: join them to within {TOLERANCE * size:.2g}.",
                field=("closed", direction),
            )
    closed = [gap[d] <= TOLERANCE * size for d in (0, 1)]
    if any(pole):
        at = NAMES[pole.index(True)]
        raise PoleError(
            f"The NURBS surface shrinks to a point at an end of {at}: a tube is open there, so trim the tip "
            "off along a parameter line."
        )
    if all(closed):
        raise HandlesError(
            "The NURBS surface is closed in u and in v, like a torus: split it along a parameter line, so "
            "that it is open in one of them.",
            data={"loops": 0, "euler_characteristic": 0, "genus": 1},
        )
    if not any(closed):
        raise NotClosedError(
            f"The NURBS surface is closed in no direction: its ends are up to {gap[0]:.4g} apart in u and "
            f"{gap[1]:.4g} in v. A tube must close up in one of them to within {TOLERANCE * size:.2g}."
        )
    notes = (
        [] if any(nurbs.closed) else [f"The surface was found to close up in {NAMES[closed.index(True)]}."]
    )
    return replace(nurbs, closed=(closed[0], closed[1])), notes


def check_data(nurbs: NurbsSurface) -> None:
    """Raises NurbsDataError, NonFiniteError."""
    net = nurbs.control_points
    if net.ndim != 3 or net.shape[2] != 4:
        raise NurbsDataError(
            f"The control points have the shape {net.shape}: a grid of (x, y, z, w) is needed.",
            field=("control_points",),
        )
    check_finite(net.reshape(-1, 4), "Control point", ("control_points",))
    if not (net[..., 3] >= SMALLEST).all():
        i, j = np.argwhere(~(net[..., 3] >= SMALLEST))[0]
        raise NurbsDataError(
            f"Control point [{i}][{j}] has the weight {net[i, j, 3]:g}: at least {SMALLEST:g} is needed.",
            field=("control_points", int(i), int(j), 3),
        )
    for direction in (0, 1):
        _check_knots(nurbs, direction)


def _check_knots(nurbs: NurbsSurface, direction: int) -> None:
    name, p, knots = NAMES[direction], nurbs.degree[direction], nurbs.knots[direction]
    n = nurbs.control_points.shape[direction]

    def wrong(text: str, part: str = "knots") -> NurbsDataError:
        return NurbsDataError(text, field=(part, direction))

    if not 1 <= p <= HIGHEST_DEGREE:
        raise wrong(f"The degree in {name} is {p}: it must lie between 1 and {HIGHEST_DEGREE}.", "degree")
    if n <= p:
        raise wrong(f"Degree {p} in {name} needs at least {p + 1} control points; there are {n}.", "degree")
    if knots.shape != (n + p + 1,):
        raise wrong(
            f"There are {knots.size} knots in {name}; {n} control points of degree {p} need the full knot "
            f"vector of {n + p + 1} (Rhino leaves out the first and the last: repeat them)."
        )
    if not np.isfinite(knots).all() or (np.diff(knots) < 0).any():
        raise wrong(f"The knots in {name} must be finite numbers that never decrease.")
    if not knots[n] > knots[p]:
        raise wrong(f"The domain in {name}, from knot {p} to knot {n}, is empty.")
    if np.abs(knots).max() > LARGEST or knots[n] - knots[p] < SMALLEST:
        raise wrong(
            f"The knots in {name} run from {knots[p]:g} to {knots[n]:g}: they must lie within ±{LARGEST:g} "
            f"and span at least {SMALLEST:g}."
        )
    inner = knots[(knots > knots[p]) & (knots < knots[n])]
    torn = [x for x, count in zip(*np.unique(inner, return_counts=True), strict=True) if count > p]
    if torn:
        raise wrong(
            f"The knot {torn[0]:g} in {name} stands there more than {p} times, which tears the surface."
        )


def spans(nurbs: NurbsSurface, direction: int, per_span: int) -> Floats:
    """Parameters from end to end of the domain, the given number of steps in every knot span."""
    low, high = domain(nurbs, direction)
    knots = nurbs.knots[direction]
    marks = np.unique(knots[(knots >= low) & (knots <= high)])
    steps = marks[:-1, None] + np.diff(marks)[:, None] * np.arange(per_span) / per_span
    return np.append(steps.ravel(), high)


def _line(nurbs: NurbsSurface, direction: int, at: float) -> Floats:
    """Points along the parameter line on which the parameter of direction is constant."""
    along = spans(nurbs, 1 - direction, PER_SPAN)
    fixed = np.full_like(along, at)
    pair = (fixed, along) if direction == 0 else (along, fixed)
    open_surface = replace(nurbs, closed=(False, False))  # both ends of a period are wanted
    return evaluate_points(open_surface, np.stack(pair, axis=1))


def end_gap(nurbs: NurbsSurface, direction: int) -> float:
    """The greatest distance between the two ends of direction."""
    low, high = (_line(nurbs, direction, x) for x in domain(nurbs, direction))
    return float(np.linalg.norm(low - high, axis=1).max())


def closed_within(nurbs: NurbsSurface, tolerance: float) -> tuple[bool, bool]:
    """Whether the two ends of u, of v are one line, to within the tolerance and not shrunk to a point."""
    found = []
    for direction in (0, 1):
        width = domain(nurbs, direction)
        low, high = (_line(nurbs, direction, x) for x in width)
        across = _line(nurbs, direction, (width[0] + width[1]) / 2)
        gap = float(np.linalg.norm(low - high, axis=1).max())
        depth = float(np.linalg.norm(low - across, axis=1).max())
        found.append(gap <= max(tolerance, TOLERANCE * nurbs.size) and depth > 10 * gap)
    return found[0], found[1]


def collapsed(nurbs: NurbsSurface, direction: int, end: int, tolerance: float) -> bool:
    """Whether the parameter line at the lower (0) or upper end (1) of direction is a point."""
    return _extent(nurbs, direction, domain(nurbs, direction)[end]) <= tolerance


def check_pinches(nurbs: NurbsSurface) -> None:
    """Raises PoleError where a parameter line between the ends of the surface shrinks to a point."""
    size = nurbs.size
    for direction in (0, 1):
        at = spans(nurbs, direction, PER_SPAN)
        extents = np.array([_extent(nurbs, direction, x) for x in at])
        inner = np.arange(1, len(at) - 1)
        narrow = inner[(extents[inner] <= extents[inner - 1]) & (extents[inner] <= extents[inner + 1])]
        for k in narrow[extents[narrow] < NARROW * size]:
            x = at[k]
            if extents[k] > TOLERANCE * size:
                x = _narrowest(nurbs, direction, at[k - 1], at[k + 1])
            line = _line(nurbs, direction, x)
            if float(np.ptp(line, axis=0).max()) <= TOLERANCE * size:
                tip = place(line.mean(axis=0))
                raise PoleError(
                    f"The surface is pinched to a point at {tip}, where {NAMES[direction]} = {x:.4g}: no "
                    "panels can pass through a point. Split it there and clad the parts one by one, or give "
                    "it a width there."
                )


def _extent(nurbs: NurbsSurface, direction: int, at: float) -> float:
    return float(np.ptp(_line(nurbs, direction, at), axis=0).max())


def _narrowest(nurbs: NurbsSurface, direction: int, low: float, high: float) -> float:
    """Where the parameter line between two of them is shortest."""
    found = scipy.optimize.minimize_scalar(
        lambda x: _extent(nurbs, direction, x),
        bounds=(low, high),
        method="bounded",
        options={"xatol": RELATIVE * (high - low), "maxiter": 100},
    )
    return float(found.x)
