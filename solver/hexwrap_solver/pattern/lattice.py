"""Regular tilings in integers, and the motions that carry them to themselves.

Cells and nodes of a tiling are points of one ring of integers ℤ[ζ], ζ = e^{iπ/3} (hexagons, triangles) or
ζ = i (quads), told apart by their colour, the residue modulo √−3 (three colours) or 1 + i (two):

    hexagons    cell centres: colour 0      nodes: colours 1, 2     edges: units ζ^j
    triangles   cell centres: colours 1, 2  nodes: colour 0         edges: (1 + ζ)·ζ^j
    quads       cell centres: colour 1      nodes: colour 0         edges: (1 + i)·i^j

A motion p ↦ ζ^k p + τ with τ of colour 0 keeps the colour 0 and so the tiling; its fixed points are exactly
the centres of 6-, 3-, 2- or 4-fold symmetry that k allows (paper, definition 2). All of it is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints
from hexwrap_solver.pattern.types import Kind


@dataclass(frozen=True)
class Lattice:
    """A point a + bζ is the integer pair (a, b); arrays of points have shape (…, 2).

    order: of the unit ζ. colours: number of residues. first_step: an edge as a lattice vector, direction 0.
    turn: directions by which a face on the left turns left at each of its corners. sides: of a cell.
    """

    kind: Kind
    order: int
    colours: int
    first_step: tuple[int, int]
    turn: int
    sides: int

    @property
    def quantum(self) -> float:
        """Cone angles must be multiples of it (paper, definition 2)."""
        return 2 * np.pi / self.order

    @property
    def unit(self) -> complex:
        return complex(np.exp(2j * np.pi / self.order))

    @cached_property
    def rotations(self) -> Ints:
        """(order, 2, 2) multiplication by ζ^j as integer matrices."""
        by_unit = np.array([[0, -1], [1, 1 if self.order == 6 else 0]], dtype=np.int64)
        powers = [np.eye(2, dtype=np.int64)]
        for _ in range(self.order - 1):
            powers.append(by_unit @ powers[-1])
        return np.stack(powers)

    @cached_property
    def steps(self) -> Ints:
        """(order, 2) edge vectors by direction."""
        return np.asarray(self.rotations @ np.array(self.first_step))

    @cached_property
    def edge(self) -> float:
        """Length of an edge in lattice units."""
        return float(abs(self.position(self.steps[0])))

    @cached_property
    def cell_area(self) -> float:
        """Area of a cell in square lattice units."""
        return {"hex": 1.5 * 3**0.5, "triangle": 0.75 * 3**0.5, "quad": 2.0}[self.kind]

    @cached_property
    def basis(self) -> Ints:
        """(2, 2) generators e1, e2 = ζ·e1 of the points of colour 0, the tiling's translations."""
        first = np.array([1, 1])
        return np.stack([first, self.rotations[1] @ first])

    def rotate(self, points: Ints, j: Ints | int) -> Ints:
        """ζ^j · points."""
        turned = self.rotations[np.asarray(j) % self.order] @ np.asarray(points)[..., None]
        return np.asarray(turned[..., 0])

    def colour(self, points: Ints) -> Ints:
        a, b = points[..., 0], points[..., 1]
        return np.asarray((a - b) % 3 if self.order == 6 else (a + b) % 2)

    def is_node(self, points: Ints) -> Bools:
        colour = self.colour(points)
        return np.asarray(colour != 0 if self.kind == "hex" else colour == 0)

    def has_edge(self, nodes: Ints, direction: Ints) -> Bools:
        """Whether an edge leaves a node in a direction: at a node of hexagons every second one does."""
        if self.kind != "hex":
            return np.ones(np.broadcast_shapes(nodes.shape[:-1], np.shape(direction)), dtype=bool)
        return np.asarray((self.colour(nodes) + direction) % 2 == 1)

    def position(self, points: Ints) -> Complexes:
        """Where points stand in the plane."""
        return np.asarray(points[..., 0] + points[..., 1] * self.unit)

    def coordinates(self, positions: Complexes) -> Floats:
        """(…, 2) real coordinates (a, b) of places in the plane."""
        b = np.imag(positions) / self.unit.imag
        return np.stack([np.real(positions) - b * self.unit.real, b], axis=-1)

    def translation_near(self, wanted: complex) -> Ints:
        """The translation of the tiling nearest to a vector of the plane."""
        e1 = complex(self.position(self.basis[0]))
        start = np.floor(self.coordinates(np.array(wanted / e1))).astype(np.int64)
        corners = (start + np.array([[0, 0], [1, 0], [0, 1], [1, 1]])) @ self.basis
        return np.asarray(corners[np.argmin(abs(self.position(corners) - wanted))])

    def without_translations(self, offset: complex) -> complex:
        """The same offset up to a translation of the tiling, near 0: small ones stay as they are."""
        return offset - complex(self.position(self.translation_near(offset)))

    def primitive(self, translation: Ints) -> Ints:
        """The shortest translation of the same direction."""
        e1 = complex(self.position(self.basis[0]))
        x, y = np.rint(self.coordinates(self.position(translation) / e1)).astype(np.int64)
        return np.asarray(translation // max(int(np.gcd(x, y)), 1))

    def shortest_towards(self, direction: complex) -> Ints:
        """The shortest translation along an edge or across a corner."""
        every = np.stack(
            [self.rotate(v, j) for v in (self.basis[0], self.basis.sum(axis=0)) for j in range(self.order)]
        )
        return np.asarray(every[np.argmin(abs(np.angle(self.position(every) / direction)))])

    def ring_near(self, around: int, direction: complex) -> Ints:
        """Of all translations with that number of cells around, the nearest in direction."""
        distance = max(1, round(around / (2 if self.kind == "triangle" else 1)))
        e1, side = complex(self.position(self.basis[0])), self.rotate(self.basis[0], 1) - self.basis[0]
        sector = int(np.floor(np.angle(direction / e1) / self.quantum))
        toward = direction / e1 / self.unit**sector
        # 1 + t·(ζ − 1) has the direction of ``toward``; the ring has points at all multiples of 1/distance.
        t = -toward.imag / ((self.unit - 1).conjugate() * toward).imag
        steps = np.clip(int(np.floor(t * distance)) + np.arange(-1, 3), 0, distance)
        ring = self.rotate(distance * self.basis[0] + steps[:, None] * side, sector)
        return np.asarray(ring[np.argmin(abs(np.angle(self.position(ring) / direction)))])

    def cells_around(self, translation: Ints) -> Ints:
        """Cells in a shortest closed ring of edge-adjacent cells once around along a translation."""
        e1 = self.position(self.basis[0])
        x, y = np.moveaxis(np.rint(self.coordinates(self.position(translation) / e1)).astype(np.int64), -1, 0)
        if self.kind == "quad":
            return np.asarray(abs(x) + abs(y))
        steps = np.maximum(np.maximum(abs(x), abs(y)), abs(x + y))
        return np.asarray(2 * steps if self.kind == "triangle" else steps)


LATTICES: dict[Kind, Lattice] = {
    "hex": Lattice("hex", 6, 3, (1, 0), 1, 6),
    "triangle": Lattice("triangle", 6, 3, (1, 1), 2, 3),
    "quad": Lattice("quad", 4, 2, (1, 1), 1, 4),
}


@dataclass(frozen=True)
class Motion:
    """The deck transformation on integers: G(p) = ζ^turns · p + shift, shift of colour 0."""

    lattice: Lattice
    turns: int
    shift: tuple[int, int]

    @cached_property
    def _shifts(self) -> Ints:
        """(order of the rotation, 2) translation parts of G^0, G^1, …"""
        order = self.lattice.order
        period = order // int(np.gcd(self.turns, order))
        shifts = [np.zeros(2, dtype=np.int64)]
        for _ in range(period - 1):
            shifts.append(self.lattice.rotate(shifts[-1], self.turns) + np.array(self.shift))
        return np.stack(shifts)

    def rotation(self, s: Ints) -> Ints:
        """By how many units ζ the power G^s turns, modulo the order."""
        return np.asarray(self.turns * np.asarray(s)) % self.lattice.order

    def carry(self, places: Complexes, s: Ints) -> Complexes:
        """G^s for places of the plane."""
        s = np.asarray(s)
        period = len(self._shifts)
        if period == 1:
            return np.asarray(places + s * complex(self.lattice.position(np.array(self.shift))))
        turned = np.exp(1j * self.lattice.quantum * self.rotation(np.arange(period)))
        return np.asarray(turned[s % period] * places + self.lattice.position(self._shifts)[s % period])

    def apply(self, points: Ints, s: Ints) -> Ints:
        """G^s(points), s broadcast over the points."""
        s = np.asarray(s)
        period = len(self._shifts)
        if period == 1:
            return np.asarray(points + s[..., None] * np.array(self.shift))
        return np.asarray(self.lattice.rotate(points, self.rotation(s)) + self._shifts[s % period])
