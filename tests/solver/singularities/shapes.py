"""Small surfaces with curvature: a tube with a waist, a dome, a closed ellipsoid, a straight tube."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.surface.topology import boundary_loops, twins, vertex_normals
from hexwrap_solver.surface.types import Surface


def surface_of(vertices: Floats, faces: Ints) -> Surface:
    """Whatever its topology; unused vertices left out."""
    used = np.unique(faces)
    new = np.full(len(vertices), -1)
    new[used] = np.arange(len(used))
    vertices, faces = vertices[used], new[faces]
    n = len(vertices)
    twin = twins(faces, n)
    loops = boundary_loops(faces, twin) if (twin < 0).any() else []
    return Surface(vertices, faces, tuple(loops), np.arange(n), np.arange(n), vertex_normals(vertices, faces))


def tube(radius: Floats, height: float, around: int = 40) -> Surface:
    """Of revolution, rings of these radii; every second ring is turned by half a step."""
    rows = len(radius)
    turn = (np.arange(around) + 0.5 * (np.arange(rows) % 2)[:, None]) / around * 2 * np.pi
    z = np.broadcast_to(np.linspace(0, height, rows)[:, None], turn.shape)
    vertices = np.stack([radius[:, None] * np.cos(turn), radius[:, None] * np.sin(turn), z], axis=2)
    number = np.arange(rows * around).reshape(rows, around)
    faces = []
    for i in range(rows - 1):
        low, high = number[i], number[i + 1]
        low_next, high_next = np.roll(low, -1), np.roll(high, -1)
        if i % 2:
            faces += [np.stack([low, low_next, high_next], 1), np.stack([low, high_next, high], 1)]
        else:
            faces += [np.stack([low, low_next, high], 1), np.stack([low_next, high_next, high], 1)]
    return surface_of(vertices.reshape(-1, 3), np.concatenate(faces))


def waist(rows: int = 31, around: int = 40) -> Surface:
    """Three times as wide at its ends as in the middle."""
    x = np.linspace(-1, 1, rows)
    return tube(np.sqrt(1 + 8 * x**2), 7.0, around)


def straight() -> Surface:
    return tube(np.ones(17), 4.0)


def gherkin() -> Surface:
    """Open below, pointed above."""
    t = np.linspace(0.12, 1, 24)
    below = tube(6 * np.sin(np.pi * t[:-1]), 25 * (t[-2] - t[0]), 30)
    tip, rim = len(below.vertices), np.arange(22 * 30, 23 * 30)
    fan = np.stack([rim, np.roll(rim, -1), np.full(30, tip)], axis=1)
    apex = [[0, 0, 25 * (t[-1] - t[0])]]
    return surface_of(np.concatenate([below.vertices, apex]), np.concatenate([below.faces, fan]))


def slivers() -> Surface:
    """The waist, its vertices shifted along the rings until many triangles are nearly flat."""
    regular = waist()
    x, y, z = regular.vertices.T
    turn = np.arctan2(y, x) + 0.11 * np.random.default_rng(1).uniform(-1, 1, len(x))
    height = z + 0.1 * np.random.default_rng(2).uniform(-1, 1, len(x)) * ((z > 0.01) & (z < 6.99))
    radius = np.hypot(x, y)
    return surface_of(np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1), regular.faces)


def ellipsoid(n: int = 1200, radius: float = 1.0) -> Surface:
    """Closed, 4 : 2.8 : 2, the least radius given: points of a spiral and their convex hull."""
    i = np.arange(n) + 0.5
    fall, turn = np.arccos(1 - 2 * i / n), np.pi * (1 + 5**0.5) * i
    points = np.stack([np.cos(turn) * np.sin(fall), np.sin(turn) * np.sin(fall), np.cos(fall)], axis=1)
    faces = ConvexHull(points).simplices.astype(np.int64)
    a, b, c = (points[corner] for corner in faces.T)
    inward = (np.cross(b - a, c - a) * (a + b + c)).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return surface_of(radius * points * [2.0, 1.4, 1.0], faces)


def dome(n: int = 1800) -> Surface:
    whole = ellipsoid(n)
    low = (whole.vertices[whole.faces][:, :, 2] > 0.05).all(axis=1)
    return surface_of(whole.vertices, whole.faces[low])


def renumbered(surface: Surface, seed: int) -> tuple[Surface, Ints]:
    """The same surface in another order, and the new number of each vertex."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(surface.vertices))
    new = np.argsort(order)
    faces = new[surface.faces][rng.permutation(len(surface.faces))]
    return surface_of(surface.vertices[order], faces), new


def setbacks(sizes: list[tuple[float, float]], heights: list[float]) -> Surface:
    """Boxes without floor and roof on top of each other, with ledges between them: rectangles joined in turn
    by walls and by ledges, each side by two triangles."""
    rings, low = [], 0.0
    for (a, b), height in zip(sizes, heights, strict=True):
        rings += [(a, b, low), (a, b, low + height)]
        low += height
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    vertices = [np.column_stack([corner * (a, b), np.full(4, z)]) for a, b, z in rings]
    k = np.arange(4)
    side = np.stack([k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4], axis=1)
    quads = np.concatenate([side + 4 * i for i in range(len(rings) - 1)])
    return surface_of(np.concatenate(vertices), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
