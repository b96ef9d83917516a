"""Surfaces whose conformal map is known in closed form, for tests of what comes after the map."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.conformal.types import ConformalMap, Deck, Unrolled
from hexwrap_solver.surface.types import Surface


def grid_annulus(around: int, along: int, cut: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Faces (m, 3) and sheets (m, 3) of a grid that closes after ``around`` columns, ``along`` + 1 rows.

    Vertex (i, j) is number j·around + i. cut: the column at which the sheet is torn. Diagonals alternate.
    """
    i, j = np.meshgrid(np.arange(around), np.arange(along), indexing="xy")
    i, j = i.ravel(), j.ravel()
    quad = np.stack([i + around * j, (i + 1) % around + around * j], axis=1)
    quad = np.concatenate([quad, quad[:, ::-1] + around], axis=1)
    last = (i == around - 1).astype(int)
    sheet = np.stack([0 * last, last, last, 0 * last], axis=1)
    one, other = [[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]
    even = ((i + j) % 2 == 0)[:, None, None]
    faces = np.where(even, quad[:, one], quad[:, other]).reshape(-1, 3)
    sheets = np.where(even, sheet[:, one], sheet[:, other]).reshape(-1, 3)
    if cut:  # vertices before the cut column move one sheet on
        ahead = np.tile(np.arange(around) < cut, along + 1).astype(int)
        sheets = sheets - ahead[faces]
    return faces, sheets


def make_map(points, faces, sheet, uv, deck, around, log_scale=None) -> ConformalMap:  # type: ignore[no-untyped-def]
    """A ConformalMap over given positions; loops of a grid annulus."""
    n = len(points)
    loops = (np.arange(around), np.arange(n - 1, n - 1 - around, -1))
    normals = np.zeros_like(points)
    a, b, c = np.moveaxis(points[faces], 1, 0)
    cross = np.cross(b - a, c - a)
    for k in range(3):
        np.add.at(normals, faces[:, k], cross)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ids = np.arange(n)
    surface = Surface(points, faces, loops, ids, ids, normals)
    corners = deck.apply(uv[faces], sheet)
    angle = np.zeros(n)
    for k in range(3):
        p, q, r = corners[:, k], corners[:, (k + 1) % 3], corners[:, (k + 2) % 3]
        np.add.at(angle, faces[:, k], np.angle((r - p) / (q - p)))
    if abs(deck.angle) < 1e-9:
        circumference = abs(deck.translation)
    else:
        apex = deck.apex if deck.apex is not None else 0
        distance = [abs(uv[loop] - apex).mean() for loop in loops]
        circumference = abs(deck.angle) * float(np.sqrt(distance[0] * distance[1]))
    return ConformalMap(
        surface=surface,
        log_scale=np.zeros(n) if log_scale is None else log_scale,
        domain=Unrolled(uv, sheet, deck, circumference),
        boundary_angles=(angle[loops[0]], angle[loops[1]]),
        iterations=0,
        residual=0.0,
    )


def revolution(profile, heights, around: int, cut: int = 0, turn: complex = 1.0) -> ConformalMap:  # type: ignore[no-untyped-def]
    """Surface of revolution r = profile(z) with its exact conformal coordinates on the cylinder 2π.

    turn: a similarity applied to the layout, which must change nothing.
    """
    r = profile(heights)
    fine = np.linspace(heights[0], heights[-1], 20001)
    speed = np.sqrt(1 + np.gradient(profile(fine), fine) ** 2) / profile(fine)
    grown = np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(fine))])
    y = np.interp(heights, fine, grown)
    theta = 2 * np.pi * np.arange(around) / around
    points = np.stack(
        [np.outer(r, np.cos(theta)), np.outer(r, np.sin(theta)), np.outer(heights, np.ones(around))], axis=-1
    ).reshape(-1, 3)
    uv = (theta[None, :] + 1j * y[:, None]).ravel()
    faces, sheet = grid_annulus(around, len(heights) - 1, cut)
    if cut:
        uv = uv + 2 * np.pi * np.tile(np.arange(around) < cut, len(heights))
    deck = Deck(0.0, complex(2 * np.pi * turn))
    u = np.repeat(-np.log(r), around)
    return make_map(points, faces, sheet, uv * turn, deck, around, u)


def flat_cone(
    angle: float, inner: float, outer: float, around: int, along: int, cut: int = 0
) -> ConformalMap:
    """A flat cone of total angle |angle| between two distances from its apex, mapped to itself.

    For |angle| < 2π a cone of revolution in space; beyond that the points are the unrolled ones, lifted by
    the turn (an isometric copy only locally), which is all that patterns need.
    """
    total = abs(angle)
    radius = np.geomspace(outer, inner, along + 1) if angle > 0 else np.geomspace(inner, outer, along + 1)
    phi = np.arange(around) / around
    sign = 1.0 if angle > 0 else -1.0
    uv = (radius[:, None] * np.exp(1j * angle * phi)[None, :]).ravel()
    slope = min(total / (2 * np.pi), 1.0)
    height = np.sqrt(max(0.0, 1 - slope**2))
    theta = 2 * np.pi * phi
    points = np.stack(
        [
            np.outer(radius * slope, np.cos(theta)),
            np.outer(radius * slope, np.sin(theta)),
            np.outer(-sign * radius * height, np.ones(around)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    faces, sheet = grid_annulus(around, along, cut)
    deck = Deck(angle, 0j)
    if cut:
        ahead = np.tile(np.arange(around) < cut, along + 1).astype(int)
        uv = deck.apply(uv, ahead)
    return make_map(points, faces, sheet, uv, deck, around)
