"""The periodic conformal map of an annulus (paper, section 3)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Floats, Progress, no_progress
from hexwrap_solver.conformal import boundary
from hexwrap_solver.conformal.corners import boundary_angles
from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.layout import lay_out
from hexwrap_solver.conformal.newton import Minimum, minimise
from hexwrap_solver.conformal.orientation import faithful, positive
from hexwrap_solver.conformal.robust import solve_with_flips, with_inserted
from hexwrap_solver.conformal.span import MAX_SPAN, check_reach, check_span
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap, Deck, Targets
from hexwrap_solver.surface.types import Surface

#: Angle sums this near to their targets make u a start for the search with flips, radians.
CLOSE = 0.5


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
    targets = boundary.isometric(surface)
    if condition.quantum is None:
        return _map(surface, targets, None, progress)
    first = _metric(surface, targets, None, _part(progress, 0.0))
    if isinstance(first, ConformalMap):
        surface, u, angles = first.surface, first.log_scale, first.boundary_angles
    else:
        sums = first.energy.angle_sums(first.minimum.corners)
        u, angles = first.minimum.u, (sums[surface.loops[0]], sums[surface.loops[1]])
    found = (boundary.cone_angle(angles[0]) - boundary.cone_angle(angles[1])) / 2
    rounded = boundary.nearest_multiple(found, condition.quantum)
    if condition.spread == "optimal":
        targets = boundary.constant_on_loops(surface, rounded)
    else:
        spread = boundary.spread_evenly
        targets = boundary.prescribed(surface, (spread(angles[0], rounded), spread(angles[1], -rounded)))
    second = _map(surface, targets, u, _part(progress, 0.5), keep_boundary=True)
    if isinstance(first, ConformalMap):
        second = with_inserted(second, first.inserted)
    return replace(second, notes=(_rounding_note(found, rounded), *second.notes))


def _part(progress: Progress, begin: float) -> Progress:
    """One half of the progress."""
    return lambda fraction, what: progress(begin + fraction / 2, what)


def _rounding_note(found: float, rounded: float) -> str:
    shape = "a cylinder" if rounded == 0 else f"a cone angle of {np.degrees(rounded):.6g}°"
    return (
        f"The isometric boundary has a cone angle of {np.degrees(found):.4g}°; the domain was given {shape}."
    )


def _useful(minimum: Minimum) -> bool:
    """Whether the search with flips may start where the one without them ended."""
    return minimum.residual < CLOSE and bool(np.ptp(minimum.u) < MAX_SPAN)


@dataclass(frozen=True)
class _Plain:
    """A flat metric on the triangles as they are."""

    energy: Energy
    minimum: Minimum


def _metric(
    surface: Surface, targets: Targets, start: Floats | None, progress: Progress
) -> _Plain | ConformalMap:
    """On the triangles as they are where that works, otherwise with flips (which lay the map out at once)."""
    energy = Energy(surface, targets)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # where u runs away, flips take over
        minimum = minimise(energy, start, progress)
    if not minimum.converged or minimum.broken:
        return solve_with_flips(surface, targets, progress, minimum.u if _useful(minimum) else start)
    check_span(minimum.u, boundary.cone_angle_of(targets, energy.angle_sums(minimum.corners), surface))
    return _Plain(energy, minimum)


def _map(
    surface: Surface, targets: Targets, start: Floats | None, progress: Progress, keep_boundary: bool = False
) -> ConformalMap:
    """Metric, layout, and with flips where triangles turn over in the layout, be it by rounding."""
    found = _metric(surface, targets, start, progress)
    if isinstance(found, _Plain):
        found = _finish(surface, found.energy, found.minimum)
        if not (positive(found.corners()).all() and faithful(found)):
            found = solve_with_flips(surface, targets, progress, start)
    if (targets.tie == 0).any():
        return found
    u = found.log_scale
    mean = _mean_on_boundary(found.surface, u) if keep_boundary else _mean_on_area(found.surface, u)
    check_reach(u - mean, found.deck.angle)
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
        surface,
        energy.scaled_lengths(u),
        minimum.corners.angle,
        boundary.cone_angle_of(energy.targets, known, surface),
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
    a, b, c = surface.faces.T
    x, y, z = ((column[b] - column[a], column[c] - column[a]) for column in surface.vertices.T)
    normal = [p[0] * q[1] - p[1] * q[0] for p, q in ((y, z), (z, x), (x, y))]
    area = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    return float(area @ (u[a] + u[b] + u[c]) / (3 * area.sum()))


def _mean_on_boundary(surface: Surface, u: Floats) -> float:
    """Length-weighted mean of u along both loops: boundary lengths are kept on average."""
    total, weight = 0.0, 0.0
    for loop in surface.loops:
        following = np.roll(loop, -1)
        length = np.linalg.norm(surface.vertices[following] - surface.vertices[loop], axis=1)
        total += float(length @ (u[loop] + u[following]) / 2)
        weight += float(length.sum())
    return total / weight
