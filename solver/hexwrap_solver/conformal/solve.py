"""The discrete conformal map of a surface (paper, section 3)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Floats, Progress, no_progress
from hexwrap_solver.conformal import boundary
from hexwrap_solver.conformal.better import corner_notes
from hexwrap_solver.conformal.corners import boundary_angles
from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.fixed import Minimum, minimise
from hexwrap_solver.conformal.layout import lay_out
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.openings import cut_openings
from hexwrap_solver.conformal.orientation import faithful, positively_oriented
from hexwrap_solver.conformal.robust import FlatMetric, metric_with_flips, solve_with_flips, with_inserted
from hexwrap_solver.conformal.robust.refine import fine_enough
from hexwrap_solver.conformal.robust.solve import REFINED
from hexwrap_solver.conformal.span import MAX_SPAN, check_reach, check_span, cone_angle_of
from hexwrap_solver.conformal.types import (
    QUANTA,
    BoundaryCondition,
    Cones,
    ConformalMap,
    Deck,
    Targets,
    Unrolled,
)
from hexwrap_solver.errors import ConvergenceError, SingularitiesError
from hexwrap_solver.surface.holes import fill_openings
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.tolerances import ANGLE

#: A cone angle this near to a multiple of π/6 is made one, radians, where the map does not come out with the
#: angle as it is: its apex would lie so far away that coordinates lose the digits in which they differ.
NEARLY = 1e-7
#: Where u changes by more along an edge of a folded surface of fewer vertices, it gets this many.
STEEP, FEW, ENOUGH = 0.15, 100, 1000
#: Smaller relative errors of boundary lengths are not worth a note.
TELLING = 1e-6
NO_ANGLES = (
    "The boundary's mode is angles, but its list of angles is empty: every boundary angle is 180°, as with"
    " straight."
)


def conformal_map(
    surface: Surface,
    condition: BoundaryCondition,
    progress: Progress = no_progress,
    cones: Cones | None = None,
) -> ConformalMap:
    """Maps a surface of genus 0 to a flat domain: an annulus to a cylinder or cone of revolution, unrolled,
    any other surface, and one with singularities, to a net. Openings to be cut are filled before and cut out
    afterwards.

    The domain has the surface's scale: the area-weighted mean of u is 0, or, with an isometric boundary,
    the length-weighted mean of u along the isometric loops.
    Raises RequestError (boundary condition, singularities), ConvergenceError.
    """
    if surface.openings:
        return cut_openings(conformal_map(fill_openings(surface), condition, progress, cones), surface)
    cones = Cones.none() if cones is None else cones
    check_cones(surface, cones)
    found = _on_mesh(surface, condition, progress, cones)
    if not _coarse(found):
        return found
    try:
        finer = _on_mesh(fine_enough(surface, ENOUGH), condition, progress, cones)
    except ConvergenceError:
        return found
    count = len(finer.surface.vertices) - len(surface.vertices)
    sentence = (
        f"{REFINED} {count} vertices were inserted on its edges, since between the few that were sent the "
        "size of the cells changes much."
    )
    notes = tuple(note for note in finer.notes if not note.startswith(REFINED))
    return replace(finer, inserted=count, notes=(*notes, sentence))


def _coarse(found: ConformalMap) -> bool:
    """Whether the mesh of a folded surface has too few vertices for u. Its flat sides are the same in more
    triangles, while those of a mesh of a round surface are what was sent."""
    surface = found.surface
    if not surface.features or found.inserted or found.flips or len(surface.vertices) >= FEW:
        return False
    return bool(np.ptp(found.log_scale[surface.faces], axis=1).max() > STEEP)


def _on_mesh(
    surface: Surface, condition: BoundaryCondition, progress: Progress, cones: Cones
) -> ConformalMap:
    """On the triangles as they are, where that works."""
    angles = boundary_angles(surface, condition, cones)
    found = _isometric(surface, condition, angles, cones, progress)
    if found is None:
        targets = boundary.targets(surface, [a for a in angles if a is not None], cones)
        plain = _plain(surface, targets, None, progress)
        found = on_area(map_to(surface, targets, cones, None, progress, plain=plain))
        if found.surface is surface and not found.flips and not len(cones):
            noted = corner_notes(surface, plain.energy, plain.minimum)
            found = replace(found, notes=(*found.notes, *noted))
    if condition.mode == "angles" and not condition.angles:
        found = replace(found, notes=(NO_ANGLES, *found.notes))
    return found


def check_cones(surface: Surface, cones: Cones) -> None:
    """Raises SingularitiesError for cones on the boundary, two at one vertex, and angles of 0 or less."""
    sent = surface.input_vertex[cones.vertex]
    inner = np.ones(len(surface.vertices), dtype=bool)
    inner[surface.boundary] = False
    outside = np.flatnonzero(~inner[cones.vertex])
    if len(outside):
        raise SingularitiesError(
            f"Singularity {outside[0]} stands at vertex {sent[outside[0]]} of the boundary: singularities "
            "lie inside; list an angle there instead.",
            vertices=sent[outside],
            field=("at", int(outside[0])),
        )
    if len(np.unique(cones.vertex)) < len(cones):
        raise SingularitiesError("Two singularities stand at one vertex of the mesh; place them apart.")
    sharp = np.flatnonzero(cones.curvature >= 2 * np.pi - ANGLE)
    if len(sharp):
        raise SingularitiesError(
            f"Singularity {sharp[0]} has index {cones.index[sharp[0]]}, which would leave nothing of the "
            f"angle of 360° around it; with a quantum of {np.degrees(cones.quantum):.4g}° it must be less "
            f"than {round(2 * np.pi / cones.quantum)}.",
            vertices=sent[sharp],
            field=("at", int(sharp[0]), "index"),
        )


def _isometric(
    surface: Surface,
    condition: BoundaryCondition,
    angles: tuple[Floats | None, ...],
    cones: Cones,
    progress: Progress,
) -> ConformalMap | None:
    """The paper's two steps: u = 0 on the isometric loops, then again with their curvatures rounded to the
    quantum. None where no loop is isometric."""
    free = [i for i, listed in enumerate(angles) if listed is None]
    if not free:
        return None
    asked: list[boundary.LoopTarget] = ["isometric" if listed is None else listed for listed in angles]
    targets = boundary.targets(surface, asked, cones)
    total = boundary.gauss_bonnet(surface) - float(cones.curvature.sum())
    total -= sum(boundary.cone_angle(listed) for listed in angles if listed is not None)
    quantum = QUANTA.get(condition.quantum)
    refusal: ConvergenceError | None = None
    if quantum is None or len(free) == 1:  # what Gauss–Bonnet leaves to a single loop cannot be rounded
        try:
            found = map_to(surface, targets, cones, None, progress)
            found = replace(found, notes=(*found.notes, *_rim_notes(found, free)))
            return found if quantum is None else scaled(found, -_mean_on(found, free))
        except ConvergenceError as error:
            if len(free) == 1:
                raise
            quantum, refusal = np.pi / 6, error
    plain = _plain(surface, targets, None, _part(progress, 0.0))
    first = plain.metric if plain.holds else metric_with_flips(surface, targets, progress, plain.start, cones)
    inserted = len(first.surface.vertices) - len(surface.vertices)
    surface = first.surface
    sums = [first.sums[loop] for loop in surface.loops]
    curvature = np.array([boundary.cone_angle(sums[i]) for i in free])
    curvature -= (curvature.sum() - total) / len(free)
    rounded = boundary.rounded_jointly(curvature, quantum, total)
    if refusal is not None and np.abs(curvature - rounded).max() > NEARLY:
        raise refusal
    asked = [first.targets.angle[loop] for loop in surface.loops]
    for i, K in zip(free, rounded, strict=True):
        asked[i] = float(K) if condition.spread == "optimal" else boundary.spread_evenly(sums[i], K)
    targets = boundary.targets(surface, asked, cones)
    second = map_to(surface, targets, cones, first.u, _part(progress, 0.5), flips=not plain.holds)
    second = with_inserted(scaled(second, -_mean_on(second, free)), inserted)
    notes = (*_rounding_notes(surface, free, curvature, rounded), *second.notes, *_rim_notes(second, free))
    return replace(second, notes=notes)


def map_of_curvatures(surface: Surface, curvature: Floats, progress: Progress = no_progress) -> ConformalMap:
    """The map with u constant along every loop, whose curvature is prescribed, (b,) radians; that of the
    first is what Gauss–Bonnet leaves. Raises ConvergenceError."""
    targets = boundary.targets(surface, [float(K) for K in curvature])
    return on_area(map_to(surface, targets, Cones.none(), None, progress))


def _rim_notes(found: ConformalMap, loops: list[int]) -> tuple[str, ...]:
    """How far edges of isometric loops are from their length, where flips have taken other edges for them."""
    if not found.flips:
        return ()
    surface, u = found.surface, found.log_scale
    on_loop = np.zeros(len(u), dtype=bool)
    for i in loops:
        on_loop[surface.loops[i]] = True
    h = np.flatnonzero((surface.twin < 0) & on_loop[surface.faces.ravel()])
    face, c = h // 3, h % 3
    corners = found.corners()
    drawn = np.abs(corners[face, (c + 1) % 3] - corners[face, c])
    ends = surface.faces[face, c], surface.faces[face, (c + 1) % 3]
    off = np.abs(np.log(drawn / surface.lengths.ravel()[h]) - (u[ends[0]] + u[ends[1]]) / 2)
    if float(off.max(initial=0)) < TELLING:
        return ()
    return (
        f"Where edges were flipped, those of the isometric boundary keep their lengths only to within "
        f"{100 * np.expm1(off.max()):.2g} %.",
    )


def _part(progress: Progress, begin: float) -> Progress:
    """One half of the progress."""
    return lambda fraction, what: progress(begin + fraction / 2, what)


def _rounding_notes(surface: Surface, free: list[int], found: Floats, rounded: Floats) -> tuple[str, ...]:
    changed = np.flatnonzero(np.abs(found - rounded) > ANGLE)
    if not len(changed):
        return ()
    if len(surface.loops) == 2 == len(free):
        shape = "a cylinder" if rounded[0] == 0 else f"a cone angle of {np.degrees(rounded[0]):.6g}°"
        return (
            f"The isometric boundary has a cone angle of {np.degrees(found[0]):.4g}°; the domain was given "
            f"{shape}.",
        )
    changes = [
        f"{np.degrees(found[i]):.4g}° to {np.degrees(rounded[i]):.6g}° on loop {free[i]}" for i in changed[:4]
    ]
    more = f" and {len(changed) - 4} more" if len(changed) > 4 else ""
    return (f"Curvatures of the isometric loops were rounded from {', '.join(changes)}{more}.",)


@dataclass(frozen=True)
class _Plain:
    """What Newton's method finds on the triangles as they are."""

    surface: Surface
    energy: Energy
    minimum: Minimum

    @property
    def holds(self) -> bool:
        """Whether it is a flat metric."""
        return self.minimum.converged and not self.minimum.violating

    @property
    def metric(self) -> FlatMetric:
        sums = self.energy.angle_sums(self.minimum.corners)
        return FlatMetric(self.surface, self.minimum.u, sums, self.energy.targets)

    @property
    def start(self) -> Floats | None:
        """Where a search with flips may start; None where this one ran away."""
        return self.minimum.u if np.ptp(self.minimum.u) < MAX_SPAN else None


def _plain(surface: Surface, targets: Targets, start: Floats | None, progress: Progress) -> _Plain:
    energy = Energy(surface, targets)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # where u runs away, flips take over
        return _Plain(surface, energy, minimise(energy, start, progress))


def map_to(
    surface: Surface,
    targets: Targets,
    cones: Cones,
    start: Floats | None = None,
    progress: Progress = no_progress,
    flips: bool = False,
    plain: _Plain | None = None,
) -> ConformalMap:
    """The map of given targets, which hold the cones' angles: on the triangles as they are where that works;
    with flips where it does not, where triangles turn over in the layout (be it by rounding), or from the
    beginning. start: (n,) u to start from. plain: what is known on the triangles as they are. With free u its
    scale is arbitrary. Raises ConvergenceError."""
    if not flips:
        plain = plain or _plain(surface, targets, start, progress)
        if plain.holds:
            found = _finish(plain, cones)
            if positively_oriented(found.corners()).all() and faithful(found):
                return found
        start = start if plain.start is None else plain.start
    return solve_with_flips(surface, targets, progress, start, cones)


def scaled(found: ConformalMap, shift: float) -> ConformalMap:
    """The same map with a domain e^shift times as large. Raises ConvergenceError beyond all doubles."""
    u = found.log_scale + shift
    factor = float(np.exp(shift))
    domain = found.domain
    if isinstance(domain, Net):
        check_reach(u, None)
        return replace(found, log_scale=u, domain=domain.moved(factor, 0.0))
    check_reach(u, domain.deck.angle)
    deck = Deck(domain.deck.angle, domain.deck.translation * factor)
    larger = Unrolled(domain.uv * factor, domain.sheet, deck, domain.circumference * factor)
    return replace(found, log_scale=u, domain=larger)


def _finish(plain: _Plain, cones: Cones) -> ConformalMap:
    """Layout and everything measured on the result."""
    surface, energy, minimum, u = plain.surface, plain.energy, plain.minimum, plain.minimum.u
    sums = energy.angle_sums(minimum.corners)
    curvature = boundary.curvatures(energy.targets, sums, surface, cones)
    check_span(u, cone_angle_of(surface, curvature))
    layout = lay_out(surface, energy.scaled_lengths(u), minimum.corners, curvature, cones.vertex)
    return ConformalMap(
        surface=surface,
        log_scale=u,
        domain=layout.domain,
        boundary_angles=tuple(sums[loop] for loop in surface.loops),
        iterations=minimum.iterations,
        residual=minimum.residual,
        closing_error=layout.closing_error,
        cones=cones,
    )


def on_area(found: ConformalMap) -> ConformalMap:
    """Scaled so that the area-weighted mean of u is 0: the domain is as large as the surface on (geometric)
    average."""
    surface, u = found.surface, found.log_scale
    mean = surface.areas @ u[surface.faces].sum(axis=1) / (3 * surface.areas.sum())
    return scaled(found, -float(mean))


def _mean_on(found: ConformalMap, loops: list[int]) -> float:
    """Length-weighted mean of u along some loops: boundary lengths are kept on average."""
    surface, u = found.surface, found.log_scale
    total, weight = 0.0, 0.0
    for i in loops:
        loop = surface.loops[i]
        following = np.roll(loop, -1)
        length = np.linalg.norm(surface.vertices[following] - surface.vertices[loop], axis=1)
        total += float(length @ (u[loop] + u[following]) / 2)
        weight += float(length.sum())
    return total / weight
