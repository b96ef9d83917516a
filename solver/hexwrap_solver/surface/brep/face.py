"""Triangles of one face: rows of points inside its boundary, Delaunay, splits where edges are too long."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.geometry import dot, face_normals, pair_key
from hexwrap_solver.surface.brep.plane import triangulated
from hexwrap_solver.surface.brep.pull import Patch, free
from hexwrap_solver.surface.brep.sizes import Field, Sizes, bilinear
from hexwrap_solver.surface.errors import TrimError
from hexwrap_solver.surface.flips import flip_to_delaunay, independent
from hexwrap_solver.surface.mesh_sizes import ROW, cumulated
from hexwrap_solver.surface.nurbs import evaluate_points, tangents
from hexwrap_solver.surface.projection import project
from hexwrap_solver.surface.topology import edge_lengths, half_edges, sum_rows, twins
from hexwrap_solver.tolerances import RELATIVE, TINY

#: Points inside keep away from the boundary by this part of its edges' lengths, which are looked at in so
#: many places each.
AWAY, PLACES = 0.5, 4
#: Rounds of splits; each halves the edges that are too long.
ROUNDS = 24
#: Triangles with an angle below this, radians, are made better by moving their vertices, so often at first.
SMALL, SMOOTHINGS = np.deg2rad(38), 3
#: Moves are taken back at most so often before all of them are.
UNDOINGS = 8
#: A row may be so much lower than equilateral.
FLATTEST = 3.0


@dataclass(frozen=True)
class Outline:
    """The boundary of a face, and lines on it that have to be edges.

    id: (k,) the mesh vertex of each corner, −1 for corners of lines inside; several corners may be one
    vertex, at seams and poles. uv: (k, 2). points: (k, 3). loops: (l + 1,) the first corners of loops; those
    beyond are inside. lines: (s, 2) pairs of corners joined inside.
    """

    id: Ints
    uv: Floats
    points: Floats
    loops: Ints
    lines: Ints

    @property
    def segments(self) -> Ints:
        """(k, 2) pairs of corners that become edges."""
        k = np.arange(self.loops[-1])
        following = k + 1
        following[self.loops[1:] - 1] = self.loops[:-1]
        return np.concatenate([np.stack([k, following], axis=1), self.lines])

    @property
    def polygon(self) -> shapely.Polygon:
        return polygon_of(self.uv, self.loops)


@dataclass(frozen=True)
class Piece:
    """The mesh of one face: first the vertices of its outline, then its own.

    faces: (m, 3) counter-clockwise in the parameters' plane. lines: edges inside that stay. loose: (n, 2)
    whether a parameter means nothing there, at poles. fixed: (n,) vertices that stay where they are.
    """

    uv: Floats
    points: Floats
    faces: Ints
    lines: Ints
    loose: Bools
    fixed: Bools

    @cached_property
    def twin(self) -> Ints:
        """(3m,) see ``topology.twins``."""
        return twins(self.faces, len(self.points))

    def middle(self, start: Ints, end: Ints) -> Floats:
        """(k, 2) parameters halfway along edges."""
        a, b = self.uv[start], self.uv[end]
        a, b = np.where(self.loose[start], b, a), np.where(self.loose[end], a, b)
        return np.asarray((a + b) / 2)


def polygon_of(uv: Floats, loops: Ints) -> shapely.Polygon:
    rings = [uv[a:b] for a, b in pairwise(loops)]
    return shapely.Polygon(rings[0], rings[1:])


def piece_of(
    patch: Patch, outline: Outline, field: Field, sizes: Sizes, most: int, name: int, taken: set[int]
) -> Piece:
    """Triangles inside the outline; no inner edge longer than wanted, none a second one between two vertices.

    taken: keys (see ``key_of``) of edges that the mesh has already, those of the face's own outline included;
    its inner edges between vertices of the outline are added. Raises TrimError.
    """
    chart = Chart.of(field)
    inner = _inner(patch, chart, outline)
    uv = np.concatenate([outline.uv, inner])
    xy = chart.at(uv)
    polygon = polygon_of(xy, outline.loops)
    if not polygon.is_valid:
        raise TrimError(
            f"The boundary of face {name} of the polysurface crosses itself "
            f"({shapely.is_valid_reason(polygon).split('[')[0].lower()}): rebuild that face in Rhino.",
            data={"face": name},
        )
    faces = triangulated(xy, outline.segments, polygon)
    if faces is None:
        raise TrimError(
            f"Face {name} of the polysurface could not be filled with triangles: its boundary nearly touches "
            "itself. Rebuild that face in Rhino, or save the object with render meshes.",
            data={"face": name},
        )
    points = np.concatenate([outline.points, evaluate_points(patch.opened, inner)])
    merged = _one_per_pole(outline, len(uv))
    faces = merged[faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    lines = merged[outline.lines]
    faces = flip_to_delaunay(points, faces, keep=lines)
    loose = np.zeros(uv.shape, dtype=bool)
    pole = np.unique(merged[merged != np.arange(len(uv))])
    loose[pole] = free(patch, uv[pole])
    fixed = np.arange(len(uv)) < len(outline.uv)
    piece = Piece(uv, points, faces, lines, loose, fixed)
    for _ in range(SMOOTHINGS):
        piece = _smoothed(patch, piece)
    return _without_doubles(patch, _split_long(patch, piece, sizes, most), outline.id, taken)


def key_of(one: Ints, two: Ints) -> Ints:
    """(k,) one number for each edge between mesh vertices, in either direction."""
    return np.asarray(np.minimum(one, two) << 32 | np.maximum(one, two))


def _without_doubles(patch: Patch, piece: Piece, id: Ints, taken: set[int]) -> Piece:
    """Inner edges between two mesh vertices that another edge joins, too, are halved.

    Such come where a face is only a few triangles wide around a pole or a seam, whose two sides are the same
    vertices, and where faces have chords between the same corners.
    """
    for _ in range(ROUNDS):
        n = len(piece.points)
        label = np.concatenate([id, np.full(n - len(id), -1)])
        inside = label < 0
        label[inside] = (1 << 31) + np.flatnonzero(inside)
        start, end = half_edges(piece.faces)
        h = np.flatnonzero(piece.twin > np.arange(len(piece.twin)))
        key = key_of(label[start[h]], label[end[h]])
        _, place, count = np.unique(key, return_inverse=True, return_counts=True)
        chord = ~inside[start[h]] & ~inside[end[h]]
        double = count[place] > 1
        double[chord] |= np.array([k in taken for k in key[chord].tolist()], dtype=bool)
        if not double.any():
            taken.update(key[chord].tolist())
            break
        piece = _halved(patch, piece, h[double])
    return piece


def _one_per_pole(outline: Outline, n: int) -> Ints:
    """(n,) vertices, neighbours on the outline at one and the same place (a pole) being one."""
    label = np.arange(n)
    for a, b in zip(outline.loops[:-1], outline.loops[1:], strict=True):
        following = np.roll(np.arange(a, b), -1)
        same = outline.id[a:b] == outline.id[following]
        for i, j in zip(np.arange(a, b)[same], following[same], strict=True):
            label[label == label[j]] = label[i]
    return label


@dataclass(frozen=True)
class Chart:
    """A map of the parameters to the plane in which edges of the wanted length are about 1 long.

    Rows run along s; swapped: s is v and t is u. x: (b, a) and y: (b, a) over the grid of s (a,) and t (b,);
    y counts rows in their heights, and in all there are ``rows``.
    """

    s: Floats
    t: Floats
    swapped: bool
    x: Floats
    y: Floats
    rows: int
    along: Floats

    @classmethod
    def of(cls, field: Field) -> Chart:
        """Rows run in the direction across which they are of more even heights."""
        density = field.density / field.h**2
        rates = []
        for speed in (field.speed_u, field.speed_v):
            s = speed / field.h
            rates.append((s, density / np.maximum(s, RELATIVE * s.max()) / ROW))
        uneven = [_unevenness(rates[0][1], field.inside), _unevenness(rates[1][1].T, field.inside.T)]
        swapped = uneven[1] < 0.9 * uneven[0]
        s, t = (field.v, field.u) if swapped else (field.u, field.v)
        along, rise = (x.T if swapped else x for x in rates[1 if swapped else 0])
        height = cumulated(rise.T, np.diff(t)).T
        needed = height[-1]
        rows = max(1, int(np.ceil(float(needed.max()) - 1e-6)))
        y = height / np.maximum(needed, 1e-12 * needed.max()) * rows * ROW
        flat = np.maximum(needed / rows, 1 / FLATTEST)
        weight = np.where((field.inside.T if swapped else field.inside), 1.0, 1e-3)
        mean = (along * weight).sum(axis=0) / weight.sum(axis=0)
        x = cumulated(mean[None], np.diff(s))[0]
        return cls(s, t, bool(swapped), np.tile(x, (len(t), 1)), y, rows, along / flat)

    def at(self, uv: Floats) -> Floats:
        """(k, 2) places in the plane; mirrored where swapped, so that turns stay what they are."""
        st = uv[:, ::-1] if self.swapped else uv
        x = bilinear(self.s, self.t, self.x, st)
        return np.stack([-x if self.swapped else x, bilinear(self.s, self.t, self.y, st)], axis=1)

    def lattice(self) -> Floats:
        """(k, 2) parameters of staggered rows of points over the whole grid, its ends left out."""
        out = []
        k = np.arange(1, self.rows)
        heights = np.stack(
            [np.interp(k * ROW, self.y[:, i], self.t) for i in range(len(self.s))], axis=1
        ).reshape(len(k), len(self.s))
        along = np.stack(
            [np.interp(heights[:, i], self.t, self.along[:, i]) for i in range(len(self.s))], axis=1
        ).reshape(len(k), len(self.s))
        total = cumulated(along, np.diff(self.s))
        for row in range(len(k)):
            n = max(1, int(np.ceil(total[row, -1] - 1e-6)))
            place = (np.arange(n) + 0.5 * (k[row] % 2)) / n * total[row, -1]
            s = np.interp(place, total[row], self.s)
            out.append(np.stack([s, np.interp(s, self.s, heights[row])], axis=1))
        st = np.concatenate(out) if out else np.zeros((0, 2))
        return np.asarray(st[:, ::-1] if self.swapped else st)


def _unevenness(rise: Floats, inside: Bools) -> float:
    """Mean variation of the height of rows (b, a) along themselves."""
    weight = np.where(inside, 1.0, 1e-3)
    mean = (rise * weight).sum(axis=1) / weight.sum(axis=1)
    spread = (np.abs(rise - mean[:, None]) * weight).sum(axis=1) / weight.sum(axis=1)
    return float((spread / np.maximum(mean, TINY)).mean())


def _inner(patch: Patch, chart: Chart, outline: Outline) -> Floats:
    """(k, 2) parameters of points inside, not too near to the outline."""
    uv = chart.lattice()
    polygon = outline.polygon
    shapely.prepare(polygon)
    uv = uv[shapely.contains_xy(polygon, uv)]
    if len(uv) == 0:
        return np.asarray(uv)
    one, two = outline.points[outline.segments[:, 0]], outline.points[outline.segments[:, 1]]
    part = (np.arange(PLACES) / PLACES)[:, None, None]
    length = np.linalg.norm(two - one, axis=1)
    distance, nearest = cKDTree((one + part * (two - one)).reshape(-1, 3)).query(
        evaluate_points(patch.opened, uv)
    )
    return np.asarray(uv[distance > AWAY * length[nearest % len(one)]])


def _split_long(patch: Patch, piece: Piece, sizes: Sizes, most: int) -> Piece:
    """Halves inner edges that are longer or farther off the surface than wanted, and flips to Delaunay."""
    for _ in range(ROUNDS):
        long = _too_long(patch, piece, sizes)
        if len(long) == 0 or len(piece.points) > most:
            break
        old = len(piece.points)
        piece = _halved(patch, piece, long)
        fresh = np.arange(len(piece.points)) >= old
        piece = replace(piece, faces=flip_to_delaunay(piece.points, piece.faces, piece.lines, fresh))
        piece = _smoothed(patch, piece, fresh)
    return piece


def _smoothed(patch: Patch, piece: Piece, fresh: Bools | None = None) -> Piece:
    """Vertices around triangles of small angles move to the middle of their neighbours, on the surface, where
    that turns no triangle over; then edges are flipped to Delaunay.

    fresh: (n,) vertices beside which triangles have changed; None: all are looked at.
    """
    n = len(piece.points)
    faces = piece.faces
    if fresh is not None:
        beside = np.zeros(n, dtype=bool)
        beside[faces[fresh[faces].any(axis=1)]] = True
        faces = faces[beside[faces].any(axis=1)]
    poor = faces[_least_angles(piece.points, faces) < SMALL].ravel()
    near = np.zeros(n, dtype=bool)
    near[poor] = True
    near[piece.faces[near[piece.faces].any(axis=1)]] = True
    pole = np.logical_or(*piece.loose.T)
    near[piece.faces[pole[piece.faces].any(axis=1)]] = False
    near &= ~piece.fixed
    move = np.flatnonzero(near)
    if len(move) == 0:
        return piece
    star = piece.faces[near[piece.faces].any(axis=1)]
    start, end = half_edges(star)
    count = np.maximum(np.bincount(start, minlength=n), 1)
    middle = sum_rows(piece.points[end], start, n) / count[:, None]
    at, du, dv = tangents(patch.opened, piece.uv[move])
    away = middle[move] - at
    e, f, g, p, q = (dot(a, b) for a, b in ((du, du), (du, dv), (dv, dv), (away, du), (away, dv)))
    determinant = np.maximum(e * g - f * f, 1e-12 * np.maximum(e * g, TINY))
    step = np.stack([g * p - f * q, e * q - f * p], axis=1) / determinant[:, None]
    uv, points = piece.uv.copy(), piece.points.copy()
    uv[move] += step
    points[move] = evaluate_points(patch.opened, uv[move])
    allowed = np.minimum(_least_angles(piece.points, star), SMALL) * 0.7
    normal = face_normals(piece.points, star)
    for _ in range(UNDOINGS):
        worse = dot(face_normals(points, star), normal) <= 0
        worse |= _least_angles(points, star) < allowed
        if not worse.any():
            break
        back = np.unique(star[worse])
        uv[back], points[back] = piece.uv[back], piece.points[back]
    else:
        return piece
    return replace(
        piece, uv=uv, points=points, faces=flip_to_delaunay(points, piece.faces, piece.lines, near)
    )


def _least_angles(points: Floats, faces: Ints) -> Floats:
    """(m,) the smallest angle of each triangle, radians, between its longer sides."""
    length = np.sort(edge_lengths(points, faces), axis=1)
    area = np.linalg.norm(face_normals(points, faces), axis=1)
    sine = area / np.maximum(length[:, 1] * length[:, 2], TINY)
    return np.asarray(np.arcsin(np.clip(sine, 0.0, 1.0)))


def _too_long(patch: Patch, piece: Piece, sizes: Sizes) -> Ints:
    """Inner half-edges to be halved, the worst first."""
    h = np.flatnonzero(piece.twin > np.arange(len(piece.twin)))
    start, end = (side[h] for side in half_edges(piece.faces))
    length = np.linalg.norm(piece.points[start] - piece.points[end], axis=1)
    excess = length / sizes.longest
    if np.isfinite(sizes.height):
        middle = (piece.points[start] + piece.points[end]) / 2
        uv = piece.middle(start, end)
        height = np.linalg.norm(evaluate_points(patch.opened, uv) - middle, axis=1)
        high = np.flatnonzero(height > sizes.height)
        if len(high):
            foot, _, _ = project(patch.opened, middle[high], uv[high], 3)
            height[high] = np.linalg.norm(middle[high] - foot, axis=1)
        excess = np.maximum(excess, np.sqrt(height / sizes.height))
    worst = np.flatnonzero(excess > 1)
    return h[worst[np.argsort(-excess[worst], kind="stable")]]


def _halved(patch: Patch, piece: Piece, h: Ints) -> Piece:
    """Edges (no two of a face) split at the middle of their parameters."""
    h = independent(h, piece.twin, len(piece.faces))
    faces = piece.faces
    start, end = (side[h] for side in half_edges(faces))
    uv = piece.middle(start, end)
    new = len(piece.uv) + np.arange(len(h))
    t = piece.twin[h]
    c = faces.ravel()[_third(h)]
    d = faces.ravel()[_third(t)]
    out = faces.copy()
    out[h // 3] = np.stack([start, new, c], axis=1)
    out[t // 3] = np.stack([end, new, d], axis=1)
    more = [np.stack([new, end, c], axis=1), np.stack([new, start, d], axis=1)]
    lines, on_lines = _halved_lines(piece.lines, start, end, new)
    return Piece(
        np.concatenate([piece.uv, uv]),
        np.concatenate([piece.points, evaluate_points(patch.opened, uv)]),
        np.concatenate([out, *more]),
        lines,
        np.concatenate([piece.loose, np.zeros((len(new), 2), dtype=bool)]),
        np.concatenate([piece.fixed, np.isin(new, on_lines)]),
    )


def _third(h: Ints) -> Ints:
    return 3 * (h // 3) + (h + 2) % 3


def _halved_lines(lines: Ints, start: Ints, end: Ints, new: Ints) -> tuple[Ints, Ints]:
    """Lines that were split are replaced by their halves; and the new vertices on them."""
    n = int(new.max(initial=0)) + 1
    key, own = pair_key(start, end, n), pair_key(lines[:, 0], lines[:, 1], n)
    order = np.argsort(key)
    place = np.minimum(np.searchsorted(key[order], own), len(key) - 1)
    hit = key[order][place] == own
    middle = new[order[place[hit]]]
    halves = [np.stack([lines[hit, 0], middle], axis=1), np.stack([middle, lines[hit, 1]], axis=1)]
    return np.concatenate([lines[~hit], *halves]), middle
