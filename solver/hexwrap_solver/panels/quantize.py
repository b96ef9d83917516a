"""From fitted panels to finished ones: edge lengths in a few classes (paper, section 5, Figure 11)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.errors import PanelsError
from hexwrap_solver.panels.facing import mean_normals, widths
from hexwrap_solver.panels.fewest import SLACK, Fewest, Joints, fewest_lengths
from hexwrap_solver.panels.sizes import (
    ALIKE,
    ALIKE_AREA,
    SHRUNK,
    choose_lengths,
    floor_to,
    lengths_of,
    level,
    partition,
)
from hexwrap_solver.panels.types import FittedPanels, Panels, PanelSettings, TradeOff

#: The trade-off curve is computed for 1 … this many classes.
TRADE_OFF_CLASSES = 40


@dataclass(frozen=True)
class SizeKey:
    """The settings that ``quantize`` depends on."""

    sizes: int | str | None
    max_gap: float | None
    size_cost: str
    edge_range: tuple[float, float] | None
    increment: float

    @classmethod
    def of(cls, settings: PanelSettings) -> SizeKey:
        return cls(
            settings.sizes, settings.max_gap, settings.size_cost, settings.edge_range, settings.increment
        )


def quantize(fitted: FittedPanels, settings: PanelSettings) -> Panels:
    """Chooses the size classes and makes the polygons.

    Depends on the settings in ``SizeKey`` only. Raises PanelsError where the increment is longer than a panel
    may be.
    """
    regular = fitted.regular
    smallest, largest = settings.edge_range or (0.0, np.inf)
    choices = [fitted]
    if fitted.spare_limit is not None and fitted.spare_center is not None:
        choices.append(replace(fitted, limit=fitted.spare_limit, center=fitted.spare_center))
    limits = [np.minimum(choice.limit[regular], largest) for choice in choices]
    usable = [k for k, limit in enumerate(limits) if (floor_to(limit, settings.increment) > 0).all()]
    if not usable:
        _require_increment(limits[0], np.flatnonzero(regular), settings.increment)
    choices, limits = [choices[k] for k in usable], [limits[k] for k in usable]
    said: tuple[str, ...] = ()
    if settings.sizes == "fewest":
        length, said = _fewest(choices[0], limits[0], settings)
        pick, lengths = 0, [length]
    else:
        lengths = [
            choose_lengths(limit, settings.sizes, settings.size_cost, settings.increment, smallest)
            for limit in limits
        ]
        pick = min(range(len(lengths)), key=lambda k: _loss(fitted, lengths[k], smallest, settings))
    fitted, length = choices[pick], lengths[pick]
    class_length, member, class_count = np.unique(length, return_inverse=True, return_counts=True)
    edge_length = fitted.limit.copy()
    edge_length[regular] = length
    size = np.full(len(fitted.face), -1, dtype=np.int64)
    size[regular] = member
    polygons = _polygons(fitted, length)
    alone = np.zeros(0, dtype=np.int64) if fitted.special is None else np.flatnonzero(fitted.special)
    size[alone] = len(class_length) + np.arange(len(alone))
    outside = np.flatnonzero(regular)[length < smallest]
    return Panels(
        mode=fitted.mode,
        polygons=polygons,
        face=fitted.face,
        size=size,
        edge_length=edge_length,
        limit=fitted.limit,
        center=fitted.center,
        normal=fitted.normal,
        whole=fitted.whole,
        class_length=np.concatenate([class_length, edge_length[alone]]),
        class_count=np.concatenate([class_count, np.ones(len(alone), dtype=np.int64)]).astype(np.int64),
        class_sides=np.concatenate(
            [np.full(len(class_length), fitted.spokes.shape[1]), polygons.lengths[alone]]
        ).astype(np.int64),
        trade_off=_trade_off(fitted, limits, settings) if len(length) else None,
        energy=fitted.energy,
        notes=(
            *fitted.notes,
            *_range_notes(settings, fitted.limit[regular], outside),
            *_size_notes(settings, limits[pick], length),
            *said,
        ),
        outside=outside,
        max_gap=settings.max_gap,
    )


def _fewest(fitted: FittedPanels, limit: Floats, settings: PanelSettings) -> tuple[Floats, tuple[str, ...]]:
    """The fewest lengths that keep joints within ``max_gap``; of as few, those that cover most."""
    if settings.max_gap is None:
        raise PanelsError(
            "Sizes are 'fewest', but no greatest joint is given: set max_gap to the widest joint that may be"
            " left open, in the unit of the model.",
            field=("max_gap",),
        )
    if fitted.facing is None or not len(limit):
        return floor_to(limit, settings.increment), ()
    order = np.argsort(limit, kind="stable")
    highest = np.empty_like(limit)
    highest[order] = level(floor_to(limit[order], settings.increment))
    joints = _joints(fitted)
    found = fewest_lengths(highest, joints, settings.max_gap)
    said = _wide_note(fitted, found, settings.max_gap)
    length, bound = found.length, np.where(found.over, np.inf, settings.max_gap * (1 + SLACK))
    for classes in range(1, min(len(np.unique(length)), TRADE_OFF_CLASSES) + 1):
        covering = choose_lengths(limit, classes, settings.size_cost, settings.increment)
        if (joints.width(covering) <= bound).all():
            return covering, said
    return length, said


def _joints(fitted: FittedPanels) -> Joints:
    """The joints of the regular panels, measured on their polygons."""
    facing, regular = fitted.facing, fitted.regular
    assert facing is not None
    position = np.full(len(regular), -1, dtype=np.int64)
    position[regular] = np.arange(int(regular.sum()))
    mean = mean_normals(facing, fitted.normal)
    p = fitted.spokes.shape[1]
    return Joints(
        position[facing.left],
        position[facing.right],
        lambda length: widths(_polygons(fitted, length), facing, mean),
        1 / (2 * np.tan(np.pi / p)),
    )


def _wide_note(fitted: FittedPanels, found: Fewest, max_gap: float) -> tuple[str, ...]:
    if not found.over.any() or fitted.facing is None:
        return ()
    worst = int(np.where(found.over, found.width, -np.inf).argmax())
    pair = (fitted.facing.left[worst], fitted.facing.right[worst])
    x, y, z = np.mean([fitted.center[panel] for panel in pair], axis=0)
    return (
        f"{int(found.over.sum())} joints are wider than max_gap {max_gap:g} even where every panel has a"
        f" length of its own, the widest {found.width[worst]:.4g}, between panels {pair[0]} and {pair[1]} at"
        f" ({x:.4g}, {y:.4g}, {z:.4g}): smaller cells, another boundary condition or a max_gap of at least"
        f" {found.width[worst]:.4g} would help.",
    )


def _loss(
    fitted: FittedPanels, length: Floats, smallest: float, settings: PanelSettings
) -> tuple[int, float]:
    """What is to be least: panels below the allowed range, then what ``size_cost`` asks for."""
    below = int((length < smallest).sum())
    if settings.size_cost == "area" or not len(length):
        return below, -float(length @ length)
    return below, float((_free_length(fitted) - length).max())


def _free_length(fitted: FittedPanels) -> Floats:
    """(r,) edges of the regular polygons that are as large as the regular panels' cells."""
    return np.asarray(np.sqrt(fitted.cell_area[fitted.regular] / _unit_area(fitted.spokes.shape[1])))


def _unit_area(p: int) -> float:
    """Area of the regular p-gon of edge 1."""
    return float(p / (4 * np.tan(np.pi / p)))


def _require_increment(allowed: Floats, panel: Ints, increment: float) -> None:
    nothing = panel[floor_to(allowed, increment) <= 0]
    if len(nothing):
        raise PanelsError(
            f"The increment {increment:g} is longer than {len(nothing)} panels may be (the smallest allows"
            f" {allowed.min():g}); ask for a smaller increment or larger cells.",
            field=("increment",),
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


def _trade_off(fitted: FittedPanels, limits: list[Floats], settings: PanelSettings) -> TradeOff:
    """What each number of classes leaves open, for the better of the limits; the regular panels only."""
    curves = [_curve(fitted, limit, settings) for limit in limits]
    most = max(len(curve) for curve in curves)
    filled = np.stack([curve[np.minimum(np.arange(most), len(curve) - 1)] for curve in curves])
    best = filled[..., 0 if settings.size_cost == "area" else 1].argmin(axis=0)
    return TradeOff(np.arange(1, most + 1), *filled[best, np.arange(most)].T)


def _curve(fitted: FittedPanels, allowed: Floats, settings: PanelSettings) -> Floats:
    """(k, 4) for 1…k classes: uncovered part, worst gap, mean and greatest width of the joints."""
    order = np.argsort(allowed, kind="stable")
    limit = allowed[order]
    made, floored = partition(limit, TRADE_OFF_CLASSES, settings.size_cost, settings.increment)
    p = fitted.spokes.shape[1]
    # A cell's inradius exceeds its panel's by half the gap between cells of the same size.
    width_of_unit = 1 / np.tan(np.pi / p)
    cell_area = float(fitted.cell_area[fitted.regular].sum())
    free_length = _free_length(fitted)[order]
    joints = None if fitted.facing is None else _joints(fitted)
    own = np.zeros(0) if joints is None else joints.width(allowed)
    lost = np.zeros(len(allowed) + 1)  # the last: of panels with a given shape, which lose nothing
    curve = []
    for start in made.start:
        length = lengths_of(start, floored)
        uncovered = 1 - _unit_area(p) * float(length @ length) / cell_area
        lost[order] = limit - length
        joint = own if joints is None else own + joints.shrink * (lost[joints.left] + lost[joints.right])
        widest = float(np.max(free_length - length)) * width_of_unit
        curve.append((uncovered, widest, joint.mean() if len(joint) else 0.0, joint.max(initial=0.0)))
    return np.array(curve)


def _range_notes(settings: PanelSettings, limit: Floats, outside: Ints) -> tuple[str, ...]:
    if settings.edge_range is None:
        return ()
    notes = []
    low, high = settings.edge_range
    if len(outside):
        notes.append(
            f"{len(outside)} panels cannot reach the least allowed edge length {low:g}"
            f" (the smallest allows {limit.min():g}, the largest {limit.max():g}); they keep lengths below"
            " it. Allow shorter edges, or ask for fewer cells around."
        )
    clipped = int((limit > high).sum())
    if clipped:
        notes.append(f"{clipped} panels were held down to the greatest allowed edge length {high:g}.")
    return tuple(notes)


def _size_notes(settings: PanelSettings, limit: Floats, length: Floats) -> list[str]:
    """Of sizes that are not used, and of panels that share one far below what their cells allow."""
    if not isinstance(settings.sizes, int) or not len(length):
        return []
    notes = []
    different = len(np.unique(level(np.sort(floor_to(limit, settings.increment)))))
    used = len(np.unique(length))
    if used < min(settings.sizes, different):
        notes.append(
            f"Of the {settings.sizes} sizes allowed {used} {'is' if used == 1 else 'are'} used: with more, "
            f"some would differ by less than {ALIKE:.1%}, to cover no more than {ALIKE_AREA:.1%} of the area."
        )
    shrunk = np.flatnonzero(length < SHRUNK * limit)
    if len(shrunk):
        worst = shrunk[np.argmax(limit[shrunk])]
        cost = "" if settings.size_cost == "worst" else "size_cost worst, "
        notes.append(
            f"{len(shrunk)} panels have less than {SHRUNK:.0%} of the edge length that their cells allow "
            f"({length[worst]:.4g} instead of up to {limit[worst]:.4g}), since they share a size with "
            f"smaller ones: more sizes, {cost}or an edge_range whose least length few panels miss keep them "
            "larger."
        )
    return notes
