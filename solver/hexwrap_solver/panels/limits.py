"""How large a regular panel may become in its cell.

A panel with centre c and edge ℓ reaches s_k·c + ℓ h_k in the direction s_k of its k-th separating plane,
h_k being the support function of the polygon with edge 1. It stays on its side when that is at most the
plane's offset o_k.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
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


@dataclass(frozen=True)
class _Programmes:
    """s_k·c + ℓ h_k ≤ o_k for every cell, as lines of the panels' planes: x, y: (k, q) of s; h: (k, q); room:
    (k, q) left beside the centre. NumPy runs along the cells."""

    x: Floats
    y: Floats
    h: Floats
    room: Floats

    def part(self, cells: Ints) -> _Programmes:
        return _Programmes(*(part.take(cells, axis=1) for part in (self.x, self.y, self.h, self.room)))

    def of(self, triple: Ints) -> _Programmes:
        """Those of three planes alone; triple: (3, q)."""
        cell = np.arange(self.x.shape[1])
        return _Programmes(*(part[triple, cell] for part in (self.x, self.y, self.h, self.room)))

    @property
    def turns(self) -> tuple[Floats, Floats, Floats]:
        """(q,) sines of the angles from the second of three planes to the third, from that to the first, and
        from that to the second."""
        x, y = self.x, self.y
        return tuple(x[i] * y[j] - y[i] * x[j] for i, j in ((1, 2), (2, 0), (0, 1)))

    def length(self, shift: Floats) -> Floats:
        """(q,) of the panels with centres moved by (2, q)."""
        return np.asarray(((self.room - self.x * shift[0] - self.y * shift[1]) / self.h).min(axis=0))


def inscribed(poses: Poses, direction: Floats, offset: Floats) -> tuple[Floats, Floats]:
    """The largest panels of the given orientations within their planes; direction (q, k, 3), offset (q, k).

    max ℓ over ℓ and c subject to s_k·c + ℓ h_k ≤ o_k, where c moves in the panel's plane: a linear programme
    in three unknowns, whose dual has a vertex for every triple of planes. By duality the optimum is
    the least dual value over all triples with non-negative multipliers, taken here for all cells at once.
    Returns lengths (q,), which may be negative where the planes leave no room, and centres (q, 3).
    """
    s = np.ascontiguousarray(direction.T)
    x_axis, y_axis, middle = (
        np.ascontiguousarray(part.T) for part in (poses.x_axis, poses.y_axis, poses.center)
    )
    h = np.ascontiguousarray(support_function(poses, direction).T)
    along = (s[0] * axis[0] + s[1] * axis[1] + s[2] * axis[2] for axis in (x_axis, y_axis, middle))
    x, y, at = along
    programmes = _Programmes(x, y, h, offset.T - at)
    best, chosen = _least_dual(programmes)
    own = programmes.of(chosen)
    shift = _touching_centre(own)
    bounded = np.where(np.isfinite(best), best, 0.0)
    short = ~np.isfinite(best) | (programmes.length(shift) < bounded - SHORTFALL * np.abs(bounded))
    again = np.flatnonzero(short | _is_loose(own))
    shift[:, again] = _middle_vertex(programmes.part(again))
    center = middle + shift[0] * x_axis + shift[1] * y_axis
    # The length is taken from the centre found, so that rounding in the centre cannot break a constraint.
    reached = s[0] * center[0] + s[1] * center[1] + s[2] * center[2]
    return ((offset.T - reached) / h).min(axis=0), np.ascontiguousarray(center.T)


def _is_loose(own: _Programmes) -> Bools:
    """Where two of the three planes are as good as parallel, so that the panel can slide between them."""
    weight = np.abs(own.turns)
    return np.asarray(weight.min(axis=0) < LOOSE * weight.max(axis=0))


def _middle_vertex(programmes: _Programmes) -> Floats:
    """(2, q) the same optimum by trying every triple's touching point, and the mean of all that are as good.

    For cells with nearly parallel sides, whose dual vertices rounding cannot tell apart.
    """
    k, q = programmes.x.shape
    tried = [
        _touching_centre(programmes.of(np.repeat(triple, q).reshape(3, q)))
        for triple in combinations(range(k), 3)
    ]
    length = np.array([programmes.length(shift) for shift in tried])
    as_good = length >= length.max(axis=0) - LOOSE * np.abs(length.max(axis=0))
    return np.asarray((as_good[:, None] * np.array(tried)).sum(axis=0) / as_good.sum(axis=0))


def _least_dual(programmes: _Programmes) -> tuple[Floats, Ints]:
    """(q,) least value of the dual vertices of three planes each, infinite where none is feasible, and the
    three (3, q)."""
    x, y, h, room = programmes.x, programmes.y, programmes.h, programmes.room
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
        np.copyto(best, value, where=better)
        which[better] = t
    return best, np.array(triples, dtype=np.int64).reshape(-1, 3).T.take(which, axis=1)


def _touching_centre(own: _Programmes) -> Floats:
    """(2, q) where the panel touches the three planes that bound it: by Cramer's rule."""
    x, y, h, room = own.x, own.y, own.h, own.room
    a, b, c = own.turns
    det = a * h[0] + b * h[1] + c * h[2]
    # Two parallel sides bound a panel that can still slide between them; least norm keeps it near the
    # centroid.
    singular = np.flatnonzero(np.abs(det) < RELATIVE)
    d, e, f = (room[i] * h[j] - h[i] * room[j] for i, j in ((1, 2), (2, 0), (0, 1)))
    safe = det.copy()
    safe[singular] = 1.0
    shift = np.stack([-(y[0] * d + y[1] * e + y[2] * f), x[0] * d + x[1] * e + x[2] * f]) / safe
    if len(singular):
        matrix = np.stack([part.take(singular, axis=1) for part in (x, y, h)], axis=2).transpose(1, 0, 2)
        right = room.take(singular, axis=1).T
        shift[:, singular] = np.einsum("qij,qj->iq", np.linalg.pinv(matrix, rcond=RELATIVE), right)[:2]
    return np.asarray(shift)


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
