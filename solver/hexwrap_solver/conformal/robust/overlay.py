"""New vertices in a map that has been found with flips, without solving again.

The map is known everywhere, not only at vertices: on what triangles of the surface and of the flat Delaunay
metric have in common it is projective, from circumcircle to circumcircle (see ``transport``). A new vertex on
the surface hence has its place in the domain, and changes nothing for the others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.orientation import inverted
from hexwrap_solver.conformal.robust.delaunay import make_delaunay
from hexwrap_solver.conformal.robust.flip_sequence import FlipSequence
from hexwrap_solver.conformal.robust.mirror import MirrorMesh, half_edge_names, mirror_mesh
from hexwrap_solver.conformal.robust.refine import (
    Problem,
    collapsing,
    once_per_edge,
    split_edges,
    split_places,
)
from hexwrap_solver.conformal.robust.straight import straighten
from hexwrap_solver.conformal.robust.transport import Places
from hexwrap_solver.conformal.types import ConformalMap, Targets
from hexwrap_solver.surface.topology import half_edges

#: Rounds of insertion, and of them without progress. Most meshes take up to six; around a vertex of many
#: edges each round may lead to the next triangle only.
MAX_ROUNDS, PATIENCE = 200, 100
#: From this round on the edges to split are those that are longest in the domain.
DRAWN = 2
#: Insertion does not end if it makes more than MOST times the vertices and MOST_MORE. It is worth some
#: patience: solving again with new vertices takes many times as long.
MOST, MOST_MORE = 2, 2000


@dataclass(frozen=True)
class Anchors:
    """Where vertices lie on the surface that the map was found on.

    corner: (n, 3) vertices of a face there, three times the same where it is one of them. weight: (n, 3)
    barycentric. owner: (n,) the corner of the greatest weight, which belongs to every face with this point.
    """

    corner: Ints
    weight: Floats
    owner: Ints

    @classmethod
    def of_vertices(cls, n: int) -> Anchors:
        own = np.arange(n)
        weight = np.zeros((n, 3))
        weight[:, 0] = 1.0
        return cls(np.repeat(own[:, None], 3, axis=1), weight, own)

    def with_points(self, corner: Ints, i: Ints, j: Ints, place: Floats) -> Anchors:
        """More of them, between vertices i and j (k,) in faces with these corners (k, 3)."""
        one, two = self.weights(i, corner), self.weights(j, corner)
        weight = (1 - place)[:, None] * one + place[:, None] * two
        owner = corner[np.arange(len(corner)), weight.argmax(axis=1)]
        return Anchors(
            np.concatenate([self.corner, corner]),
            np.concatenate([self.weight, weight]),
            np.concatenate([self.owner, owner]),
        )

    def weights(self, vertices: Ints, corner: Ints) -> Floats:
        """(k, 3) weights of vertices for the corners of faces that they lie in."""
        same = self.corner[vertices][:, None, :] == corner[:, :, None]
        return np.asarray((same * self.weight[vertices][:, None, :]).sum(axis=2))


class Overlay:
    """The surface's triangles and those of a flat metric, one over the other.

    found: the map that was drawn. log_length: (3m,) of its surface's half-edges, in the unit that the metric
    was found in. winding: (m, 3) of them, see ``MirrorMesh``. u: (n,) of the metric. lift: (n,) see
    ``Development``.
    """

    def __init__(self, found: ConformalMap, log_length: Floats, winding: Ints, u: Floats, lift: Ints) -> None:
        mesh = mirror_mesh(found.surface, log_length, winding.ravel())
        self.found, self.u, self.lift = found, u, lift
        self._winding = winding
        self._first = half_edge_names(found.surface)[::3]
        self._flat, self._curved = FlipSequence(with_points=True), FlipSequence(with_points=True)
        make_delaunay(mesh, np.zeros(mesh.n), euclidean=True, do=self._flat.flip)
        self._corners = _corners(mesh)
        make_delaunay(mesh, u, do=self._curved.flip)
        self._mesh = mesh
        self._length = mesh.scaled(u)
        self._shift = float(found.log_scale[0] - u[0])

    def place(self, face: Ints, weight: Floats, owner: Ints) -> tuple[Complexes, Floats]:
        """Points of the surface in the domain, beside the copy uv[owner] of one of their face's corners, and
        their u. face: (k,). weight: (k, 3) barycentric. owner: (k,)."""
        corner = self.found.surface.faces[face]
        winding = self._winding[face]
        to_corner = np.stack([np.zeros(len(face), dtype=np.int64), winding[:, 0], -winding[:, 2]], axis=1)
        which = (corner == owner[:, None]).argmax(axis=1)
        power = self.lift[owner] - to_corner[np.arange(len(face)), which]
        size = len(self._mesh.origin)
        at = self._flat.transport(Places(self._first[face], weight, power), size)
        corners = self._corners[at.half_edge]
        scaled = at.weight * np.where(corners >= 0, np.exp(-self.u[corners]), 1.0)
        return self._drawn(self._curved.transport(replace(at, weight=scaled), size))

    def _drawn(self, at: Places) -> tuple[Complexes, Floats]:
        mesh, h = self._mesh, at.half_edge
        following, before = mesh.next[h], mesh.prev[h]
        outer = mesh.outer[h]
        start = self._copy(mesh.origin[h], at.power)
        end = self._copy(mesh.origin[following], at.power + mesh.winding[h])
        apex = self._copy(mesh.origin[before], at.power - mesh.winding[before])
        side = self._length[h >> 1]
        m, n = mesh.cross_length(h, self._length), mesh.cross_length(following, self._length)
        slope = np.where(outer, (np.exp(n - side) - np.exp(m - side)) / 2, 0.0)
        along = np.sqrt(np.maximum((1 - slope) * (1 + slope), 0.0))
        pole = (end - start) * (-slope + 1j * along) * np.exp(-side)
        first, second, third = at.weight.T
        total = first + second + np.where(outer, 0.0, third)
        shift = np.where(outer, third * pole, third * (apex - start))
        return start + (second * (end - start) + shift) / total, self._shift - np.log(total)

    def _copy(self, vertex: Ints, power: Ints) -> Complexes:
        return self.found.deck.apply(self.found.uv[vertex], power - self.lift[vertex])

    def sheets(self, face: Ints, owner: Ints) -> Ints:
        """(k,) where the copies uv[owner] of corners of faces (k,) stand, see ``ConformalMap.sheet``."""
        which = (self.found.surface.faces[face] == owner[:, None]).argmax(axis=1)
        return np.asarray(self.found.sheet[face, which])

    def drawn(self, problem: Problem, anchors: Anchors, uv: Complexes) -> tuple[ConformalMap, Ints]:
        """The map on a refined surface, whose parents are the faces of the first one, and ``Refined.start``.
        uv: (n,)."""
        found, surface = self.found, problem.surface
        owner = anchors.owner[surface.faces]
        sheet = np.stack([self.sheets(problem.parent, owner[:, c]) for c in range(3)], axis=1)
        start = sheet[:, 0].copy()
        sheet -= start[:, None]
        sums = [np.full(len(uv), np.pi) for _ in surface.loops]
        for k in range(2):
            sums[k][found.surface.loops[k]] = found.boundary_angles[k]
        drawn = replace(
            found,
            surface=surface,
            log_scale=problem.u,
            domain=replace(
                found.unrolled, uv=straighten(surface, problem.targets, uv, sheet, found.deck), sheet=sheet
            ),
            boundary_angles=(sums[0][surface.loops[0]], sums[1][surface.loops[1]]),
        )
        return drawn, start


@dataclass(frozen=True)
class Refined:
    """A map with new vertices. parent: (m,) the face of the first surface that each face is a part of. start:
    (m,) where its first corner stands there, see ``ConformalMap.sheet``."""

    map: ConformalMap
    parent: Ints
    start: Ints


def insert(overlay: Overlay, targets: Targets) -> Refined | None:
    """The map with new vertices, until no triangle turns over; None where that does not end.

    targets: of the surface that the map was found on.
    """
    wrong = np.flatnonzero(inverted(overlay.found))
    surface, uv = overlay.found.surface, overlay.found.uv
    corners, n = surface.faces, len(surface.vertices)
    problem = Problem(surface, targets, overlay.found.log_scale, np.arange(len(corners)))
    anchors, counts, drawn = Anchors.of_vertices(n), [len(wrong)], overlay.found
    for attempt in range(MAX_ROUNDS):
        domain = drawn.corners()[wrong] if attempt >= DRAWN else None
        marked, place = split_places(problem.surface, problem.targets, wrong, attempt, domain)
        while len(marked):
            marked, place = once_per_edge(problem.surface, marked, place)
            before = len(problem.surface.vertices)
            face, (tail, head) = problem.parent[marked // 3], half_edges(problem.surface.faces)
            anchors = anchors.with_points(corners[face], tail[marked], head[marked], place)
            problem = split_edges(problem, marked, place)
            added, u = overlay.place(face, anchors.weight[before:], anchors.owner[before:])
            problem.u[before:] = u
            uv = np.concatenate([uv, added])
            drawn, start = overlay.drawn(problem, anchors, uv)
            winding = np.roll(drawn.sheet, -1, axis=1) - drawn.sheet
            marked = collapsing(problem.surface, problem.targets, winding.ravel())
            place = np.full(len(marked), 0.5)
        if len(uv) > MOST * n + MOST_MORE or not (np.isfinite(uv).all() and np.isfinite(problem.u).all()):
            return None
        wrong = np.flatnonzero(inverted(drawn))
        if not len(wrong):
            return Refined(drawn, problem.parent, start)
        counts.append(len(wrong))
        if attempt >= PATIENCE and min(counts[-PATIENCE:]) >= min(counts[:-PATIENCE]):
            return None
    return None


def _corners(mesh: MirrorMesh) -> Ints:
    """(2e, 3) vertices of each half-edge's piece from its origin on, −1 for K."""
    apex = np.where(mesh.outer, -1, mesh.origin[mesh.prev])
    return np.stack([mesh.origin, mesh.origin[mesh.next], apex], axis=1)
