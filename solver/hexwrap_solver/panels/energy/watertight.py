"""The mesh stays whole: panels share their corners, and faces become as flat and even as that allows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Progress, Ragged, no_progress
from hexwrap_solver.panels.energy.cell_matrix import CellMatrix
from hexwrap_solver.panels.energy.residuals import (
    bounded,
    edges_of,
    jacobian,
    plane_distances,
    plane_slopes,
    residuals,
    surface_residuals,
)
from hexwrap_solver.panels.types import Weights
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.surface.closest import TriangleTree

#: Most Gauss–Newton steps for each weight of the plane distances.
STEPS_PER_STAGE = 12

#: Weight of the plane distances in the first stage; from stage to stage tenfold more, so that flatness wins.
FIRST_FLATNESS, STAGES = 1e3, 5

#: Plane distances / ℓ below this count as flat.
FLAT = 1e-9

#: A stage ends when a step lowers its energy by less than this fraction. What one leaves undone, the next
#: does along with its own work; nobody comes after the last, nor after the only one where nothing is to
#: become flat.
DECREASE, LAST_DECREASE, ONLY_DECREASE = 2e-2, 4e-3, 1e-4

#: Nor does the last stage end before the greatest distance from a plane / ℓ is below this.
FLAT_ENOUGH = 1e-4

#: Corners leave the surface by about this / ℓ before the first step. A regular pattern on a saddle-shaped
#: surface can become flat in mirrored ways and balances between them, so that the first dozens of steps would
#: only wait for rounding to tip it over.
NUDGE = 0.03

#: Weight of the squared movement / ℓ²: energies that only know shapes would move the mesh by whole edges.
ANCHOR = 10.0

#: The same for quads that become flat, and the weight of the squared differences of the movement along edges
#: / ℓ². Near any surface quads can become flat by waves from row to row, like bellows; smooth nets of flat
#: quads may lie further away. (Hexagons on a saddle become flat by moving apart, and so they do without.)
QUAD_ANCHOR, EVENNESS = 1.0, 10.0

#: Damping relative to 1/ℓ², how it changes after a good and after a bad step, and its least value.
DAMPING, EASE, TIGHTEN, LEAST_DAMPING = 1e-3, 0.2, 8.0, 1e-9

#: A step is halved at most down to this fraction.
SHORTEST = 1e-3

#: Most corrections at the end that see the planes only.
MOST_CORRECTIONS = 5


@dataclass(frozen=True)
class _Group:
    """Cells with the same number of corners. corner: (q, p) pattern vertices; length: (q,) targets; edge:
    (q, p, 3) the cells' edges."""

    corner: Ints
    length: Floats
    regular: bool
    edge: Floats


@dataclass(frozen=True)
class _State:
    """points: (n, 3). residual: of each part, (q, m), see ``_Problem``; pull: (n, 3) the anchor's.
    asked, planes: energy of what was asked for, and of the plane distances."""

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
    weights: Weights,
    surface: TriangleTree | None,
    progress: Progress = no_progress,
) -> tuple[Floats, Floats]:
    """New places (p, 3) of the pattern's vertices, and the energy (weights as asked for) after each step.

    length: (cells,) target edge lengths. Angles count in whole cells only. Damped Gauss–Newton with a weak
    anchor. Where planarity has a weight, the distances from the faces' planes are added, weighing more
    from stage to stage, until faces are flat; and quads are to move evenly.
    """
    weights, factor = bounded(weights)
    flat = weights.planarity > 0
    problem = _Problem(pattern, length, weights, surface, even=flat and pattern.kind == "quad")
    state = problem.at(pattern.vertices, 0.0)
    curve = [state.asked]
    damping = DAMPING
    if flat and problem.bend(state.points) >= FLAT:
        state = problem.at(state.points + NUDGE * problem.unit * _nudges(pattern), 0.0)
    for stage in range(STAGES if flat else 1):
        flatness = weights.planarity * FIRST_FLATNESS * 10.0**stage
        state = problem.at(state.points, flatness)
        last = flat and stage == STAGES - 1
        enough = ONLY_DECREASE if not flat else LAST_DECREASE if last else DECREASE
        for step in range(STEPS_PER_STAGE):
            done = (stage + step / STEPS_PER_STAGE) / STAGES
            progress(done, f"flatness weight {flatness:.0e}, energy {state.energy:.3e}")
            problem.linearise(state, flatness, damping)
            found, fraction = _search(problem, state, flatness)
            damping = max(damping * (EASE if fraction == 1 else TIGHTEN), LEAST_DAMPING)
            if fraction == 0:
                continue
            slow = state.energy - found.energy < enough * state.energy
            state = found
            curve.append(state.asked)
            if slow and not (last and problem.bend(state.points) > FLAT_ENOUGH):
                break
        if problem.bend(state.points) < FLAT:
            break
    if flat:
        state = _flattened(problem, state, flatness)
        curve.append(state.asked)
    return state.points, factor * np.array(curve)


def _search(problem: _Problem, state: _State, flatness: float) -> tuple[_State, float]:
    """A state of less energy, and the fraction of the step that led there: 0 where none was found.

    Faces turn as they move, so that a long step leaves their planes. A second step from where the first one
    ends, with the same derivatives and so without another factorisation, leads back to them (second-order
    correction; Fletcher 1982). If that is not enough, both are shortened along t·step + t²·correction.
    """
    step = problem.step(state)
    best = problem.at(state.points + step, flatness)
    correction = np.zeros_like(step)
    if np.isfinite(best.energy):
        correction = problem.step(best)
        corrected = problem.at(best.points + correction, flatness)
        best = corrected if corrected.energy < best.energy else best
    fraction = 1.0
    while not best.energy < state.energy:  # nor where it is no number
        fraction /= 2
        if fraction < SHORTEST:
            return state, 0.0
        best = problem.at(state.points + fraction * step + fraction**2 * correction, flatness)
    return best, fraction


def _flattened(problem: _Problem, state: _State, flatness: float) -> _State:
    """The nearest flat mesh: however heavy, a weight leaves distances that the other energies still pull at.

    "Nearest" in the sense of the matrix factorised last, so that the other energies change least.
    """
    bend = problem.bend(state.points)
    for _ in range(MOST_CORRECTIONS):
        tried = problem.at(state.points + problem.step(state, planes_only=True), flatness)
        if not tried.planes < state.planes / 2:
            break
        reached = problem.bend(tried.points)
        if reached > bend:
            break
        state, bend = tried, reached
    return state


def _nudges(pattern: Pattern) -> Floats:
    """(n, 3) along the normals, of order 1, the same for vertices that are alike in their ring: a surface of
    revolution keeps its symmetry."""
    faces = pattern.faces
    corner = np.arange(len(faces.values)) - faces.offsets[faces.row]
    kind = pattern.ring[faces.row] * (int(faces.lengths.max()) + 1) + corner
    least = np.full(len(pattern.vertices), kind.max(), dtype=np.int64)
    np.minimum.at(least, faces.values.astype(np.int64), kind)
    _, kind = np.unique(least, return_inverse=True)
    size = np.random.default_rng(0).normal(size=int(kind.max()) + 1)
    return np.asarray(size[kind][:, None] * pattern.normals)


class _Problem:
    """Residuals of all cells over the shared vertices.

    Its parts are the groups of cells with the same number p of corners, whose last p residuals are the
    distances from their planes; and, where the surface counts, the vertices' distances from it. unit: mean
    target length. even: whether differences of the movement count.
    """

    def __init__(
        self,
        pattern: Pattern,
        length: Floats,
        weights: Weights,
        surface: TriangleTree | None,
        *,
        even: bool,
    ) -> None:
        self._groups = _groups(pattern, length)
        self._weights = weights
        self._surface = surface
        self._start = pattern.vertices
        self.unit = float(length.mean())
        self._even = even
        self._anchor = np.sqrt(QUAD_ANCHOR if even else ANCHOR) / self.unit
        self._corners = [group.corner for group in self._groups]
        if surface is not None:
            self._corners.append(np.arange(len(pattern.vertices))[:, None])
        self._matrix = CellMatrix(pattern.vertices, self._corners)
        self._slopes: list[Floats] = []

    def at(self, points: Floats, flatness: float) -> _State:
        """The energy is ∞ where a step went so far that squares overflow."""
        with np.errstate(all="ignore"):
            return self._at(points, flatness)

    def _at(self, points: Floats, flatness: float) -> _State:
        pull = self._anchor * (points - self._start)
        root = np.sqrt(flatness)
        residual, asked, planes = [], _square(pull), 0.0
        try:
            for g in self._groups:
                corner = points[g.corner]
                shape = self._shape(g, corner)
                plane = root * plane_distances(corner, g.length)
                residual.append(np.concatenate([shape, plane], axis=1))
                asked, planes = asked + _square(shape), planes + _square(plane)
        except np.linalg.LinAlgError:
            return _State(points, (), pull, np.inf, 0.0)
        if self._surface is not None:
            away = self._to_surface(points, self._surface)[0]
            residual.append(away)
            asked += _square(away)
        return _State(points, tuple(residual), pull, asked, planes)

    def _shape(self, g: _Group, corner: Floats) -> Floats:
        """(q, r) what is asked of the cells' shapes."""
        shape = residuals(corner, g.length, self._weights, angles=g.regular)
        if not self._even:
            return shape
        change = (edges_of(corner) - g.edge) * (np.sqrt(EVENNESS) / g.length)[:, None, None]
        return np.concatenate([change.reshape(len(change), -1), shape], axis=1)

    def _shape_slopes(self, g: _Group, corner: Floats) -> Floats:
        """(q, r, p, 3) derivatives of it by the corners."""
        shape = jacobian(corner, g.length, self._weights, angles=g.regular)
        if not self._even:
            return shape
        p = corner.shape[1]
        step = np.einsum("kc,xy->kxcy", np.roll(np.eye(p), 1, axis=1) - np.eye(p), np.eye(3))
        change = step.reshape(3 * p, p, 3) * (np.sqrt(EVENNESS) / g.length)[:, None, None, None]
        return np.concatenate([change, shape], axis=1)

    def bend(self, points: Floats) -> float:
        """Greatest distance of a corner from its face's plane / ℓ."""
        return float(max(np.abs(plane_distances(points[g.corner], g.length)).max() for g in self._groups))

    def linearise(self, state: _State, flatness: float, damping: float) -> None:
        """Takes the derivatives at a state; damping is relative to 1/ℓ²."""
        self._slopes = []
        for g in self._groups:
            corner = state.points[g.corner]
            shape = self._shape_slopes(g, corner)
            plane = np.sqrt(flatness) * plane_slopes(corner, g.length)
            slope = np.concatenate([shape, plane], axis=1)
            self._slopes.append(slope.reshape(*slope.shape[:2], -1))
        if self._surface is not None:
            self._slopes.append(self._to_surface(state.points, self._surface)[1])
        self._matrix.factorise(self._slopes, self._anchor**2 + damping / self.unit**2)

    def step(self, state: _State, *, planes_only: bool = False) -> Floats:
        """(n, 3) Gauss–Newton step from a state with the derivatives taken last."""
        gradient = np.zeros(state.points.size) if planes_only else self._anchor * state.pull.ravel()
        for g, slope, residual in zip(self._groups, self._slopes, state.residual, strict=False):
            some = slice(-g.corner.shape[1] if planes_only else 0, None)
            gradient += self._spread(g.corner, slope[:, some], residual[:, some])
        if self._surface is not None and not planes_only:
            gradient += (self._slopes[-1] * state.residual[-1][..., None]).ravel()
        return -self._matrix.solve(gradient).reshape(-1, 3)

    def _spread(self, corner: Ints, slope: Floats, residual: Floats) -> Floats:
        """(3n,) Jᵀ r, summed over cells."""
        share = (residual[:, None] @ slope).ravel()
        at = 3 * corner[..., None] + np.arange(3)
        return np.asarray(
            np.bincount(at.ravel(), weights=share, minlength=self._start.size), dtype=np.float64
        )

    def _to_surface(self, points: Floats, surface: TriangleTree) -> tuple[Floats, Floats]:
        """(n, 1) residuals and (n, 1, 3) derivatives."""
        value, slope = surface_residuals(points, np.full(len(points), self.unit), surface)
        root = np.sqrt(self._weights.surface)
        return root * value[:, None], root * slope[:, None]


def _square(residual: Floats) -> float:
    return 0.5 * float(np.vdot(residual, residual))


def _groups(pattern: Pattern, length: Floats) -> list[_Group]:
    faces: Ragged = pattern.faces
    p = np.bincount(faces.lengths[pattern.whole]).argmax() if pattern.whole.any() else 0
    regular = pattern.whole & (faces.lengths == p)
    groups = []
    for count in np.unique(faces.lengths):
        for even in (False, True):
            chosen = np.flatnonzero((faces.lengths == count) & (regular == even))
            if len(chosen):
                corner = faces.values[faces.offsets[chosen][:, None] + np.arange(count)].astype(np.int64)
                groups.append(_Group(corner, length[chosen], even, edges_of(pattern.vertices[corner])))
    return groups
