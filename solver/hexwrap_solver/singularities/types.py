"""What is asked of singularities, and what was found (beyond the paper)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

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


Points = tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class KeepOff:
    """A curve that singularities keep away from. Raises SettingError without points."""

    line: Annotated[Points, Setting("points of the curve in order, or a single one", most=10_000)]
    distance: Annotated[float, Setting("least distance from it", ge=0, le=1e6, unit="cells")] = 2.0

    def __post_init__(self) -> None:
        if not self.line:
            raise SettingError("'line' must have a point at least")


@dataclass(frozen=True)
class Region:
    """A ball in which singularities may stand."""

    point: Annotated[tuple[float, float, float], Setting("middle of the ball")]
    radius: Annotated[float | None, Setting("of the ball; null: one cell", gt=0, unit="length")] = None


@dataclass(frozen=True)
class SingularitySettings:
    """Cells with more or fewer sides, which make the sizes of all others more equal. With ``at``, exactly
    those; the other rules are for those that are placed.

    only: none may stand outside these balls. symmetric: they stand in positions that a symmetry of the
    surface, a mirror plane or a rotation, carries into each other.
    """

    count: Annotated[
        int | Literal["auto"] | None, Setting("at most this many, or auto: as many as pay", ge=0, le=30)
    ] = None
    at: Annotated[tuple[SingularityAt, ...], Setting("where they are to stand, each", most=100)] = ()
    from_boundary: Annotated[
        float, Setting("least distance from the boundary", ge=0.5, le=1e6, unit="cells", rare=True)
    ] = 2.0
    from_features: Annotated[
        float, Setting("least distance from creases and other lines", ge=0, le=1e6, unit="cells", rare=True)
    ] = 1.0
    keep_off: Annotated[
        tuple[KeepOff, ...], Setting("curves that they keep away from", most=100, rare=True)
    ] = ()
    only: Annotated[tuple[Region, ...], Setting("where they may stand", most=1000, rare=True)] = ()
    symmetric: Annotated[bool, Setting("singularities stand symmetrically, as the surface is", rare=True)] = (
        False
    )


@dataclass(frozen=True)
class Rules:
    """What the search must keep to.

    quantum: of the cone angles, π/3 or π/2. cell: width of a cell on the surface, model units. sizes:
    number of size classes. ends: per loop of the surface. most: number of singularities, at most; enough:
    more than so many only where these leave much open.
    from_loops: cells between a singularity and a loop; apart, opposite: between two of the same and of
    opposite signs. away: polylines (k, 3), each with how many cells they must keep from it; creases: further
    ones, but for vertices at which the surface is a cone already. only: (k, 4)
    centres and radii of balls in which they must stand, None: anywhere. largest: greatest |k| of one.
    symmetric: see ``SingularitySettings``. angles: (n,) target angles at boundary vertices of loops
    whose ends are "angles"; None: there are none.
    """

    quantum: float
    cell: float
    sizes: int | None
    ends: tuple[End, ...]
    most: int = 6
    enough: int = 30
    from_loops: float = 2.0
    apart: float = 3.0
    opposite: float = 5.0
    away: tuple[tuple[Floats, float], ...] = ()
    creases: tuple[tuple[Floats, float], ...] = ()
    only: Floats | None = None
    largest: int = 1
    angles: Floats | None = None
    symmetric: bool = False


@dataclass(frozen=True)
class Proposal:
    """Singularities as the linear model sees them.

    vertex: (s,) of the mesh; index: (s,) k of each. loops: per loop its curvature in quanta (straight ones:
    0). uncovered: share of the area that panels in the size classes leave open; spread: standard deviation
    of u over the area; ratio: largest over smallest cell.
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


@dataclass(frozen=True)
class Choices:
    """How much is left open with how many singularities: what one chooses their number from.

    sizes: number of size classes. taken: index of the number that the map has. number: (c,) ascending.
    uncovered: (c,) share of the cells' area left open: measured at ``taken`` where panels were made, the
    others by the linear model. ratio: (c,) largest over smallest cell. places: per number (k, 3) where they
    stand, and index: (k,) theirs; asked for as a list of places they give the same again. coarse: by the
    rough model that is good for a note; ends free.
    """

    sizes: int
    taken: int
    number: Ints
    uncovered: Floats
    ratio: Floats
    places: tuple[Floats, ...]
    index: tuple[Ints, ...]
    coarse: bool = False

    @classmethod
    def of(cls, proposals: Sequence[Proposal], taken: int, sizes: int, vertices: Floats) -> Choices:
        """vertices: (n, 3) of the mesh that the proposals are for."""
        return cls(
            sizes,
            taken,
            np.array([one.count for one in proposals], dtype=np.int64),
            np.array([one.uncovered for one in proposals]),
            np.array([one.ratio for one in proposals]),
            tuple(vertices[one.vertex] for one in proposals),
            tuple(one.index for one in proposals),
        )

    def with_measured(self, left: float) -> Choices:
        """left: measured share of the area that is open now; what the model lacks of it is added to all."""
        more = max(left - float(self.uncovered[self.taken]), 0.0)
        uncovered = self.uncovered + more
        uncovered[self.taken] = left
        return replace(self, uncovered=uncovered)
