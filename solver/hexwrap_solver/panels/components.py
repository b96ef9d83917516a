"""What each panel is built from (paper, Figure 9): inset outline, plane with axes, closed solid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.errors import PanelsError
from hexwrap_solver.geometry import cross_2d, dot, normalize, plane_axes
from hexwrap_solver.panels.folds import flat_parts, halves_of_ring, hinges_of
from hexwrap_solver.panels.planar import in_planes, outlines
from hexwrap_solver.panels.polygons import (
    area_vectors,
    edge_vectors,
    interior_angles,
    means,
    row_maxima,
    row_minima,
)
from hexwrap_solver.panels.types import Components, ComponentSettings, Panels
from hexwrap_solver.tolerances import RELATIVE

#: Interior angles above this are reflex; a straight corner's is π to rounding.
REFLEX = np.pi + 1e-6

#: Halvings of the inset to find what room a panel too narrow for it has.
HALVINGS = 20


def make_components(panels: Panels, settings: ComponentSettings) -> Components:
    """One component per panel. Raises PanelsError where the inset leaves nothing of a whole panel.

    Trimmed panels too thin for the inset get half of what they have room for.
    """
    outline = _inset(panels, settings.inset) if settings.inset > 0 else panels.polygons
    z_axis, parts = panels.normal, Parts.of(panels, outline)
    first = edge_vectors(panels.polygons)[panels.polygons.offsets[:-1]]
    x_axis = normalize(first - dot(first, z_axis)[:, None] * z_axis)
    solid = _solids(outline, parts, settings.thickness) if settings.thickness > 0 else (None, None)
    return Components(outline, panels.center, x_axis, np.cross(z_axis, x_axis), z_axis, *solid)


def _inset(panels: Panels, inset: float) -> Ragged:
    """Outlines moved inwards by the same width on every edge (mitred corners)."""
    if panels.bends is not None and len(panels.bends.panel):
        return _inset_parts(panels, inset)
    polygons = panels.polygons
    row, points = polygons.row, np.asarray(polygons.values, dtype=np.float64)
    inward = normalize(np.cross(panels.normal[row], edge_vectors(polygons)))
    before = np.zeros_like(inward)
    before[polygons.next()] = inward
    room = row_minima(dot(panels.center[row] - points, inward), polygons.offsets)
    concave = np.flatnonzero(row_maxima(interior_angles(polygons, panels.normal), polygons.offsets) > REFLEX)
    flat = _in_plane(panels, concave)
    room[concave] = _room(flat, inset)  # the centre may lie behind edges
    thin = room <= inset
    _require_room(panels, thin, inset, room)
    width = np.where(thin, np.maximum(room, 0.0) / 2, inset)
    # The mitred corner lies at distance ``width`` from both edges' lines: the bisector, scaled.
    bend = 1 + dot(before, inward)[:, None]
    moved = points + width[row, None] * (before + inward) / np.maximum(bend, RELATIVE)
    folded = row_minima(dot(moved[polygons.next()] - moved, edge_vectors(polygons)), polygons.offsets)
    # Where a short edge would turn round, the outline shrinks about the centre instead.
    factor = 1 - (width / np.where(room > 0, room, np.inf))[row, None]
    center = panels.center[row]
    shrunk = center + factor * (points - center)
    outline = Ragged(np.where((folded > 0)[row, None], moved, shrunk), polygons.offsets)
    return _with_rows(outline, concave, _offset(panels, concave, flat, width[concave]))


def _inset_parts(panels: Panels, inset: float) -> Ragged:
    """Of panels some of which are bent: the flat ones as ever; of the others each half, but not at the hinge,
    whose ends are where both halves still reach."""
    hinge = hinges_of(panels)
    flat = np.flatnonzero(hinge < 0)
    plain = _inset(panels.part(flat), inset)
    rows: list[Floats] = [np.zeros((0, 3))] * panels.n_panels
    for i, row in enumerate(flat.tolist()):
        rows[row] = np.asarray(plain[i])
    for row in np.flatnonzero(hinge >= 0).tolist():
        rows[row] = _inset_bent(np.asarray(panels.polygons[row], dtype=np.float64), int(hinge[row]), inset)
    return Ragged.of(np.concatenate(rows), np.array([len(one) for one in rows]))


def _inset_bent(corner: Floats, hinge: int, inset: float) -> Floats:
    """(p, 3) a bent outline moved inwards; half as large about the middle of its hinge where it has no room
    for that."""
    a, b = corner[hinge], corner[0]
    x = normalize((b - a)[None])[0]
    middle, moved, ends = (a + b) / 2, corner.copy(), []
    for part in halves_of_ring(list(range(len(corner))), hinge):
        points = corner[part]
        count = len(points)
        normal = normalize(area_vectors(Ragged(points, np.array([0, count]))))[0]
        edge = normalize(np.roll(points, -1, axis=0) - points)
        inward = np.cross(normal, edge)
        width = np.full(count, inset)
        width[-1] = 0.0  # the hinge, from the last corner to the first
        u, v, wu, wv = np.roll(inward, 1, axis=0), inward, np.roll(width, 1), width
        cosine = dot(u, v)
        sine = np.maximum(1 - cosine**2, 1e-12)
        even = wu == wv  # edges in line move as one
        one = np.where(even, wu / (1 + cosine), (wu - cosine * wv) / sine)
        two = np.where(even, wv / (1 + cosine), (wv - cosine * wu) / sine)
        shifted = points + one[:, None] * u + two[:, None] * v
        along = dot(np.roll(shifted, -1, axis=0) - shifted, edge)
        if (along <= 0).any():
            return np.asarray(middle + (corner - middle) / 2)
        moved[part] = shifted
        ends.append(sorted(((shifted[[0, -1]] - middle) @ x).tolist()))
    moved[0], moved[hinge] = (middle + t * x for t in (min(e[1] for e in ends), max(e[0] for e in ends)))
    return moved


@dataclass(frozen=True)
class Parts:
    """Flat parts of outlines. outline: rows of them, corner: (·,) of all outlines that each of their corners
    is; row: (parts,) outline; normal: (parts, 3). offset: (·, 3) of all corners of the outlines, to what is
    1 above all planes that meet there."""

    outline: Ragged
    corner: Ints
    row: Ints
    normal: Floats
    offset: Floats

    @classmethod
    def of(cls, panels: Panels, outline: Ragged) -> Parts:
        parts, corner, row, normal = flat_parts(outline, panels)
        total = np.zeros_like(outline.values, dtype=np.float64)
        np.add.at(total, corner, normal[parts.row])
        count = np.bincount(corner, minlength=len(total))[:, None]
        # The mitre: n for one plane, (n₁ + n₂) / (1 + n₁·n₂) for two.
        return cls(parts, corner, row, normal, total * count / dot(total, total)[:, None])


def _in_plane(panels: Panels, which: Ints) -> shapely.Geometry:
    """(k,) the given panels as polygons in their own planes, about their centres, without self-crossings."""
    some = panels.polygons.take(which)
    corner = in_planes(some, panels.center[which], plane_axes(panels.normal[which]))
    return shapely.make_valid(outlines(corner, some.row)) if len(which) else np.zeros(0, dtype=object)


def _room(flat: shapely.Geometry, inset: float) -> Floats:
    """(k,) how far the outlines can be moved inwards until nothing is left; ∞ where more than ``inset``."""
    room = np.where(shapely.is_empty(_moved(flat, inset)), 0.0, np.inf)
    few = np.flatnonzero(room == 0)
    low, high = np.zeros(len(few)), np.full(len(few), inset)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        nothing = shapely.is_empty(_moved(flat[few], middle))
        low, high = np.where(nothing, low, middle), np.where(nothing, middle, high)
    room[few] = low
    return room


def _moved(flat: shapely.Geometry, width: Floats | float) -> shapely.Geometry:
    return shapely.buffer(flat, -width, join_style="mitre")


def _offset(panels: Panels, which: Ints, flat: shapely.Geometry, width: Floats) -> list[Floats]:
    """Corners in space of the outlines moved inwards; of those that fall apart the largest piece."""
    rows = []
    axes = plane_axes(panels.normal[which])
    for i, shape, plane in zip(which, _moved(flat, width), axes, strict=True):
        piece = max(shapely.get_parts(shape), key=shapely.area)
        ring = shapely.get_exterior_ring(piece)
        corners = shapely.get_coordinates(ring)[:-1]
        corners = corners if shapely.is_ccw(ring) else corners[::-1]
        rows.append(panels.center[i] + corners @ plane)
    return rows


def _with_rows(table: Ragged, rows: Ints, found: list[Floats]) -> Ragged:
    """The table with some of its rows replaced."""
    if not len(rows):
        return table
    every = [table[i] for i in range(table.n_rows)]
    for i, row in zip(rows, found, strict=True):
        every[i] = row
    return Ragged.of(np.concatenate(every).astype(np.float64), np.array([len(row) for row in every]))


def _require_room(panels: Panels, thin: np.ndarray, inset: float, room: Floats) -> None:
    empty = np.flatnonzero(thin & panels.whole)
    if len(empty):
        raise PanelsError(
            f"An inset of {inset:g} leaves nothing of {len(empty)} panels (the smallest has room for"
            f" {room[empty].min():g}); ask for a smaller inset.",
            field=("components", "inset"),
            data={"panels": empty[:100].tolist()},
        )


def _solids(outline: Ragged, parts: Parts, thickness: float) -> tuple[Ragged, Ragged]:
    """Prisms from the outline outwards: n lower corners, then n upper ones; 4n − 4 triangles each."""
    count, offsets = outline.lengths, outline.offsets
    local = outline.within
    n = np.repeat(count, count)
    at = local + 2 * np.repeat(offsets[:-1], count)
    vertices = np.zeros((2 * len(outline.values), 3))
    vertices[at] = outline.values
    vertices[at + n] = outline.values + thickness * parts.offset
    following = np.where(local + 1 < n, local + 1, 0)
    sides = np.stack([local, following, following + n, local, following + n, local + n], axis=1).reshape(
        -1, 2, 3
    )
    row, inner = outline.row, np.repeat(parts.row, parts.outline.lengths - 2)
    first = np.repeat(parts.outline.offsets[:-1], parts.outline.lengths - 2)
    corners = triangulated(parts.outline, parts.normal)
    corners = parts.corner[first[:, None] + corners] - offsets[inner][:, None]
    lower, upper = corners[:, ::-1], corners + count[inner][:, None]
    owner = np.concatenate([np.repeat(row, 2), inner, inner])
    triangles = np.concatenate([sides.reshape(-1, 3), lower, upper])
    order = np.argsort(owner, kind="stable")
    return Ragged(vertices, 2 * offsets), Ragged.of(triangles[order].ravel(), 3 * (4 * count - 4))


def triangulated(outline: Ragged, normal: Floats) -> Ints:
    """(·, 3) each outline cut into n − 2 triangles, row by row, by numbers of its corners.

    Fans from the corner with the greatest interior angle; outlines with several reflex corners, which no fan
    may fill, by clipping ears (Meisters 1975).
    """
    row, local = outline.row, outline.within
    following = np.where(local + 1 < outline.lengths[row], local + 1, 0)
    apex = _fan_corner(outline, normal)[row]
    inner = (local != apex) & (following != apex)
    triangles = np.stack([apex, local, following], axis=1)[inner]
    corner = in_planes(outline, means(outline), plane_axes(normal))
    a, b, c = np.moveaxis(corner[outline.offsets[:-1][row[inner]][:, None] + triangles], 1, 0)
    for i in np.unique(row[inner][cross_2d(b - a, c - a) < 0]):
        triangles[row[inner] == i] = _ears(corner[outline.offsets[i] : outline.offsets[i + 1]])
    return np.asarray(triangles)


def _ears(corner: Floats) -> Ints:
    """(n − 2, 3) a polygon's corners (n, 2) cut into triangles, counter-clockwise."""
    left, triangles = np.arange(len(corner)), []
    while len(left) > 2:
        a, b, c = corner[np.roll(left, 1)], corner[left], corner[np.roll(left, -1)]
        bulge = cross_2d(b - a, c - a)
        covered = np.ones((len(left), len(left)), dtype=bool)
        for p, q in ((a, b), (b, c), (c, a)):
            covered &= cross_2d((q - p)[:, None], corner[left] - p[:, None]) >= 0
        own = np.eye(len(left), dtype=bool)
        covered &= ~(own | np.roll(own, 1, axis=1) | np.roll(own, -1, axis=1))
        # Where rounding leaves no ear, the corner that bulges most.
        k = int(np.argmax(np.where(covered.any(axis=1) | (bulge <= 0), -np.inf, bulge)))
        triangles.append([left[k - 1], left[k], left[(k + 1) % len(left)]])
        left = np.delete(left, k)
    return np.array(triangles)


def _fan_corner(outline: Ragged, normal: Floats) -> Ints:
    """(q,) corner from which the polygon is cut into triangles: the one with the greatest interior angle,
    so that polygons with one reflex corner are cut rightly, too."""
    angle = interior_angles(outline, normal)
    order = np.lexsort((np.arange(len(angle)), -np.round(angle, 9), outline.row))
    return np.asarray(order[outline.offsets[:-1]] - outline.offsets[:-1])
