"""Newton's method on the convex energy.

The line search looks at the directional derivative φ'(t) = ∇E(u + t d)·d alone. E is convex, so φ' is
monotone and every t with φ'(t) ≤ 0 lies on the descending side; a zero of φ' is the exact minimum along d.
Energy values are not needed: near the solution their differences drown in rounding (E grows like the
number of vertices) long before the gradient does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Floats, Progress, no_progress
from hexwrap_solver.conformal.energy import Corners, Energy
from hexwrap_solver.conformal.factor import Factorisation

MAX_STEPS = 60
#: No single step may change a length by more than this factor's logarithm: broken triangles make Newton leap.
MAX_CHANGE = 8.0
#: The largest entry of the gradient bottoms out at rounding, about this times √(number of unknowns).
ROUNDING = 4e-15
#: Acceptable overshoot φ'(t) / |φ'(0)| of a step.
OVERSHOOT = 0.1
MAX_TRIALS = 30


@dataclass(frozen=True)
class Minimum:
    """u: (n,) log scale factors. residual: max |angle sum − target| over the unknowns. broken: number of
    triangles that violate the triangle inequality (then the original triangulation has no solution here)."""

    u: Floats
    corners: Corners
    residual: float
    iterations: int
    converged: bool

    @property
    def broken(self) -> int:
        return int(self.corners.broken.sum())


def minimise(energy: Energy, start: Floats | None = None, progress: Progress = no_progress) -> Minimum:
    """Minimises the energy from ``start`` (u = 0 by default).

    Stops at rounding: when the residual is below what angle sums of this many triangles can resolve, or
    when a full Newton step near the minimum no longer lowers it.
    """
    factorisation = Factorisation(energy.points, energy.rows, energy.columns)
    x = np.zeros(energy.n_dof) if start is None else energy.unknowns_of(start)
    corners = energy.corners(energy.scale_of(x))
    gradient = energy.gradient(corners)
    tolerance = ROUNDING * np.sqrt(energy.n_dof)
    iterations, converged = 0, False
    while iterations < MAX_STEPS:
        residual = _largest(gradient)
        if residual <= tolerance:
            converged = True
            break
        progress(min(0.9, iterations / 10), f"Newton step {iterations + 1}, residual {residual:.1e} rad")
        direction = _newton_direction(energy, factorisation, corners, gradient)
        accepted = None if direction is None else _line_search(energy, x, direction, gradient)
        if accepted is None:
            converged = residual <= 1e3 * tolerance
            break
        iterations += 1
        if _largest(accepted[2]) >= 0.5 * residual and residual <= 1e3 * tolerance:
            converged = True  # stagnation at rounding; keep the better of the two
            if _largest(accepted[2]) < residual:
                x, corners, gradient = accepted
            break
        x, corners, gradient = accepted
    return Minimum(energy.scale_of(x), corners, _largest(gradient), iterations, converged)


def _largest(gradient: Floats) -> float:
    return float(np.abs(gradient).max(initial=0.0))


def _newton_direction(
    energy: Energy, factorisation: Factorisation, corners: Corners, gradient: Floats
) -> Floats | None:
    """H⁻¹(−∇E); a vertex all of whose triangles are broken gets a small diagonal, else H would be singular.
    None where the system cannot be solved."""
    diagonal, off_diagonal = energy.hessian(corners)
    if corners.broken.any():
        diagonal = diagonal + 1e-10 * max(float(np.abs(diagonal).max()), 1.0)
    try:
        factorisation.factorise(diagonal, off_diagonal)
    except np.linalg.LinAlgError:
        return None
    direction = -factorisation.solve(gradient)
    return direction if np.isfinite(direction).all() and gradient @ direction < 0 else None


def _line_search(
    energy: Energy, x: Floats, direction: Floats, gradient: Floats
) -> tuple[Floats, Corners, Floats] | None:
    """The first acceptable step: φ'(t) at most a little above zero. Overshoots are cut by bisection
    guarded secants on φ'. None where no step is left."""
    slope = float(gradient @ direction)
    low, low_slope = 0.0, slope
    t = min(1.0, MAX_CHANGE / max(_largest(direction), 1e-300))
    for _ in range(MAX_TRIALS):
        trial = x + t * direction
        corners = energy.corners(energy.scale_of(trial))
        new = energy.gradient(corners)
        new_slope = float(new @ direction)
        if new_slope <= OVERSHOOT * abs(slope) or _largest(new) <= 0.5 * _largest(gradient):
            return trial, corners, new
        secant = low + (t - low) * low_slope / (low_slope - new_slope)
        t = min(max(secant, low + 0.1 * (t - low)), low + 0.7 * (t - low))
    return None
