"""Lines drawn on a surface made chains of mesh edges, for a pattern to follow them as it follows creases.

A line is followed from vertex to vertex. In the triangles around one, the plane through it, the next point of
the line and the normal crosses an opposite edge, which gets a vertex there:

           a                       a
         ╱ |                     ╱ |        The edge from v to x is there without more ado, whatever was
        v  x → q       →        v──x        inserted before, and for lines that cross each other too. Where x
         ╲ |                     ╲ |        lies near a corner, that corner is taken, and moved to x where it
           b                       b        is free to: no triangle gets much narrower.

A point that is a vertex already is taken as it is: a line drawn along edges becomes these edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.geometry import angles_between, dot, face_normals, normalize
from hexwrap_solver.surface.closest import nearest_in_triangles
from hexwrap_solver.surface.errors import DrawnLineError
from hexwrap_solver.surface.features import FeatureEdges
from hexwrap_solver.surface.normals import with_tangents
from hexwrap_solver.surface.projection import project, start_parameters
from hexwrap_solver.surface.types import Feature, Surface
from hexwrap_solver.tolerances import RELATIVE

#: Points of a line may be away from the surface by this part of its size.
FAR = 0.02
#: Vertices nearer to a line than this part of the least height of the triangles around them are moved onto
#: it; those that may not be moved are taken for it below the second one.
NEAR, TOUCHING = 0.25, 0.05
#: A point of a line nearer to a vertex than this part of the size, and than this part of the least height of
#: the triangles around it, is that vertex: coordinates come rounded, and to the tolerance of a model.
ON_VERTEX, OF_HEIGHT = 1e-5, 0.01
#: A point at which a line turns by more than this gets a vertex, radians.
TURN = np.deg2rad(20.0)
#: A point is in a triangle if it is away from the line through it by less than this part of the way across.
BESIDE = 0.1
#: Unit normals whose sum is shorter face away from each other.
OPPOSITE = 0.1
#: All lines together get at most this many vertices.
MOST_VERTICES = 50_000
#: Points of a line closer together than this part of the size are one.
SAME = 1e-9

Line = Floats | Sequence[Sequence[float]]


def with_lines(surface: Surface, lines: Sequence[Line]) -> Surface:
    """The surface with each line as a feature, before those that it has.

    lines: points (k, 3) each, closed where the last is the first. Points are taken to the nearest ones of the
    surface, and joined straight. New vertices, and those that were moved onto a line, have input_vertex −1.
    Raises DrawnLineError.
    """
    if not lines:
        return surface
    if not np.isfinite(np.concatenate([np.asarray(line, dtype=float).ravel() for line in lines])).all():
        raise DrawnLineError("The coordinates of surface.features.lines must be finite numbers.")
    size = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    mesh = _Mesh(surface)
    chains = []
    for i, line in enumerate(lines):
        chains.append(_followed(mesh, _on_surface(surface, line, i, size), size))
    return _built(surface, mesh, chains)


@dataclass(frozen=True)
class _Line:
    """number: of the line. index: (k,) numbers of its points, no two successive ones in one place. point:
    (k, 3) on the surface, face: (k,) there, normal: (k, 3)."""

    number: int
    index: Ints
    point: Floats
    face: Ints
    normal: Floats

    def lost(self, k: int) -> DrawnLineError:
        a, b = self.index[k - 1 : k + 1].tolist()
        return _fault(
            self.number,
            b,
            f"Line {self.number} cannot be followed on the surface between its points {a} and {b}: it leaves "
            "the surface there, or goes around it; add points between.",
        )


def _on_surface(surface: Surface, line: Line, number: int, size: float) -> _Line:
    """Raises DrawnLineError."""
    points = np.asarray(line, dtype=float).reshape(-1, 3)
    apart = np.linalg.norm(np.diff(points, axis=0), axis=1) > SAME * size
    index = np.flatnonzero(np.append(True, apart)[: len(points)])
    if len(index) < 2:
        raise _fault(number, 0, f"Line {number} of surface.features.lines needs two different points.")
    near = surface.tree.nearest(points)
    far = int(np.argmax(near.distance))
    if near.distance[far] > FAR * size:
        raise _fault(
            number,
            far,
            f"Point {far} of line {number} is {near.distance[far]:.4g} away from the surface, more than "
            f"{FAR:.0%} of its size ({size:.4g}): draw the line on the surface.",
        )
    corner = surface.faces[near.face]
    points = np.einsum("kc,kcd->kd", near.barycentric, surface.vertices[corner])
    # Smooth ones: at an edge, those of one of its faces would lead the line off to the other side.
    normal = normalize(np.einsum("kc,kcd->kd", near.barycentric, surface.normals[corner]))
    return _Line(number, index, points[index], near.face[index], normal[index])


def _fault(line: int, point: int, detail: str) -> DrawnLineError:
    return DrawnLineError(detail, data={"line": line, "point": point})


class _Mesh:
    """A mesh that is changed locally: triangles as tuples, and the triangles around each vertex that was
    looked at."""

    def __init__(self, surface: Surface) -> None:
        self.surface = surface
        self.n = len(surface.vertices)
        self.order = np.argsort(surface.faces.ravel(), kind="stable") // 3
        self.first = np.concatenate([[0], np.cumsum(np.bincount(surface.faces.ravel(), minlength=self.n))])
        self.face: dict[int, tuple[int, int, int]] = {}
        self.around: dict[int, list[int]] = {}
        self.place = surface.vertices.copy()
        self.parent: list[int] = []
        self.parts: dict[int, list[int]] = {}
        self.middle: dict[tuple[int, int], int] = {}
        self.added = 0
        self.moved: list[int] = []
        self.fixed = {int(v) for v in surface.boundary}
        for feature in surface.features:
            self.fixed.update(feature.vertices.tolist())

    def at(self, v: int) -> Floats:
        found: Floats = self.place[v]
        return found

    def corners(self, f: int) -> tuple[int, int, int]:
        found = self.face.get(f)
        if found is None:
            a, b, c = self.surface.faces[f].tolist()
            found = self.face[f] = (a, b, c)
        return found

    def star(self, v: int) -> list[int]:
        found = self.around.get(v)
        if found is None:
            found = self.around[v] = self.order[self.first[v] : self.first[v + 1]].tolist()
        return found

    def fan(self, v: int) -> tuple[list[int], Ints]:
        """The faces around a vertex, and (k, 2) their other corners in order."""
        faces = self.star(v)
        others = []
        for f in faces:
            a, b, c = self.corners(f)
            others.append((b, c) if a == v else (c, a) if b == v else (a, b))
        return faces, np.array(others)

    def height(self, v: int) -> float:
        """The least height of the triangles around a vertex, seen from it."""
        _, others = self.fan(v)
        a, b = self.place[others[:, 0]], self.place[others[:, 1]]
        base, arm = b - a, a - self.at(v)
        square, along = dot(base, base), dot(base, arm)
        return float(np.sqrt(np.maximum(dot(arm, arm) - along * along / square, 0.0).min()))

    def takes(self, v: int, point: Floats) -> bool:
        """Whether a vertex stands for a point that is so near; it is moved there if it may be."""
        apart = float(np.linalg.norm(point - self.at(v)))
        free = v not in self.fixed
        if apart > (NEAR if free else TOUCHING) * self.height(v):
            return False
        if free and apart > SAME * self.height(v):  # not by mere rounding
            self.moved.append(v)
            self._put_at(v, point)
        self.fixed.add(v)
        return True

    def vertex_at(self, point: Floats, v: int, within: float) -> int | None:
        """The vertex that a point is, of v and those around it."""
        _, others = self.fan(v)
        around = np.append(others, v)
        apart = np.linalg.norm(self.place[around] - point, axis=1)
        k = int(np.argmin(apart))
        u = int(around[k])
        if apart[k] > within or apart[k] > OF_HEIGHT * self.height(u):
            return None
        self.fixed.add(u)
        return u

    def _put_at(self, v: int, point: Floats) -> None:
        if v >= len(self.place):
            self.place = np.concatenate([self.place, np.zeros_like(self.place)])
        self.place[v] = point

    def _new_vertex(self, point: Floats) -> int:
        v = self.n + self.added
        self.added += 1
        self._put_at(v, point)
        self.around[v] = []
        self.fixed.add(v)
        return v

    def _new_face(self, corners: tuple[int, int, int], of: int) -> None:
        m = len(self.surface.faces)
        old = of if of < m else self.parent[of - m]
        f = m + len(self.parent)
        self.parent.append(old)
        self.parts.setdefault(old, []).append(f)
        self.face[f] = corners
        for v in corners:
            self.star(v).append(f)

    def split(self, a: int, b: int, point: Floats) -> int:
        """A new vertex on an edge."""
        both = [f for f in self.star(a) if b in self.corners(f)]
        x = self._new_vertex(point)
        for f in both:
            for v in self.corners(f):
                self.star(v)
            corners = self.corners(f)
            self.star(b).remove(f)
            self.face[f] = tuple(x if v == b else v for v in corners)  # type: ignore[assignment]
            self.star(x).append(f)
            self._new_face(tuple(x if v == a else v for v in corners), f)  # type: ignore[arg-type]
        self.middle[min(a, b), max(a, b)] = x
        return x

    def put(self, point: Floats, faces: list[int]) -> int:
        """A vertex at a point near some faces: one of theirs, or a new one on an edge or inside."""
        corners = self.place[np.array([self.corners(f) for f in faces])]
        weights, distance = nearest_in_triangles(np.broadcast_to(point, (len(faces), 3)), corners)
        best = int(np.argmin(distance))
        f, weight = faces[best], weights[best]
        point = weight @ corners[best]
        v = self.corners(f)
        near = int(np.argmax(weight))
        if self.takes(v[near], point):
            return v[near]
        thin = int(np.argmin(weight))
        a, b = (thin + 1) % 3, (thin + 2) % 3
        if weight[thin] < NEAR / 2 and self._bends(v[a], v[b], f, point):
            return self.split(v[a], v[b], point)
        if weight[thin] < TOUCHING:
            share = weight[b] / (weight[a] + weight[b])
            return self.split(v[a], v[b], (1 - share) * corners[best, a] + share * corners[best, b])
        x = self._new_vertex(point)
        for u in v:
            self.star(u)
        self.star(v[2]).remove(f)
        self.face[f] = (v[0], v[1], x)
        self.star(x).append(f)
        self._new_face((v[1], v[2], x), f)
        self._new_face((v[2], v[0], x), f)
        return x

    def _bends(self, a: int, b: int, f: int, point: Floats) -> bool:
        """Whether an edge may be bent to a point beside it, in the face f: the triangle behind it keeps its
        shape more or less, and nothing runs along the edge."""
        if a in self.fixed and b in self.fixed:
            return False
        behind = [g for g in self.star(a) if g != f and b in self.corners(g)]
        if len(behind) != 1:
            return False
        corners = self.corners(behind[0])
        old = self.place[np.array(corners)]
        whole = np.cross(old[1] - old[0], old[2] - old[0])
        for end in (a, b):
            part = np.where(np.array(corners)[:, None] == end, point, old)
            area = np.cross(part[1] - part[0], part[2] - part[0])
            if float(area @ whole) < NEAR * NEAR * float(whole @ whole):
                return False
        return True

    def near(self, f: int) -> list[int]:
        """The faces that a face of the surface has become, and those around."""
        parts = [f, *self.parts.get(f, [])]
        return sorted({g for part in parts for v in self.corners(part) for g in self.star(v)})


def _followed(mesh: _Mesh, line: _Line, size: float) -> list[int]:
    """The vertices of a line, in order. size: of the surface. Raises DrawnLineError."""
    points, number, same = line.point.copy(), line.number, SAME * size
    step = np.diff(points, axis=0)
    turn = np.concatenate([[np.pi], angles_between(step[:-1], step[1:]), [np.pi]])
    v = mesh.put(points[0], mesh.near(int(line.face[0])))
    chain = [v]
    if np.linalg.norm(points[-1] - points[0]) <= same:
        points[-1] = mesh.at(v)
    for k in range(1, len(points)):
        stop = turn[k] > TURN
        goal = points[k]
        axis = line.normal[k - 1] + line.normal[k]
        if np.linalg.norm(axis) < OPPOSITE:
            raise line.lost(k)
        begun = len(chain) if turn[k - 1] > TURN else 0  # at a corner
        while True:
            if max(mesh.added, len(chain)) > MOST_VERTICES:
                raise _fault(
                    number,
                    int(line.index[k]),
                    f"The lines cross more than {MOST_VERTICES} edges of the mesh up to line {number}: draw "
                    "fewer lines, or take a coarser mesh.",
                )
            p = mesh.at(v)
            ahead = goal - p
            if float(ahead @ ahead) <= same**2:
                break
            met = mesh.vertex_at(goal, v, ON_VERTEX * size)
            if met is not None:
                v = met
                _append(chain, v)
                break
            crossing = _crossing(mesh, v, ahead, axis)
            if crossing is None:
                raise line.lost(k)
            a, b, x, f = crossing
            way = x - p
            share = float(ahead @ way) / float(way @ way)
            off = np.linalg.norm(ahead - share * way)
            passed = share <= 1 + RELATIVE and off <= BESIDE * np.linalg.norm(way)
            if not passed:
                if np.linalg.norm(x - mesh.at(b)) < np.linalg.norm(x - mesh.at(a)):
                    a, b = b, a
                u = a if mesh.takes(a, x) else mesh.split(a, b, x)
                passed = len(chain) > 1 and u == chain[-2]  # the point lies behind a corner that was taken
                if passed and len(chain) == begun:
                    raise line.lost(k)
            if passed:
                if stop:
                    v = mesh.put(goal, [f] if share <= 1 + RELATIVE else mesh.star(v))
                    _append(chain, v)
                break
            v = u
            chain.append(v)
    if len(chain) < 2:
        raise _fault(
            number, 0, f"Line {number} is shorter than an edge of the mesh there: draw a longer one."
        )
    return chain


def _append(chain: list[int], v: int) -> None:
    if chain[-1] != v:
        chain.append(v)


def _crossing(mesh: _Mesh, v: int, ahead: Floats, normal: Floats) -> tuple[int, int, Floats, int] | None:
    """Where the plane through a vertex, along ``ahead`` and a normal, leaves the triangles around it: an
    edge, the point on it, and the face."""
    faces, others = mesh.fan(v)
    (ax, ay, az), (bx, by, bz) = ahead.tolist(), normal.tolist()  # np.cross takes as long as all the rest
    across = np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
    size = float(np.linalg.norm(across))
    if size <= RELATIVE * float(np.linalg.norm(ahead) * np.linalg.norm(normal)):
        return None
    across = across / size
    p = mesh.at(v)
    a, b = mesh.place[others[:, 0]] - p, mesh.place[others[:, 1]] - p
    da, db = a @ across, b @ across
    cuts = (da * db <= 0) & (da != db)
    if not cuts.any():
        return None
    share = np.where(cuts, da / np.where(cuts, da - db, 1.0), 0.0)
    x = a + share[:, None] * (b - a)
    forward = np.where(cuts, x @ ahead / np.maximum(np.linalg.norm(x, axis=1), np.finfo(float).tiny), -np.inf)
    best = int(np.argmax(forward))
    if forward[best] <= 0:
        return None
    return int(others[best, 0]), int(others[best, 1]), p + x[best], faces[best]


def _built(surface: Surface, mesh: _Mesh, chains: list[list[int]]) -> Surface:
    """The surface with all that was changed."""
    faces = surface.faces.copy()
    m = len(faces)
    changed = [f for f in mesh.face if f < m]
    if changed:
        faces[changed] = [mesh.face[f] for f in changed]
    new = [mesh.face[m + i] for i in range(len(mesh.parent))]
    faces = np.concatenate([faces, np.array(new, dtype=np.int64).reshape(-1, 3)])
    n, count = mesh.n, mesh.added
    at = np.concatenate([np.array(mesh.moved, dtype=np.int64), np.arange(n, n + count)])
    seen = surface.tree.nearest(mesh.place[at])
    vertices = np.concatenate([surface.vertices, np.zeros((count, 3))])
    normals = np.concatenate([surface.normals, np.zeros((count, 3))])
    vertices[at] = mesh.place[at]
    corner = surface.faces[seen.face]
    normals[at] = normalize(np.einsum("kc,kcd->kd", seen.barycentric, surface.normals[corner]))
    parameters = surface.parameters
    if surface.nurbs is not None and parameters is not None and len(at):
        start = start_parameters(surface, seen.face, seen.barycentric)
        parameters = np.concatenate([parameters, np.zeros((count, 2))])
        vertices[at], parameters[at], exact = project(surface.nurbs, vertices[at], start)
        normals[at] = with_tangents(exact, normals[at])
    input_vertex = np.concatenate([surface.input_vertex, np.zeros(count, dtype=np.int64)])
    input_vertex[at] = -1
    patch = surface.patch
    if patch is not None:
        patch = np.concatenate([patch, patch[np.array(mesh.parent, dtype=np.int64)]])
    lines = [np.array(_refined(chain, mesh.middle), dtype=np.int64) for chain in chains]
    drawn = {(min(a, b), max(a, b)) for line in lines for a, b in pairwise(line.tolist())}
    found = [
        piece
        for feature in surface.features
        for piece in _without(feature, _refined(feature.vertices.tolist(), mesh.middle), drawn)
    ]
    finer = replace(
        surface,
        vertices=vertices,
        faces=faces,
        loops=tuple(
            np.array(_refined([*loop.tolist(), int(loop[0])], mesh.middle)[:-1], dtype=np.int64)
            for loop in surface.loops
        ),
        input_vertex=input_vertex,
        normals=normals,
        parameters=parameters,
        patch=patch,
        features=(),
    )
    features = [Feature(line, _fold(finer, line), bool(line[0] == line[-1]), given=True) for line in lines]
    return replace(finer, features=(*features, *found)).knowing(finer)


def _refined(chain: list[int], middle: dict[tuple[int, int], int]) -> list[int]:
    """A chain of edges with the vertices that these were given since."""
    out = [chain[0]]
    for end in chain[1:]:
        stack = [end]
        while stack:
            a, b = out[-1], stack[-1]
            x = middle.get((min(a, b), max(a, b)))
            if x is None:
                out.append(stack.pop())
            else:
                stack.append(x)
    return out


def _without(feature: Feature, chain: list[int], drawn: set[tuple[int, int]]) -> list[Feature]:
    """The pieces of a feature that are not drawn, too."""
    free = [(min(a, b), max(a, b)) not in drawn for a, b in pairwise(chain)]
    if all(free):
        return [replace(feature, vertices=np.array(chain, dtype=np.int64))]
    pieces, run = [], chain[:1]
    for is_free, v in zip([*free, False], [*chain[1:], -1], strict=True):
        if is_free:
            run.append(v)
            continue
        if len(run) > 1:
            pieces.append(replace(feature, vertices=np.array(run, dtype=np.int64), closed=False))
        run = [v]
    return pieces


def _fold(surface: Surface, line: Ints) -> float:
    """The mean angle between the faces beside a chain, radians."""
    h = FeatureEdges.of(surface, (Feature(line, 0.0, False),)).half_edge
    if not len(h):
        return 0.0
    one, two = (
        normalize(face_normals(surface.vertices, surface.faces[side // 3])) for side in (h, surface.twin[h])
    )
    return float(angles_between(one, two).mean())
