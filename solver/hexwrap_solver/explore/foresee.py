"""Stage 1: the variants of one frame, foreseen from their maps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Progress, no_progress
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.explore.predict import Outlook, outlook
from hexwrap_solver.explore.types import ExploreSettings, Figures
from hexwrap_solver.explore.variants import Frame, Variant, as_settings
from hexwrap_solver.panels.polygons import edge_lengths, fan_areas
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.place.placement import edge_angle
from hexwrap_solver.pattern.place.size import mean_stretch, wanted_edge
from hexwrap_solver.pipeline import Solution, SolveSettings, StageRunner, mapped
from hexwrap_solver.singularities.solve import chosen, frame_of
from hexwrap_solver.singularities.types import SingularityAt, SingularitySettings
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.threads import one_blas_thread

#: Metres of the units that a model may be in.
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}


@dataclass(frozen=True)
class Candidate:
    """A variant as a request, and what it will come to; foreseen: None where it cannot be, and then why.
    place: of the variant."""

    settings: SolveSettings
    foreseen: Figures | None
    problem: str = ""
    place: int = 0


def default_edge(
    take_in: Callable[[], Surface], settings: ExploreSettings, run: StageRunner, source: object = None
) -> float:
    """Edge length of the cells on the surface where none is asked for, model units. Raises HexwrapError."""
    pattern = settings.pattern
    if pattern.rotation in ("u", "v"):
        pattern = replace(pattern, rotation="edge")
    lattice = LATTICES[pattern.cell_kind]
    with one_blas_thread():
        cmap, _ = mapped(take_in, SolveSettings(pattern=pattern, panels=None), run, source=source)
    return wanted_edge(cmap, lattice, pattern, edge_angle(lattice, pattern)) * mean_stretch(cmap)


def foresee(
    take_in: Callable[[], Surface],
    settings: ExploreSettings,
    listed: tuple[Variant, ...],
    runner: Callable[[], StageRunner],
    *,
    source: object = None,
    progress: Progress = no_progress,
) -> tuple[Candidate, ...]:
    """Variants of one frame, in their order.

    runner: makes one for each way through the stages. Raises HexwrapError where the surface cannot be used.
    """
    with one_blas_thread():
        return tuple(_foresee(take_in, settings, listed, runner, source, progress))


def _foresee(
    take_in: Callable[[], Surface],
    settings: ExploreSettings,
    listed: tuple[Variant, ...],
    runner: Callable[[], StageRunner],
    source: object,
    progress: Progress,
) -> Iterator[Candidate]:
    run = runner()
    surface = run("surface", source, lambda progress: take_in())
    frame = listed[0].frame
    most = max(variant.singularities for variant in listed)
    seats: dict[int, tuple[SingularityAt, ...]] = {0: ()}
    if most:
        try:
            searched = run("seats", (frame, most), lambda progress: _seats(surface, frame, most))
            seats |= {len(at): at for at in searched}
        except HexwrapError:  # then there are the variants without
            pass
    # Such as an odd number with two straight ends: then the next smaller one.
    possible = [max(count for count in seats if count <= variant.singularities) for variant in listed]
    seen: dict[int, Outlook | str] = {}
    counts = sorted(set(possible))
    for i, count in enumerate(counts):
        progress(i / len(counts), f"{frame.boundary.mode}, {count} singularities")
        try:
            asked = as_settings(listed[0], settings, seats[count])
            cmap, _ = mapped(take_in, asked, runner(), source=source)
            seen[count] = outlook(cmap, frame.pattern)
        except HexwrapError as error:
            seen[count] = error.detail
    for variant, count in zip(listed, possible, strict=True):
        found = _candidate(variant, settings, seats[count], seen[count], surface.unit)
        yield replace(found, place=variant.place)


def _seats(surface: Surface, frame: Frame, most: int) -> tuple[tuple[SingularityAt, ...], ...]:
    """The best places for each number of singularities that is possible, as a request says them."""
    boundary, asked = frame.boundary.adapted(frame.pattern.cell_kind), SingularitySettings(count=most)
    found = chosen(surface, frame_of(surface, boundary, asked, frame.pattern, None), asked)
    return tuple(
        tuple(
            SingularityAt(index=int(k), point=tuple(surface.vertices[v].tolist()))
            for v, k in zip(one.vertex, one.index, strict=True)
        )
        for one in found.proposals
    )


def _candidate(
    variant: Variant,
    settings: ExploreSettings,
    at: tuple[SingularityAt, ...],
    seen: Outlook | str,
    unit: str | None,
) -> Candidate:
    asked = as_settings(variant, settings, at)
    if isinstance(seen, str):
        return Candidate(asked, None, seen)
    found = seen.foresee(variant.sizes, variant.joint)
    if not found.panels:
        return Candidate(asked, None, "No cell has room for a panel.")
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
