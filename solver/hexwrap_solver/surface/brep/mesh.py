"""Triangle mesh of a Brep: every edge divided once, faces filled, and sewn together by the edges' vertices.

The mesh is watertight wherever the Brep is, by construction: two faces that share an edge share its vertices,
and no tolerance is involved.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely

from hexwrap_solver.arrays import Floats, Ints, positions
from hexwrap_solver.geometry import angles_between, dot, normalize, quarter_turn
from hexwrap_solver.surface.brep.curves import corners, curvature, evaluate_curve, places
from hexwrap_solver.surface.brep.face import Outline, Piece, key_of, piece_of, polygon_of
from hexwrap_solver.surface.brep.kinks import crossings, kink_lines, kinks_of
from hexwrap_solver.surface.brep.pull import Patch, free, lifted, patch_of, pull
from hexwrap_solver.surface.brep.sizes import Field, Sizes, field_of, meeting, sized
from hexwrap_solver.surface.brep.types import Brep, Edge, Face, Trim
from hexwrap_solver.surface.brep.whole import check_brep
from hexwrap_solver.surface.errors import EmptySurfaceError, FlatSurfaceError
from hexwrap_solver.surface.mesh_sizes import GRADE, ROW, check_number, check_settings
from hexwrap_solver.surface.nurbs import evaluate
from hexwrap_solver.surface.topology import sum_rows
from hexwrap_solver.surface.types import MeshSettings
from hexwrap_solver.tolerances import TINY

#: Normals of two faces that differ by more than this along their edge make a crease, radians.
CREASE = np.deg2rad(5.0)
#: A surface with less area than this part of its largest face's size, squared, is a curve.
FLAT = 1e-10
#: Normals beside an edge are taken this part of the face's box away from it.
BESIDE = 1e-4


@dataclass(frozen=True)
class BrepMesh:
    """vertices: (n, 3). faces: (m, 3), the outside as in the Brep. normals: (n, 3) unit.

    face: (m,) the Brep's face of each triangle. uv: (m, 3, 2) the parameters of its corners there.
    creases: (k, 2) mesh edges at which faces meet at an angle, and fold: (k,) that angle, radians.
    """

    vertices: Floats
    faces: Ints
    normals: Floats
    face: Ints
    uv: Floats
    creases: Ints
    fold: Floats


@dataclass
class _Side:
    """A face on its way: where its trims run in the parameters' plane, at the edges' first places."""

    face: Face
    patch: Patch
    loops: list[list[Floats | None]]
    coarse: shapely.Geometry
    kinks: list[tuple[int, float]]
    field: Field


@dataclass(frozen=True)
class _Divided:
    """An edge with its mesh vertices: parameters t (k,), points (k, 3) and ids (k,), its ends included."""

    t: Floats
    points: Floats
    id: Ints


def mesh_brep(brep: Brep, settings: MeshSettings | None = None) -> BrepMesh:
    """No edge is longer than settings.max_edge, and no edge's middle is further than settings.tolerance from
    the surface (or, on the Brep's edges, from the edge). Raises TrimError, TooFineError, NurbsDataError."""
    settings = settings or MeshSettings()
    check_settings(settings)
    if not brep.faces:
        raise EmptySurfaceError("The polysurface has no faces.")
    check_brep(brep)
    used = sorted({t.edge for face in brep.faces for loop in face.loops for t in loop if t.edge >= 0})
    first = {e: places(brep.edges[e]) for e in used}
    at = {e: evaluate_curve(brep.edges[e].curve, t) for e, t in first.items()}
    sides = [
        _side(face, name, brep, {e: a[0] for e, a in at.items()}) for name, face in enumerate(brep.faces)
    ]
    area = sum(side.field.area for side in sides)
    if area < FLAT * max(side.patch.size for side in sides) ** 2:
        raise FlatSurfaceError(
            "The surface has no area, it has shrunk to a curve: run SelBadObjects in Rhino, or Undo what has "
            "flattened it."
        )
    sizes = Sizes.of(settings, area)
    for side in sides:
        side.field = sized(side.field, sizes)
    uses = _uses(sides)
    wanted = {e: _wanted(sizes, at[e], [uv for _, uv in uses[e]], [s for s, _ in uses[e]]) for e in used}
    for e in used:
        for side, uv in uses[e]:
            side.field = meeting(side.field, at[e][0], uv, wanted[e])
    check_number(sum(side.field.total(side.field.h) for side in sides) / ROW, settings.max_vertices)
    marks = {e: _marks(brep.edges[e], first[e], uses[e]) for e in used}
    divided = _divided(brep, used, first, at, wanted, marks, sizes)
    return _sewn(brep, sides, divided, first, sizes, settings.max_vertices)


def _side(face: Face, name: int, brep: Brep, points: dict[int, Floats]) -> _Side:
    patch = patch_of(face.surface, brep.tolerance)
    loops = lifted(patch, face, points, brep.tolerance, name)
    corners = [np.concatenate([t for t in loop if t is not None]) for loop in loops]
    ends = np.cumsum([0, *map(len, corners)])
    coarse = shapely.make_valid(polygon_of(np.concatenate(corners), ends))
    return _Side(face, patch, loops, coarse, kinks_of(patch, coarse), field_of(patch, coarse))


def _uses(sides: list[_Side]) -> dict[int, list[tuple[_Side, Floats]]]:
    """For every edge, the faces it bounds and its first places in their parameters, in its own direction."""
    out: dict[int, list[tuple[_Side, Floats]]] = {}
    for side in sides:
        for loop, lines in zip(side.face.loops, side.loops, strict=True):
            for trim, uv in zip(loop, lines, strict=True):
                if uv is not None:
                    out.setdefault(trim.edge, []).append((side, uv[:: -1 if trim.reversed else 1]))
    return out


def _wanted(sizes: Sizes, at: tuple[Floats, Floats, Floats], uvs: list[Floats], sides: list[_Side]) -> Floats:
    """(k,) edge lengths along an edge: its own curvature and the faces beside it, slowly changing."""
    point, tangent, bend = at
    h = sizes.at(curvature(tangent, bend))
    for side, uv in zip(sides, uvs, strict=True):
        h = np.minimum(h, side.field.wanted(uv))
    x = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(point, axis=0), axis=1))])
    return np.asarray((h[:, None] + GRADE * np.abs(x[:, None] - x)).min(axis=0))


def _marks(edge: Edge, t: Floats, uses: list[tuple[_Side, Floats]]) -> Floats:
    """Ascending parameters that must be vertices: ends, corners, and where kinks of faces are crossed."""

    def point(x: Floats) -> Floats:
        return evaluate_curve(edge.curve, x)[0]

    low, high = edge.interval
    own = corners(edge)
    found = [x for side, uv in uses for x in crossings(side.patch, side.kinks, t, uv, point)]
    margin = 1e-6 * (high - low)
    inner = list(own)
    for x in sorted(found):
        if low + margin < x < high - margin and all(abs(x - y) > margin for y in inner):
            inner.append(x)
    return np.array([low, *sorted(inner), high])


def _divided(
    brep: Brep,
    used: list[int],
    first: dict[int, Floats],
    at: dict[int, tuple[Floats, Floats, Floats]],
    wanted: dict[int, Floats],
    marks: dict[int, Floats],
    sizes: Sizes,
) -> dict[int, _Divided]:
    """All edges with their vertices; the Brep's own vertices come first."""
    alike = Counter(frozenset((brep.edges[e].start, brep.edges[e].end)) for e in used)
    next_id = len(brep.vertices)
    out = {}
    for e in used:
        edge = brep.edges[e]
        ends = frozenset((edge.start, edge.end))
        least = 3 if len(ends) == 1 else 2 if alike[ends] > 1 else 1
        t = _parameters(edge, first[e], wanted[e], marks[e], least, sizes)
        points = evaluate_curve(edge.curve, t)[0]
        points[0], points[-1] = brep.vertices[edge.start], brep.vertices[edge.end]
        inner = np.arange(next_id, next_id + len(t) - 2)
        next_id += len(inner)
        out[e] = _Divided(t, points, np.concatenate([[edge.start], inner, [edge.end]]))
    return out


def _parameters(
    edge: Edge,
    t: Floats,
    wanted: Floats,
    marks: Floats,
    least: int,
    sizes: Sizes,
) -> Floats:
    """Parameters of an edge's vertices: between marks, evenly in units of the wanted length."""
    dense = np.linspace(0, 1, 5)[:-1]
    fine = np.append((t[:-1, None] + np.diff(t)[:, None] * dense).ravel(), t[-1])
    fine = np.union1d(fine, marks)
    point = evaluate_curve(edge.curve, fine)[0]
    h = np.interp(fine, t, wanted)
    steps = np.linalg.norm(np.diff(point, axis=0), axis=1) * 2 / (h[1:] + h[:-1])
    total = np.concatenate([[0.0], np.cumsum(steps)])
    out = [marks[:1]]
    for low, high in pairwise(marks):
        a, b = np.interp([low, high], fine, total)
        n = max(int(np.ceil(b - a - 1e-6)), 1, -(-least // (len(marks) - 1)))
        inner = np.interp(a + (b - a) * np.arange(1, n) / n, total, fine)
        out += [inner, np.array([high])]
    made = np.concatenate(out)
    return _refined(edge, made, sizes)


def _refined(edge: Edge, t: Floats, sizes: Sizes) -> Floats:
    """Chords that are too long or too far off the edge are halved."""
    for _ in range(12):
        middle = (t[1:] + t[:-1]) / 2
        point = evaluate_curve(edge.curve, t)[0]
        chord = np.diff(point, axis=0)
        length = np.linalg.norm(chord, axis=1)
        offset = evaluate_curve(edge.curve, middle)[0] - (point[1:] + point[:-1]) / 2
        along = dot(offset, chord) / np.maximum(length, TINY) ** 2
        height = np.linalg.norm(offset - along[:, None] * chord, axis=1)
        bad = (length > sizes.longest) | (height > sizes.height)
        if not bad.any():
            break
        t = np.union1d(t, middle[bad])
    return t


def _sewn(
    brep: Brep,
    sides: list[_Side],
    divided: dict[int, _Divided],
    first: dict[int, Floats],
    sizes: Sizes,
    most: int,
) -> BrepMesh:
    total = max([len(brep.vertices), *(int(d.id.max()) + 1 for d in divided.values())])
    points = [np.zeros((total, 3))]
    for d in divided.values():
        points[0][d.id] = d.points
    faces, names, uvs, around = [], [], [], []
    flanks: dict[int, list[Floats]] = {}
    creases, folds = [], []
    taken = {key for d in divided.values() for key in key_of(d.id[:-1], d.id[1:]).tolist()}
    for name, side in enumerate(sides):
        outline, trims = _outline(side, divided, first, brep)
        outline = kink_lines(side.patch, side.kinks, side.field, outline, brep.tolerance)
        piece = piece_of(side.patch, outline, side.field, sizes, most, name, taken)
        label = np.concatenate([outline.id, np.full(len(piece.uv) - len(outline.id), -1)])
        fresh = label < 0
        label[fresh] = total + np.arange(int(fresh.sum()))
        total += int(fresh.sum())
        points.append(piece.points[fresh])
        live = np.unique(piece.faces)
        around.append((label[live], _outward(side, piece.uv[live])))
        turn = [0, 2, 1] if side.face.reversed else [0, 1, 2]
        faces.append(label[piece.faces][:, turn])
        uvs.append(_corners_at(piece)[:, turn])
        names.append(np.full(len(piece.faces), name))
        for trim, corner in trims:
            own = _beside(side, outline.uv[corner[:-1]], outline.uv[corner[1:]])
            agrees = 1.0 if trim.reversed == side.face.reversed else -1.0
            flanks.setdefault(trim.edge, []).append(
                np.concatenate([own, np.full((len(own), 1), agrees)], axis=1)[:: -1 if trim.reversed else 1]
            )
        one, two = piece.uv[piece.lines[:, 0]], piece.uv[piece.lines[:, 1]]
        fold = angles_between(_beside(side, one, two), _beside(side, two, one))
        creases.append(label[piece.lines][fold > CREASE])
        folds.append(fold[fold > CREASE])
    for e, pair in flanks.items():
        if len(pair) != 2:
            continue
        one, two = pair
        # Faces that run through their edge in the same direction look to different sides of the surface.
        fold = angles_between(one[:, :3], two[:, :3] * (-1.0 if one[0, 3] == two[0, 3] else 1.0))
        id = divided[e].id
        creases.append(np.stack([id[:-1], id[1:]], axis=1)[fold > CREASE])
        folds.append(fold[fold > CREASE])
    labels, normals = (np.concatenate(x) for x in zip(*around, strict=True))
    return _compacted(
        BrepMesh(
            np.concatenate(points),
            np.concatenate(faces),
            normalize(sum_rows(normals, labels, total)),
            np.concatenate(names),
            np.concatenate(uvs),
            np.concatenate(creases),
            np.concatenate(folds),
        )
    )


def _outline(
    side: _Side, divided: dict[int, _Divided], first: dict[int, Floats], brep: Brep
) -> tuple[Outline, list[tuple[Trim, Ints]]]:
    """The boundary of a face by the vertices of its edges; and for every trim its corners, end to end."""
    uv: list[Floats] = []
    points: list[Floats] = []
    ids: list[Ints] = []
    starts, count = [0], 0
    trims: list[tuple[Trim, Ints]] = []
    for loop, lines in zip(side.face.loops, side.loops, strict=True):
        made = [
            None if line is None else _pulled(side, trim, line, divided[trim.edge], first[trim.edge])
            for trim, line in zip(loop, lines, strict=True)
        ]
        for k, trim in enumerate(loop):
            own = made[k]
            if own is None:
                before = next(x for x in (made[k - j] for j in range(1, len(made))) if x is not None)
                part = before[0][-1:], brep.vertices[[trim.start]], np.array([trim.start])
            else:
                part = own[0][:-1], own[1][:-1], own[2][:-1]
                trims.append((trim, count + np.arange(len(own[2]))))
            uv.append(part[0])
            points.append(part[1])
            ids.append(part[2])
            count += len(part[2])
        for _, corner in trims:
            corner[corner == count] = starts[-1]
        starts.append(count)
    outline = Outline(
        np.concatenate(ids),
        np.concatenate(uv),
        np.concatenate(points),
        np.array(starts),
        np.zeros((0, 2), dtype=np.int64),
    )
    return outline, trims


def _corners_at(piece: Piece) -> Floats:
    """(m, 3, 2) parameters of the corners of triangles; at poles, what is free lies between the other two."""
    uv = piece.uv[piece.faces]
    others = (uv.sum(axis=1, keepdims=True) - uv) / 2
    return np.where(piece.loose[piece.faces], others, uv)


def _pulled(side: _Side, trim: Trim, line: Floats, edge: _Divided, t: Floats) -> tuple[Floats, Floats, Ints]:
    """Parameters, points and mesh vertices along a trim, in its direction."""
    turn = -1 if trim.reversed else 1
    coarse = line[::turn]
    near = np.stack([np.interp(edge.t, t, coarse[:, d]) for d in (0, 1)], axis=1)
    uv, _ = pull(side.patch, edge.points, near)
    uv = np.where(free(side.patch, near), near, uv)
    uv = np.clip(uv, side.patch.low, side.patch.low + side.patch.width)
    return uv[::turn], edge.points[::turn], edge.id[::turn]


def _outward(side: _Side, uv: Floats) -> Floats:
    """(k, 3) unit normals of a face; at poles those close by."""
    width = BESIDE * side.patch.width
    inset = np.clip(uv, side.patch.low + width, side.patch.low + side.patch.width - width)
    normal = evaluate(side.patch.opened, inset).normal
    return -normal if side.face.reversed else normal


def _beside(side: _Side, one: Floats, two: Floats) -> Floats:
    """(k, 3) outward normals just to the left of segments in the parameters' plane."""
    box = np.array([side.field.u[-1] - side.field.u[0], side.field.v[-1] - side.field.v[0]])
    along = (two - one) / box
    left = normalize(quarter_turn(along))
    uv = np.clip((one + two) / 2 + BESIDE * left * box, side.patch.low, side.patch.low + side.patch.width)
    normal = evaluate(side.patch.opened, uv).normal
    return -normal if side.face.reversed else normal


def _compacted(mesh: BrepMesh) -> BrepMesh:
    """The mesh without vertices that no face uses, and without triangles that a short edge has taken away."""
    a, b, c = mesh.faces.T
    keep = (a != b) & (b != c) & (c != a)
    used = np.unique(mesh.faces[keep])
    new = positions(used, len(mesh.vertices))
    return replace(
        mesh,
        vertices=mesh.vertices[used],
        faces=new[mesh.faces[keep]],
        normals=mesh.normals[used],
        face=mesh.face[keep],
        uv=mesh.uv[keep],
        creases=new[mesh.creases],
    )
