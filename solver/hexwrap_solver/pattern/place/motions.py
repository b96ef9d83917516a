"""The motions of a net, and what ties them together.

Around a vertex inside, the product of the motions met is the identity; around a singularity of index k it is
the rotation by −k quanta about its place, which must be a centre of that symmetry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.errors import NotAdaptedError
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.place.placement import NEARLY, PARTS, quantum_name


@dataclass(frozen=True)
class Holonomy:
    """The motions that generate the holonomy of a net, and what they must fulfil.

    turn: (t,) rotations in steps of ζ. mate: (t,) the inverse of each. words: per singularity, then per
    vertex at which three or more pieces of the cut meet, the motions met on the way around it. index: (c,) of
    the singularities.
    """

    turn: Ints
    mate: Ints
    translation: Complexes
    words: list[Ints]
    index: Ints

    @property
    def lead(self) -> Ints:
        """(p,) one of each pair of inverses: the generators."""
        every = np.arange(len(self.turn))
        return every[every < self.mate]


def holonomy_of(cmap: ConformalMap, lattice: Lattice, net: Net) -> Holonomy:
    """Raises NotAdaptedError where a motion turns by no multiple of the quantum."""
    faces, twin = cmap.surface.faces, cmap.surface.twin
    steps, own = net.angle / lattice.step_angle, lattice.order // lattice.fold
    used = np.unique(net.crossing)
    off = abs(steps - own * np.rint(steps / own)) * lattice.step_angle
    if (off[used] > NEARLY).any():
        worst = int(used[np.argmax(off[used])])
        part = PARTS[lattice.fold]
        raise NotAdaptedError(
            f"A loop or singularity turns the domain by {net.angle[worst]:.8f} rad, but a {lattice.kind} "
            f"pattern closes up only where that is a multiple of {part}: choose boundary angles or "
            f"singularities that add up to one, or boundary.quantum {quantum_name(lattice)}.",
            data={"cone_angle": float(net.angle[worst]), "quantum": lattice.quantum},
        )
    turn = np.rint(steps).astype(np.int64) % lattice.order
    starts = np.full(len(cmap.surface.vertices), len(twin), dtype=np.int64)
    corners = faces.ravel()
    np.minimum.at(starts, corners, np.arange(len(corners)))
    glued = (net.crossing.ravel() > 0) & (twin >= 0)
    meeting = np.bincount(corners[glued], minlength=len(starts))
    on_boundary = np.zeros(len(starts), dtype=bool)
    on_boundary[corners[twin < 0]] = True
    branching = np.flatnonzero((meeting > 2) & ~on_boundary)
    branching = branching[~np.isin(branching, cmap.cones.vertex)]
    words = [
        word_around(net, twin, int(starts[v])) for v in [*cmap.cones.vertex.tolist(), *branching.tolist()]
    ]
    return Holonomy(turn, net.inverse, net.translation, words, cmap.cones.index)


def word_around(net: Net, twin: Ints, corner: int) -> Ints:
    """The motions met around a vertex inside, counter-clockwise from one of its corners."""
    found, at = [], corner
    while True:
        at = at - at % 3 + (at + 2) % 3  # the half-edge that comes to the vertex
        if net.crossing.ravel()[at]:
            found.append(int(net.crossing.ravel()[at]))
        at = int(twin[at])
        if at == corner:
            return np.array(found, dtype=np.int64)


def fixed_point(lattice: Lattice, rotation: Ints) -> Complexes:
    """(…,) of rotations (…, 4)."""
    zeta = np.exp(1j * lattice.step_angle * rotation[..., 0])
    return np.asarray(lattice.position(rotation[..., 1:3]) / (1 - zeta))


def pin_cones(
    cmap: ConformalMap, lattice: Lattice, rows: Ints, corner: Ints, normal: Complexes, depth: Floats
) -> None:
    """Singularities stand exactly at the fixed points of the motions around them."""
    for v in cmap.cones.vertex.tolist():
        word = word_around(cmap.net, cmap.surface.twin, int(corner[v]))
        centre = complex(fixed_point(lattice, lattice.partial_products(rows[word])[-1]))
        normal[v] = 1.0, 1j
        depth[v] = centre.real, centre.imag
