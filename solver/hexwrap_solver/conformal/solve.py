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
from hexwrap_solver.conformal.robust import FlatMetric, metric_with_flips, solve_with_flips, with_inserted
from hexwrap_solver.conformal.span import MAX_SPAN, check_reach, check_span
from hexwrap_solver.conformal.types import QUANTA, BoundaryCondition, ConformalMap, Deck, Targets
from hexwrap_solver.surface.types import Surface

#: Cone angles this near to a multiple of the quantum are one, radians.
NOISE = 1e-9
NO_ANGLES = (
    "The boundary's mode is angles, but its list of angles is empty: every boundary angle is 180°, as with"
    " straight."
)


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
    targets = boundary.straight(surface)
    notes: tuple[str, ...] = ()
    if condition.mode == "angles":
        targets = boundary.prescribed(surface, boundary_angles(surface, condition))
        if not condition.angles:
            notes = (NO_ANGLES,)
    found = _map(surface, targets, None, progress)
    found = replace(found, notes=(*notes, *found.notes))
    return _scaled(found, -_mean_on_area(found.surface, found.log_scale))


def _isometric(surface: Surface, condition: BoundaryCondition, progress: Progress) -> ConformalMap:
    """The paper's two steps: u = 0 on the boundary, then again with the cone angle rounded to the quantum."""
    targets = boundary.isometric(surface)
    quantum = QUANTA.get(condition.quantum)
    if quantum is None:
        return _map(surface, targets, None, progress)
    plain = _plain(surface, targets, None, _part(progress, 0.0))
    first = plain.metric if plain.holds else metric_with_flips(surface, targets, progress, plain.start)
    inserted = len(first.surface.vertices) - len(surface.vertices)
    surface, loops = first.surface, first.surface.loops
    angles = first.sums[loops[0]], first.sums[loops[1]]
    found = (boundary.cone_angle(angles[0]) - boundary.cone_angle(angles[1])) / 2
    rounded = boundary.nearest_multiple(found, quantum)
    if condition.spread == "optimal":
        targets = boundary.constant_on_loops(surface, rounded)
    else:
        spread = boundary.spread_evenly
        targets = boundary.prescribed(surface, (spread(angles[0], rounded), spread(angles[1], -rounded)))
    second = _map(surface, targets, first.u, _part(progress, 0.5), flips=not plain.holds)
    second = _scaled(second, -_mean_on_boundary(second.surface, second.log_scale))
    second = with_inserted(second, inserted)
    return replace(second, notes=(*_rounding_notes(found, rounded), *second.notes))


def _part(progress: Progress, begin: float) -> Progress:
    """One half of the progress."""
    return lambda fraction, what: progress(begin + fraction / 2, what)


def _rounding_notes(found: float, rounded: float) -> tuple[str, ...]:
    if abs(found - rounded) <= NOISE:
        return ()
    shape = "a cylinder" if rounded == 0 else f"a cone angle of {np.degrees(rounded):.6g}°"
    return (
        f"The isometric boundary has a cone angle of {np.degrees(found):.4g}°; the domain was given {shape}.",
    )


@dataclass(frozen=True)
class _Plain:
    """What Newton's method finds on the triangles as they are."""

    surface: Surface
    energy: Energy
    minimum: Minimum

    @property
    def holds(self) -> bool:
        """Whether it is a flat metric."""
        return self.minimum.converged and not self.minimum.broken

    @property
    def metric(self) -> FlatMetric:
        return FlatMetric(self.surface, self.minimum.u, self.energy.angle_sums(self.minimum.corners))

    @property
    def start(self) -> Floats | None:
        """Where a search with flips may start; None where this one ran away."""
        return self.minimum.u if np.ptp(self.minimum.u) < MAX_SPAN else None


def _plain(surface: Surface, targets: Targets, start: Floats | None, progress: Progress) -> _Plain:
    energy = Energy(surface, targets)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # where u runs away, flips take over
        return _Plain(surface, energy, minimise(energy, start, progress))


def _map(
    surface: Surface, targets: Targets, start: Floats | None, progress: Progress, flips: bool = False
) -> ConformalMap:
    """On the triangles as they are where that works; with flips where it does not, where triangles turn over
    in the layout (be it by rounding), or from the beginning. With free u its scale is arbitrary."""
    if not flips:
        plain = _plain(surface, targets, start, progress)
        if plain.holds:
            found = _finish(plain)
            if positive(found.corners()).all() and faithful(found):
                return found
        start = start if plain.start is None else plain.start
    return solve_with_flips(surface, targets, progress, start)


def _scaled(found: ConformalMap, shift: float) -> ConformalMap:
    """The same map with a domain e^shift times as large. Raises ConvergenceError beyond all doubles."""
    u = found.log_scale + shift
    check_reach(u, found.deck.angle)
    factor = float(np.exp(shift))
    return replace(
        found,
        log_scale=u,
        uv=found.uv * factor,
        deck=Deck(found.deck.angle, found.deck.translation * factor),
        circumference=found.circumference * factor,
    )


def _finish(plain: _Plain) -> ConformalMap:
    """Layout and everything measured on the result."""
    surface, energy, minimum, u = plain.surface, plain.energy, plain.minimum, plain.minimum.u
    sums = energy.angle_sums(minimum.corners)
    pinned = bool((energy.targets.tie == 0).any())
    known = sums if pinned else energy.targets.angle
    angle = boundary.cone_angle_of(energy.targets, known, surface)
    check_span(u, angle)
    layout = lay_out(
        surface,
        energy.scaled_lengths(u),
        minimum.corners,
        angle,
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
