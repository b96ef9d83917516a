"""Stage 1: the variants of one frame, foreseen from their maps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.errors import HexwrapError, PanelsError, PatternError
from hexwrap_solver.explore.predict import Outlook, outlook
from hexwrap_solver.explore.types import ExploreSettings, Figures
from hexwrap_solver.explore.variants import AROUND_DEFAULT, Frame, Variant, as_settings
from hexwrap_solver.panels.polygons import edge_lengths, fan_areas
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.place.placement import edge_angle
from hexwrap_solver.pattern.place.rotation import check_parameters
from hexwrap_solver.pattern.place.sense import check_edge
from hexwrap_solver.pattern.place.size import mean_stretch, wanted_edge
from hexwrap_solver.pipeline import Solution, SolveSettings, StageRunner, mapped
from hexwrap_solver.singularities.solve import chosen, frame_of, needs_singularities
from hexwrap_solver.singularities.types import SingularityAt, SingularitySettings
from hexwrap_solver.surface.holes import fill_openings
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.threads import one_blas_thread

#: Metres of the units that a model may be in.
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}


#: Where the singularities of a variant stand.
Seats = tuple[SingularityAt, ...]


@dataclass(frozen=True)
class Candidate:
    """A variant as a request, and what it will come to, or why it cannot be."""

    settings: SolveSettings
    foreseen: Figures | HexwrapError


def default_edge(
    take_in: Callable[[], Surface], settings: ExploreSettings, run: StageRunner, source: object = None
) -> float | None:
    """Edge length of the cells on the surface, model units; longer where the smallest cells that are tried
    about it would be more than the limit of panels allows; None where a size is asked for.

    Raises HexwrapError, also for a pattern that no variant can have on this surface.
    """
    pattern, vary = settings.pattern, settings.vary
    surface = run("surface", source, lambda progress: take_in())
    varies = vary.edge_length is not None or vary.around is not None
    if not varies:
        check_edge(surface, pattern)
    if pattern.rotation in ("u", "v"):
        if vary.rotation is None:
            check_parameters(surface)
        pattern = replace(pattern, rotation="edge")
    if varies or pattern.edge_length is not None or pattern.around is not None:
        return None
    lattice = LATTICES[pattern.cell_kind]
    with one_blas_thread():
        cmap, _ = mapped(take_in, SolveSettings(pattern=pattern, panels=None), run, source=source)
    edge = wanted_edge(cmap, lattice, pattern, edge_angle(lattice, pattern)) * mean_stretch(cmap)
    area = float(cmap.surface.areas.sum())
    fewest = area / (lattice.cell_area / lattice.edge**2 * (settings.limits.panels or np.inf))
    return max(edge, float(np.sqrt(fewest)) / AROUND_DEFAULT[0])


def seated(
    take_in: Callable[[], Surface],
    settings: ExploreSettings,
    listed: Sequence[Variant],
    run: StageRunner,
    source: object = None,
) -> list[tuple[Seats, tuple[Variant, ...]]]:
    """Variants of one frame, those of as many singularities together, ascending, and where these stand.

    Where a number is impossible, such as an odd one with two straight ends, the next smaller one is taken,
    or the smallest there is: a dome whose edge is straight needs six. Raises HexwrapError where the surface
    cannot be used.
    """
    with one_blas_thread():
        surface = run("surface", source, lambda progress: take_in())
        seats = _searched(surface, listed[0].frame, settings, run)
    fewest = min(seats)
    parts: dict[int, list[Variant]] = {}
    for variant in listed:
        count = max(count for count in seats if count <= max(variant.singularities, fewest))
        parts.setdefault(count, []).append(variant)
    return [(seats[count], tuple(parts[count])) for count in sorted(parts)]


def foresee(
    take_in: Callable[[], Surface],
    settings: ExploreSettings,
    at: Seats,
    listed: Sequence[Variant],
    run: StageRunner,
    *,
    source: object = None,
) -> tuple[Candidate, ...]:
    """Variants of one frame, in their order, with singularities there, or as few as there must be: they
    share their map."""
    frame = listed[0].frame
    with one_blas_thread():
        try:
            if not at:
                surface = run("surface", source, lambda progress: take_in())
                if _needed(surface, frame):
                    seats = _searched(surface, frame, settings, run)
                    at = seats[min(seats)]
            cmap, _ = mapped(take_in, as_settings(listed[0], settings, at), run, source=source)
            seen = outlook(cmap, frame.pattern)
        except HexwrapError as error:
            return tuple(Candidate(as_settings(one, settings, at), error) for one in listed)
    return tuple(
        _candidate(as_settings(one, settings, at), settings, seen, cmap.surface.unit) for one in listed
    )


def _searched(
    surface: Surface, frame: Frame, settings: ExploreSettings, run: StageRunner
) -> dict[int, Seats]:
    """The best places for each number of singularities that is possible; none where none are."""
    most = max(settings.vary.singularities)
    try:
        found = run("seats", (frame, most), lambda progress: _seats(surface, frame, most))
    except HexwrapError:  # then there are the variants without
        found = ((),)
    return {len(at): at for at in found}


def _needed(surface: Surface, frame: Frame) -> bool:
    return needs_singularities(surface, frame.boundary.adapted(frame.pattern.cell_kind))


def _seats(surface: Surface, frame: Frame, most: int) -> tuple[Seats, ...]:
    """As a request says them."""
    needed = _needed(surface, frame)
    boundary = frame.boundary.adapted(frame.pattern.cell_kind)
    asked = SingularitySettings(count="auto" if needed else most)
    surface = fill_openings(surface)
    found = chosen(surface, frame_of(surface, boundary, asked, frame.pattern, None), asked)
    placed = tuple(
        tuple(
            SingularityAt(index=int(k), point=tuple(surface.vertices[v].tolist()))
            for v, k in zip(one.vertex, one.index, strict=True)
        )
        for one in found.proposals
    )
    return placed if needed else ((), *placed)


def _candidate(asked: SolveSettings, settings: ExploreSettings, seen: Outlook, unit: str | None) -> Candidate:
    assert asked.panels is not None
    sizes = asked.panels.sizes
    assert isinstance(sizes, int)
    panels = asked.panels
    found = seen.foresee(sizes, panels.joint, panels.edge_range, panels.increment)
    if not found.panels:
        if not len(seen.size):
            return Candidate(asked, PatternError("No whole cell fits: ask for smaller cells."))
        if panels.increment > 0 and seen.foresee(sizes, panels.joint).panels:
            sentence = (
                f"The increment {panels.increment:g} is longer than any panel may be: ask for a smaller "
            )
            return Candidate(asked, PanelsError(f"{sentence}one, or larger cells.", field=("increment",)))
        return Candidate(
            asked,
            PanelsError(
                "No cell has room for a panel between such joints: ask for narrower joints or larger cells.",
                field=("joint",),
            ),
        )
    cost = settings.cost.of(
        found.types, found.panels, found.area, found.perimeter, METRES.get(unit or "m", 1.0)
    )
    return Candidate(asked, Figures(found.uncovered, found.panels, found.types, cost, bare=found.bare))


def measured(solution: Solution, settings: ExploreSettings) -> Figures:
    """The same of a finished solution. Trimmed panels are all different."""
    panels, quality = solution.panels, solution.quality
    assert panels is not None
    gap = quality.gap_tangential
    finite = np.zeros(0) if gap is None else gap[np.isfinite(gap)]
    types = len(panels.class_length) + int((panels.size < 0).sum())
    cost = settings.cost.of(
        types,
        panels.n_panels,
        float(fan_areas(panels.polygons).sum()),
        float(edge_lengths(panels.polygons).sum()),
        METRES.get(solution.map.surface.unit or "m", 1.0),
    )
    widest = float(finite.max()) if len(finite) else None
    return Figures(1 - quality.coverage, panels.n_panels, types, cost, widest, quality.bare)
