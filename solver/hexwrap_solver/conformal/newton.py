"""Newton's method on a convex energy, once for all: the triangulation may stay (``fixed``) or follow by flips
(``robust/descent``).

The line search looks at the directional derivative φ'(t) = ∇E(u + t d)·d alone. E is convex, so φ' is
monotone and every t with φ'(t) ≤ 0 lies on the descending side; a zero of φ' is the exact minimum along d.
Energy values are not needed: near the solution their differences drown in rounding (E grows like the
number of vertices) long before the gradient does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, Progress
from hexwrap_solver.tolerances import TINY

#: Angle sums resolve this much, radians, or the rounding of the largest target (that of an unknown shared by
#: a loop is a sum over all of it). Stopping earlier would show: layout errors are the residual times the
#: vertices along the way.
ROUNDING = 2e-14
#: Near the solution, a step that leaves more than this share of the residual met rounding: slivers stop at a
#: higher level of it.
STAGNATION = 0.5
#: Residuals below this are not worth a factorisation of their own, radians.
LAST_ROUNDINGS = 1e-12
#: Acceptable overshoot φ'(t) / |φ'(0)| of a step.
OVERSHOOT = 0.1
#: Cuts of one step; more were never seen to help.
MAX_TRIALS = 40
#: The factorised Hessian is used again (a chord step) where at most this many such steps, each leaving as
#: much of the residual as the last one did, would reach rounding: a step costs a fourth of one with a
#: factorisation, after which two or three chord steps would follow all the same.
CHORDS = 6
#: What a chord step may leave of the residual for another one to follow, if many would be needed.
CHORD_GAIN = 0.25
#: Steps that a chord step learns from (L-BFGS; Nocedal 1980).
LEARNED = 8
#: Where a step was cut short, the unknowns with a large residual, and RINGS of their neighbours, are brought
#: near the minimum first, where these are at most the share FEW of all; by at most LOCAL_STEPS steps.
RINGS, FEW, LOCAL_STEPS = 3, 0.25, 8
#: After this many times that this left more than STAGNATION of the residual, it is not tried again.
FRUITLESS = 3


class Point(Protocol):
    """Unknowns x: (n,), and the gradient (n,) of the energy there."""

    @property
    def x(self) -> Floats: ...

    @property
    def gradient(self) -> Floats: ...


P = TypeVar("P", bound=Point)


class Convex(Protocol[P]):
    """A convex energy of n unknowns. Looking at one point may spoil another: see ``again``."""

    def at(self, x: Floats) -> P: ...

    def again(self, point: P) -> P:
        """The same point, after others have been looked at."""

    def edges(self) -> tuple[Ints, Ints]:
        """(e,) the unknowns at both ends of every edge, −1 where an end is fixed."""

    def change(self, direction: Floats) -> float:
        """How far a full step leaps, in the measure of ``Rules.leap``."""

    def direction(self, point: P) -> Floats | None:
        """−H⁻¹∇E at the point looked at last; None where the system cannot be solved."""

    def local_direction(self, point: P, among: Ints) -> Floats | None:
        """The same where only the unknowns ``among`` may change; (n,), 0 elsewhere."""

    def solve(self, right: Floats) -> Floats:
        """H⁻¹ · right with the Hessian of the last ``direction``."""

    def is_hopeless(self, point: P, iterations: int, settled: bool) -> bool:
        """Whether to give up. settled: the point is near the minimum, such as it is."""


@dataclass(frozen=True)
class Rules:
    """steps: the most. leap: the longest single step, see ``Convex.change``. accepted: the residual
    from which on stagnation counts as rounding; at the ``stalls``-th time the search ends. large, share:
    residuals above this, radians, and this share of the largest are brought down locally; at_first: before
    the first step, too. settled: a step that leaves at most this share of the residual is near the minimum.
    usual: steps expected, for the progress. words: what the steps are called. promising: where a full
    step left at most this share of the residual, a chord step is tried even if many of that gain would be
    needed: the more they are, the more they have learned."""

    steps: int
    leap: float
    accepted: float
    stalls: int
    large: float
    share: float
    settled: float
    usual: int
    at_first: bool = False
    words: str = ""
    promising: float = 0.0


@dataclass(frozen=True)
class Descended(Generic[P]):
    """Where the search ended. iterations: steps taken, of which ``factorisations`` had their own Hessian."""

    point: P
    iterations: int
    factorisations: int


def descend(
    energy: Convex[P], start: Floats, rules: Rules, progress: Progress, target: Floats
) -> Descended[P]:
    """Minimises from the unknowns ``start`` (n,).

    Stops at rounding: when the residual is below what sums of angles near ``target`` can resolve, or when
    steps near the minimum no longer lower it. Stops earlier where the energy says that it is hopeless.
    """
    tolerance = max(ROUNDING, float(np.finfo(float).eps) * largest(target))
    point = energy.at(start)
    if rules.at_first:
        point = relaxed(energy, point, rules)
    iterations, factorisations, fruitless, stalls, chord = 0, 0, 0, 0, False
    secants = _Secants()
    while (residual := largest(point.gradient)) > tolerance and iterations < rules.steps:
        words = f"Newton step {iterations + 1}{rules.words}, residual {residual:.1e} rad"
        progress(min(0.9, iterations / rules.usual), words)
        step = _chord(energy, point, secants) if chord else None
        fresh = step is None
        if step is None:
            factorisations += 1
            secants = _Secants()
            step = _newton(energy, energy.again(point) if chord else point, rules.leap)
        if step is None:
            point = energy.again(point)
            break
        iterations += 1
        secants.learn(point, step.point)
        gain = largest(step.point.gradient) / residual
        settled = step.full and gain <= rules.settled
        if not step.full and fruitless < FRUITLESS and not energy.is_hopeless(step.point, iterations, False):
            before = largest(step.point.gradient)
            step = _Step(relaxed(energy, step.point, rules), full=False)
            after = largest(step.point.gradient)
            settled, gain = after <= rules.settled * before, after / residual
            fruitless += after > STAGNATION * before
        near = residual <= rules.accepted
        point = step.point if gain < 1 or not near else energy.again(point)
        stalls += near and gain > STAGNATION
        if stalls and (stalls >= rules.stalls or residual <= LAST_ROUNDINGS):
            break
        if energy.is_hopeless(point, iterations, settled):
            break
        few = _chords_left(largest(point.gradient), gain, tolerance) <= CHORDS
        chord = step.full and (few or gain <= (rules.promising if fresh else CHORD_GAIN))
    return Descended(point, iterations, factorisations)


@dataclass(frozen=True)
class _Step(Generic[P]):
    """Where a step led, and whether it was a full one."""

    point: P
    full: bool


def relaxed(energy: Convex[P], point: P, rules: Rules) -> P:
    """Newton's method among the unknowns where the residual is large, and their neighbours, if these are few.

    For the sake of a few triangles that degenerate, steps of all unknowns would be cut short again and again
    (nonlinear elimination; Cai, Keyes 2002).
    """
    for _ in range(LOCAL_STEPS):
        residual = np.abs(point.gradient)
        among = around(residual > max(rules.large, rules.share * largest(residual)), *energy.edges())
        if not 0 < len(among) <= FEW * len(point.x):
            break
        direction = energy.local_direction(point, among)
        step = None if direction is None else _line_search(energy, point, direction, rules.leap)
        if step is None:
            return energy.again(point)
        point = step.point
    return point


def around(marked: Bools, one: Ints, other: Ints) -> Ints:
    """The marked unknowns (n,), and those up to RINGS edges away from them. one, other: (e,) the ends of the
    edges, −1 where an end is fixed."""
    marked = np.append(marked, False)
    for _ in range(RINGS):
        joined = marked[one] | marked[other]
        marked[one[joined]] = marked[other[joined]] = True
        marked[-1] = False
    return np.flatnonzero(marked)


def largest(gradient: Floats) -> float:
    """Maximum norm, 0 of nothing."""
    return float(np.abs(gradient).max(initial=0.0))


def _chords_left(residual: float, gain: float, tolerance: float) -> float:
    """Steps that reach the tolerance when each leaves ``gain`` of the residual."""
    if residual <= tolerance:
        return 0.0
    return float(np.log(tolerance / residual) / np.log(gain)) if gain < 1 else np.inf


class _Secants:
    """What steps since the last factorisation have shown of the Hessian: pairs of differences of x and of
    the gradient (L-BFGS). Mostly it changes in a few places, at corners and rough spots."""

    def __init__(self) -> None:
        self._pairs: list[tuple[Floats, Floats, float]] = []

    def learn(self, before: Point, after: Point) -> None:
        step, change = after.x - before.x, after.gradient - before.gradient
        along = float(step @ change)
        if along > 0 and largest(before.gradient) > LAST_ROUNDINGS:
            self._pairs = [*self._pairs[1 - LEARNED :], (step, change, along)]

    def direction(self, solve: Callable[[Floats], Floats], gradient: Floats) -> Floats:
        """−H⁻¹∇E with what is known of H; solve: with the factorised one."""
        right, shares = -gradient, []
        for step, change, along in reversed(self._pairs):
            shares.append(float(step @ right) / along)
            right = right - shares[-1] * change
        found = solve(right)
        for (step, change, along), share in zip(self._pairs, reversed(shares), strict=True):
            found = found + (share - float(change @ found) / along) * step
        return found


def _chord(energy: Convex[P], point: P, secants: _Secants) -> _Step[P] | None:
    """A step with the Hessian of an earlier one; None where that lowers nothing. Among the last roundings it
    need not: the Hessian is not what is missing there."""
    residual = largest(point.gradient)
    last = residual <= LAST_ROUNDINGS
    known = _Secants() if last else secants
    following = energy.at(point.x + known.direction(energy.solve, point.gradient))
    return _Step(following, full=True) if last or largest(following.gradient) < residual else None


def _newton(energy: Convex[P], point: P, leap: float) -> _Step[P] | None:
    """A step with the Hessian at the point; None where there is none."""
    direction = energy.direction(point)
    return None if direction is None else _line_search(energy, point, direction, leap)


def _line_search(energy: Convex[P], point: P, direction: Floats, leap: float) -> _Step[P] | None:
    """The first acceptable step: φ'(t) at most a little above zero. Overshoots are cut by secants on φ' from
    the start, guarded by bisection. None where no step is left."""
    slope = float(point.gradient @ direction)
    if not slope < 0:
        return None
    t = min(1.0, leap / max(energy.change(direction), TINY))
    for _ in range(MAX_TRIALS):
        trial = energy.at(point.x + t * direction)
        new_slope = float(trial.gradient @ direction)
        halved = largest(trial.gradient) <= 0.5 * largest(point.gradient)
        if new_slope <= OVERSHOOT * abs(slope) or halved:
            return _Step(trial, full=t == 1.0)
        t *= min(max(slope / (slope - new_slope), 0.1), 0.7)
    return None
