"""The nearest point of a triangle mesh, exactly, for many points at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.geometry import dot, dot_first
from hexwrap_solver.tolerances import RELATIVE

#: Points searched together, pairs of points and triangles looked at together, and compared together; they
#: bound the memory of the search, not its result. A point on the axis of a tube is as near to whole rings.
CHUNK, MOST_PAIRS, COMPARED = 65536, 1 << 22, 1 << 18

#: At most this many points descend the tree together: as many as there are for each triangle, since the box
#: of points that lie further apart than triangles meets too many of these.
LARGEST_GROUP = 8
#: So many of these groups descend the upper half of the tree together, where boxes are large.
BUNDLE = 16

#: Triangles whose boxes are no further apart than this part of a usual one's extent are beside each other;
#: which ones is remembered, for no more than MOST_PAIRS of them.
MARGIN = 0.125
#: A point walks over at most this many sides of triangles.
MOST_STEPS = 12

#: A point further away than this many sizes of the mesh is moved straight towards it, to this distance, for
#: the search. From there rays to the mesh differ from parallel ones by the inverse part of its size; much
#: further away the digits that distinguish triangles are lost, and squares overflow in the end.
FAR = 1e6

#: Bits per coordinate of the Morton code that sorts the triangles.
MORTON_BITS = 20
#: Moves the bits of a coordinate three places apart: shift, then keep what these masks leave.
SPREAD = (
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)
#: Distances from boxes are good to this many roundings of the coordinates.
ROUNDINGS = 8


_NO_PAIRS = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class Nearest:
    """face: (k,) a nearest triangle. barycentric: (k, 3) of the nearest point in it. distance: (k,)."""

    face: Ints
    barycentric: Floats
    distance: Floats


@dataclass(frozen=True)
class _Beside:
    """Leaves beside triangles. first, count: (m,) where those of each stand in leaf; first is −1 where they
    were not asked for yet."""

    first: Ints
    count: Ints
    leaf: NDArray[np.int32]

    def pairs(self, face: Ints) -> tuple[Ints, Ints]:
        """Which of the triangles (k,), and a leaf beside it."""
        count = self.count.take(face)
        one = np.repeat(np.arange(len(face)), count)
        at = np.arange(len(one)) + np.repeat(self.first.take(face) - np.cumsum(count) + count, count)
        return one, self.leaf.take(at).astype(np.int64)

    def knowing(self, face: Ints, one: Ints, leaf: Ints) -> _Beside:
        """With the pairs of further triangles (k,); without all others where there are too many."""
        known = self if len(self.leaf) + len(leaf) <= MOST_PAIRS else _Beside.none(len(self.first))
        first, count = known.first.copy(), known.count.copy()
        count[face] = np.bincount(one, minlength=len(face))
        first[face] = len(known.leaf) + np.cumsum(count[face]) - count[face]
        added = leaf[np.argsort(one, kind="stable")].astype(np.int32)
        return _Beside(first, count, np.concatenate([known.leaf, added]))

    @classmethod
    def none(cls, m: int) -> _Beside:
        return cls(np.full(m, -1), np.zeros(m, dtype=np.int64), np.zeros(0, dtype=np.int32))


@dataclass(frozen=True)
class TriangleTree:
    """Boxes around triangles sorted along a Morton curve, pairwise merged up to a single root.

    corners: (m, 3, 3). centroids: search tree over the triangles' centroids. order: (m,) triangles along
    the curve. low, high: per level from the root downwards, (3, 2^level); boxes beyond the last triangle
    are empty (low = ∞).
    """

    corners: Floats
    centroids: KDTree
    order: Ints
    low: list[Floats]
    high: list[Floats]

    @classmethod
    def build(cls, vertices: Floats, faces: Ints) -> TriangleTree:
        """vertices: (n, 3), faces: (m, 3) with m ≥ 1."""
        corners = vertices[faces]
        centroid = corners.mean(axis=1)
        order = np.argsort(_morton(centroid), kind="stable")
        leaves = 1 << max(len(faces) - 1, 0).bit_length()
        low, high = np.full((3, leaves), np.inf), np.full((3, leaves), -np.inf)
        a, b, c = (vertices[corner].T for corner in faces[order].T)
        low[:, : len(faces)] = np.minimum(np.minimum(a, b), c)
        high[:, : len(faces)] = np.maximum(np.maximum(a, b), c)
        lows, highs = [low], [high]
        while lows[-1].shape[1] > 1:
            lows.append(np.minimum(lows[-1][:, ::2], lows[-1][:, 1::2]))
            highs.append(np.maximum(highs[-1][:, ::2], highs[-1][:, 1::2]))
        return cls(corners, KDTree(centroid), order, lows[::-1], highs[::-1])

    def nearest(self, points: Floats) -> Nearest:
        """points: (k, 3), finite.

        Of a point beyond FAR sizes of the mesh the nearest point is exact to 1/FAR of the mesh's size; a
        distance that no number can hold is given as the largest number.
        """
        far, near = self._moved_near(points)
        found = self._nearest_of_all(near)
        gap = points[far] - np.einsum("kc,kcd->kd", found.barycentric[far], self.corners[found.face[far]])
        found.distance[far] = _length(gap)
        return found

    def farthest(self, points: Floats, row: Ints, rows: int, near: Ints, twin: Ints) -> Floats:
        """(rows,) the greatest distance from the mesh among the points of each row, exactly; 0 for none.

        points: (k, 3), finite. row: (k,) row of each. near: (k,) a triangle believed to be near each point.
        The distance of the one to which the way from there leads bounds the point's own from above, so that
        most points need not be searched for. twin: of half-edges, as ``Triangles.twin``. Rows that are as the
        last time keep what was found then.
        """
        last: tuple[Floats, Ints, Ints, Floats] | None = self.__dict__.get("_last")
        place = np.ascontiguousarray(points.T)
        if last is None or len(last[3]) != rows or not np.array_equal(last[1], row):
            greatest = self._farthest(place, row, rows, near, twin)
        else:
            changed, greatest = np.zeros(rows, dtype=bool), last[3].copy()
            changed[row[(place != last[0]).any(axis=0) | (near != last[2])]] = True
            some, at = np.flatnonzero(changed.take(row)), np.cumsum(changed) - 1
            greatest[changed] = self._farthest(
                place.take(some, axis=1), at.take(row.take(some)), int(changed.sum()), near.take(some), twin
            )
        # as a cached property would be
        self.__dict__["_last"] = tuple(one.copy() for one in (place, row, near, greatest))
        return greatest

    def _farthest(self, points: Floats, row: Ints, rows: int, near: Ints, twin: Ints) -> Floats:
        """points: (3, k), as below: NumPy runs along them."""
        near, bound = self._walked(points, near, twin)
        greatest = np.full(rows, -1.0)
        np.maximum.at(greatest, row, bound)
        first = bound == greatest.take(row)
        greatest[:] = 0.0

        def search(which: Bools) -> None:
            some = np.flatnonzero(which)
            found = self._least_distance(points.take(some, axis=1), near.take(some), bound.take(some))
            np.maximum.at(greatest, row.take(some), found)

        search(first)
        search(bound > greatest.take(row))
        return greatest

    def _walked(self, points: Floats, face: Ints, twin: Ints) -> tuple[Ints, Floats]:
        """(k,) triangles nearer to the points (3, k), as a rule, than those given, and the distances from
        them: while a point lies beyond a side of its own, the one across is next, unless it came from there.
        """
        face, before, left = face.copy(), np.full(len(face), -1), np.arange(len(face))
        placed = here = self._placed(points, face)
        for _ in range(MOST_STEPS):
            second, third, _ = here
            beyond = np.flatnonzero((second < 0) | (third < 0) | (second + third > 1))
            left, second, third = (of.take(beyond) for of in (left, second, third))
            side = np.stack([1 - second - third, second, third]).argmin(axis=0)
            now = face.take(left)
            # the half-edge from the next corner on lies opposite
            across = twin.take(3 * now + (side + 1) % 3)
            on = np.flatnonzero((across >= 0) & (across // 3 != before.take(left)))
            if not len(on):
                break
            left = left.take(on)
            before[left], face[left] = now.take(on), across.take(on) // 3
            here = self._placed(points.take(left, axis=1), face.take(left))
            placed[:, left] = here
        return face, self._distance(points, face, placed=placed)

    def _least_distance(self, points: Floats, near: Ints, bound: Floats) -> Floats:
        """(k,) distances from the mesh. bound: from the triangles near (k,); where these are not near, the
        search begins elsewhere."""
        start, end, _ = self._corner.take(near, axis=2)
        close = bound <= np.abs(end - start).max(axis=0)
        some, least = points[:, close], bound.copy()
        scale = np.maximum(np.abs(some).max(axis=0, initial=0.0), np.abs(self._corner).max())
        reach = bound[close] * (1 + RELATIVE) + ROUNDINGS * np.finfo(float).eps * scale
        found = self._around(some, near[close], reach) if len(reach) else None
        if found is None:
            close[:] = False
        else:
            point, leaf = found
            there = least[close]
            distance = self._distance(some.take(point, axis=1), self.order.take(leaf), there.take(point))
            np.minimum.at(there, point, distance)
            least[close] = there
        if not close.all():
            least[~close] = self.nearest(points[:, ~close].T).distance
        return least

    def _around(self, points: Floats, near: Ints, reach: Floats) -> tuple[Ints, Ints] | None:
        """The pairs of ``_within``, and others, of points (3, k) within reach of the triangles near (k,)."""
        beside, others = np.flatnonzero(reach <= self._margin), np.flatnonzero(reach > self._margin)
        known: _Beside = self.__dict__.get("_beside", _Beside.none(len(self.corners)))
        new = np.unique(near[beside][known.first.take(near[beside]) < 0])
        own = self._corner.take(new, axis=2)
        low, high = own.min(axis=0) - self._margin, own.max(axis=0) + self._margin
        added = self._meeting(low, high) if len(new) else _NO_PAIRS
        searched = self._within(points[:, others].T, reach[others]) if len(others) else _NO_PAIRS
        if added is None or searched is None:
            return None
        if len(new):
            known = known.knowing(new, *added)
            self.__dict__["_beside"] = known  # as a cached property would be
        point, leaf = known.pairs(near[beside])
        below, above = ((points + way * reach).take(beside, axis=1) for way in (-1, 1))
        for axis in range(3):
            meets = self.low[-1][axis].take(leaf) <= above[axis].take(point)
            meets &= self.high[-1][axis].take(leaf) >= below[axis].take(point)
            kept = np.flatnonzero(meets)
            point, leaf = point.take(kept), leaf.take(kept)
        return np.append(beside.take(point), others.take(searched[0])), np.append(leaf, searched[1])

    @cached_property
    def _margin(self) -> float:
        return MARGIN * float(np.median(np.ptp(self.corners, axis=1).max(axis=1)))

    @cached_property
    def _corner(self) -> Floats:
        """(corner, coordinate, m), so that NumPy runs along the triangles."""
        return np.ascontiguousarray(self.corners.transpose(1, 2, 0))

    @cached_property
    def _frames(self) -> Floats:
        """(coordinate, 3, m) what carries an offset from the first corner of a triangle to the barycentric
        coordinates of the other two and the height above it; not numbers where it has no area."""
        ab, ac = self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0]
        normal = np.cross(ab, ac)
        square = dot(normal, normal)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            rows = np.cross(ac, normal) / square, np.cross(normal, ab) / square, normal / np.sqrt(square)
        return np.ascontiguousarray(np.stack(rows).transpose(2, 0, 1))

    def _placed(self, points: Floats, face: Ints) -> Floats:
        """(3, k) barycentric coordinates for the second and third corner, and height above the triangle."""
        offset = points - self._corner[0].take(face, axis=1)
        return dot_first(self._frames.take(face, axis=2), offset[:, None])

    def _distance(
        self, points: Floats, face: Ints, most: Floats | float = np.inf, placed: Floats | None = None
    ) -> Floats:
        """(k,) distance of each point from a triangle of its own; where it is not below ``most``, only
        something that is not, either. placed: as ``_placed`` gives it, where it is known."""
        second, third, height = self._placed(points, face) if placed is None else placed
        distance: Floats = np.abs(height)
        outside = ~((second >= 0) & (third >= 0) & (second + third <= 1)) & ~(distance >= most)
        outer = np.flatnonzero(outside)
        corners = self._corner.take(face.take(outer), axis=2)
        distance[outer] = np.sqrt(_on_sides(points.take(outer, axis=1), corners)[1].min(axis=0))
        return distance

    def _moved_near(self, points: Floats) -> tuple[Ints, Floats]:
        """Which points are too far away to search for them as they are, and all points, those moved."""
        low, high = self.low[0][:, 0], self.high[0][:, 0]
        middle, limit = (low + high) / 2, FAR * np.linalg.norm(high - low)
        offset = points - middle
        largest = np.abs(offset).max(axis=1)  # not the length, whose squares may overflow
        far = np.flatnonzero(largest > limit)
        direction = offset[far] / largest[far, None]
        near = points.copy()
        near[far] = middle + limit * direction / np.linalg.norm(direction, axis=1)[:, None]
        return far, near

    def _nearest_of_all(self, points: Floats) -> Nearest:
        face = np.zeros(len(points), dtype=np.int64)
        barycentric = np.zeros((len(points), 3))
        distance = np.zeros(len(points))
        along_curve = np.argsort(_morton(points), kind="stable") if len(points) else face
        for i in range(0, len(points), CHUNK):
            part = along_curve[i : i + CHUNK]
            face[part], barycentric[part], distance[part] = self._nearest(points[part])
        return Nearest(face, barycentric, distance)

    def _nearest(self, points: Floats) -> tuple[Ints, Floats, Floats]:
        """The triangle with the nearest centroid bounds the search of the others."""
        first = np.asarray(self.centroids.query(points)[1])
        guess = self.corners[first]
        bound = nearest_in_triangles(points, guess)[1]
        # Rounding, of the distance as of the boxes, must not prune the guess itself.
        scale = np.maximum(np.abs(points).max(axis=1), np.abs(guess).max(axis=(1, 2)))
        reach = bound * (1 + RELATIVE) + ROUNDINGS * np.finfo(float).eps * scale
        reach += np.finfo(float).tiny
        found = self._within(points, reach)
        if found is None:
            halves = (self._nearest(half) for half in np.array_split(points, 2))
            face, barycentric, distance = (np.concatenate(parts) for parts in zip(*halves, strict=True))
            return face, barycentric, distance
        point, leaf = found
        face = self.order[leaf]
        barycentric, distance = np.zeros((len(face), 3)), np.zeros(len(face))
        for i in range(0, len(face), COMPARED):
            part = slice(i, i + COMPARED)
            barycentric[part], distance[part] = nearest_in_triangles(
                points.take(point[part], axis=0), self.corners.take(face[part], axis=0)
            )
        best = np.lexsort((face, distance, point))
        best = best[np.diff(point[best], prepend=-1) > 0]
        return face[best], barycentric[best], distance[best]

    def _within(self, points: Floats, reach: Floats) -> tuple[Ints, Ints] | None:
        """All pairs (point, leaf) whose box comes within reach of the point; None where several points have
        too many."""
        place = np.ascontiguousarray(points.T)
        found = self._meeting(place - reach, place + reach)
        if found is None:
            return None
        point, leaf = found
        square = np.zeros(len(leaf))
        for axis in range(3):
            at = place[axis].take(point)
            outside = np.maximum(self.low[-1][axis].take(leaf) - at, at - self.high[-1][axis].take(leaf))
            square += np.maximum(outside, 0.0) ** 2
        kept = np.flatnonzero(np.sqrt(square) <= reach.take(point))
        return point.take(kept), leaf.take(kept)

    def _meeting(self, below: Floats, above: Floats) -> tuple[Ints, Ints] | None:
        """All pairs of a box, (3, k) its ends, and a leaf that it meets, and others; None where several boxes
        have too many.

        Boxes that are neighbours along the curve descend the tree together, in one.
        """
        k = below.shape[1]
        together = min(LARGEST_GROUP, 1 + k // len(self.order))
        bundle = BUNDLE if len(self.low) > 1 else 1
        start = np.arange(0, k, together * bundle)
        low, high = np.minimum.reduceat(below, start, axis=1), np.maximum.reduceat(above, start, axis=1)
        group, node = np.arange(len(start)), np.zeros(len(start), dtype=np.int64)
        for level in range(1, len(self.low)):
            if level == max(1, len(self.low) // 2):
                start = np.arange(0, k, together)
                low = np.minimum.reduceat(below, start, axis=1)
                high = np.maximum.reduceat(above, start, axis=1)
                group = (BUNDLE * group[:, None] + np.arange(BUNDLE)).ravel()
                node = np.repeat(node, BUNDLE)[group < len(start)]
                group = group[group < len(start)]
            group = np.repeat(group, 2)
            node = np.repeat(2 * node, 2)
            node[1::2] += 1
            for axis in range(3):
                meets = self.low[level][axis].take(node) <= high[axis].take(group)
                meets &= self.high[level][axis].take(node) >= low[axis].take(group)
                kept = np.flatnonzero(meets)
                group, node = group.take(kept), node.take(kept)
            if len(group) * together > MOST_PAIRS and k > 1:
                return None
        size = np.minimum(together, k - start)[group]
        box = np.repeat(start[group] - np.cumsum(size) + size, size) + np.arange(size.sum())
        return box, np.repeat(node, size)


def nearest_in_triangles(points: Floats, corners: Floats) -> tuple[Floats, Floats]:
    """Barycentric coordinates (k, 3) of the point of triangle k nearest to point k, and the distance (k,)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac, ap = b - a, c - a, points - a
    g11, g12, g22 = dot(ab, ab), dot(ab, ac), dot(ac, ac)
    r1, r2 = dot(ab, ap), dot(ac, ap)
    det = g11 * g22 - g12**2
    flat = det <= 0
    det = np.where(flat, 1.0, det)
    v, w = (g22 * r1 - g12 * r2) / det, (g11 * r2 - g12 * r1) / det
    inside = ~flat & (v >= 0) & (w >= 0) & (v + w <= 1)
    barycentric = np.stack([1 - v - w, v, w], axis=1)
    outer = np.flatnonzero(~inside)
    barycentric[outer] = _nearest_on_sides(points[outer], corners[outer])
    offset = ap - barycentric[:, 1:2] * ab - barycentric[:, 2:] * ac
    return barycentric, np.sqrt(dot(offset, offset))


def _nearest_on_sides(points: Floats, corners: Floats) -> Floats:
    way, distance = _on_sides(points.T, corners.transpose(1, 2, 0))
    side, k = distance.argmin(axis=0), np.arange(len(points))
    barycentric = np.zeros((len(points), 3))
    barycentric[k, side], barycentric[k, (side + 1) % 3] = 1 - way[side, k], way[side, k]
    return barycentric


def _on_sides(points: Floats, corners: Floats) -> tuple[Floats, Floats]:
    """(3, k) how far along each side, 0…1 from each corner to the next, the place nearest to the point lies,
    and its squared distance. points: (coordinate, k); corners: (corner, coordinate, k) of the triangles."""
    along = (np.roll(corners, -1, axis=0) - corners).swapaxes(0, 1)
    offset = (points - corners).swapaxes(0, 1)
    squared = dot_first(along, along)
    way = np.clip(dot_first(offset, along) / np.where(squared > 0, squared, 1.0), 0.0, 1.0)
    gap = way * along - offset
    return way, dot_first(gap, gap)


def _morton(points: Floats) -> Ints:
    """Interleaved bits of the coordinates: a curve that keeps near points near."""
    low = points.min(axis=0)
    span = max(float((points.max(axis=0) - low).max()), np.finfo(float).tiny)
    cell = ((points - low) / span * ((1 << MORTON_BITS) - 1)).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for axis in range(3):
        spread = np.ascontiguousarray(cell[:, axis])
        for shift, mask in SPREAD:
            spread = (spread | spread << shift) & mask
        code |= spread << axis
    return code


def _length(gap: Floats) -> Floats:
    """Lengths (k,) of (k, 3) however long, at most the largest number."""
    largest = np.maximum(np.abs(gap).max(axis=1), np.finfo(float).tiny)
    with np.errstate(over="ignore"):
        length = largest * np.linalg.norm(gap / largest[:, None], axis=1)
    return np.asarray(np.minimum(length, np.finfo(float).max))
