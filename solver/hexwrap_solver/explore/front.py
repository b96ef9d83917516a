"""Which variants are worth solving, which are kept, and which one is proposed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.explore.types import Figures, Limits
from hexwrap_solver.tolerances import TINY

#: Variants that are solved, at most.
MOST_SOLVED = 30
#: Differences that are none: of the uncovered share, of the types, of the cost (relatively), and of the
#: share of the surface without cells: less cost that comes of more bare surface beats nothing.
SAME = (1e-3, 0.0, 5e-3, 0.03)
#: Whatever closes the rest, and how it looks, is dear: an open square metre counts as this many of panels.
OPEN = 10.0
#: Figures are foreseen only so well: a variant this much beyond a limit, or beyond what comes nearest to it,
#: may yet be better.
NEARLY = 1.05


def objectives(figures: Sequence[Figures]) -> Floats:
    """(v, 4) less is better: uncovered, types, log cost, bare."""
    return np.array(
        [[f.uncovered, f.types, np.log(max(f.cost, TINY)), f.bare] for f in figures], dtype=np.float64
    ).reshape(-1, 4)


def non_dominated(values: Floats, same: tuple[float, ...]) -> Bools:
    """(v,) ε-non-dominated: no other is at most as large in all columns and smaller by more than ``same`` in
    one; of those that are equal in this sense to each other, the first is kept. values: (v, k)."""
    kept = np.zeros(len(values), dtype=bool)
    # In this order none that comes later can be better in all columns than one before.
    for i in np.lexsort(values.T[::-1]):
        kept[i] = not (values[kept] <= values[i] + np.array(same)).all(axis=1).any()
    return kept


def limited(figures: Figures, limits: Limits, sizes: int) -> dict[str, tuple[float, float]]:
    """Of each limit by name: what a variant has, and the most that it may have. sizes: number of edge lengths
    that was asked for."""
    has = {"sizes": sizes, "max_gap": figures.gap_max, "panels": figures.panels}
    pairs = {name: (value, getattr(limits, name)) for name, value in has.items()}
    return {name: (v, most) for name, (v, most) in pairs.items() if v is not None and most is not None}


def excess(figures: Figures, limits: Limits, sizes: int) -> float:
    """By which parts of them limits are exceeded, all together; 0 where all are kept."""
    pairs = limited(figures, limits, sizes).values()
    return sum(max(has / max(most, TINY) - 1, 0.0) for has, most in pairs if has > most)


def to_solve(figures: Sequence[Figures], beyond: Sequence[float], most: int = MOST_SOLVED) -> Ints:
    """Indices of the non-dominated of those that come nearest to the limits, at most this many: ends of the
    front, and what fills its widest holes. beyond: their ``excess``."""
    near = np.flatnonzero(np.asarray(beyond) <= (1 + min(beyond, default=0.0)) * NEARLY - 1)
    values = objectives(figures)
    candidates = near[non_dominated(values[near], SAME)]
    if len(candidates) <= most:
        return candidates
    spread = _scaled(values[candidates])
    chosen = list(dict.fromkeys(spread.argmin(axis=0).tolist()))
    away = np.min([np.abs(spread - spread[i]).sum(axis=1) for i in chosen], axis=0)
    while len(chosen) < most:
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.abs(spread - spread[chosen[-1]]).sum(axis=1))
    return np.sort(candidates[chosen[: max(most, 0)]])


def front_of(figures: Sequence[Figures]) -> Bools:
    """(v,) the non-dominated of measured variants."""
    return non_dominated(objectives(figures), SAME)


def by_cost(figures: Sequence[Figures]) -> list[int]:
    """The least cost first, where surface without panels costs ``OPEN`` times what panels cost."""
    return sorted(range(len(figures)), key=lambda i: figures[i].cost * (1 + OPEN * _open(figures[i])))


def _open(found: Figures) -> float:
    """Area of the surface left open, between cells and beside them, per area of the panels."""
    return 1 / max((1 - found.uncovered) * (1 - found.bare), 1e-12) - 1


def _scaled(values: Floats) -> Floats:
    low = values.min(axis=0)
    return np.asarray((values - low) / np.maximum(values.max(axis=0) - low, 1e-12))
