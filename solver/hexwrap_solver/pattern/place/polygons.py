"""Loops of a net that are polygons of quantized corners, or closed straight lines: on which lattice lines.

A loop is unrolled from its first corner on: every boundary edge is carried by the motions met on the way
around the loop into the frame of the first one. There each side has one direction of the lattice and one
depth; a vertex on it must keep to the line that this is in the vertex's own coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.place.rows import rows_along
from hexwrap_solver.pattern.place.sides import corners_of, curvatures
from hexwrap_solver.surface.topology import next_half_edge
from hexwrap_solver.tolerances import ANGLE, TINY


@dataclass(frozen=True)
class Polygons:
    """Sides of loops of a net, in the frames of the loops, z being places of the domain.

    loop: (s,) of each side. direction: (s,) unit complex; middle: (s,) mean place of its vertices; length:
    (s,). half_edge: (k,) boundary half-edges of all sides, in order; side: (k,) of each. starts: per loop,
    position of its first half-edge. words: motions met from each half-edge to the next, see ``_rounds``.
    closed: per loop that is one straight line, its first side and the motions met once around it, in order.
    """

    loops: list[int]
    loop: Ints
    direction: Complexes
    middle: Complexes
    length: Floats
    half_edge: Ints
    side: Ints
    starts: Ints
    words: list[tuple[Ints, Ints]]
    closed: list[tuple[int, Ints]]

    @classmethod
    def of(cls, cmap: ConformalMap, lattice: Lattice, loops: list[int]) -> Polygons:
        """loops: polygons, see ``sides.is_polygon``."""
        surface, net = cmap.surface, cmap.net
        tail = surface.faces.ravel()
        leaving = np.full(len(surface.vertices), -1, dtype=np.int64)
        rim = np.flatnonzero(surface.twin < 0)
        leaving[tail[rim]] = rim
        parts = []
        for loop in loops:
            corner = corners_of(curvatures(cmap, loop), lattice)
            shift = int(np.argmax(corner))
            half_edge = leaving[np.roll(surface.loops[loop], -shift)]
            corner = np.roll(corner, -shift)
            straight = not corner.any()
            corner[0] = True
            words = _rounds(net.across.ravel(), net.crossing.ravel(), surface.twin, half_edge)
            # In order along the loop, and around each vertex in that of the rounds.
            order = np.argsort(np.concatenate([which for which, _ in words]), kind="stable")
            met = np.concatenate([crossing for _, crossing in words])[order]
            turn, shift_ = np.ones(len(half_edge), dtype=complex), np.zeros(len(half_edge), dtype=complex)
            for which, crossing in words:
                shift_[which] += turn[which] * net.translation[crossing]
                turn[which] *= np.exp(1j * net.angle[crossing])
            before = np.concatenate([[1], np.cumprod(turn)[:-1]])
            moved = np.concatenate([[0], np.cumsum(before * shift_)[:-1]])
            z = net.corners.ravel()
            start = before * z[half_edge] + moved
            end = before * z[next_half_edge(half_edge)] + moved
            side = np.cumsum(corner) - 1
            at = np.append(np.flatnonzero(corner), len(half_edge))
            step = np.array([end[b - 1] - start[a] for a, b in pairwise(at.tolist())])
            weight = abs(end - start)
            middle = np.bincount(side, weight * (start + end).real / 2) + 1j * np.bincount(
                side, weight * (start + end).imag / 2
            )
            once = met if straight else met[:0]
            parts.append((half_edge, side, step, middle / np.bincount(side, weight), words, once))
        sizes = [len(part[0]) for part in parts]
        sides = [len(part[2]) for part in parts]
        first, low = np.cumsum([0, *sizes]), np.cumsum([0, *sides])
        none = np.zeros(0, dtype=np.int64)
        step = np.concatenate([none, *(part[2] for part in parts)])
        return cls(
            loops,
            np.repeat(np.array(loops, dtype=np.int64), sides),
            step / np.maximum(abs(step), TINY),
            np.concatenate([none, *(part[3] for part in parts)]),
            abs(step),
            np.concatenate([none, *(part[0] for part in parts)]),
            np.concatenate([none, *(part[1] + n for part, n in zip(parts, low, strict=False))]),
            first[:-1],
            [(which + n, c) for part, n in zip(parts, first, strict=False) for which, c in part[4]],
            [(int(n), part[5]) for part, n in zip(parts, low, strict=False) if len(part[5])],
        )

    @property
    def n(self) -> int:
        return len(self.length)

    def unit(self, lattice: Lattice, zero: complex) -> complex:
        """The rotation after which directions are best those of the lattice, ``zero`` being one of them."""
        mean = complex((self.length * self.direction**lattice.fold).sum())
        return zero / complex(np.exp(1j * np.angle(mean) / lattice.fold))

    def normals(self, lattice: Lattice, zero: complex) -> Complexes:
        """(s,) inward, in the directions of the lattice."""
        steps = np.rint(np.angle(self.direction * self.unit(lattice, zero) / zero) / lattice.quantum)
        return np.asarray(1j * zero * np.exp(1j * lattice.quantum * steps))


@dataclass(frozen=True)
class Alignment:
    """What polygons want of the lattice. normal: (s,) of their sides; first, period: of the lines."""

    lattice: Lattice
    polygons: Polygons
    normal: Complexes
    unit: complex
    first: float
    period: float

    @classmethod
    def of(cls, polygons: Polygons, lattice: Lattice, angle: float, boundary: str) -> Alignment:
        zero = complex(lattice.forward * np.exp(-1j * angle))
        rows = rows_along(lattice, angle, boundary)
        return cls(
            lattice,
            polygons,
            polygons.normals(lattice, zero),
            polygons.unit(lattice, zero),
            rows.first,
            rows.period,
        )

    def along(self) -> list[tuple[Ints, Ints]]:
        """Motions whose product must be a translation by a multiple of a lattice vector (2,): what is met
        once around each closed line."""
        return [
            (word, self.lattice.shortest_towards(complex(-1j * self.normal[side])))
            for side, word in self.polygons.closed
        ]

    def misfit(self, A: Complexes, B: Complexes) -> Floats:
        """(k,) mean distance of the sides from their nearest lines, for places of the lattice (k,)."""
        depth = (self.normal.conj() * (A[:, None] * self.polygons.middle + B[:, None])).real
        off = depth - self._nearest(depth)
        return np.asarray(abs(off) @ self.polygons.length / self.polygons.length.sum())

    def _nearest(self, depth: Floats) -> Floats:
        return np.asarray(self.first + self.period * np.rint((depth - self.first) / self.period))

    def lines(self, rows: Ints, own: Ints, place: Complexes, faces: Ints) -> tuple[Complexes, Floats]:
        """normal, depth: (n, 2) of up to two lines per vertex in its own coordinates, 0 where there
        is none.

        rows: (t, 4) what the motions are. own: (m, 3, 4) from vertices' coordinates to those of corners.
        place: (n,) where vertices would stand undeformed.
        """
        lattice, poly = self.lattice, self.polygons
        step = np.zeros((len(poly.half_edge), 4), dtype=np.int64)
        for which, crossing in poly.words:
            step[which] = lattice.compose(step[which], rows[crossing])
        bounds = [*poly.starts.tolist(), len(poly.half_edge)]
        frame = np.concatenate(
            [lattice.partial_products(step[a:b])[:-1] for a, b in pairwise(bounds)]
            or [np.zeros((0, 4), dtype=np.int64)]
        )
        flat, corner = own.reshape(-1, 4), faces.ravel()
        head = next_half_edge(poly.half_edge)
        to_loop = lattice.compose(np.tile(frame, (2, 1)), flat[np.concatenate([poly.half_edge, head])])
        vertex = corner[np.concatenate([poly.half_edge, head])]
        side = np.tile(poly.side, 2)
        depth = (self.normal[side].conj() * lattice.carry(to_loop, place[vertex])).real
        line = self._nearest(np.bincount(side, depth) / np.bincount(side))[side]
        turn = np.exp(1j * lattice.step_angle * to_loop[:, 0])
        normal = self.normal[side] / turn
        line = line - (self.normal[side].conj() * lattice.position(to_loop[:, 1:3])).real
        found, at = np.zeros((len(place), 2), dtype=complex), np.zeros((len(place), 2))
        _, once = np.unique(vertex, return_index=True)
        found[vertex[once], 0], at[vertex[once], 0] = normal[once], line[once]
        other = abs(normal - found[vertex, 0]) > ANGLE
        found[vertex[other], 1], at[vertex[other], 1] = normal[other], line[other]
        return found, at


def _rounds(across: Ints, crossing: Ints, twin: Ints, half_edge: Ints) -> list[tuple[Ints, Ints]]:
    """The motions met on the way from each boundary half-edge around its head to the next, in rounds:
    (which of them, motion)."""
    found: list[tuple[Ints, Ints]] = [(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))]
    at = next_half_edge(half_edge)
    turning = np.arange(len(half_edge))
    while len(turning):
        turning = turning[across[at[turning]] >= 0]
        met = crossing[at[turning]]
        if met.any():
            found.append((turning[met != 0], met[met != 0]))
        at[turning] = next_half_edge(twin[at[turning]])
    return found
