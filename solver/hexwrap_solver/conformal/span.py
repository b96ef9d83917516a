"""How far scale factors may lie apart."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.errors import ConvergenceError

#: The largest difference of u that a layout in double precision can show: e^36 is 4e15.
MAX_SPAN = 36.0


def check_span(u: Floats, cone_angle: float) -> None:
    """Raises ConvergenceError where the domain would have finer parts than its coordinates have digits."""
    span = float(np.ptp(u))
    if span > MAX_SPAN:
        raise ConvergenceError(
            f"Under this boundary condition (cone angle {np.degrees(cone_angle):.4g}°) the map would shrink "
            f"some parts of the surface about 10^{span / np.log(10):.0f} times as much as others, more than "
            "the 16 digits of a coordinate can tell apart; ask for a smaller cone angle, or cut the surface "
            "where it is long and thin."
        )
