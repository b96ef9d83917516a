"""Sparse linear (and separably quadratic) programmes whose unknowns lie on a surface, by an interior-point
method.

Mehrotra's predictor-corrector method (SIAM J. Optim. 2, 1992) for max w·x − ½ Σ ρ_i x_i² subject to A x ≤
b. Its normal matrix couples neighbouring panels only, so the geometric factorisation of the map serves
here, too; it is many times faster than a general solver, which must find a vertex at the end.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array

from hexwrap_solver.arrays import Floats, Progress, no_progress
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.linalg.normal_matrix import NormalMatrix

#: Mean complementarity gap and greatest infeasibility at which the search ends (figures are of order 1).
TOLERANCE = 1e-7

MOST_STEPS = 100

#: A gap or infeasibility beyond this means that the programme has no bounded solution.
DIVERGED = 1e12

#: Steps without progress after which rounding is taken to be reached, and the gap that is then good enough.
PATIENCE, ACCEPTED = 6, 1e-4

#: Fraction of the way to the boundary that a step may go.
DAMPING = 0.995


def maximise(
    weight: Floats,
    rho: Floats,
    a: csr_array,
    b: Floats,
    start: Floats,
    points: Floats,
    progress: Progress = no_progress,
) -> Floats:
    """x that maximises weight·x − ½ Σ rho x² subject to a x ≤ b; all figures of order 1.

    rho: ≥ 0. start: any x, best inside. points: (unknowns, 3) where each unknown lies. Raises
    ConvergenceError.
    """
    transposed = a.T.tocsr()
    normal = NormalMatrix(points)
    x = best = start
    least, since = np.inf, 0
    slack = np.maximum(b - a @ x, 1e-2)
    dual = np.full(len(b), 0.1)
    for step in range(MOST_STEPS):
        primal_miss, dual_miss = b - a @ x - slack, weight - rho * x - transposed @ dual
        mean_gap = float(slack @ dual) / len(b)
        miss = max(mean_gap, float(np.abs(primal_miss).max()), float(np.abs(dual_miss).max()))
        if miss < TOLERANCE:
            return x
        if miss < least:
            best, least, since = x, miss, step
        if miss > DIVERGED or step - since > PATIENCE:
            break
        progress(min(0.1 * step, 0.95), f"linear programme, gap {miss:.1e}")
        normal.factorise(a, dual / slack, rho)
        direction = _direction(normal, a, transposed, slack, dual, primal_miss, dual_miss)
        _, d_slack, d_dual = direction(-slack * dual)
        reached = (slack + _step(slack, d_slack) * d_slack) @ (dual + _step(dual, d_dual) * d_dual) / len(b)
        centring = (reached / mean_gap) ** 3 * mean_gap
        d_x, d_slack, d_dual = direction(centring - slack * dual - d_slack * d_dual)
        primal, dual_step = DAMPING * _step(slack, d_slack), DAMPING * _step(dual, d_dual)
        x, slack, dual = x + primal * d_x, slack + primal * d_slack, dual + dual_step * d_dual
    if least < ACCEPTED:
        return best
    raise ConvergenceError(
        f"The linear programme for the panel sizes still has a gap of {least:.1e} after {step} steps;"
        " ask for target inscribed."
    )


def _direction(
    normal: NormalMatrix,
    a: csr_array,
    transposed: csr_array,
    slack: Floats,
    dual: Floats,
    primal_miss: Floats,
    dual_miss: Floats,
) -> Callable[[Floats], tuple[Floats, Floats, Floats]]:
    """Newton's step towards slack·dual = 0 (changed by ``complement``) and no misses."""

    def solve(complement: Floats) -> tuple[Floats, Floats, Floats]:
        d_x = normal.solve(dual_miss - transposed @ ((complement - dual * primal_miss) / slack))
        d_slack = primal_miss - a @ d_x
        return d_x, d_slack, (complement - dual * d_slack) / slack

    return solve


def _step(value: Floats, change: Floats) -> float:
    """Longest step up to 1 that keeps all values positive."""
    falling = change < 0
    return float(min(1.0, (-value[falling] / change[falling]).min(initial=np.inf)))
