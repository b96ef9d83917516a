"""Singularities moved until the pattern closes up around every one of them and around every loop.

Cut open along a tree, the surface is laid out in the plane; across each branch of the cut stands a motion.
All of these must be symmetries of one lattice. Deforming the layout until they are would strain it at the
singularities; instead these move on the surface, by less than a cell each, and u varies a little along free
loops (a dipole each), so that the map stays conformal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints, Progress, no_progress, positions
from hexwrap_solver.conformal.energy import Corners, corner_angles, opposite_lengths, total
from hexwrap_solver.conformal.layout import FaceTree, develop
from hexwrap_solver.conformal.types import Targets
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.linalg.integers import nearest_integers
from hexwrap_solver.singularities.cut import Branches, branches
from hexwrap_solver.singularities.drag import Grip, dragged, grips
from hexwrap_solver.singularities.linear import targets, vertex_areas
from hexwrap_solver.singularities.solvable import solvable
from hexwrap_solver.singularities.types import End
from hexwrap_solver.surface.topology import next_half_edge
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.tolerances import RELATIVE, TINY

#: Units of the unknowns beside moves by a cell: a dipole's amplitude, a uniform stretch, a turn of the
#: lattice, a change of its scale.
DIPOLE, STRETCH, TURN, SCALE = 0.15, 0.002, 0.1, 0.02
#: Largest move in one step, cells; steps of Newton's method; residuals at which it ends, and which are
#: accepted.
STRIDE, STEPS, DONE, ACCEPTED = 0.6, 40, 1e-11, 1e-9
#: A step beyond which there is no map is halved at most so often.
HALVINGS = 2
#: Differences for the Jacobian, in units, to each of which the map is linear.
DIFFERENCE = 1e-3
#: Residual of the angle sums that will do on the way, radians per cell that is left to close.
ROUGH = 1e-7
#: Chord steps of the inner Newton's method, each of which must leave at most this part of the residual
#: until it is down to rounding, radians.
CHORDS, CHORD_GAIN, SMALL = 60, 0.3, 1e-12
#: Rotations and scales of the lattice that are tried where nothing is aligned.
TURNS, SCALES = 48, 9
#: Where the scale may change by more than the first, only so many places have their integers searched.
WIDE, FEW = 0.2, 8


@dataclass(frozen=True)
class Line:
    """Straight loops that are to be lattice lines: the shortest translation along one, and at which depths
    ≡ first (mod period), inwards from a cell's centre, they may lie; in widths of a cell."""

    step: complex
    first: float
    period: float


@dataclass(frozen=True)
class Holonomy:
    """image: (e,) M(c) − c of every leaf's motion M, c being the root's place; turn: (e,) quanta by which M
    turns. foot: per straight loop a point of it less c, and heading its direction."""

    image: Complexes
    turn: Ints
    center: complex
    foot: Complexes
    heading: Complexes


@dataclass(frozen=True)
class Seen:
    """The map at some moves. place: (3, m) the layout. residual: of the angle sums, radians. lengths,
    metric: (3, m) of the flat triangles."""

    surface: Surface
    u: Floats
    place: Complexes
    holonomy: Holonomy
    residual: float
    lengths: Floats
    metric: Corners


class Chart:
    """The map as a function of moves, dipoles and stretch; connectivity and cut stay the same."""

    def __init__(
        self,
        surface: Surface,
        cones: Ints,
        index: Ints,
        loops: tuple[int, ...],
        ends: tuple[End, ...],
        quantum: float,
        cell: float,
        slope: Callable[[Surface], Floats] | None = None,
        angles: Floats | None = None,
    ) -> None:
        """The first cone is the root of the cut. angles: see ``targets``. slope: (m, 3) squared sine of
        every half-edge's angle to the horizontal, in which direction a stretch is allowed; None: none is.
        The surface gets more vertices where its triangles cannot follow the map. Raises ConvergenceError."""
        self._targets = partial(targets, ends=ends, loops=loops, quantum=quantum, index=index)
        self._angles = angles
        self.energy, surface, found = solvable(surface, lambda one: self._wanted(one, cones))
        self.surface, self.index, self.cell = surface, index, cell
        self.quantum, self.ends = quantum, ends
        pairs = list(zip(surface.loops, ends, strict=True))
        self.waves = [_waves(surface, loop) for loop, end in pairs if end == "free"]
        self.straight = [_rim(surface, loop) for loop, end in pairs if end == "straight"]
        self.slope = None if slope is None else np.ascontiguousarray(slope(surface).T[[1, 2, 0]])
        self.area = vertex_areas(surface)
        self.factor = found.factorisation
        self._seat(cones, self.energy.unknowns_of(found.u), found.corners)

    def _wanted(self, surface: Surface, cones: Ints) -> Targets:
        return self._targets(surface, vertex=cones, angles=extended(self._angles, surface))

    def _seat(self, cones: Ints, x: Floats, corners: Corners) -> None:
        """x, corners: the map with the singularities at these vertices."""
        surface = self.surface
        self.cones = cones
        self.cut: Branches = branches(surface, int(cones[0]), cones[1:], tuple(surface.loops))
        self.tree = FaceTree.of(self.cut.twin)
        self.hold: list[Grip] = grips(surface, cones, self.cell)
        self.factor.factorise(*self.energy.hessian(corners))
        self._x, self._at = x, np.zeros(self.unknowns)
        self._response: Floats | None = None  # (n_dof, unknowns) of the energy's unknowns to those here
        self._root = int(np.flatnonzero(surface.faces.ravel() == cones[0])[0])

    def reseated(self, cones: Ints) -> Chart | None:
        """The same map with the singularities at other vertices, from this one, which is used up; None where
        that does not lead there."""
        other = copy(self)
        other.energy = self.energy.aimed_at(self._wanted(self.surface, cones))
        _, _, other.energy.lengths = self._given(np.zeros(self.unknowns))
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                _, corners, _ = other._solve(self._x, 0.0)
        except ConvergenceError:
            return None
        other._seat(cones, other._x, corners)
        return other

    @property
    def unknowns(self) -> int:
        return 2 * len(self.cones) + 2 * len(self.waves) + (self.slope is not None)

    def _given(self, x: Floats) -> tuple[Surface, Floats, Floats]:
        """The surface with its mesh dragged, (n,) the dipoles' part of u, (3, m) lengths with both."""
        s, d = 2 * len(self.cones), 2 * len(self.waves)
        surface = dragged(self.surface, self.hold, x[:s].reshape(-1, 2) * self.cell)
        factor = np.zeros(len(surface.vertices))
        for (loop, wave), amplitude in zip(self.waves, DIPOLE * x[s : s + d].reshape(-1, 2), strict=True):
            factor[loop] += wave @ amplitude
        half = np.exp(factor / 2)[self.energy.corner]
        lengths = opposite_lengths(surface.vertices, surface.faces) * half[[1, 2, 0]] * half[[2, 0, 1]]
        if self.slope is not None:
            lengths *= self._stretched(x[-1])
        return surface, factor, lengths

    def at(self, x: Floats, enough: float = 0.0) -> Seen:
        """x: (unknowns,) moves of each singularity in cells, dipoles and stretch in their units. enough:
        residual of the angle sums that will do, 0: rounding."""
        surface, factor, self.energy.lengths = self._given(x)
        start = self._x
        if self._response is not None:
            start = start + self._response @ (x - self._at)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # where there is no map
            u, corners, residual = self._solve(start, enough)
        self._at = x.copy()
        shift = self._mean(u + factor)
        flat_lengths = self.energy.scaled_lengths(u - shift)
        place = develop(self.tree, flat_lengths, corners)
        holonomy = self._holonomy(place.T.ravel())
        return Seen(surface, u + factor - shift, place, holonomy, residual, flat_lengths, corners)

    def _mean(self, u: Floats) -> float:
        return float(self.area @ u / self.area.sum())

    def small_steps(self, step: float) -> list[Holonomy]:
        """What is seen after a step of each unknown from 0, where the map must be the last one that was
        found: by one step of Newton's method for all of them together."""
        energy, base, x = self.energy, self.energy.lengths, self._x
        u = energy.scale_of(x)
        scale, angle = np.exp((u.mean() - u) / 2), energy.corners(u).angle
        given, right = list(self._changes(step)), np.empty((energy.n_dof, self.unknowns))
        for i, (_, face, lengths) in enumerate(given):
            corner = energy.corner[:, face]
            more = corner_angles(lengths * scale[corner]).angle - angle[:, face]
            right[:, i] = energy.reduce(total(corner.ravel(), more.ravel(), energy.n))
        response = self.factor.solve(right)
        self._response = response / step
        seen, tree = self._surroundings()
        corner, flat = energy.corner[:, seen], np.full((len(self.surface.faces), 3), np.nan, dtype=complex)
        found = []
        for i, (factor, face, lengths) in enumerate(given):
            u = energy.scale_of(x + response[:, i])
            u -= self._mean(u + factor)
            half = np.exp(u / 2)[corner]
            changed = base.copy()
            changed[:, face] = lengths
            flat_lengths = changed[:, seen] * half[[1, 2, 0]] * half[[2, 0, 1]]
            flat[seen] = develop(tree, flat_lengths, corner_angles(flat_lengths)).T
            found.append(self._holonomy(flat.ravel()))
        return found

    def _changes(self, step: float) -> Iterator[tuple[Floats | float, Ints, Floats]]:
        """For a step of each unknown from 0 what it changes: the dipoles' part of u, and the lengths (3, k)
        of which faces (k,)."""
        surface, base, n = self.surface, self.energy.lengths, len(self.surface.vertices)
        for grip in self.hold:
            face = self._around(grip.vertex)
            for moved in grip.moved(surface, step * self.cell):
                yield 0.0, face, opposite_lengths(moved, surface.faces[face])
        for loop, wave in self.waves:
            face = self._around(loop)
            for along in wave.T:
                factor = np.zeros(n)
                factor[loop] = DIPOLE * step * along
                half = np.exp(factor / 2)[self.energy.corner[:, face]]
                yield factor, face, base[:, face] * half[[1, 2, 0]] * half[[2, 0, 1]]
        if self.slope is not None:
            yield 0.0, np.arange(len(surface.faces)), base * self._stretched(step)

    def _around(self, vertex: Ints) -> Ints:
        """Faces at these vertices."""
        marked = np.zeros(len(self.surface.vertices), dtype=bool)
        marked[vertex] = True
        return np.flatnonzero(marked[self.surface.faces].any(axis=1))

    def _stretched(self, x: float) -> Floats:
        """(3, m) factors of the lengths."""
        assert self.slope is not None
        return np.asarray(np.sqrt(1 + ((1 + STRETCH * x) ** 2 - 1) * self.slope))

    def _surroundings(self) -> tuple[Ints, FaceTree]:
        """The faces along the cut and the straight loops, and those that lead there from the tree's root;
        and a tree of them."""
        ways = np.concatenate([np.zeros(0, dtype=np.int64), *self.cut.ways])
        edges = np.concatenate([[self._root, 0], ways, self.surface.twin[ways], *self.straight])
        needed, here = np.zeros(len(self.surface.faces), dtype=bool), np.unique(edges // 3)
        while len(here):
            needed[here] = True
            here = np.unique(self.tree.parent[here])
            here = here[~needed[here]]
        face = np.flatnonzero(needed)
        new = positions(face, len(needed))
        twin = self.cut.twin.reshape(-1, 3)[face].ravel()
        inside = (twin >= 0) & (new[twin // 3] >= 0)
        return face, FaceTree.of(np.where(inside, 3 * new[twin // 3] + twin % 3, -1))

    def _holonomy(self, flat: Complexes) -> Holonomy:
        """flat: (3m,) the layout."""
        center = complex(flat[self._root])
        image, turn = self._images(flat, center)
        rims = [(flat[h], flat[next_half_edge(h)]) for h in self.straight]
        foot = np.array([complex((start + end).mean() / 2) - center for start, end in rims])
        heading = np.array([complex((end - start).sum()) for start, end in rims])
        return Holonomy(image, turn, center, foot, heading)

    def _solve(self, x: Floats, enough: float) -> tuple[Floats, Corners, float]:
        """Newton's method from x; the Hessian is factorised again where it has aged."""
        energy = self.energy
        corners = energy.corners(energy.scale_of(x))
        gradient = energy.gradient(corners)
        residual, fresh = float(np.abs(gradient).max()), False
        for _ in range(CHORDS):
            if residual <= enough:
                break
            trial = x - self.factor.solve(gradient)
            seen = energy.corners(energy.scale_of(trial))
            new = energy.gradient(seen)
            after = float(np.abs(new).max())
            good = after < residual and not seen.violating.any()
            gain = after / max(residual, TINY)
            if good:
                x, corners, gradient, residual = trial, seen, new, after
            if residual <= SMALL and gain > CHORD_GAIN:
                break
            if good and (fresh or gain <= CHORD_GAIN):
                fresh = False
                continue
            if fresh:
                break
            try:
                self.factor.factorise(*energy.hessian(corners))
            except np.linalg.LinAlgError:  # the energy is flat where triangles break
                break
            fresh = True
        if not residual <= max(enough, ACCEPTED):  # nor where it is NaN
            raise ConvergenceError(
                "The map breaks down where the singularities have to move for the pattern to close: ask for "
                "smaller cells, or another number of singularities."
            )
        self._x = x
        return energy.scale_of(x), corners, residual

    def _images(self, flat: Complexes, center: complex) -> tuple[Complexes, Ints]:
        """flat: (3m,) the layout."""
        images, turns = [], []
        for way in self.cut.ways:
            there = self.surface.twin[way]
            one, other = flat[way], flat[next_half_edge(way)]
            across_other, across_one = flat[there], flat[next_half_edge(there)]
            angle = float(np.angle(((other - one) / (across_other - across_one)).sum()))
            turn = round(angle / self.quantum)
            rho = np.exp(1j * turn * self.quantum)
            shift = complex((one + other - rho * (across_one + across_other)).mean() / 2)
            images.append(rho * center + shift - center)
            turns.append(turn)
        return np.array(images, dtype=complex), np.array(turns, dtype=np.int64)


def extended(angles: Floats | None, surface: Surface) -> Floats | None:
    """Target angles of new vertices, too: on a loop they are straight."""
    if angles is None:
        return None
    return np.concatenate([angles, np.full(len(surface.vertices) - len(angles), np.pi)])


def _waves(surface: Surface, loop: Ints) -> tuple[Ints, Floats]:
    """(k,) a loop and (k, 2) cosine and sine along its length."""
    step = np.linalg.norm(surface.vertices[np.roll(loop, -1)] - surface.vertices[loop], axis=1)
    along = 2 * np.pi * (np.cumsum(step) - step) / step.sum()
    return loop, np.stack([np.cos(along), np.sin(along)], axis=1)


def _rim(surface: Surface, loop: Ints) -> Ints:
    """The loop's boundary half-edges."""
    on = np.zeros(len(surface.vertices), dtype=bool)
    on[loop] = True
    rim = np.flatnonzero(surface.twin < 0)
    return rim[on[surface.faces.ravel()[rim]]]


@dataclass(frozen=True)
class Closed:
    """seen: the chart on which the lattice lies. factor, shift: z ↦ factor · z + shift carries it to the
    lattice whose translations are ℤ[ζ]. unstretched: the map, whose faces the chart has; the same but for
    the stretch. motion: (e, 2) translation of each leaf's motion there. moves: (s,) cells;
    dipole: the largest amplitude; stretch: ε. residual: cells."""

    seen: Seen
    unstretched: Seen
    factor: complex
    shift: complex
    motion: Ints
    moves: Floats
    dipole: float
    stretch: float
    residual: float
    steps: int


def near_lattice(z: Complexes, order: int) -> Ints:
    """(…, 2) integers (a, b), a + bζ being nearest to each z."""
    zeta = np.exp(2j * np.pi / order)
    b = z.imag / zeta.imag
    a = z.real - b * zeta.real
    low = np.stack([np.floor(a), np.floor(b)], axis=-1)
    every = low[..., None, :] + np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
    off = np.abs(every[..., 0] + every[..., 1] * zeta - z[..., None])
    return np.asarray(
        np.take_along_axis(every, off.argmin(-1)[..., None, None], -2)[..., 0, :], dtype=np.int64
    )


def as_complex(points: Ints, order: int) -> Complexes:
    return np.asarray(points[..., 0] + points[..., 1] * np.exp(2j * np.pi / order))


@dataclass(frozen=True)
class Goal:
    """Wanted values of the equations: images as complex numbers, then depths."""

    factor: complex
    image: Complexes
    depth: Floats
    cost: float


class Closing:
    """Newton's method for a chart: factor · image must be translations of the lattice, and straight loops
    lie on its lines."""

    def __init__(
        self,
        chart: Chart,
        width: float,
        line: Line | None = None,
        free_scale: float = 0.05,
        aligned: tuple[bool, ...] | None = None,
    ) -> None:
        """width: of a cell in the domain; it may change by the share ``free_scale``. line: None leaves
        straight loops where they come. aligned: per loop, whether it is to be a line; None: straight ones."""
        self.chart, self.width, self.free_scale = chart, width, free_scale
        straight = [end == "straight" for end in chart.ends]
        on_line = straight if aligned is None else [a and b for a, b in zip(aligned, straight, strict=True)]
        self.line = line if any(on_line) else None
        self.lines = np.flatnonzero(np.array(on_line, dtype=bool)[np.array(straight, dtype=bool)])
        self.order = round(2 * np.pi / chart.quantum)
        self.zeta = complex(np.exp(1j * chart.quantum))
        self.base = chart.at(np.zeros(chart.unknowns)).holonomy
        s = len(chart.cones) - 1
        loops = [-1] * s + [-2 if self.line is None or not on else -3 for on in on_line]
        kind = np.array(loops, dtype=np.int64)
        # Of the motions around all leaves and the root one follows from the others.
        spare = np.flatnonzero(kind == -2)
        if not len(spare) and self.order == 6:
            spare = np.flatnonzero((kind == -1) & (np.abs(np.append(chart.index[1:], 0 * kind[s:])) == 1))
        keep = np.ones(len(kind), dtype=bool)
        if len(spare):
            keep[spare[-1]] = False
        self.kept = np.flatnonzero(keep)
        self.aligned = kind[self.kept] == -3
        # A cone's motion turns about a cell's centre for multiples of 1 − ζ^k, all where that is a unit.
        cone = np.arange(len(kind)) < s
        self.divisor = np.where(cone, 1 - self.zeta**self.base.turn, 1.0)[self.kept]

    def depth(self, seen: Holonomy, factor: complex) -> Floats:
        """Of straight loops that are to be aligned, inwards."""
        if self.line is None:
            return np.zeros(0)
        heading, foot = seen.heading[self.lines], seen.foot[self.lines]
        inward = 1j * heading / np.abs(heading)
        return np.asarray(abs(factor) * (inward.conj() * foot).real)

    def _values(self, seen: Holonomy, factor: complex) -> Floats:
        """All equations, real."""
        image = factor * seen.image[self.kept]
        return np.concatenate([image.real, image.imag, self.depth(seen, factor)])

    def _slopes(self, changed: list[Holonomy], factor: complex) -> Floats:
        """(equations, unknowns + 2); the last two: turn and scale of the lattice."""
        here = self._values(self.base, factor)
        columns = [(self._values(seen, factor) - here) / DIFFERENCE for seen in changed]
        for change in (np.exp(1j * TURN * DIFFERENCE), np.exp(SCALE * DIFFERENCE)):
            columns.append((self._values(self.base, factor * change) - here) / DIFFERENCE)
        return np.stack(columns, axis=1)

    def start(self, changed: list[Holonomy]) -> Goal:
        """The place of the lattice, and the integers there, that ask for the least moves."""
        factors = self._factors()
        if self.line is None:
            factors = [self._least(changed, np.array(factors))]
        elif self.free_scale > WIDE:
            factors = self._nearest(np.array(factors))
        return min((self._goal(changed, factor) for factor in factors), key=lambda goal: goal.cost)

    def _nearest(self, factors: Complexes) -> list[complex]:
        """Of many places of the lattice a few from which translations are nearest as they are."""
        wanted = factors[:, None] * self.base.image[self.kept]
        nearest = near_lattice(wanted / self.divisor, self.order) @ self.zeta ** np.arange(2) * self.divisor
        off = (abs(nearest - wanted) ** 2).sum(axis=1)
        return list(factors[np.argsort(off, kind="stable")[:FEW]].tolist())

    def _least(self, changed: list[Holonomy], factors: Complexes) -> complex:
        """Of many places of the lattice the one whose nearest translations ask for the least moves."""
        image = self.base.image[self.kept]
        inverse = np.linalg.pinv(self._slopes(changed, 1.0), rcond=RELATIVE)
        wanted = factors[:, None] * image
        zeta = self.zeta ** np.arange(2)
        nearest = near_lattice(wanted / self.divisor, self.order) @ zeta * self.divisor
        off = (nearest - wanted) / factors[:, None]
        moves = inverse @ np.concatenate([off.real, off.imag], axis=1).T
        cost = (moves**2).sum(axis=0) + self._cost_of_scale(factors)
        return complex(factors[cost.argmin()])

    def _cost_of_scale(self, factor: Complexes | complex) -> Floats:
        return np.asarray(0.02 * (np.log(np.abs(factor) * self.width) / SCALE) ** 2)

    def _factors(self) -> list[complex]:
        most = self.free_scale
        if self.line is not None:
            at = int(self.kept[np.flatnonzero(self.aligned)[0]])
            around = abs(self.base.image[at]) / (self.width * abs(self.line.step))
            numbers = range(
                max(1, int(np.ceil(around * np.exp(-most)))), max(1, int(np.floor(around * np.exp(most)))) + 1
            )
            every = list(numbers) or [max(1, round(around))]
            return [complex(k * self.line.step / self.base.image[at]) for k in every]
        scales = np.exp(np.linspace(-most, most, SCALES if most else 1))
        turns = np.arange(TURNS) / TURNS * self.chart.quantum
        return [complex(np.exp(1j * turn) / (self.width * scale)) for scale in scales for turn in turns]

    def _goal(self, changed: list[Holonomy], factor: complex) -> Goal:
        """The integers nearest in moves."""
        here = self._values(self.base, factor)
        slopes = self._slopes(changed, factor)
        steps, rest = self._lattice(factor)
        inverse = np.linalg.pinv(slopes, rcond=RELATIVE)
        weighted = inverse @ steps
        centre = np.linalg.lstsq(weighted, inverse @ (here - rest), rcond=None)[0]
        z, _ = nearest_integers(
            np.asarray(weighted.T @ weighted, dtype=float), np.asarray(centre, dtype=float)
        )
        wanted = steps @ z + rest
        moves = inverse @ (wanted - here)
        cost = float(moves @ moves + self._cost_of_scale(factor))
        e = len(self.kept)
        return Goal(factor, wanted[:e] + 1j * wanted[e : 2 * e], wanted[2 * e :], cost)

    def _lattice(self, factor: complex) -> tuple[Floats, Floats]:
        """(equations, integers) and (equations,): the admissible values are steps @ z + rest."""
        e, columns = len(self.kept), []
        depths = len(self.lines) if self.line is not None else 0
        for i in range(e):
            units = [self.divisor[i], self.divisor[i] * self.zeta]
            if self.aligned[i] and self.line is not None:
                towards = factor * self.base.image[self.kept[i]] / self.line.step
                turn = round(float(np.angle(towards)) / self.chart.quantum)
                units = [self.line.step * self.zeta**turn]
            for unit in units:
                column = np.zeros(2 * e + depths)
                column[i], column[e + i] = complex(unit).real, complex(unit).imag
                columns.append(column)
        rest = np.zeros(2 * e + depths)
        for i in range(depths):
            assert self.line is not None
            column = np.zeros(2 * e + depths)
            column[2 * e + i] = self.line.period
            columns.append(column)
            rest[2 * e + i] = self.line.first
        return np.array(columns, dtype=float).reshape(len(columns), len(rest)).T, rest

    def _stepped(self, x: Floats, step: Floats, enough: float) -> tuple[Floats, Seen]:
        """The step, halved until the map of the moved singularities is found, and that map."""
        for _ in range(HALVINGS):
            try:
                return step, self.chart.at(x + step[:-2], enough)
            except ConvergenceError:
                step = step / 2
        return step, self.chart.at(x + step[:-2], enough)

    @cached_property
    def _linear(self) -> tuple[complex, Floats, Floats]:
        """Place of the lattice, wanted values of the equations there, and their slopes."""
        changed = self.chart.small_steps(DIFFERENCE)
        goal = self.start(changed)
        wanted = np.concatenate([goal.image.real, goal.image.imag, goal.depth])
        return goal.factor, wanted, self._slopes(changed, goal.factor)

    @cached_property
    def moves(self) -> Floats:
        """(s, 2) cells, by which the singularities would have to move if the map were linear in them."""
        factor, wanted, slopes = self._linear
        step = np.linalg.lstsq(slopes, wanted - self._values(self.base, factor), rcond=RELATIVE)[0]
        return np.asarray(step[: 2 * len(self.chart.cones)].reshape(-1, 2), dtype=np.float64)

    @property
    def places(self) -> Floats:
        """(s, 3) where they would come to stand then."""
        chart = self.chart
        moved = dragged(chart.surface, chart.hold, chart.cell * self.moves)
        return np.asarray(moved.vertices[chart.cones], dtype=np.float64)

    def solve(self, progress: Progress = no_progress) -> Closed:
        """Raises ConvergenceError where it does not close."""
        chart = self.chart
        factor, wanted, slopes = self._linear
        x, seen = np.zeros(chart.unknowns), None
        off = wanted - self._values(self.base, factor)
        best, steps, s = float(np.abs(off).max(initial=0.0)), 0, 2 * len(chart.cones)
        for _ in range(STEPS):
            if best <= DONE:
                break
            d: Floats = np.linalg.lstsq(slopes, off, rcond=RELATIVE)[0].astype(np.float64)
            stride = float(np.hypot(d[0:s:2], d[1:s:2]).max())
            d *= min(1.0, STRIDE / max(stride, TINY))
            d, new_seen = self._stepped(x, d, ROUGH * best)
            new_x, new_factor = x + d[:-2], factor * complex(np.exp(1j * TURN * d[-2] + SCALE * d[-1]))
            new_off = wanted - self._values(new_seen.holonomy, new_factor)
            slopes = slopes + np.outer(off - new_off - slopes @ d, d) / (d @ d)  # Broyden 1965
            residual = float(np.abs(new_off).max())
            progress(0.5, f"singularities close to {residual:.1e} cells")
            if residual > 0.5 * best and best <= ACCEPTED:
                break
            steps += 1
            x, factor, seen, off, best = new_x, new_factor, new_seen, new_off, residual
        if seen is None or seen.residual > SMALL:
            seen = chart.at(x)
        every = factor * seen.holonomy.image
        motion = near_lattice(every, self.order)
        residual = max(best, float(np.abs(every - as_complex(motion, self.order)).max()))
        if residual > ACCEPTED:
            raise ConvergenceError(
                f"The singularities could not be moved so that the pattern closes: {residual:.1e} cells are "
                "left. Another size of the cells or another number of singularities may do."
            )
        w = s + 2 * len(chart.waves)
        dipole = float(np.hypot(x[s:w:2], x[s + 1 : w : 2]).max(initial=0.0)) * DIPOLE
        stretch = STRETCH * float(x[-1]) if chart.slope is not None else 0.0
        unstretched = chart.at(np.append(x[:-1], 0.0)) if stretch else seen
        moves = np.hypot(x[0:s:2], x[1:s:2])
        return Closed(
            seen,
            unstretched,
            factor,
            -factor * seen.holonomy.center,
            motion,
            moves,
            dipole,
            stretch,
            residual,
            steps,
        )
