"""Tolerances that more than one module goes by."""

from __future__ import annotations

import math

#: Sums of many angles carry rounding up to this, radians: cone angles nearer to 0, to a multiple of 2π or
#: of a quantum count as that, and a corner nearer to π as straight.
ANGLE = 1e-9
#: Parts of a whole, or of a figure beside it, that are no more than rounding.
RELATIVE = 1e-9
#: Stands for 0 in a divisor: what is divided by it is 0 as well, and quotients of lengths stay finite.
TINY = 1e-300


def is_zero(angle: float) -> bool:
    """Whether a cone angle is 0: the domain is a cylinder."""
    return abs(angle) < ANGLE


def is_whole_turn(angle: float, tolerance: float = ANGLE) -> bool:
    """Whether an angle is a multiple of 2π: rotation by it does nothing."""
    return abs(math.remainder(angle, 2 * math.pi)) < tolerance
