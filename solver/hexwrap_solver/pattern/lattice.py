"""Regular tilings in integers, and the motions that carry them to themselves.

Cells and nodes of a tiling are points of one ring of integers ℤ[ζ], ζ = e^{iπ/3} (hexagons, triangles) or
ζ = i (quads), told apart by their coset, the residue modulo √−3 (three cosets) or 1 + i (two):

    hexagons    cell centres: coset 0      nodes: cosets 1, 2     edges: units ζ^j
    triangles   cell centres: cosets 1, 2  nodes: coset 0         edges: (1 + ζ)·ζ^j
    quads       cell centres: coset 1      nodes: coset 0         edges: (1 + i)·i^j

An isometry p ↦ ζ^k p + τ with τ of coset 0 keeps the coset 0 and so the tiling; its fixed points are exactly
the centres of 6-, 3-, 2- or 4-fold symmetry that k allows (paper, definition 2). All of it is exact.

An isometry is a row (k, a, b, w): k modulo the order of ζ, τ = a + bζ, and w, an integer that adds up under
composition and acts on nothing. On annuli it counts turns around the surface, which k and τ cannot tell where
a power of the deck transformation is the identity; elsewhere it is 0.
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

    order: of the unit ζ. cosets: number of residues. first_step: an edge as a lattice vector, direction 0.
    turn: directions by which a face on the left turns left at each of its corners. sides: of a cell.
    """

    kind: Kind
    order: int
    cosets: int
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
        """(2, 2) generators e1, e2 = ζ·e1 of the points of coset 0, the tiling's translations."""
        first = np.array([1, 1])
        return np.stack([first, self.rotations[1] @ first])

    def rotate(self, points: Ints, j: Ints | int) -> Ints:
        """ζ^j · points."""
        turned = self.rotations[np.asarray(j) % self.order] @ np.asarray(points)[..., None]
        return np.asarray(turned[..., 0])

    def compose(self, outer: Ints, inner: Ints) -> Ints:
        """(…, 4) the isometries p ↦ outer(inner(p))."""
        result = outer + inner
        turned = outer[..., 0] != 0
        if turned.any():
            result[..., 0] %= self.order
            turned = turned & ((inner[..., 1] | inner[..., 2]) != 0)
            rows, steps = np.broadcast_to(outer, result.shape), np.broadcast_to(inner, result.shape)
            moved = self.rotate(steps[turned][:, 1:3], rows[turned][:, 0])
            result[turned, 1:3] = rows[turned][:, 1:3] + moved
        return np.asarray(result)

    def invert(self, isometry: Ints) -> Ints:
        """(…, 4) the inverse isometries."""
        result = -isometry
        turned = result[..., 0] != 0
        if turned.any():
            result[..., 0] %= self.order
            result[turned, 1:3] = self.rotate(result[turned][:, 1:3], result[turned][:, 0])
        return np.asarray(result)

    def apply(self, isometry: Ints, points: Ints) -> Ints:
        """(…, 2) images of points (…, 2) under isometries (…, 4)."""
        turn = isometry[..., 0]
        moved = self.rotate(points, turn) if turn.any() else points
        return np.asarray(moved + isometry[..., 1:3])

    def carry(self, isometry: Ints, places: Complexes) -> Complexes:
        """(…) images of places of the plane under isometries (…, 4)."""
        shape = np.broadcast_shapes(np.shape(places), isometry.shape[:-1])
        isometry = np.broadcast_to(isometry, (*shape, 4))
        result = np.broadcast_to(places, shape).astype(complex)
        moved = (isometry[..., 0] | isometry[..., 1] | isometry[..., 2]) != 0  # few: the others stay
        k, a, b, _ = isometry[moved].T
        turn = np.exp(1j * self.quantum * np.arange(self.order))[k]
        result[moved] = turn * result[moved] + (a + b * self.unit)
        return result

    def partial_products(self, isometry: Ints) -> Ints:
        """(n + 1, 4) the products of the first 0, 1, …, n of (n, 4) isometries, the first one outermost."""
        products = np.zeros((len(isometry) + 1, 4), dtype=np.int64)
        products[1:] = isometry
        known = 1  # after each round, products[i] is that of the last ``known`` factors up to i
        while known < len(products):
            products[known:] = self.compose(products[:-known], products[known:])
            known *= 2
        return products

    def coset(self, points: Ints) -> Ints:
        a, b = points[..., 0], points[..., 1]
        return np.asarray((a - b) % 3 if self.order == 6 else (a + b) % 2)

    def is_node(self, points: Ints) -> Bools:
        coset = self.coset(points)
        return np.asarray(coset != 0 if self.kind == "hex" else coset == 0)

    def has_edge(self, nodes: Ints, direction: Ints) -> Bools:
        """Whether an edge leaves a node in a direction: at a node of hexagons every second one does."""
        if self.kind != "hex":
            return np.ones(np.broadcast_shapes(nodes.shape[:-1], np.shape(direction)), dtype=bool)
        return np.asarray((self.coset(nodes) + direction) % 2 == 1)

    def position(self, points: Ints) -> Complexes:
        """Where points stand in the plane."""
        return np.asarray(points[..., 0] + points[..., 1] * self.unit)

    def coordinates(self, positions: Complexes) -> Floats:
        """(…, 2) real coordinates (a, b) of places in the plane."""
        b = np.imag(positions) / self.unit.imag
        return np.stack([np.real(positions) - b * self.unit.real, b], axis=-1)

    def translation_near(self, wanted: complex) -> Ints:
        """(2,) the translation of the tiling nearest to a vector of the plane."""
        return np.asarray(self.translations_near(np.array([wanted]))[0])

    def translations_near(self, wanted: Complexes) -> Ints:
        """(k, 2) those nearest to vectors (k,)."""
        e1 = complex(self.position(self.basis[0]))
        start = np.floor(self.coordinates(wanted / e1)).astype(np.int64)
        corners = (start[:, None] + np.array([[0, 0], [1, 0], [0, 1], [1, 1]])) @ self.basis
        best = abs(self.position(corners) - wanted[:, None]).argmin(axis=1)
        return np.asarray(corners[np.arange(len(wanted)), best])

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

    def period_along(self, direction: complex) -> float:
        """Length of the shortest translation along an edge or across a corner."""
        return float(abs(complex(self.position(self.shortest_towards(direction)))))

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
class Isometry:
    """The deck transformation of an annulus on integers: G(p) = ζ^turns · p + shift, shift of coset 0.

    turns counts the quanta of the cone angle and is not reduced; shift: (a, b)."""

    lattice: Lattice
    turns: int
    shift: tuple[int, int]

    @cached_property
    def _first(self) -> Ints:
        """(period, 4) the powers G^0, G^1, … until the rotation repeats; w counts them."""
        lattice, order = self.lattice, self.lattice.order
        once = np.array([self.turns % order, *self.shift, 1])
        rows = [np.zeros(4, dtype=np.int64)]
        for _ in range(order // int(np.gcd(self.turns, order)) - 1):
            rows.append(lattice.compose(rows[-1], once))
        return np.stack(rows)

    def power(self, s: Ints) -> Ints:
        """(…, 4) G^s as isometries, see the module."""
        s = np.asarray(s)
        result = np.zeros((*s.shape, 4), dtype=np.int64)
        moved = s != 0  # few: only the triangles at the cut leave their sheet
        period = len(self._first)
        rows = self._first[s[moved] % period]
        if period == 1:
            rows[..., 1:3] = s[moved][..., None] * np.array(self.shift)
        rows[..., 3] = s[moved]
        result[moved] = rows
        return result

    def rotation(self, s: Ints) -> Ints:
        """By how many units ζ the power G^s turns, modulo the order."""
        return np.asarray(self.turns * np.asarray(s)) % self.lattice.order

    def carry(self, places: Complexes, s: Ints) -> Complexes:
        """G^s for places of the plane."""
        return self.lattice.carry(self.power(s), places)

    def apply(self, points: Ints, s: Ints) -> Ints:
        """G^s(points), s broadcast over the points."""
        return self.lattice.apply(self.power(s), points)
