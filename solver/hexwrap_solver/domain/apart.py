"""Nets that overlap themselves, taken apart for drawings: in pieces beside each other that do not.

Which triangles overlap is decided on a raster: two that hold the same point of it do. What a drawing cannot
show, because it is finer than that, counts as no overlap.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints, runs
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap

#: Points of the raster along the longer side of the net.
RASTER = 400
#: Part of the raster's points held twice below which a net counts as not overlapping itself.
NEGLIGIBLE = 1e-3
#: Pieces smaller than this part of the net are not taken apart, nor more than this many.
CRUMB, MOST = 0.02, 24
#: Room between pieces, and the width of a row of pieces, in parts of the size of them all.
ROOM, WIDE = 0.04, 1.2


@dataclass(frozen=True)
class Apart:
    """piece: (m,) of each face. shift: (p,) complex, by which each piece is moved."""

    piece: Ints
    shift: Complexes

    def of_faces(self) -> Complexes:
        """(m,) the shift of every face."""
        return np.asarray(self.shift[self.piece])

    def moved(self, cmap: ConformalMap) -> ConformalMap:
        """The same map, on the net of the pieces where they are drawn."""
        corners = cmap.corners() + self.of_faces()[:, None]
        return replace(cmap, domain=Net.of_corners(corners, cmap.surface.twin))


def apart(cmap: ConformalMap) -> Apart | None:
    """The pieces to draw, or None where the net does not overlap itself."""
    corners, net = cmap.corners(), cmap.net
    face, point = _raster(corners)
    held = np.bincount(point)
    if np.count_nonzero(held > 1) <= NEGLIGIBLE * np.count_nonzero(held):
        return None
    across = np.where(net.crossing == 0, net.across, -1)
    piece = _merged(_pieces(across, face, point), across, np.bincount(face, minlength=len(corners)))
    if piece.max() == 0:
        return None
    return Apart(piece, _side_by_side(corners, piece))


def _raster(corners: Complexes) -> tuple[Ints, Ints]:
    """(face, point) for each point of the raster in a face, sorted by face; points on edges count once."""
    x, y = corners.real, corners.imag
    step = max(float(np.ptp(x)), float(np.ptp(y))) / RASTER
    x, y = (x - x.min()) / step + 0.381966, (y - y.min()) / step + 0.618034
    first = np.ceil(y.min(axis=1)).astype(np.int64)
    owner, row = runs(np.ceil(y.max(axis=1)).astype(np.int64) - first)
    row = row + first[owner]
    low, high = np.full(len(owner), np.inf), np.full(len(owner), -np.inf)
    for c in range(3):
        x0, y0, x1, y1 = (a[owner, (c + k) % 3] for k in (0, 1) for a in (x, y))
        crosses = (y0 < row) != (y1 < row)
        rise = np.where(crosses, y1 - y0, 1.0)
        at = x0 + (row - y0) / rise * (x1 - x0)
        low, high = np.where(crosses, np.minimum(low, at), low), np.where(crosses, np.maximum(high, at), high)
    met = low < high
    owner, row, low, high = owner[met], row[met], low[met], high[met]
    start = np.ceil(low).astype(np.int64)
    span, column = runs(np.ceil(high).astype(np.int64) - start)
    return owner[span], row[span] * (RASTER + 3) + start[span] + column


def _pieces(across: Ints, face: Ints, point: Ints) -> Ints:
    """(m,) pieces grown from neighbour to neighbour, each as far as it does not overlap itself."""
    m = len(across)
    counts = np.bincount(face, minlength=m)
    starts = np.cumsum(counts) - counts
    piece = np.full(m, -1, dtype=np.int64)
    for number in range(MOST):
        left = np.flatnonzero(piece < 0)
        if not len(left):
            break
        taken = np.zeros(int(point.max(initial=0)) + 1, dtype=bool)
        refused = piece >= 0
        frontier = left[[np.argmax(counts[left])]]
        while len(frontier):
            owner, step = runs(counts[frontier])
            at = point[starts[frontier][owner] + step]
            # Of two that overlap in the same wave the first one stays.
            first = np.zeros(len(at), dtype=bool)
            first[np.unique(at, return_index=True)[1]] = True
            clash = np.bincount(owner, taken[at] | ~first, minlength=len(frontier)) > 0
            taken[at[~clash[owner]]] = True
            refused[frontier] = True
            frontier = frontier[~clash]
            piece[frontier] = number
            near = np.unique(across[frontier])
            near = near[near >= 0]
            frontier = near[~refused[near]]
    piece[piece < 0] = 0
    return piece


def _merged(piece: Ints, across: Ints, size: Ints) -> Ints:
    """(m,) the same, crumbs being part of the neighbour they share most edges with."""
    piece = piece.copy()
    total = np.bincount(piece, size)
    for crumb in np.argsort(total):
        if total[crumb] >= CRUMB * total.sum():
            break
        members = np.flatnonzero(piece == crumb)
        beyond = across[members]
        beside = piece[beyond[beyond >= 0]]
        beside = beside[beside != crumb]
        if len(members) and len(beside):
            into = int(np.argmax(np.bincount(beside)))
            piece[members] = into
            total[into] += total[crumb]
    return np.unique(piece, return_inverse=True)[1].reshape(-1)


def _side_by_side(corners: Complexes, piece: Ints) -> Complexes:
    """(p,) shifts that put the pieces into rows, the tallest first; nothing changes within a piece."""
    order = np.argsort(piece, kind="stable")
    bounds = np.searchsorted(piece[order], np.arange(int(piece.max()) + 1))
    x, y = corners.real[order], corners.imag[order]
    low = np.stack([np.minimum.reduceat(a.min(axis=1), bounds) for a in (x, y)], axis=1)
    high = np.stack([np.maximum.reduceat(a.max(axis=1), bounds) for a in (x, y)], axis=1)
    extent: Floats = high - low
    size = float(np.sqrt(extent.prod(axis=1).sum()))
    width, room = max(WIDE * size, float(extent[:, 0].max())), ROOM * size
    target = np.zeros(len(extent), dtype=complex)
    right = up = tallest = 0.0
    for p in np.argsort(-extent[:, 1], kind="stable").tolist():
        if right and right + extent[p, 0] > width:
            right, up, tallest = 0.0, up + tallest + room, 0.0
        target[p] = complex(right, up)
        right += extent[p, 0] + room
        tallest = max(tallest, float(extent[p, 1]))
    shift = target - (low[:, 0] + 1j * low[:, 1])
    return np.asarray(shift - shift[0])  # the first piece, the largest part as a rule, stays where it is
