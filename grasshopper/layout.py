"""Where Grasshopper draws an object, given the one point that it keeps of its place: the Pivot.

Bounds in a file are only what the last session drew; on opening, every object is laid out anew from its
Pivot. What the Pivot means differs by kind. Widths of texts are estimates: fonts differ between systems.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

ROW, ICON, LETTER = 20.0, 24.0, 6.9

Box = tuple[float, float, float, float]
Point = tuple[float, float]

#: Objects whose Pivot is the top left corner of their Bounds; they keep their size in the file.
CORNERED = {"Panel", "Number Slider", "Boolean Toggle", "Button"}


@dataclass(frozen=True)
class Columns:
    """A component's box: inputs on the left of the middle, outputs on its right. rows: of the longer side."""

    left: float
    middle: float
    right: float
    rows: int

    @property
    def width(self) -> float:
        return self.left + self.middle + self.right

    @property
    def height(self) -> float:
        return ROW * max(self.rows, 1) + 4


def columns(inputs: Sequence[str], outputs: Sequence[str], middle: float = ICON) -> Columns:
    """The columns of a component with parameters of these names."""
    left, right = (max((len(name) for name in names), default=0) * LETTER + 10 for names in (inputs, outputs))
    return Columns(left, middle, right if outputs else 2.0, max(len(inputs), len(outputs)))


def label_width(nickname: str) -> float:
    """Width of the name on the left of a Value List's drop-down."""
    return len(nickname) * LETTER + 12


def pivot(kind: str, box: Box, offset: float = 0.0) -> Point:
    """The Pivot of an object of that name that shall be drawn in a box.

    offset: of a Value List, the width of its label; of a component, how far the middle of its icon lies from
    the left edge.
    """
    x, y, width, height = box
    if kind in CORNERED:
        return x, y
    if kind == "Value List":
        return x + offset, y
    if offset:
        return x + offset, y + height / 2
    return x + width / 2, y + height / 2


def box(kind: str, place: Point, size: tuple[float, float], offset: float = 0.0) -> Box:
    """Inverse of ``pivot``: the box that is drawn."""
    (x, y), (width, height) = place, size
    if kind in CORNERED:
        return x, y, width, height
    if kind == "Value List":
        return x - offset, y, width, height
    return x - (offset or width / 2), y - height / 2, width, height


def overlap(a: Box, b: Box) -> bool:
    """Do two boxes share more than an edge?"""
    return a[0] < b[0] + b[2] and b[0] < a[0] + a[2] and a[1] < b[1] + b[3] and b[1] < a[1] + a[3]
