"""What a drawing of any format holds."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hexwrap_server.errors import DrawingError
from hexwrap_solver.arrays import Floats

#: Arcs and splines become polylines at most this far from them, in parts of the drawing's size.
FLATNESS = 1e-5
#: Blocks within blocks may multiply without end: more objects than these are not taken out of them.
MOST_OBJECTS = 200_000
#: Blocks within blocks, at most so deep.
DEEPEST = 32


@dataclass(frozen=True)
class Curve:
    """points: (k, 2 or 3), a single one for a point. closed: the last is joined to the first."""

    points: Floats
    closed: bool = False


@dataclass
class Drawing:
    """curves: also single points. left_out: how many objects of each kind could not be carried."""

    curves: list[Curve] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)

    def notes(self) -> list[str]:
        """A sentence where something was left out."""
        if not self.left_out:
            return []
        listed = ", ".join(f"{count} {what}" for what, count in sorted(self.left_out.items()))
        return [f"left out of the drawing, since only points and curves are carried: {listed}"]


def curve(points: list[Any] | Floats, closed: bool = False) -> Curve:
    """Raises DrawingError unless the points are rows of two or of three numbers."""
    try:
        table = np.array(points, dtype=float)
    except (ValueError, TypeError):
        table = np.zeros(0)
    if table.ndim != 2 or table.shape[1] not in (2, 3):
        raise DrawingError("Every point of the drawing must be two or three numbers, as many in each curve.")
    return Curve(table, closed)


def too_many() -> DrawingError:
    return DrawingError(
        f"The blocks of the drawing hold more than {MOST_OBJECTS} objects in all: explode the ones that are "
        "needed and delete the others."
    )
