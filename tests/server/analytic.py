"""Solutions known in closed form, so that writers are tested without the solver: cylinders of hexagons."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.conformal.types import ConformalMap, Deck, Unrolled
from hexwrap_solver.panels.types import Panels, Quality
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.pipeline import Solution
from hexwrap_solver.surface.types import Surface

CORNERS = np.array([[2, 0], [1, 1], [-1, 1], [-2, 0], [-1, -1], [1, -1]])


def cylinder(
    around: int = 12, rings: int = 5, edge: float = 1.0, sizes: int = 3, origin: tuple[float, ...] = (0, 0, 0)
) -> Solution:
    """A round cylinder of ``around`` (even) by ``rings`` hexagons, ring r shrunk to one of the sizes."""
    turn = 1.5 * edge * around
    height = np.sqrt(3) * edge * (rings + 0.5)
    cmap = _map(turn, height, 2 * around, 2 * rings, np.asarray(origin, dtype=float))
    pattern = _pattern(around, rings, edge, turn, np.asarray(origin, dtype=float))
    panels = _panels(pattern, edge, sizes)
    gaps = np.where(pattern.neighbours.values < 0, np.nan, 0.01 * edge)
    ones = np.ones(panels.n_panels)
    quality = Quality(
        1.0, 1.0, 1.0, planarity=0 * ones, edge_deviation=0 * ones, angle_deviation=0 * ones,
        surface_distance=0.02 * ones, gap_tangential=gaps, gap_normal=gaps / 2, kink=gaps,
        convex=np.ones(panels.n_panels, dtype=bool), congruence=panels.size, coverage=0.97,
    )  # fmt: skip
    return Solution(cmap, quality, pattern, panels)


def _bend(uv: Floats, turn: float, origin: Floats) -> tuple[Floats, Floats]:
    """Unrolled positions (n, 2) → points on the cylinder and outward normals."""
    t = 2 * np.pi * uv[:, 0] / turn
    normals = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    points = normals * turn / (2 * np.pi) + np.stack([0 * t, 0 * t, uv[:, 1]], axis=1)
    return points + origin, normals


def _map(turn: float, height: float, columns: int, rows: int, origin: Floats) -> ConformalMap:
    x, y = np.meshgrid(np.arange(columns), np.arange(rows + 1))
    uv = np.stack([x.ravel() * turn / columns, y.ravel() * height / rows], axis=1)
    points, normals = _bend(uv, turn, origin)
    i, j = (c.ravel() for c in np.meshgrid(np.arange(columns), np.arange(rows)))
    a, b = j * columns + i, j * columns + (i + 1) % columns
    wraps = (i + 1) // columns
    faces = np.stack([np.stack([a, b, b + columns], 1), np.stack([a, b + columns, a + columns], 1)], 1)
    sheet = np.stack([np.stack([0 * a, wraps, wraps], 1), np.stack([0 * a, wraps, 0 * a], 1)], 1)
    n = len(uv)
    loops = np.arange(columns), n - 1 - np.arange(columns)
    identity = np.arange(n)
    surface = Surface(points, faces.reshape(-1, 3), loops, identity, identity, normals)
    angles = np.full(columns, np.pi), np.full(columns, np.pi)
    deck = Deck(0.0, complex(turn))
    return ConformalMap(
        surface, np.zeros(n), Unrolled(uv @ [1, 1j], sheet.reshape(-1, 3), deck, turn), angles, 1, 1e-14
    )


def _pattern(around: int, rings: int, edge: float, turn: float, origin: Floats) -> Pattern:
    ring, place = (c.ravel() for c in np.meshgrid(np.arange(rings), np.arange(around), indexing="ij"))
    centre = np.stack([3 * place, 2 * ring + 1 + place % 2], axis=1)
    nodes = (centre[:, None, :] + CORNERS).reshape(-1, 2)
    sheet = nodes[:, 0] // (3 * around)
    nodes[:, 0] %= 3 * around
    unique, index = np.unique(nodes, axis=0, return_inverse=True)
    uv = unique * [edge / 2, np.sqrt(3) * edge / 2]
    points, normals = _bend(uv, turn, origin)
    cells = around * rings
    across = np.stack([_across(ring, place, k, rings, around) for k in range(6)], axis=1)
    return Pattern(
        "hex", points, normals, uv @ [1, 1j], Ragged.from_table(index.reshape(cells, 6)),
        uv[index.ravel()] @ [1, 1j] + sheet * 3 * around * edge / 2, np.zeros(cells, dtype=int), sheet,
        Ragged.from_table(across), np.zeros(len(uv), dtype=int), np.full((len(uv), 3), 1 / 3),
        np.ones(cells, dtype=bool), ring, place, rings, around, 0.0, edge, 0.0,
    )  # fmt: skip


def _across(ring: Ints, place: Ints, k: int, rings: int, around: int) -> Ints:
    """The cell across edge k → k+1 of the corners above."""
    step, up = [(1, 1), (0, 2), (-1, 1), (-1, -1), (0, -2), (1, -1)][k]
    row = (2 * ring + place % 2 + up - (place + step) % around % 2) // 2
    return np.where((row >= 0) & (row < rings), row * around + (place + step) % around, -1)


def _panels(pattern: Pattern, edge: float, sizes: int) -> Panels:
    """Regular hexagons in the tangent planes, a little smaller than their cells."""
    cells = np.asarray(pattern.vertices[pattern.faces.values]).reshape(-1, 6, 3)
    centre = cells.mean(axis=1)
    normal = np.stack([centre[:, 0], centre[:, 1], 0 * centre[:, 0]], axis=1)
    normal -= np.stack([*pattern.vertices[:, :2].mean(axis=0), 0.0])
    normal[:, 2] = 0
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    size = pattern.ring % sizes
    lengths = edge * (0.9 - 0.02 * np.arange(sizes)[::-1])
    side, up = np.cross([0.0, 0.0, 1.0], normal), np.array([0.0, 0.0, 1.0])
    t = np.arange(6) * np.pi / 3
    arm = np.cos(t)[None, :, None] * side[:, None, :] + np.sin(t)[None, :, None] * up
    polygons = centre[:, None, :] + lengths[size][:, None, None] * arm
    n = len(cells)
    return Panels(
        "split", Ragged.from_table(polygons), np.arange(n), size, lengths[size], np.full(n, 0.95 * edge),
        centre, normal, np.ones(n, dtype=bool), lengths, np.bincount(size, minlength=sizes),
        np.full(sizes, 6),
    )  # fmt: skip
