"""Moving singularities on the surface, and the mesh around them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.conformal.robust.refine import split
from hexwrap_solver.geometry import normalize
from hexwrap_solver.surface.normals import with_tangents
from hexwrap_solver.surface.nurbs import evaluate, wrap
from hexwrap_solver.surface.projection import project
from hexwrap_solver.surface.topology import half_edges
from hexwrap_solver.surface.types import Surface

#: The mesh follows within this many cells, this part of the way to a loop, and that to the next singularity.
REACH, TO_LOOP, TO_NEXT = 4.0, 0.95, 0.6
#: Edges within this many cells of a singularity are split until they are below that part of a cell.
FINE, FINEST = (2.0, 1.0), (0.3, 0.15)
#: Tangents with a smaller squared sine between them are singular.
REGULAR = 1e-4


def refined(surface: Surface, places: Floats, cell: float) -> Surface:
    """The same surface with more triangles near the places: there the discrete map's own error is largest."""
    for reach, longest in zip(FINE, FINEST, strict=True):
        for _ in range(4):
            middle = surface.vertices[surface.faces].mean(axis=1)
            near = np.asarray(cKDTree(places).query(middle)[0]) <= reach * cell
            long = np.greater(surface.lengths, longest * cell)
            marked = np.flatnonzero((long & near[:, None]).ravel() & (surface.twin >= 0))
            if not len(marked):
                break
            surface = split(surface, marked)
    return surface


@dataclass(frozen=True)
class Grip:
    """The vertices that follow one singularity. share: (k,) how far, from 1 to 0. axes: (2, 3) tangents.
    steps: (k, 2, 2) change of the NURBS parameters per unit along each axis; None where there are none, or
    where they are singular."""

    vertex: Ints
    share: Floats
    axes: Floats
    steps: Floats | None

    def moved(self, surface: Surface, step: float) -> Iterator[Floats]:
        """(n, 3) the surface's vertices after a small step along each axis; on a NURBS surface to first
        order, in their tangent planes."""
        if self.steps is None:
            for move in step * np.eye(2):
                yield dragged(surface, [self], move[None]).vertices
            return
        normal = surface.normals[self.vertex]
        for axis in self.axes:
            vertices = surface.vertices.copy()
            vertices[self.vertex] += step * self.share[:, None] * (axis - (normal @ axis)[:, None] * normal)
            yield vertices


def rims(surface: Surface) -> Ints:
    """(k, 2) edges around the openings that were filled."""
    if surface.patch is None:
        return np.zeros((0, 2), dtype=np.int64)
    inner = np.flatnonzero(surface.twin >= 0)
    rim = inner[surface.patch[inner // 3] & ~surface.patch[surface.twin[inner] // 3]]
    tail, head = half_edges(surface.faces)
    return np.stack([tail[rim], head[rim]], axis=1)


def grips(surface: Surface, cones: Ints, cell: float) -> list[Grip]:
    places = surface.vertices[cones]
    loops = np.union1d(surface.boundary, rims(surface))
    tree = cKDTree(surface.vertices)
    found = []
    for i, cone in enumerate(cones):
        reach = REACH * cell
        if len(loops):
            reach = min(
                reach, TO_LOOP * float(np.linalg.norm(surface.vertices[loops] - places[i], axis=1).min())
            )
        if len(cones) > 1:
            others = np.delete(places, i, axis=0)
            reach = min(reach, TO_NEXT * float(np.linalg.norm(others - places[i], axis=1).min()))
        near = np.array(sorted(tree.query_ball_point(places[i], reach)), dtype=np.int64)
        facing = surface.normals[near] @ surface.normals[cone] > 0  # not the other side of a thin wall
        near = near[facing]
        far = np.linalg.norm(surface.vertices[near] - places[i], axis=1) / reach
        axes = _axes(surface.normals[cone])
        found.append(Grip(near, (1 - far**2) ** 2, axes, _parameter_steps(surface, near, axes)))
    return found


def _parameter_steps(surface: Surface, vertex: Ints, axes: Floats) -> Floats | None:
    if surface.nurbs is None or surface.parameters is None:
        return None
    jet = evaluate(surface.nurbs, surface.parameters[vertex])
    tangents = np.stack([jet.du, jet.dv], axis=1)
    metric = np.einsum("kax,kbx->kab", tangents, tangents)
    size = np.einsum("kaa->ka", metric)
    if (np.linalg.det(metric) < REGULAR * size[:, 0] * size[:, 1]).any():
        return None
    along = np.einsum("kax,jx->kaj", tangents, axes)
    return np.asarray(np.linalg.solve(metric, along).transpose(0, 2, 1))


def _axes(normal: Floats) -> Floats:
    """(2, 3) horizontal and upward tangents, where there are such."""
    across = np.cross([0.0, 0.0, 1.0], normal)
    if np.linalg.norm(across) < 1e-3:
        across = np.cross([0.0, 1.0, 0.0], normal)
    across = across / np.linalg.norm(across)
    return np.stack([across, np.cross(normal, across)])


def dragged(surface: Surface, hold: list[Grip], moves: Floats) -> Surface:
    """The surface with its mesh dragged; moves: (s, 2) along the axes of each, model units.

    Vertices stay on the NURBS surface, or on the mesh that was sent.
    """
    vertices, moved = surface.vertices.copy(), np.zeros(len(surface.vertices), dtype=bool)
    parameters, normals = surface.parameters, surface.normals.copy()
    if parameters is not None:
        parameters = parameters.copy()
    smooth = parameters is not None and all(grip.steps is not None for grip in hold)
    for grip, move in zip(hold, moves, strict=True):
        if np.any(move):
            if smooth and parameters is not None and grip.steps is not None:
                parameters[grip.vertex] += grip.share[:, None] * (move @ grip.steps)
            else:
                vertices[grip.vertex] += grip.share[:, None] * (move @ grip.axes)
            moved[grip.vertex] = True
    index = np.flatnonzero(moved)
    if not len(index):
        return surface
    if surface.nurbs is not None and parameters is not None:
        if smooth:
            parameters[index] = wrap(surface.nurbs, parameters[index])
            jet = evaluate(surface.nurbs, parameters[index])
            vertices[index], exact = jet.point, jet.normal
        else:
            vertices[index], parameters[index], exact = project(
                surface.nurbs, vertices[index], parameters[index]
            )
        normals[index] = with_tangents(exact, normals[index])
    else:
        seen = surface.tree.nearest(vertices[index])
        corner = surface.faces[seen.face]
        vertices[index] = np.einsum("kc,kcd->kd", seen.barycentric, surface.vertices[corner])
        normals[index] = normalize(np.einsum("kc,kcd->kd", seen.barycentric, surface.normals[corner]))
    return _known(
        surface,
        replace(
            surface,
            vertices=vertices,
            normals=normals,
            parameters=parameters,
            input_vertex=_forgotten(surface, vertices, moved),
        ),
    )


def _known(old: Surface, new: Surface) -> Surface:
    """The triangles are the same: what follows from them alone need not be found again."""
    for name in ("edge_groups", "twin", "edge_ends"):
        if name in old.__dict__:
            new.__dict__[name] = old.__dict__[name]
    return new


def _forgotten(surface: Surface, vertices: Floats, moved: Bools) -> Ints:
    away = moved & (vertices != surface.vertices).any(axis=1)
    return np.where(away, -1, surface.input_vertex)
