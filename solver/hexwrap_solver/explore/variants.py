"""Which variants are tried: points of a Halton sequence over the choices, shifted by the seed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.explore.types import ExploreSettings
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.pipeline import SolveSettings
from hexwrap_solver.singularities.types import SingularityAt, SingularitySettings

#: Sizes of cells that are tried: this many steps from the lowest to the highest, in equal ratios. Variants of
#: one size share their map where singularities make it depend on that.
STEPS = 3
#: Without a range: the default size times these.
AROUND_DEFAULT = (0.8, 1.25)
#: Joints that are tried, likewise.
JOINTS = 4
#: Different variants are looked for among this many times as many points.
PATIENCE = 20
#: Some cannot be made, or come to the same as others: more are drawn than are asked for.
SPARE = 2
BASES = (2, 3, 5, 7, 11, 13, 17)


@dataclass(frozen=True)
class Frame:
    """What variants share whose singularities come from one search."""

    boundary: BoundaryCondition
    pattern: PatternSettings


@dataclass(frozen=True)
class Variant:
    """singularities: how many are wanted."""

    frame: Frame
    singularities: int
    sizes: int
    joint: float


def variants(settings: ExploreSettings, edge: float | None) -> list[Variant]:
    """SPARE times as many different ones as are asked for, or as there are: first what would be taken if
    nothing varied, then in the order of the sequence.

    Of the numbers of sizes, those within the limit are tried, where there are such. edge: default edge length
    of the cells on the surface, for settings that give none.
    """
    vary, panels = settings.vary, settings.panels
    joints = _between(*(vary.joint or (panels.joint, panels.joint)), JOINTS)
    low, high = vary.sizes
    most = max(low, min(high, settings.limits.sizes or high))
    sizes = range(low, most + 1)
    shapes = _shapes(settings, edge)
    kinds = vary.kind or (settings.pattern.cell_kind,)
    rotations = vary.rotation or (settings.pattern.rotation,)
    choices = (vary.boundary, vary.singularities, kinds, shapes, rotations, sizes, joints)
    usual = (
        min(panels.sizes, settings.limits.sizes or panels.sizes) if isinstance(panels.sizes, int) else most
    )
    found = {Variant(Frame(BoundaryCondition(), settings.pattern), 0, usual, panels.joint): None}
    wanted = SPARE * settings.variants
    for point in _halton(PATIENCE * wanted, settings.seed):
        if len(found) == wanted:
            break
        taken: list[Any] = [options[int(x * len(options))] for options, x in zip(choices, point, strict=True)]
        boundary, count, kind, shape, rotation, number, joint = taken
        pattern = replace(shape, kind=kind, rotation=rotation)
        found[Variant(Frame(BoundaryCondition(boundary), pattern), count, number, joint)] = None
    return list(found)


def _shapes(settings: ExploreSettings, edge: float | None) -> list[PatternSettings]:
    vary, pattern = settings.vary, settings.pattern
    if vary.around is not None:
        steps = dict.fromkeys(round(n) for n in _between(*vary.around, STEPS))
        return [replace(pattern, around=n, edge_length=None) for n in steps]
    if vary.edge_length is None:
        if pattern.around is not None or pattern.edge_length is not None:
            return [pattern]
        assert edge is not None
        low, high = (edge * part for part in AROUND_DEFAULT)
    else:
        low, high = vary.edge_length
    return [replace(pattern, edge_length=_short(x), around=None) for x in _between(low, high, STEPS)]


def _between(low: float, high: float, steps: int) -> list[float]:
    """From low to high in equal ratios, or differences where one is 0."""
    if low == high:
        return [low]
    t = np.linspace(0, 1, steps)
    return list((low * (high / low) ** t if low > 0 else low + (high - low) * t).tolist())


def _short(x: float) -> float:
    """Four digits, for people to read."""
    return float(f"{x:.4g}")


def _halton(n: int, seed: int) -> Iterator[Floats]:
    """n points of the unit cube, turned by a shift that the seed gives (Cranley and Patterson 1976)."""
    shift = np.random.default_rng(seed).random(len(BASES))
    for i in range(1, n + 1):
        yield np.array([(_inverse(i, base) + s) % 1.0 for base, s in zip(BASES, shift, strict=True)])


def _inverse(i: int, base: int) -> float:
    """The digits of i behind the point, backwards."""
    value, place = 0.0, 1.0 / base
    while i:
        i, digit = divmod(i, base)
        value += digit * place
        place /= base
    return value


def as_settings(variant: Variant, settings: ExploreSettings, at: tuple[SingularityAt, ...]) -> SolveSettings:
    """What is to be solved. at: where its singularities stand."""
    return SolveSettings(
        boundary=variant.frame.boundary,
        pattern=variant.frame.pattern,
        panels=replace(settings.panels, sizes=variant.sizes, joint=variant.joint),
        singularities=SingularitySettings(at=at) if at else None,
    )
