"""Panels for cells cut at the boundary: flat, of the cell's own shape, and clear of their neighbours.

Each edge of a cell that has a neighbour has a plane that separates the two panels (``separation``). In the
panel's own plane it is a line s · x = h, with s of length 1 pointing outwards; the panel must stay where
s · x ≤ h. A regular panel is shrunk until it does. A cut cell has no shape to keep, so that its corners may
go to these lines one by one, in three steps.

Mitres. Imagine a picture frame whose sides are moved, each along its own normal: a corner slides along its
mitre, to where its two sides meet again. With u and v the normals of the edges before and behind a corner c,
and e_u = h_u − u · c, e_v = h_v − v · c what is left to their lines, that place is

    c + (e_v J u − e_u J v) / (u × v),   J a quarter turn to the left,

since u · J v = −u × v and v · J u = u × v. Where u × v is nearly 0, the lines meet far off or nowhere: there
the corner goes straight back along u + v, behind both. Edges that would turn round keep their ends.

Clipping. A line binds the whole panel, not only its own edge: an outline that is not convex may reach over
the line of an edge far from there. So it is clipped at each line in turn, as by Sutherland and Hodgman
(1974); but corners beyond a line are not dropped. They are spread over the piece of the line that closes the
gap, so that the panel keeps a corner for every corner of its cell.

Wedges. Where a sliver was joined to the cell, the outline has a reflex corner with the same neighbour on both
of its edges. The neighbour then stands in the wedge beyond both lines, and to be beyond one of them is no
fault: these lines do not clip. Only where an edge of the outline passes through the wedge all the same, the
first or the last line of the run is made to clip, whichever leaves more of the panel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.geometry import cross_2d, dot, plane_axes, quarter_turn
from hexwrap_solver.panels.planar import in_planes
from hexwrap_solver.panels.polygons import area_vectors, means, row_maxima, row_sums

#: Lines that meet under an angle with a smaller sine do not fix a corner.
SHALLOW = 0.1

#: Part of a line that is left to short edges whose corners lay beyond it.
CROWDED = 0.1

#: Lengths below this, relative to the polygon's size, are rounding.
ROUNDING = 1e-12


def plane_normals(polygons: Ragged) -> Floats:
    """(q, 3) unit normals of the polygons' mean planes (direction of the area vector)."""
    vector = area_vectors(polygons)
    length = np.linalg.norm(vector, axis=1)
    return vector / np.where(length > 0, length, 1.0)[:, None]


def flatten_and_clear(
    polygons: Ragged,
    normal: Floats,
    direction: Floats,
    offset: Floats,
    across: Ints,
    origin: Floats | None = None,
) -> tuple[Ragged, Floats, Floats]:
    """Lays polygons in their planes, each as large as its separating planes let it be.

    normal: (q, 3). direction, offset: per corner, the plane of the edge that begins there; across: the cell
    beyond it, or −1, where nothing binds. origin: (q, 3) points of the planes, the means of the corners
    unless given. Corners and edges stay in step with those of the cell. Returns the
    polygons, their mean points (q, 3) and how much of its size each has kept (q,): the root of the ratio of
    areas, 0 where no room was left.
    """
    flat = _Outlines.of(polygons, normal, direction, offset, across, origin)
    mitred, inner = _mitred(flat), across >= 0
    wedge, multiple = _wedges(mitred)
    best = _clipped(mitred, inner & ~multiple)
    strayed = _enters(best, wedge, multiple)
    if strayed.any():
        # What reaches into a wedge all the same is kept to one side of it: the first of its lines, or the
        # last.
        one, other = (
            _clipped(mitred, inner & ~multiple | multiple & (wedge != wedge[flat.after(step)]))
            for step in (-1, 1)
        )
        better = np.where((one.areas() >= other.areas())[flat.row, None], one.corner, other.corner)
        best = replace(best, corner=np.where(strayed[flat.row, None], better, best.corner))
    share = np.divide(best.areas(), flat.areas(), out=np.zeros(len(normal)), where=flat.areas() > 0)
    result = Ragged(best.in_space(), polygons.offsets)
    return result, means(result), np.sqrt(np.maximum(share, 0.0))


@dataclass(frozen=True)
class _Outlines:
    """Polygons in their own planes. corner: (h, 2), the plane of the edge that begins there being the line
    side · x = support, side (h, 2) of length 1; row, offsets: as in Ragged; across: as above. origin (q, 3)
    and axes (q, 2, 3) lead back to space."""

    corner: Floats
    side: Floats
    support: Floats
    across: Ints
    row: Ints
    offsets: Ints
    origin: Floats
    axes: Floats

    @classmethod
    def of(
        cls,
        polygons: Ragged,
        normal: Floats,
        direction: Floats,
        offset: Floats,
        across: Ints,
        origin: Floats | None,
    ) -> _Outlines:
        row, origin = polygons.row, means(polygons) if origin is None else origin
        axes = plane_axes(normal)
        corner = in_planes(polygons, origin, axes)
        side = np.einsum("hed,hd->he", axes[row], direction)
        length = np.maximum(np.linalg.norm(side, axis=1), ROUNDING)
        support = (offset - dot(direction, origin[row])) / length
        return cls(corner, side / length[:, None], support, across, row, polygons.offsets, origin, axes)

    @property
    def count(self) -> Ints:
        return np.diff(self.offsets)

    @property
    def next(self) -> Ints:
        """(h,) position of the following corner of the same polygon."""
        return np.asarray(self.after(1))

    def after(self, step: int) -> Ints:
        """(h,) position of the corner that many further on."""
        start = self.offsets[:-1][self.row]
        return np.asarray(start + (np.arange(len(self.row)) - start + step) % self.count[self.row])

    def areas(self) -> Floats:
        """(q,) signed."""
        a, b = self.corner, self.corner[self.next]
        return row_sums(cross_2d(a, b) / 2, self.offsets)

    def sizes(self) -> Floats:
        """(q,) greatest distance of a corner from the origin."""
        return row_maxima(np.linalg.norm(self.corner, axis=1), self.offsets)

    def in_space(self) -> Floats:
        """(h, 3) corners."""
        return np.asarray(self.origin[self.row] + np.einsum("he,hed->hd", self.corner, self.axes[self.row]))


def _mitred(flat: _Outlines) -> _Outlines:
    """Corners moved to where the lines of their two edges meet.

    Where these run nearly the same way, just behind both of them. The ends of edges that would turn round
    stay where they are.
    """
    before = flat.after(-1)
    u, v = flat.side[before], flat.side
    excess_u, excess_v = (
        flat.support[k] - dot(flat.side[k], flat.corner) for k in (before, np.arange(len(flat.row)))
    )
    sine = cross_2d(u, v)
    rim = (flat.across < 0) & (flat.across[before] < 0)
    sharp = (np.abs(sine) > SHALLOW) & ~rim
    meeting = (excess_v[:, None] * quarter_turn(u) - excess_u[:, None] * quarter_turn(v)) / np.where(
        sharp, sine, 1.0
    )[:, None]
    middle = u + v
    squared = dot(middle, middle)
    short = np.minimum(np.minimum(excess_u, excess_v), 0.0) / np.maximum(squared, 1.0)
    back = np.where((rim | (squared < 1))[:, None], 0.0, 2 * short[:, None] * middle)
    moved = flat.corner + np.where(sharp[:, None], meeting, back)
    turned = _turned_round(flat, moved)
    stays = turned | turned[before]
    moved = np.where(stays[:, None], flat.corner, moved)
    again = _any(_turned_round(flat, moved), flat.offsets)[flat.row]
    return replace(flat, corner=np.where(again[:, None], flat.corner, moved))


def _turned_round(flat: _Outlines, moved: Floats) -> Bools:
    """(h,) edges that would run the other way with their corners moved."""
    following = flat.next
    ahead = flat.corner[following] - flat.corner
    along = dot(moved[following] - moved, ahead)
    return np.asarray((along <= 0) & (dot(ahead, ahead) > 0))


def _wedges(flat: _Outlines) -> tuple[Ints, Bools]:
    """(h,) number, within its polygon, of the run of edges that an edge belongs to, and whether the run has
    several: edges to the same neighbour with a reflex corner between each and the next."""
    before = flat.after(-1)
    joins = (flat.across >= 0) & (flat.across == flat.across[before])
    joins &= cross_2d(flat.side[before], flat.side) < 0
    begun = np.cumsum(~joins)
    begun = begun - np.concatenate([[0], begun])[flat.offsets[:-1]][flat.row]
    runs = row_maxima(begun, flat.offsets)[flat.row]
    number = begun % np.maximum(runs, 1)  # a run goes on from the last corner to the first
    most = int(flat.count.max(initial=1))
    size = np.bincount(flat.row * most + number, minlength=most)
    return number, size[flat.row * most + number] > 1


def _clipped(flat: _Outlines, binding: Bools) -> _Outlines:
    """What of the outlines lies on their side of all binding lines, with as many corners (after Sutherland
    and Hodgman 1974).

    Corners beyond a line go to the piece of it that closes the gap, which stays in one piece as far as it is
    the line of an edge between two of them; one corner alone goes to the end of that piece where it cuts off
    less. Outlines wholly beyond a line come back without area.
    """
    corner = flat.corner.copy()
    slack, start, count = ROUNDING * flat.sizes(), flat.offsets[:-1], flat.count
    for step in range(int(count.max(initial=0))):
        line = (start + np.minimum(step, count - 1))[flat.row]
        height = dot(flat.side[line], corner) - flat.support[line]
        over = _any(binding[line] & (height > slack[flat.row]), flat.offsets)
        beyond = over[flat.row] & (height > -slack[flat.row])
        gone = ~_any(~beyond, flat.offsets)[flat.row]
        corner[gone] = 0.0
        beyond &= ~gone
        at = np.flatnonzero(beyond)
        if not len(at):
            continue
        first, last = (_inside_next(flat, beyond, at, way) for way in (-1, 1))
        a, b = (
            _crossing(corner, height, inside, flat.after(way)[inside])
            for inside, way in ((first[0], 1), (last[0], -1))
        )
        rank, run = first[1], first[1] + last[1] - 1
        lost_at_a = np.abs(cross_2d(b - a, corner[last[0]] - a))
        lost_at_b = np.abs(cross_2d(b - a, corner[first[0]] - a))
        even = np.where(run > 1, (rank - 1) / np.maximum(run - 1, 1), lost_at_a > lost_at_b)
        # The edge on the line takes nearly all of it, where both its ends are here.
        place = (line[at] - first[0]) % count[flat.row[at]]
        tight = CROWDED / np.maximum(run - 1, 1)
        crowded = np.where(rank <= place, tight * (rank - 1), 1 - tight * (run - rank))
        along = np.where((place > 0) & (place < run), crowded, even)
        corner[at] = a + along[:, None] * (b - a)
    return replace(flat, corner=corner)


def _inside_next(flat: _Outlines, beyond: Bools, at: Ints, way: int) -> tuple[Ints, Ints]:
    """From each of the corners ``at`` the next one that is not beyond, forwards (1) or backwards (−1), and
    how many steps away it is."""
    following = flat.after(way)
    found, steps = following[at], np.ones(len(at), dtype=np.int64)
    while (going := beyond[found]).any():
        found, steps = np.where(going, following[found], found), steps + going
    return found, steps


def _crossing(corner: Floats, height: Floats, inside: Ints, outside: Ints) -> Floats:
    """(k, 2) where the edges between corners below and above a line cross it."""
    part = height[inside] / (height[inside] - height[outside])
    return np.asarray(corner[inside] + part[:, None] * (corner[outside] - corner[inside]))


def _enters(flat: _Outlines, wedge: Ints, multiple: Bools) -> Bools:
    """(q,) whether an edge of the outline passes through one of its wedges: the points beyond all lines of a
    run."""
    entered = np.zeros(len(flat.count), dtype=bool)
    following, steps = flat.next, range(int(flat.count.max(initial=0)))
    slack = ROUNDING * flat.sizes()[flat.row]
    for number in np.unique(wedge[multiple]):
        chosen = multiple & (wedge == number)
        concerned = _any(chosen, flat.offsets)[flat.row]
        low, high = np.zeros(len(flat.row)), np.where(concerned, 1.0, -1.0)
        for step in steps:
            line = flat.after(step)
            side, support = flat.side[line], flat.support[line]
            start, end = (dot(side, flat.corner[k]) - support for k in (slice(None), following))
            crossing = np.divide(slack - start, end - start, out=np.zeros(len(slack)), where=start != end)
            outside, leaves, comes = (
                (start <= slack) & (end <= slack),
                (start > slack) & (end <= slack),
                (start <= slack) & (end > slack),
            )
            used = chosen[line]
            high = np.where(used & outside, -1.0, np.where(used & leaves, np.minimum(high, crossing), high))
            low = np.where(used & comes, np.maximum(low, crossing), low)
        entered |= _any(high > low, flat.offsets)
    return entered


def _any(values: Bools, offsets: Ints) -> Bools:
    """(q,) whether any value of each row is true; no row may be empty."""
    return np.asarray(np.logical_or.reduceat(values, offsets[:-1])) if len(offsets) > 1 else values[:0]
