"""A net on a lattice: what the pattern is found on."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.tolerances import TINY


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

    @cached_property
    def sides(self) -> tuple[tuple[Floats, ...], ...]:
        """Per edge of the triangles, (m,) each: where it begins, x and y, and its unit direction, u and v."""
        found = []
        for c in range(3):
            begin = self.corners[:, c]
            along = self.corners[:, (c + 1) % 3] - begin
            along = along / np.maximum(abs(along), TINY)
            found.append(tuple(map(np.ascontiguousarray, (begin.real, begin.imag, along.real, along.imag))))
        return tuple(found)

    def edge_distances(self, face: Ints, place: Complexes) -> Floats:
        """(3, k) signed distances of places from the edges of triangles, positive inside."""
        px, py = np.ascontiguousarray(place.real), np.ascontiguousarray(place.imag)
        distance = np.empty((3, len(face)))
        for c, side in enumerate(self.sides):
            x, y, u, v = (part.take(face) for part in side)
            np.subtract(u * (py - y), v * (px - x), out=distance[c])
        return distance

    def into(self, crossing: Ints) -> Ints:
        """(…, 4) isometries that carry coordinates of a face to those of the face across: the inverses."""
        return self.isometries[self.inverse[crossing]]
