"""What hangs together in a file: meshes and surfaces joined along their edges, and what bounds them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hexwrap_server.input.readers.found import STRAY, FileContent, Found, Geometry
from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.errors import SurfaceError
from hexwrap_solver.surface import NurbsSurface, SentMesh
from hexwrap_solver.surface.brep import Brep
from hexwrap_solver.surface.brep.curves import evaluate_curve, places
from hexwrap_solver.surface.brep.join import joined as joined_brep
from hexwrap_solver.surface.brep.types import together as one_brep
from hexwrap_solver.surface.brep.whole import brep_of_surface, check_brep
from hexwrap_solver.surface.checks import check_arrays
from hexwrap_solver.surface.nurbs_checks import TOLERANCE, closed_within, end_gap
from hexwrap_solver.surface.pieces import Joint, Piece, joined, only, pieces, together

#: Of more pieces of a mesh than these, only the largest count; the rest are strays.
MOST = 300
#: The tolerance of a file counts up to this part of the size of what is joined.
COARSEST = 1e-3


@dataclass(frozen=True)
class Part:
    """Something that hangs together. members: places of its objects. area: of a mesh, or of control nets.

    make: its geometry. boundary: (k, 2, 3) pieces of its boundary curves. box: (2, 3) its lowest and highest
    coordinates.
    """

    members: tuple[int, ...]
    loops: int
    area: float
    boundary: Floats
    box: Floats
    make: Callable[[], Geometry]
    joint: Joint
    is_fin: bool = False


@dataclass(frozen=True)
class Parts:
    """strays: small pieces that were left out, with the places of their objects.

    spoilt: objects that cannot be read, with the reason. copies: objects that another one covers exactly.
    """

    parts: list[Part] = field(default_factory=list)
    strays: list[tuple[set[int], Piece]] = field(default_factory=list)
    spoilt: list[tuple[int, str]] = field(default_factory=list)
    copies: list[int] = field(default_factory=list)


def parts_of(content: FileContent, meant: Sequence[Found]) -> Parts:
    """Everything that hangs together after joining. Raises SurfaceError for a lone object that is broken."""
    found = Parts()
    if content.mesh is not None and content.owner is not None:
        place = {id(item): i for i, item in enumerate(meant)}
        lookup = np.array([place.get(id(item), -1) for item in content.objects], dtype=np.int64)
        owner = lookup[content.owner]
        mesh = only(content.mesh, np.flatnonzero(owner >= 0))
        check_arrays(mesh)
        _add_meshes(mesh, owner[owner >= 0], content.tolerance, found)
        return found
    meshes: list[tuple[int, SentMesh]] = []
    others: list[tuple[int, NurbsSurface | Brep]] = []
    prints: list[Floats] = []
    for i, item in enumerate(meant):
        try:
            geometry = item.read()
            if len(meant) > 1:
                prints.append(_print_of(geometry))
                if _is_copy(prints, content.tolerance):
                    found.copies.append(i)
                    continue
            if isinstance(geometry, SentMesh):
                check_arrays(geometry)
                meshes.append((i, geometry))
            else:
                check_brep(geometry)
                others.append((i, geometry))
        except SurfaceError as error:
            if len(meant) == 1:
                raise
            found.spoilt.append((i, error.detail))
    if meshes:
        mesh, source = together([geometry for _, geometry in meshes])
        member = np.array([i for i, _ in meshes])
        at = np.repeat(member, [len(geometry.vertices) for _, geometry in meshes])
        _add_meshes(mesh, member[source], content.tolerance, found, at)
    if others:
        _add_breps(others, content.tolerance, found)
    return found


def _print_of(geometry: Geometry) -> Floats:
    """(13,) what tells a geometry from others whichever way its parameters run: the number, box, mean and
    spread of the points that define it."""
    if isinstance(geometry, SentMesh):
        nets = [geometry.vertices[geometry.faces.values]]
    elif isinstance(geometry, Brep):
        nets = [geometry.vertices, *(face.surface.control_points[..., :3] for face in geometry.faces)]
    else:
        nets = [geometry.control_points[..., :3]]
    points = np.concatenate([net.reshape(-1, 3) for net in nets])
    if not len(points):
        return np.zeros(13)
    ends = np.concatenate([points.min(axis=0), points.max(axis=0)])
    return np.concatenate([[len(points)], ends, points.mean(axis=0), points.std(axis=0)])


def _is_copy(prints: list[Floats], tolerance: float | None) -> bool:
    """Whether the last one is the print of an earlier one; if so, it is taken off the list."""
    last, before = prints[-1], np.array(prints[:-1]).reshape(-1, len(prints[-1]))
    near = _allowed(tolerance, float(np.linalg.norm(last[4:7] - last[1:4])))
    same = ((before[:, 0] == last[0]) & (np.abs(before - last) <= near).all(axis=1)).any()
    if same:
        prints.pop()
    return bool(same)


def _add_meshes(
    mesh: SentMesh, owner: Ints, tolerance: float | None, found: Parts, at: Ints | None = None
) -> None:
    """owner: (m,) the object of each face. at: (n,) that of each vertex, where objects have their own; a part
    then has those of its own objects alone."""
    mesh, source, joint = joined(mesh, _allowed(tolerance, size_of(mesh.vertices[mesh.faces.values])))
    owner = owner[source]
    split = [(piece, np.unique(owner[piece.faces]).tolist()) for piece in pieces(mesh)]
    largest: dict[int, float] = {}
    for piece, members in split:  # the largest come first
        for i in members:
            largest.setdefault(i, piece.area)
    for k, (piece, members) in enumerate(split):
        if k >= MOST or all(piece.area < STRAY * largest[i] for i in members):
            found.strays.append((set(members), piece))
        else:
            found.parts.append(
                Part(
                    tuple(members),
                    piece.loops,
                    piece.area,
                    piece.boundary,
                    np.array([piece.low, piece.high]),
                    partial(_of_objects, mesh, piece.faces, None if at is None else np.isin(at, members)),
                    joint,
                    piece.is_fin,
                )
            )


def _of_objects(mesh: SentMesh, faces: Ints, own: Bools | None) -> SentMesh:
    """Those faces, with the vertices that are their own (n,), or that they use; None: all."""
    part = only(mesh, faces)
    if own is None or own.all():
        return part
    own[part.faces.values] = True
    number = np.cumsum(own) - 1
    normals = None if part.normals is None else part.normals[own]
    return SentMesh(part.vertices[own], Ragged(number[part.faces.values], part.faces.offsets), normals)


def _add_breps(objects: list[tuple[int, NurbsSurface | Brep]], tolerance: float | None, found: Parts) -> None:
    """Surfaces and polysurfaces, their open edges joined where they meet."""
    breps = [
        geometry
        if isinstance(geometry, Brep)
        else brep_of_surface(geometry, _allowed(tolerance, size_of(geometry.control_points[..., :3])))
        for _, geometry in objects
    ]
    whole = one_brep(breps)
    owner = np.repeat([i for i, _ in objects], [len(brep.faces) for brep in breps])
    joint = Joint()
    if len(objects) > 1:
        whole, joints = joined_brep(whole)
        x, y, z = joints.place.tolist()
        joint = Joint(joints.count, joints.gap, (x, y, z))
    for faces in _connected(whole):
        members = tuple(np.unique(owner[faces]).tolist())
        own = [geometry for i, geometry in objects if i in members]
        boundary, loops = _naked(whole, faces)
        is_whole = len(own) == 1 and (owner == members[0]).sum() == len(faces)
        make = partial(_same, own[0]) if is_whole else partial(_some, whole, faces)
        nets = np.concatenate([whole.faces[f].surface.control_points[..., :3].reshape(-1, 3) for f in faces])
        box = np.array([nets.min(axis=0), nets.max(axis=0)])
        found.parts.append(Part(members, loops, _net_area(whole, faces), boundary, box, make, joint))


def _same(geometry: Geometry) -> Geometry:
    return geometry


def size_of(points: Floats) -> float:
    return float(np.linalg.norm(np.ptp(points.reshape(-1, 3), axis=0)))


def _allowed(tolerance: float | None, size: float) -> float:
    """The file's tolerance as far as it is sane, and never less than rounding."""
    return max(TOLERANCE * size, min(tolerance or 0.0, COARSEST * size))


def brep_where_needed(geometry: Geometry, tolerance: float | None) -> tuple[Geometry, list[str]]:
    """The NURBS surface itself where it is closed in one direction and has no pole, else a Brep of one face
    whose ends are one seam where they meet within the file's tolerance; and notes for the user."""
    if not isinstance(geometry, NurbsSurface):
        return geometry, []
    size = size_of(geometry.control_points[..., :3])
    exact, wide = TOLERANCE * size, _allowed(tolerance, size)
    is_tube = sum(closed_within(geometry, exact)) == 1
    brep = brep_of_surface(geometry, exact if is_tube else wide)
    if is_tube and all(trim.edge >= 0 for loop in brep.faces[0].loops for trim in loop):
        return geometry, []
    notes = [
        f"The ends of the surface in {'uv'[d]} are up to {end_gap(geometry, d):.3g} apart and were made one "
        f"seam, within the file's tolerance of {wide:g}."
        for d in (0, 1)
        if closed_within(geometry, wide)[d] and not closed_within(geometry, exact)[d]
    ]
    return brep, notes


def _some(brep: Brep, faces: Iterable[int]) -> Brep:
    return Brep(brep.vertices, brep.edges, tuple(brep.faces[f] for f in faces), brep.tolerance)


def _connected(brep: Brep) -> list[list[int]]:
    """Faces that hang together across edges."""
    uses = _uses(brep, range(len(brep.faces)))
    n, nodes = len(brep.faces), len(brep.faces) + len(brep.edges)
    label = _components(uses[:, 0], n + uses[:, 1], nodes)[:n]
    return [np.flatnonzero(label == k).tolist() for k in dict.fromkeys(label.tolist())]


def _naked(brep: Brep, faces: Sequence[int]) -> tuple[Floats, int]:
    """(k, 2, 3) chords of edges with one face only, and the number of closed curves that these edges make."""
    edge, count = np.unique(_uses(brep, faces)[:, 1], return_counts=True)
    naked = [brep.edges[k] for k in edge[count == 1]]
    ends = np.array([(e.start, e.end) for e in naked], dtype=np.int64)
    start, end = ends.reshape(-1, 2).T
    loops = len(np.unique(_components(start, end, len(brep.vertices))[np.unique(ends)]))
    lines = [evaluate_curve(e.curve, places(e))[0] for e in naked]
    chords = [np.stack([line[:-1], line[1:]], axis=1) for line in lines]
    return np.concatenate([np.zeros((0, 2, 3)), *chords]), loops


def _uses(brep: Brep, faces: Iterable[int]) -> Ints:
    """(k, 2) face and edge, wherever a face has an edge on its boundary."""
    trims = ((f, trim.edge) for f in faces for loop in brep.faces[f].loops for trim in loop)
    return np.array([use for use in trims if use[1] >= 0], dtype=np.int64).reshape(-1, 2)


def _components(one: Ints, other: Ints, n: int) -> Ints:
    """(n,) label of each node of a graph with these edges."""
    graph = coo_array((np.ones(len(one)), (one, other)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1])


def _net_area(brep: Brep, faces: Sequence[int]) -> float:
    total = 0.0
    for f in faces:
        net = brep.faces[f].surface.control_points[..., :3]
        one, two = net[1:, 1:] - net[:-1, :-1], net[1:, :-1] - net[:-1, 1:]
        total += float(np.linalg.norm(np.cross(one, two), axis=-1).sum()) / 2
    return total
