"""The periodic conformal map of an annulus (paper, section 3)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Floats, Progress, no_progress
from hexwrap_solver.conformal import boundary
from hexwrap_solver.conformal.corners import boundary_angles
from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.layout import lay_out
from hexwrap_solver.conformal.newton import Minimum, minimise
from hexwrap_solver.conformal.orientation import positive
from hexwrap_solver.conformal.robust import solve_with_flips, with_inserted
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap, Deck, Targets
from hexwrap_solver.surface.types import Surface


def conformal_map(
    surface: Surface, condition: BoundaryCondition, progress: Progress = no_progress
) -> ConformalMap:
    """Maps an annulus to a cylinder or cone of revolution, unrolled.

    The domain has the surface's scale: the area-weighted mean of u is 0, or, with an isometric boundary,
    the length-weighted mean of u along the boundary.
    Raises RequestError (boundary condition), ConvergenceError.
    """
    if condition.mode == "isometric":
        return _isometric(surface, condition, progress)
    if condition.mode == "angles":
        targets = boundary.prescribed(surface, boundary_angles(surface, condition))
        return _map(surface, targets, None, progress)
    return _map(surface, boundary.straight(surface), None, progress)


def _isometric(surface: Surface, condition: BoundaryCondition, progress: Progress) -> ConformalMap:
    """The paper's two steps: u = 0 on the boundary, then again with the cone angle rounded to the quantum."""
    first = _map(surface, boundary.isometric(surface), None, progress)
    if condition.quantum is None:
        return first
    surface = first.surface  # refined where that was needed
    rounded = boundary.nearest_multiple(first.deck.angle, condition.quantum)
    if condition.spread == "optimal":
        targets = boundary.constant_on_loops(surface, rounded)
    else:
        angles = [
            boundary.spread_evenly(sums, wanted)
            for sums, wanted in zip(first.boundary_angles, (rounded, -rounded), strict=True)
        ]
        targets = boundary.prescribed(surface, (angles[0], angles[1]))
    second = _map(surface, targets, first.log_scale, progress, keep_boundary=True)
    return second if not first.inserted else with_inserted(second, first.inserted)


def _map(
    surface: Surface, targets: Targets, start: Floats | None, progress: Progress, keep_boundary: bool = False
) -> ConformalMap:
    """On the triangles as they are where that works, otherwise with flips."""
    energy = Energy(surface, targets)
    minimum = minimise(energy, start, progress)
    found = None
    if minimum.converged and not minimum.broken:
        found = _finish(surface, energy, minimum)
    if found is None or not positive(found.corners()).all():
        found = solve_with_flips(surface, targets, progress, start)
    if (targets.tie == 0).any():
        return found
    u = found.log_scale
    mean = _mean_on_boundary(found.surface, u) if keep_boundary else _mean_on_area(found.surface, u)
    return _scaled(found, -mean)


def _scaled(found: ConformalMap, shift: float) -> ConformalMap:
    """The same map with a domain e^shift times as large."""
    factor = float(np.exp(shift))
    return replace(
        found,
        log_scale=found.log_scale + shift,
        uv=found.uv * factor,
        deck=Deck(found.deck.angle, found.deck.translation * factor),
        circumference=found.circumference * factor,
    )


def _finish(surface: Surface, energy: Energy, minimum: Minimum) -> ConformalMap:
    """Layout and everything measured on the result."""
    sums = energy.angle_sums(minimum.corners)
    pinned = bool((energy.targets.tie == 0).any())
    u = minimum.u
    known = sums if pinned else energy.targets.angle
    layout = lay_out(
        surface.faces,
        energy.scaled_lengths(u),
        minimum.corners.angle,
        boundary.cone_angle_of(energy.targets, known, surface),
        surface.loops,
        len(surface.vertices),
    )
    return ConformalMap(
        surface=surface,
        log_scale=u,
        uv=layout.uv,
        sheet=layout.sheet,
        deck=layout.deck,
        boundary_angles=(sums[surface.loops[0]], sums[surface.loops[1]]),
        circumference=layout.circumference,
        iterations=minimum.iterations,
        residual=minimum.residual,
        closing_error=layout.closing_error,
    )


def _mean_on_area(surface: Surface, u: Floats) -> float:
    """Area-weighted mean of u: the domain is as large as the surface on (geometric) average."""
    a, b, c = surface.vertices[surface.faces.T]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return float(area @ u[surface.faces].mean(axis=1) / area.sum())


def _mean_on_boundary(surface: Surface, u: Floats) -> float:
    """Length-weighted mean of u along both loops: boundary lengths are kept on average."""
    total, weight = 0.0, 0.0
    for loop in surface.loops:
        following = np.roll(loop, -1)
        length = np.linalg.norm(surface.vertices[following] - surface.vertices[loop], axis=1)
        total += float(length @ (u[loop] + u[following]) / 2)
        weight += float(length.sum())
    return total / weight
