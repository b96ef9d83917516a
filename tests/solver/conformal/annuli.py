"""Test surfaces: grids around an axis, with known conformal maps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial import Delaunay

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.conformal.types import BoundaryAngle, BoundaryCondition
from hexwrap_solver.surface.types import Surface


def corners_at(vertices: Ints, angles: Floats, **others: Any) -> BoundaryCondition:
    """The given angles at the given sent vertices."""
    pairs = zip(np.asarray(vertices).tolist(), np.asarray(angles).tolist(), strict=True)
    return BoundaryCondition("angles", tuple(BoundaryAngle(a, vertex=v) for v, a in pairs), **others)


def annulus(vertices: Floats, faces: Ints, loops: tuple[Ints, Ints]) -> Surface:
    """A Surface of vertices that were sent in this order; normals are of no concern to the map."""
    n = len(vertices)
    return Surface(
        vertices=np.asarray(vertices, dtype=float),
        faces=np.asarray(faces, dtype=np.int64),
        loops=loops,
        input_vertex=np.arange(n),
        vertex_of_input=np.arange(n),
        normals=np.tile([0.0, 0.0, 1.0], (n, 1)),
    )


def grid(
    around: int, rows: int, place: Callable[[Floats, Floats], Floats], alternate: bool = True
) -> Surface:
    """place(φ, s) → (n, 3), φ ∈ [0, 2π) around, s ∈ [0, 1] from loop 0 to loop 1; seen with φ to the right
    and s upwards, faces run counter-clockwise. alternate: quad diagonals in turns."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(around), np.arange(rows)))
    right = (i + 1) % around
    a, b = j * around + i, j * around + right
    c, d = b + around, a + around
    flip = ((i + j) % 2 == 1) & alternate
    first = np.where(flip[:, None], np.stack([a, b, d], 1), np.stack([a, b, c], 1))
    second = np.where(flip[:, None], np.stack([b, c, d], 1), np.stack([a, c, d], 1))
    i, j = (x.ravel() for x in np.meshgrid(np.arange(around), np.arange(rows + 1)))
    vertices = place(2 * np.pi * i / around, j / rows)
    last = np.arange(around)[::-1] + rows * around
    return annulus(vertices, np.concatenate([first, second]), (np.arange(around), last))


def revolution(
    radius: Callable[[Floats], Floats], height: Callable[[Floats], Floats]
) -> Callable[..., Floats]:
    """place() of the surface of revolution with profile (radius(s), height(s))."""

    def place(phi: Floats, s: Floats) -> Floats:
        return np.stack([radius(s) * np.cos(phi), radius(s) * np.sin(phi), height(s)], axis=1)

    return place


def catenoid(around: int, rows: int, low: float = -0.5, high: float = 1.0) -> Surface:
    """r = cosh z for z ∈ [low, high]: conformal to a cylinder of height/circumference (high − low)/2π."""
    z = lambda s: low + (high - low) * s  # noqa: E731
    return grid(around, rows, revolution(lambda s: np.cosh(z(s)), z))


def uneven(phi: Floats, s: Floats) -> Floats:
    """place() of a tower of no symmetry, girth changing by more than 2:1."""
    r = 1.0 + 0.6 * s**2 + 0.15 * np.cos(3 * phi + 2 * s) + 0.2 * np.sin(4 * s) * np.cos(phi)
    return np.stack([r * np.cos(phi) + 0.3 * s, r * np.sin(phi), 2.5 * s + 0.1 * np.sin(2 * phi)], axis=1)


def bump(around: int, rows: int) -> Surface:
    """The uneven tower on a grid."""
    return grid(around, rows, uneven)


def flat_cone(around: int, rows: int, inner: float, outer: float, angle: float) -> Surface:
    """A cone of revolution with cone angle ``angle`` < 2π, slant distances between inner and outer."""
    slope = angle / (2 * np.pi)
    rho = lambda s: outer + (inner - outer) * s  # noqa: E731
    return grid(around, rows, revolution(lambda s: slope * rho(s), lambda s: -np.sqrt(1 - slope**2) * rho(s)))


def irregular(around: int, rows: int, place: Callable[[Floats, Floats], Floats], seed: int = 0) -> Surface:
    """The surface of ``grid`` on scattered points: jittered by a third of a cell and joined at random.

    Points are triangulated by Delaunay's criterion in a sheared parameter plane, so that triangles differ
    from those of the grid; three copies side by side make it periodic.
    """
    random = np.random.default_rng(seed)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(around), np.arange(rows + 1)))
    inside = (j > 0) & (j < rows)
    n = len(i)
    x = (i + random.uniform(-0.33, 0.33, n)) / around
    y = (j + inside * random.uniform(-0.33, 0.33, n)) / rows
    plane = np.stack([around * x + 0.3 * rows * y, rows * y], axis=1)
    copies = np.concatenate([plane + np.array([k * around, 0.0]) for k in (-1, 0, 1)])
    triangles = Delaunay(copies).simplices
    a, b, c = copies[triangles].transpose(1, 0, 2)
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    lowest = np.sort(triangles, axis=1)[:, 0]  # one of the three copies of each triangle starts in the middle
    mine = triangles[(lowest >= n) & (lowest < 2 * n) & (np.abs(area) > 1e-9)]
    wrapped = mine % n
    _, once = np.unique(np.sort(wrapped, axis=1), axis=0, return_index=True)
    last = np.arange(around)[::-1] + rows * around
    return annulus(place(2 * np.pi * x, y), wrapped[once], (np.arange(around), last))


def ring(outer: float = 1.0, inner: float = 0.3, apart: float = 0.5) -> Callable[[Floats, Floats], Floats]:
    """place() of the plane ring between two circles whose centres are ``apart``; loop 0 is the outer one."""

    def place(phi: Floats, s: Floats) -> Floats:
        radius, centre = outer + (inner - outer) * s, apart * s
        return np.stack([centre + radius * np.cos(phi), radius * np.sin(phi), 0 * phi], axis=1)

    return place


def prism(around: int, height: float) -> Callable[[Floats, Floats], Floats]:
    """place() of a right prism over a regular polygon of circumference 2π: a flat cylinder, if vertices
    stand on its upright edges or triangles do not reach across these."""

    def place(phi: Floats, s: Floats) -> Floats:
        radius = np.pi / around / np.sin(np.pi / around)
        return np.stack([radius * np.cos(phi), radius * np.sin(phi), height * s], axis=1)

    return place
