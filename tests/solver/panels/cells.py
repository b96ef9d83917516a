"""Patterns and maps on surfaces whose conformal coordinates are known in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Floats, Ragged
from hexwrap_solver.conformal.types import ConformalMap, Deck, Unrolled
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.surface.types import Surface

#: (x, y) on the cylinder of circumference 2π → a point of the surface; conformal.
Chart = Callable[[Floats, Floats], Floats]


def cylinder(x: Floats, y: Floats) -> Floats:
    return np.stack([np.cos(x), np.sin(x), y], axis=-1)


def catenoid(x: Floats, y: Floats) -> Floats:
    """Negative curvature everywhere."""
    return np.stack([np.cosh(y) * np.cos(x), np.cosh(y) * np.sin(x), y], axis=-1)


def sphere(x: Floats, y: Floats) -> Floats:
    """Mercator."""
    return np.stack([np.cos(x) / np.cosh(y), np.sin(x) / np.cosh(y), np.tanh(y)], axis=-1)


def torus(x: Floats, y: Floats, ratio: float = 2.0) -> Floats:
    """A torus of radii ratio and 1; y runs around the tube, so that curvature changes its sign."""
    root = np.sqrt(ratio**2 - 1)
    angle = 2 * np.arctan2(
        np.sqrt(ratio + 1) * np.sin(root * y / 2), np.sqrt(ratio - 1) * np.cos(root * y / 2)
    )
    r = ratio + np.cos(angle)
    return np.stack([r * np.cos(x), r * np.sin(x), np.sin(angle)], axis=-1)


def inverted(chart: Chart, center: tuple[float, float, float]) -> Chart:
    """Möbius image: still conformal, no longer a surface of revolution. Reflected, to keep the outside."""

    def image(x: Floats, y: Floats) -> Floats:
        spoke = chart(x, y) - np.asarray(center)
        return spoke / (spoke**2).sum(axis=-1, keepdims=True) * np.array([1.0, 1.0, -1.0])

    return image


def normals(chart: Chart, x: Floats, y: Floats) -> Floats:
    step = 1e-5
    du = chart(x + step, y) - chart(x - step, y)
    dv = chart(x, y + step) - chart(x, y - step)
    n = np.cross(du, dv)
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


def hex_pattern(chart: Chart, around: int, rings: int, low: float = 0.0) -> Pattern:
    """Whole hexagons in staggered rings, wrapped by the chart; the lowest corner row at y = low."""
    side = 2 * np.pi / around / np.sqrt(3)
    level, place = np.meshgrid(np.arange(rings + 1), np.arange(around), indexing="ij")
    # Two rows of vertices between successive rings: lower (even) and upper (odd) end of the vertical edges.
    shift = np.pi / around * (level % 2)
    x = 2 * np.pi * place / around + shift
    lower = np.stack([x, low + 1.5 * side * level], axis=-1)
    upper = np.stack([x + np.pi / around, low + 1.5 * side * level + side / 2], axis=-1)
    grid = np.stack([lower, upper], axis=2).reshape(-1, 2)

    def index(kind: int, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        return (row * around + column % around) * 2 + kind

    row, column = np.meshgrid(np.arange(rings), np.arange(around), indexing="ij")
    row, column = row.ravel(), column.ravel()
    odd = row % 2
    # A ring's cells stand on a lower vertex of their row and end at an upper vertex of the next one.
    faces = np.stack(
        [
            index(0, row, column),
            index(1, row, column),
            index(0, row + 1, column + odd),
            index(1, row + 1, column - 1 + odd),
            index(0, row + 1, column - 1 + odd),
            index(1, row, column - 1),
        ],
        axis=1,
    )
    return assemble(chart, grid, faces, "hex", around, rings)


def quad_pattern(chart: Chart, around: int, rings: int, low: float = 0.0) -> Pattern:
    side = 2 * np.pi / around
    level, place = np.meshgrid(np.arange(rings + 1), np.arange(around), indexing="ij")
    grid = np.stack([place * side, low + level * side], axis=-1).reshape(-1, 2)
    row, column = (a.ravel() for a in np.meshgrid(np.arange(rings), np.arange(around), indexing="ij"))
    right = (column + 1) % around
    faces = np.stack(
        [
            row * around + column,
            row * around + right,
            (row + 1) * around + right,
            (row + 1) * around + column,
        ],
        1,
    )
    return assemble(chart, grid, faces, "quad", around, rings)


def brick_pattern(chart: Chart, around: int, rings: int, low: float = 0.0) -> Pattern:
    """Running bond of bricks twice as long as wide: the hexagons of ``hex_pattern`` with straight rows."""
    honeycomb = hex_pattern(cylinder, around, rings, low)
    side = 2 * np.pi / around / np.sqrt(3)
    # Both nodes of a zigzag go to the height between them; rows lie half a brick apart.
    row = np.round((honeycomb.uv.imag - low - side / 4) / (1.5 * side))
    grid = np.stack([honeycomb.uv.real, low + np.pi / around * row], axis=-1)
    return assemble(chart, grid, honeycomb.faces, "brick", around, rings)


def triangle_pattern(chart: Chart, around: int, rings: int, low: float = 0.0) -> Pattern:
    side = 2 * np.pi / around
    level, place = np.meshgrid(np.arange(rings + 1), np.arange(around), indexing="ij")
    grid = np.stack(
        [place * side + level % 2 * side / 2, low + level * side * np.sqrt(3) / 2], axis=-1
    ).reshape(-1, 2)
    row, column = (a.ravel() for a in np.meshgrid(np.arange(rings), np.arange(around), indexing="ij"))
    at = lambda r, c: r * around + c % around  # noqa: E731
    odd = row % 2
    up = np.stack([at(row, column), at(row, column + 1), at(row + 1, column + odd)], axis=1)
    down = np.stack([at(row + 1, column + odd), at(row, column + 1), at(row + 1, column + 1 + odd)], axis=1)
    return assemble(chart, grid, np.stack([up, down], axis=1).reshape(-1, 3), "triangle", around, rings)


def trihexagonal_pattern(chart: Chart, around: int, rings: int, low: float = 0.0) -> Pattern:
    """3.6.3.6: the hexagons of ``hex_pattern`` shrunk to the midpoints of their edges, and a triangle at each
    of their inner nodes."""
    honeycomb = hex_pattern(cylinder, around, rings, low)
    faces = honeycomb.faces.values.reshape(-1, 6)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    edge, index = np.unique(np.sort(np.stack([start, end], 1), axis=1), axis=0, return_inverse=True)
    here, there = honeycomb.uv[edge].T
    there = there + 2 * np.pi * np.round((here - there).real / (2 * np.pi))
    grid = np.stack([((here + there) / 2).real, here.imag / 2 + there.imag / 2], axis=-1)
    hexagons = index.reshape(-1, 6)
    # From one edge at a node to the next one to its left, across the cell between them.
    left: dict[int, dict[int, int]] = {}
    for cell, corner in zip(hexagons.tolist(), faces.tolist(), strict=True):
        for k in range(6):
            left.setdefault(corner[k], {})[cell[k]] = cell[k - 1]
    loops = [[a, turn[a], turn[turn[a]]] for turn in left.values() if len(turn) == 3 for a in turn]
    triangles = [loop for loop in loops if _leftmost(grid, loop)]  # alike all around
    values = np.concatenate([hexagons.ravel(), np.array(triangles).ravel()])
    count = np.repeat([6, 3], [len(hexagons), len(triangles)])
    cells = Ragged(values, np.concatenate([[0], np.cumsum(count)]))
    pattern = assemble(chart, grid, cells, "hex", around, rings)
    height = np.add.reduceat(grid[values, 1], cells.offsets[:-1]) / count
    return replace(pattern, ring=np.unique(height.round(6), return_inverse=True)[1])


def _leftmost(grid: Floats, loop: list[int]) -> bool:
    """Whether a triangle on the cylinder begins at its left corner."""
    ahead = (grid[loop, 0] - grid[loop[0], 0] + np.pi) % (2 * np.pi) - np.pi
    return bool((ahead > -1e-9).all())


def assemble(
    chart: Chart, grid: Floats, faces: np.ndarray | Ragged, kind: str, around: int, rings: int
) -> Pattern:
    cells = faces if isinstance(faces, Ragged) else Ragged.from_table(faces.astype(np.int64))
    start, end = cells.values, cells.values[cells.next()]
    owner = {(int(a), int(b)): f for a, b, f in zip(start, end, cells.row, strict=True)}
    across = np.array([owner.get((int(b), int(a)), -1) for a, b in zip(start, end, strict=True)])
    points = chart(grid[:, 0], grid[:, 1])
    n = len(grid)
    n_cells = cells.n_rows
    per_ring = -(-n_cells // rings)
    edge = np.linalg.norm(points[start] - points[end], axis=1).mean()
    return Pattern(
        kind=kind,  # type: ignore[arg-type]
        vertices=points,
        normals=normals(chart, grid[:, 0], grid[:, 1]),
        uv=grid[:, 0] + 1j * grid[:, 1],
        faces=cells,
        corners=(grid[:, 0] + 1j * grid[:, 1])[start],
        index=np.zeros(n_cells, dtype=np.int64),
        sheet=np.zeros(len(start), dtype=np.int64),
        neighbours=Ragged(across, cells.offsets),
        triangle=np.zeros(n, dtype=np.int64),
        barycentric=np.tile([1.0, 0.0, 0.0], (n, 1)),
        whole=np.ones(n_cells, dtype=bool),
        ring=np.arange(n_cells) // per_ring,
        place=np.arange(n_cells) % per_ring,
        rings=rings,
        around=around,
        rotation=0.0,
        edge_length=float(edge),
        distortion=0.0,
    )


def grid_map(chart: Chart, columns: int, rows: int, low: float, high: float) -> ConformalMap:
    """The exact map of the surface's triangulated grid to the cylinder of circumference 2π."""
    y, x = np.meshgrid(
        np.linspace(low, high, rows + 1), 2 * np.pi * np.arange(columns) / columns, indexing="ij"
    )
    row, column = (a.ravel() for a in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    right = (column + 1) % columns
    wrap = (right == 0).astype(np.int64)
    a, b = row * columns + column, row * columns + right
    c, d = b + columns, a + columns
    zero = np.zeros_like(wrap)
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    sheet = np.concatenate([np.stack([zero, wrap, wrap], 1), np.stack([zero, wrap, zero], 1)])
    x, y = x.ravel(), y.ravel()
    n = len(x)
    step = 1e-5
    scale = np.linalg.norm(chart(x + step, y) - chart(x - step, y), axis=1) / (2 * step)
    surface = Surface(
        vertices=chart(x, y),
        faces=faces,
        loops=(np.arange(columns), np.arange(n - columns, n)[::-1].copy()),
        input_vertex=np.arange(n),
        vertex_of_input=np.arange(n),
        normals=normals(chart, x, y),
    )
    straight = np.full(columns, np.pi)
    return ConformalMap(
        surface=surface,
        log_scale=-np.log(scale),
        domain=Unrolled(x + 1j * y, sheet, Deck(0.0, 2 * np.pi + 0j), 2 * np.pi),
        boundary_angles=(straight, straight),
        iterations=0,
        residual=0.0,
    )
