"""Which of the objects of a file are meant, and what becomes of them: chosen, joined, strays left out.

First, those that are named, or else all that are visible and not locked. Then what meets along its edges is
joined. Of the parts that are left, the only one that can be meant is taken: a tube before a closed mass before
a surface with one boundary curve, and of several such one that is far larger than the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_server.input.readers.errors import NoObjectError, SeveralObjectsError, UnreadableFileError
from hexwrap_server.input.readers.found import STRAY, FileContent, Found, Geometry
from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.surface import NurbsSurface, SentMesh
from hexwrap_solver.surface.brep import Brep
from hexwrap_solver.surface.brep.join import joined as joined_brep
from hexwrap_solver.surface.brep.types import together as one_brep
from hexwrap_solver.surface.brep.whole import brep_of_surface
from hexwrap_solver.surface.checks import check_arrays
from hexwrap_solver.surface.pieces import Joint, Piece, joined, only, pieces, together

#: Of several parts that could be meant, one whose area is so many times that of the next is meant.
DOMINANT = 10.0
#: Edges that nearly meet are told up to so many times the tolerance.
NEARLY = 100.0
#: The tolerance of a file counts up to this part of the size of what is joined.
COARSEST = 1e-3
#: Sentences name at most so many objects, problems list at most so many.
SHOWN, LISTED = 5, 200


@dataclass(frozen=True)
class Chosen:
    """What a file stands for. told: sentences for the user. used: the objects it is made of."""

    geometry: Geometry
    used: tuple[Found, ...]
    told: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Part:
    """Something that hangs together. members: places of its objects. area: of a mesh, or of control nets.

    make: its geometry. rim: (k, 3) points on its boundary.
    """

    members: tuple[int, ...]
    loops: int
    area: float
    rim: Floats
    place: Floats
    make: Callable[[], Geometry]
    faces: int = 0

    @property
    def rank(self) -> int:
        return 0 if self.loops > 1 else 1 if self.loops == 0 else 2


def choose(
    content: FileContent, object: str | int | None = None, layer: str | None = None, unit: str | None = None
) -> Chosen:
    """Raises NoObjectError, SeveralObjectsError, UnreadableFileError, SurfaceError."""
    meant = named(content, object, layer)
    unit = unit or content.unit
    if content.mesh is None and len(meant) == 1 and not isinstance(meant[0].read(), SentMesh):
        return Chosen(meant[0].read(), (meant[0],), _others(content, meant))
    if content.is_whole and content.mesh is not None:
        return Chosen(content.mesh, tuple(meant))
    parts, told = _parts(content, meant)
    if not parts:
        raise UnreadableFileError("The file holds no faces.")
    best = min(part.rank for part in parts)
    fitting = sorted((part for part in parts if part.rank == best), key=lambda part: -part.area)
    if len(fitting) > 1 and fitting[0].area < DOMINANT * fitting[1].area:
        raise several(
            content, [meant[i] for part in fitting for i in part.members], len(fitting), unit
        )
    part = fitting[0]
    used = [meant[i] for i in part.members]
    told += _nearly(part, [other for other in parts if other is not part], meant, content.tolerance)
    return Chosen(part.make(), tuple(used), (*told, *_others(content, used)))


def named(content: FileContent, object: str | int | None, layer: str | None) -> list[Found]:
    """Objects that are named, or those in sight. Raises NoObjectError."""
    objects = content.objects
    if not objects:
        others = ", ".join(f"{count} {kind}" for kind, count in sorted(content.others.items()))
        raise UnreadableFileError(
            f"The file holds no mesh, surface, polysurface, extrusion or SubD ({others or 'nothing at all'}): "
            "in Rhino, make one with Loft, ExtrudeCrv or NetworkSrf, or run ExtractSrf on a solid."
        )
    if object is None and layer is None:
        seen = [found for found in objects if found.visible and not found.locked]
        if seen:
            return seen
        raise NoObjectError(
            f"All {len(objects)} surfaces of the file are hidden, locked or on layers that are off: show them "
            f"in Rhino, or name the one that is meant ({listed(objects, content.unit)}).",
            data={"objects": rows(objects)},
        )
    found = [item for i, item in enumerate(objects) if _is_named(item, i, object) and _is_on(item, layer)]
    if not found and object is not None:  # a name may look like a number, a number is no pattern
        found = [item for item in objects if str(object) == item.name and _is_on(item, layer)]
    if found:
        return found
    what = " and ".join(
        ([f"is named '{object}'"] if object is not None else [])
        + ([f"is on layer '{layer}'"] if layer is not None else [])
    )
    raise NoObjectError(
        f"No surface of the file {what}; there are {listed(objects, content.unit)}.",
        data={"objects": rows(objects)},
    )


def _is_named(found: Found, number: int, object: str | int | None) -> bool:
    if object is None:
        return True
    word = str(object).strip().lower()
    return (
        word in (str(number), found.id.lower(), *found.id.lower().split("/"))
        or fnmatchcase(found.name.lower(), word)
    )


def _is_on(found: Found, layer: str | None) -> bool:
    """A layer stands for those below it; a single name for every layer of that name."""
    if layer is None:
        return True
    word = layer.strip().lower()
    steps = found.layer.lower().split("::")
    paths = ["::".join(steps[i : k + 1]) for k in range(len(steps)) for i in (0, k)]
    return any(fnmatchcase(path, word) for path in paths)


def _parts(content: FileContent, meant: Sequence[Found]) -> tuple[list[_Part], list[str]]:
    """Everything that hangs together after joining, without strays; and what is to be told."""
    told: list[str] = []
    parts: list[_Part] = []
    if content.mesh is not None and content.owner is not None:
        place = {id(found): i for i, found in enumerate(meant)}
        lookup = np.array([place.get(id(found), -1) for found in content.objects], dtype=np.int64)
        owner = lookup[content.owner]
        mesh = only(content.mesh, np.flatnonzero(owner >= 0))
        parts += _mesh_parts(mesh, owner[owner >= 0], content.tolerance, meant, told)
        return parts, told
    read = [found.read() for found in meant]
    at = [i for i, geometry in enumerate(read) if isinstance(geometry, SentMesh)]
    if at:
        mesh, source = together([geometry for geometry in read if isinstance(geometry, SentMesh)])
        parts += _mesh_parts(mesh, np.array(at)[source], content.tolerance, meant, told)
    rest = [i for i in range(len(read)) if i not in set(at)]
    if rest:
        parts += _brep_parts([(i, read[i]) for i in rest], content.tolerance, meant, told)
    return parts, told


def _mesh_parts(
    mesh: SentMesh, owner: Ints, tolerance: float | None, meant: Sequence[Found], told: list[str]
) -> list[_Part]:
    check_arrays(mesh)
    if tolerance is not None:
        size = float(np.linalg.norm(np.ptp(mesh.vertices[mesh.faces.values], axis=0)))
        mesh, source, joint = joined(mesh, min(tolerance, COARSEST * size))
        owner = owner[source]
        told += _joint(joint, tolerance, len(np.unique(owner)))
    found = pieces(mesh)
    by_owner: dict[int, float] = {}
    for piece in found:
        for i in np.unique(owner[piece.faces]).tolist():
            by_owner[i] = max(by_owner.get(i, 0.0), piece.area)
    kept, strays = [], []
    for piece in found:
        members = np.unique(owner[piece.faces]).tolist()
        is_stray = all(piece.area < STRAY * by_owner[i] for i in members)
        (strays if is_stray else kept).append(piece)
    told += _strays(strays)

    def part(piece: Piece) -> _Part:
        members = tuple(np.unique(owner[piece.faces]).tolist())
        return _Part(
            members, piece.loops, piece.area, piece.rim, (piece.low + piece.high) / 2,
            lambda: only(mesh, piece.faces), len(piece.faces),
        )  # fmt: skip

    return [part(piece) for piece in kept]


def _brep_parts(
    objects: list[tuple[int, Geometry]], tolerance: float | None, meant: Sequence[Found], told: list[str]
) -> list[_Part]:
    """Surfaces and polysurfaces, their open edges joined where they meet."""
    breps = []
    for _, geometry in objects:
        if isinstance(geometry, Brep):
            breps.append(geometry)
        elif isinstance(geometry, NurbsSurface):
            size = float(np.linalg.norm(np.ptp(geometry.control_points[..., :3].reshape(-1, 3), axis=0)))
            breps.append(brep_of_surface(geometry, min(tolerance or 1e-6 * size, COARSEST * size)))
    whole = one_brep(breps)
    owner = np.repeat([i for i, _ in objects], [len(brep.faces) for brep in breps])
    single = len(objects) == 1
    if not single:
        whole, joints = joined_brep(whole)
        joint = Joint(joints.count, joints.gap, tuple(joints.place.tolist()))
        told += _joint(joint, whole.tolerance, len(objects))
    found = []
    for faces in _connected(whole):
        members = tuple(np.unique(owner[faces]).tolist())
        rim, loops = _naked(whole, faces)
        own = [geometry for i, geometry in objects if i in members]
        found.append(
            _Part(
                members, loops, _net_area(whole, faces), rim, _center(whole, faces),
                (lambda g=own[0]: g) if len(own) == 1 else (lambda f=tuple(faces): _some(whole, f)),
                len(faces),
            )
        )  # fmt: skip
    return found


def _some(brep: Brep, faces: Iterable[int]) -> Brep:
    return Brep(brep.vertices, brep.edges, tuple(brep.faces[f] for f in faces), brep.tolerance)


def _connected(brep: Brep) -> list[list[int]]:
    """Faces that hang together across edges."""
    label = list(range(len(brep.faces)))

    def root(f: int) -> int:
        while label[f] != f:
            label[f] = label[label[f]]
            f = label[f]
        return f

    first: dict[int, int] = {}
    for f, face in enumerate(brep.faces):
        for loop in face.loops:
            for trim in loop:
                if trim.edge >= 0:
                    label[root(f)] = root(first.setdefault(trim.edge, f))
    groups: dict[int, list[int]] = {}
    for f in range(len(brep.faces)):
        groups.setdefault(root(f), []).append(f)
    return list(groups.values())


def _naked(brep: Brep, faces: Sequence[int]) -> tuple[Floats, int]:
    """Ends of edges with one face only, and the number of closed curves that these edges make."""
    uses: dict[int, int] = {}
    for f in faces:
        for loop in brep.faces[f].loops:
            for trim in loop:
                if trim.edge >= 0:
                    uses[trim.edge] = uses.get(trim.edge, 0) + 1
    naked = [e for e, count in uses.items() if count == 1]
    label: dict[int, int] = {}

    def root(v: int) -> int:
        while label.setdefault(v, v) != v:
            v = label[v]
        return v

    for e in naked:
        label[root(brep.edges[e].start)] = root(brep.edges[e].end)
    ends = sorted(label)
    return brep.vertices[ends], len({root(v) for v in ends})


def _net_area(brep: Brep, faces: Sequence[int]) -> float:
    total = 0.0
    for f in faces:
        net = brep.faces[f].surface.control_points[..., :3]
        one, two = net[1:, 1:] - net[:-1, :-1], net[1:, :-1] - net[:-1, 1:]
        total += float(np.linalg.norm(np.cross(one, two), axis=-1).sum()) / 2
    return total


def _center(brep: Brep, faces: Sequence[int]) -> Floats:
    points = np.concatenate([brep.faces[f].surface.control_points[..., :3].reshape(-1, 3) for f in faces])
    return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2)


def _joint(joint: Joint, tolerance: float, objects: int) -> list[str]:
    if joint.count == 0 or joint.gap == 0.0:
        return []
    what = f"{objects} objects" if objects > 1 else "open edges"
    return [
        f"Joined {what} within the file's tolerance of {tolerance:g}: the greatest gap closed was "
        f"{joint.gap:.3g}, at {point(joint.place)}."
    ]


def _strays(strays: Sequence[Piece]) -> list[str]:
    if not strays:
        return []
    places = ", ".join(point((piece.low + piece.high) / 2) for piece in strays[:SHOWN])
    more = f" and {len(strays) - SHOWN} more" if len(strays) > SHOWN else ""
    faces = sum(len(piece.faces) for piece in strays)
    noun = "piece" if len(strays) == 1 else "pieces"
    return [
        f"{len(strays)} stray {noun} of {faces} face{'s' * (faces > 1)} in all left out, at {places}{more}."
    ]


def _nearly(
    part: _Part, others: Sequence[_Part], meant: Sequence[Found], tolerance: float | None
) -> list[str]:
    """Where edges of another part come near, but not within the tolerance."""
    if tolerance is None or not len(part.rim):
        return []
    told = []
    tree = cKDTree(part.rim)
    for other in others:
        if not len(other.rim):
            continue
        distance, _ = tree.query(other.rim)
        k = int(np.argmin(distance))
        if tolerance < distance[k] < NEARLY * tolerance:
            told.append(
                f"{_label(meant[other.members[0]], other.members[0])} comes within {distance[k]:.3g} of the "
                f"surface at {point(other.rim[k])}, more than the file's tolerance of {tolerance:g}, and was not "
                "joined: close the gap with Rhino's MatchSrf or JoinEdge."
            )
    return told[:SHOWN]


def _others(content: FileContent, used: Sequence[Found]) -> tuple[str, ...]:
    """What was taken and what was not, where there was a choice."""
    kept = {id(found) for found in used}
    left = [found for found in content.objects if id(found) not in kept]
    if not left:
        return ()
    taken = ", ".join(described(found, i, content.unit) for i, found in enumerate(content.objects)
                      if id(found) in kept)  # fmt: skip
    return (f"Taken: {taken}. Left out: {listed(left, content.unit, content.objects)}.",)


def several(
    content: FileContent, objects: Sequence[Found], count: int, unit: str | None
) -> SeveralObjectsError:
    distinct = list({id(found): found for found in objects}.values())
    if len(distinct) < 2:
        return SeveralObjectsError(
            f"The mesh is in {count} pieces of about the same size that do not meet: delete those that are not "
            "meant, or join them along their edges (in Rhino: SplitDisjointMesh shows them).",
            data={"objects": rows(content.objects)},
        )
    return SeveralObjectsError(
        f"The file holds {len(distinct)} objects that could be meant: "
        f"{listed(distinct, unit, content.objects)}. Name one with --object or --layer ('object' or 'layer' of "
        "the surface in a request), or hide the others; edges that meet within the file's tolerance are joined.",
        data={"objects": rows(content.objects)},
    )


def listed(objects: Sequence[Found], unit: str | None, among: Sequence[Found] | None = None) -> str:
    number = {id(found): i for i, found in enumerate(among or objects)}
    shown = ", ".join(described(found, number[id(found)], unit) for found in objects[:SHOWN])
    return shown + (f" and {len(objects) - SHOWN} more" if len(objects) > SHOWN else "")


def described(found: Found, number: int, unit: str | None) -> str:
    """Name, kind, layer and size in one phrase."""
    size = " × ".join(f"{x:.4g}" for x in found.size)
    layer = f" on layer {found.layer}" if found.layer else ""
    return f"{_label(found, number)} ({found.kind}{layer}, {size}{' ' + unit if unit else ''})"


def _label(found: Found, number: int) -> str:
    return f"'{found.name}'" if found.name else f"object {number}"


def rows(objects: Sequence[Found], used: Sequence[Found] = ()) -> list[dict[str, Any]]:
    """As POST /v1/surfaces answers them."""
    kept = {id(found) for found in used}
    return [
        {
            "id": found.id,
            "name": found.name,
            "layer": found.layer,
            "kind": found.kind,
            "visible": found.visible and not found.locked,
            "size": list(found.size),
            "used": id(found) in kept,
        }
        for found in objects[:LISTED]
    ]


def point(place: Iterable[float]) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in place) + ")"

