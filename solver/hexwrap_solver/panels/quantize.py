"""From fitted panels to finished ones: edge lengths in a few classes (paper, section 5, Figure 11)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.errors import PanelsError
from hexwrap_solver.panels.facing import widths
from hexwrap_solver.panels.fewest import Fewest, Joints, fewest_lengths
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
from hexwrap_solver.words import place

#: The trade-off curve is computed for 1 … this many classes.
TRADE_OFF_CLASSES = 40


def size_key(s: PanelSettings) -> tuple[object, ...]:
    """The settings that ``quantize`` depends on."""
    return s.sizes, s.max_gap, s.size_cost, s.edge_range, s.increment


def curve_key(s: PanelSettings) -> tuple[object, ...]:
    """The settings that ``trade_off`` depends on."""
    return s.size_cost, None if s.edge_range is None else s.edge_range[1], s.increment


def trade_off(fitted: FittedPanels, settings: PanelSettings) -> TradeOff | None:
    """What each number of classes leaves open, for the better of the limits; the regular panels only. None
    without such.

    Depends on the settings in ``curve_key`` only. Raises PanelsError as ``quantize`` does.
    """
    limits = _limits(fitted, settings)[1]
    if not len(limits[0]):
        return None
    curves = [_curve(fitted, limit, settings) for limit in limits]
    most = max(len(curve) for curve in curves)
    filled = np.stack([curve[np.minimum(np.arange(most), len(curve) - 1)] for curve in curves])
    best = filled[..., 0 if settings.size_cost == "area" else 1].argmin(axis=0)
    return TradeOff(np.arange(1, most + 1), *filled[best, np.arange(most)].T)


def quantize(fitted: FittedPanels, settings: PanelSettings, curve: TradeOff | None = None) -> Panels:
    """Chooses the size classes and makes the polygons. curve: the ``trade_off``, where it is known.

    Depends on the settings in ``size_key`` only. Raises PanelsError where the increment is longer than a
    panel may be.
    """
    regular = fitted.regular
    curve = curve or trade_off(fitted, settings)
    smallest = settings.edge_range[0] if settings.edge_range else 0.0
    choices, limits = _limits(fitted, settings)
    said: tuple[str, ...] = ()
    if settings.sizes == "fewest":
        length, said = _fewest(choices[0], limits[0], settings)
        pick, lengths = 0, [length]
    else:
        lengths = [_chosen(fitted, limit, settings.sizes, settings, smallest) for limit in limits]
        pick = min(range(len(lengths)), key=lambda k: _loss(fitted, lengths[k], smallest, settings))
    fitted, length = choices[pick], lengths[pick]
    kind = _kinds(fitted)
    lengths_used, which = np.unique(length, return_inverse=True)
    classes, member, class_count = np.unique(
        which + kind * len(lengths_used), return_inverse=True, return_counts=True
    )
    class_kind = classes // max(len(lengths_used), 1)
    class_length = lengths_used[classes % max(len(lengths_used), 1)]
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
        class_sides=np.concatenate([_sides(fitted)[class_kind], polygons.lengths[alone]]).astype(np.int64),
        trade_off=curve and replace(curve, taken=_most(class_kind, fitted.pieces)),
        energy=fitted.energy,
        notes=(
            *fitted.notes,
            *_range_notes(settings, fitted.limit[regular], outside),
            *_size_notes(fitted, settings, limits[pick], length),
            *said,
        ),
        outside=outside,
        max_gap=settings.max_gap,
        n_special=len(alone) + int((class_kind >= fitted.pieces).sum()),
        bends=fitted.bends,
    )


def _most(class_kind: Ints, kinds: int) -> int:
    """Classes of the kind that has most. kinds: those of whole cells come first."""
    return int(np.bincount(class_kind[class_kind < kinds]).max(initial=0))


def _limits(fitted: FittedPanels, settings: PanelSettings) -> tuple[list[FittedPanels], list[Floats]]:
    """The choices of limit and centre that the increment leaves, and (r,) the limits of each."""
    largest = settings.edge_range[1] if settings.edge_range else np.inf
    choices = [fitted]
    if fitted.spare_limit is not None and fitted.spare_center is not None:
        choices.append(replace(fitted, limit=fitted.spare_limit, center=fitted.spare_center))
    limits = [np.minimum(choice.limit[fitted.regular], largest) for choice in choices]
    usable = [k for k, limit in enumerate(limits) if (floor_to(limit, settings.increment) > 0).all()]
    if not usable:
        _require_increment(limits[0], np.flatnonzero(fitted.regular), settings.increment)
    return [choices[k] for k in usable], [limits[k] for k in usable]


def _by_kind(fitted: FittedPanels, limit: Floats, choose: Callable[[Floats], Floats]) -> Floats:
    """(r,) chosen for the panels of each number of sides by themselves."""
    kinds = _kinds(fitted)
    chosen = np.zeros_like(limit)
    for kind in np.unique(kinds):
        chosen[kinds == kind] = choose(limit[kinds == kind])
    return chosen


def _chosen(
    fitted: FittedPanels, limit: Floats, classes: int | None, settings: PanelSettings, smallest: float = 0.0
) -> Floats:
    """(r,) lengths in this many classes of each kind."""
    cost, increment = settings.size_cost, settings.increment
    return _by_kind(fitted, limit, lambda own: choose_lengths(own, classes, cost, increment, smallest))


def _kinds(fitted: FittedPanels) -> Ints:
    """(r,) of the regular panels."""
    return np.zeros(len(fitted.spokes.lengths), dtype=np.int64) if fitted.kind is None else fitted.kind


def _sides(fitted: FittedPanels) -> Ints:
    """(kinds,) corners of each that are not straight."""
    return np.zeros(0, dtype=np.int64) if fitted.sides is None else fitted.sides


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

    def leveled(own: Floats) -> Floats:
        order = np.argsort(own, kind="stable")
        highest = np.empty_like(own)
        highest[order] = level(floor_to(own[order], settings.increment))
        return highest

    kind = _kinds(fitted)
    joints = _joints(fitted)
    found = fewest_lengths(_by_kind(fitted, limit, leveled), joints, settings.max_gap, kind)
    said = _wide_note(fitted, found, settings.max_gap)
    length, bound = found.length, found.bound
    few = _classes(kind, length)
    for classes in range(1, min(few, TRADE_OFF_CLASSES) + 1):
        covering = _chosen(fitted, limit, classes, settings)
        if _classes(kind, covering) > few:
            break
        if (joints.width(covering) <= bound).all():
            return covering, said
    return length, said


def _classes(kind: Ints, length: Floats) -> int:
    """How many different panels there are."""
    return len(np.unique(np.stack([kind, length]), axis=1).T)


def _joints(fitted: FittedPanels) -> Joints:
    """The joints of the regular panels, measured on their polygons."""
    facing, regular = fitted.facing, fitted.regular
    assert facing is not None
    position = np.full(len(regular), -1, dtype=np.int64)
    position[regular] = np.arange(int(regular.sum()))
    return Joints(
        position[facing.left],
        position[facing.right],
        lambda length: widths(_polygons(fitted, length), facing),
        _inradius(fitted),
    )


def _wide_note(fitted: FittedPanels, found: Fewest, max_gap: float) -> tuple[str, ...]:
    if not found.over.any() or fitted.facing is None:
        return ()
    worst = int(np.where(found.over, found.width, -np.inf).argmax())
    pair = (fitted.facing.left[worst], fitted.facing.right[worst])
    middle = np.mean([fitted.center[panel] for panel in pair], axis=0)
    return (
        f"{int(found.over.sum())} joints are wider than max_gap {max_gap:g} even where every panel has a"
        f" length of its own, the widest {found.width[worst]:.4g}, between panels {pair[0]} and {pair[1]} at"
        f" {place(middle)}: smaller cells, another boundary condition or a max_gap of at least"
        f" {found.width[worst]:.4g} would help.",
    )


def _loss(
    fitted: FittedPanels, length: Floats, smallest: float, settings: PanelSettings
) -> tuple[int, float]:
    """What is to be least: panels below the allowed range, then what ``size_cost`` asks for."""
    below = int((length < smallest).sum())
    if settings.size_cost == "area" or not len(length):
        return below, -float(fitted.area @ length**2)
    return below, float((_free_length(fitted) - length).max())


def _free_length(fitted: FittedPanels) -> Floats:
    """(r,) edges of the regular polygons that are as large as the regular panels' cells."""
    return np.asarray(np.sqrt(fitted.cell_area[fitted.regular] / fitted.area))


def _inradius(fitted: FittedPanels) -> Floats:
    """(r,) of the panels with edge 1: how far a side moves per length; a mean for those not regular."""
    return np.asarray(2 * fitted.area / fitted.spokes.lengths)


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
    regular, spokes = fitted.regular, fitted.spokes
    center, row = fitted.center[regular], spokes.row
    points = center.take(row, axis=0) + length.take(row)[:, None] * spokes.values
    if regular.all():
        return Ragged(points, spokes.offsets)
    count = np.zeros(len(regular), dtype=np.int64)
    count[regular], count[~regular] = spokes.lengths, fitted.shapes.lengths
    is_regular = np.repeat(regular, count)
    every = np.zeros((len(is_regular), 3))
    every[is_regular], every[~is_regular] = points, fitted.shapes.values
    return Ragged.of(every, count)


def _curve(fitted: FittedPanels, allowed: Floats, settings: PanelSettings) -> Floats:
    """(k, 4) for 1…k classes of each kind: uncovered part, worst gap, mean and greatest width of the
    joints."""
    kind_of, area, inradius = _kinds(fitted), fitted.area, _inradius(fitted)
    cell_area = float(fitted.cell_area[fitted.regular].sum())
    free_length = _free_length(fitted)
    kinds = []
    for kind in np.unique(kind_of):
        own = np.flatnonzero(kind_of == kind)
        own = own[np.argsort(allowed[own], kind="stable")]
        made, floored = partition(allowed[own], TRADE_OFF_CLASSES, settings.size_cost, settings.increment)
        kinds.append((own, made.start, floored))
    own_width, sides = np.zeros(0), []
    if fitted.facing is not None:
        joints = _joints(fitted)
        own_width, sides = joints.width(allowed), [joints.left + 1, joints.right + 1]
    # The first: of panels with a given shape, which lose nothing.
    shrunk = np.zeros(len(allowed) + 1)
    length = np.zeros_like(allowed)
    # A cell's inradius exceeds its panel's by half the gap between cells of the same size.
    free_gap, gap_per_length = 2 * inradius * free_length, 2 * inradius
    curve = []
    for k in range(max(len(start) for _, start, _ in kinds)):
        for own, start, floored in kinds:
            length[own] = lengths_of(start[min(k, len(start) - 1)], floored)
        uncovered = 1 - float(area @ length**2) / cell_area
        shrunk[1:] = inradius * (allowed - length)
        joint = sum((shrunk.take(side) for side in sides), start=own_width)
        widest = float(np.max(free_gap - gap_per_length * length))
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


def _size_notes(fitted: FittedPanels, settings: PanelSettings, limit: Floats, length: Floats) -> list[str]:
    """Of sizes that are not used, and of panels that share one far below what their cells allow."""
    if not isinstance(settings.sizes, int) or not len(length):
        return []
    notes = []
    kinds, sides = _kinds(fitted), _sides(fitted)
    for kind in np.unique(kinds[kinds < fitted.pieces]).tolist():
        own = kinds == kind
        different = len(np.unique(level(np.sort(floor_to(limit[own], settings.increment)))))
        used = len(np.unique(length[own]))
        if used >= min(settings.sizes, different):
            continue
        of = "" if fitted.pieces < 2 else f" of panels with {sides[kind]} sides"
        notes.append(
            f"Of the {settings.sizes} sizes{of} allowed {used} {'is' if used == 1 else 'are'} used: with "
            f"more, some would differ by less than {ALIKE:.1%}, to cover no more than {ALIKE_AREA:.1%} of "
            "the area."
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
