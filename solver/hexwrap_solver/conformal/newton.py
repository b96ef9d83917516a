"""Newton's method on the convex energy.

The line search looks at the directional derivative φ'(t) = ∇E(u + t d)·d alone. E is convex, so φ' is
monotone and every t with φ'(t) ≤ 0 lies on the descending side; a zero of φ' is the exact minimum along d.
Energy values are not needed: near the solution their differences drown in rounding (E grows like the
number of vertices) long before the gradient does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, Progress, no_progress
from hexwrap_solver.conformal.energy import Corners, Energy
from hexwrap_solver.linalg.factor import Factorisation

MAX_STEPS = 60
#: No single step may change a length by more than this factor's logarithm: broken triangles make Newton leap.
MAX_CHANGE = 8.0
#: Angle sums resolve this much, radians, or the rounding of the largest target (a tie's is a sum over a whole
#: loop). Stopping earlier would show: layout errors are the residual times the vertices along the way.
ROUNDING = 2e-14
#: A residual up to this is accepted (the boundary angles are promised to 1e-9); from there on, a step that
#: leaves more than STAGNATION of it is the last one: slivers stop at a higher level of rounding.
ACCEPTED, STAGNATION = 3e-10, 0.5
#: Residuals below this are worth no factorisation of their own, radians.
LAST_ROUNDINGS = 1e-12
#: Multiples of its largest diagonal entry that make a singular Hessian definite.
SHIFTS = (0.0, 1e-12, 1e-9, 1e-6)
#: Acceptable overshoot φ'(t) / |φ'(0)| of a step.
OVERSHOOT = 0.1
MAX_TRIALS = 30
#: After a full step, the factorised Hessian is used again where that many such chord steps (each leaving as
#: much of the residual as the last step did) would reach rounding: a step costs a fourth of one with a
#: factorisation, after which two or three chord steps would follow all the same.
CHORDS = 6
#: What a chord step may leave of the residual to be kept.
CHORD_GAIN = 0.2
#: Where more than BROKEN_AT_FIRST triangles are broken after the first step, more than BROKEN after others,
#: or any after a full step that leaves at most SETTLED of the residual, the minimum has broken triangles as
#: well: the search ends there.
BROKEN_AT_FIRST, BROKEN, SETTLED = 16, 8, 0.05


#: After a step that was cut short, unknowns with a residual of at least the share LOCAL of the largest, and
#: RINGS of their neighbours, are brought near the minimum first, where these are no more than the share FEW
#: of all; by at most LOCAL_STEPS steps.
LOCAL, RINGS, FEW, LOCAL_STEPS = 0.1, 3, 0.25, 8
#: So many times that this leaves more than STAGNATION of the residual, and it is not tried again.
FRUITLESS = 3


@dataclass(frozen=True)
class Minimum:
    """u: (n,) log scale factors. residual: max |angle sum − target| over the unknowns. broken: number of
    triangles that violate the triangle inequality (then the original triangulation has no solution here).
    iterations: steps taken, of which ``factorisations`` had a Hessian of their own."""

    u: Floats
    corners: Corners
    residual: float
    iterations: int
    factorisations: int
    converged: bool

    @property
    def broken(self) -> int:
        return int(self.corners.broken.sum())


@dataclass
class _Point:
    """The unknowns, and what the energy says there."""

    x: Floats
    corners: Corners
    gradient: Floats

    @classmethod
    def at(cls, energy: Energy, x: Floats) -> _Point:
        corners = energy.corners(energy.scale_of(x))
        return cls(x, corners, energy.gradient(corners))

    @property
    def residual(self) -> float:
        return largest(self.gradient)


def minimise(energy: Energy, start: Floats | None = None, progress: Progress = no_progress) -> Minimum:
    """Minimises the energy from ``start`` (u = 0 by default).

    Stops at rounding: when the residual is below what angle sums of this many triangles can resolve, or
    when a full Newton step near the minimum no longer lowers it. Stops without convergence as soon as it is
    plain that triangles will stay broken.
    """
    factorisation = Factorisation(energy.points, energy.rows, energy.columns)
    point = _Point.at(energy, np.zeros(energy.n_dof) if start is None else energy.unknowns_of(start))
    tolerance = max(ROUNDING, np.finfo(float).eps * largest(energy.target))
    iterations, factorisations, fruitless, chord = 0, 0, 0, False
    while point.residual > tolerance and iterations < MAX_STEPS:
        progress(
            min(0.9, iterations / 10), f"Newton step {iterations + 1}, residual {point.residual:.1e} rad"
        )
        following, full = None, True
        if chord:
            following = _chord(energy, factorisation, point)
        if following is None:
            factorisations += 1
            following, full = _newton_step(energy, factorisation, point)
        if following is None:
            break
        iterations += 1
        gain, near = following.residual / point.residual, point.residual <= ACCEPTED
        if gain < 1 or not near:
            point = following
        if gain > STAGNATION and near:
            break
        settled = full and gain <= SETTLED
        if not full and fruitless < FRUITLESS and not _stays_broken(point.corners, iterations, False):
            before = point.residual
            point = _relaxed(energy, point)
            settled = point.residual <= SETTLED * before
            fruitless += point.residual > STAGNATION * before
        if _stays_broken(point.corners, iterations, settled):
            break
        chord = full and chords_left(point.residual, gain, tolerance) <= CHORDS
    return Minimum(
        energy.scale_of(point.x),
        point.corners,
        point.residual,
        iterations,
        factorisations,
        converged=point.residual <= ACCEPTED,
    )


def _relaxed(energy: Energy, point: _Point) -> _Point:
    """Newton's method among the unknowns where the residual is large, and their neighbours, if these are few.

    For the sake of a few triangles that break, steps of all unknowns are cut short again and again (nonlinear
    elimination; Cai, Keyes 2002).
    """
    for _ in range(LOCAL_STEPS):
        among = around(np.abs(point.gradient) > LOCAL * point.residual, energy.rows, energy.columns)
        if len(among) > FEW * len(point.x) or point.residual <= ACCEPTED:
            break
        direction = _local_direction(energy, point, among)
        following = None if direction is None else _line_search(energy, point, direction)[0]
        if following is None:
            break
        point = following
    return point


def around(marked: Bools, one: Ints, other: Ints) -> Ints:
    """The marked unknowns (n,), and those up to RINGS edges away from them. one, other: (e,) the ends of the
    edges, −1 where it is no unknown."""
    marked = np.append(marked, False)
    for _ in range(RINGS):
        joined = marked[one] | marked[other]
        marked[one[joined]] = marked[other[joined]] = True
        marked[-1] = False
    return np.flatnonzero(marked)


def _local_direction(energy: Energy, point: _Point, among: Ints) -> Floats | None:
    """``_newton_direction`` where only the unknowns ``among`` may change."""
    local = np.full(len(point.x), -1)
    local[among] = np.arange(len(among))
    rows, columns = local[energy.rows], local[energy.columns]
    inside = (rows >= 0) & (columns >= 0)
    factorisation = Factorisation(energy.points[among], rows[inside], columns[inside])
    diagonal, off_diagonal = energy.hessian(point.corners)
    found = _solved(
        factorisation, diagonal[among], off_diagonal[inside], -point.gradient[among], point.corners
    )
    if found is None:
        return None
    direction = np.zeros(len(point.x))
    direction[among] = found
    return direction


def _stays_broken(corners: Corners, iterations: int, settled: bool) -> bool:
    """Whether the original triangulation can be given up, see BROKEN."""
    count = int(corners.broken.sum())
    return count > (0 if settled else BROKEN if iterations > 1 else BROKEN_AT_FIRST)


def largest(gradient: Floats) -> float:
    """Maximum norm, 0 of nothing."""
    return float(np.abs(gradient).max(initial=0.0))


def chords_left(residual: float, gain: float, tolerance: float) -> float:
    """Steps that reach the tolerance when each leaves ``gain`` of the residual."""
    if residual <= tolerance:
        return 0.0
    return float(np.log(tolerance / residual) / np.log(gain)) if gain < 1 else np.inf


def _chord(energy: Energy, factorisation: Factorisation, point: _Point) -> _Point | None:
    """A step with the Hessian of an earlier one; None where that is not good enough. Among the last roundings
    whatever is gained is: the Hessian is not what is missing there."""
    following = _Point.at(energy, point.x - factorisation.solve(point.gradient))
    enough = CHORD_GAIN if point.residual > LAST_ROUNDINGS else np.inf
    return following if following.residual <= enough * point.residual else None


def _newton_step(energy: Energy, factorisation: Factorisation, point: _Point) -> tuple[_Point | None, bool]:
    """The next point, None where there is none, and whether the step was a full one."""
    direction = _newton_direction(energy, factorisation, point)
    if direction is None:
        return None, False
    following, length = _line_search(energy, point, direction)
    return following, length == 1.0


def _newton_direction(energy: Energy, factorisation: Factorisation, point: _Point) -> Floats | None:
    """H⁻¹(−∇E). None where the system cannot be solved."""
    return _solved(factorisation, *energy.hessian(point.corners), -point.gradient, point.corners)


def _solved(
    factorisation: Factorisation, diagonal: Floats, off_diagonal: Floats, right: Floats, corners: Corners
) -> Floats | None:
    """The solution of a system with the Hessian, if it leads downhill.

    Broken triangles add nothing to H; where a vertex has no other ones H is singular, so a small multiple of
    the diagonal is added, more where that does not suffice (Levenberg 1944).
    """
    scale = max(float(np.abs(diagonal).max()), 1.0)
    for shift in SHIFTS[int(corners.broken.any()) :]:
        try:
            factorisation.factorise(diagonal + shift * scale, off_diagonal)
        except np.linalg.LinAlgError:
            continue
        direction = factorisation.solve(right)
        if np.isfinite(direction).all() and right @ direction > 0:
            return np.asarray(direction)
    return None


def _line_search(energy: Energy, point: _Point, direction: Floats) -> tuple[_Point | None, float]:
    """The first acceptable step and its length: φ'(t) at most a little above zero. Overshoots are cut by
    bisection guarded secants on φ'. None where no step is left."""
    slope = float(point.gradient @ direction)
    t = min(1.0, MAX_CHANGE / max(largest(direction), 1e-300))
    for _ in range(MAX_TRIALS):
        trial = _Point.at(energy, point.x + t * direction)
        new_slope = float(trial.gradient @ direction)
        if new_slope <= OVERSHOOT * abs(slope) or trial.residual <= 0.5 * point.residual:
            return trial, t
        t *= min(max(slope / (slope - new_slope), 0.1), 0.7)
    return None, 0.0
