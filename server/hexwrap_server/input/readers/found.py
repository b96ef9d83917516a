"""What a file of any format holds: objects that can be chosen, its unit and its tolerance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from hexwrap_solver.arrays import Ints
from hexwrap_solver.surface import NurbsSurface, SentMesh
from hexwrap_solver.surface.brep import Brep
from hexwrap_solver.surface.checks import check_arrays
from hexwrap_solver.surface.pieces import Piece, only, pieces
from hexwrap_solver.surface.triangulate import cut_polygons

#: A piece of an object with less than this part of its largest piece's area is a stray.
STRAY = 0.01

#: What stands for blocks whose content lies in another file.
LINKED = "blocks that are linked or empty"

Geometry = SentMesh | NurbsSurface | Brep


@dataclass(frozen=True)
class Found:
    """An object of a file that is a mesh or a surface.

    kind: Rhino's word for it. size: of its bounding box. read: its geometry, converted when it is asked for.
    attributes: user strings. within: names and layers of the block instances that it is in, outermost first.
    """

    id: str
    name: str
    kind: str
    size: tuple[float, float, float]
    read: Callable[[], Geometry]
    layer: str = ""
    visible: bool = True
    locked: bool = False
    attributes: dict[str, str] = field(default_factory=dict)
    within: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class FileContent:
    """unit: ``m``, ``cm``, ``mm``, ``ft``, ``in`` or None. tolerance: of the file, in its unit; None where
    the format has none. others: what else is there, by kind. odd_unit: the file's own unit, if it is none of
    these. notes: what was changed in reading.

    mesh, owner: where the objects are faces (m,) of one table of vertices, the whole table; its vertices keep
    their numbers, independent of the choice. whole: the mesh, where it is one object and known to be one
    piece.
    """

    objects: tuple[Found, ...]
    unit: str | None = None
    tolerance: float | None = None
    others: Counter[str] = field(default_factory=Counter)
    mesh: SentMesh | None = None
    owner: Ints | None = None
    whole: Piece | None = None
    odd_unit: str = ""
    notes: tuple[str, ...] = ()

    def noted(self, sentence: str) -> FileContent:
        """With one more note, before the others."""
        return replace(self, notes=(sentence, *self.notes))


def of_mesh(mesh: SentMesh, names: Sequence[tuple[str, str]] = (), owner: Ints | None = None) -> FileContent:
    """The content of a file that is one table of vertices and faces.

    names: (name, layer) of each object, owner: (m,) the object of each face; without, the pieces of the mesh
    that do not hang together are its objects, but for strays. Polygons are cut into triangles, and edges
    that were written as faces left out. Raises SurfaceError.
    """
    real = np.flatnonzero(mesh.faces.lengths > 2)
    if 0 < len(real) < mesh.faces.n_rows and mesh.faces.values.max() < len(mesh.vertices):
        content = of_mesh(only(mesh, real), names, None if owner is None else owner[real])
        left = mesh.faces.n_rows - len(real)
        return content.noted(f"Faces with fewer than three corners were left out, {left:,} in all.")
    if mesh.vertices.ndim == 2 and mesh.vertices.shape[1] == 3:
        faces, row = cut_polygons(mesh.vertices, mesh.faces)
        if faces is not mesh.faces:
            content = of_mesh(replace(mesh, faces=faces), names, None if owner is None else owner[row])
            return content.noted(_cut(int((np.bincount(row) > 1).sum())))
    check_arrays(mesh)
    if owner is not None and len(names) > 1:
        order = np.argsort(owner, kind="stable")
        each = np.split(order, np.searchsorted(owner[order], np.arange(1, len(names))))
        return FileContent(_objects(mesh, names, each), mesh=mesh, owner=owner)
    found = pieces(mesh)
    large = [piece.faces for piece in found if piece.area >= STRAY * found[0].area]
    if len(large) < 2:
        name = names[0][0] if names else ""
        (whole,) = _objects(mesh, [(name, "")], [np.arange(mesh.faces.n_rows)])
        return FileContent(
            (whole,), mesh=mesh, owner=_none(mesh), whole=found[0] if len(found) == 1 else None
        )
    owner = _none(mesh)
    for i, own in enumerate(large):
        owner[own] = i
    objects = _objects(mesh, [(f"part {i}", "") for i in range(len(large))], large)
    return FileContent(objects, mesh=mesh, owner=owner)


def _cut(count: int) -> str:
    what = "polygon" if count == 1 else "polygons"
    return (
        f"{count:,} {what} with more than four corners {'was' if count == 1 else 'were'} cut into triangles."
    )


def _objects(mesh: SentMesh, names: Sequence[tuple[str, str]], each: Sequence[Ints]) -> tuple[Found, ...]:
    """Objects of those names and layers and of each of those faces. There may be very many of them: their
    sizes are found together, and their meshes when they are asked for."""
    corners = mesh.faces.take(np.concatenate(each))
    points = mesh.vertices[corners.values]
    ends = np.append(0, corners.offsets[np.cumsum([len(faces) for faces in each])])
    held = np.flatnonzero(np.diff(ends))
    sizes = np.zeros((len(each), 3))
    sizes[held] = np.maximum.reduceat(points, ends[held]) - np.minimum.reduceat(points, ends[held])
    return tuple(
        Found(str(i), name, "mesh", (x, y, z), partial(only, mesh, faces), layer)
        for i, ((name, layer), faces, (x, y, z)) in enumerate(zip(names, each, sizes.tolist(), strict=True))
    )


def _none(mesh: SentMesh) -> Ints:
    return np.zeros(mesh.faces.n_rows, dtype=np.int64)
