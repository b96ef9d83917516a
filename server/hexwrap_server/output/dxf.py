"""``panels.dxf``: the panels in space as closed 3-D polylines, a layer per size, labels at their centres."""

from __future__ import annotations

import numpy as np

from hexwrap_server.output.drawing import Entities, drawing
from hexwrap_server.output.layers import size_layers
from hexwrap_server.output.meta import Meta, panels_of
from hexwrap_solver.arrays import Floats
from hexwrap_solver.panels.folds import hinges_of
from hexwrap_solver.pipeline import Solution

#: Height of the labels in edge lengths.
TEXT = 0.16


def panels_dxf(solution: Solution, meta: Meta) -> bytes:
    """AutoCAD 2010 DXF; labels lie in the planes of their panels, read from outside."""
    pattern, panels = panels_of(solution, "panels.dxf")
    space = Entities(drawing(panels, meta, "labels"))
    layers = {size: layer.name for size, layer in size_layers(panels).items()}
    for points, size in zip(panels.polygons.to_lists(), panels.size.tolist(), strict=True):
        space.path(points, layers[size], close=True)
    hinges = hinges_of(panels)
    for row in np.flatnonzero(hinges >= 0).tolist():
        start, end = np.asarray(panels.polygons[row])[[0, hinges[row]]].tolist()
        space.line(start, end, layers[int(panels.size[row])])
    names = pattern.labels()
    centres = object_coordinates(panels.center, panels.normal).tolist()
    for face, centre, normal, edge in zip(
        panels.face.tolist(), centres, panels.normal.tolist(), panels.edge_length.tolist(), strict=True
    ):
        space.text(names[face], TEXT * edge, centre, "labels", normal=normal)
    return space.encode()


def object_coordinates(points: Floats, normals: Floats) -> Floats:
    """(n, 3) points in the coordinates in which DXF places flat things (its arbitrary axis algorithm)."""
    steep = np.all(np.abs(normals[:, :2]) < 1 / 64, axis=1, keepdims=True)
    x_axis = np.cross(np.where(steep, [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]), normals)
    x_axis /= np.linalg.norm(x_axis, axis=1, keepdims=True)
    y_axis = np.cross(normals, x_axis)
    return np.stack([np.sum(points * axis, axis=1) for axis in (x_axis, y_axis, normals)], axis=1)
