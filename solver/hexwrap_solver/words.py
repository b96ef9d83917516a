"""Numbers in sentences for people: no exponents, and no more digits than tell a place."""

from __future__ import annotations

from collections.abc import Iterable

from hexwrap_solver.tolerances import RELATIVE

#: Coordinates below this have six significant digits, larger ones two decimals.
LARGE = 1e5


def length(value: float) -> str:
    """A length or an area: four significant digits, or whole with commas."""
    return f"{value:,.0f}" if 1000 <= abs(value) < 1e15 else f"{value:.4g}"


def were(number: int, one: str) -> str:
    """What a sentence about a number of things begins with: "1 cell was" or "2 cells were"."""
    return f"{number} {one} was" if number == 1 else f"{number} {one}s were"


def box(size: Iterable[float]) -> str:
    """The sides of a box; what is rounding beside the longest is 0."""
    return " × ".join(map(length, _without_rounding(size)))


def place(point: Iterable[float]) -> str:
    """Coordinates in parentheses; what is rounding beside the largest is 0."""
    return "(" + ", ".join(map(_coordinate, _without_rounding(point))) + ")"


def _without_rounding(values: Iterable[float]) -> list[float]:
    values = list(values)
    least = RELATIVE * max(map(abs, values), default=0.0)
    return [x if abs(x) > least else 0.0 for x in values]


def _coordinate(x: float) -> str:
    return f"{x:.6g}" if abs(x) < LARGE else f"{x:.2f}".rstrip("0").rstrip(".")
