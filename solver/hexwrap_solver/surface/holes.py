"""Openings of a facade filled smoothly, so that the map may run past them.

A hole is triangulated in the plane of its loop, with triangles about as large as those around (Liepa 2003).
Then the fill is bent so that the surface runs on smoothly across the loop: it minimises the integral of the
squared Laplacian of the positions (Botsch, Kobbelt 2004).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from hexwrap_solver import words
from hexwrap_solver.arrays import Complexes, Floats, Ints, Ragged
from hexwrap_solver.geometry import dot, face_areas
from hexwrap_solver.surface.brep.plane import triangulated
from hexwrap_solver.surface.topology import half_edges, vertex_normals
from hexwrap_solver.surface.types import Openings, Surface
from hexwrap_solver.tolerances import TINY

#: Sides of an outline on a circle are at least this part of its mean side.
SHORTEST = 0.01
#: Vertices inside keep this many edge lengths away from the loop.
CLEARANCE = 0.6
#: A hole gets at most this many vertices for each one of its loop: a loop of very short edges around a large
#: hole would ask for millions.
MOST_PER_VERTEX = 40
#: Cotangents are cut off here: the fairest fill must not hang on needles.
MOST_COTANGENT = 50.0
#: Of two loops whose ``_flatness`` differs by so much, one looks like a window, the other like an end.
UNLIKE = 0.35


def fill_openings(surface: Surface) -> Surface:
    """The surface with its last ``openings`` loops filled; ``patch`` marks the new faces. New vertices and
    faces come after all others."""
    if not surface.openings:
        return surface
    kept = len(surface.loops) - surface.openings
    old = len(surface.vertices)
    # a loop runs with the surface on its left, and so clockwise around its hole
    around = [loop[::-1] for loop in surface.loops[kept:]]
    outlines = Ragged.of(np.concatenate(around), np.array([len(loop) for loop in around]))
    z, fills = _filled(surface, outlines)
    n = old + len(z) - len(outlines.values)
    name = np.concatenate([outlines.values, np.arange(old, n)])
    inner = _spanned(z, fills, name, surface.vertices)
    filled = np.concatenate([surface.faces, name[fills]])
    vertices = _faired(np.concatenate([surface.vertices, inner]), filled, old, len(surface.faces))
    return replace(
        surface,
        vertices=vertices,
        faces=filled,
        loops=surface.loops[:kept],
        input_vertex=np.concatenate([surface.input_vertex, np.full(n - old, -1, dtype=np.int64)]),
        normals=np.concatenate([surface.normals, vertex_normals(vertices, filled)[old:]]),
        openings=0,
        patch=np.arange(len(filled)) >= len(surface.faces),
        nurbs=None,
        parameters=None,
    )


def _filled(surface: Surface, outlines: Ragged) -> tuple[Complexes, Ints]:
    """(k + p,) the vertices of the outlines and points inside them, and (t, 3) triangles. Every outline lies
    in a plane of its own."""
    points, k = surface.vertices[outlines.values], len(outlines.values)
    flat, round_ = _flattened(points, outlines), _rounded(points, outlines)
    unfit = ~shapely.is_valid(_polygons(flat, outlines))  # any disk will do, since the fill is bent anyway
    found = _triangulated(np.where(unfit[outlines.row], round_, flat), outlines)
    if found is None:
        found = _one_by_one(np.where(unfit[outlines.row], round_, flat), round_, outlines)
    z, fills, owner = found
    spoilt = np.zeros(outlines.n_rows, dtype=bool)
    spoilt[owner[fills[_repeats(surface, outlines, fills)]]] = True
    if not spoilt.any():
        return z, fills
    keep = ~spoilt[owner] | (np.arange(len(z)) < k)  # no point inside but the centre
    rim = np.flatnonzero(spoilt[outlines.row])
    centre = int(keep.sum()) + np.cumsum(spoilt)[outlines.row[rim]] - 1
    around = np.stack([rim, outlines.next()[rim], centre], axis=1)
    z[rim] = round_[rim]
    fills = (np.cumsum(keep) - 1)[fills[~spoilt[owner[fills[:, 0]]]]]
    return np.append(z[keep], np.zeros(int(spoilt.sum()))), np.concatenate([fills, around])


def _one_by_one(z: Complexes, round_: Complexes, outlines: Ragged) -> tuple[Complexes, Ints, Ints]:
    """As ``_triangulated``, each outline (k,) by itself, and on its circle where it all but touches
    itself."""
    k, rims, inner, fills, owner = len(z), [], [], [], [outlines.row]
    for i, start in enumerate(outlines.offsets[:-1].tolist()):
        own, only = slice(start, outlines.offsets[i + 1]), _only(outlines, i)
        found = _triangulated(z[own], only) or _triangulated(round_[own], only)
        assert found is not None, "a circle does not touch itself"
        n = len(outlines[i])
        rims.append(found[0][:n])
        fills.append(np.where(found[1] < n, found[1] + start, found[1] + (k - n)))
        inner.append(found[0][n:])
        owner.append(np.full(len(inner[-1]), i))
        k += len(inner[-1])
    return np.concatenate([*rims, *inner]), np.concatenate(fills), np.concatenate(owner)


def _repeats(surface: Surface, outlines: Ragged, fills: Ints) -> Ints:
    """(r,) the triangles with an edge across the hole that is one of the surface already: a second such edge
    would have four sides."""
    n, k = len(surface.vertices), len(outlines.values)
    around = np.zeros(n, dtype=bool)
    around[outlines.values] = True
    edges = np.stack(half_edges(surface.faces), axis=1)
    taken = np.sort(edges[around[edges].all(axis=1)], axis=1) @ [n, 1]
    rim = np.sort(np.stack([outlines.values, outlines.values[outlines.next()]], axis=1), axis=1) @ [n, 1]
    sides = np.stack(half_edges(fills), axis=1)
    across = np.flatnonzero((sides < k).all(axis=1))
    edge = np.sort(outlines.values[sides[across]], axis=1) @ [n, 1]
    return np.asarray(across[np.isin(edge, np.setdiff1d(taken, rim))] // 3)


def _only(outlines: Ragged, i: int) -> Ragged:
    return Ragged(outlines[i], np.array([0, len(outlines[i])]))


def _polygons(z: Complexes, outlines: Ragged) -> np.ndarray:
    return np.asarray(
        shapely.polygons(shapely.linearrings(np.stack([z.real, z.imag], axis=1), indices=outlines.row))
    )


def _sums(values: Floats, outlines: Ragged) -> Floats:
    """(b, …) sums over every outline."""
    return np.asarray(np.add.reduceat(values, outlines.offsets[:-1], axis=0))


def _flattened(points: Floats, outlines: Ragged) -> Complexes:
    """(k,) the points (k, 3) of outlines, each in its best plane, counter-clockwise."""
    row = outlines.row
    centred = points - (_sums(points, outlines) / outlines.lengths[:, None])[row]
    area = _sums(np.cross(centred, centred[outlines.next()]), outlines)  # twice the vector area
    normal = area / np.maximum(np.linalg.norm(area, axis=1), TINY)[:, None]
    planar = centred - dot(centred, normal[row])[:, None] * normal[row]
    x = np.linalg.eigh(_sums(planar[:, :, None] * planar[:, None, :], outlines))[1][:, :, 2]
    return np.asarray(dot(centred, x[row]) + 1j * dot(centred, np.cross(normal, x)[row]))


def _rounded(points: Floats, outlines: Ragged) -> Complexes:
    """(k,) the points (k, 3) of outlines, each on a circle, by length; none of them all but in one place."""
    length = np.linalg.norm(points[outlines.next()] - points, axis=1)
    mean = _sums(length, outlines) / outlines.lengths
    length = np.maximum(length, SHORTEST * mean[outlines.row])
    total = _sums(length, outlines)
    before = np.cumsum(length) - length
    along = (before - before[outlines.offsets[:-1]][outlines.row]) / total[outlines.row]
    return np.asarray(total[outlines.row] / (2 * np.pi) * np.exp(2j * np.pi * along))


def _triangulated(z: Complexes, outlines: Ragged) -> tuple[Complexes, Ints, Ints] | None:
    """Counter-clockwise outlines (k,) with points inside, about as far from each other as its vertices;
    (t, 3) triangles; and the outline of each point. All in one triangulation, outlines far apart, the unit
    of each its points' distance. None where one all but touches itself."""
    row, following = outlines.row, outlines.next()
    step = _sums(np.abs(z[following] - z), outlines) / outlines.lengths
    area = np.abs(_sums((z.conj() * z[following]).imag, outlines)) / 2
    z = z / np.maximum(step, np.sqrt(area / (0.87 * MOST_PER_VERTEX * outlines.lengths)))[row]
    polygons = _polygons(z, outlines)
    bounds = shapely.bounds(polygons)
    across = int(np.ceil(np.sqrt(len(polygons))))
    each = np.arange(len(polygons))
    corner = 2 * float((bounds[:, 2:] - bounds[:, :2]).max()) * (each % across + 1j * (each // across))
    z = z + (corner - bounds[:, 0] - 1j * bounds[:, 1])[row]
    polygons = _polygons(z, outlines)

    columns, rows = ((bounds[:, 2:] - bounds[:, :2]) / [1, np.sqrt(0.75)] + [3, 2]).astype(int).T
    owner = np.repeat(each, rows * columns)
    j, i = np.divmod(
        np.arange(len(owner)) - (np.cumsum(rows * columns) - rows * columns)[owner], columns[owner]
    )
    lattice = corner[owner] + i - 0.75 + 0.5 * (j % 2) + 1j * np.sqrt(0.75) * (j + 0.25)
    away = shapely.buffer(polygons, -CLEARANCE)
    shapely.prepare(away)
    inside = shapely.contains_xy(away[owner], lattice.real, lattice.imag)
    both = np.append(z, lattice[inside])
    edges = np.stack([np.arange(len(z)), following], axis=1)
    fills = triangulated(np.stack([both.real, both.imag], axis=1), edges, shapely.multipolygons(polygons))
    return None if fills is None else (both, fills, np.append(row, owner[inside]))


def _cotangents(points: Floats, faces: Ints) -> csr_array:
    """(n, n) the cotangent Laplacian of triangles, its sign such that it is positive semidefinite."""
    n = len(points)
    rows, columns, weights = [], [], []
    for c in range(3):
        apex, a, b = (faces[:, (c + i) % 3] for i in range(3))
        one, other = points[a] - points[apex], points[b] - points[apex]
        area = np.linalg.norm(np.cross(one, other), axis=1)
        cotangent = dot(one, other) / np.maximum(area, TINY)
        rows.append(a)
        columns.append(b)
        weights.append(0.5 * np.clip(cotangent, -MOST_COTANGENT, MOST_COTANGENT))
    i, j, w = (np.concatenate(parts) for parts in (rows, columns, weights))
    both = coo_array((np.tile(w, 2), (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(n, n)).tocsr()
    degree = coo_array((np.asarray(both.sum(axis=1)).ravel(), (np.arange(n), np.arange(n))), shape=(n, n))
    return csr_array(degree - both)


def _spanned(z: Complexes, triangles: Ints, name: Ints, vertices: Floats) -> Floats:
    """(p, 3) the inner points of plane triangulations, spanned harmonically over their outlines. name: (k,)
    of each point z; those of ``vertices`` lie on an outline."""
    laplacian = _cotangents(np.stack([z.real, z.imag, 0 * z.real], axis=1), triangles)
    rim, inner = np.flatnonzero(name < len(vertices)), np.flatnonzero(name >= len(vertices))
    if not len(inner):
        return np.zeros((0, 3))
    rows = laplacian[inner]
    return np.asarray(splu(rows[:, inner].tocsc()).solve(-(rows[:, rim] @ vertices[name[rim]])))


def _faired(vertices: Floats, faces: Ints, old: int, wall: int) -> Floats:
    """The vertices with those from ``old`` on moved to where Σ |Δx|² is least. wall: number of old faces."""
    if len(vertices) == old:
        return vertices
    at_fill = np.zeros(len(vertices), dtype=bool)
    at_fill[faces[wall:].ravel()] = True
    near = faces[at_fill[faces].any(axis=1)]
    names, local = np.unique(near, return_inverse=True)
    points, near = vertices[names], local.reshape(-1, 3)
    mass = np.bincount(near.ravel(), np.repeat(face_areas(points, near) / 3, 3), len(names))
    rows = np.flatnonzero(at_fill[names])  # all triangles around these are at hand
    weight = diags_array(1 / np.sqrt(np.maximum(mass[rows], TINY)))
    laplacian = csr_array(weight @ _cotangents(points, near)[rows]).tocsc()
    free = np.flatnonzero(names >= old)
    held = np.flatnonzero(names < old)
    unknown, known = laplacian[:, free], laplacian[:, held]
    bending = csr_array(unknown.T @ unknown).tocsc()
    moved = vertices.copy()
    moved[names[free]] = splu(bending).solve(np.asarray(-(unknown.T @ (known @ points[held]))))
    return moved


def with_openings(surface: Surface, openings: Openings) -> Surface:
    """The surface with its loops beyond the two longest as openings, or as boundaries."""
    count = max(len(surface.loops) - 2, 0) if openings == "cut" else 0
    if not count:
        return surface
    return replace(surface, openings=count, repairs=(*surface.repairs, *_mistaken(surface)))


def _mistaken(surface: Surface) -> list[str]:
    """Told where a filled loop looks like an end of a tube and one of the two longest like a window."""
    flat = np.array([_flatness(surface, loop) for loop in surface.loops])
    window, end = int(flat[:2].argmax()), 2 + int(flat[2:].argmin())
    if flat[window] - flat[end] < UNLIKE:
        return []
    (there, around), (here, shorter) = (_whereabouts(surface, surface.loops[i]) for i in (window, end))
    return [
        f"The opening at {there}, {around} around, is longer than the end at {here}, {shorter} around, which "
        "was filled in its stead: openings are the loops beyond the two longest. With surface.openings "
        "loop each is a boundary."
    ]


def _flatness(surface: Surface, loop: Ints) -> float:
    """Mean cosine between the surface's normals along a loop and that of its plane: 1 for a hole in a flat
    wall, 0 for the end of a cylinder."""
    start, end = surface.vertices[loop], surface.vertices[np.roll(loop, -1)]
    length = np.linalg.norm(end - start, axis=1)
    plane = np.cross(start - start.mean(axis=0), end - start).sum(axis=0)
    plane /= max(float(np.linalg.norm(plane)), TINY)
    return float(length @ abs(surface.normals[loop] @ plane) / max(float(length.sum()), TINY))


def _whereabouts(surface: Surface, loop: Ints) -> tuple[str, str]:
    """The middle of a loop, and its length."""
    points = surface.vertices[loop]
    around = float(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).sum())
    return words.place(points.mean(axis=0)), words.length(around)
