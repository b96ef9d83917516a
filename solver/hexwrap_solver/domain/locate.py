"""Which triangle of the unrolled domain holds a place of the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints, runs
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.tolerances import RELATIVE, TINY

#: A place this far outside of a triangle, in barycentric coordinates, still counts as on its edge.
ON_EDGE = 1e-9

#: Buckets beyond these are empty: sizes of triangles differ by less, and places farther off are outside.
FARTHEST = 2.0**31

#: Sheets tried to either side when g moves the domain by much less than its size.
FEW_SHEETS = 64


def barycentric(corners: Complexes, place: Complexes) -> Floats:
    """(k, 3) barycentric coordinates of places in triangles with corners (k, 3) in the plane."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = place - corners[:, 0]
    area = a.real * b.imag - a.imag * b.real
    area = np.where(area == 0, TINY, area)
    second = (p.real * b.imag - p.imag * b.real) / area
    third = (a.real * p.imag - a.imag * p.real) / area
    return np.stack([1 - second - third, second, third], axis=1)


@dataclass(frozen=True)
class _Level:
    """Triangles of about one size in square buckets of that size: each lies in at most four."""

    side: float
    key: Ints
    triangle: Ints


class TriangleIndex:
    """Finds triangles of the plane by place; they may differ in size by any factor, and overlap."""

    def __init__(self, corners: Complexes) -> None:
        self.corners = corners
        low = np.stack([corners.real.min(axis=1), corners.imag.min(axis=1)], axis=1)
        high = np.stack([corners.real.max(axis=1), corners.imag.max(axis=1)], axis=1)
        self.low, self.high = low, high
        self.origin = low.min(axis=0)
        size = np.maximum((high - low).max(axis=1), RELATIVE * float((high.max(axis=0) - self.origin).max()))
        level = np.ceil(np.log2(size)).astype(np.int64)
        self.levels = [self._level(low, high, np.flatnonzero(level == e), int(e)) for e in np.unique(level)]

    def _level(self, low: Floats, high: Floats, which: Ints, exponent: int) -> _Level:
        side = 2.0**exponent
        margin = 1e-6 * side
        first = np.floor((low[which] - margin - self.origin) / side).astype(np.int64)
        last = np.floor((high[which] + margin - self.origin) / side).astype(np.int64)
        wide = last - first + 1
        owner, step = runs(wide.prod(axis=1))
        x, y = first[owner, 0] + step % wide[owner, 0], first[owner, 1] + step // wide[owner, 0]
        key = _pack(x, y)
        order = np.argsort(key, kind="stable")
        return _Level(side, key[order], which[owner][order])

    def find(self, places: Complexes) -> tuple[Ints, Floats]:
        """(k,) triangle that holds each place, −1 where none does, and (k, 3) its barycentric coordinates."""
        face = np.full(len(places), -1, dtype=np.int64)
        weights = np.zeros((len(places), 3))
        depth = np.full(len(places), -ON_EDGE)
        for level in self.levels:
            bucket = np.floor((np.stack([places.real, places.imag], axis=1) - self.origin) / level.side)
            bucket = np.clip(bucket, -FARTHEST, FARTHEST).astype(np.int64)
            key = _pack(bucket[:, 0], bucket[:, 1])
            start, end = (np.searchsorted(level.key, key, side=side) for side in ("left", "right"))
            place, step = runs(end - start)
            triangle = level.triangle[start[place] + step]
            at, margin = places[place], 1e-6 * level.side
            low, high = self.low[triangle], self.high[triangle]
            near = (at.real >= low[:, 0] - margin) & (at.real <= high[:, 0] + margin)
            near &= (at.imag >= low[:, 1] - margin) & (at.imag <= high[:, 1] + margin)
            place, triangle = place[near], triangle[near]
            inside = barycentric(self.corners[triangle], places[place])
            least = inside.min(axis=1)
            order = np.lexsort((triangle, -least, place))
            best = order[np.unique(place[order], return_index=True)[1]]
            best = best[least[best] > depth[place[best]]]
            at = place[best]
            face[at], weights[at], depth[at] = triangle[best], inside[best], least[best]
        return face, weights


def _pack(x: Ints, y: Ints) -> Ints:
    """One number for a bucket; far outside the domain numbers may coincide, which costs a test, no more."""
    return np.asarray(x * (1 << 31) + y)


def find_places(cmap: ConformalMap, places: Complexes) -> tuple[Ints, Floats]:
    """The triangle of each place of the unrolled domain, on any sheet; as TriangleIndex.find.

    Where the domain overlaps itself, the sheet nearest to 0 is meant; of a net, the triangle in which the
    place lies deepest.
    """
    if cmap.kind == "net":
        return TriangleIndex(cmap.corners()).find(places)
    if cmap.kind == "cylinder" and len(places):  # straight to the right turn, however far away
        turn = cmap.deck.translation
        places = places - np.floor(((places - cmap.uv[0]) / turn).real) * turn
    index = TriangleIndex(cmap.corners())
    face = np.full(len(places), -1, dtype=np.int64)
    weights = np.zeros((len(places), 3))
    for s in _sheets(cmap, places):
        missing = np.flatnonzero(face < 0)
        if not len(missing):
            break
        face[missing], weights[missing] = index.find(cmap.deck.apply(places[missing], -s))
    missing = np.flatnonzero((face < 0) & np.isfinite(places))
    for sheet in _sheets_about_apex(cmap, places) if len(missing) else ():
        face[missing], weights[missing] = index.find(cmap.deck.apply(places[missing], -sheet[missing]))
        missing = missing[face[missing] < 0]
    return face, weights


def _sheets_about_apex(cmap: ConformalMap, places: Complexes) -> list[Ints]:
    """(k,) sheets on which the places can lie, from their angles about the apex. Nothing where g turns by so
    much that ``_sheets`` has tried all."""
    apex, reduced = cmap.deck.apex, cmap.deck.reduced
    if apex is None or abs(reduced) * FEW_SHEETS >= 2 * np.pi:
        return []
    own = np.angle((cmap.corners() - apex) / (cmap.uv[0] - apex)) / reduced
    known = np.where(np.isfinite(places), places, cmap.uv[0])
    first = np.ceil(np.angle((known - apex) / (cmap.uv[0] - apex)) / reduced - own.max() - 1e-3)
    many = min(int(np.ceil(np.ptp(own))) + 1, 2 * FEW_SHEETS)
    return [(first + step).astype(np.int64) for step in range(many)]


def _sheets(cmap: ConformalMap, places: Complexes) -> list[int]:
    """Sheets on which any of the places can lie: 0, 1, −1, 2, …, no more than a few of very many."""
    deck = cmap.deck
    spread = int(abs(cmap.sheet).max(initial=0))
    if not deck.is_translation:
        most = min(int(np.ceil(2 * np.pi / abs(deck.reduced))), FEW_SHEETS) + spread + 1
    elif abs(deck.translation) == 0 or not len(places):
        most = 0
    else:
        reach = abs(places - cmap.uv[0]).max() + abs(cmap.corners() - cmap.uv[0]).max()
        most = min(int(reach / abs(deck.translation)) + 1, FEW_SHEETS)
    return [0] + [sign * s for s in range(1, most + 1) for sign in (1, -1)]
