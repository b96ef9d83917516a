"""How far scale factors may lie apart."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.conformal.types import Cones
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.tolerances import is_whole_turn

#: The largest difference of u that a layout in double precision can show where places have no centre: e^36
#: is 4e15.
MAX_SPAN = 36.0
#: Cones have a centre, their apex at the origin, and every place keeps all its digits relative to it, down to
#: the smallest doubles. |u| up to this leaves room for products of two lengths: e^600 is 4e260.
MAX_REACH = 300.0
#: From this difference of u on, a map that does not come out right is refused for it: e^11.5 is 1e5, and most
#: surfaces that are not long and thin have less.
WIDE = 11.5
#: Cone angles nearer than this to a multiple of 2π have an apex, but one that is not known to all digits.
CLEAR = 1e-3


def is_annulus(surface: Surface, cones: Cones) -> bool:
    """Whether the domain is unrolled into sheets: two loops and no cones."""
    return len(surface.loops) == 2 and not len(cones)


def cone_angle_of(surface: Surface, curvature: Floats) -> float | None:
    """K of an annulus without cones, from the curvatures of its loops; None of all other surfaces: their
    domains have no centre."""
    return float(curvature[0]) if len(surface.loops) == 2 == len(curvature) else None


def largest_span(cone_angle: float | None) -> float:
    """The largest difference of u that a domain of this cone angle can show."""
    if cone_angle is None:
        return MAX_SPAN
    return MAX_SPAN if is_whole_turn(cone_angle, CLEAR) else 2 * MAX_REACH


def check_span(u: Floats, cone_angle: float | None) -> None:
    """Raises ConvergenceError where the domain would have finer parts than its coordinates have digits."""
    span = float(np.ptp(u))
    most = largest_span(cone_angle)
    if span > most:
        held = "the 16 digits of a coordinate" if most == MAX_SPAN else "the range of double precision"
        raise ConvergenceError(_sentence(span, cone_angle, f"more than {held} can tell apart"))


def check_reach(u: Floats, cone_angle: float | None) -> None:
    """Raises ConvergenceError where lengths or areas in the domain would leave the range of doubles."""
    if float(np.abs(u).max()) > MAX_REACH:
        span = float(np.ptp(u))
        raise ConvergenceError(_sentence(span, cone_angle, "beyond the range of double precision"))


def failure(
    span: float, cone_angle: float | None, what: str, advice: str, vertices: list[int]
) -> ConvergenceError:
    """Why a map has not come out right: because of its span of u where that is wide, or else ``what``, with
    ``advice``."""
    sentence = f"{what}: {advice}."
    if span > WIDE:
        sentence = _sentence(span, cone_angle, f"too far apart for double precision on this mesh. {what}")
    return ConvergenceError(sentence, vertices=vertices)


def _sentence(span: float, cone_angle: float | None, why: str) -> str:
    which, angles = "", "boundary angles nearer to 180°, or another place for singularities"
    if cone_angle is not None:
        which = f" (cone angle {np.degrees(cone_angle):.4g}°)"
        angles = "boundary angles nearer to 180°" if abs(cone_angle) < CLEAR else "a smaller cone angle"
    return (
        f"Under this boundary condition{which} the map would shrink "
        f"some parts of the surface about 10^{span / np.log(10):.0f} times as much as others, {why}; ask for "
        f"{angles}, or cut the surface where it is long and thin."
    )
