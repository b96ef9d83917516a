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
#: Figures are foreseen only so well: a variant this much beyond a limit of the panels may yet keep it.
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


def within(figures: Figures, limits: Limits, sizes: int | None, slack: float = 1.0) -> bool:
    """sizes: number of edge lengths that was asked for."""
    return (
        (limits.sizes is None or (sizes is not None and sizes <= limits.sizes))
        and (limits.panels is None or figures.panels <= limits.panels * slack)
        and (limits.max_gap is None or figures.gap_max is None or figures.gap_max <= limits.max_gap)
    )


def to_solve(figures: Sequence[Figures], most: int = MOST_SOLVED) -> Ints:
    """Indices of the non-dominated, at most this many: ends of the front, and what fills its widest holes."""
    values = objectives(figures)
    candidates = np.flatnonzero(non_dominated(values, SAME))
    if len(candidates) <= most:
        return candidates
    spread = _scaled(values[candidates])
    chosen = list(dict.fromkeys(spread.argmin(axis=0).tolist()))
    away = np.min([np.abs(spread - spread[i]).sum(axis=1) for i in chosen], axis=0)
    while len(chosen) < most:
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.abs(spread - spread[chosen[-1]]).sum(axis=1))
    return np.sort(candidates[chosen])


def front_of(figures: Sequence[Figures]) -> Bools:
    """(v,) the non-dominated of measured variants."""
    return non_dominated(objectives(figures), SAME)


def best_of(figures: Sequence[Figures]) -> int:
    """The least cost, where surface without panels costs ``OPEN`` times what panels cost."""
    return min(range(len(figures)), key=lambda i: figures[i].cost * (1 + OPEN * _open(figures[i])))


def _open(found: Figures) -> float:
    """Area of the surface left open, between cells and beside them, per area of the panels."""
    return 1 / max((1 - found.uncovered) * (1 - found.bare), 1e-12) - 1


def _scaled(values: Floats) -> Floats:
    low = values.min(axis=0)
    return np.asarray((values - low) / np.maximum(values.max(axis=0) - low, 1e-12))
