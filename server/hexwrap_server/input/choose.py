"""Which of the objects of a file are meant, and what becomes of them: chosen, joined, strays left out.

First, those that are named, or else all that are visible and not locked. Copies on top of each other count
once, and what meets along its edges is joined. Of the parts that are left, the one that can be meant is
taken: the largest, where a tube counts for more than a closed mass or a surface with one boundary curve, and
low ground for least, unless another comes near it that has another shape or another name.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from hexwrap_server.errors import NoObjectError, SeveralObjectsError, UnreadableFileError
from hexwrap_server.input.object_words import (
    apart_from,
    coarse_numbers,
    copies,
    joint,
    label,
    listed,
    odd_unit,
    others,
    rows,
    spoilt,
    strays,
)
from hexwrap_server.input.parts import COARSEST, Part, brep_where_needed, parts_of, size_of
from hexwrap_server.input.readers.found import LINKED, FileContent, Found, Geometry
from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface.closest import TriangleTree
from hexwrap_solver.surface.weld import TOLERANCE
from hexwrap_solver.words import place

#: Of several parts that could be meant, one that counts for this many times the next is meant.
DOMINANT = 1.3
#: A part that nearly meets the best one is left out only if that counts for this many times as much.
TORN = 10.0
#: The area of what is not a tube counts for this part of it, that of ground, and that of what is flat.
NO_TUBE, GROUND, PLANE = 1 / 20, 1 / 400, 1e-6
#: Parts are alike whose sizes and areas differ by no more than this part.
ALIKE = 0.01
#: A part thinner than this part of its size is flat; ground is lower than this.
FLAT, LOW = 1e-4, 0.1
#: Edges that nearly meet are reported up to this many times the tolerance, those of one part if they are
#: further apart along the boundary by a factor.
NEARLY, ALONG = 100.0, 6.0
#: A mesh and a surface meet that have so many points in common; a slit is looked for at so many places.
MEETING, PLACES = 3, 100
#: Said where closed masses touch; among more parts than these none are looked for.
UNITE = "Closed masses that touch become one with Rhino's BooleanUnion (meshes: MeshBooleanUnion)."
MOST_MASSES = 50
#: Rhino's command for gaps between edges of meshes.
MATCH = "MatchMeshEdge"
#: At most this many such places are reported.
SHOWN = 5
#: Of more objects than these, only the largest are looked at.
MOST = 300


@dataclass(frozen=True)
class Chosen:
    """What a file stands for. notes: sentences for the user. used: the objects it is made of."""

    geometry: Geometry
    used: tuple[Found, ...]
    notes: tuple[str, ...] = ()


def choose(
    content: FileContent, object: str | None = None, layer: str | None = None, unit: str | None = None
) -> Chosen:
    """Raises NoObjectError, SeveralObjectsError, UnreadableFileError, SurfaceError."""
    meant = named(content, object, layer)
    odd = (*content.notes, *odd_unit(content, unit))
    unit = unit or content.unit
    if content.whole is not None and content.mesh is not None:
        torn = slits(content.whole.boundary, size_of(content.mesh.vertices), None)
        return Chosen(content.mesh, tuple(meant), (*torn, *coarse_numbers(content.mesh, None), *odd))
    meant = sorted(meant, key=lambda item: -max(item.size))[:MOST]
    found = parts_of(content, meant)
    if not found.parts:
        raise UnreadableFileError(found.spoilt[0][1] if found.spoilt else "The file holds no faces.")
    fitting = sorted(found.parts, key=_weight, reverse=True)
    best = fitting[0]
    alike = [other for other in fitting if _is_alike(other, best, meant)]
    apart = _nearly(best, [other for other in fitting if other is not best], meant, content)
    rivals = [
        other
        for other in fitting
        if all(other is not one for one in alike)
        and _weight(best) < (TORN if id(other) in apart else DOMINANT) * _weight(other)
    ]
    if rivals:
        near = [other for other in fitting if other is best or any(other is one for one in rivals)]
        gaps = [apart[id(other)] for other in rivals if id(other) in apart]
        if any(_touch(one, two, content.tolerance) for one, two in combinations(near[:MOST_MASSES], 2)):
            gaps.append(UNITE)
        fins = sum(part.is_fin for part in near)
        raise several(content, [meant[i] for part in near for i in part.members], len(near), unit, gaps, fins)
    part = next((other for other in alike if _is_exact(other, meant)), best)
    used = [meant[i] for i in part.members]
    geometry, notes = brep_where_needed(part.make(), content.tolerance)
    if len(used) > 1 or len(meant) == 1:
        notes += joint(part.joint, content.tolerance, len(used))
    notes += apart_from([other.box for other in found.parts if other is not part and _shares(other, part)])
    notes += strays([piece for members, piece in found.strays if members & set(part.members)])
    notes += list(apart.values())[:SHOWN]
    if any(_touch(part, other, content.tolerance) for other in fitting[:MOST_MASSES] if other is not part):
        notes.append(UNITE)
    notes += slits(part.boundary, size_of(part.box), content.tolerance, _commands([part], meant))
    notes += coarse_numbers(geometry, content.tolerance)
    notes += [*copies(len(found.copies)), *spoilt(found.spoilt, meant, content), *others(content, used), *odd]
    return Chosen(geometry, tuple(used), tuple(notes))


def _weight(part: Part) -> float:
    """How much speaks for a part: its area, and what it is."""
    if part.loops > 1:
        return part.area
    size = np.ptp(part.box, axis=0)
    if size.min() <= FLAT * np.linalg.norm(size):
        return PLANE * part.area
    is_ground = part.loops == 1 and size[2] <= LOW * np.linalg.norm(size)
    return (GROUND if is_ground else NO_TUBE) * part.area


def _is_alike(one: Part, other: Part, meant: Sequence[Found]) -> bool:
    """Whether it makes no difference which of the two is taken: same size, and no names that differ."""
    names = [{meant[i].name for i in part.members} - {""} for part in (one, other)]
    if all(names) and names[0] != names[1]:
        return False
    size, other_size = np.sort(np.ptp(one.box, axis=0)), np.sort(np.ptp(other.box, axis=0))
    near = np.abs(size - other_size).max() <= ALIKE * np.linalg.norm(size)
    in_place = np.abs(one.box - other.box).max() <= ALIKE * np.linalg.norm(size)
    return bool(near and (in_place or abs(one.area - other.area) <= ALIKE * one.area))


def _touch(one: Part, other: Part, tolerance: float | None) -> bool:
    """Whether both are closed and their boxes meet."""
    meet = (one.box[0] <= other.box[1] + (tolerance or 0)) & (other.box[0] <= one.box[1] + (tolerance or 0))
    return one.loops == other.loops == 0 and bool(meet.all())


def _shares(one: Part, other: Part) -> bool:
    """Whether both are of one object."""
    return bool(set(one.members) & set(other.members))


def _is_exact(part: Part, meant: Sequence[Found]) -> bool:
    """Whether it is a surface rather than the mesh of one."""
    return all(meant[i].kind != "mesh" for i in part.members)


def named(content: FileContent, object: str | None, layer: str | None) -> list[Found]:
    """Objects that are named, or those in sight. Raises NoObjectError."""
    objects = content.objects
    if not objects:
        held = ", ".join(f"{kind}: {count}" for kind, count in sorted(content.others.items()))
        raise UnreadableFileError(
            f"The file holds no mesh, surface, polysurface, extrusion or SubD ({held or 'nothing at all'}): "
            "in Rhino, "
            + ("embed linked blocks with BlockManager, or " if LINKED in content.others else "")
            + "make one with Loft, ExtrudeCrv or NetworkSrf, and save it with the file."
        )
    if object is None and layer is None:
        seen = [found for found in objects if found.visible and not found.locked]
        if seen:
            return seen
        raise NoObjectError(
            f"{_all(len(objects))} hidden, locked or on a layer that is off: run Show, Unlock or LayerOn in "
            f"Rhino, or name what is meant with --object or --layer ({listed(objects, content.unit)}).",
            data={"objects": rows(objects)},
        )
    on = [(i, item) for i, item in enumerate(objects) if _is_on(item, layer)]
    exact = [item for _, item in on if object is not None and _plain(object) in map(_plain, _names(item))]
    found = exact or [item for i, item in on if _is_named(item, i, object)]
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


def _all(count: int) -> str:
    return "The only surface of the file is" if count == 1 else f"All {count} surfaces of the file are"


def _is_named(found: Found, number: int, object: str | None) -> bool:
    if object is None:
        return True
    word = _plain(object)
    ways = (str(number), f"object {number}", label(found, number), found.id, *found.id.split("/"))
    return word in map(_plain, ways) or any(_fits(name, word) for name in _names(found))


def _names(found: Found) -> list[str]:
    """Its own, and those of the block instances that it is in, and of their blocks."""
    return list(filter(None, (found.name, *(name for name, _ in found.within))))


def _plain(text: str) -> str:
    """Capitals, and the ways to write an accent, make no difference."""
    return unicodedata.normalize("NFC", text.strip()).casefold()


def _fits(text: str, word: str) -> bool:
    """``*`` and ``?`` of a plain word stand for any letters; brackets for one of theirs, or themselves."""
    return any(fnmatchcase(_plain(text), way) for way in (word, word.replace("[", "[[]")))


def _is_on(found: Found, layer: str | None) -> bool:
    """A layer stands for those below it; the last steps of a path for every layer that has them. A block
    instance is on its own layer, and so is what is in it."""
    if layer is None:
        return True
    word = _plain(layer).removeprefix("…::")  # as hexwrap inspect shortens paths
    for path in (found.layer, *(layer for _, layer in found.within)):
        steps = path.split("::")
        ends = range(1, len(steps) + 1)
        if any(_fits("::".join(steps[i:k]), word) for k in ends for i in range(k)):
            return True
    return False


def _nearly(
    part: Part, others: Sequence[Part], meant: Sequence[Found], content: FileContent
) -> dict[int, str]:
    """Where edges of other parts come near, but not within the tolerance: a sentence by id of the part."""
    size = float(np.linalg.norm(np.ptp(part.box, axis=0)))
    tolerance = TOLERANCE * size if content.tolerance is None else content.tolerance
    reach = COARSEST * size if content.tolerance is None else NEARLY * tolerance
    allowed = "" if content.tolerance is None else f", more than the file's tolerance of {tolerance:g},"
    number = {id(item): i for i, item in enumerate(content.objects)}
    if not len(part.boundary):
        return {}
    notes = {}
    tree = _tree(part)
    for other in others:
        box = part.box + np.array([[-reach], [reach]])
        if not len(other.boundary) or (other.box[1] < box[0]).any() or (other.box[0] > box[1]).any():
            continue
        own, its = part.boundary[:, 0], other.boundary[:, 0]
        ends = np.concatenate([its, own])
        distance = np.concatenate([tree.nearest(its).distance, _tree(other).nearest(own).distance])
        corner = np.concatenate([cKDTree(own).query(its)[0], cKDTree(its).query(own)[0]])
        distance = np.where((distance > tolerance) & (corner < reach), corner, distance)
        k = int(np.argmin(np.where(distance > tolerance, distance, np.inf)))
        first = label(meant[other.members[0]], number[id(meant[other.members[0]])])
        name = f"{first[0].upper()}{first[1:]}"
        met = np.flatnonzero(distance <= tolerance)
        if len(met) >= MEETING and _is_mesh(part, meant) != _is_mesh(other, meant):
            notes[id(other)] = (
                f"{name} meets the surface at {place(ends[met[0]])} and was not joined, because meshes "
                "are not joined with surfaces: make a mesh of both with Rhino's Mesh."
            )
        elif tolerance < distance[k] < reach:
            notes[id(other)] = (
                f"{name} comes within {distance[k]:.3g} of the surface at {place(ends[k])}{allowed} and was "
                f"not joined: close the gap with Rhino's {_commands([part, other], meant)}."
            )
    return notes


def slits(boundary: Floats, size: float, tolerance: float | None, commands: str = MATCH) -> list[str]:
    """About edges of a part that nearly meet each other, and not only along the boundary (k, 2, 3)."""
    whose = "gaps that are welded, up to" if tolerance is None else "the file's tolerance of"
    tolerance = tolerance or TOLERANCE * size
    if not len(boundary) or NEARLY * tolerance > LOW * size:
        return []
    points = boundary.reshape(-1, 3)
    tree, n = cKDTree(points), len(points)
    same = tree.query_pairs(tolerance, output_type="ndarray")
    _, name = connected_components(coo_array((np.ones(len(same)), same.T), shape=(n, n)), directed=False)
    near = tree.query_pairs(NEARLY * tolerance, output_type="ndarray")
    near = near[name[near[:, 0]] != name[near[:, 1]]]
    near = near[:: 1 + len(near) // PLACES]
    if not len(near):
        return []
    length = np.linalg.norm(points[::2] - points[1::2], axis=1)
    along = coo_array((length, (name[::2], name[1::2])), shape=(n, n)).tocsr()
    reach = ALONG * NEARLY * tolerance
    way = dijkstra(along, directed=False, indices=name[near[:, 0]], limit=reach)
    near = near[np.isinf(way[np.arange(len(near)), name[near[:, 1]]])]
    if len(near) < 2:
        return []
    apart = np.linalg.norm(points[near[:, 0]] - points[near[:, 1]], axis=1)
    k = int(apart.argmin())
    at = place(points[near[k, 0]])
    return [
        f"Edges of the surface come within {apart[k]:.3g} of each other at {at}, more than {whose} "
        f"{tolerance:g}, and were left open: close the gap with Rhino's {commands}."
    ]


def _tree(part: Part) -> TriangleTree:
    """Of its boundary, edges being triangles without area."""
    n = 2 * np.arange(len(part.boundary))
    return TriangleTree.build(part.boundary.reshape(-1, 3), np.stack([n, n + 1, n + 1], axis=1))


def _is_mesh(part: Part, meant: Sequence[Found]) -> bool:
    return all(meant[i].kind in ("mesh", "SubD") for i in part.members)


def _commands(parts: Sequence[Part], meant: Sequence[Found]) -> str:
    """What closes gaps between them in Rhino."""
    return MATCH if any(_is_mesh(part, meant) for part in parts) else "MatchSrf or JoinEdge"


def several(
    content: FileContent,
    objects: Sequence[Found],
    count: int,
    unit: str | None,
    gaps: Sequence[str] = (),
    fins: int = 0,
) -> SeveralObjectsError:
    """fins: how many of the parts touch larger ones without being joined to them along an edge."""
    distinct = list({id(found): found for found in objects}.values())
    if len(distinct) > 1:
        sentence = (
            f"The file holds {len(distinct)} objects that could be meant: "
            f"{listed(distinct, unit, content.objects)}. Name one with --object or --layer ('object' or "
            "'layer' of the surface in a request), or hide the others; edges that meet within the file's "
            f"tolerance are joined. {' '.join(gaps[:SHOWN])}"
        ).rstrip()
    elif fins:
        sentence = (
            f"The mesh falls into {count} pieces of about the same size, which meet only at vertices and at "
            "edges that more than two faces share: remove inner walls and double faces (Rhino's "
            "ExtractNonManifoldMeshEdges finds them, ExtractDuplicateMeshFaces those that are double)."
        )
    else:
        sentence = (
            f"The mesh is in {count} pieces of about the same size that do not meet: delete those that are "
            "not meant, or join them along their edges (in Rhino: SplitDisjointMesh shows them)."
        )
    return SeveralObjectsError(sentence, data={"objects": rows(content.objects)})
