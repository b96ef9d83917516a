"""Text that may come from anywhere, made safe for one place in a file."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from fractions import Fraction
from itertools import pairwise

import numpy as np

#: More significant digits no length is written with.
MOST_DIGITS = 17
#: Lengths that differ by no more, relative to them, are one.
ROUNDING = 1e-9


def one_line(text: str) -> str:
    """The text without line breaks and control characters (a comment, a title)."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def csv_table(rows: Iterable[Iterable[object]]) -> bytes:
    """Rows as RFC 4180 says it, in UTF-8."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\r\n").writerows(rows)
    return text.getvalue().encode()


def length(value: float) -> str:
    """A length to four significant digits, or to the whole unit where it is larger."""
    return _digits(value, 4)


def lengths(values: list[float], shapes: list[int] | None = None) -> list[str]:
    """Lengths, each as ``length`` writes it, or with the digits that tell it apart from those beside it.

    Those that differ by rounding, or whose ``shapes`` (numbers of sides) tell them apart, are written alike.
    """
    shapes = shapes or [0] * len(values)
    words = [length(value) for value in values]
    for digits in range(5, MOST_DIGITS + 1):
        same = [
            a == b and shape == other and abs(x - y) > ROUNDING * abs(x)
            for (a, x, shape), (b, y, other) in pairwise(zip(words, values, shapes, strict=True))
        ]
        alike = [a or b for a, b in zip([False, *same], [*same, False], strict=True)]
        if not any(same):
            break
        pairs = zip(words, values, alike, strict=True)
        words = [_digits(value, digits) if again else word for word, value, again in pairs]
    return words


def _digits(value: float, digits: int) -> str:
    """The given number of significant digits, trailing zeros kept."""
    if not 1e-5 < abs(value) < 1e9:
        return f"{value:.{digits}g}"
    return f"{value:.{max(0, digits - 1 - int(np.floor(np.log10(abs(value)))))}f}"


def angle(value: float) -> str:
    """Radians as a multiple of π where it is a simple one (``4π/3``), else in degrees (``97.3°``)."""
    turns = Fraction(value / np.pi).limit_denominator(12)
    if abs(float(turns) * np.pi - value) > 1e-6:
        return f"{np.degrees(value):.1f}°"
    if turns == 0:
        return "0"
    sign, top = "−" if turns < 0 else "", abs(turns.numerator)
    return f"{sign}{'' if top == 1 else top}π" + (f"/{turns.denominator}" if turns.denominator > 1 else "")
