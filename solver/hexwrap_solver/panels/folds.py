"""Panels along folds: flat halves, or both halves of a cell as one panel that is bent.

Pieces of one shape in the lattice are a kind of panels with sizes of its own, as the whole cells are: copies
of one outline. Bent panels have the pattern's own cell as their blank, with the fold, the hinge, on one of
its lines:

         b ___________ a        one half turns n₁ to the viewer, the other n₂; both planes contain the hinge
          /     n₁    \\         from b to a, along which the panel may slide (t) while its edge ℓ grows:
         b ─ ─ hinge ─ a              max ℓ   subject to   s_k·(c + t·x) + ℓ h_k ≤ o_k,
          \\     n₂    /         with s_k, o_k the separating planes and h_k the reach of the half that has
           \\_________/          edge k.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, Ragged, runs
from hexwrap_solver.geometry import dot, normalize
from hexwrap_solver.panels.limits import inscribed
from hexwrap_solver.panels.polygons import area_vectors, means
from hexwrap_solver.panels.regular import Poses, bending, copies
from hexwrap_solver.panels.separation import Separation
from hexwrap_solver.panels.tangents import surface_normals
from hexwrap_solver.panels.types import Bends, Panels, PanelSettings
from hexwrap_solver.pattern.halfedges import HalfEdges
from hexwrap_solver.pattern.types import FoldPieces, Pattern
from hexwrap_solver.surface.types import Surface

#: Places in the lattice are the same where they agree to this many parts of an edge.
PARTS = 1e5
#: Planes along the hinge, whose distance a shift does not change.
LEVEL = 1e-9
#: A shape that fewer pieces have is not a kind: they are made as large as their cells allow, each by itself.
FEWEST = 2


@dataclass(frozen=True)
class Halves:
    """Flat pieces of one shape. face: (k,) cells. at: (k, p) their half-edges. outline: (p,) complex."""

    face: Ints
    at: Ints
    poses: Poses
    outline: Complexes

    @property
    def spokes(self) -> Ragged:
        return Ragged.from_table(self.poses.spokes(self.at.shape[1]))

    @property
    def bends(self) -> int:
        """Corners that are not straight."""
        return bending(self.outline)

    def inscribed(self, planes: Separation) -> tuple[Floats, Floats]:
        return inscribed(self.poses, planes.direction[self.at], planes.offset[self.at])


@dataclass(frozen=True)
class Bent:
    """Pairs of mates whose blanks have one shape. face, other: (k,) the cells. at: (k, p) half-edges that
    bound both, from the hinge's end b on. first: corners of the half in ``face``, the hinge's ends included.
    center: (k, 3) middle of the hinge; x: (k, 3) along it, from a to b. one, two: (k, 3) normals of the
    halves. outline: (p,) complex, of the blank."""

    face: Ints
    other: Ints
    at: Ints
    first: int
    center: Floats
    x: Floats
    one: Floats
    two: Floats
    outline: Complexes

    @property
    def _spokes(self) -> Floats:
        """(k, p, 3)"""
        along, out = self.outline.real, self.outline.imag
        up, down = np.cross(self.one, self.x), np.cross(self.x, self.two)
        y = np.where((np.arange(len(out)) < self.first)[:, None], up[:, None], down[:, None])
        return np.asarray(along[:, None] * self.x[:, None] + abs(out)[:, None] * y)

    @property
    def spokes(self) -> Ragged:
        return Ragged.from_table(self._spokes)

    @property
    def bends(self) -> int:
        """Corners of the blank that are not straight."""
        return bending(self.outline)

    def inscribed(self, planes: Separation) -> tuple[Floats, Floats]:
        """Greatest lengths (k,) and the middles of their hinges (k, 3)."""
        direction, offset = planes.direction[self.at], planes.offset[self.at]
        corner = np.arange(self.at.shape[1])
        # A corner is of the first half up to the hinge's end a, of the second from there on to b again.
        halves = corner < self.first, (corner >= self.first - 1) | (corner == 0)
        upper = corner < self.first - 1
        reached = np.einsum("kjd,kmd->kjm", direction, self._spokes)
        h = np.where(upper, *(np.where(own, reached, -np.inf).max(axis=2) for own in halves))
        slope = dot(direction, self.x[:, None])
        room = offset - dot(direction, self.center[:, None])
        length = _greatest(slope, h, room)
        left = room - length[:, None] * h
        with np.errstate(divide="ignore", invalid="ignore"):
            high = np.where(slope > LEVEL, left / slope, np.inf).min(axis=1)
            low = np.where(slope < -LEVEL, left / slope, -np.inf).max(axis=1)
        t = np.where(np.isfinite(low) & np.isfinite(high), (low + high) / 2, 0.0)
        center = self.center + t[:, None] * self.x
        # Taken from the place found, so that rounding breaks nothing.
        return ((offset - dot(direction, center[:, None])) / h).min(axis=1), center


def _greatest(slope: Floats, h: Floats, room: Floats) -> Floats:
    """(k,) greatest ℓ with slope·t + ℓ h ≤ room for some t: the least that any two planes leave, one on
    either way."""
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.where(abs(slope) <= LEVEL, room / h, np.inf).min(axis=1)
        p, q = slope[:, :, None], -slope[:, None, :]
        pair = (room[:, :, None] * q + room[:, None, :] * p) / (h[:, :, None] * q + h[:, None, :] * p)
    facing = (p > LEVEL) & (q > LEVEL)
    return np.asarray(np.minimum(least, np.where(facing, pair, np.inf).min(axis=(1, 2))))


def halves_of(surface: Surface, pattern: Pattern, pieces: FoldPieces, tangent: bool) -> list[Halves]:
    """Pieces by shape, the most frequent first. tangent: in the surface's tangent planes."""
    groups = []
    for rows in _frequent(_shapes(pieces.outline)):
        outline = _places(pieces.outline, int(rows[0]))
        face, p = pieces.cell[rows], len(outline)
        at = pattern.faces.offsets[face][:, None] + np.arange(p)
        points = np.asarray(pattern.cells.values[at], dtype=np.float64)
        about = outline - outline.mean()
        turn = (np.arange(p) - pieces.side[rows][:, None]) % p  # from the cell's first corner on
        own = np.stack([about.real, about.imag], axis=-1)[turn]
        normal = surface_normals(surface, points.mean(axis=1)) if tangent else None
        groups.append(Halves(face, at, copies(points, own, normal), outline))
    return groups


def bent_of(pattern: Pattern, pieces: FoldPieces, normal: Floats) -> list[Bent]:
    """Pairs of mates by the shape of their blanks, the most frequent first; normal: (c, 3) of the cells."""
    one = np.flatnonzero(pieces.mate > np.arange(len(pieces.mate)))
    pairs = np.stack([one, pieces.mate[one]], axis=1)
    shape = _shapes(pieces.outline)[pairs]
    pairs = np.where((shape[:, :1] > shape[:, 1:]), pairs[:, ::-1], pairs)
    _, blank = np.unique(np.sort(shape, axis=1), axis=0, return_inverse=True)
    return [_bent(pattern, pieces, pairs[rows], normal) for rows in _frequent(blank.ravel())]


def _bent(pattern: Pattern, pieces: FoldPieces, mates: Ints, normal: Floats) -> Bent:
    m, n = pieces.outline.lengths[mates[0]].tolist()
    cell, side = pieces.cell[mates], pieces.side[mates]
    start = pattern.faces.offsets[cell]
    # From b on: the first half but for its side along the fold, then the second one.
    at = np.concatenate(
        [
            start[:, :1] + (side[:, :1] + 1 + np.arange(m - 1)) % m,
            start[:, 1:] + (side[:, 1:] + 1 + np.arange(n - 1)) % n,
        ],
        axis=1,
    )
    a, b = _ends(pattern, cell[:, 0], side[:, 0])
    x = normalize(b - a)
    one, two = (_upright(normal[cell[:, k]], x) for k in range(2))
    outline = _blank(pieces.outline, mates[0])
    return Bent(cell[:, 0], cell[:, 1], at, m, (a + b) / 2, x, one, two, outline)


def _upright(normal: Floats, x: Floats) -> Floats:
    """Normals made perpendicular to the hinges, so that both planes contain them."""
    return normalize(normal - dot(normal, x)[:, None] * x)


def _blank(outline: Ragged, mates: Ints) -> Complexes:
    """(p,) the outline of two mates together, from b on, unfolded; seen from the first one."""
    one, two = (_places(outline, int(k)) for k in mates)
    return np.concatenate([one[1:], one[:1], -two[2:]])


def _places(outline: Ragged, row: int) -> Complexes:
    """(p,) corners."""
    corner = np.asarray(outline[row], dtype=np.float64)
    return np.asarray(corner[:, 0] + 1j * corner[:, 1])


def _shapes(outline: Ragged) -> Ints:
    """(k,) numbers, the same for equal outlines."""
    number, used = np.zeros(outline.n_rows, dtype=np.int64), 0
    for count in np.unique(outline.lengths):
        rows = np.flatnonzero(outline.lengths == count)
        place = outline.take(rows).values.reshape(len(rows), -1)
        key = np.rint(place * PARTS).astype(np.int64)
        _, own = np.unique(key, axis=0, return_inverse=True)
        number[rows] = used + own.ravel()
        used = int(number.max()) + 1
    return number


def _frequent(number: Ints) -> list[Ints]:
    """The rows of each number that enough of them have, the most frequent first."""
    order = np.argsort(number, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(number[order])) + 1) if len(order) else []
    return sorted(
        (rows for rows in parts if len(rows) >= FEWEST), key=lambda rows: (-len(rows), int(rows[0]))
    )


@dataclass(frozen=True)
class AlongFolds:
    """What is made of the pieces along folds. kinds: those of one shape. normal: (c, 3) of all cells; origin:
    (c, 3) points of their planes. taken: (c,) second halves of bent panels among the kinds. divided: (c,) all
    pieces. closed: (c,) the corner at which the side begins that becomes a hinge, −1: none."""

    pieces: FoldPieces | None
    kinds: list[Halves | Bent]
    normal: Floats
    origin: Floats
    taken: Bools
    divided: Bools
    closed: Ints

    @classmethod
    def of(cls, surface: Surface, pattern: Pattern, normal: Floats, settings: PanelSettings) -> AlongFolds:
        """normal: (c, 3) of the cells' mean planes."""
        pieces, n = pattern.pieces, pattern.n_cells
        origin, normal = means(pattern.cells), normal.copy()
        taken, divided, closed = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool), np.full(n, -1)
        if pieces is None or not len(pieces.cell):
            return cls(None, [], normal, origin, taken, divided, closed)
        divided[pieces.cell] = True
        if settings.fold == "halves":
            halves = halves_of(surface, pattern, pieces, settings.orientation == "tangent")
            for half in halves:
                normal[half.face] = half.poses.normal
            return cls(pieces, [*halves], normal, origin, taken, divided, closed)
        mated = pieces.mate >= 0
        cell, side = pieces.cell[mated], pieces.side[mated]
        a, b = _ends(pattern, cell, side)
        normal[cell] = _upright(normal[cell], normalize(b - a))
        origin[cell], closed[cell] = (a + b) / 2, side
        bent = bent_of(pattern, pieces, normal)
        for group in bent:
            taken[group.other] = True
        # What has no mate is as among halves.
        alone = replace_pieces(pieces, ~mated)
        rest = halves_of(surface, pattern, alone, settings.orientation == "tangent")
        for half in rest:
            normal[half.face] = half.poses.normal
        return cls(pieces, [*bent, *rest], normal, origin, taken, divided, closed)

    def joints(self, edges: HalfEdges, joint: float) -> Floats:
        """(h,) widths to be left open, none at hinges."""
        hinge = np.zeros(len(edges.cell), dtype=bool)
        cell = np.flatnonzero(self.closed >= 0)
        first = np.searchsorted(edges.cell, cell)
        hinge[first + self.closed[cell]] = True
        return np.where(hinge, 0.0, joint)

    def joined(self, pattern: Pattern, shapes: Ragged, center: Floats, face: Ints) -> Singles:
        """Polygons of no kind, (k,) of the cells in ``face``; mates as one where panels are folded."""
        if self.pieces is None or not (self.closed >= 0).any():
            none = np.full(len(face), -1)
            return Singles(shapes, center, face, none, none, np.stack([none, none], axis=1))
        return bent_singles(pattern, self.pieces, shapes, center, face)

    def bends(self, made: Ints, kept: Bools, single: Singles) -> Bends | None:
        """made: cells that have panels of their own, ascending; kept: (c,) those that are kinds."""
        groups = [group for group in self.kinds if isinstance(group, Bent)]
        if self.pieces is None or not (self.closed >= 0).any():
            return None
        lone = single.other >= 0
        face = np.concatenate([*(g.face for g in groups), single.face[lone]])
        other = np.concatenate([*(g.other for g in groups), single.other[lone]])
        hinge = np.concatenate([*(np.full(len(g.face), g.first - 1) for g in groups), single.hinge[lone]])
        side = np.concatenate(
            [
                *(np.stack([self.closed[g.face], self.closed[g.other]], axis=1) for g in groups),
                single.side[lone],
            ]
        )
        there = kept[face] | np.isin(face, single.face[lone])
        order = np.argsort(face[there], kind="stable")
        face, other, hinge, side = (table[there][order] for table in (face, other, hinge, side))
        return Bends(np.searchsorted(made, face), other, hinge, side)


def places_of(pattern: Pattern, made: Ints, bends: Bends | None) -> tuple[Ints, Ints]:
    """(c,) the panel of each cell, −1: none; and (h,) the corner of that at which each half-edge's own edge
    begins, −1 along hinges."""
    row = pattern.faces.row
    corner = pattern.faces.within
    panel = np.full(pattern.n_cells, -1, dtype=np.int64)
    panel[made] = np.arange(len(made))
    if bends is not None:
        panel[bends.other] = bends.panel
        for cell, side, begin in (
            (made[bends.panel], bends.side[:, 0], np.zeros_like(bends.hinge)),
            (bends.other, bends.side[:, 1], bends.hinge),
        ):
            first = np.full(pattern.n_cells, -1)
            first[cell] = np.arange(len(cell))
            at = np.flatnonzero(first[row] >= 0)
            which, count = first[row[at]], pattern.faces.lengths[row[at]]
            within = (corner[at] - side[which] - 1) % count
            corner[at] = np.where(within < count - 1, begin[which] + within, -1)
    return panel, corner


def _ends(pattern: Pattern, cell: Ints, side: Ints) -> tuple[Floats, Floats]:
    """(k, 3) where the given sides of cells begin and end."""
    start, count = pattern.faces.offsets[cell], pattern.faces.lengths[cell]
    begin, end = (pattern.faces.values[start + (side + step) % count].astype(np.int64) for step in (0, 1))
    return pattern.vertices[begin], pattern.vertices[end]


def replace_pieces(pieces: FoldPieces, keep: Bools) -> FoldPieces:
    """Some of them, which have no mates."""
    none = np.full(int(keep.sum()), -1)
    return FoldPieces(pieces.cell[keep], pieces.side[keep], none, pieces.outline.take(keep))


@dataclass(frozen=True)
class Singles:
    """Finished polygons that belong to no kind. shapes, center: rows (k,) of the cells in ``face``,
    ascending. other, hinge, side: (k,), (k,), (k, 2) as in ``Bends``; other −1 where the panel is flat."""

    shapes: Ragged
    center: Floats
    face: Ints
    other: Ints
    hinge: Ints
    side: Ints


def bent_singles(pattern: Pattern, pieces: FoldPieces, shapes: Ragged, center: Floats, face: Ints) -> Singles:
    """Flat pieces, rows of cells (k,), in planes that contain their hinges: mates made one panel.

    Each end of a hinge is where both halves still reach.
    """
    k = len(face)
    row = np.full(pattern.n_cells, -1, dtype=np.int64)
    row[face] = np.arange(k)
    first = np.flatnonzero(pieces.mate > np.arange(len(pieces.mate)))
    cell, side = (
        table[np.stack([first, pieces.mate[first]], axis=1)] for table in (pieces.cell, pieces.side)
    )
    there = (row[cell] >= 0).all(axis=1)
    cell, side = cell[there], side[there]
    of, count = row[cell], shapes.lengths[row[cell]]
    points = np.asarray(shapes.values, dtype=np.float64)
    start = shapes.offsets[of]
    a, b = _ends(pattern, cell[:, 0], side[:, 0])
    middle, x = (a + b) / 2, normalize(b - a)
    begin, end = (points[start + (side + step) % count] - middle[:, None] for step in (0, 1))
    reach_a = np.maximum(dot(begin[:, 0], x), dot(end[:, 1], x))
    reach_b = np.minimum(dot(end[:, 0], x), dot(begin[:, 1], x))
    room = reach_b > reach_a
    cell, side, of, count, start = (table[room] for table in (cell, side, of, count, start))
    total = count.sum(axis=1) - 2
    pair, within = runs(total)
    m = count[pair, 0]
    one = start[pair, 0] + (side[pair, 0] + 1 + within) % m
    two = start[pair, 1] + (side[pair, 1] + 2 + within - m) % count[pair, 1]
    joined = Ragged.of(points[np.where(within < m, one, two)], total)
    first_corner = joined.offsets[:-1]
    joined.values[first_corner] = (middle + reach_b[:, None] * x)[room]
    joined.values[first_corner + count[:, 0] - 1] = (middle + reach_a[:, None] * x)[room]
    alone = np.ones(k, dtype=bool)
    alone[of] = False
    faces = np.concatenate([face[alone], cell[:, 0]])
    order = np.argsort(faces, kind="stable")
    none = np.full(int(alone.sum()), -1)
    return Singles(
        Ragged.chained([shapes.take(alone), joined]).take(order),
        np.concatenate([center[alone], means(joined)])[order],
        faces[order],
        np.concatenate([none, cell[:, 1]])[order],
        np.concatenate([none, count[:, 0] - 1])[order],
        np.concatenate([np.stack([none, none], axis=1), side])[order],
    )


def parts_of(panels: Panels) -> tuple[Ragged, Ints, Floats]:
    """Flat parts of all panels, those of bent ones two; the panel of each, (k,), and their normals (k, 3)."""
    parts, _, owner, normal = flat_parts(panels.polygons, panels)
    return parts, owner, normal


def flat_parts(polygons: Ragged, panels: Panels) -> tuple[Ragged, Ints, Ints, Floats]:
    """The same of outlines in step with the panels' own; also which of all their corners each one is."""
    bends = panels.bends
    if bends is None or not len(bends.panel):
        return polygons, np.arange(len(polygons.values)), np.arange(panels.n_panels), panels.normal
    count = np.repeat(polygons.lengths, 2)
    begin = np.zeros_like(count)
    count[1::2] = 0
    count[2 * bends.panel], count[2 * bends.panel + 1] = (
        bends.hinge + 1,
        polygons.lengths[bends.panel] - bends.hinge + 1,
    )
    begin[2 * bends.panel + 1] = bends.hinge
    owner = np.repeat(np.arange(panels.n_panels), 2)
    owner, begin, count = owner[count > 0], begin[count > 0], count[count > 0]
    row, within = runs(count)
    at = polygons.offsets[owner][row] + (begin[row] + within) % polygons.lengths[owner][row]
    parts = Ragged.of(polygons.values[at], count)
    bent = np.isin(owner, bends.panel)
    normal = panels.normal[owner]
    vector = area_vectors(parts)
    normal[bent] = normalize(vector[bent])
    return parts, at, owner, normal


def parts_by_cell(panels: Panels) -> tuple[Panels, Ints]:
    """The flat parts as panels of their own, corners in step with those of their cells, and the panel of
    each."""
    bends = panels.bends
    parts, owner, normal = parts_of(panels)
    if bends is None or len(owner) == panels.n_panels:
        return panels, owner
    first = np.searchsorted(owner, bends.panel)
    face, turn = panels.face[owner], np.zeros(len(owner), dtype=np.int64)
    face[first + 1] = bends.other
    turn[first], turn[first + 1] = bends.side[:, 0] + 1, bends.side[:, 1] + 1
    row = parts.row
    at = parts.offsets[row] + (parts.within - turn[row]) % parts.lengths[row]
    polygons = Ragged(parts.values[at], parts.offsets)
    center = panels.center[owner]
    bent = np.isin(owner, bends.panel)
    center[bent] = means(polygons)[bent]
    whole, edge = panels.whole[owner], panels.edge_length[owner]
    return replace(
        panels,
        polygons=polygons,
        face=face,
        normal=normal,
        center=center,
        whole=whole,
        edge_length=edge,
        bends=None,
    ), owner


def hinges_of(panels: Panels) -> Ints:
    """(q,) the corner at the far end of each panel's hinge, −1 where it is flat."""
    hinge = np.full(panels.n_panels, -1)
    if panels.bends is not None:
        hinge[panels.bends.panel] = panels.bends.hinge
    return hinge


def halves_of_ring(ring: list[int], hinge: int) -> list[list[int]]:
    """The corners of a panel, part by part."""
    return [ring] if hinge < 0 else [ring[: hinge + 1], [*ring[hinge:], ring[0]]]


def bend_angles(panels: Panels) -> Floats:
    """(q,) angle between the normals of both halves, radians, negative where the outside is hollow; 0 where a
    panel is not bent."""
    angle = np.zeros(panels.n_panels)
    bends = panels.bends
    if bends is None or not len(bends.panel):
        return angle
    _, owner, normal = parts_of(panels)
    first = np.searchsorted(owner, bends.panel)
    points = np.asarray(panels.polygons.values, dtype=np.float64)
    start = panels.polygons.offsets[bends.panel]
    x = normalize(points[start] - points[start + bends.hinge])
    one, two = normal[first], normal[first + 1]
    angle[bends.panel] = np.arctan2(dot(np.cross(one, two), x), dot(one, two))
    return angle


def blanks(panels: Panels) -> tuple[Ragged, Floats]:
    """Outlines laid flat in their first part's plane, seen from outside: (·, 3) points, and the normals of
    those planes (q, 3). Bent panels are unfolded about their hinges."""
    bends, polygons = panels.bends, panels.polygons
    if bends is None or not len(bends.panel):
        return polygons, panels.normal
    _, owner, part_normal = parts_of(panels)
    first = np.searchsorted(owner, np.arange(panels.n_panels))
    normal = part_normal[first]
    points = np.array(polygons.values, dtype=np.float64)
    row, within = polygons.row, polygons.within
    hinge = np.full(panels.n_panels, np.iinfo(np.int64).max)
    hinge[bends.panel] = bends.hinge
    moved = np.flatnonzero(within > hinge[row])
    q = row[moved]
    b, a = points[polygons.offsets[q]], points[polygons.offsets[q] + hinge[q]]
    x = normalize(b - a)
    arm = points[moved] - a
    along = dot(arm, x)
    away = np.linalg.norm(arm - along[:, None] * x, axis=1)
    points[moved] = a + along[:, None] * x - away[:, None] * np.cross(normal[q], x)
    return Ragged(points, polygons.offsets), normal
