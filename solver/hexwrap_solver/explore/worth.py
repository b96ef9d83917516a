"""Whether singularities that the linear model proposes keep their promise, as the finished maps foresee."""

from __future__ import annotations

from dataclasses import replace

from hexwrap_solver.arrays import Progress, no_progress
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.explore.predict import outlook
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.singularities.place import WORTH
from hexwrap_solver.singularities.solve import in_words
from hexwrap_solver.surface.types import Surface


def or_plain(
    cmap: ConformalMap,
    surface: Surface,
    boundary: BoundaryCondition,
    pattern: PatternSettings,
    sizes: int,
    progress: Progress = no_progress,
) -> ConformalMap:
    """cmap, or the map without singularities where each of these would not save ``WORTH`` of the area. The
    linear model sees the sizes of the cells alone; here it is also seen how far they are from regular."""
    try:
        plain = conformal_map(surface, boundary, progress)
        without = outlook(plain, pattern).foresee(sizes).uncovered
    except HexwrapError:  # then there is nothing but the map with them
        return cmap
    left = outlook(cmap, pattern).foresee(sizes).uncovered
    if left + WORTH * len(cmap.cones) < without:
        return cmap
    names = in_words(pattern.cell_kind, cmap.cones.index).capitalize()
    note = f"{names} would leave about {left:.1%} uncovered, none {without:.1%}: they are left out."
    return replace(plain, notes=(*plain.notes, note))
