"""What else could have been asked for, and by how much it would be better: of all that, one note tells the
best. What is foreseen is told as a bound that the finished solution keeps."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Floats, Progress, no_progress
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.explore.predict import outlook as foreseen_by
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from hexwrap_solver.singularities.outlook import SAVED, SHARE, Prospects, uncovered_then
from hexwrap_solver.singularities.place import number_of
from hexwrap_solver.singularities.solve import in_words
from hexwrap_solver.surface.types import Surface

#: The linear model errs by such a part of what it foresees and by so much of the area (gherkins, vases and
#: domes in 1, 3 and 11 sizes were left with .7 to 1.17 times as much); what the map of a variant foresees, by
#: that much.
LINEAR, LITTLE, EXACT = 1.2, 0.003, 0.006
#: A smaller share of the surface without cells is not worth cutting some; covered by cut cells, each a type
#: of its own, it counts for so much.
BARE, CUT = 0.05, 0.5
#: Cells that differ by less than this are equally large. More types of panels than these are many.
EVEN, FEW_TYPES = 1.01, 20
#: Numbers of sizes that are foreseen at once, so that another one asks for no other map.
MOST_SIZES = 40


@dataclass(frozen=True)
class Offer:
    """saved: share of the area, by which offers are compared."""

    saved: float
    note: str


@dataclass(frozen=True)
class Trimmed:
    """The same cells, cut along the edges of the surface. cut: how many are. bare: share of the surface that
    is without cells even then: it comes to a point within one of them."""

    cut: int
    bare: float

    @classmethod
    def of(
        cls, cmap: ConformalMap, pattern: PatternSettings, progress: Progress = no_progress
    ) -> Trimmed | None:
        """None where they cannot be."""
        try:
            laid = lay_pattern(cmap, replace(pattern, boundary="trim"), progress)
        except HexwrapError:
            return None
        return cls(int((~laid.whole).sum()), max(1 - laid.area / float(cmap.surface.areas.sum()), 0.0))


def trim_offer(trimmed: Trimmed, bare: float) -> list[Offer]:
    """bare: share of the surface without cells."""
    if bare - trimmed.bare < BARE / 2:
        return []
    then = f"{trimmed.bare:.1%}" if trimmed.bare >= 0.0005 else "nothing"
    note = (
        f"With pattern.boundary trim, {trimmed.cut} cells cut along its edges would leave {then} of the "
        f"surface bare instead of {bare:.1%}."
    )
    return [Offer(CUT * (bare - trimmed.bare), note)]


def outlook_offer(found: Prospects, laid: Pattern, sizes: int, left: float, pointed: float) -> list[Offer]:
    """Singularities, where they would leave clearly less than now, and than none with free ends. left: share
    that is uncovered now. pointed: share of the surface that is without cells where it comes to a point."""
    choices, then = found.choices, uncovered_then(found, laid, sizes)
    best = number_of(then, choices.number)
    bound = LINEAR * float(then[best]) + LITTLE
    if not best or not _pays(bound, left):
        return []
    number, more = int(choices.number[best]), ""
    if pointed >= BARE:
        more = f", and cover nearly all of the {pointed:.0%} that is bare where the surface comes to a point"
    names = "Up to " * (number > 1) + in_words(laid.kind, choices.index[best])
    note = (
        f"{names} would leave less than {bound:.1%} uncovered instead of "
        f"{left:.1%}{more}: ask for singularities {number} with boundary.mode isometric."
    )
    return [Offer(left - bound + pointed, note)]


def corners_offer(found: Prospects, laid: Pattern, sizes: int, left: float, types: int) -> list[Offer]:
    """Quads around the corners of a building that is flat but for these, where they leave hardly more open in
    few types of panels. found: of quads. types: of panels now."""
    choices = found.choices
    even = np.flatnonzero((choices.number > 0) & (choices.ratio < EVEN))
    if not len(even) or types <= FEW_TYPES:
        return []
    bound = LINEAR * float(uncovered_then(found, laid, sizes)[even[0]]) + LITTLE
    if bound > left + SAVED:
        return []
    note = (
        f"The surface is flat but for {choices.number[even[0]]} corners of quarter turns: pattern.kind "
        f"quad with singularities auto and no boundary.mode would leave less than {bound:.1%} uncovered in "
        f"one size and a few kinds along the folds, instead of {left:.1%} in {types} types of panels."
    )
    return [Offer(1.0, note)]


def plain_is_better(found: Prospects, laid: Pattern, sizes: int, left: float) -> bool:
    """Whether free ends without singularities promise to leave clearly less open than straight ones."""
    number = found.choices.number
    return bool(len(number)) and not number[0] and _pays(float(uncovered_then(found, laid, sizes)[0]), left)


@dataclass(frozen=True)
class OtherKey:
    """What ``isometric_bounds`` depend on beside the surface. pattern: of cells at most √2 times as large as
    they are, so that it stays the same where they change a little."""

    boundary: BoundaryCondition
    pattern: PatternSettings

    @classmethod
    def of(cls, boundary: BoundaryCondition, pattern: PatternSettings, laid: Pattern) -> OtherKey:
        edge = 2.0 ** (math.ceil(2 * math.log2(laid.edge_length)) / 2)
        adapted = replace(boundary, mode="isometric").adapted(pattern.cell_kind)
        return cls(adapted, replace(pattern, around=None, edge_length=edge, phase=(0.0, 0.0)))


def isometric_map(
    surface: Surface, boundary: BoundaryCondition, progress: Progress = no_progress
) -> ConformalMap | None:
    """None where there is none."""
    try:
        return conformal_map(surface, boundary, progress)
    except HexwrapError:
        return None


def isometric_bounds(cmap: ConformalMap | None, pattern: PatternSettings) -> Floats:
    """(MOST_SIZES,) the most that panels on an isometric boundary's map would leave uncovered with 1, 2, …
    sizes; 1 where none can be."""
    try:
        if cmap is not None:
            seen = foreseen_by(cmap, pattern)
            most_first = [seen.foresee(sizes).uncovered for sizes in range(MOST_SIZES, 0, -1)]
            return np.array(most_first[::-1]) + EXACT
    except HexwrapError:
        pass
    return np.ones(MOST_SIZES)


def isometric_offer(bounds: Floats, sizes: int, left: float) -> list[Offer]:
    """An isometric boundary, where it would leave clearly less open than now."""
    bound = float(bounds[min(sizes, MOST_SIZES) - 1])  # more sizes leave no more
    if not _pays(bound, left):
        return []
    note = f"With boundary.mode isometric less than {bound:.1%} would be uncovered instead of {left:.1%}."
    # no singularities are simpler than some
    return [Offer(left - bound + LITTLE, note)]


def _pays(bound: float, left: float) -> bool:
    return left - bound >= max(SAVED, SHARE * left)
