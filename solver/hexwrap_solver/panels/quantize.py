"""From fitted panels to finished ones: edge lengths in a few classes (paper, section 5, Figure 11)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.errors import PanelsError
from hexwrap_solver.panels.sizes import choose_lengths, floor_to, partition
from hexwrap_solver.panels.types import FittedPanels, Panels, PanelSettings, TradeOff

#: The trade-off curve is computed for 1 … this many classes.
TRADE_OFF_CLASSES = 40


@dataclass(frozen=True)
class SizeKey:
    """The settings that ``quantize`` depends on."""

    sizes: int | None
    size_cost: str
    edge_range: tuple[float, float] | None
    increment: float

    @classmethod
    def of(cls, settings: PanelSettings) -> SizeKey:
        return cls(settings.sizes, settings.size_cost, settings.edge_range, settings.increment)


def quantize(fitted: FittedPanels, settings: PanelSettings) -> Panels:
    """Chooses the size classes and makes the polygons.

    Depends on the settings in ``SizeKey`` only. Raises PanelsError where the increment is longer than a panel
    may be.
    """
    regular = fitted.regular
    limit = fitted.limit[regular]
    smallest, largest = settings.edge_range or (0.0, np.inf)
    allowed = np.minimum(limit, largest)
    _require_increment(allowed, np.flatnonzero(regular), settings.increment)
    length = choose_lengths(allowed, settings.sizes, settings.size_cost, settings.increment, smallest)
    class_length, member, class_count = np.unique(length, return_inverse=True, return_counts=True)
    edge_length = fitted.limit.copy()
    edge_length[regular] = length
    size = np.full(len(fitted.face), -1, dtype=np.int64)
    size[regular] = member
    outside = np.flatnonzero(regular)[length < smallest]
    return Panels(
        mode=fitted.mode,
        polygons=_polygons(fitted, length),
        face=fitted.face,
        size=size,
        edge_length=edge_length,
        limit=fitted.limit,
        center=fitted.center,
        normal=fitted.normal,
        whole=fitted.whole,
        class_length=class_length,
        class_count=class_count.astype(np.int64),
        trade_off=_trade_off(fitted, allowed, settings) if len(limit) else None,
        energy=fitted.energy,
        notes=fitted.notes + _range_notes(settings, limit, outside),
        outside=outside,
    )


def _require_increment(allowed: Floats, panel: Ints, increment: float) -> None:
    nothing = panel[floor_to(allowed, increment) <= 0]
    if len(nothing):
        raise PanelsError(
            f"The increment {increment:g} is longer than {len(nothing)} panels may be (the smallest allows"
            f" {allowed.min():g}); ask for a smaller increment or larger cells.",
            field=("panels", "increment"),
            data={"panels": nothing[:100].tolist()},
        )


def _polygons(fitted: FittedPanels, length: Floats) -> Ragged:
    """All panels in the order of their faces."""
    regular = fitted.regular
    p = fitted.spokes.shape[1]
    count = np.full(len(regular), p, dtype=np.int64)
    count[~regular] = fitted.shapes.lengths
    offsets = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    points = np.zeros((int(offsets[-1]), 3))
    is_regular = np.repeat(regular, count)
    center = fitted.center[regular]
    points[is_regular] = (center[:, None] + length[:, None, None] * fitted.spokes).reshape(-1, 3)
    points[~is_regular] = fitted.shapes.values
    return Ragged(points, offsets)


def _trade_off(fitted: FittedPanels, allowed: Floats, settings: PanelSettings) -> TradeOff:
    """What each number of classes leaves open; the regular panels only."""
    order = np.argsort(allowed, kind="stable")
    limit = allowed[order]
    made, floored = partition(limit, TRADE_OFF_CLASSES, settings.size_cost, settings.increment)
    p = fitted.spokes.shape[1]
    area_of_unit = p / (4 * np.tan(np.pi / p))
    # A cell's inradius exceeds its panel's by half the gap between cells of the same size.
    width_of_unit = 1 / np.tan(np.pi / p)
    cell_area = fitted.cell_area[fitted.regular][order]
    free_length = np.sqrt(cell_area / area_of_unit)
    uncovered, worst = [], []
    for start in made.start:
        length = np.repeat(floored[start], np.diff(np.append(start, len(limit))))
        uncovered.append(1 - area_of_unit * float(length @ length) / float(cell_area.sum()))
        worst.append(float(np.max(free_length - length)) * width_of_unit)
    return TradeOff(np.arange(1, len(uncovered) + 1), np.array(uncovered), np.array(worst))


def _range_notes(settings: PanelSettings, limit: Floats, outside: Ints) -> tuple[str, ...]:
    if settings.edge_range is None:
        return ()
    notes = []
    low, high = settings.edge_range
    if len(outside):
        notes.append(
            f"{len(outside)} panels cannot reach the least allowed edge length {low:g}"
            f" (the smallest allows {limit.min():g}); they keep lengths below it."
        )
    clipped = int((limit > high).sum())
    if clipped:
        notes.append(f"{clipped} panels were held down to the greatest allowed edge length {high:g}.")
    return tuple(notes)
