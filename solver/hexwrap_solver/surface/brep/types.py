"""Boundary representation of a surface as plain data: faces trimmed by loops of shared edges."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface.types import NurbsSurface, SentMesh, premultiplied


@dataclass(frozen=True)
class NurbsCurve:
    """Rational B-spline curve with its *full* knot vector.

    knots: (n + degree + 1,). control_points: (n, 4) as (x, y, z, w), coordinates not premultiplied.
    """

    degree: int
    knots: Floats
    control_points: Floats

    @property
    def domain(self) -> tuple[float, float]:
        return float(self.knots[self.degree]), float(self.knots[len(self.knots) - 1 - self.degree])

    @cached_property
    def spline(self) -> scipy.interpolate.BSpline:
        """Of homogeneous coordinates (x·w, y·w, z·w, w)."""
        return scipy.interpolate.BSpline(self.knots, premultiplied(self.control_points), self.degree)


@dataclass(frozen=True)
class Edge:
    """The part of a curve between two parameters, low < high; it runs from vertex start to vertex end."""

    curve: NurbsCurve
    interval: tuple[float, float]
    start: int
    end: int


@dataclass(frozen=True)
class Trim:
    """One side of a face: an edge, run through backwards where reversed.

    edge: −1 where the surface shrinks to a point (a pole), which is the vertex start and end.
    """

    edge: int
    reversed: bool
    start: int
    end: int


@dataclass(frozen=True)
class Face:
    """A NURBS surface inside its loops of trims.

    loops: each closed, with the face on its left in the parameters' plane; the outer one first.
    reversed: whether the outside is opposite to ∂u × ∂v. render: a mesh of the face that came with it, its
    faces looking outwards; only used where we cannot make one.
    """

    surface: NurbsSurface
    loops: tuple[tuple[Trim, ...], ...]
    reversed: bool
    render: SentMesh | None = None


@dataclass(frozen=True)
class Brep:
    """vertices: (n, 3). tolerance: how far edges and vertices may be from their surfaces, model units."""

    vertices: Floats
    edges: tuple[Edge, ...]
    faces: tuple[Face, ...]
    tolerance: float

    def transformed(self, matrix: Floats) -> Brep:
        """The Brep under an affine map (4, 4); mirrored faces keep their outside."""
        linear, shift = matrix[:3, :3], matrix[:3, 3]
        mirrored = float(np.linalg.det(linear)) < 0

        def moved(net: Floats) -> Floats:
            return np.concatenate([net[..., :3] @ linear.T + shift, net[..., 3:]], axis=-1)

        edges = tuple(
            replace(edge, curve=replace(edge.curve, control_points=moved(edge.curve.control_points)))
            for edge in self.edges
        )
        faces = tuple(
            replace(
                face,
                surface=replace(face.surface, control_points=moved(face.surface.control_points)),
                reversed=face.reversed != mirrored,
                render=face.render and face.render.transformed(matrix),
            )
            for face in self.faces
        )
        scale = float(np.linalg.norm(linear, 2))
        return Brep(self.vertices @ linear.T + shift, edges, faces, self.tolerance * scale)


def together(breps: list[Brep]) -> Brep:
    """All of them as one, nothing joined; the largest tolerance counts."""
    vertices, edges, faces = [], [], []
    shift, first = 0, 0
    for brep in breps:
        vertices.append(brep.vertices)
        edges += [replace(e, start=e.start + shift, end=e.end + shift) for e in brep.edges]
        for face in brep.faces:
            loops = tuple(
                tuple(
                    Trim(t.edge + first if t.edge >= 0 else -1, t.reversed, t.start + shift, t.end + shift)
                    for t in loop
                )
                for loop in face.loops
            )
            faces.append(replace(face, loops=loops))
        shift += len(brep.vertices)
        first += len(brep.edges)
    return Brep(np.concatenate(vertices), tuple(edges), tuple(faces), max(brep.tolerance for brep in breps))
