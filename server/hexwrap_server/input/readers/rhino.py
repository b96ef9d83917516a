"""Rhino's .3dm: meshes, surfaces, polysurfaces, extrusions and SubDs, in blocks or not."""

from __future__ import annotations

import re
from collections import Counter
from itertools import product
from typing import Any

import numpy as np
import rhino3dm

from hexwrap_server.errors import UnreadableFileError
from hexwrap_server.input.readers.found import LINKED, FileContent, Found, Geometry
from hexwrap_server.input.readers.rhino_brep import brep_of, nurbs_surface, rhino_mesh, subd_mesh
from hexwrap_server.input.readers.rhino_model import MOST_OBJECTS, Model, Placed, TooManyObjectsError, xyz
from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface import NurbsSurface

#: Rhino's geometry types that are surfaces; curves, points, lights and texts beside them do no harm.
SURFACES = (rhino3dm.Mesh, rhino3dm.Brep, rhino3dm.Surface, rhino3dm.SubD)
#: Words for what is not a surface. Blocks are resolved: one that is left is linked to a missing file.
OTHERS = {
    rhino3dm.Curve: "curves",
    rhino3dm.Point: "points",
    rhino3dm.PointCloud: "point clouds",
    rhino3dm.Light: "lights",
    rhino3dm.Hatch: "hatches",
    rhino3dm.AnnotationBase: "texts or dimensions",
    rhino3dm.TextDot: "text dots",
    rhino3dm.InstanceReference: LINKED,
}
#: A block that is scaled by less than this part of its largest scale in some direction is flat.
FLATTENED = 1e-9
#: Rhino's unit systems that are carried.
UNITS = {"Meters": "m", "Centimeters": "cm", "Millimeters": "mm", "Feet": "ft", "Inches": "in"}


def read_3dm(data: bytes) -> FileContent:
    """Raises UnreadableFileError."""
    model = Model.read(data)
    if model is None:
        raise UnreadableFileError(
            "The file is not a Rhino file, is truncated, or is of a newer version: save it again with "
            "Rhino's SaveAs."
        )
    try:
        placed = model.objects()
    except TooManyObjectsError:
        raise UnreadableFileError(
            f"The blocks of the Rhino file hold more than {MOST_OBJECTS} objects in all: delete those that "
            "are not needed, or export the facade alone with Rhino's ExportSelected command."
        ) from None
    settings = model.file.Settings
    tolerance = float(settings.ModelAbsoluteTolerance)
    unit = str(settings.ModelUnitSystem).rpartition(".")[2]
    return FileContent(
        tuple(_found(item, tolerance) for item in placed if isinstance(item.geometry, SURFACES)),
        UNITS.get(unit),
        tolerance if 0 < tolerance < np.inf else None,
        Counter(_other_kind(item.geometry) for item in placed if not isinstance(item.geometry, SURFACES)),
        odd_unit="" if unit in (*UNITS, "None", "Unset") else re.sub(r"\B(?=[A-Z])", " ", unit).lower(),
    )


def _found(placed: Placed, tolerance: float) -> Found:
    return Found(
        placed.id,
        placed.name,
        _kind(placed.geometry),
        _size(placed.geometry, placed.matrix),
        lambda: _moved(convert(placed.geometry, tolerance), placed.matrix),
        placed.layer,
        placed.visible,
        placed.locked,
        placed.strings,
        tuple(
            (name, one.layer)
            for one in placed.within
            for name in dict.fromkeys((one.name, one.block))
            if name
        ),
    )


def found_alone(geometry: Any, tolerance: float) -> Found:
    """A geometry that is in no file."""
    size = _size(geometry, None)
    return Found("0", "", _kind(geometry), size, lambda: convert(geometry, tolerance))


def _kind(geometry: Any) -> str:
    """As Rhino's What command says it."""
    if isinstance(geometry, rhino3dm.Mesh):
        return "mesh"
    if isinstance(geometry, rhino3dm.SubD):
        return "SubD"
    if isinstance(geometry, rhino3dm.Extrusion):
        return "extrusion"
    if isinstance(geometry, rhino3dm.Brep):
        if len(geometry.Faces) > 1:
            return "closed polysurface" if geometry.IsSolid else "polysurface"
        return "surface" if geometry.IsSurface else "trimmed surface"
    return "surface"


def _other_kind(geometry: Any) -> str:
    """Of what is not a surface."""
    for kind, word in OTHERS.items():
        if isinstance(geometry, kind):
            return word
    return str(type(geometry).__name__)


def _size(geometry: Any, matrix: Floats | None) -> tuple[float, float, float]:
    box = geometry.GetBoundingBox()
    if not box.IsValid:  # of nothing
        return 0.0, 0.0, 0.0
    corners = np.array(list(product(*zip(xyz(box.Min), xyz(box.Max), strict=True))))
    if matrix is not None:
        corners = corners @ matrix[:3, :3].T
    x, y, z = np.ptp(corners, axis=0).tolist()
    return x, y, z


def _moved(geometry: Geometry, matrix: Floats | None) -> Geometry:
    """Where its block puts it; the outside stays outside where a block is mirrored."""
    if matrix is None:
        return geometry
    linear, shift = matrix[:3, :3], matrix[:3, 3]
    scales = np.linalg.svd(linear, compute_uv=False)
    if not scales[-1] > FLATTENED * scales[0]:
        raise UnreadableFileError(
            "The block instance that the surface is in flattens it: undo its scaling with Rhino's "
            "ResetBlock, or explode it with ExplodeBlock and look at what is left."
        )
    if not isinstance(geometry, NurbsSurface):
        return geometry.transformed(matrix)
    net = geometry.control_points
    moved = np.concatenate([net[..., :3] @ linear.T + shift, net[..., 3:]], axis=-1)
    surface = NurbsSurface(geometry.degree, geometry.knots, moved, geometry.closed)
    return _turned(surface) if float(np.linalg.det(linear)) < 0 else surface


def convert(geometry: Any, tolerance: float = 0.0) -> Geometry:
    """One object of rhino3dm. tolerance: the file's. Raises UnreadableFileError."""
    if isinstance(geometry, rhino3dm.Mesh):
        return rhino_mesh(geometry)
    if isinstance(geometry, rhino3dm.SubD):
        mesh = subd_mesh(geometry)
        if mesh is None:
            raise UnreadableFileError(
                "The SubD cannot be subdivided: convert it with Rhino's ToNURBS command."
            )
        return rhino_mesh(mesh)
    if isinstance(geometry, rhino3dm.Extrusion):
        geometry = geometry.ToBrep(True) or geometry
    if isinstance(geometry, rhino3dm.Brep) and len(geometry.Faces) == 1 and geometry.IsSurface:
        surface = nurbs_surface(geometry.Faces[0].UnderlyingSurface())
        return _turned(surface) if geometry.Faces[0].OrientationIsReversed else surface
    if isinstance(geometry, rhino3dm.Brep):
        return brep_of(geometry, tolerance)
    return nurbs_surface(geometry)


def _turned(surface: NurbsSurface) -> NurbsSurface:
    """The same surface seen from its other side: the second parameter runs backwards."""
    u, v = surface.knots
    return NurbsSurface(surface.degree, (u, -v[::-1]), surface.control_points[:, ::-1], surface.closed)
