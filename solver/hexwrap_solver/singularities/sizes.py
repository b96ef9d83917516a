"""What size classes leave open, from the sizes alone."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.panels.sizes import partition_by_area
from hexwrap_solver.tolerances import RELATIVE

#: Patches whose sizes differ by less than this (relatively) count as one.
ALIKE = 2e-3
#: Values of u that are told apart within a patch.
WITHIN = 5
#: Sizes are told apart in this many steps when many states are compared.
STEPS = 64


def uncovered(u: Floats, weight: Floats, sizes: int | None) -> float:
    """Share of the area that ``sizes`` lengths leave open, cells being e^−u wide; 0 with a length for each.

    u: (p,) weight: (p,) shares of the area. The lengths are the best there are (see ``partition_by_area``).
    """
    return 0.0 if sizes is None else float(uncovered_by(u, weight, sizes)[-1])


def uncovered_by(u: Floats, weight: Floats, most: int) -> Floats:
    """(most,) the same for each number of sizes from 1 to most ≥ 1."""
    u = u - u.max()
    level = np.floor(-u / ALIKE).astype(np.int64)
    number = level.max() + 1
    share = np.bincount(level, weight, number)
    there = np.flatnonzero(share)
    length = np.exp((there + 0.5) * ALIKE)
    made = partition_by_area(length, most, share[there] / length**2)
    return np.asarray(made.loss[np.minimum(np.arange(most), len(made.loss) - 1)] / share.sum())


def within(u: Floats, slope: Floats, area: Floats) -> tuple[Floats, Floats]:
    """u and shares of the area where it varies by a slope over each of the patches, (p,) all: as if they were
    squares that it crosses straight."""
    across = ((np.arange(WITHIN) + 0.5) / WITHIN - 0.5)[:, None] * np.sqrt(area)
    return (u + across * slope).ravel(), np.tile(area / (WITHIN * area.sum()), WITHIN)


def uncovered_of_many(u: Floats, weight: Floats, sizes: int) -> Floats:
    """(m,) the same for each column of u (p, m), on STEPS sizes between each one's smallest and largest:
    good for comparing neighbours.

    With k classes over the first j steps, V_k(j) = max_i V_{k−1}(i) + ℓ_i² (A_j − A_i), A being the sum of
    weight/ℓ² over the steps before.
    """
    columns = np.arange(u.shape[1])
    above = u.max(axis=0) - u
    width = np.maximum(above.max(axis=0), RELATIVE) / STEPS
    step = np.minimum((above / width).astype(np.int64), STEPS - 1) * len(columns) + columns
    flat = np.broadcast_to(weight[:, None], u.shape).ravel()
    share = np.bincount(step.ravel(), flat, STEPS * len(columns)).reshape(STEPS, -1).T
    start = np.arange(STEPS) * width[:, None]
    square = np.exp(2 * start).astype(np.float32)
    sums = np.concatenate(
        [np.zeros((len(columns), 1)), np.cumsum(share * np.exp(-2 * (start + width[:, None] / 2)), axis=1)],
        axis=1,
    )
    gain = square[:, :, None] * (sums[:, None, :] - sums[:, :STEPS, None]).astype(np.float32)
    value = gain[:, 0]
    for _ in range(sizes - 1):
        value = (value[:, :STEPS, None] + gain).max(axis=1)
    return np.asarray(1 - value[:, -1], dtype=float)
