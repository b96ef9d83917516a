"""A triangulated annulus glued to its mirror image, of which only the front half is stored.

The double of the annulus is a closed torus; its mirror line consists of the two boundary loops. A Delaunay
triangulation of the double that respects the mirror has two kinds of edges: those that lie in the front (and,
mirrored, in the back), and those that cross the mirror line at right angles and join a vertex w to its own
image w'. Below an edge (i, j) of the front that faces the mirror there is hence always an isosceles
*trapezoid* (i, j, j', i') with its mirror line through the middle. Where i lies on the boundary itself i' = i
and the trapezoid is a triangle, and where both do it is flat: an edge of the boundary.

    front triangles          w1 ------ w2          edges (v0,w1), (w1,w2), (w2,v1): one trapezoid below each
                           / :         : \\        dotted: crossing edges (w1,w1'), (w2,w2'), upper halves
    mirror line      v0 --------------------- v1

Half-edges 2e and 2e + 1 are the two sides of edge e. A half-edge is either the side of a triangle, or
*outer*: the upper side of a trapezoid. Outer half-edges form closed chains, one per boundary loop. When a
triangle is flipped away over the mirror line its edge becomes the crossing edge of its apex, so that edges
are as many as ever and every edge keeps one length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, positions
from hexwrap_solver.surface.topology import next_half_edge
from hexwrap_solver.surface.types import Surface


@dataclass
class MirrorMesh:
    """Changed in place by flips.

    origin: (2e,) vertex where the half-edge starts (both sides of a crossing edge start at its vertex).
    next, prev: (2e,) neighbours in the triangle, or in the chain of outer half-edges.
    outer: (2e,) whether it is the upper side of a trapezoid.
    cross: (2e,) for outer half-edges the crossing edge that ends the trapezoid at the origin, −1 on the
    boundary.
    crossing: (e,) whether the edge crosses the mirror line.
    winding: (2e,) how often the half-edge goes around the annulus, counted where it crosses a fixed cut:
    sums to 0 over every triangle and to 1 over loop 0.
    log_length: (e,) of the whole edge (from w to w' for a crossing one), before it is scaled by u.
    """

    n: int
    origin: Ints
    next: Ints
    prev: Ints
    outer: Bools
    cross: Ints
    crossing: Bools
    winding: Ints
    log_length: Floats
    _faces: tuple[Ints, Ints] | None = None

    def scaled(self, u: Floats) -> Floats:
        """(e,) log-lengths in the metric with logarithmic factors u."""
        return self.log_length + (u[self.origin[::2]] + u[self.origin[1::2]]) / 2

    def triangles(self) -> Ints:
        """(3, t) the half-edges of every front triangle."""
        return self._found()[0]

    def chain(self) -> Ints:
        """(k,) all outer half-edges."""
        return self._found()[1]

    def flipped(self) -> None:
        """To be called after every flip."""
        self._faces = None

    def _found(self) -> tuple[Ints, Ints]:
        """Triangles and chain, which last until the next flip."""
        if self._faces is None:
            first = np.flatnonzero(~self.outer & ~np.repeat(self.crossing, 2))
            second = self.next[first]
            first, second = first[first < second], second[first < second]
            third = self.next[second]
            once = first < third
            triangles = np.stack([first[once], second[once], third[once]])
            self._faces = triangles, np.flatnonzero(self.outer)
        return self._faces

    def cross_length(self, half_edges: Ints, log_length: Floats) -> Floats:
        """Log-length of the crossing edge at the origin of outer half-edges, −inf on the boundary."""
        cross = self.cross[half_edges]
        return np.where(cross < 0, -np.inf, log_length[cross])


def half_edge_names(surface: Surface) -> Ints:
    """(3m,) what the half-edges of the faces are called in ``mirror_mesh``."""
    twin = surface.twin
    lead = (twin < 0) | (np.arange(len(twin)) < twin)
    edge = np.zeros(len(twin), dtype=np.int64)
    edge[lead] = np.arange(int(lead.sum()))
    edge[~lead] = edge[twin[~lead]]
    return np.asarray(2 * edge + ~lead)


def mirror_mesh(surface: Surface, log_length: Floats, winding: Ints) -> MirrorMesh:
    """The double of a surface. log_length, winding: (3m,) per half-edge of the faces (see ``topology``)."""
    faces, twin, n = surface.faces, surface.twin, len(surface.vertices)
    name = half_edge_names(surface)
    edge = name >> 1
    size = 2 * (int(edge.max()) + 1)
    boundary = np.flatnonzero(twin < 0)
    outside = name[boundary] + 1

    origin, following, around = (np.zeros(size, dtype=np.int64) for _ in range(3))
    origin[name] = faces.ravel()
    origin[outside] = np.roll(faces, -1, axis=1).ravel()[boundary]
    following[name] = name[next_half_edge(np.arange(faces.size))]
    at_origin = np.zeros(n, dtype=np.int64)
    at_origin[origin[outside]] = outside
    following[outside] = at_origin[faces.ravel()[boundary]]
    previous = positions(following, size)
    outer = np.zeros(size, dtype=bool)
    outer[outside] = True
    around[name] = winding
    around[outside] = -winding[boundary]
    lengths = np.zeros(size // 2)
    lengths[edge] = log_length
    return MirrorMesh(
        n,
        origin,
        following,
        previous,
        outer,
        np.full(size, -1, dtype=np.int64),
        np.zeros(size // 2, dtype=bool),
        around,
        lengths,
    )


def link(mesh: MirrorMesh, *ring: Ints) -> None:
    for one, two in zip(ring, (*ring[1:], ring[0]), strict=True):
        mesh.next[one] = two
        mesh.prev[two] = one


def set_cross(mesh: MirrorMesh, trapezoids: Ints, cross: Ints) -> None:
    """The crossing edges at the origins of trapezoids; ``next`` leads back from such an edge to its
    trapezoid."""
    mesh.cross[trapezoids] = cross
    is_edge = cross >= 0
    mesh.next[2 * cross[is_edge]] = trapezoids[is_edge]


def lower(mesh: MirrorMesh, below: Ints) -> None:
    """The triangle (i, j, x) over each outer half-edge j → i, and the trapezoid below it, become the
    trapezoids below j → x and x → i; the edge ij becomes the crossing edge at x. Links only, no lengths."""
    edges, h = below >> 1, below ^ 1
    left, right = mesh.next[h], mesh.prev[h]
    before, after = mesh.prev[below], mesh.next[below]
    set_cross(mesh, left, mesh.cross[below])
    set_cross(mesh, right, edges)
    mesh.outer[left] = mesh.outer[right] = True
    mesh.outer[below] = False
    mesh.crossing[edges] = True
    mesh.origin[h] = mesh.origin[below] = mesh.origin[right]
    mesh.winding[h] = mesh.winding[below] = 0
    mesh.next[before], mesh.prev[left] = left, before
    mesh.next[left], mesh.prev[right] = right, left
    mesh.next[right], mesh.prev[after] = after, right


def raise_(mesh: MirrorMesh, below: Ints) -> None:
    """The reverse of ``lower``. below: (k,) the side of each crossing edge that becomes outer."""
    edges, h = below >> 1, below ^ 1
    right = mesh.next[2 * edges]
    left = mesh.prev[right]
    before, after = mesh.prev[left], mesh.next[right]
    set_cross(mesh, below, mesh.cross[left])
    mesh.cross[left] = mesh.cross[right] = -1
    mesh.outer[left] = mesh.outer[right] = False
    mesh.outer[below] = True
    mesh.crossing[edges] = False
    mesh.origin[h], mesh.origin[below] = mesh.origin[after], mesh.origin[left]
    mesh.winding[below] = mesh.winding[left] + mesh.winding[right]
    mesh.winding[h] = -mesh.winding[below]
    link(mesh, left, right, h)
    mesh.next[before], mesh.prev[below] = below, before
    mesh.next[below], mesh.prev[after] = after, below
