"""Text that may come from anywhere, made safe for one place in a file."""

from __future__ import annotations

from fractions import Fraction

import numpy as np


def one_line(text: str) -> str:
    """The text without line breaks and control characters (a comment, a title)."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def length(value: float) -> str:
    """A length to four significant digits, or to the whole unit where it is larger."""
    if not 1e-5 < abs(value) < 1e9:
        return f"{value:.4g}"
    return f"{value:.{max(0, 3 - int(np.floor(np.log10(abs(value)))))}f}"


def angle(value: float) -> str:
    """Radians as a multiple of π where it is a simple one (``4π/3``), else in degrees (``97.3°``)."""
    turns = Fraction(value / np.pi).limit_denominator(12)
    if abs(float(turns) * np.pi - value) > 1e-6:
        return f"{np.degrees(value):.1f}°"
    if turns == 0:
        return "0"
    sign, top = "−" if turns < 0 else "", abs(turns.numerator)
    return f"{sign}{'' if top == 1 else top}π" + (f"/{turns.denominator}" if turns.denominator > 1 else "")
