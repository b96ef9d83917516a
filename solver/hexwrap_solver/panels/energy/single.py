"""Single panels: every cell becomes a polygon of its own (paper, section 5)."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Progress, no_progress
from hexwrap_solver.panels.energy.residuals import ANCHOR, bounded, jacobian, residuals, surface_residuals
from hexwrap_solver.panels.regular import nearest_regular
from hexwrap_solver.panels.types import Weights
from hexwrap_solver.surface.closest import TriangleTree

MOST_STEPS = 60

#: A panel is finished when a step moves it by less than this, relative to its edge.
STEP_TOLERANCE = 1e-11

#: Energy of a panel above which its minimum may be a local one.
STUCK = 1e-6

#: Damping of the first step, and how it changes after a good and after a bad step (Marquardt 1963).
DAMPING, EASE, TIGHTEN = 1e-3, 0.2, 8.0


def minimise_singly(
    cells: Floats,
    length: Floats,
    weights: Weights,
    surface: TriangleTree | None,
    progress: Progress = no_progress,
) -> tuple[Floats, Floats]:
    """Minimises the weighted energy of each cell (q, p, 3) for target lengths (q,), all at once.

    Damped Gauss–Newton on 3p unknowns per panel. surface: reference of weights.surface, or None.
    Without it the energies do not see rigid motions, and of all minimisers the one nearest to its cell is
    returned; with it panels could still slide along it, and are anchored weakly. Returns the polygons (q,
    p, 3) and the total energy after each step.
    """
    if not len(cells):
        return cells.copy(), np.zeros(1)
    weights, factor = bounded(weights)
    points, energy, curve = _descend(cells, cells, length, weights, surface, progress)
    # Badly bent cells can end in a local minimum; those start again from the nearest regular polygon.
    stuck = np.flatnonzero(energy > STUCK)
    if len(stuck):
        poses = nearest_regular(cells[stuck])
        start = poses.center[:, None] + length[stuck, None, None] * poses.spokes(cells.shape[1])
        tried, reached, _ = _descend(start, cells[stuck], length[stuck], weights, surface, progress)
        better = reached < energy[stuck]
        points[stuck[better]], energy[stuck[better]] = tried[better], reached[better]
        curve.append(float(energy.sum()))
    return (points if surface is not None else _aligned(points, cells)), factor * np.array(curve)


def _descend(
    start: Floats,
    cells: Floats,
    length: Floats,
    weights: Weights,
    surface: TriangleTree | None,
    progress: Progress,
) -> tuple[Floats, Floats, list[float]]:
    """Polygons, the energy of each, and the total after each step."""
    points = start.copy()
    damping = np.full(len(cells), DAMPING)
    active = np.arange(len(cells))
    r, j = _system(points, cells, length, weights, surface)
    energy = 0.5 * np.einsum("qm,qm->q", r, r)
    curve = [float(energy.sum())]
    for step in range(MOST_STEPS):
        if not len(active):
            break
        progress(step / MOST_STEPS, f"energy {curve[-1]:.3e}, {len(active)} panels moving")
        move = _gauss_newton(r, j, damping[active], length[active])
        tried = points[active] + move
        r_new, j_new = _system(tried, cells[active], length[active], weights, surface)
        energy_new = 0.5 * np.einsum("qm,qm->q", r_new, r_new)
        good = energy_new <= energy[active]
        points[active[good]], energy[active[good]] = tried[good], energy_new[good]
        damping[active] = np.maximum(damping[active] * np.where(good, EASE, TIGHTEN), 1e-12)
        r, j = np.where(good[:, None], r_new, r), np.where(good[:, None, None], j_new, j)
        curve.append(float(energy.sum()))
        size = np.abs(move).max(axis=(1, 2)) / length[active]
        going = size > STEP_TOLERANCE
        active, r, j = active[going], r[going], j[going]
    return points, energy, curve


def _system(
    points: Floats, cells: Floats, length: Floats, weights: Weights, surface: TriangleTree | None
) -> tuple[Floats, Floats]:
    """Residuals (q, m) and Jacobian (q, m, 3p)."""
    q, p, _ = points.shape
    r, j = residuals(points, length, weights), jacobian(points, length, weights).reshape(q, -1, 3 * p)
    if surface is None:
        return r, j
    root = np.sqrt(weights.surface)
    value, slope = surface_residuals(points.reshape(-1, 3), np.repeat(length, p), surface)
    block = np.zeros((q, p, p, 3))
    block[:, np.arange(p), np.arange(p)] = root * slope.reshape(q, p, 3)
    hold = np.sqrt(ANCHOR) / length
    moved = hold[:, None] * (points - cells).reshape(q, 3 * p)
    return (
        np.concatenate([r, root * value.reshape(q, p), moved], axis=1),
        np.concatenate([j, block.reshape(q, p, 3 * p), hold[:, None, None] * np.eye(3 * p)], axis=1),
    )


def _gauss_newton(r: Floats, j: Floats, damping: Floats, length: Floats) -> Floats:
    """(q, p, 3) steps; damping is relative to 1/ℓ², the size of the entries of JᵀJ."""
    unknowns = j.shape[2]
    normal = j.transpose(0, 2, 1) @ j + (damping / length**2)[:, None, None] * np.eye(unknowns)
    right = np.einsum("qmu,qm->qu", j, r)
    step = -np.linalg.solve(normal, right[..., None])[..., 0]
    return np.asarray(step.reshape(len(r), -1, 3))


def _aligned(points: Floats, cells: Floats) -> Floats:
    """Moves each polygon rigidly to where it is nearest to its cell (Kabsch 1976)."""
    center = cells.mean(axis=1, keepdims=True)
    spokes = points - points.mean(axis=1, keepdims=True)
    u, _, vt = np.linalg.svd(spokes.transpose(0, 2, 1) @ (cells - center))
    # A flat polygon leaves the sign of the last axis free: take the rotation.
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    return np.asarray(spokes @ (u @ vt) + center)
