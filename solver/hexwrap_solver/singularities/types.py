"""What is asked of singularities, and what was found (beyond the paper)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.errors import SettingError
from hexwrap_solver.setting import Setting

#: Per loop: u is constant along it and its curvature a whole number of quanta, it is straight, or its
#: angles are given.
End = Literal["free", "straight", "angles"]


@dataclass(frozen=True)
class SingularityAt:
    """One that is asked for, at a vertex of the sent mesh or near a point. Raises SettingError unless
    exactly one of the two is given, and for an index of 0."""

    index: Annotated[int, Setting("sides fewer than the other cells, −1: one more", ge=-2, le=2)]
    vertex: Annotated[
        int | None, Setting("vertex inside, an index of the sent mesh", ge=0, lt=2**53, unit="vertex")
    ] = None
    point: Annotated[
        tuple[float, float, float] | None, Setting("instead: the vertex nearest to this point")
    ] = None

    def __post_init__(self) -> None:
        if (self.vertex is None) == (self.point is None):
            raise SettingError("give either 'vertex' or 'point'")
        if self.index == 0:
            raise SettingError("'index' must be 1, −1, 2 or −2 (sides fewer or more)")


@dataclass(frozen=True)
class SingularitySettings:
    """Cells with more or fewer sides, which make the sizes of all others more equal. With ``at``, exactly
    those."""

    count: Annotated[
        int | Literal["auto"] | None, Setting("at most this many, or auto: as many as pay", ge=0, le=30)
    ] = None
    at: Annotated[tuple[SingularityAt, ...], Setting("where they are to stand, each", most=100)] = ()
    from_boundary: Annotated[
        float, Setting("least distance from the boundary", ge=0.5, le=1e6, unit="cells", rare=True)
    ] = 2.0


@dataclass(frozen=True)
class Rules:
    """What the search must keep to.

    quantum: of the cone angles, π/3 or π/2. cell: width of a cell on the surface, model units. sizes:
    number of size classes. ends: per loop of the surface. most: number of singularities, at most.
    from_loops: cells between a singularity and a loop; apart, opposite: between two of the same and of
    opposite signs. away: (k, 3) points, such as those of a curve, that they must keep ``from_away`` cells
    from. only: (k, 3) points within ``cell`` of which they must stand, None: anywhere. largest: greatest
    |k| of one. angles: (n,) target angles at boundary vertices of loops whose ends are "angles"; None:
    there are none.
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
    angles: Floats | None = None


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
