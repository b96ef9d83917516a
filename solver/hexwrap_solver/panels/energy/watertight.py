"""The mesh stays whole: panels share their corners, and faces become flat.

What is minimised, lengths relative to the edges:

    E =   the paper's functionals, as they are weighted
        + anchor · ½ ‖x − x₀‖²                      movement from the pattern on the surface
        + evenness · ½ Σ ‖change of the movement from one edge of a cell to the opposite one‖²
        + ½ Σ d⁴ / worst²                           distances d from the surface, the greatest first

subject to flat faces. The last term keeps away waves from row to row, like bellows, by which nets of quads
become flat near any surface; of opposite edges, because nodes that a translation of the pattern takes to
each other lie there, whereas flat hexagons on a saddle need neighbouring corners to move apart.

Faces stay clear of collapsing, folding over and crossing themselves by a barrier, see ``guard``.

Gauss–Newton steps with the heights above the faces' best planes as a penalty, tenfold from stage to stage,
lead near the minimum; Newton's method on the planes alone then makes them flat to rounding, along a short
way. Where the surface is hardly curved in one direction corners may slide far for little, so that steps which
had to be shortened are damped afterwards (Levenberg 1944, Marquardt 1963). Only the planes' equations are
factorised, see ``flat_steps``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from hexwrap_solver.arrays import Floats, Ints, Progress, no_progress
from hexwrap_solver.panels.energy.flat_steps import FlatSteps, summed
from hexwrap_solver.panels.energy.guard import Guard, free_corners
from hexwrap_solver.panels.energy.residuals import bounded, jacobian, residuals
from hexwrap_solver.panels.energy.seen import Seen
from hexwrap_solver.panels.polygons import mean_edges
from hexwrap_solver.panels.types import Weights
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.tolerances import TINY

#: Weights of the plane distances, stage by stage; the surface weighs 1.
FLATNESS: tuple[float, ...] = (1e2, 1e3, 1e4, 1e5, 1e6, 1e8)

#: After this many stages Newton's method is tried; the others follow only where it makes no headway.
USUAL = 5

#: Most Gauss–Newton steps, and the fraction of its energy that a step takes away if another one is to follow
#: in its stage: what is left undone, the next stage does along with its own work. Heavier weights do not help
#: where the planes are most of the energy; there it is less. The first stage has one step.
MOST_STEPS, ENOUGH, LITTLE = 25, 0.6, 0.5

#: The same where nothing is to become flat, and so nothing comes after.
ONLY_STEPS, ONLY_ENOUGH = 15, 1e-4

#: Damping after the first shortened step, relative to the weight of the planes; by how much it falls after
#: full steps, and rises after shortened ones.
DAMPING, EASE, TIGHTEN = 1e-4, 4.0, 4.0

#: Weight of the planes in Newton's method at the end, so large that the rest only chooses among flat meshes.
DECISIVE = 1e9

#: Distances from planes / ℓ below this are rounding; Newton's method takes at most this many steps to it.
FLAT, NEWTON_STEPS = 1e-12, 12

#: Of coordinates, relative to them.
ROUNDING = 1e-15

#: See ``_flattened``.
HEADWAY = 0.3

#: Corners leave the surface by about this / ℓ before the first step. A regular pattern on a saddle can become
#: flat in mirrored ways and balances between them, so that rounding would tip it over, here one way and there
#: the other.
NUDGE = 0.03

#: Cosine of the angle to the normal above which the way to the nearest point leads off a boundary.
ASLANT = 0.7

#: Newton's steps to the place whose interpolated normal leads to a point; barycentric coordinates below that
#: lie outside a face, and normals whose cosine is less are not near each other.
PROJECTIONS, INSIDE, ALIKE = 3, 1e-9, 0.8

#: With the same derivatives at most so many corrections follow a step, as long as each leaves less than this
#: fraction of the energy; and at most this many of Newton's steps follow each other.
CORRECTIONS, CHORDS, WORTH = 4, 8, 0.6

#: Rounds for a step end after so many, or when one changes it by less than this fraction. Eigenvalues of the
#: preconditioned matrix are taken to lie between this and 1; smaller ones are solved for with less.
MOST_ROUNDS, EXACT = 30, 0.1
SLOWEST = 0.2

#: As long as vertices moved less than this / ℓ (root of the mean square), all see the same planes of the
#: surface as before.
NEAR = 0.05

#: A step is halved at most down to this fraction.
SHORTEST = 1e-3


@dataclass(frozen=True)
class Aims:
    """What is asked of the mesh, see the head of this module. worst: distances from the surface / ℓ from
    which on their fourth powers count more than their squares. flat: whether faces must become flat."""

    weights: Weights
    anchor: float
    evenness: float
    worst: float
    flat: bool


#: As near to the surface, and to the pattern on it, as flat faces can be. A movement along the surface costs
#: a tenth of one off it.
NEAREST = Aims(
    Weights(planarity=0.0, angle=0.0, edge=0.0, surface=1.0), anchor=0.1, evenness=0.1, worst=0.1, flat=True
)


def functionals(weights: Weights) -> Aims:
    """The paper's. They know shapes only, and would move the mesh by whole edges without a stronger anchor.
    Faces become flat where planarity has a weight."""
    return Aims(weights, anchor=10.0, evenness=0.1, worst=np.inf, flat=weights.planarity > 0)


@dataclass(frozen=True, eq=False)
class _Group:
    """Cells with the same number of corners. corner: (q, p) pattern vertices; length: (q,) target lengths;
    across: (m, p), applied to corners, those on one edge minus those on the opposite one."""

    corner: Ints
    length: Floats
    regular: bool
    across: Floats
    guard: Guard


class _Soft(NamedTuple):
    """Derivatives (q, r, 3p) of residuals of cells (q,) of a group by their corners (q, p)."""

    cell: Ints
    corner: Ints
    slope: Floats

    def spread(self, residual: Floats, n: int) -> Floats:
        """(n, 3) derivative of half the sum of the squares of residuals (q, r)."""
        share = (residual[:, None] @ self.slope)[:, 0]
        return summed(share.reshape(-1, 3), self.corner.ravel(), n)


@dataclass(frozen=True)
class _State:
    """points: (n, 3). heights: of each bent group, above the cells' planes / ℓ; shapes: residuals of each
    group; pull: (n, 3) gradient of what holds single vertices and of evenness. asked, planes:
    energy of what was asked for, and of the heights, at the stage's weight."""

    points: Floats
    heights: list[Floats]
    shapes: list[Floats]
    pull: Floats
    asked: float
    planes: float

    @property
    def energy(self) -> float:
        return self.asked + self.planes


def minimise_watertight(
    pattern: Pattern,
    length: Floats,
    aims: Aims,
    surface: Surface,
    progress: Progress = no_progress,
) -> tuple[Floats, Floats]:
    """New places (p, 3) of the pattern's vertices, and the energy (what was asked for) after each step.

    length: (cells,) target edge lengths. Angles count in whole cells with the usual number of corners only.
    """
    weights, factor = bounded(aims.weights)
    problem = _Problem(pattern, length, replace(aims, weights=weights), surface)
    points = pattern.vertices
    curve: list[float] = []
    if aims.flat and not problem.flat(points):
        points = points + NUDGE * _nudges(pattern)
    stages, most, enough = FLATNESS, MOST_STEPS, ENOUGH
    if not aims.flat:
        stages, most, enough = (0.0,), ONLY_STEPS, ONLY_ENOUGH
    stage, damping = 0, 0.0
    for step in range(most):
        state = problem.linearise(points, stages[stage], damping)
        if not curve:
            curve.append(state.asked)
        done = 0.9 * max(step / most, stage / len(stages))
        progress(done, f"flatness weight {stages[stage]:.0e}, energy {state.energy:.3e}")
        found, fraction = _search(problem, state)
        if found is not None:
            points = found.points
            curve.append(found.asked)
        shortened = fraction < 1
        damping = max(TIGHTEN * damping, DAMPING * stages[stage]) if shortened else damping / EASE
        gain = 0.0 if found is None else 1 - found.energy / state.energy
        bent = aims.flat and found is not None and found.planes > found.asked
        tired = found is None or (gain < (LITTLE if bent else enough) and not shortened)
        if tired or (aims.flat and not stage):
            stage += 1
            if stage == len(stages):
                break
            flat = _flattened(problem, points, HEADWAY) if stage >= USUAL else points
            if stage >= USUAL and problem.flat(flat):
                points = flat
                break
    if aims.flat and not problem.flat(points):
        progress(0.9, "flattening")
        points = _flattened(problem, points)
    if aims.flat:
        curve.append(problem.at(points).asked)
    energy = np.array(curve)
    return points, factor * energy[np.isfinite(energy)]  # Newton's method may end beyond the barrier


def _search(problem: _Problem, state: _State) -> tuple[_State | None, float]:
    """A state of less energy, None where none was found, and the fraction of the step that leads there.

    Faces turn as they move, so that a long step leaves their planes. More steps from where the first one
    ends, with the same derivatives and so without another factorisation, lead back to them (second-order
    correction; Fletcher 1982). If that is not enough, all are shortened along t·step + t²·corrections.
    """
    step = problem.step(state)
    best = problem.at(state.points + step)
    correction = np.zeros_like(step)
    for _ in range(CORRECTIONS if np.isfinite(best.energy) else 0):
        more = problem.step(best)
        before, corrected = best, problem.at(best.points + more)
        if corrected.energy < before.energy:
            correction, best = correction + more, corrected
        if not corrected.energy < WORTH * before.energy:
            break
    fraction = 1.0
    while not best.energy < state.energy:  # nor where it is NaN
        fraction /= 2
        if fraction < SHORTEST:
            return None, 0.0
        best = problem.at(state.points + fraction * step + fraction**2 * correction)
    return best, fraction


def _flattened(problem: _Problem, points: Floats, headway: float = 1.0) -> Floats:
    """The nearest flat mesh: however heavy, a penalty leaves distances that the rest still pulls at.

    What remains to be moved is little. headway: gives up where derivatives taken anew leave more than this
    fraction of the distances' squares; 1: goes through the barrier if it must.
    """
    for _ in range(NEWTON_STEPS):
        start = state = problem.linearise(points, DECISIVE, guarded=headway < 1)
        for _ in range(CHORDS):
            step, fraction = problem.step(state, planes_only=True), 1.0
            best = problem.at(state.points + step)
            while not best.planes < state.planes and state is start and fraction > SHORTEST:
                fraction /= 2
                best = problem.at(state.points + fraction * step)
            if not best.planes < state.planes:
                break
            swift = best.planes < WORTH**2 * state.planes
            state = best
            if not swift or problem.flat(state.points):
                break
        points = state.points
        if state is start or problem.flat(points) or state.planes > headway * start.planes:
            break
    return points


def _nudges(pattern: Pattern) -> Floats:
    """(n, 3) along the normals, of the order of the edges beside them, the same for vertices that are alike
    in their ring: a surface of revolution keeps its symmetry."""
    faces = pattern.faces
    kind = pattern.ring[faces.row] * (int(faces.lengths.max()) + 1) + faces.within
    least = np.full(len(pattern.vertices), kind.max(), dtype=np.int64)
    np.minimum.at(least, faces.values.astype(np.int64), kind)
    _, kind = np.unique(least, return_inverse=True)
    size = np.random.default_rng(0).normal(size=int(kind.max()) + 1)
    n, edge = len(pattern.vertices), mean_edges(pattern.cells)[faces.row]
    length = np.bincount(faces.values, edge, n) / np.maximum(np.bincount(faces.values, minlength=n), 1)
    return np.asarray((size[kind] * length)[:, None] * pattern.normals)


class _Problem:
    """Energies of all cells over the shared vertices, and steps that lower them.

    The distance from the surface is seen, between two linearisations, as that from the plane through each
    vertex' nearest point. unit: mean target length.
    """

    def __init__(self, pattern: Pattern, length: Floats, aims: Aims, surface: Surface) -> None:
        self._aims = aims
        self._groups = _groups(pattern, length)
        self._surface = surface
        self._start = pattern.vertices
        self._unit = float(length.mean())
        self._even = _evenness(self._groups, len(self._start), aims.evenness / self._unit**2)
        self._bent = [g for g in self._groups if aims.flat and g.corner.shape[1] > 3]
        self._matrix = FlatSteps(pattern.vertices, [g.corner for g in self._bent])
        self._flatness = 0.0
        self._soft: list[_Soft] = []
        self._bases: list[Floats] = []
        self._soft_blocks: Floats = np.zeros((0, 3, 3))
        n = len(self._start)
        self._from = np.full((n, 3), np.inf)
        self._away, self._direction = np.zeros(n), np.zeros((n, 3))

    def linearise(
        self, points: Floats, flatness: float, damping: float = 0.0, *, guarded: bool = True
    ) -> _State:
        """Takes the derivatives there, with that weight of the planes, and gives the state. damping: of
        steps, as the anchor's weight. guarded: whether they feel the barrier."""
        n = len(points)
        self._flatness, self._soft, self._bases, normals = flatness, [], [], []
        squares = np.zeros((n, 9))
        for g in self._groups:
            corner = points[g.corner]
            seen = Seen.of(corner)
            if g in self._bent:
                normals.append(seen.normal / g.length[:, None])
                self._bases.append(seen.basis())
            cell, slope = self._shape_slopes(g, corner, seen, guarded)
            # (Σ sᵢ·xᵢ)² ≤ Σ|sⱼ| Σ (sᵢ·xᵢ)² / |sᵢ|
            size = np.sqrt(np.einsum("qrpd,qrpd->qrp", slope, slope))
            share = size.sum(axis=2, keepdims=True) / np.where(size > 0, size, np.inf)
            square = np.einsum("qrp,qrpd,qrpe->qpde", share, slope, slope, optimize=True)
            at = g.corner[cell]
            squares += summed(square.reshape(-1, 9), at.ravel(), n)
            self._soft.append(_Soft(cell, at, slope.reshape(*slope.shape[:2], 3 * g.corner.shape[1])))
        self._soft_blocks = blocks = squares.reshape(n, 3, 3)
        weight = self._aims.weights.surface
        if weight:
            self._look_at_surface(points)
            away = self._heights_above_surface(points)
            stiffness = weight / self._unit**2 * (1 + 4 * (away / self._aims.worst) ** 2)
            along = self._direction
            blocks = blocks + stiffness[:, None, None] * along[:, :, None] * along[:, None]
        free = (self._aims.anchor + damping) / self._unit**2 + 2 * self._even.diagonal()
        blocks = blocks + free[:, None, None] * np.eye(3)
        self._matrix.factorise(blocks, normals, self._bases, flatness)
        return self.at(points)

    def _look_at_surface(self, points: Floats) -> None:
        """Where vertices hardly moved, the planes seen last serve again; for all or none, so that what is
        symmetric stays so."""
        if not np.linalg.norm(points - self._from) < NEAR * self._unit * np.sqrt(len(points)):
            self._away, self._direction = _beside(points, self._surface)
            self._from = points

    def at(self, points: Floats) -> _State:
        """The energy is ∞ or no number where a step went so far that squares overflow."""
        with np.errstate(all="ignore"):
            moved = points - self._start
            pull = self._aims.anchor / self._unit**2 * moved + self._even @ moved
            asked, planes = 0.5 * float(np.vdot(pull, moved)), 0.0
            heights, shapes = [], []
            for g in self._groups:
                corner = points[g.corner]
                seen = Seen.of(corner)
                if g in self._bent:
                    heights.append(seen.heights() / g.length[:, None])
                    planes += self._flatness * _square(heights[-1])
                shapes.append(self._shape(g, corner, seen))
                asked += _square(shapes[-1])
            if self._aims.weights.surface:
                away = self._heights_above_surface(points)
                steep = away**2 / self._aims.worst
                asked += self._aims.weights.surface * (_square(away) + _square(steep))
                pull += (
                    self._aims.weights.surface
                    / self._unit
                    * ((away + 2 * away * steep / self._aims.worst)[:, None] * self._direction)
                )
            return _State(points, heights, shapes, pull, asked, planes)

    def _heights_above_surface(self, points: Floats) -> Floats:
        """(n,) / ℓ."""
        moved = np.einsum("nd,nd->n", self._direction, points - self._from)
        return np.asarray((self._away + moved) / self._unit)

    def _shape(self, g: _Group, corner: Floats, seen: Seen) -> Floats:
        """(q, r) what is asked of the cells' shapes."""
        shape = residuals(corner, g.length, self._aims.weights, angles=g.regular)
        return np.concatenate([shape, g.guard.residuals(seen)], axis=1) if self._aims.flat else shape

    def _shape_slopes(self, g: _Group, corner: Floats, seen: Seen, guarded: bool) -> tuple[Ints, Floats]:
        """(k,) cells, and (k, r, p, 3) derivatives of it by their corners: of the others they are 0."""
        shape = jacobian(corner, g.length, self._aims.weights, angles=g.regular)
        every = np.arange(len(corner))
        if not self._aims.flat:
            return every, shape
        cell, guard = g.guard.slopes(seen)
        guard = guard * guarded
        if not shape.shape[1]:
            return cell, guard
        whole = np.zeros((len(corner), *guard.shape[1:]))
        whole[cell] = guard
        return every, np.concatenate([shape, whole], axis=1)

    def bend(self, points: Floats) -> float:
        """Greatest distance of a corner from its face's plane / ℓ; ∞ where coordinates are NaN."""
        with np.errstate(all="ignore"):
            found = [
                np.abs(Seen.of(points[g.corner]).heights() / g.length[:, None]).max() for g in self._bent
            ]
        worst = float(max(found, default=0.0))
        return worst if np.isfinite(worst) else np.inf

    def flat(self, points: Floats) -> bool:
        """But for rounding, which far from the origin is more."""
        rounding = ROUNDING * float(np.abs(self._start).max(initial=0.0)) / self._unit
        return self.bend(points) < max(FLAT, rounding)

    def step(self, state: _State, *, planes_only: bool = False) -> Floats:
        """(n, 3) Gauss–Newton step from a state with the derivatives taken last.

        What couples vertices beside the planes (evenness and the barrier) stands in the preconditioner M
        vertex by vertex, and large enough for M to be an upper bound of the matrix; Chebyshev's iteration
        does the rest. Conjugate gradients take fewer rounds, but find polynomials for what is symmetric that
        magnify the rounding in everything else. As M z = r, the matrix times z is r + rest · z.
        """
        heights = [np.einsum("qpr,qp->qr", b, h) for b, h in zip(self._bases, state.heights, strict=True)]
        if planes_only:
            return self._matrix.solve(np.zeros_like(state.points), heights)
        gradient = state.pull.copy()
        for soft, shape in zip(self._soft, state.shapes, strict=True):
            # Beyond the barrier residuals are ∞ and slopes 0.
            pull = np.where(np.isfinite(shape), shape, 0.0)[soft.cell]
            gradient += soft.spread(pull, len(gradient))
        step = self._matrix.solve(gradient, heights)
        left = -self._rest(step)
        middle, half = (1 + SLOWEST) / 2, (1 - SLOWEST) / 2
        way, image, again, fresh = np.zeros_like(step), np.zeros_like(step), 0.0, 1 / middle
        ratio = half / middle
        for _ in range(MOST_ROUNDS):
            better = self._matrix.solve(-left)
            way = again * way + fresh * better
            image = again * image + fresh * (left + self._rest(better))
            step, left = step + way, left - image
            if np.linalg.norm(way) < EXACT * np.linalg.norm(step):
                break
            before, ratio = ratio, 1 / (2 * middle / half - ratio)
            again, fresh = ratio * before, 2 * ratio / half
        return step

    def _rest(self, moved: Floats) -> Floats:
        """(n, 3) the matrix less the preconditioner, times what moved."""
        result = self._even @ moved - 2 * self._even.diagonal()[:, None] * moved
        result -= np.einsum("nde,ne->nd", self._soft_blocks, moved)
        for soft in self._soft:
            q, p = soft.corner.shape
            along = (soft.slope @ moved[soft.corner].reshape(q, 3 * p, 1))[..., 0]
            result += soft.spread(along, len(moved))
        return np.asarray(result)


def _beside(points: Floats, surface: Surface) -> tuple[Floats, Floats]:
    """(n,) distances from the surface, along (n, 3) unit vectors.

    These are the normals, interpolated, of the place whose normal leads to the point: so facets leave no
    print, and where two of them are equally near, it does not matter which is taken. But beyond a boundary,
    where the way back is not along normals, they are those from the nearest points.
    """
    nearest = surface.tree.nearest(points)
    spoke = np.einsum(
        "nc,ncd->nd", nearest.barycentric, points[:, None] - surface.vertices[surface.faces[nearest.face]]
    )
    normal = surface.normals_at(nearest.face, nearest.barycentric)
    along = np.einsum("nd,nd->n", normal, spoke)
    beyond = np.abs(along) < ASLANT * nearest.distance
    weight, height, lifted = _lifted(points, nearest.face, nearest.barycentric, surface)
    sound = ~beyond & (np.abs(height) < 2 * nearest.distance)
    outside = np.flatnonzero(sound & (weight.min(axis=1) < -INSIDE))
    if len(outside):
        down = surface.tree.nearest(points[outside] - height[outside, None] * lifted[outside])
        _, height[outside], lifted[outside] = _lifted(points[outside], down.face, down.barycentric, surface)
    # On coarse meshes normals may turn so much within a face that none of them leads to the point.
    found = np.einsum("nd,nd->n", normal, lifted) > ALIKE
    normal, along = np.where(found[:, None], lifted, normal), np.where(found, height, along)
    direction = np.where(beyond[:, None], spoke / np.maximum(nearest.distance, TINY)[:, None], normal)
    return np.where(beyond, nearest.distance, along), direction


def _lifted(points: Floats, face: Ints, weight: Floats, surface: Surface) -> tuple[Floats, Floats, Floats]:
    """The places in the planes of faces (n,) whose interpolated normals lead to points (n, 3): barycentric
    coordinates (n, 3), first guessed as weight, heights (n,) above them and unit normals (n, 3)."""
    vertex, normal = surface.vertices[surface.faces[face]], surface.normals[surface.faces[face]]
    height = np.zeros(len(points))
    with np.errstate(all="ignore"):
        for _ in range(PROJECTIONS):
            mean = np.einsum("nc,ncd->nd", weight, normal)
            lifted = vertex + height[:, None, None] * normal
            # Differences of coordinates come first: far from the origin their digits are all there is.
            miss = np.einsum("nc,ncd->nd", weight, points[:, None] - lifted)
            sides = lifted[:, 1:] - lifted[:, :1]
            more = _solved(np.concatenate([sides, mean[:, None]], axis=1), miss)
            weight = weight + np.concatenate([-more[:, :1] - more[:, 1:2], more[:, :2]], axis=1)
            height = height + more[:, 2]
        mean = np.einsum("nc,ncd->nd", weight, normal)
        size = np.maximum(np.linalg.norm(mean, axis=1), np.finfo(float).tiny)
        return weight, height * size, mean / size[:, None]


def _solved(rows: Floats, right: Floats) -> Floats:
    """(n, 3) coefficients of sums of rows (n, 3, 3) that give the right-hand sides (n, 3); 0 where there are
    none."""
    a, b, c = rows[:, 0], rows[:, 1], rows[:, 2]
    across = [np.cross(b, c), np.cross(c, a), np.cross(a, b)]
    volume = np.einsum("nd,nd->n", a, across[0])
    parts = np.stack([np.einsum("nd,nd->n", right, one) for one in across], axis=1)
    return np.asarray(np.divide(parts, volume[:, None], out=np.zeros_like(parts), where=volume[:, None] != 0))


def _square(residual: Floats) -> float:
    return 0.5 * float(np.vdot(residual, residual))


def _groups(pattern: Pattern, length: Floats) -> list[_Group]:
    faces, free = pattern.faces, free_corners(pattern)
    p = np.bincount(faces.lengths[pattern.whole]).argmax() if pattern.whole.any() else 0
    regular = pattern.whole & (faces.lengths == p)
    some_free = np.logical_or.reduceat(free, faces.offsets[:-1]) if faces.n_rows else regular
    kind = 4 * faces.lengths + 2 * regular + some_free
    groups = []
    for one in np.unique(kind).tolist():
        chosen = np.flatnonzero(kind == one)
        at = faces.offsets[chosen][:, None] + np.arange(one // 4)
        corner = faces.values[at].astype(np.int64)
        guard = Guard.of(pattern.vertices[corner], free[at])
        groups.append(_Group(corner, length[chosen], bool(one & 2), _across(one // 4), guard))
    return groups


def _across(p: int) -> Floats:
    """(p, p) from each corner to the one across the cell by a translation that takes an edge to the opposite
    one; (0, p) where p is odd, and no edges are opposite."""
    if p % 2:
        return np.zeros((0, p))
    return np.asarray((np.roll(np.eye(p), p // 2 - 1, axis=1) - np.eye(p)) / np.sqrt(2))


def _evenness(groups: list[_Group], n: int, weight: float) -> csr_array:
    """(n, n) matrix of the energy that changes from edges of cells to the opposite ones cost."""
    rows, columns, values = [], [], []
    for g in groups:
        q, p = g.corner.shape
        square = weight * g.across.T @ g.across
        rows.append(np.repeat(g.corner, p, axis=1).ravel())
        columns.append(np.tile(g.corner, (1, p)).ravel())
        values.append(np.tile(square.ravel(), q))
    at = (np.concatenate(rows), np.concatenate(columns))
    return csr_array((np.concatenate(values), at), shape=(n, n))
