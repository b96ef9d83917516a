"""What is asked of singularities, and what was found (beyond the paper)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from hexwrap_solver.arrays import Floats, Ints

#: Per loop: u is constant along it and its curvature a whole number of quanta, or it is straight.
End = Literal["free", "straight"]


@dataclass(frozen=True)
class SingularitySettings:
    """What is asked for.

    count: at most so many are placed, "auto": as many as pay, None: those listed only. vertices: (k,)
    *sent* vertex indices, −1 where points gives a place instead. points: (k, 3). indices: (k,) sides fewer
    of each. With a list, exactly those are taken.
    """

    count: int | Literal["auto"] | None = None
    vertices: Ints | None = None
    points: Floats | None = None
    indices: Ints | None = None


@dataclass(frozen=True)
class Rules:
    """What the search must keep to.

    quantum: of the cone angles, π/3 or π/2. cell: width of a cell on the surface, model units. sizes: number
    of size classes. ends: per loop of the surface. most: number of singularities, at most. from_loops: cells
    between a singularity and a loop; apart, opposite: between two of the same and of opposite signs. away:
    (k, 3) points, such as those of a curve, that they must keep ``from_away`` cells from. only: (k, 3) points
    within ``cell`` of which they must stand, None: anywhere. largest: greatest |k| of one.
    """

    quantum: float
    cell: float
    sizes: int | None
    ends: tuple[End, ...]
    most: int = 6
    from_loops: float = 2.0
    apart: float = 3.0
    opposite: float = 5.0
    away: Floats | None = None
    from_away: float = 2.0
    only: Floats | None = None
    largest: int = 1


@dataclass(frozen=True)
class Proposal:
    """Singularities as the linear model sees them.

    vertex: (s,) of the mesh; index: (s,) k of each. loops: per loop its curvature in quanta (straight ones:
    0). uncovered: share of the area that the size classes leave open; spread: standard deviation of u over
    the area; ratio: largest over smallest cell.
    """

    vertex: Ints
    index: Ints
    loops: tuple[int, ...]
    uncovered: float
    spread: float
    ratio: float

    @property
    def count(self) -> int:
        return len(self.vertex)
