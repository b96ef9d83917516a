"""Boundary representations with known geometry, made from plain arrays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import make_interp_spline

from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface import NurbsSurface
from hexwrap_solver.surface.brep import Brep, Edge, Face, NurbsCurve, Trim

Curve = Callable[[Floats], Floats]
Shape = Callable[[Floats, Floats], Floats]


def line(a: Floats, b: Floats) -> NurbsCurve:
    net = np.ones((2, 4))
    net[:, :3] = a, b
    return NurbsCurve(1, np.array([0.0, 0, 1, 1]), net)


def fitted_curve(curve: Curve, n: int = 40) -> NurbsCurve:
    """A cubic through n points of a curve over [0, 1]."""
    t = np.linspace(0, 1, n)
    spline = make_interp_spline(t, curve(t), 3)
    return NurbsCurve(3, spline.t, np.column_stack([spline.c, np.ones(n)]))


def fitted_surface(
    shape: Shape, u: tuple[float, float], v: tuple[float, float], n: tuple[int, int] = (24, 24)
) -> NurbsSurface:
    """A bicubic surface through a grid of points of a shape."""
    s, t = np.linspace(*u, n[0]), np.linspace(*v, n[1])
    points = shape(*np.meshgrid(s, t, indexing="ij"))
    one = make_interp_spline(s, points, 3)
    two = make_interp_spline(t, np.moveaxis(one.c, 1, 0), 3)
    net = np.concatenate([np.moveaxis(two.c, 0, 1), np.ones((*n, 1))], axis=2)
    return NurbsSurface((3, 3), (one.t, two.t), net, (False, False))


def bilinear(corners: Floats) -> NurbsSurface:
    """(2, 2, 3) corners."""
    net = np.concatenate([np.asarray(corners, dtype=float), np.ones((2, 2, 1))], axis=2)
    knots = np.array([0.0, 0, 1, 1])
    return NurbsSurface((1, 1), (knots, knots), net, (False, False))


def box(size: tuple[float, float, float] = (12, 9, 30), caps: bool = True) -> Brep:
    """Four walls, and a floor and a roof; outside out."""
    x, y, z = size
    corner = np.array([(a, b, c) for c in (0, z) for a, b in ((0, 0), (x, 0), (x, y), (0, y))], dtype=float)
    ends = [(k, (k + 1) % 4) for k in range(4)]
    ends += [(4 + a, 4 + b) for a, b in ends] + [(k, k + 4) for k in range(4)]
    edges = tuple(Edge(line(corner[a], corner[b]), (0.0, 1.0), a, b) for a, b in ends)
    faces = []
    for k in range(4):
        a, b = ends[k]
        surface = bilinear([[corner[a], corner[a + 4]], [corner[b], corner[b + 4]]])
        loop = (
            Trim(k, False, a, b),
            Trim(8 + b, False, b, b + 4),
            Trim(4 + k, True, b + 4, a + 4),
            Trim(8 + a, True, a + 4, a),
        )
        faces.append(Face(surface, (loop,), False))
    if caps:
        for k, flipped in ((0, True), (4, False)):
            a, b, c, d = corner[k : k + 4]
            loop = tuple(Trim(k + i, False, k + i, k + (i + 1) % 4) for i in range(4))
            faces.append(Face(bilinear([[a, d], [b, c]]), (loop,), flipped))
    return Brep(corner, edges, tuple(faces), 1e-3)


def tower_shape(angle: Floats, z: Floats) -> Floats:
    """A waisted, twisted tube of eight soft corners; z from 0 to 1 over 60 units."""
    turned = angle + 0.4 * z
    r = 14 + 3 * np.cos(2 * np.pi * z) + 0.6 * np.cos(8 * turned)
    return np.stack([r * np.cos(turned), r * np.sin(turned), 60 * z], axis=-1)


def trimmed_tower(faces: int = 8, windows: bool = True) -> Brep:
    """Faces of surfaces larger than they, cut along wavy verticals, at a slanted top and around windows."""

    def side(k: int) -> Curve:
        return lambda t: tower_shape(
            2 * np.pi * k / faces + 0.04 * np.sin(5 * t + k), t * (0.9 + 0.05 * np.sin(2 * np.pi * k / faces))
        )

    def top(k: int) -> Curve:
        start, end = (2 * np.pi * j / faces + 0.04 * np.sin(5 + j % faces) for j in (k, k + 1))

        def curve(t: Floats) -> Floats:
            angle = start + (end - start) * t
            a, b = (0.9 + 0.05 * np.sin(2 * np.pi * j / faces) for j in (k, k + 1))
            return tower_shape(angle, a + (b - a) * t)

        return curve

    def bottom(k: int) -> Curve:
        start, end = (2 * np.pi * j / faces + 0.04 * np.sin(j % faces) for j in (k, k + 1))
        return lambda t: tower_shape(start + (end - start) * t, 0 * t)

    def window(k: int) -> Curve:
        middle = 2 * np.pi * (k + 0.5) / faces
        return lambda t: tower_shape(
            middle + 0.15 * np.cos(2 * np.pi * t), 0.5 + 0.08 * np.sin(-2 * np.pi * t)
        )

    points: list[Floats] = []
    for k in range(faces):
        points += [bottom(k)(np.zeros(1))[0], top(k)(np.zeros(1))[0]]
    edges: list[Edge] = []
    for k in range(faces):
        j = (k + 1) % faces
        edges += [
            Edge(fitted_curve(side(k)), (0.0, 1.0), 2 * k, 2 * k + 1),
            Edge(fitted_curve(bottom(k)), (0.0, 1.0), 2 * k, 2 * j),
            Edge(fitted_curve(top(k)), (0.0, 1.0), 2 * k + 1, 2 * j + 1),
        ]
    made = []
    for k in range(faces):
        j = (k + 1) % faces
        loops = [
            (
                Trim(3 * k + 1, False, 2 * k, 2 * j),
                Trim(3 * j, False, 2 * j, 2 * j + 1),
                Trim(3 * k + 2, True, 2 * j + 1, 2 * k + 1),
                Trim(3 * k, True, 2 * k + 1, 2 * k),
            )
        ]
        if windows:
            vertex = len(points)
            points.append(window(k)(np.zeros(1))[0])
            edges.append(Edge(fitted_curve(window(k)), (0.0, 1.0), vertex, vertex))
            loops.append((Trim(len(edges) - 1, False, vertex, vertex),))
        step = 2 * np.pi / faces
        surface = fitted_surface(tower_shape, (k * step - 0.1, (k + 1) * step + 0.1), (-0.05, 1.02), (20, 40))
        made.append(Face(surface, tuple(loops), False))
    return Brep(np.array(points), tuple(edges), tuple(made), 1e-2)
