"""From a sent mesh to an annulus: check, split quads, weld, orient, drop what has no area, check again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.errors import SurfaceError
from hexwrap_solver.surface.annulus import (
    SentNames,
    annulus_loops,
    check_connected,
    check_edges,
    not_orientable,
)
from hexwrap_solver.surface.checks import LISTED, check_arrays, check_extent
from hexwrap_solver.surface.degenerate import flat, repair_flat
from hexwrap_solver.surface.duplicates import first_of_equals
from hexwrap_solver.surface.errors import DegeneratePolygonError
from hexwrap_solver.surface.normals import sent_normals
from hexwrap_solver.surface.orient import flipped
from hexwrap_solver.surface.topology import edge_groups, twins, twins_of, vertex_normals
from hexwrap_solver.surface.triangulate import triangulate
from hexwrap_solver.surface.types import SentMesh, Surface
from hexwrap_solver.surface.weld import TOLERANCE, weldings


def surface_from_mesh(sent: SentMesh) -> Surface:
    """The annulus that a sent mesh describes, repaired as far as that leaves its shape alone.

    Vertices keep the order in which they were sent. Raises SurfaceError: one child of it per way to fail.
    """
    check_arrays(sent)
    vertices = np.ascontiguousarray(sent.vertices, dtype=float)
    triangles, polygon = triangulate(vertices, sent.faces)
    used = _mark(triangles, len(vertices))
    size = float(np.linalg.norm([np.ptp(x) for x in vertices[used].T]))
    check_extent(size)
    refusal: SurfaceError | None = None
    for label in weldings(vertices, triangles, TOLERANCE * size):
        try:
            return _build(sent, vertices, triangles, polygon, label)
        except SurfaceError as error:  # less welding may help; where it does not, the fullest one's is told
            refusal = refusal or error
    raise refusal or AssertionError("there is always one way to weld")


@dataclass
class _Draft:
    """The mesh on its way. faces: (m, 3) into all sent vertices; polygon: (m,) the sent face of each."""

    faces: Ints
    polygon: Ints
    repairs: list[str]

    def tell(self, count: int, one: str, many: str, what: str) -> None:
        """Notes a repair of count elements; ``was`` in what agrees with their number."""
        if count:
            noun, was = (one, "was") if count == 1 else (many, "were")
            self.repairs.append(f"{count} {noun} {what.format(was=was)}.")

    def drop(self, keep: Bools, what: str) -> None:
        self.tell(int((~keep).sum()), "triangle", "triangles", what)
        self.faces, self.polygon = self.faces[keep], self.polygon[keep]


def _build(sent: SentMesh, vertices: Floats, triangles: Ints, polygon: Ints, label: Ints) -> Surface:
    """The annulus that comes of one way of welding: label (n,) the lowest vertex each one is welded to."""
    n = len(vertices)
    draft = _Draft(label[triangles], polygon, [])
    used = _mark(triangles, n)
    draft.tell(int(n - used.sum()), "vertex", "vertices", "that no face uses {was} left out")
    welded = int((used & (label != np.arange(n))).sum())
    draft.tell(
        welded, "vertex", "vertices", f"{{was}} welded to one within {TOLERANCE:g} of the model's size"
    )
    _drop_collapsed(draft)
    order, first = _drop_duplicates(draft, n)
    grouped = draft.faces
    names = SentNames(np.arange(n), draft.polygon)
    check_edges(draft.faces, order, first, names)
    twin = _orient(draft, twins_of(order, first), n, names)
    twin = _flatten(draft, vertices, twin, n)

    index = np.flatnonzero(_mark(draft.faces, n))
    new = np.full(n, -1, dtype=np.int64)
    new[index] = np.arange(len(index))
    faces = new[draft.faces]
    loops = annulus_loops(faces, twin, len(index), SentNames(index, draft.polygon))
    stand = np.where(used, new[label], -1)
    normals = vertex_normals(vertices[index], faces)
    if sent.normals is not None:
        normals, sentence = sent_normals(normals, sent.normals, stand)
        draft.repairs.extend(sentence)
    surface = Surface(vertices[index], faces, loops, index, stand, normals, tuple(draft.repairs))
    # Leaving out vertices keeps the order of the others, and so that of the edges.
    return surface.knowing((order, first)) if draft.faces is grouped else surface


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


def _drop_duplicates(draft: _Draft, n: int) -> tuple[Ints, Ints]:
    """The edge groups of what remains."""
    order, first = edge_groups(draft.faces, n)
    keep = first_of_equals(draft.faces, order, first)
    if keep.all():
        return order, first
    draft.drop(keep, "with the same corners as another one {was} left out")
    return edge_groups(draft.faces, n)


def _orient(draft: _Draft, twin: Ints, n: int, names: SentNames) -> Ints:
    """Turns faces over so that all agree with most of the sent ones; the twins after that."""
    check_connected(twin, names)
    weight = 1.0 / np.bincount(draft.polygon)[draft.polygon]
    turn, clash = flipped(draft.faces, twin, weight)
    if len(clash):
        raise not_orientable(draft.faces, clash, names)
    if not turn.any():
        return twin
    turned = len(np.unique(draft.polygon[turn]))
    draft.tell(turned, "face", "faces", "{was} turned over to agree with the others")
    draft.faces = np.where(turn[:, None], draft.faces[:, ::-1], draft.faces)
    return twins(draft.faces, n)


def _flatten(draft: _Draft, vertices: Floats, twin: Ints, n: int) -> Ints:
    """Repairs triangles without area; the twins after that. Raises DegeneratePolygonError."""
    bad = flat(vertices, draft.faces)
    if not bad.any():
        return twin
    draft.faces, keep, left = repair_flat(vertices, draft.faces)
    if left.any():
        polygons = np.unique(draft.polygon[left])
        raise DegeneratePolygonError(
            f"Face {polygons[0]} has no area: its corners lie on one line, and it cannot be merged into its "
            f"neighbours ({len(polygons)} such in all). Move its middle corner off the line or delete it.",
            faces=polygons[:LISTED],
        )
    draft.tell(int(bad.sum()), "triangle", "triangles", "without area {was} merged into the neighbours")
    draft.faces, draft.polygon = draft.faces[keep], draft.polygon[keep]
    return twins(draft.faces, n)
