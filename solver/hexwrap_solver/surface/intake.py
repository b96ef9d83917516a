"""From a sent mesh to a surface: check, split quads, weld, orient, drop what has no area, check again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Bools, Ints, Ragged, positions
from hexwrap_solver.errors import SurfaceError
from hexwrap_solver.geometry import pair_key
from hexwrap_solver.surface.caps import caps_of, kept
from hexwrap_solver.surface.checks import LISTED, check_arrays, check_extent
from hexwrap_solver.surface.degenerate import flat, repair_flat
from hexwrap_solver.surface.duplicates import equal_faces
from hexwrap_solver.surface.errors import (
    DegeneratePolygonError,
    NonManifoldEdgeError,
    NotOrientableError,
)
from hexwrap_solver.surface.features import chained, folds, lie_along
from hexwrap_solver.surface.genus import (
    SentNames,
    apart,
    check_connected,
    check_edges,
    loops_of,
    not_orientable,
)
from hexwrap_solver.surface.normals import sent_normals
from hexwrap_solver.surface.orient import flipped
from hexwrap_solver.surface.pieces import Piece, divided, inner_pieces, only
from hexwrap_solver.surface.topology import face_graph, vertex_normals
from hexwrap_solver.surface.triangulate import triangulate
from hexwrap_solver.surface.types import (
    Feature,
    FeatureSettings,
    SentMesh,
    Surface,
    SurfaceSettings,
    Triangles,
)
from hexwrap_solver.surface.weld import TOLERANCE, coincident, relabelled, weldings
from hexwrap_solver.words import place

#: At most this many places of what is left out are told.
SHOWN = 5


def surface_from_mesh(sent: SentMesh, settings: SurfaceSettings | None = None) -> Surface:
    """The surface that a sent mesh describes, repaired as far as that leaves its shape alone.

    Floors and inner walls that are welded to it are left out, flat caps of a closed mass taken off, and
    creases found, as the settings say.
    Vertices keep the order in which they were sent. Raises SurfaceError: one child of it per way to fail.
    """
    settings = settings or SurfaceSettings()
    try:
        return _welded(sent, settings)
    except NonManifoldEdgeError as refusal:
        inner = inner_pieces(sent)
        if not inner:
            raise
        keep = np.ones(sent.faces.n_rows, dtype=bool)
        keep[np.concatenate([piece.faces for piece in inner])] = False
        try:
            surface = _welded(only(sent, np.flatnonzero(keep)), settings)
        except SurfaceError:
            raise refusal from None  # which names the faces as they were sent
        left_out = _left_out(inner)
        return replace(surface, repairs=(left_out, *surface.repairs)).knowing(surface)


def _left_out(inner: list[Piece]) -> str:
    """The sentence about floors and inner walls."""
    count, faces = len(inner), sum(len(piece.faces) for piece in inner)
    what = "1 floor or inner wall" if count == 1 else f"{count} floors or inner walls"
    places = ", ".join(place((piece.low + piece.high) / 2) for piece in inner[:SHOWN])
    more = f" and {count - SHOWN} more" if count > SHOWN else ""
    return f"{what} of {faces} face{'s' * (faces > 1)} in all left out, around {places}{more}."


def _welded(sent: SentMesh, settings: SurfaceSettings) -> Surface:
    """The surface with nothing left out but strays without area. Raises SurfaceError."""
    check_arrays(sent)
    vertices = np.ascontiguousarray(sent.vertices, dtype=float)
    triangles, polygon = triangulate(vertices, sent.faces)
    # Both sides of a face that was sent twice may be cut along other diagonals.
    once = (equal_faces(vertices, sent.faces) == np.arange(sent.faces.n_rows))[polygon]
    triangles, polygon = triangles[once], polygon[once]
    used = _mark(triangles, len(vertices))
    size = float(np.linalg.norm([np.ptp(x) for x in vertices[used].T]))
    check_extent(size)
    refusal: SurfaceError | None = None
    mesh = Triangles(vertices, triangles)
    tolerance = TOLERANCE * size
    for label in weldings(mesh, tolerance):
        try:
            return _build(sent, mesh, polygon, label, tolerance, settings)
        except NotOrientableError:  # without the weld at its seam a Möbius band would pass for a strip
            raise
        except SurfaceError as error:  # less welding may help; else the fullest one's error stands
            refusal = refusal or error
    raise refusal or AssertionError("there is always one way to weld")


@dataclass
class _Draft:
    """The mesh on its way, of all sent vertices; polygon: (m,) the sent face of each triangle."""

    mesh: Triangles
    polygon: Ints
    repairs: list[str]

    def note(self, count: int, one: str, many: str, what: str) -> None:
        """Notes a repair of count elements; ``was`` in what agrees with their number."""
        if count:
            noun, was = (one, "was") if count == 1 else (many, "were")
            self.repairs.append(f"{count} {noun} {what.format(was=was)}.")

    @property
    def faces(self) -> Ints:
        return self.mesh.faces

    @faces.setter
    def faces(self, faces: Ints) -> None:
        self.mesh = Triangles(self.mesh.vertices, faces)

    def drop(self, keep: Bools, what: str) -> None:
        if not keep.all():
            self.note(int((~keep).sum()), "triangle", "triangles", what)
            self.faces, self.polygon = self.faces[keep], self.polygon[keep]


def _build(
    sent: SentMesh,
    mesh: Triangles,
    polygon: Ints,
    label: Ints,
    tolerance: float,
    settings: SurfaceSettings,
) -> Surface:
    """The surface that comes of one way of welding: label (n,) the lowest vertex each one is welded to."""
    vertices, n = mesh.vertices, len(mesh.vertices)
    draft = _Draft(relabelled(mesh, label), polygon, [])
    used = _mark(mesh.faces, n)
    unused = ~used if sent.others is None else ~used & ~sent.others
    draft.note(int(unused.sum()), "vertex", "vertices", "that no face uses {was} left out")
    welded = int((used & (label != np.arange(n))).sum())
    draft.note(
        welded, "vertex", "vertices", f"{{was}} welded to one within {TOLERANCE:g} of the model's size"
    )
    twice = sent.faces.n_rows - int(np.count_nonzero(np.diff(polygon, prepend=-1)))
    draft.note(twice, "face", "faces", "with the same corners as another one {was} left out")
    _drop_collapsed(draft)
    equal = equal_faces(np.arange(n, dtype=float)[:, None], Ragged.from_table(draft.faces))
    draft.drop(
        equal == np.arange(len(equal)),
        "with the same corners as another one {was} left out",
    )
    _drop_copies(draft, sent, tolerance)
    _divide(draft, tolerance)
    names = SentNames(np.arange(n), draft.polygon, vertices)
    check_edges(draft.faces, *draft.mesh.edge_groups, names)
    _orient(draft, names)
    _flatten(draft)
    if settings.caps == "drop":
        _uncap(draft)

    origin = np.concatenate([np.arange(n), _untouching(draft, n)])  # of the mesh's vertices
    index = np.flatnonzero(_mark(draft.faces, len(origin)))
    new = positions(index, len(origin))
    faces, index = new[draft.faces], origin[index]
    loops = loops_of(
        vertices[index], faces, draft.mesh.twin, SentNames(index, draft.polygon, vertices[index])
    )
    stand = np.where(used, new[label], -1)
    normals = vertex_normals(vertices[index], faces)
    if sent.normals is not None:
        own = normals
        normals, sentence = sent_normals(own, sent.normals, stand)
        draft.repairs.extend(sentence)
        if sent.creases is not None:  # one sent normal for both sides, of which one may be gone with a cap
            crease = stand[np.unique(sent.creases)]
            crease = crease[crease >= 0]
            normals[crease] = own[crease]
    # Leaving out vertices keeps the order of the others, and so that of the edges.
    repairs = tuple(draft.repairs)
    surface = Surface(vertices[index], faces, loops, index, stand, normals, repairs).knowing(draft.mesh)
    return replace(surface, features=_features(surface, sent, settings)).knowing(draft.mesh)


def _features(surface: Surface, sent: SentMesh, settings: SurfaceSettings) -> tuple[Feature, ...]:
    """Creases that were sent, else the folds of the mesh, less those that are not wanted; in any case inside
    the surface."""
    wanted = settings.features or FeatureSettings()
    asked = wanted.angle
    if sent.creases is not None and sent.fold is not None:
        edges, fold = surface.vertex_of_input[sent.creases], sent.fold
        inner = (edges >= 0).all(axis=1) & (edges[:, 0] != edges[:, 1])
        edges, fold = edges[inner], fold[inner]
    elif asked is None:
        return ()
    else:
        edges, fold = folds(surface, np.deg2rad(asked))
    rim = np.zeros(len(surface.vertices), dtype=bool)
    rim[surface.boundary] = True
    # Edges of the boundary are not creases; nor are edges that a repair has taken out of the mesh.
    low, high = surface.edge_ends
    n = len(surface.vertices)
    inside = (low * n + high)[np.diff(surface.edge_groups[1]) == 2]
    named = pair_key(edges[:, 0], edges[:, 1], n)
    keep = np.searchsorted(inside, named, side="right") > np.searchsorted(inside, named)  # inside ascends
    keep[keep] = ~lie_along(surface.vertices, edges[keep], wanted.without)
    chains = chained(surface.vertices, edges[keep], fold[keep], rim)
    return tuple(replace(chain, given=sent.creases is not None) for chain in chains)


def _uncap(draft: _Draft) -> None:
    """Takes flat caps off a closed mass. The closed surface is kept where that would tear it apart."""
    chosen, sentence = caps_of(draft.mesh)
    if chosen:
        keep = kept(draft.mesh, chosen)
        draft.repairs.append(sentence)
        draft.faces, draft.polygon = draft.faces[keep], draft.polygon[keep]


def _untouching(draft: _Draft, n: int) -> Ints:
    """(k,) vertices in which the surface touches itself, once for every copy that they got."""
    mesh = draft.mesh
    faces, copied = apart(mesh.faces, n, mesh.twin)
    if len(copied):
        places = np.unique(copied)
        at = ", ".join(str(np.round(mesh.vertices[v], 6).tolist()) for v in places[:2])
        draft.note(
            len(places),
            "vertex",
            "vertices",
            f"in which the surface touches itself {{was}} taken apart, at {at}"
            + (f" and {len(places) - 2} more" if len(places) > 2 else ""),
        )
        draft.mesh = Triangles(np.concatenate([mesh.vertices, mesh.vertices[copied]]), faces)
    return copied


def _mark(faces: Ints, n: int) -> Bools:
    """(n,) the vertices that faces use."""
    mark = np.zeros(n, dtype=bool)
    mark[faces.ravel()] = True
    return mark


def _drop_collapsed(draft: _Draft) -> None:
    a, b, c = draft.faces.T
    keep = (a != b) & (b != c) & (c != a)
    if not keep.any():
        raise DegeneratePolygonError("No face has three different corners: send faces that have an area.")
    draft.drop(keep, "without three different corners {was} left out")


def _drop_copies(draft: _Draft, sent: SentMesh, tolerance: float) -> None:
    """Of a mesh in pieces, leaves out faces whose corners are within the tolerance of another one's."""
    pieces, _ = connected_components(face_graph(draft.mesh.twin), directed=False)
    if pieces > 1:
        where = coincident(draft.mesh.vertices, tolerance)[:, None].astype(float)
        once = equal_faces(where, sent.faces) == np.arange(sent.faces.n_rows)
        ends = where[draft.faces, 0]
        small = (ends == np.roll(ends, 1, axis=1)).any(axis=1)  # faces alike in all that is left of them
        draft.drop(
            small | once[draft.polygon],
            f"within {TOLERANCE:g} of the model's size of others {{was}} left out",
        )


def _divide(draft: _Draft, tolerance: float) -> None:
    """Closes T-junctions: divides open edges at vertices of others that lie on them."""
    mesh, polygon, _ = divided(draft.mesh, draft.polygon, tolerance)
    more = len(mesh.faces) - len(draft.faces)
    draft.note(more, "open edge", "open edges", "{was} divided at vertices of others")
    draft.mesh, draft.polygon = mesh, polygon


def _orient(draft: _Draft, names: SentNames) -> None:
    """Turns faces over so that all agree with most of the sent ones."""
    twin = draft.mesh.twin
    check_connected(twin, names)
    weight = 1.0 / np.bincount(draft.polygon)[draft.polygon]
    turn, clash = flipped(draft.faces, twin, weight)
    if len(clash):
        raise not_orientable(draft.faces, clash, names)
    if not turn.any():
        return
    turned = len(np.unique(draft.polygon[turn]))
    draft.note(turned, "face", "faces", "{was} turned over to agree with the others")
    draft.faces = np.where(turn[:, None], draft.faces[:, ::-1], draft.faces)


def _flatten(draft: _Draft) -> None:
    """Repairs triangles without area. Raises DegeneratePolygonError."""
    bad = flat(draft.mesh.lengths)
    if not bad.any():
        return
    draft.faces, keep, left = repair_flat(draft.mesh.vertices, draft.faces)
    if left.any():
        polygons = np.unique(draft.polygon[left])
        raise DegeneratePolygonError(
            f"Face {polygons[0]} has no area: its corners lie on one line, and it cannot be merged into its "
            f"neighbours ({len(polygons)} such in all). Move its middle corner off the line or delete it.",
            faces=polygons[:LISTED],
        )
    if not keep.any():
        raise DegeneratePolygonError(
            "No face has an area beside the size of the whole: send faces that have one."
        )
    draft.note(int(bad.sum()), "triangle", "triangles", "without area {was} merged into the neighbours")
    draft.faces, draft.polygon = draft.faces[keep], draft.polygon[keep]
