"""The mesh stays whole: panels share their corners, and faces become as flat and even as that allows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from hexwrap_solver.arrays import Floats, Ints, Progress, Ragged, no_progress
from hexwrap_solver.conformal.normal_matrix import NormalMatrix
from hexwrap_solver.panels.energy.residuals import jacobian, plane_distances, residuals, surface_residuals
from hexwrap_solver.panels.types import Weights
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.surface.closest import TriangleTree

#: Gauss–Newton steps for each weight of the plane distances.
STEPS_PER_STAGE = 12

#: Weight of the plane distances in the first stage; from stage to stage tenfold more, so that flatness wins.
FIRST_FLATNESS, STAGES = 1e3, 5

#: Plane distances / ℓ below this count as flat.
FLAT = 1e-9

#: A stage ends when a step lowers its energy by less than this fraction.
DECREASE = 1e-4

#: Weight of the squared movement / ℓ²: energies that only know shapes would move the mesh by whole edges.
ANCHOR = 10.0

#: Damping relative to 1/ℓ², and how it changes after a good and after a bad step.
DAMPING, EASE, TIGHTEN = 1e-3, 0.2, 8.0


@dataclass(frozen=True)
class _Group:
    """Cells with the same number of corners. corner: (q, p) pattern vertices; length: (q,) targets."""

    corner: Ints
    length: Floats
    regular: bool


@dataclass(frozen=True)
class _Part:
    """residual: (rows,). slope: (rows, p, 3) by the vertices (rows, p)."""

    residual: Floats
    slope: Floats
    vertex: Ints


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
    from stage to stage, until faces are flat.
    """
    problem = _Problem(pattern, length, weights, surface)
    points = pattern.vertices.copy()
    curve = [problem.energy(points, 0.0)]
    damping = DAMPING
    for stage in range(STAGES if weights.planarity > 0 else 1):
        flatness = weights.planarity * FIRST_FLATNESS * 10.0**stage
        energy = problem.energy(points, flatness)
        for step in range(STEPS_PER_STAGE):
            done = (stage + step / STEPS_PER_STAGE) / STAGES
            progress(done, f"flatness weight {flatness:.0e}, energy {energy:.3e}")
            tried = points + problem.step(points, flatness, damping)
            reached = problem.energy(tried, flatness)
            damping = max(damping * (EASE if reached < energy else TIGHTEN), 1e-9)
            if not reached < energy:  # nor where it is no number
                continue
            slow = energy - reached < DECREASE * energy
            points, energy = tried, reached
            curve.append(problem.energy(points, 0.0))
            if slow:
                break
        if problem.bend(points) < FLAT:
            break
    return points, np.array(curve)


class _Problem:
    """Residuals of all cells over the shared vertices."""

    def __init__(
        self, pattern: Pattern, length: Floats, weights: Weights, surface: TriangleTree | None
    ) -> None:
        self._groups = _groups(pattern, length)
        self._weights = weights
        self._surface = surface
        self._start = pattern.vertices
        self._unit = float(length.mean())
        self._normal = NormalMatrix(np.repeat(pattern.vertices, 3, axis=0))

    def energy(self, points: Floats, flatness: float) -> float:
        """∞ where a step went so far that squares overflow."""
        try:
            parts = [part.residual for part in self._parts(points, flatness)]
        except np.linalg.LinAlgError:
            return np.inf
        return 0.5 * sum(float(part @ part) for part in [*parts, self._moved(points)])

    def bend(self, points: Floats) -> float:
        """Greatest distance of a corner from its face's plane / ℓ."""
        return float(max(np.abs(plane_distances(points[g.corner], g.length)[0]).max() for g in self._groups))

    def step(self, points: Floats, flatness: float, damping: float) -> Floats:
        parts = list(self._parts(points, flatness))
        slope = _assemble(parts, len(points))
        hold = np.sqrt(ANCHOR) / self._unit
        self._normal.factorise(slope, np.ones(slope.shape[0]), hold**2 + damping / self._unit**2)
        gradient = slope.T @ np.concatenate([part.residual for part in parts]) + hold * self._moved(points)
        return -self._normal.solve(gradient).reshape(-1, 3)

    def _moved(self, points: Floats) -> Floats:
        """Movement, flat and scaled so that half its square is the anchor's energy."""
        return np.asarray(np.sqrt(ANCHOR) / self._unit * (points - self._start)).ravel()

    def _parts(self, points: Floats, flatness: float) -> Iterator[_Part]:
        for g in self._groups:
            corners, p = points[g.corner], g.corner.shape[1]
            value = residuals(corners, g.length, self._weights, angles=g.regular)
            slope = jacobian(corners, g.length, self._weights, angles=g.regular)
            vertex = np.repeat(g.corner, value.shape[1], axis=0)
            yield _Part(value.ravel(), slope.reshape(-1, p, 3), vertex)
            root = np.sqrt(flatness)
            value, slope = plane_distances(corners, g.length)
            yield _Part(root * value.ravel(), root * slope.reshape(-1, p, 3), np.repeat(g.corner, p, axis=0))
        if self._surface is not None:
            root = np.sqrt(self._weights.surface)
            value, slope = surface_residuals(points, np.full(len(points), self._unit), self._surface)
            yield _Part(root * value, root * slope[:, None], np.arange(len(points))[:, None])


def _groups(pattern: Pattern, length: Floats) -> list[_Group]:
    faces: Ragged = pattern.faces
    p = np.bincount(faces.lengths[pattern.whole]).argmax() if pattern.whole.any() else 0
    regular = pattern.whole & (faces.lengths == p)
    groups = []
    for count in np.unique(faces.lengths):
        for even in (False, True):
            chosen = np.flatnonzero((faces.lengths == count) & (regular == even))
            if len(chosen):
                corner = faces.values[faces.offsets[chosen][:, None] + np.arange(count)]
                groups.append(_Group(corner.astype(np.int64), length[chosen], even))
    return groups


def _assemble(parts: list[_Part], vertices: int) -> csr_array:
    """The parts' rows one after the other, (rows, 3 · vertices)."""
    data = np.concatenate([part.slope.ravel() for part in parts])
    column = np.concatenate([(3 * part.vertex[..., None] + np.arange(3)).ravel() for part in parts])
    entries = np.concatenate([np.full(len(part.residual), 3 * part.vertex.shape[1]) for part in parts])
    start = np.concatenate([[0], np.cumsum(entries)])
    return csr_array((data, column, start), shape=(len(entries), 3 * vertices))
