"""How large a regular panel may become in its cell.

A panel with centre c and edge ℓ reaches s_k·c + ℓ h_k in the direction s_k of its k-th separating plane,
h_k being the support function of the polygon with edge 1. It stays on its side when that is at most the
plane's offset o_k.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.geometry import cross_2d
from hexwrap_solver.panels.regular import Poses
from hexwrap_solver.tolerances import RELATIVE

#: Multipliers of a dual vertex count as non-negative down to this (their sum is of order 1).
DUAL_TOLERANCE = 1e-12

#: A panel found this much shorter (relatively) than the programme allows is looked for again.
SHORTFALL = 1e-9

#: Figures that differ by less (relatively) leave the panel's place open.
LOOSE = 1e-6


def support_function(poses: Poses, direction: Floats) -> Floats:
    """(q, k) farthest extent of the polygons of edge 1 around 0 in each direction (q, k, 3), one a corner."""
    spokes, (x, y, z) = poses.spokes(direction.shape[1]), np.ascontiguousarray(direction.T)
    reached = np.full(x.shape, -np.inf)
    for u, v, w in np.ascontiguousarray(spokes.transpose(1, 2, 0)):
        np.maximum(reached, x * u + y * v + z * w, out=reached)
    return reached.T


def inscribed(poses: Poses, direction: Floats, offset: Floats) -> tuple[Floats, Floats]:
    """The largest panels of the given orientations within their planes; direction (q, k, 3), offset (q, k).

    max ℓ over ℓ and c subject to s_k·c + ℓ h_k ≤ o_k, where c moves in the panel's plane: a linear programme
    in three unknowns, whose dual has a vertex for every triple of planes. By duality the optimum is
    the least dual value over all triples with non-negative multipliers, taken here for all cells at once.
    Returns lengths (q,), which may be negative where the planes leave no room, and centres (q, 3).
    """
    axes = np.stack([poses.x_axis, poses.y_axis], axis=1)
    flat = np.einsum("qkd,qed->qke", direction, axes)
    room = offset - np.einsum("qkd,qd->qk", direction, poses.center)
    h = support_function(poses, direction)
    best, chosen = _least_dual(flat, h, room)
    shift = _touching_centre(flat, h, room, chosen)
    bounded = np.where(np.isfinite(best), best, 0.0)
    short = ~np.isfinite(best) | (_room_length(shift, flat, h, room) < bounded - SHORTFALL * np.abs(bounded))
    again = np.flatnonzero(short | _is_loose(flat, chosen))
    shift[again] = _middle_vertex(flat[again], h[again], room[again])
    center = poses.center + np.einsum("qe,qed->qd", shift, axes)
    # The length is taken from the centre found, so that rounding in the centre cannot break a constraint.
    return length_at(center, direction, offset, h), center


def _is_loose(flat: Floats, triple: Ints) -> Bools:
    """Where two of the three planes are as good as parallel, so that the panel can slide between them."""
    a, b, c = np.moveaxis(flat[np.arange(len(flat))[:, None], triple], 1, 0)
    weight = np.abs([cross_2d(b, c), cross_2d(c, a), cross_2d(a, b)])
    return np.asarray(weight.min(axis=0) < LOOSE * weight.max(axis=0))


def _middle_vertex(flat: Floats, h: Floats, room: Floats) -> Floats:
    """(q, 2) the same optimum by trying every triple's touching point, and the mean of all that are as good.

    For cells with nearly parallel sides, whose dual vertices rounding cannot tell apart.
    """
    triples = list(combinations(range(flat.shape[1]), 3))
    tried = np.array([_touching_centre(flat, h, room, np.tile(triple, (len(flat), 1))) for triple in triples])
    length = np.array([_room_length(shift, flat, h, room) for shift in tried])
    as_good = length >= length.max(axis=0) - LOOSE * np.abs(length.max(axis=0))
    return np.asarray(np.einsum("tq,tqe->qe", as_good, tried) / as_good.sum(axis=0)[:, None])


def _room_length(shift: Floats, flat: Floats, h: Floats, room: Floats) -> Floats:
    return np.asarray(((room - np.einsum("qke,qe->qk", flat, shift)) / h).min(axis=1))


def _least_dual(flat: Floats, h: Floats, room: Floats) -> tuple[Floats, Ints]:
    """(q,) least value of the dual vertices of three planes each, infinite where none is feasible, and the
    three (q, 3)."""
    x, y, h, room = (np.ascontiguousarray(part.T) for part in (flat[..., 0], flat[..., 1], h, room))
    k, q = h.shape
    turn = {(i, j): x[i] * y[j] - y[i] * x[j] for i, j in combinations(range(k), 2)}
    triples = list(combinations(range(k), 3))
    best, which = np.full(q, np.inf), np.zeros(q, dtype=np.int64)
    for t, (a, b, c) in enumerate(triples):
        u, v, w = turn[b, c], -turn[a, c], turn[a, b]
        total = u * h[a] + v * h[b] + w * h[c]
        sign = np.sign(total)
        least = np.minimum(np.minimum(u * sign, v * sign), w * sign)
        feasible = (np.abs(total) > DUAL_TOLERANCE) & ~(least < -DUAL_TOLERANCE)
        value = (u * room[a] + v * room[b] + w * room[c]) / np.where(feasible, total, 1.0)
        better = feasible & (value < best)
        best[better], which[better] = value[better], t
    return best, np.array(triples, dtype=np.int64).reshape(-1, 3)[which]


def _touching_centre(flat: Floats, h: Floats, room: Floats, triple: Ints) -> Floats:
    """(q, 2) where the panel touches the three planes that bound it."""
    rows = np.arange(len(flat))[:, None]
    matrix = np.concatenate([flat[rows, triple], h[rows, triple][..., None]], axis=2)
    right = room[rows, triple]
    # Two parallel sides bound a panel that can still slide between them; least norm keeps it near the
    # centroid.
    singular = np.abs(np.linalg.det(matrix)) < RELATIVE
    solution = np.zeros((len(flat), 3))
    solution[~singular] = np.linalg.solve(matrix[~singular], right[~singular][..., None])[..., 0]
    solution[singular] = np.einsum(
        "qij,qj->qi", np.linalg.pinv(matrix[singular], rcond=RELATIVE), right[singular]
    )
    return solution[:, :2]


def length_at(center: Floats, direction: Floats, offset: Floats, h: Floats) -> Floats:
    """(q,) greatest edge length of panels with fixed centres."""
    return np.asarray(((offset - np.einsum("qkd,qd->qk", direction, center)) / h).min(axis=1))


def shortest_edge(poses: Poses, points: Floats, direction: Floats, offset: Floats) -> tuple[Floats, Floats]:
    """The paper's rule: a panel takes the shortest edge of its cell, around the cell's centroid.

    That alone does not exclude overlap. Where it would overlap, the centre moves towards that of the largest
    inscribed panel just as far as needed; where even that is smaller, the inscribed panel is taken.
    """
    edge = np.linalg.norm(np.roll(points, -1, axis=1) - points, axis=2).min(axis=1)
    largest, goal = inscribed(poses, direction, offset)
    length = np.minimum(edge, largest)
    h = support_function(poses, direction)
    now = offset - np.einsum("qkd,qd->qk", direction, poses.center) - length[:, None] * h
    gained = -np.einsum("qkd,qd->qk", direction, goal - poses.center)
    needed = np.divide(-now, gained, out=np.zeros_like(now), where=(now < 0) & (gained > 0))
    center = poses.center + np.clip(needed.max(axis=1), 0.0, 1.0)[:, None] * (goal - poses.center)
    return np.minimum(length, length_at(center, direction, offset, h)), center
