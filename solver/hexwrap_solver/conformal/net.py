"""The domain as a net: triangles of the plane that motions glue to each other across their edges.

Cylinder, cone, ring, disk, dome, sphere and tower with openings are all of this form. Inside the cut-open
surface neighbours simply stand beside each other; across the cut the neighbour stands beside a face only
after a motion z ↦ e^{iα} z + t, one of a small table. Composed around a cone the motions are a rotation by
its curvature about its place, around a boundary loop they are the loop's holonomy. The net may overlap
itself: places are the same if the faces that hold them are, never because they coincide in the plane.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, positions
from hexwrap_solver.surface.topology import next_half_edge

#: Two images of an edge are one where they differ by less, relative to the domain's size.
SAME = 1e-7


@dataclass(frozen=True)
class Net:
    """Half-edge c of face f runs from its corner c to corner c + 1.

    corners: (m, 3) complex, every face positively oriented.
    across: (m, 3) face on the other side of each half-edge, −1 at the boundary.
    crossing: (m, 3) the motion that brings that face here: beside face f, across half-edge c, stands
    M(corners[across]). Motion 0 is the identity.
    angle: (t,) rotation of each motion, radians. translation: (t,) complex.
    inverse: (t,) which motion undoes each.
    winding: (t,) of annuli without cones, which power of the deck transformation each motion is; else None.
    """

    corners: Complexes
    across: Ints
    crossing: Ints
    angle: Floats
    translation: Complexes
    inverse: Ints
    winding: Ints | None = None

    @classmethod
    def of_corners(cls, corners: Complexes, twin: Ints) -> Net:
        """Where only the corners are known: a motion for each edge whose two images differ. twin: (3m,)."""
        start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
        inner = np.flatnonzero(twin >= 0)
        there = twin[inner]
        turn = (end[inner] - start[inner]) / (start[there] - end[there])
        shift = start[inner] - turn * end[there]
        apart = np.abs(turn - 1) + np.abs(shift) / float(np.ptp(corners.real) + np.ptp(corners.imag)) > SAME
        glued = inner[apart]
        crossing = np.zeros(len(twin), dtype=np.int64)
        crossing[glued] = np.arange(1, len(glued) + 1)
        return cls(
            corners,
            np.where(twin >= 0, twin // 3, -1).reshape(-1, 3),
            crossing.reshape(-1, 3),
            np.append(0.0, np.angle(turn[apart])),
            np.append(0.0, shift[apart]),
            np.append(0, crossing[twin[glued]]),
        )

    def apply(self, motion: Ints, z: Complexes) -> Complexes:
        """M(z) for arrays of motions and places."""
        return np.asarray(np.exp(1j * self.angle[motion]) * z + self.translation[motion])

    def gap(self, twin: Ints) -> float:
        """How far edges are from being one, seen from both their faces, over the diameter of the net. twin:
        (3m,) half-edge on the other side, −1 at the boundary."""
        h = np.flatnonzero(self.crossing.ravel() > 0)
        if not len(h):
            return 0.0
        flat, motion, other = self.corners.ravel(), self.crossing.ravel()[h], twin[h]
        start = self.apply(motion, flat[next_half_edge(other)]) - flat[h]
        end = self.apply(motion, flat[other]) - flat[next_half_edge(h)]
        size = 2 * float(np.abs(self.corners - self.corners.mean()).max())
        return float(np.maximum(np.abs(start), np.abs(end)).max()) / size

    def moved(self, factor: complex, shift: complex) -> Net:
        """The same net after z ↦ factor · z + shift."""
        turn = np.exp(1j * self.angle)
        return replace(
            self,
            corners=factor * self.corners + shift,
            translation=factor * self.translation + (1 - turn) * shift,
        )

    def restricted(self, keep: Bools) -> Net:
        """The net of some faces, keep (m,); what lay across to others is boundary then."""
        new = positions(np.flatnonzero(keep), len(keep) + 1)  # the last one stands for −1
        across = new[self.across[keep]]
        return replace(
            self,
            corners=self.corners[keep],
            across=across,
            crossing=np.where(across < 0, 0, self.crossing[keep]),
        )
