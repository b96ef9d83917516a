"""Tilings in integers, and the motions that carry them to themselves.

A pattern is described by integers. Its points are those of one ring ℤ[ζ], ζ = e^{iπ/3} or ζ = i; its
translations are the multiples of one element, the ``period`` g; its symmetries are p ↦ ζ^k p + τ, τ a
translation, k a multiple of order/fold. Nodes and edges are orbits under these symmetries, given by one edge
(tail, head) of each. The residue of a point modulo g says all about it: whether it is a node, in which
directions its edges leave, and so which cells lie between them.

    kind                  ring      period      edges (tail → head)            cells round the origin
    hex                   ζ⁶ = 1    1 + ζ       1 → ζ                          hexagon
    triangle                        1 + ζ       0 → 1 + ζ                      (a node)
    trihexagonal                    2           1 → ζ                          hexagon
    truncated-hexagonal             3 + 3ζ      2 + ζ → 1 + 2ζ, 2 + ζ → 4      dodecagon
    rhombitrihexagonal              5           1 + ζ → −1 + 2ζ, → 3 + ζ       hexagon
    quad                  ζ⁴ = 1    1 + i       0 → 1 + i                      (a node)
    diamond                         1 + i       the same, on its corner        (a node)
    brick (fold 2)                  2 + 2i      i → 2 + i → 4 + i, 2 + i → 2 − i  rectangle
    truncated-square                4           2 + i → 2 − i, 2 + i → 1 + 2i  octagon

Each cell is a walk along edges that takes the first edge clockwise at every node. Where regular cells cannot
have their corners in points of the ring (dodecagons, octagons), one node is given its true ``place`` and all
others follow by symmetry: integers say which node is meant, places where it stands, and a motion carries the
place of a node to the place of its image.

The origin is the place where singularities may stand, unless ``centre`` says another: the highest symmetry.
A singularity of index k leaves order − k of the sectors around it: a cell there has that many parts of its
sides, a node that many parts of its edges.

An isometry is a row (k, a, b, w): k modulo the order of ζ, τ = a + bζ, and w, an integer that adds up under
composition and acts on nothing. On annuli it counts turns around the surface, which k and τ cannot tell where
a power of the deck transformation is the identity; elsewhere it is 0. All of it is exact (definition 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints
from hexwrap_solver.pattern.types import Kind
from hexwrap_solver.tolerances import RELATIVE

Point = tuple[int, int]


@dataclass(frozen=True)
class Lattice:
    """A point a + bζ is the integer pair (a, b); arrays of points have shape (…, 2).

    order: of the unit ζ. fold: of the pattern's own rotations, which divides it. period: g. edges: (tail,
    head), one of each orbit. along: the direction that lies along the boundary where ``rotation`` is "edge".
    lines: for boundaries in that direction, and in the one half a rotation of the pattern further: the depth
    of the first line for whole and for trimmed cells, and the distance of the lines; see ``Rows``. place:
    (node, where it stands), None where all stand at their points. centre: a point at which singularities may
    stand. counted: the cells that ``around`` counts: per translation along one of ``beside``, which leads to
    the cells next to one of them, as multiples (x, y) of g and ζg, counter-clockwise over half a turn.
    """

    kind: Kind
    order: int
    fold: int
    period: Point
    edges: tuple[tuple[Point, Point], ...]
    along: Point
    lines: tuple[tuple[float, float, float], tuple[float, float, float]]
    place: tuple[Point, complex] | None = None
    centre: Point = (0, 0)
    counted: int = 1
    beside: tuple[Point, ...] = ((1, 0), (0, 1), (-1, 1))

    @property
    def quantum(self) -> float:
        """Cone angles must be multiples of it (paper, definition 2)."""
        return 2 * np.pi / self.fold

    @property
    def step_angle(self) -> float:
        """Angle of ζ, by which isometries count rotations: the quantum or a part of it."""
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
    def roots_of_unity(self) -> Complexes:
        """(order,) ζ^j."""
        return np.asarray(np.exp(1j * self.step_angle * np.arange(self.order)))

    @cached_property
    def basis(self) -> Ints:
        """(2, 2) generators g, ζg of the tiling's translations."""
        first = np.array(self.period)
        return np.stack([first, self.rotations[1] @ first])

    @cached_property
    def _norm(self) -> int:
        """|g|², also the number of residues modulo g."""
        a, b = self.period
        return a * a + b * b + (a * b if self.order == 6 else 0)

    def residue(self, points: Ints) -> Ints:
        """(…) a number that points have in common if and only if a translation carries one to the other."""
        a, b = points[..., 0], points[..., 1]
        c, d = self.period
        c, d = (c + d, -d) if self.order == 6 else (c, -d)  # the conjugate: g·conj(g) = |g|²
        x, y = a * c - b * d, a * d + b * c + (b * d if self.order == 6 else 0)
        return np.asarray((x % self._norm) * self._norm + y % self._norm)

    @cached_property
    def _every_edge(self) -> Ints:
        """(e, 2, 2) tail and step of all edges up to translations."""
        given = np.array(self.edges)
        tail, step = given[:, 0], given[:, 1] - given[:, 0]
        tail, step = np.concatenate([tail, tail + step]), np.concatenate([step, -step])
        turned = range(0, self.order, self.order // self.fold)
        pairs = np.concatenate(
            [np.stack([self.rotate(tail, j), self.rotate(step, j)], axis=1) for j in turned]
        )
        names = np.concatenate([self.residue(pairs[:, 0])[:, None], pairs[:, 1]], axis=1)
        return np.asarray(pairs[np.unique(names, axis=0, return_index=True)[1]])

    @cached_property
    def steps(self) -> Ints:
        """(d, 2) edges as vectors, counter-clockwise by direction, evenly spread over the turn; rotation by ζ
        takes each to the one d/order further."""
        turned = [self.rotate(self._every_edge[:, 1], j) for j in range(self.order)]
        steps = np.unique(np.concatenate(turned), axis=0)
        turn = np.round(np.angle(self.position(steps)) / (2 * np.pi), 9) % 1
        return np.asarray(steps[np.argsort(turn)])

    @property
    def directions(self) -> int:
        return len(self.steps)

    @property
    def steps_per_turn(self) -> int:
        """Directions by which ζ turns."""
        return self.directions // self.order

    @cached_property
    def headings(self) -> Complexes:
        """(d,) unit vectors of the directions."""
        first = complex(self.position(self.steps[0]))
        return np.asarray(
            first / abs(first) * np.exp(2j * np.pi * np.arange(self.directions) / self.directions)
        )

    @cached_property
    def _leads(self) -> Bools:
        """(residues, d) whether an edge leaves a point of that residue in a direction."""
        every, steps = self._every_edge, self.steps
        direction = (every[:, 1][:, None] == steps).all(axis=2).argmax(axis=1)
        leads = np.zeros((self._norm**2, len(steps)), dtype=bool)
        leads[self.residue(every[:, 0]), direction] = True
        return leads

    @cached_property
    def ways(self) -> Ints:
        """(residues, most) the directions of the edges at a point, counter-clockwise, then −1."""
        degree = self._leads.sum(axis=1)
        ways = np.where(self._leads, np.arange(self.directions), self.directions)
        ways = np.sort(ways, axis=1)[:, : int(degree.max())]
        return np.asarray(np.where(ways == self.directions, -1, ways))

    @cached_property
    def slots(self) -> Ints:
        """(residues, d) which of ``ways`` each direction is, −1: none."""
        return np.asarray(np.where(self._leads, np.cumsum(self._leads, axis=1) - 1, -1))

    def is_node(self, points: Ints) -> Bools:
        return np.asarray(self.ways[self.residue(points), 0] >= 0)

    def has_edge(self, points: Ints, direction: Ints) -> Bools:
        """Whether an edge leaves points (…, 2) in a direction (…)."""
        return np.asarray(self._leads[self.residue(points), direction])

    @cached_property
    def _offsets(self) -> Complexes | None:
        """(residues,) where nodes stand, less their points."""
        if self.place is None:
            return None
        node, place = np.array(self.place[0]), self.place[1]
        offsets = np.zeros(self._norm**2, dtype=complex)
        off = place - complex(self.position(node))
        for j in range(0, self.order, self.order // self.fold):
            offsets[self.residue(self.rotate(node, j))] = off * self.roots_of_unity[j]
        return offsets

    @cached_property
    def largest_offset(self) -> float:
        """How far a node stands from its point at most."""
        return 0.0 if self._offsets is None else float(abs(self._offsets).max())

    def position(self, points: Ints) -> Complexes:
        """Points of the ring as places of the plane."""
        return np.asarray(points[..., 0] + points[..., 1] * self.unit)

    def stand(self, nodes: Ints) -> Complexes:
        """Where nodes stand in the plane."""
        place = self.position(nodes)
        return place if self._offsets is None else np.asarray(place + self._offsets[self.residue(nodes)])

    @cached_property
    def forward(self) -> complex:
        """Unit vector of ``along``."""
        along = complex(self.position(np.array(self.along)))
        return along / abs(along)

    @cached_property
    def edge(self) -> float:
        """Length of every edge in lattice units."""
        tail, step = self._every_edge[0]
        return float(abs(self.stand(tail + step) - self.stand(tail)))

    @cached_property
    def outlines(self) -> dict[int, Complexes]:
        """By number of corners, (p,) the cells with that many as polygons of the plane, edges of length 1."""
        found: dict[int, Complexes] = {}
        for start, step in self._every_edge:
            outline = self.cell(start, step)
            found.setdefault(len(outline), self.stand(np.array(outline)) / self.edge)
        return found

    @cached_property
    def centred(self) -> dict[int, Complexes]:
        """The same around 0."""
        return {p: outline - outline.mean() for p, outline in self.outlines.items()}

    def uneven_outline(self, sides: int) -> Floats | None:
        """(sides, 2) corners, about their mean, of a cell that is not a regular polygon; else None."""
        outline = self.outlines[sides]
        edge = np.roll(outline, -1) - outline
        if np.ptp((np.roll(edge, -1) / edge).real) < RELATIVE:
            return None
        about = self.centred[sides]
        return np.stack([about.real, about.imag], axis=1)

    def cell(self, start: Ints, step: Ints) -> list[Ints]:
        """The nodes around the cell to the left of an edge."""
        corners, at = [start], start
        way = int((self.steps == step).all(axis=1).argmax())
        while True:
            at = at + self.steps[way]
            if (at == start).all():
                return corners
            corners.append(at)
            leads = self._leads[self.residue(at)]
            way = (way + self.directions // 2 - 1) % self.directions
            while not leads[way]:
                way = (way - 1) % self.directions

    @cached_property
    def sides(self) -> int:
        """Corners of the largest kind of cell."""
        return max(self.outlines)

    @cached_property
    def every_cell(self) -> list[Complexes]:
        """The corners of all cells up to translations."""
        every = [self.stand(np.array(self.cell(start, step))) for start, step in self._every_edge]
        middles = np.array([cell.mean() for cell in every]) / complex(self.position(self.basis[0]))
        _, first = np.unique(np.rint(self.coordinates(middles) % 1 * 1e6) % 1e6, axis=0, return_index=True)
        return [every[i] for i in first]

    @cached_property
    def middles(self) -> Complexes:
        """(k,) the middles of all cells up to translations."""
        return np.array([cell.mean() for cell in self.every_cell])

    @cached_property
    def sides_around_middles(self) -> Ints:
        """(k,) corners of those cells."""
        return np.array([len(cell) for cell in self.every_cell])

    @cached_property
    def cell_area(self) -> float:
        """Mean area of a cell in square lattice units."""
        around = [1 / len(self.cell(start, step)) for start, step in self._every_edge]
        return self._norm * float(np.sin(self.step_angle)) / round(sum(around))

    @cached_property
    def sides_at_centre(self) -> int:
        """Corners of the cell at whose middle singularities stand, 0 where they stand on a node."""
        for start, step in self._every_edge:
            outline = np.array(self.cell(start, step))
            if len(outline) % self.fold == 0 and self.is_centre(self.stand(outline).mean()):
                return len(outline)
        return 0

    def is_centre(self, places: Complexes) -> Bools:
        """Whether singularities may stand at places of the plane."""
        off = np.asarray(places) - complex(self.position(np.array(self.centre)))
        nearest = np.rint(self.coordinates(off)).astype(np.int64)
        return np.asarray((abs(self.position(nearest) - off) < 1e-6) & (self.residue(nearest) == 0))

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
        turn = self.roots_of_unity[k]
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

    @cached_property
    def _measures(self) -> Ints:
        """(2b, 2) rows (m, n) such that mx + ny is 1 for both translations of each sector of ``beside``."""
        half = np.array(self.beside)
        ring = np.concatenate([half, -half])
        following = np.roll(ring, -1, axis=0)
        det = ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0]
        rows = np.stack([following[:, 1] - ring[:, 1], ring[:, 0] - following[:, 0]], axis=1)
        return np.asarray(rows // det[:, None])

    def cells_along(self, x: Floats | Ints, y: Floats | Ints) -> Ints | Floats:
        """(…) cells in a shortest ring along xg + yζg; also of a part of a translation."""
        rows = self._measures
        return np.asarray(self.counted * np.max([m * x + n * y for m, n in rows.tolist()], axis=0))

    def ring_near(self, around: int, direction: complex) -> Ints:
        """Of all translations with that number of cells around, the nearest in direction."""
        distance = max(1, round(around / self.counted))
        half = np.array(self.beside)
        ring = np.concatenate([half, -half]) @ self.basis
        turned = np.angle(self.position(ring) / direction)
        sector = int(np.argmax(np.where(turned <= 1e-12, turned, -np.inf)))
        first, side = ring[sector], ring[(sector + 1) % len(ring)] - ring[sector]
        steps = np.arange(distance + 1)[:, None]
        points = distance * first + steps * side
        return np.asarray(points[np.argmin(abs(np.angle(self.position(points) / direction)))])

    def cells_around(self, translation: Ints) -> Ints:
        """Cells in a shortest closed ring of neighbouring cells once around along a translation."""
        e1 = self.position(self.basis[0])
        x, y = np.moveaxis(np.rint(self.coordinates(self.position(translation) / e1)).astype(np.int64), -1, 0)
        return np.asarray(self.cells_along(x, y), dtype=np.int64)


ROOT = 3**0.5
#: Edges of regular dodecagons that cut corners off hexagons of edge 3; half an edge of octagons 4 wide; the
#: radius of hexagons 5 apart with squares between them.
_DODECAGON, _OCTAGON, _HEXAGON = 3 / (1 + 2 / ROOT), 2 * np.tan(np.pi / 8), 5 / (1 + ROOT)
_SQUARES: tuple[Point, ...] = ((1, 0), (0, 1))

LATTICES: dict[Kind, Lattice] = {
    "hex": Lattice("hex", 6, 6, (1, 1), (((1, 0), (0, 1)),), (1, 0), ((0.0, 0.0, ROOT / 2), (0.5, 0.0, 1.5))),
    "triangle": Lattice(
        "triangle",
        6,
        6,
        (1, 1),
        (((0, 0), (1, 1)),),
        (1, 1),
        ((0.0, 0.0, 1.5), (0.0, 0.0, ROOT / 2)),
        counted=2,
    ),
    "quad": Lattice(
        "quad",
        4,
        4,
        (1, 1),
        (((0, 0), (1, 1)),),
        (1, 1),
        ((0.0, 0.0, 2**0.5), (0.0, 0.0, 1.0)),
        centre=(1, 0),
        beside=_SQUARES,
    ),
    "diamond": Lattice(
        "diamond",
        4,
        4,
        (1, 1),
        (((0, 0), (1, 1)),),
        (1, 0),
        ((0.0, 0.0, 1.0), (0.0, 0.0, 2**0.5)),
        centre=(1, 0),
        beside=_SQUARES,
    ),
    "brick": Lattice(
        "brick",
        4,
        2,
        (2, 2),
        (((0, 1), (2, 1)), ((2, 1), (4, 1)), ((2, 1), (2, -1))),
        (1, 0),
        ((1.0, 1.0, 2.0), (0.0, 0.0, 2.0)),
    ),
    "trihexagonal": Lattice(
        "trihexagonal",
        6,
        6,
        (2, 0),
        (((1, 0), (0, 1)),),
        (1, 0),
        ((ROOT / 2, ROOT / 2, ROOT), (0.0, 0.0, 1.0)),
    ),
    "truncated-hexagonal": Lattice(
        "truncated-hexagonal",
        6,
        6,
        (3, 3),
        (((2, 1), (1, 2)), ((2, 1), (4, 0))),
        (1, 0),
        ((0.0, 0.0, 1.5 * ROOT), (1.5 + _DODECAGON / (2 * ROOT), 0.0, 4.5)),
        place=((4, 0), 3 + _DODECAGON / ROOT),
    ),
    "truncated-square": Lattice(
        "truncated-square",
        4,
        4,
        (4, 0),
        (((2, 1), (2, -1)), ((2, 1), (1, 2))),
        (1, 0),
        ((2.0, 2.0, 4.0), (8**0.5 - 2, 0.0, 8**0.5)),
        place=((2, 1), complex(2, _OCTAGON)),
        beside=_SQUARES,
    ),
    "rhombitrihexagonal": Lattice(
        "rhombitrihexagonal",
        6,
        6,
        (5, 0),
        (((1, 1), (-1, 2)), ((1, 1), (3, 1))),
        (1, 0),
        ((2.5 * ROOT - _HEXAGON, 0.0, 2.5 * ROOT), (2.5 - _HEXAGON * ROOT / 2, 0.0, 2.5)),
        place=((1, 1), _HEXAGON * (ROOT + 1j) / 2),
    ),
}


@dataclass(frozen=True)
class Isometry:
    """The deck transformation of an annulus on integers: G(p) = ζ^cone_index · p + shift, shift of coset 0.

    cone_index counts the quanta of the cone angle and is not reduced; shift: (a, b)."""

    lattice: Lattice
    cone_index: int
    shift: tuple[int, int]

    @cached_property
    def _first(self) -> Ints:
        """(period, 4) the powers G^0, G^1, … until the rotation repeats; w counts them."""
        lattice, order = self.lattice, self.lattice.order
        once = np.array([self.cone_index % order, *self.shift, 1])
        rows = [np.zeros(4, dtype=np.int64)]
        for _ in range(order // int(np.gcd(self.cone_index, order)) - 1):
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
        return np.asarray(self.cone_index * np.asarray(s)) % self.lattice.order

    def carry(self, places: Complexes, s: Ints) -> Complexes:
        """G^s for places of the plane."""
        return self.lattice.carry(self.power(s), places)

    def apply(self, points: Ints, s: Ints) -> Ints:
        """G^s(points), s broadcast over the points."""
        return self.lattice.apply(self.power(s), points)
