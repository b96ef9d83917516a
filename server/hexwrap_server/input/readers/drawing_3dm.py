"""Drawings in Rhino's .3dm."""

from __future__ import annotations

import numpy as np
import rhino3dm

from hexwrap_server.errors import DrawingError
from hexwrap_server.input.readers.drawing import Drawing, curve, too_many
from hexwrap_server.input.readers.rhino_curves import rhino_curve
from hexwrap_server.input.readers.rhino_model import Model, Placed, TooManyObjectsError, xyz


def read_3dm_drawing(data: bytes) -> Drawing:
    """Visible points, point clouds and curves, blocks resolved. Raises DrawingError."""
    model = Model.read(data)
    if model is None:
        raise DrawingError("The drawing is not a Rhino file, or is truncated.")
    try:
        objects = model.objects()
    except TooManyObjectsError:
        raise too_many() from None
    drawing = Drawing()
    curves: list[Placed] = []
    for placed in objects:
        geometry = placed.geometry
        if not placed.visible:
            drawing.left_out[f"hidden {kind(placed)}"] += 1
        elif isinstance(geometry, rhino3dm.Curve):
            curves.append(placed)
        elif isinstance(geometry, rhino3dm.Point):
            drawing.curves.append(curve([_moved(xyz(geometry.Location), placed)]))
        elif isinstance(geometry, rhino3dm.PointCloud):
            drawing.curves += [curve([_moved(xyz(point), placed)]) for point in geometry.GetPoints()]
        else:
            drawing.left_out[kind(placed)] += 1
    boxes = [placed.geometry.GetBoundingBox() for placed in curves if placed.matrix is None]
    size = 0.0
    if boxes:
        corners = np.array([xyz(corner) for box in boxes for corner in (box.Min, box.Max)])
        size = float(np.ptp(corners, axis=0).max())
    drawing.curves += [rhino_curve(placed.geometry, size, placed.matrix) for placed in curves]
    return drawing


def kind(placed: Placed) -> str:
    """Rhino's word for what it is."""
    name = type(placed.geometry).__name__
    return {"Brep": "polysurface or surface", "InstanceReference": "linked block"}.get(name, name)


def _moved(point: list[float], placed: Placed) -> list[float]:
    if placed.matrix is None:
        return point
    moved: list[float] = (placed.matrix[:3, :3] @ point + placed.matrix[:3, 3]).tolist()
    return moved
