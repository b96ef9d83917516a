"""The mesh stays whole: panels share their corners, and faces become flat.

What is minimised, lengths relative to the edges:

    E =   the paper's functionals, as they are weighted
        + anchor · ½ ‖x − x₀‖²                      movement from the pattern on the surface
        + evenness · ½ Σ ‖change of the movement from one edge of a cell to the opposite one‖²

subject to flat faces. The last term keeps away waves from row to row, like bellows, by which nets of quads
become flat near any surface; of opposite edges, because nodes that a translation of the pattern takes to
each other lie there, whereas flat hexagons on a saddle need neighbouring corners to move apart.

Faces stay clear of collapsing, folding over and crossing themselves by a barrier, see ``guard``.

Gauss–Newton steps with the distances from the faces' best planes as a penalty, hundredfold from stage to
stage, lead near the minimum; Newton's method on the planes alone then makes them flat to rounding, along the
shortest way in the sense of E. Where the surface is hardly curved in one direction corners may slide far for
little, so that steps which had to be shortened are damped afterwards (Levenberg 1944, Marquardt 1963). All
matrices have the same pattern of entries and are analysed once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Progress, no_progress
from hexwrap_solver.panels.energy.cell_matrix import CellMatrix
from hexwrap_solver.panels.energy.guard import Guard, free_corners
from hexwrap_solver.panels.energy.residuals import (
    bounded,
    jacobian,
    plane_distances,
    plane_slopes,
    residuals,
)
from hexwrap_solver.panels.polygons import mean_edges
from hexwrap_solver.panels.types import Weights
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.surface.types import Surface

#: Weights of the plane distances, stage by stage; the surface weighs 1.
FLATNESS: tuple[float, ...] = (1e2, 1e4, 1e6, 1e8)

#: After so many stages Newton's method is tried; the others follow only where it makes no headway.
USUAL = 3

#: Most Gauss–Newton steps, and the fraction of its energy that a step takes away if another one is to follow
#: in its stage: what is left undone, the next stage does along with its own work. A heavier weight is no help
#: where the planes are most of the energy; there it is less. The first stage has one step.
MOST_STEPS, ENOUGH, LITTLE = 25, 0.35, 0.1

#: The same where nothing is to become flat, and so nothing comes after.
ONLY_STEPS, ONLY_ENOUGH = 15, 1e-4

#: Damping after the first shortened step, relative to the weight of the planes; by how much it falls after
#: full steps, and rises after shortened ones.
DAMPING, EASE, TIGHTEN = 1e-4, 4.0, 4.0

#: Weight of the planes in Newton's method at the end, so large that the rest only chooses among flat meshes.
DECISIVE = 1e9

#: Distances from planes / ℓ below this are rounding; Newton's method takes at most so many steps to it.
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
#: fraction of the energy; and at most so many of Newton's steps follow each other.
CORRECTIONS, CHORDS, WORTH = 4, 8, 0.6

#: A step is halved at most down to this fraction.
SHORTEST = 1e-3


@dataclass(frozen=True)
class Aims:
    """What is asked of the mesh, see the head of this module. flat: whether faces must become flat."""

    weights: Weights
    anchor: float
    evenness: float
    flat: bool


#: As near to the surface, and to the pattern on it, as flat faces can be. A movement along the surface costs
#: a tenth of one off it.
NEAREST = Aims(Weights(planarity=0.0, angle=0.0, edge=0.0, surface=1.0), anchor=0.1, evenness=0.1, flat=True)


def functionals(weights: Weights) -> Aims:
    """The paper's. They know shapes only, and would move the mesh by whole edges without a stronger anchor.
    Faces become flat where planarity has a weight."""
    return Aims(weights, anchor=10.0, evenness=0.1, flat=weights.planarity > 0)


@dataclass(frozen=True)
class _Group:
    """Cells with the same number of corners. corner: (q, p) pattern vertices; length: (q,) target lengths;
    across: (m, p), applied to corners, those on one edge minus those on the opposite one."""

    corner: Ints
    length: Floats
    regular: bool
    across: Floats
    guard: Guard


@dataclass(frozen=True)
class _State:
    """points: (n, 3). residual: of each part, see ``_Problem``; pull: (n, 3) the anchor's. asked, planes:
    energy of what was asked for, and of the plane distances, at the stage's weight."""

    points: Floats
    residual: tuple[Floats, ...]
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
    while not best.energy < state.energy:  # nor where it is no number
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
    corner = np.arange(len(faces.values)) - faces.offsets[faces.row]
    kind = pattern.ring[faces.row] * (int(faces.lengths.max()) + 1) + corner
    least = np.full(len(pattern.vertices), kind.max(), dtype=np.int64)
    np.minimum.at(least, faces.values.astype(np.int64), kind)
    _, kind = np.unique(least, return_inverse=True)
    size = np.random.default_rng(0).normal(size=int(kind.max()) + 1)
    n, edge = len(pattern.vertices), mean_edges(pattern.cells)[faces.row]
    length = np.bincount(faces.values, edge, n) / np.maximum(np.bincount(faces.values, minlength=n), 1)
    return np.asarray((size[kind] * length)[:, None] * pattern.normals)


class _Problem:
    """Residuals of all cells over the shared vertices.

    Its parts are the groups of cells with the same number p of corners, whose last p residuals are the
    distances from their planes; and the vertices' distances from the surface, which between two
    linearisations is seen as the plane through each vertex' nearest point. unit: mean target length.
    """

    def __init__(self, pattern: Pattern, length: Floats, aims: Aims, surface: Surface) -> None:
        self._aims = aims
        self._groups = _groups(pattern, length)
        self._surface = surface
        self._start = pattern.vertices
        self._unit = float(length.mean())
        self._corners = [group.corner for group in self._groups]
        if aims.weights.surface:
            self._corners.append(np.arange(len(pattern.vertices))[:, None])
        self._matrix = CellMatrix(pattern.vertices, self._corners)
        self._flatness = 0.0
        self._from = pattern.vertices
        self._slopes: list[Floats] = []
        self._away: Floats = np.zeros((0, 1))

    def linearise(
        self, points: Floats, flatness: float, damping: float = 0.0, *, guarded: bool = True
    ) -> _State:
        """Takes the derivatives there, with that weight of the planes, and gives the state. damping: of
        steps, as the anchor's weight. guarded: whether they feel the barrier."""
        self._flatness, self._from, self._slopes = flatness, points, []
        for g in self._groups:
            corner = points[g.corner]
            shape = self._shape_slopes(g, corner, guarded)
            plane = np.sqrt(flatness) * plane_slopes(corner, g.length)
            slope = np.concatenate([shape, plane], axis=1)
            self._slopes.append(slope.reshape(*slope.shape[:2], -1))
        weight = self._aims.weights.surface
        if weight:
            away, direction = _beside(points, self._surface)
            self._away = np.sqrt(weight) / self._unit * away[:, None]
            self._slopes.append(np.sqrt(weight) / self._unit * direction[:, None])
        self._matrix.factorise(self._slopes, (self._aims.anchor + damping) / self._unit**2)
        return self.at(points)

    def at(self, points: Floats) -> _State:
        """The energy is ∞ where a step went so far that squares overflow."""
        with np.errstate(all="ignore"):
            return self._at(points)

    def _at(self, points: Floats) -> _State:
        pull = np.sqrt(self._aims.anchor) / self._unit * (points - self._start)
        root = np.sqrt(self._flatness)
        residual, asked, planes = [], _square(pull), 0.0
        try:
            for g in self._groups:
                corner = points[g.corner]
                shape = self._shape(g, corner)
                plane = root * plane_distances(corner, g.length)
                residual.append(np.concatenate([shape, plane], axis=1))
                asked, planes = asked + _square(shape), planes + _square(plane)
        except np.linalg.LinAlgError:
            return _State(points, (), pull, np.inf, np.inf)
        if self._aims.weights.surface:
            slope = self._slopes[-1][:, 0]
            away = self._away + np.einsum("nd,nd->n", slope, points - self._from)[:, None]
            residual.append(away)
            asked += _square(away)
        return _State(points, tuple(residual), pull, asked, planes)

    def _shape(self, g: _Group, corner: Floats) -> Floats:
        """(q, r) what is asked of the cells' shapes."""
        moved = corner - self._start[g.corner]
        change = (np.sqrt(self._aims.evenness) / self._unit) * (g.across @ moved)
        shape = residuals(corner, g.length, self._aims.weights, angles=g.regular)
        guard = [g.guard.residuals(corner)] if self._aims.flat else []
        return np.concatenate([change.reshape(len(change), -1), shape, *guard], axis=1)

    def _shape_slopes(self, g: _Group, corner: Floats, guarded: bool) -> Floats:
        """(q, r, p, 3) derivatives of it by the corners."""
        q, p, _ = corner.shape
        change = np.einsum("kc,xy->kxcy", g.across, np.eye(3)).reshape(-1, p, 3)
        change = np.broadcast_to(np.sqrt(self._aims.evenness) / self._unit * change, (q, *change.shape))
        shape = jacobian(corner, g.length, self._aims.weights, angles=g.regular)
        guard = [g.guard.slopes(corner) * guarded] if self._aims.flat else []
        return np.concatenate([change, shape, *guard], axis=1)

    def bend(self, points: Floats) -> float:
        """Greatest distance of a corner from its face's plane / ℓ; ∞ where points are no numbers."""
        with np.errstate(all="ignore"):
            try:
                return float(
                    max(np.abs(plane_distances(points[g.corner], g.length)).max() for g in self._groups)
                )
            except np.linalg.LinAlgError:
                return np.inf

    def flat(self, points: Floats) -> bool:
        """But for rounding, which far from the origin is more."""
        rounding = ROUNDING * float(np.abs(self._start).max(initial=0.0)) / self._unit
        return self.bend(points) < max(FLAT, rounding)

    def step(self, state: _State, *, planes_only: bool = False) -> Floats:
        """(n, 3) Gauss–Newton step from a state with the derivatives taken last."""
        gradient = np.zeros(state.points.size)
        if not planes_only:
            gradient += np.sqrt(self._aims.anchor) / self._unit * state.pull.ravel()
        parts = len(self._groups) if planes_only else len(self._corners)
        for corner, slope, residual in zip(self._corners[:parts], self._slopes, state.residual, strict=False):
            some = slice(-corner.shape[1] if planes_only else 0, None)
            # Beyond the barrier residuals are ∞ and slopes 0.
            pull = np.where(np.isfinite(residual), residual, 0.0)
            share = (pull[:, None, some] @ slope[:, some]).ravel()
            at = 3 * corner[..., None] + np.arange(3)
            gradient += np.bincount(at.ravel(), weights=share, minlength=gradient.size)
        return -self._matrix.solve(gradient).reshape(-1, 3)


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
    direction = np.where(beyond[:, None], spoke / np.maximum(nearest.distance, 1e-300)[:, None], normal)
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
