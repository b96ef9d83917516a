"""The periodic conformal map of an annulus (paper, section 3)."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Progress, no_progress
from hexwrap_solver.conformal import boundary
from hexwrap_solver.conformal.corners import boundary_angles
from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.layout import lay_out
from hexwrap_solver.conformal.newton import Minimum, minimise
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap, Targets
from hexwrap_solver.errors import ConvergenceError
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
    rounded = boundary.nearest_multiple(first.deck.angle, condition.quantum)
    if condition.spread == "optimal":
        targets = boundary.constant_on_loops(surface, rounded)
    else:
        angles = [
            boundary.spread_evenly(sums, wanted)
            for sums, wanted in zip(first.boundary_angles, (rounded, -rounded), strict=True)
        ]
        targets = boundary.prescribed(surface, (angles[0], angles[1]))
    return _map(surface, targets, first.log_scale, progress, keep_boundary=True)


def _map(
    surface: Surface, targets: Targets, start: Floats | None, progress: Progress, keep_boundary: bool = False
) -> ConformalMap:
    energy = Energy(surface, targets)
    minimum = minimise(energy, start, progress)
    if not minimum.converged or minimum.broken:
        raise ConvergenceError(
            f"Newton's method ended after {minimum.iterations} steps with a residual of "
            f"{minimum.residual:.1e} rad and {minimum.broken} broken triangles."
        )
    return _finish(surface, energy, minimum, keep_boundary)


def _finish(surface: Surface, energy: Energy, minimum: Minimum, keep_boundary: bool) -> ConformalMap:
    """Gauge, layout and everything measured on the result."""
    sums = energy.angle_sums(minimum.corners)
    pinned = bool((energy.targets.tie == 0).any())
    u = minimum.u
    if not pinned:
        u = u - (_mean_on_boundary(surface, u) if keep_boundary else _mean_on_area(surface, u))
    known = sums if pinned else energy.targets.angle
    layout = lay_out(
        surface.faces,
        energy.scaled_lengths(u),
        minimum.corners.angle,
        _cone_angle(energy.targets, known, surface),
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


def _cone_angle(targets: Targets, sums: Floats, surface: Surface) -> float:
    """K, exactly as prescribed where it is: Σκ over loop 0, or −Σκ over a tied loop 1."""
    if len(targets.tie_angle) > 1:
        angle = float(targets.tie_angle[1]) - len(surface.loops[1]) * np.pi
    else:
        angle = boundary.cone_angle(sums[surface.loops[0]])
    return boundary.snapped(angle)


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
