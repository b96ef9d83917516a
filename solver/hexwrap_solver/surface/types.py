"""What the intake of a surface yields (paper, Figure 2: NURBS surface → triangle mesh)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
import scipy

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.errors import SettingError
from hexwrap_solver.geometry import dot, face_areas, face_normals, lengths, normalize, weighted
from hexwrap_solver.setting import Setting
from hexwrap_solver.surface.closest import TriangleTree
from hexwrap_solver.surface.topology import edge_groups, edge_lengths, half_edges, twins_of

#: Least cosine of the angle between the normal at a place and that of the triangle it lies in.
LEAST_COSINE = 0.17
#: Of all drawn lines together.
MOST_POINTS = 20_000

Openings = Literal["cut", "loop"]
Caps = Literal["drop", "keep"]


@dataclass(frozen=True)
class SentMesh:
    """A polygon mesh as it was sent, nothing checked yet.

    vertices: (n, 3). faces: rows of 3 or 4 vertex indices. normals: (n, 3), any length, or None.
    creases: (k, 2) vertex pairs, edges at which the exact surface folds, and fold: (k,) by how much, radians;
    None where that is to be seen from the mesh. others: (n,) vertices of faces that were left out, no fault
    of the mesh; None if there are none.
    """

    vertices: Floats
    faces: Ragged
    normals: Floats | None = None
    creases: Ints | None = None
    fold: Floats | None = None
    others: Bools | None = None

    def transformed(self, matrix: Floats) -> SentMesh:
        """The mesh under an affine map (4, 4); mirrored faces keep their outside."""
        linear, shift = matrix[:3, :3], matrix[:3, 3]
        faces = self.faces
        if float(np.linalg.det(linear)) < 0:
            backwards = np.repeat(faces.offsets[:-1] + faces.offsets[1:] - 1, faces.lengths)
            faces = Ragged(faces.values[backwards - np.arange(len(faces.values))], faces.offsets)
        normals = None if self.normals is None else self.normals @ np.linalg.pinv(linear)
        return replace(self, vertices=self.vertices @ linear.T + shift, faces=faces, normals=normals)


@dataclass(frozen=True)
class MeshSettings:
    """How finely a NURBS surface is meshed (paper, Figure 2).

    With neither size, edges are chosen from the surface's area, for about 6,000 vertices.
    """

    max_edge: Annotated[
        float | None, Setting("NURBS surfaces: longest edge of the mesh", gt=0, unit="length")
    ] = None
    tolerance: Annotated[
        float | None,
        Setting("NURBS surfaces: greatest distance of the mesh (chord height)", gt=0, unit="length"),
    ] = None
    max_vertices: Annotated[
        int, Setting("finer meshes are refused before any large array is made", limit=True)
    ] = 1_000_000


Polyline = tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class FeatureSettings:
    """Which edges of the mesh are lines of the pattern, and lines that are drawn on it. Raises SettingError
    for a line of fewer than two points, and for too many points."""

    angle: Annotated[
        float | None,
        Setting(
            "mesh edges that fold by more are lines of the pattern; null: none", ge=1, lt=180, unit="degrees"
        ),
    ] = 30.0
    lines: Annotated[
        tuple[Polyline, ...],
        Setting(
            "polylines drawn on the surface, lines of the pattern too; closed: the first point again",
            most=1000,
        ),
    ] = ()
    without: Annotated[
        tuple[Polyline, ...],
        Setting("polylines along folds and creases that are not to become lines of the pattern", most=1000),
    ] = ()

    def __post_init__(self) -> None:
        for name, lines in (("lines", self.lines), ("without", self.without)):
            for i, line in enumerate(lines):
                if len(line) < 2:
                    raise SettingError(
                        f"line {i} of '{name}' has {len(line)} of the two points that it needs at least"
                    )
            if sum(map(len, lines)) > MOST_POINTS:
                raise SettingError(f"'{name}' may have {MOST_POINTS} points together; give fewer")


@dataclass(frozen=True)
class SurfaceSettings:
    """How a sent surface is taken in.

    caps ``drop``: flat caps of a closed mass are taken off, and of a plate all but one side. ``keep``: the
    closed surface is meant.
    openings ``cut``: loops beyond the two longest are filled smoothly, mapped as wall, and cut out again.
    ``loop``: each is a boundary of its own.
    """

    mesh: Annotated[MeshSettings | None, Setting("how a NURBS surface is meshed", rare=True)] = None
    openings: Annotated[
        Openings, Setting("what loops beyond the two longest are: holes to cut out, or boundaries")
    ] = "cut"
    caps: Annotated[Caps, Setting("flat caps of a closed mass: taken off, or kept")] = "drop"
    features: Annotated[
        FeatureSettings | None, Setting("lines that the pattern follows; null: as by default", rare=True)
    ] = None
    unit: Annotated[
        Literal["m", "cm", "mm", "ft", "in"] | None,
        Setting("unit of lengths; a file's own, where it has one, if it is not given"),
    ] = None
    object: Annotated[
        str | None,
        Setting(
            "which object of a file is meant: name, id or number; * and ? stand for any letters", most=400
        ),
    ] = None
    layer: Annotated[
        str | None,
        Setting(
            "which layer of a file is meant, with those below it: path or name, also with * and ?", most=400
        ),
    ] = None


@dataclass(frozen=True)
class Origin:
    """What the surface was called where it comes from. attributes: further (key, value) pairs. tolerance: of
    the file, in its unit, None where it has none."""

    name: str = ""
    layer: str = ""
    attributes: tuple[tuple[str, str], ...] = ()
    tolerance: float | None = None


def premultiplied(control_points: Floats) -> Floats:
    """Control points (…, 4) as (x·w, y·w, z·w, w)."""
    return np.concatenate(
        [control_points[..., :3] * control_points[..., 3:], control_points[..., 3:]], axis=-1
    )


@dataclass(frozen=True)
class NurbsSurface:
    """Tensor-product rational B-spline surface with *full* knot vectors.

    degree: (p, q). knots: two arrays of lengths n+p+1 and m+q+1. control_points: (n, m, 4) as
    (x, y, z, w), coordinates not premultiplied by the weight. closed: whether the surface closes up
    (with clamped and coincident, or periodic knots) in u, in v.
    """

    degree: tuple[int, int]
    knots: tuple[Floats, Floats]
    control_points: Floats
    closed: tuple[bool, bool]

    @property
    def size(self) -> float:
        """Bounding diagonal of the control points."""
        return float(np.linalg.norm(np.ptp(self.control_points[..., :3].reshape(-1, 3), axis=0)))

    @cached_property
    def spline(self) -> scipy.interpolate.NdBSpline:
        """Of homogeneous coordinates (x·w, y·w, z·w, w)."""
        return scipy.interpolate.NdBSpline(self.knots, premultiplied(self.control_points), self.degree)


@dataclass(frozen=True)
class Triangles:
    """vertices: (n, 3). faces: (m, 3). What follows from them is computed once, and not to be written to."""

    vertices: Floats
    faces: Ints

    @cached_property
    def edge_groups(self) -> tuple[Ints, Ints]:
        """The half-edges in the order of their edges, see ``topology.edge_groups``."""
        return edge_groups(self.faces, len(self.vertices))

    @cached_property
    def edge_ends(self) -> tuple[Ints, Ints]:
        """(e,) the lower and (e,) the higher vertex of every edge, in the order of ``edge_groups``."""
        order, first = self.edge_groups
        one = order[first[:-1]]
        start, end = (side[one] for side in half_edges(self.faces))
        return np.minimum(start, end), np.maximum(start, end)

    @cached_property
    def twin(self) -> Ints:
        """(3m,) the half-edge on the other side of each, −1 where the edge has not exactly two faces."""
        twin = twins_of(*self.edge_groups)
        twin.flags.writeable = False
        return twin

    @cached_property
    def areas(self) -> Floats:
        """(m,) areas of the faces."""
        areas = face_areas(self.vertices, self.faces)
        areas.flags.writeable = False
        return areas

    @cached_property
    def lengths(self) -> Floats:
        """(m, 3) lengths of the half-edges."""
        lengths = edge_lengths(self.vertices, self.faces)
        lengths.flags.writeable = False
        return lengths


@dataclass(frozen=True)
class Feature:
    """A line along which the surface folds, from a junction, a corner or the boundary to the next.

    vertices: (k,) of the mesh, neighbours joined by edges; a closed line ends where it begins. fold: mean
    angle between the faces beside it, radians. given: of the exact surface, or drawn; not only seen on the
    mesh.
    """

    vertices: Ints
    fold: float
    closed: bool
    given: bool = False


@dataclass(frozen=True)
class Surface(Triangles):
    """A triangle mesh of genus 0: connected, oriented, manifold, without handles.

    vertices: (n, 3). faces: (m, 3), counter-clockwise seen from outside.
    loops: the boundary loops as vertex indices, surface on the left. Of two, loop 0 holds the lowest sent
    vertex index of the boundary; of any other number, loops are sorted by length, the longest first.
    input_vertex: (n,) a sent vertex that stands at vertex i, or −1.
    vertex_of_input: (n_sent,) the vertex at which each sent vertex stands, or −1 where it was dropped.
    normals: (n, 3) unit vertex normals (sent ones, the NURBS surface's, or area-weighted face normals).
    repairs: one sentence each.
    features: creases of the surface as chains of mesh edges.
    openings: how many loops, the last ones, are openings of the wall: the map is found with them filled,
    and they are cut out of it. patch: (m,) on a filled surface, the faces that fill openings; None if there
    are none.
    nurbs, parameters: the NURBS surface the mesh was made from, and (n, 2) its parameters at the
    vertices (in the closed direction, parameters are in the base period); None for sent meshes.
    unit: of lengths, None where it is not known. origin: names it came with.
    """

    loops: tuple[Ints, ...]
    input_vertex: Ints
    vertex_of_input: Ints
    normals: Floats
    repairs: tuple[str, ...] = ()
    nurbs: NurbsSurface | None = None
    parameters: Floats | None = None
    openings: int = 0
    patch: Bools | None = None
    features: tuple[Feature, ...] = ()
    unit: str | None = None
    origin: Origin = field(default_factory=Origin)

    def knowing(self, mesh: Triangles) -> Surface:
        """The surface itself, which takes over what was computed for the same triangles."""
        known = ("edge_groups", "twin", "lengths", "areas")
        self.__dict__.update({name: mesh.__dict__[name] for name in known if name in mesh.__dict__})
        return self

    @property
    def boundary(self) -> Ints:
        """(b,) the vertices of all loops."""
        return np.concatenate([np.zeros(0, dtype=np.int64), *self.loops])

    def normals_at(self, face: Ints, weights: Floats) -> Floats:
        """(k, 3) unit normals on the outside at barycentric coordinates (k, 3) of faces (k,): interpolated
        between those of the vertices, and nowhere further than ``LEAST_COSINE`` from the face's own, as they
        would be beside edges where a coarse mesh folds back."""
        normal = normalize(weighted(self.normals, self.faces[face], weights))
        own = self.face_normals.take(face, axis=0)
        rise = dot(normal, own)
        low = np.flatnonzero(rise < LEAST_COSINE)
        low = low[own[low].any(axis=1)]
        along = normalize(normal[low] - rise[low, None] * own[low])
        normal[low] = normalize(LEAST_COSINE * own[low] + np.sqrt(1 - LEAST_COSINE**2) * along)
        return normal

    @cached_property
    def face_normals(self) -> Floats:
        """(m, 3) unit normals of the faces, 0 where one has no area. Not to be written to."""
        return np.ascontiguousarray(normalize(face_normals(self.vertices, self.faces)))

    @cached_property
    def tree(self) -> TriangleTree:
        """For the nearest points of the mesh."""
        return TriangleTree.build(self.vertices, self.faces)

    @cached_property
    def enclosed(self) -> float:
        """Volume that the surface and the cones from its loops to their middles enclose, over (their
        area)^(3/2); negative where the normals look inwards."""
        vertices, faces = [self.vertices], [self.faces]
        for loop in self.loops:  # the surface is on their left, and so the cones are on their right
            middle = np.full(len(loop), sum(map(len, vertices)))
            vertices.append(self.vertices[loop].mean(axis=0, keepdims=True))
            faces.append(np.stack([middle, np.roll(loop, -1), loop], axis=1))
        place, corner = np.concatenate(vertices), np.concatenate(faces)
        place -= self.vertices.mean(axis=0)
        twice = face_normals(place, corner)
        volume = float(np.einsum("kd,kd->", place[corner[:, 0]], twice)) / 6
        area = float(lengths(twice).sum()) / 2
        return float(volume / area**1.5)
