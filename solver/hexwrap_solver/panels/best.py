"""All panel sizes optimised together: one sparse linear programme with separating rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, eye_array, vstack

from hexwrap_solver.arrays import Floats, Ints, Progress, no_progress
from hexwrap_solver.panels.limits import inscribed, support_function
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


@dataclass(frozen=True)
class Bound:
    """Panels with the same number k of corners, and their planes: direction (r, k, 3), offset (r, k). area:
    of one with edge 1, relative to the largest kind's."""

    poses: Poses
    direction: Floats
    offset: Floats
    area: float = 1.0


def jointly_largest(
    groups: list[Bound], partner: Ints, progress: Progress = no_progress
) -> tuple[Floats, Floats]:
    """Lengths (r,) and centres (r, 3) with the greatest total area to first order, without overlap.

    groups: r panels altogether. partner: (h,) of the edges of all groups in a row: position of the same edge
    in the neighbour, or −1 where the plane stays fixed (boundary, trimmed neighbours).
    Planes between two regular panels may slide: the one gains what the other gives up. With s the plane's
    direction, c + ℓh the support function of a panel along it, and primes for the neighbour,
        s·c + ℓ h − s·c' + ℓ' h' ≤ −joint.
    Sizes are weighted by those of the inscribed panels, and kinds by their area, since dA ∝ A₁ ℓ dℓ. The
    programme is solved to a tolerance; the lengths are taken anew from the planes that its centres leave,
    which excludes overlap exactly. Raises ConvergenceError. Where some cell has no room at all, or there is
    none, the inscribed lengths are returned.
    """
    found = [inscribed(group.poses, group.direction, group.offset) for group in groups]
    start = np.concatenate([length for length, _ in found])
    center = np.concatenate([center for _, center in found])
    r = len(start)
    if not r or start.min() <= 0:
        return start, center
    unit = float(np.median(start))
    sides = np.concatenate([np.full(len(group.offset), group.offset.shape[1]) for group in groups])
    panel, first = np.repeat(np.arange(r), sides), np.cumsum(sides) - sides
    h = np.concatenate([support_function(group.poses, group.direction).ravel() for group in groups])
    direction = np.concatenate([group.direction.reshape(-1, 3) for group in groups])
    offset = np.concatenate([group.offset.ravel() for group in groups])
    axes = np.concatenate([np.stack([g.poses.x_axis, g.poses.y_axis], axis=1) for g in groups])
    flat = np.einsum("hd,hed->he", direction, axes[panel])
    room = (offset - np.einsum("hd,hd->h", direction, center[panel])) / unit
    rows, right = _rows(flat, h, room, partner, panel, start / unit)
    area = np.concatenate([np.full(len(group.offset), group.area) for group in groups])
    weight = np.concatenate([np.zeros(2 * r), area * start / unit])
    inside = np.concatenate([np.zeros(2 * r), start / unit])
    where = np.concatenate([np.repeat(center, 2, axis=0), center])
    rho = np.concatenate([np.full(2 * r, SHIFT_COST), np.zeros(r)])
    solved = maximise(weight, rho, rows, right, inside, where, progress)
    center = center + unit * np.einsum("re,red->rd", solved[: 2 * r].reshape(r, 2), axes)
    at = np.einsum("hd,hd->h", direction, center[panel])
    slack = offset - at - unit * solved[2 * r :][panel] * h
    shared = np.flatnonzero(partner >= 0)
    # Planes are put halfway into the room that each pair leaves.
    offset[shared] += (slack[partner[shared]] - slack[shared]) / 2
    return np.minimum.reduceat((offset - at) / h, first), center


def _rows(
    flat: Floats, h: Floats, room: Floats, partner: Ints, panel: Ints, least: Floats
) -> tuple[csr_array, Floats]:
    """Unknowns: in-plane shifts (r, 2), lengths (r,), in units of the median length. least: lengths kept.

    ``room`` of a shared plane is that to the unmoved plane less joint/2; both sides add up to that of the
    row.
    """
    edge = np.arange(len(room))
    r = len(least)
    fixed, once = np.flatnonzero(partner < 0), np.flatnonzero(edge < partner)
    sides = [np.concatenate([fixed, once]), np.concatenate([np.full(len(fixed), -1), partner[once]])]
    row, column, value = [], [], []
    for side in sides:
        at = np.flatnonzero(side >= 0)
        own = panel[side[at]]
        row += [at, at, at]
        column += [2 * own, 2 * own + 1, 2 * r + own]
        value += [flat[side[at], 0], flat[side[at], 1], h[side[at]]]
    entries = (np.concatenate(value), (np.concatenate(row), np.concatenate(column)))
    right = room[sides[0]] + np.where(sides[1] >= 0, room[sides[1]], 0.0)
    shared = csr_array(entries, shape=(len(right), 3 * r))
    box, lengths = eye_array(2 * r, 3 * r), eye_array(r, 3 * r, k=2 * r)
    bounds = [np.full(4 * r, FARTHEST_SHIFT), -(1 - GREATEST_LOSS) * least]
    return csr_array(vstack([shared, box, -box, -lengths])), np.concatenate([right, *bounds])
