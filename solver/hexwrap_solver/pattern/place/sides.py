"""Straight lines in the domain that lattice lines shall follow: sides of the boundary, between its corners
(paper, section 3.1; Figures 5 and 7), and features."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from itertools import pairwise

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Isometry, Lattice
from hexwrap_solver.tolerances import RELATIVE

#: A boundary is straight where it turns by less than this altogether, a corner quantized within it; rad.
QUANTIZED = 0.02
#: Where it turns by less than this, it is straight but for rounding (of given angles, too).
ROUNDING = 1e-5


@dataclass(frozen=True)
class Sides:
    """Sides of the boundary, each from corner to corner, the domain on the left; and features.

    direction: (s,) unit complex, in the frame of the loop: the loop unrolled from its first corner on, in
    that vertex's own sheet. length: (s,) in the domain. loop: (s,), −1 for features, whose frame is that of
    their first vertex. closed: (s,) whether the side is a closed line. vertex, side, sheet: (k,) the vertices
    of all sides, both ends included, and the sheet on which the frame shows them; place: (k,) where.
    """

    direction: Complexes
    length: Floats
    loop: Ints
    closed: Bools
    vertex: Ints
    side: Ints
    sheet: Ints
    place: Complexes

    @property
    def n(self) -> int:
        return len(self.length)

    def and_also(self, other: Sides) -> Sides:
        """Both, the other ones after these."""
        fields = {k: np.concatenate([v, vars(other)[k]]) for k, v in vars(self).items() if k != "side"}
        return Sides(**fields, side=np.concatenate([self.side, other.side + self.n]))


def curvatures(cmap: ConformalMap, loop: int) -> Floats:
    """π − angle sum at the vertices of a loop."""
    return np.asarray(np.pi - cmap.boundary_angles[loop])


def has_corners(cmap: ConformalMap, lattice: Lattice, loop: int) -> bool:
    """Whether a loop has corners of quantized angles."""
    return bool(corners_of(curvatures(cmap, loop), lattice).any())


def is_line(cmap: ConformalMap, loop: int) -> bool:
    """Whether a loop is straight but for rounding."""
    return bool(abs(np.cumsum(curvatures(cmap, loop))).max() < ROUNDING)


def is_polygon(cmap: ConformalMap, lattice: Lattice, loop: int) -> bool:
    """Whether a loop is straight but for corners of quantized angles, so that lattice lines can bound it."""
    kappa = curvatures(cmap, loop)
    corner = corners_of(kappa, lattice)
    if not corner.any():
        return bool(abs(np.cumsum(kappa)).max() < QUANTIZED)
    kappa = np.roll(kappa, -int(np.argmax(corner)))
    corner = np.roll(corner, -int(np.argmax(corner)))
    bent = np.cumsum(np.where(corner, 0.0, kappa))
    at_corner = bent[corner]
    drift = abs(bent - at_corner[np.cumsum(corner) - 1]).max()
    sharp = abs(abs(np.rint(kappa[corner] / lattice.quantum) * lattice.quantum) - np.pi) < 0.1
    return bool(drift < QUANTIZED and not sharp.any())


def corners_of(kappa: Floats, lattice: Lattice) -> Bools:
    """(k,) which vertices of a loop, of these curvatures, are quantized corners."""
    steps = np.rint(kappa / lattice.quantum)
    return np.asarray((steps != 0) & (abs(kappa - steps * lattice.quantum) < QUANTIZED))


def sides_of(cmap: ConformalMap, lattice: Lattice, loops: list[int]) -> Sides:
    """Sides of the given loops, each of which is a polygon with at least one corner or a closed line."""
    gained = _sheets_gained(cmap)
    parts = [no_sides(), *(_sides_of_loop(cmap, lattice, loop, gained) for loop in loops)]
    return reduce(Sides.and_also, parts)


def no_sides() -> Sides:
    none, nothing, nowhere = np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0, dtype=np.complex128)
    return Sides(nowhere, nothing, none, none > 0, none, none, none, nowhere)


def _sheets_gained(cmap: ConformalMap) -> Ints:
    """Sheets gained along each boundary edge, by its tail."""
    gained = (np.roll(cmap.sheet, -1, axis=1) - cmap.sheet).ravel()
    rim = np.flatnonzero(cmap.surface.twin < 0)
    by_tail = np.zeros(len(cmap.uv), dtype=np.int64)
    by_tail[cmap.surface.faces.ravel()[rim]] = gained[rim]
    return by_tail


def _sides_of_loop(cmap: ConformalMap, lattice: Lattice, loop: int, gained: Ints) -> Sides:
    corner = corners_of(curvatures(cmap, loop), lattice)
    shift = int(np.argmax(corner))
    vertices = np.roll(cmap.surface.loops[loop], -shift)
    corner = np.roll(corner, -shift)
    corner[0] = True
    sheet = np.concatenate([[0], np.cumsum(gained[vertices])])
    vertices = np.append(vertices, vertices[0])
    place = cmap.deck.apply(cmap.uv[vertices], sheet)
    at = np.append(np.flatnonzero(corner), len(vertices) - 1)
    step = place[at[1:]] - place[at[:-1]]
    side = np.repeat(np.arange(len(step)), np.diff(at) + 1)
    index = np.concatenate([np.arange(a, b + 1) for a, b in pairwise(at.tolist())])
    return Sides(
        step / abs(step),
        abs(step),
        np.full(len(step), loop),
        np.full(len(step), len(step) == 1),
        vertices[index],
        side,
        sheet[index],
        place[index],
    )


@dataclass(frozen=True)
class Lines:
    """The lines on which vertices must lie, up to two each: normal: (n, 2), unit and inward in the vertex's
    own sheet, 0 where there is none. side: (n, 2) to which they belong, −1 where there is none. sheet: (n,
    2) on which the side's frame shows the vertex. entry: (n, 2) where the sides list it."""

    normal: Complexes
    side: Ints
    sheet: Ints
    entry: Ints

    def depths(self, depth: Floats, motion: Isometry) -> Floats:
        """(n, 2) depth of each line from 0 in the vertex's own sheet; depth: (s,) of the sides in the frame
        of their loop."""
        zero = np.zeros((*self.sheet.shape, 2), dtype=np.int64)
        shift = motion.lattice.position(motion.apply(zero, self.sheet))
        turn = np.exp(1j * motion.lattice.step_angle * motion.rotation(self.sheet))
        own = depth[self.side] - ((self.normal * turn).conj() * shift).real
        return np.asarray(np.where(self.side >= 0, own, 0.0))


def lines_of(n: int, sides: Sides, normal: Complexes, motion: Isometry) -> Lines:
    """normal: (s,) of the sides in the frame of their loop. motion: any with the right rotation."""
    own = normal[sides.side] / np.exp(1j * motion.lattice.step_angle * motion.rotation(sides.sheet))
    # Of the lines listed for a vertex each once: a closed one comes twice, one of several features again.
    order = np.argsort(sides.vertex, kind="stable")
    vertex = sides.vertex[order]
    once = np.ones(len(order), dtype=bool)
    for step in range(1, int(np.bincount(vertex).max(initial=1))):
        same = vertex[step:] == vertex[:-step]
        once[step:] &= ~(same & (abs(own[order][step:] - own[order][:-step]) < RELATIVE))
    order, vertex = order[once], vertex[once]
    again = np.arange(len(vertex)) - np.searchsorted(vertex, vertex)
    normals, side, sheet = (
        np.zeros((n, 2), dtype=complex),
        np.full((n, 2), -1),
        np.zeros((n, 2), dtype=np.int64),
    )
    normals[vertex, again] = own[order]
    side[vertex, again] = sides.side[order]
    sheet[vertex, again] = sides.sheet[order]
    entry = np.zeros_like(side)
    entry[vertex, again] = order
    return Lines(normals, side, sheet, entry)
