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

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.geometry import dot, face_areas
from hexwrap_solver.surface.brep.plane import triangulated
from hexwrap_solver.surface.topology import half_edges, vertex_normals
from hexwrap_solver.surface.types import Openings, Surface
from hexwrap_solver.tolerances import TINY

#: Vertices inside keep this many edge lengths away from the loop.
CLEARANCE = 0.6
#: A hole gets at most this many vertices for each one of its loop: a loop of very short edges around a large
#: hole would ask for millions.
MOST_PER_VERTEX = 40
#: Cotangents are cut off here: the fairest fill must not hang on needles.
MOST_COTANGENT = 50.0


def fill_openings(surface: Surface) -> Surface:
    """The surface with its last ``openings`` loops filled; ``patch`` marks the new faces. New vertices and
    faces come after all others."""
    if not surface.openings:
        return surface
    kept = len(surface.loops) - surface.openings
    n = old = len(surface.vertices)
    places, triangles, names, start = [], [], [], 0
    around = np.zeros(n, dtype=bool)
    around[np.concatenate(surface.loops[kept:])] = True
    edges = np.stack(half_edges(surface.faces), axis=1)
    taken = np.sort(edges[around[edges].all(axis=1)], axis=1) @ [n, 1]
    for loop in surface.loops[kept:]:
        outline = loop[::-1]  # a loop runs with the surface on its left, and so clockwise around its hole
        z, fill = _fill(surface.vertices[outline])
        if np.isin(_across(outline, fill) @ [old, 1], taken).any():  # an edge would have four sides
            z, fill = _fan(surface.vertices[outline])
        places.append(z)
        triangles.append(start + fill)
        names.append(np.concatenate([outline, n + np.arange(len(z) - len(loop))]))
        n, start = n + len(z) - len(loop), start + len(z)
    fills, name = np.concatenate(triangles), np.concatenate(names)
    inner = _spanned(np.concatenate(places), fills, name, surface.vertices)
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


def _fill(outline: Floats) -> tuple[Complexes, Ints]:
    """(k + p,) the outline (k, 3) and points inside it in a plane, and (t, 3) triangles."""
    z = _flattened(outline)
    found = _triangulated(z) if shapely.Polygon(np.stack([z.real, z.imag], axis=1)).is_valid else None
    if found is None:  # it does not lie flat: any disk will do, since the fill is bent anyway
        found = _triangulated(_rounded(outline))
        assert found is not None, "a circle does not touch itself"
    return found


def _across(outline: Ints, fill: Ints) -> Ints:
    """(m, 2) ends, the lower first, of edges across the hole. outline: (k,) vertices; fill: (t, 3) triangles,
    of which corners below k are these."""
    k = len(outline)
    sides = np.stack(half_edges(fill), axis=1)
    apart = (sides[:, 1] - sides[:, 0]) % k
    across = (sides < k).all(axis=1) & (apart != 1) & (apart != k - 1)
    return np.sort(outline[sides[across]], axis=1)


def _fan(outline: Floats) -> tuple[Complexes, Ints]:
    """(k + 1,) the outline (k, 3) on a circle, and its centre, and (k, 3) triangles around that."""
    k = len(outline)
    around = np.arange(k)
    return np.append(_rounded(outline), 0), np.stack([around, (around + 1) % k, np.full(k, k)], axis=1)


def _flattened(outline: Floats) -> Complexes:
    """(k,) the outline in its best plane, counter-clockwise."""
    centred = outline - outline.mean(axis=0)
    area = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)  # twice the vector area
    normal = area / max(float(np.linalg.norm(area)), TINY)
    x = np.linalg.svd(centred - np.outer(centred @ normal, normal), full_matrices=False)[2][0]
    return np.asarray(centred @ x + 1j * (centred @ np.cross(normal, x)))


def _rounded(outline: Floats) -> Complexes:
    """(k,) the outline on a circle, by length."""
    length = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
    total = float(length.sum())
    along = (np.cumsum(length) - length) / total
    return np.asarray(total / (2 * np.pi) * np.exp(2j * np.pi * along))


def _triangulated(z: Complexes) -> tuple[Complexes, Ints] | None:
    """A counter-clockwise polygon (k,) with points inside, about as far from each other as its vertices, and
    (t, 3) triangles. None where the polygon all but touches itself."""
    k = len(z)
    polygon = shapely.Polygon(np.stack([z.real, z.imag], axis=1))
    step = float(np.abs(np.roll(z, -1) - z).mean())
    step = max(step, float(np.sqrt(polygon.area / (0.87 * MOST_PER_VERTEX * k))))
    low, high = z.real.min() + 1j * z.imag.min(), z.real.max() + 1j * z.imag.max()
    rows = np.arange(int((high - low).imag / (step * np.sqrt(0.75))) + 2)
    columns = np.arange(-1, int((high - low).real / step) + 2)
    j, i = (a.ravel() for a in np.meshgrid(rows, columns, indexing="ij"))
    lattice = low + step * (i + 0.5 * (j % 2) + 0.25 + 1j * np.sqrt(0.75) * (j + 0.25))
    away = polygon.buffer(-CLEARANCE * step)
    shapely.prepare(away)
    inner = lattice[shapely.contains_xy(away, lattice.real, lattice.imag)]
    both = np.concatenate([z, inner])
    around = np.stack([np.arange(k), (np.arange(k) + 1) % k], axis=1)
    triangles = triangulated(np.stack([both.real, both.imag], axis=1), around, polygon)
    return None if triangles is None else (both, triangles)


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
    return replace(surface, openings=count) if count else surface
