"""The vertices of a net once each, and how the corners of its faces follow from them on the lattice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Ints
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Isometry, Lattice


@dataclass(frozen=True)
class Glued:
    """rows: (m, 3, 4) isometries that carry a vertex's own place to that of each corner."""

    lattice: Lattice
    rows: Ints

    @classmethod
    def by_sheets(cls, cmap: ConformalMap, motion: Isometry) -> Glued:
        """Of an annulus, the deck transformation being an isometry of the lattice."""
        return cls(motion.lattice, motion.power(cmap.sheet))

    @property
    def turn(self) -> Complexes:
        """(m, 3) as factors."""
        return np.asarray(np.exp(1j * self.lattice.step_angle * self.rows[..., 0]))

    @property
    def shift(self) -> Complexes:
        """(m, 3)"""
        return self.lattice.position(self.rows[..., 1:3])

    def corners(self, faces: Ints, place: Complexes) -> Complexes:
        """(m, 3) places of the corners, from those of the vertices (n,)."""
        return self.lattice.carry(self.rows, place[faces])


def around_vertices(
    lattice: Lattice, net: Net, twin: Ints, isometries: Ints, faces: Ints
) -> tuple[Ints, Ints]:
    """rows: (m, 3, 4), see Glued, composed from corner to corner around every vertex; own: (n,) the corner
    3·face + c at which each vertex is at home, its lowest.

    At a cone, whose image depends on the way around it, only a fixed point of the holonomy is consistent.
    """
    n = int(faces.max()) + 1
    vertex = faces.ravel()
    own = np.full(n, len(vertex), dtype=np.int64)
    np.minimum.at(own, vertex, np.arange(len(vertex)))
    rows = np.zeros((len(vertex), 4), dtype=np.int64)
    glued = np.zeros(n, dtype=bool)
    face, edge = np.nonzero(net.crossing)
    glued[faces[face, edge]] = glued[faces[face, (edge + 1) % 3]] = True
    known: Bools = ~glued[vertex]
    known[own] = True
    frontier = own[glued]
    while len(frontier):
        reached = []
        for half_edge in (frontier, frontier - frontier % 3 + (frontier + 2) % 3):
            inner = twin[half_edge] >= 0
            at, beyond = frontier[inner], twin[half_edge[inner]]
            if half_edge is frontier:  # it leaves the vertex, its twin comes to it
                beyond = beyond - beyond % 3 + (beyond + 1) % 3
            new = ~known[beyond]
            at, beyond, crossing = at[new], beyond[new], net.crossing.ravel()[half_edge[inner][new]]
            into = isometries[net.inverse[crossing]]
            rows[beyond] = lattice.compose(into, rows[at])
            known[beyond] = True
            reached.append(beyond)
        frontier = np.concatenate(reached)
    return rows.reshape(*faces.shape, 4), own
