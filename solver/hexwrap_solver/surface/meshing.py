"""Triangle mesh of a closed NURBS surface (paper, Figure 2)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.surface.nurbs import Jet, domain, evaluate
from hexwrap_solver.surface.topology import boundary_loops, twins
from hexwrap_solver.surface.types import MeshSettings, NurbsSurface, Surface

#: Samples per direction from which lengths are measured.
SAMPLES = 192
DEFAULT_VERTICES = 6000


def surface_from_nurbs(nurbs: NurbsSurface, settings: MeshSettings | None = None) -> Surface:
    """Mesh a NURBS surface that is closed in one direction and open in the other."""
    settings = settings or MeshSettings()
    around = 0 if nurbs.closed[0] else 1
    t, s, points = _sample(nurbs, around)
    girth = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    rise = np.linalg.norm(np.diff(points, axis=0), axis=2)
    area = float((rise.mean(axis=1) * (girth[1:] + girth[:-1]) / 2).sum())
    h = settings.max_edge or np.sqrt(area / DEFAULT_VERTICES * 2 / np.sqrt(3))
    n = max(3, int(np.ceil(girth.max() / h)))
    m = max(1, int(np.ceil(rise.max(axis=1).sum() / (h * np.sqrt(3) / 2))))
    heights = _even(t, rise.mean(axis=1), m + 1)
    parameters = _rows(nurbs, around, heights, s, n)
    jet = evaluate(nurbs, parameters)
    faces = _staggered(m, n)
    return _finish(nurbs, jet, parameters, faces)


def _sample(nurbs: NurbsSurface, around: int) -> tuple[Floats, Floats, Floats]:
    t = np.linspace(*domain(nurbs, 1 - around), SAMPLES)
    s = np.linspace(*domain(nurbs, around), SAMPLES)
    grid = np.stack(np.meshgrid(s, t), axis=2).reshape(-1, 2)
    points = evaluate(nurbs, grid if around == 0 else grid[:, ::-1]).point
    return t, s, points.reshape(SAMPLES, SAMPLES, 3)


def _even(x: Floats, weights: Floats, k: int) -> Floats:
    """k values between the first and last x that divide the length measured by weights evenly."""
    length = np.concatenate([[0.0], np.cumsum(weights)])
    return np.interp(np.linspace(0, length[-1], k), length, x)


def _rows(nurbs: NurbsSurface, around: int, heights: Floats, s: Floats, n: int) -> Floats:
    """(rows·n, 2) parameters, each row evenly divided by arc length, every second one half a step ahead."""
    grid = np.stack(np.meshgrid(s, heights), axis=2).reshape(-1, 2)
    points = evaluate(nurbs, grid if around == 0 else grid[:, ::-1]).point.reshape(len(heights), len(s), 3)
    length = np.linalg.norm(np.diff(points, axis=1), axis=2)
    out = np.zeros((len(heights), n, 2))
    for i in range(len(heights)):
        total = np.concatenate([[0.0], np.cumsum(length[i])])
        out[i, :, 0] = np.interp((np.arange(n) + (i % 2) / 2) / n * total[-1], total, s)
    out[..., 1] = heights[:, None]
    flat = out.reshape(-1, 2)
    return flat if around == 0 else flat[:, ::-1]


def _staggered(m: int, n: int) -> Ints:
    """Triangles between m + 1 rows of n vertices, every second row half a step ahead."""
    i, j = np.divmod(np.arange(m * n), n)
    a, b = i * n + j, i * n + (j + 1) % n
    c, d = a + n, (i + 1) * n + (j + 1) % n
    odd = i % 2 == 1
    one = np.stack([a, b, np.where(odd, d, c)], axis=1)
    two = np.stack([np.where(odd, a, b), d, c], axis=1)
    return np.concatenate([one, two])


def _finish(nurbs: NurbsSurface, jet: Jet, parameters: Floats, faces: Ints) -> Surface:
    if not nurbs.closed[0]:  # u × v shall point outward in the sense of the surface's own normal
        faces = faces[:, ::-1]
    n = len(parameters)
    first, second = boundary_loops(faces, twins(faces, n))
    index = np.arange(n, dtype=np.int64)
    surface = Surface(jet.point, faces, (first, second), index, index, jet.normal)
    return replace(surface, nurbs=nurbs, parameters=parameters)
