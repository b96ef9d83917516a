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
from scipy.spatial import Delaunay

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.geometry import dot, face_areas
from hexwrap_solver.surface.topology import vertex_normals
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
    n = len(surface.vertices)
    points, faces = [surface.vertices], [surface.faces]
    for loop in surface.loops[kept:]:
        inner, triangles = _fill(surface.vertices[loop])
        faces.append(np.concatenate([loop, n + np.arange(len(inner))])[triangles])
        points.append(inner)
        n += len(inner)
    old, filled = len(surface.vertices), np.concatenate(faces)
    vertices = _faired(np.concatenate(points), filled, old, len(surface.faces))
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


def _fill(loop: Floats) -> tuple[Floats, Ints]:
    """(p, 3) points inside a loop (k, 3), and (t, 3) triangles; of the loop's vertices first. The loop
    runs with the surface on its left, and so clockwise around its hole."""
    k = len(loop)
    outline = loop[::-1]
    z = _flattened(outline)
    found = _triangulated(z) if shapely.Polygon(np.stack([z.real, z.imag], axis=1)).is_valid else None
    if found is None:  # it does not lie flat: any disk will do, since the fill is bent anyway
        z = _rounded(outline)
        found = _triangulated(z)
        assert found is not None, "the edges between neighbours on a circle are Delaunay"
    inner, triangles = found
    places = _spanned(np.concatenate([z, inner]), triangles, outline)
    return places, np.concatenate([np.arange(k)[::-1], k + np.arange(len(inner))])[triangles]


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
    """Points inside a counter-clockwise polygon (k,), about as far from each other as its vertices, and
    (t, 3) triangles over both. None where an edge of the polygon is not among the sides of the Delaunay
    triangles."""
    k = len(z)
    polygon = shapely.Polygon(np.stack([z.real, z.imag], axis=1))
    step = float(np.abs(np.roll(z, -1) - z).mean())
    step = max(step, float(np.sqrt(polygon.area / (0.87 * MOST_PER_VERTEX * k))))
    low, high = z.real.min() + 1j * z.imag.min(), z.real.max() + 1j * z.imag.max()
    rows = np.arange(int((high - low).imag / (step * np.sqrt(0.75))) + 2)
    columns = np.arange(-1, int((high - low).real / step) + 2)
    j, i = (a.ravel() for a in np.meshgrid(rows, columns, indexing="ij"))
    lattice = low + step * (i + 0.5 * (j % 2) + 0.25 + 1j * np.sqrt(0.75) * (j + 0.25))
    inner = lattice[shapely.contains_xy(polygon, lattice.real, lattice.imag)]
    apart = shapely.distance(polygon.exterior, shapely.points(inner.real, inner.imag))
    inner = inner[apart > CLEARANCE * step]
    middle, reach = (z + np.roll(z, -1)) / 2, np.abs(np.roll(z, -1) - z) / 2
    if len(inner):  # an edge whose diametral circle is empty is Delaunay (Gabriel, Sokal 1969)
        tree = shapely.STRtree(shapely.points(inner.real, inner.imag))
        edges = shapely.buffer(shapely.points(middle.real, middle.imag), 1.05 * reach)
        inner = np.delete(inner, np.unique(tree.query(edges, predicate="intersects")[1]))
    both = np.concatenate([z, inner])
    plane = np.stack([both.real, both.imag], axis=1)
    triangles = Delaunay(plane - plane.mean(axis=0)).simplices.astype(np.int64)
    a, b, c = (both[triangles[:, corner]] for corner in range(3))
    area = (np.conj(b - a) * (c - a)).imag
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    centre = (a + b + c) / 3
    size = np.abs(high - low)
    keep = (np.abs(area) > 1e-12 * size**2) & shapely.contains_xy(polygon, centre.real, centre.imag)
    triangles = triangles[keep]
    tail, head = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    sides = tail * len(both) + head
    wanted = np.arange(k) * len(both) + (np.arange(k) + 1) % k
    disk = len(both) - (3 * len(triangles) + k) // 2 + len(triangles) == 1
    return (inner, triangles) if disk and np.isin(wanted, sides).all() else None


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


def _spanned(z: Complexes, triangles: Ints, outline: Floats) -> Floats:
    """(p, 3) the inner points of a plane triangulation, spanned harmonically over the outline (k, 3)."""
    k = len(outline)
    if len(z) == k:
        return np.zeros((0, 3))
    laplacian = _cotangents(np.stack([z.real, z.imag, 0 * z.real], axis=1), triangles)
    return np.asarray(splu(laplacian[k:, k:].tocsc()).solve(-laplacian[k:, :k] @ outline))


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
