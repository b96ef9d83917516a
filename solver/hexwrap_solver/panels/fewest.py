"""The fewest edge lengths that leave no joint wider than an architect accepts.

Every panel may have any length in an interval: at most its limit, and at least what keeps the joints to its
neighbours narrow enough. The fewest values that meet all intervals are found greedily from below (the
classical stabbing of intervals): the lowest upper end must be met, and meeting it as high as possible serves
most others. Panels share the room in a joint; how it is divided between the two is not given, so classes are
then taken away one by one for as long as the *measured* joints allow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints

#: A joint this much over the greatest one allowed, relatively, is rounding.
SLACK = 1e-9
#: Intervals looked at together while the next one that is not met is searched.
BLOCK = 4096
#: Rounds in which room is divided anew between the two panels of a joint.
ROUNDS = 8
#: Above this many classes no attempt is made to save one: nobody builds with them.
MANY = 400


@dataclass(frozen=True)
class Joints:
    """Joints between panels that may still change their lengths, and others.

    left, right: (k,) the panels, −1 where a panel has a given shape. width: measures all joints, (k,), for
    given lengths (r,). shrink: (r,) by how much a joint widens per length that a panel loses.
    """

    left: Ints
    right: Ints
    width: Callable[[Floats], Floats]
    shrink: Floats


@dataclass(frozen=True)
class Fewest:
    """length: (r,). over: (k,) joints wider than allowed even where every panel has its own length; width:
    (k,) the joints with own lengths. bound: (k,) greatest width that was kept."""

    length: Floats
    over: Bools
    width: Floats
    bound: Floats


def fewest_lengths(limit: Floats, joints: Joints, max_gap: float, kind: Ints) -> Fewest:
    """limit: (r,) greatest length of each panel, which its class may not exceed. max_gap: greatest width of a
    joint, in the unit of the limits. kind: (r,) panels of different kinds share no class. Joints that are
    wider even at the limits become no wider than the widest of them is there."""
    own = joints.width(limit)
    allowed = np.full(len(own), max_gap * (1 + SLACK))
    over = own > allowed
    bound = np.where(over, (1 + SLACK) * own[over].max(initial=0.0), allowed)
    length = _stab_fairly(limit, joints, own, bound, kind)
    for one in np.unique(kind):
        length = _merge_classes(limit, length, joints, bound, kind == one)
    return Fewest(length, over, own, bound)


def _stab_fairly(limit: Floats, joints: Joints, own: Floats, bound: Floats, kind: Ints) -> Floats:
    """Lengths by stabbing, the room in each joint divided between its panels.

    How a joint widens is linear in the lengths only where the edges are parallel. Where the measured widths
    still exceed the bound, the room that is given away there shrinks, at last to nothing.
    """
    room = bound - own
    share = np.ones(len(own))
    length = limit
    for _ in range(ROUNDS):
        low = limit - _least_per_panel(joints, share * room / 2, len(limit)) / joints.shrink
        length = np.zeros_like(limit)
        for one in np.unique(kind):
            length[kind == one] = stab(limit[kind == one], low[kind == one])
        wide = joints.width(length) > bound
        if not wide.any():
            return length
        share[wide] /= 2
    return limit  # always allowed


def _least_per_panel(joints: Joints, value: Floats, n: int) -> Floats:
    least = np.full(n, np.inf)
    for side in (joints.left, joints.right):
        np.minimum.at(least, side[side >= 0], value[side >= 0])
    return np.asarray(np.maximum(least, 0.0))


def stab(high: Floats, low: Floats) -> Floats:
    """(n,) for each interval [low, high] a value inside, with the fewest different values, each an upper end.

    Values are as high as they can be: the greatest of them that does not exceed the interval's upper end.
    """
    order = np.argsort(high, kind="stable")
    ends, begins = high[order], low[order]
    value = np.zeros(len(high))
    at = 0
    while at < len(ends):
        after = at
        while after < len(ends):  # the next interval that begins above the value
            beyond = begins[after : after + BLOCK] > ends[at]
            if beyond.any():
                after += int(beyond.argmax())
                break
            after += len(beyond)
        value[order[at:after]] = ends[at]
        at = after
    return value


def _merge_classes(limit: Floats, length: Floats, joints: Joints, bound: Floats, chosen: Bools) -> Floats:
    """Takes classes of the chosen panels away, the cheapest in area first, while the joints stay narrow
    enough."""
    sizes = np.unique(length[chosen])
    if len(sizes) > MANY:
        return length
    tried: set[float] = set()
    while len(sizes) > 1:
        counts = np.bincount(np.searchsorted(sizes, length[chosen]), minlength=len(sizes))
        cost = np.append(np.inf, counts[1:] * np.diff(sizes**2))
        cost[np.isin(sizes, list(tried))] = np.inf
        least = int(cost.argmin())
        if not np.isfinite(cost[least]):
            break
        fewer = np.delete(sizes, least)
        shorter = length.copy()
        shorter[chosen] = fewer[np.searchsorted(fewer, limit[chosen], side="right") - 1]
        if (joints.width(shorter) <= bound).all():
            sizes, length = fewer, shorter
        else:
            tried.add(float(sizes[least]))
    return length
