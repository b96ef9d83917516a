"""The whole way from a surface to panels (paper, Figure 2), stage by stage.

A ``StageRunner`` decides how a stage is run: by default it is simply called; the service passes one that
remembers finished stages under a hash of everything they depend on, and reports progress.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Protocol, TypeVar

from hexwrap_solver.arrays import Progress, no_progress
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.robust.refine import fine_enough
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.explore import best_boundary_map
from hexwrap_solver.explore.offers import (
    BARE,
    Offer,
    OtherKey,
    Trimmed,
    corners_offer,
    isometric_bounds,
    isometric_map,
    isometric_offer,
    outlook_offer,
    plain_is_better,
    trim_offer,
)
from hexwrap_solver.explore.worth import or_plain
from hexwrap_solver.panels import fit_panels, make_components, measure, quantize, support
from hexwrap_solver.panels.fit import fit_key
from hexwrap_solver.panels.quantize import curve_key, size_key, trade_off
from hexwrap_solver.panels.types import Components, ComponentSettings, Panels, PanelSettings, Quality, Support
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from hexwrap_solver.setting import Setting
from hexwrap_solver.singularities.outlook import PATCHES, ProspectKey, outlook, prospects, seats, worth_a_look
from hexwrap_solver.singularities.solve import SIZES, closed_map, needs_singularities, seated
from hexwrap_solver.singularities.types import Choices, SingularitySettings
from hexwrap_solver.surface.curvature import is_flat_with_cones, saddle_share
from hexwrap_solver.surface.holes import fill_openings
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.threads import one_blas_thread

T = TypeVar("T")

#: A smaller share of the surface curved like a saddle may be noise of the mesh.
SADDLE = 0.02


class StageRunner(Protocol):
    """Runs one stage. settings: all that the stage depends on besides the stages before it. after: of a stage
    beside the others, on which none depends, the last one that it depends on itself."""

    def __call__(
        self, stage: str, settings: Any, compute: Callable[[Progress], T], after: str | None = None
    ) -> T: ...


@dataclass
class PlainRunner:
    """Calls each stage and keeps its wall time in seconds."""

    progress: Progress = no_progress
    timings: dict[str, float] = field(default_factory=dict)

    def __call__(
        self, stage: str, settings: Any, compute: Callable[[Progress], T], after: str | None = None
    ) -> T:
        start = time.perf_counter()
        result = compute(self.progress)
        self.timings[stage] = time.perf_counter() - start
        return result


@dataclass(frozen=True)
class Solution:
    """Everything that was computed; a stage that was not asked for is None."""

    map: ConformalMap
    quality: Quality
    pattern: Pattern | None = None
    panels: Panels | None = None
    components: Components | None = None
    support: Support | None = None


@dataclass(frozen=True)
class SolveSettings:
    """All that is asked for besides the surface; None stops before that stage."""

    boundary: Annotated[BoundaryCondition, Setting("what happens at the boundary")] = field(
        default_factory=BoundaryCondition
    )
    pattern: Annotated[PatternSettings | None, Setting("the cells; null stops after the map")] = field(
        default_factory=PatternSettings
    )
    panels: Annotated[PanelSettings | None, Setting("the panels; null stops after the pattern")] = field(
        default_factory=PanelSettings
    )
    singularities: Annotated[
        SingularitySettings | None,
        Setting("cells with more or fewer sides; null: none, except where the topology asks for them"),
    ] = None
    support: Annotated[
        bool, Setting("add the torsion-free support structure, with beams where components have a depth")
    ] = False


def solve(
    take_in: Callable[[], Surface],
    settings: SolveSettings,
    run: StageRunner | None = None,
    *,
    source: Any = None,
) -> Solution:
    """Surface → conformal map → pattern → panels → quality, and components and support where asked for.

    take_in: makes the surface from what was sent (``surface_from_mesh`` or ``surface_from_nurbs``).
    source: what the surface depends on, for runners that remember. Raises HexwrapError.
    """
    with one_blas_thread():
        return _solve(take_in, settings, run or PlainRunner(), source)


def _solve(
    take_in: Callable[[], Surface], settings: SolveSettings, run: StageRunner, source: Any
) -> Solution:
    panels = settings.panels
    surface = run("surface", source, lambda progress: take_in())
    pattern, note = decided(settings, surface)
    cmap, choices = _map(surface, replace(settings, pattern=pattern), run)
    if pattern is None:
        return Solution(
            cmap,
            run("quality", None, lambda progress: replace(measure(cmap, None, None), singularities=choices)),
        )
    laid = run("pattern", pattern, lambda progress: lay_pattern(cmap, pattern, progress))
    made, wanted, facing = None, None, None
    if panels is not None:
        # Three stages, so that a change of the size classes alone reuses the poses and limits.
        fitted = run("fit", fit_key(panels), lambda progress: fit_panels(cmap, laid, panels, progress))
        curve = run("trade-off", curve_key(panels), lambda progress: trade_off(fitted, panels))
        made = run("panels", size_key(panels), lambda progress: quantize(fitted, panels, curve))
        facing = fitted.facing
        wanted = panels.components or (ComponentSettings() if settings.support else None)
    quality = run("quality", None, lambda progress: measure(cmap, laid, made, progress, facing))
    quality = replace(quality, notes=note + quality.notes)  # not in the stage, which any request may share
    quality = _with_choices(quality, cmap, laid, made, replace(settings, pattern=pattern), choices, run)
    parts, frame = None, None
    if made is not None and wanted is not None:
        parts = run("components", wanted, lambda progress: make_components(made, wanted))
    if settings.support or wanted is not None:
        depth = wanted.depth if wanted is not None else 0.0
        frame = run("support", depth, lambda progress: support(laid, depth, progress))
    return Solution(cmap, quality, laid, made, parts, frame)


def mapped(
    take_in: Callable[[], Surface], settings: SolveSettings, run: StageRunner, *, source: Any = None
) -> tuple[ConformalMap, Choices | None]:
    """The first stages alone, as ``solve`` runs them. Raises HexwrapError."""
    surface = run("surface", source, lambda progress: take_in())
    pattern, _ = decided(settings, surface)
    return _map(surface, replace(settings, pattern=pattern), run)


def decided(settings: SolveSettings, surface: Surface) -> tuple[PatternSettings | None, tuple[str, ...]]:
    """The pattern with a kind where ``auto`` was asked for, and a note where that is not the usual one.

    Flat convex panels, three at each node, follow no saddle (Li, Liu and Wang 2015); four can.
    """
    pattern, panels = settings.pattern, settings.panels
    if pattern is None or pattern.kind != "auto":
        return pattern, ()
    saddle = saddle_share(surface) if panels is not None and panels.mode == "watertight" else 0.0
    if saddle < SADDLE:
        return replace(pattern, kind="hex"), ()
    note = (
        f"Pattern: trihexagonal, since {saddle:.0%} of the surface is curved like a saddle, where flat "
        "hexagons that share their edges cannot be convex; pattern.kind chooses another."
    )
    return replace(pattern, kind="trihexagonal"), (note,)


def _with_choices(
    quality: Quality,
    cmap: ConformalMap,
    laid: Pattern,
    made: Panels | None,
    settings: SolveSettings,
    choices: Choices | None,
    run: StageRunner,
) -> Quality:
    """With what other numbers of singularities would leave open, and one note on the choice that would bring
    most, where one would bring much."""
    panels, pattern, left = settings.panels, settings.pattern, 1 - quality.coverage
    assert pattern is not None
    offers: list[Offer] = []
    pointed = quality.bare
    if pointed >= BARE and pattern.boundary == "whole":
        trimmed = run("trimmed", pattern, lambda progress: Trimmed.of(cmap, pattern, progress), after="map")
        pointed = 0.0
        if trimmed is not None:
            offers, pointed = trim_offer(trimmed, quality.bare), trimmed.bare
    if made is not None and panels is not None and made.mode == "split" and isinstance(panels.sizes, int):
        if choices is not None:
            choices = choices.with_measured(left)
        elif worth_a_look(cmap, laid, panels.sizes, left):
            key = ProspectKey.of(cmap.surface, laid)
            known = run("seats", laid.kind, lambda progress: seats(cmap.surface, laid.kind), after="map")
            found = run("outlook", key, lambda progress: prospects(known, cmap.surface, key), after="map")
            choices = outlook(found, laid, panels.sizes, left)
            if choices is not None:
                offers += outlook_offer(found, laid, panels.sizes, left, pointed)
            if settings.boundary.mode == "straight" and plain_is_better(found, laid, panels.sizes, left):
                other = OtherKey.of(settings.boundary, pattern, laid)
                isometric = run(
                    "other map",
                    other.boundary,
                    lambda progress: isometric_map(cmap.surface, other.boundary, progress),
                    after="map",
                )
                bounds = run(
                    "other boundary",
                    other,
                    lambda progress: isometric_bounds(isometric, other.pattern),
                    after="map",
                )
                offers += isometric_offer(bounds, panels.sizes, left)
        if choices is None or not choices.number[choices.taken]:
            offers += _corners_offer(cmap, laid, made, panels.sizes, left, run)
    best = max(offers, key=lambda offer: offer.saved, default=None)
    notes = quality.notes if best is None or laid.proposes else (*quality.notes, best.note)
    return replace(quality, singularities=choices, notes=notes)


def _corners_offer(
    cmap: ConformalMap, laid: Pattern, made: Panels, sizes: int, left: float, run: StageRunner
) -> list[Offer]:
    """What quads would bring a building that is flat but for its corners."""
    flat = run(
        "flat",
        None,
        lambda progress: is_flat_with_cones(fill_openings(cmap.surface), LATTICES["quad"].quantum),
        after="map",
    )
    if not flat or len(cmap.cones):
        return []
    key = replace(ProspectKey.of(cmap.surface, laid), kind="quad")
    known = run("seats", "quad", lambda progress: seats(cmap.surface, "quad"), after="map")
    found = run("outlook", key, lambda progress: prospects(known, cmap.surface, key), after="map")
    types = len(made.class_length) + int((made.size < 0).sum())
    return corners_offer(found, laid, sizes, left, types)


def _map(surface: Surface, settings: SolveSettings, run: StageRunner) -> tuple[ConformalMap, Choices | None]:
    """With singularities where they are asked for, or needed; and what one may choose from then."""
    asked, pattern = settings.singularities, settings.pattern
    boundary = settings.boundary.adapted(pattern.cell_kind if pattern else None)
    if asked is None and needs_singularities(surface, boundary):
        asked = SingularitySettings("auto")
    if asked is None or (asked.count in (None, 0) and not asked.at):
        make = best_boundary_map if boundary.mode == "auto" else conformal_map
        return run("map", boundary, lambda progress: make(surface, boundary, progress)), None
    if boundary.mode == "auto":  # ends that are free take up what singularities need
        quantum = LATTICES[pattern.cell_kind if pattern else "hex"].quantum
        flat = is_flat_with_cones(fill_openings(surface), quantum)
        boundary = replace(boundary, mode="straight" if flat else "isometric")
    surface = fine_enough(surface, PATCHES)
    wanted = asked
    sizes = settings.panels.sizes if settings.panels is not None else None
    # where they stand is not chosen for the sizes then: variants with other sizes share the map
    classes = sizes if isinstance(sizes, int) and not asked.at else None
    shape = None if pattern is None else replace(pattern, phase=(0.0, 0.0), max_cells=0)
    seats = run(
        "singularities",
        (wanted, boundary, shape, classes),
        lambda progress: seated(surface, boundary, wanted, pattern, classes, progress),
    )
    placing = seats.placing

    def closed(progress: Progress) -> ConformalMap:
        found = closed_map(surface, seats.frame, placing, boundary, progress)
        if not len(found.cones) or not placing.may_be_none or placing.proposals[0].count:
            return found
        return or_plain(found, surface, boundary, pattern or PatternSettings(), classes or SIZES, progress)

    cmap = run("map", boundary, closed)
    taken = next(i for i, one in enumerate(placing.proposals) if one.count == len(cmap.cones))
    return cmap, Choices.of(placing.proposals, taken, classes or SIZES, fill_openings(surface).vertices)
