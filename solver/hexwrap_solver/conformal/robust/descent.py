"""Newton's method on Penner's space: through as many Delaunay triangulations as it takes.

The energy is convex and twice continuously differentiable across flips (Springborn 2020), and it has a
minimum for every annulus and all positive targets that obey Gauss–Bonnet (Gu, Luo, Sun, Wu 2018). Unlike on a
fixed triangulation there are no broken triangles: each trial point is made Delaunay first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Progress
from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.factor import Factorisation
from hexwrap_solver.conformal.robust.delaunay import make_delaunay
from hexwrap_solver.conformal.robust.metric import Metric, angle_sums, laplacian_entries, measure
from hexwrap_solver.conformal.robust.mirror import MirrorMesh

MAX_STEPS = 200
#: No single step may change u by more than this: Newton leaps where the Hessian is nearly singular.
MAX_CHANGE = 8.0
#: Acceptable overshoot φ'(t) / |φ'(0)| of a step along its direction.
OVERSHOOT = 0.1
MAX_TRIALS = 40
#: The largest entry of the gradient bottoms out at rounding, about this times √(number of unknowns).
ROUNDING = 1e-14
#: Above this the answer is not accepted: boundary angles must be right to 1e-9.
ACCEPTED = 3e-10


@dataclass(frozen=True)
class Descent:
    """u: (n,) where it ended, with its Delaunay metric. residual: max |angle sum − target|."""

    u: Floats
    metric: Metric
    residual: float
    iterations: int
    flips: int


class FlipEnergy:
    """The energy of ``plain``'s problem on the mirrored mesh, which follows u by flips."""

    def __init__(self, plain: Energy, mesh: MirrorMesh) -> None:
        self.plain = plain
        self.mesh = mesh
        self.flips = 0

    def at(self, x: Floats) -> tuple[Metric, Floats]:
        """The Delaunay metric at the unknowns x, and the gradient."""
        u = self.plain.scale_of(x)
        self.flips += make_delaunay(self.mesh, u)
        metric = measure(self.mesh, u)
        return metric, self.plain.target - self.plain.reduce(angle_sums(self.mesh, metric))

    def newton_direction(self, metric: Metric, gradient: Floats) -> Floats:
        tail, head, weight = laplacian_entries(self.mesh, metric)
        tail, head = self.plain.dof[tail], self.plain.dof[head]
        apart = tail != head
        low, high, weight = np.minimum(tail, head)[apart], np.maximum(tail, head)[apart], weight[apart]
        n = self.plain.n_dof
        both = np.concatenate([low, high]) + 1
        diagonal = _sums(both, np.tile(weight, 2), n + 1)[1:]
        inside = low >= 0
        pairs, which = np.unique(low[inside] * n + high[inside], return_inverse=True)
        factorisation = Factorisation(n, pairs % n, pairs // n)
        factorisation.factorise(diagonal, -_sums(which, weight[inside], len(pairs)))
        return -factorisation.solve(gradient)


def descend(energy: FlipEnergy, start: Floats, progress: Progress) -> Descent:
    """Minimises from ``start`` (n,) until rounding stops it; see ``residual`` for how far it got."""
    x = energy.plain.unknowns_of(start)
    metric, gradient = energy.at(x)
    tolerance = ROUNDING * np.sqrt(len(x))
    iterations = 0
    while iterations < MAX_STEPS and _largest(gradient) > tolerance:
        residual = _largest(gradient)
        progress(
            min(0.9, iterations / 20), f"Newton step {iterations + 1} with flips, residual {residual:.1e}"
        )
        step = _line_search(energy, x, energy.newton_direction(metric, gradient), gradient)
        if step is None:
            break
        iterations += 1
        if _largest(step[2]) >= 0.5 * residual and residual <= ACCEPTED:
            break  # nothing but rounding is left
        x, metric, gradient = step
    metric, gradient = energy.at(x)
    return Descent(energy.plain.scale_of(x), metric, _largest(gradient), iterations, energy.flips)


def _sums(index: Ints, weights: Floats, n: int) -> Floats:
    return np.bincount(index, weights=weights, minlength=n).astype(np.float64)


def _largest(gradient: Floats) -> float:
    return float(np.abs(gradient).max(initial=0.0))


def _line_search(
    energy: FlipEnergy, x: Floats, direction: Floats, gradient: Floats
) -> tuple[Floats, Metric, Floats] | None:
    """The first point along the direction where φ' is at most a little above zero; φ is convex, so secants
    on φ' bracket its minimum."""
    slope = float(gradient @ direction)
    if not slope < 0:
        return None
    low, low_slope = 0.0, slope
    t = min(1.0, MAX_CHANGE / max(_largest(direction), 1e-300))
    for _ in range(MAX_TRIALS):
        trial = x + t * direction
        metric, new = energy.at(trial)
        new_slope = float(new @ direction)
        if new_slope <= OVERSHOOT * abs(slope) or _largest(new) <= 0.5 * _largest(gradient):
            return trial, metric, new
        secant = low + (t - low) * low_slope / (low_slope - new_slope)
        t = min(max(secant, low + 0.1 * (t - low)), low + 0.7 * (t - low))
    return None
