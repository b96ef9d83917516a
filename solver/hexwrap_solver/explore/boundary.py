"""Straight or isometric: the boundary condition that a designer who asks for none would keep."""

from __future__ import annotations

from dataclasses import replace

from hexwrap_solver.arrays import Progress, no_progress
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.singularities.sizes import uncovered
from hexwrap_solver.surface.types import Surface

#: Sizes by which boundary conditions are compared, irrespective of the number asked for, so that another
#: number does not bring another domain: the default of ``PanelSettings.sizes``.
SIZES = 11
#: Straight ends carry whole rows, on lattice lines; an isometric boundary has to leave this much less of the
#: area uncovered to be preferred.
MARGIN = 0.02


def best_boundary_map(
    surface: Surface, condition: BoundaryCondition, progress: Progress = no_progress
) -> ConformalMap:
    """The map under mode ``auto``: with a straight boundary, unless an isometric one leaves less of the
    surface uncovered by more than MARGIN, or the straight one is impossible. A note gives both figures.

    Raises RequestError, ConvergenceError where neither is possible: what is wrong with the isometric one.
    """

    def part(begin: float) -> Progress:
        return lambda fraction, what: progress(begin + fraction / 2, what)

    refusal: HexwrapError | None = None
    straight = isometric = None
    if len(surface.loops) > 1:  # a disk turns by 2π: no boundary of it is straight
        try:
            straight = conformal_map(surface, replace(condition, mode="straight"), part(0.0))
        except HexwrapError as error:
            refusal = error
    try:
        isometric = conformal_map(surface, replace(condition, mode="isometric"), part(0.5))
    except HexwrapError as error:
        if straight is None:
            raise
        refusal = error
    return _chosen(straight, isometric, refusal)


def foreseen(cmap: ConformalMap, sizes: int = SIZES) -> float:
    """Area share that this many sizes leave uncovered because cells differ in size, by e^−u alone."""
    area = cmap.surface.areas
    return uncovered(cmap.log_scale[cmap.surface.faces].mean(axis=1), area / area.sum(), sizes)


def _chosen(
    straight: ConformalMap | None, isometric: ConformalMap | None, refusal: HexwrapError | None
) -> ConformalMap:
    if straight is None:
        assert isometric is not None
        if refusal is None:
            return isometric
        return _with_note(isometric, f"Boundary: isometric, since it cannot be straight: {refusal.detail}")
    if isometric is None:
        assert refusal is not None
        return _with_note(straight, f"Boundary: straight, since it cannot be isometric: {refusal.detail}")
    share = {"straight": foreseen(straight), "isometric": foreseen(isometric)}
    keep = share["straight"] <= share["isometric"] + MARGIN
    chosen, other = ("straight", "isometric") if keep else ("isometric", "straight")
    left = {mode: f"at least {part:.1%}" if part >= 0.0005 else "nothing" for mode, part in share.items()}
    note = (
        f"Boundary: {chosen}. At {SIZES} sizes, cells that differ in size leave {left[chosen]} of the "
        f"surface uncovered; were it {other}, {left[other]}."
    )
    return _with_note(straight if keep else isometric, note)


def _with_note(cmap: ConformalMap, note: str) -> ConformalMap:
    return replace(cmap, notes=(note, *cmap.notes))
