"""A net on a lattice: what the pattern is found on."""

from __future__ import annotations

from dataclasses import dataclass

from hexwrap_solver.arrays import Complexes, Ints
from hexwrap_solver.pattern.lattice import Lattice


@dataclass(frozen=True)
class Layout:
    """The net of the domain in lattice units.

    corners: (m, 3) complex, the triangles. across: (m, 3) face beyond half-edge c → c + 1, −1 at the
    boundary; there stands the image of that face under isometries[crossing], (m, 3), of the table (t, 4) of
    lattice isometries, whose row 0 is the identity and whose inverses are the rows ``inverse``, (t,). twin:
    (3m,) the same edge as a half-edge of the face beyond. cones: (s,) a corner 3·face + c at each
    singularity. tolerance: distance below which a point counts as lying on an edge, lattice units.
    """

    corners: Complexes
    across: Ints
    crossing: Ints
    isometries: Ints
    inverse: Ints
    twin: Ints
    cones: Ints
    lattice: Lattice
    tolerance: float

    def into(self, crossing: Ints) -> Ints:
        """(…, 4) isometries that carry coordinates of a face to those of the face across: the inverses."""
        return self.isometries[self.inverse[crossing]]
