"""Surfaces that are no annuli, and their maps: disks, rings with openings, closed ones with singularities."""

from __future__ import annotations

from functools import cache

import numpy as np

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import (
    BoundaryAngle,
    BoundaryCondition,
    Cones,
    ConformalMap,
    LoopCondition,
)
from hexwrap_solver.surface import surface_from_mesh, with_openings
from hexwrap_solver.surface.holes import fill_openings
from hexwrap_solver.surface.types import SentMesh, Surface

QUANTUM = {"hex": np.pi / 3, "triangle": np.pi / 3, "quad": np.pi / 2}


def surface(points: np.ndarray, faces: np.ndarray) -> Surface:
    return surface_from_mesh(SentMesh(np.asarray(points, dtype=float), Ragged.from_table(faces)))


def nearest(found: Surface, places: np.ndarray) -> np.ndarray:
    """Vertices nearest to places (k, 3)."""
    away = np.linalg.norm(found.vertices[None] - np.asarray(places, dtype=float)[:, None], axis=2)
    return away.argmin(axis=1)


def _quads(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


@cache
def roof() -> ConformalMap:
    """A rectangular roof, 30 by 20, mapped to a rectangle."""
    n, m = 24, 16
    x, y = (t.ravel() for t in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1)))
    points = np.stack([30 * x, 20 * y, 3 * np.sin(np.pi * x) * np.sin(np.pi * y)], axis=1)
    i, j = (t.ravel() for t in np.meshgrid(np.arange(n), np.arange(m)))
    a = i + (n + 1) * j
    found = surface(points, _quads(a, a + 1, a + n + 2, a + n + 1))
    corners = nearest(found, points[[0, n, n + (n + 1) * m, (n + 1) * m]])
    right = tuple(BoundaryAngle(np.pi / 2, vertex=int(v)) for v in found.input_vertex[corners])
    return conformal_map(found, BoundaryCondition("angles", right))


def dome_surface(rings: int = 18) -> Surface:
    """A paraboloid over a disk of radius 10, rings of 6k vertices."""
    points, start = [np.zeros((1, 2))], [0, 1]
    for r in range(1, rings + 1):
        angle = 2 * np.pi * np.arange(6 * r) / (6 * r)
        points.append(r / rings * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        start.append(start[-1] + 6 * r)
    faces = []
    for r in range(1, rings + 1):
        outer, inner = 6 * r, max(6 * (r - 1), 1)
        for sector in range(6):
            for k in range(r):
                at = start[r] + (sector * r + k)
                end = start[r] + (sector * r + k + 1) % outer
                below = start[r - 1] + (sector * (r - 1) + k) % inner
                faces.append((at, end, below))
                if k < r - 1:
                    faces.append((below, end, start[r - 1] + (sector * (r - 1) + k + 1) % inner))
    xy = np.concatenate(points)
    height = 6 * (1 - (xy**2).sum(axis=1))
    return surface(np.column_stack([10 * xy, height]), np.array(faces))


@cache
def dome(cones: tuple[tuple[float, float, int], ...] = (), kind: str = "hex") -> ConformalMap:
    """With singularities at (x, y, index)."""
    found = dome_surface()
    table = np.array(cones, dtype=float).reshape(-1, 3)
    xy = table[:, :2]
    places = np.column_stack([xy, 6 * (1 - (xy**2).sum(axis=1) / 100)])
    singular = Cones.at(nearest(found, places), table[:, 2].astype(np.int64), QUANTUM[kind])
    return conformal_map(found, BoundaryCondition("isometric", quantum=kind), cones=singular)


@cache
def tower(holes: int, kind: str = "hex", wide: int = 4) -> ConformalMap:
    """A tower with openings, each a boundary loop of its own; every loop isometric."""
    n, m = 48, 26
    turn, z = 2 * np.pi * np.arange(n) / n, np.linspace(0, 30, m + 1)
    radius = 8 + 1.5 * np.sin(z / 7)
    points = np.stack(
        [np.outer(radius, np.cos(turn)), np.outer(radius, np.sin(turn)), np.outer(z, np.ones(n))], axis=-1
    ).reshape(-1, 3)
    i, j = (t.ravel() for t in np.meshgrid(np.arange(n), np.arange(m)))
    keep = np.ones(len(i), dtype=bool)
    for a, b in [(6, 7), (22, 14), (36, 9)][:holes]:
        keep &= ~((i >= a) & (i < a + wide) & (j >= b) & (j < b + wide))
    i, j = i[keep], j[keep]
    a, b = i + n * j, (i + 1) % n + n * j
    found = surface(points, _quads(a, b, b + n, a + n))
    return conformal_map(found, BoundaryCondition("isometric", quantum=kind))


@cache
def straightened(holes: int, loops: tuple[int, ...], kind: str) -> ConformalMap:
    """A tower with openings; some loops, openings too, are closed straight lines, the others isometric."""
    straight = tuple(LoopCondition("straight", loop=loop) for loop in loops)
    condition = BoundaryCondition("isometric", quantum=kind, loops=straight)
    return conformal_map(tower(holes, wide=8).surface, condition)


@cache
def doors(count: int) -> ConformalMap:
    """A tower whose foot is straight, with rectangular doors: four corners of 270° each."""
    found = tower(count).surface
    conditions = [LoopCondition("straight", loop=0)]
    for b in range(2, 2 + count):
        points = found.vertices[found.loops[b]]
        turn, up = np.unwrap(np.arctan2(points[:, 1], points[:, 0])), points[:, 2]
        extreme = [abs(x - (x.min() + x.max()) / 2) > 0.499 * np.ptp(x) for x in (turn, up)]
        ends = found.input_vertex[found.loops[b][extreme[0] & extreme[1]]]
        corners = tuple(BoundaryAngle(1.5 * np.pi, vertex=int(v)) for v in ends)
        assert len(corners) == 4
        conditions.append(LoopCondition("angles", loop=b, angles=corners))
    return conformal_map(found, BoundaryCondition("isometric", quantum="quad", loops=tuple(conditions)))


@cache
def ellipsoid(kind: str) -> ConformalMap:
    """Closed, with singularities at the 12 corners of an icosahedron, of quads at the 8 of a cube."""
    golden = (1 + 5**0.5) / 2
    ico = np.array([[0, s, t * golden] for s in (-1, 1) for t in (-1, 1)], dtype=float)
    ico = np.concatenate([np.roll(ico, k, axis=1) for k in range(3)])
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    octahedron = np.concatenate([np.eye(3), -np.eye(3)])
    faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    faces = np.array(faces)
    points = octahedron
    for _ in range(4):
        ends = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        edge, which = np.unique(ends, axis=0, return_inverse=True)
        ab, bc, ca = len(points) + which.ravel().reshape(3, -1)
        points = np.concatenate([points, points[edge].mean(axis=1)])
        a, b, c = faces.T
        faces = np.concatenate(
            [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    found = surface(points * [10, 10, 8], faces)
    corners = cube if kind == "quad" else ico
    places = corners / np.linalg.norm(corners, axis=1, keepdims=True) * [10, 10, 8]
    cones = Cones.at(nearest(found, places), np.ones(len(places), dtype=np.int64), QUANTUM[kind])
    return conformal_map(found, BoundaryCondition("isometric", quantum=kind), cones=cones)


@cache
def cut_tower(holes: int = 3, wide: int = 4) -> ConformalMap:
    """A tower whose windows are filled, mapped as wall and cut out again; a straight cylinder."""
    found = with_openings(tower(holes, wide=wide).surface, "cut")
    return conformal_map(found, BoundaryCondition("straight"))


@cache
def filled_tower(holes: int = 3) -> ConformalMap:
    """The same without windows, on the same filling."""
    found = fill_openings(with_openings(tower(holes).surface, "cut"))
    return conformal_map(found, BoundaryCondition("straight"))
