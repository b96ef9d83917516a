"""The unrolled domain as lines: cells, boundary loops, the cut. For drawings of it, in its own units."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints, Ragged
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.domain.apart import Apart, apart
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.pipeline import Solution

#: Two places are one where they are nearer than this part of the domain's size.
SAME = 1e-6


@dataclass(frozen=True)
class Unrolled:
    """A mesh laid out face by face.

    start, end: (3m,) the sides of all faces, three each. loops: per boundary loop its sides in order, each
    starting at the loop's vertex. cut: sides along the cut, both banks of it.
    """

    start: Complexes
    end: Complexes
    loops: tuple[Ints, ...]
    cut: Ints

    @classmethod
    def of(cls, cmap: ConformalMap) -> Unrolled:
        faces, at = cmap.surface.faces, cmap.corners()
        tail, head = faces.ravel(), faces[:, [1, 2, 0]].ravel()
        start, end = at.ravel(), at[:, [1, 2, 0]].ravel()
        boundary = np.flatnonzero(cmap.net.across.ravel() < 0)
        side = np.full(len(cmap.surface.vertices), -1)
        side[tail[boundary]] = boundary
        banks = np.flatnonzero(cmap.net.crossing.ravel())
        near = SAME * float(np.ptp(at.real) + np.ptp(at.imag))
        loops = tuple(side[loop] for loop in cmap.surface.loops)
        return cls(start, end, loops, _chained(banks, tail, head, start, end, near))

    def lines(self, sides: Ints) -> list[Complexes]:
        """The sides in the given order as polylines: a new one wherever a side starts elsewhere."""
        start, end = self.start[sides], self.end[sides]
        size = max(float(np.ptp(self.start.real)), float(np.ptp(self.start.imag)))
        breaks = np.flatnonzero(np.abs(start[1:] - end[:-1]) > SAME * size) + 1
        return [
            np.append(part, end[last])
            for part, last in zip(np.split(start, breaks), np.append(breaks, len(start)) - 1, strict=True)
            if len(part)
        ]


def _chained(sides: Ints, tail: Ints, head: Ints, start: Complexes, end: Complexes, near: float) -> Ints:
    """The sides in such an order that each starts where the one before it ends, as far as there is one."""
    leaving: dict[int, list[int]] = {}
    for side in sides.tolist():
        leaving.setdefault(int(tail[side]), []).append(side)
    following: dict[int, int] = {}
    for side in sides.tolist():
        for other in leaving.get(int(head[side]), []):
            if abs(start[other] - end[side]) < near:
                following[side] = other
    starts = sorted(set(sides.tolist()) - set(following.values()))
    ordered: dict[int, None] = {}
    for first in [*starts, *sorted(sides.tolist())]:  # what is left after the starts runs in circles
        at: int | None = first
        while at is not None and at not in ordered:
            ordered[at] = None
            at = following.get(at)
    return np.array(list(ordered), dtype=np.int64)


def drawn(cmap: ConformalMap) -> tuple[ConformalMap, Apart | None]:
    """The map on the domain as it is drawn: in pieces beside each other where it overlaps itself."""
    pieces = apart(cmap)
    return (cmap if pieces is None else pieces.moved(cmap)), pieces


def in_pieces(solution: Solution) -> Solution:
    """The solution as clients see it: a net that overlaps itself is one of pieces beside each other, where
    each place is one point of the surface. Cylinders and cones are told by their uv, on any sheet."""
    return moved_to(pieces_of_net(solution.map), solution)


def pieces_of_net(cmap: ConformalMap) -> Apart | None:
    """Those of a net; None of cylinders and cones, too."""
    return apart(cmap) if cmap.kind == "net" else None


def moved_to(pieces: Apart | None, solution: Solution) -> Solution:
    """The solution, its net being in these pieces."""
    laid = solution.pattern
    if pieces is None:
        return solution
    if laid is not None:
        uv = laid.uv + pieces.shift[pieces.piece[laid.triangle]]
        laid = replace(laid, uv=uv, corners=moved_corners(laid, pieces))
    return replace(solution, map=pieces.moved(solution.map), pattern=laid)


def moved_corners(pattern: Pattern, pieces: Apart) -> Complexes:
    """(·,) corners of the cells, each cell whole and beside its first corner."""
    return np.asarray(pattern.corners + pieces.shift[piece_of_cells(pattern, pieces)][pattern.faces.row])


def cells(pattern: Pattern, pieces: Apart | None = None) -> Ragged:
    """(·, 2) outlines of the cells."""
    corners = pattern.corners if pieces is None else moved_corners(pattern, pieces)
    return Ragged(plane(corners), pattern.faces.offsets)


def piece_of_cells(pattern: Pattern, pieces: Apart) -> Ints:
    """(c,) the piece in which each cell is drawn."""
    first = pattern.faces.values[pattern.faces.offsets[:-1]]
    return np.asarray(pieces.piece[pattern.triangle[first]])


def plane(z: Complexes) -> Floats:
    """(…, 2) real and imaginary parts."""
    return np.stack([z.real, z.imag], axis=-1)
