"""All panel sizes optimised together: one sparse linear programme with separating rows."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, eye_array, vstack

from hexwrap_solver.arrays import Floats, Ints, Progress, no_progress
from hexwrap_solver.panels.limits import inscribed, length_at, reach
from hexwrap_solver.panels.linear_programme import maximise
from hexwrap_solver.panels.regular import Poses

#: A centre may move this far (in edge lengths) from its inscribed panel's. Rows speak of next neighbours
#: only; without a bound whole rings of panels would slide away.
FARTHEST_SHIFT = 0.25

#: No panel may become smaller than its inscribed size by more than this fraction. (With none at all the
#: programme would have no interior where panels are jammed.)
GREATEST_LOSS = 1e-3

#: Cost of ½ (shift / edge)² against 1 for an edge of size. Long rings of panels could otherwise close up a
#: little more by sliding along, and leave all that they gained as one wide gap at the boundary.
SHIFT_COST = 1.0


def jointly_largest(
    poses: Poses,
    direction: Floats,
    offset: Floats,
    partner: Ints,
    joint: float,
    progress: Progress = no_progress,
) -> tuple[Floats, Floats]:
    """Lengths (r,) and centres (r, 3) with the greatest total area to first order, without overlap.

    direction (r, k, 3), offset (r, k): the separating planes, k = corners. partner: (r·k,) position of the
    same edge in the neighbour's row, or −1 where the plane stays fixed (boundary, trimmed neighbours).
    Planes between two regular panels may slide: the one gains what the other gives up. With s the plane's
    direction, c + ℓh the reach of a panel along it, and primes for the neighbour,
        s·c + ℓ h − s·c' + ℓ' h' ≤ −joint.
    Sizes are weighted by those of the inscribed panels, since dA ∝ ℓ dℓ. The programme is solved to a
    tolerance; the lengths are taken anew from the planes that its centres leave, which excludes overlap
    exactly. Raises ConvergenceError. Where some cell has no room at all, or there is none, the inscribed
    lengths are returned.
    """
    r = len(offset)
    start, center = inscribed(poses, direction, offset)
    if not r or start.min() <= 0:
        return start, center
    unit = float(np.median(start))
    h = reach(poses, direction)
    axes = np.stack([poses.x_axis, poses.y_axis], axis=1)
    flat = np.einsum("rkd,red->rke", direction, axes).reshape(-1, 2)
    room = (offset - np.einsum("rkd,rd->rk", direction, center)).ravel() / unit
    rows, right = _rows(flat, h.ravel(), room, partner, start / unit)
    weight = np.concatenate([np.zeros(2 * r), start / unit])
    inside = np.concatenate([np.zeros(2 * r), start / unit])
    where = np.concatenate([np.repeat(center, 2, axis=0), center])
    rho = np.concatenate([np.full(2 * r, SHIFT_COST), np.zeros(r)])
    solved = maximise(weight, rho, rows, right, inside, where, progress)
    center = center + unit * np.einsum("re,red->rd", solved[: 2 * r].reshape(r, 2), axes)
    length = unit * solved[2 * r :]
    moved = _slide(center, length, direction, offset, h, partner, joint)
    return length_at(center, direction, moved, h), center


def _rows(flat: Floats, h: Floats, room: Floats, partner: Ints, least: Floats) -> tuple[csr_array, Floats]:
    """Unknowns: in-plane shifts (r, 2), lengths (r,), in units of the median length. least: lengths kept.

    ``room`` of a shared plane is that to the unmoved plane less joint/2; both sides add up to that of the
    row.
    """
    edge = np.arange(len(room))
    r = len(least)
    k = len(room) // r
    fixed, once = np.flatnonzero(partner < 0), np.flatnonzero(edge < partner)
    sides = [np.concatenate([fixed, once]), np.concatenate([np.full(len(fixed), -1), partner[once]])]
    row, column, value = [], [], []
    for side in sides:
        at = np.flatnonzero(side >= 0)
        panel = side[at] // k
        row += [at, at, at]
        column += [2 * panel, 2 * panel + 1, 2 * r + panel]
        value += [flat[side[at], 0], flat[side[at], 1], h[side[at]]]
    entries = (np.concatenate(value), (np.concatenate(row), np.concatenate(column)))
    right = room[sides[0]] + np.where(sides[1] >= 0, room[sides[1]], 0.0)
    shared = csr_array(entries, shape=(len(right), 3 * r))
    box, lengths = eye_array(2 * r, 3 * r), eye_array(r, 3 * r, k=2 * r)
    bounds = [np.full(4 * r, FARTHEST_SHIFT), -(1 - GREATEST_LOSS) * least]
    return csr_array(vstack([shared, box, -box, -lengths])), np.concatenate([right, *bounds])


def _slide(
    center: Floats, length: Floats, direction: Floats, offset: Floats, h: Floats, partner: Ints, joint: float
) -> Floats:
    """(r, k) offsets of the planes put halfway into the room that each pair leaves."""
    extent = np.einsum("rkd,rd->rk", direction, center) + length[:, None] * h
    slack = (offset - extent).ravel()
    moved = offset.ravel().copy()
    shared = np.flatnonzero(partner >= 0)
    moved[shared] += (slack[partner[shared]] - slack[shared]) / 2
    return moved.reshape(offset.shape)
