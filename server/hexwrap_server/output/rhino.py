"""``panels.3dm``: closed polylines with a layer per size, labels as text dots, panel data as user strings.

Where components were asked for, a block per size with an instance per panel; the surface on a layer of its
own.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import rhino3dm

from hexwrap_server.output.blocks import Blocks, Shape
from hexwrap_server.output.layers import size_layers
from hexwrap_server.output.meta import Meta, panels_of
from hexwrap_server.output.table import columns
from hexwrap_server.output.text import one_line
from hexwrap_server.output.units import unit_of
from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.panels.folds import hinges_of
from hexwrap_solver.panels.types import Components, Panels, Support
from hexwrap_solver.pipeline import Solution

#: The columns of ``panels.csv`` that every polyline carries as user strings.
KEYS = (
    "label", "ring", "place", "size", "edge_length", "planarity", "surface_distance",
    "gap_tangential_mean", "gap_normal_mean", "bend_angle", "neighbours",
)  # fmt: skip
LABELS = (60, 64, 70)
COMPONENTS = (150, 156, 166)
SUPPORT = (96, 104, 118)
SURFACE = (190, 194, 200)
PATH = (0, 0, 0)


def panels_3dm(solution: Solution, meta: Meta) -> bytes:
    """A Rhino file in the unit of the sent surface.

    Where that came with a layer, all layers stand below it; its name and user strings go to the group of the
    panels, to each panel, and to the surface itself, a mesh on a layer of its own.
    """
    _, panels = panels_of(solution, "panels.3dm")
    surface = solution.map.surface
    model = rhino3dm.File3dm()
    model.ApplicationName = "hexwrap"
    model.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, unit_of(meta.unit).rhino)
    if surface.origin.tolerance is not None:
        model.Settings.ModelAbsoluteTolerance = surface.origin.tolerance
    model.Strings["hexwrap"] = one_line(meta.name)
    known = {key: values for key, values in columns(solution).items() if key in KEYS}
    names = [str(label) for label in known["label"]]
    root = _path(model, surface.origin.layer)
    strings = [(key, value) for key, value in surface.origin.attributes if key not in known]
    if surface.origin.name:
        strings.append(("source", surface.origin.name))
    group = rhino3dm.Group()
    group.Name = one_line(f"{surface.origin.name} panels").strip()
    model.Groups.Add(group)
    top = _layer(model, "panels", LABELS, root)
    place = {size: _layer(model, x.name, x.colour, top) for size, x in size_layers(panels).items()}
    sizes = panels.size.tolist()
    texts = list(zip(*([str(value) for value in values] for values in known.values()), strict=True))
    for row, points in enumerate(panels.polygons.to_lists()):
        attributes = _attributes(place[sizes[row]], names[row])
        attributes.AddToGroup(0)
        for key, value in (*zip(known, texts[row], strict=True), *strings):
            attributes.SetUserString(key, value)
        model.Objects.AddPolyline(_closed(points), attributes)
    hinges = hinges_of(panels)
    bent = np.flatnonzero(hinges >= 0).tolist()
    if bent:
        folds = _layer(model, "bends", LABELS, root)
        for row in bent:
            ends = np.asarray(panels.polygons[row])[[0, hinges[row]]].tolist()
            model.Objects.AddLine(*(rhino3dm.Point3d(*p) for p in ends), _attributes(folds, names[row]))
    labels = _layer(model, "labels", LABELS, root)
    for name, centre in zip(names, panels.center.tolist(), strict=True):
        model.Objects.AddTextDot(name, rhino3dm.Point3d(*centre), _attributes(labels, name))
    if solution.components is not None:
        _add_components(model, panels, solution.components, names, root)
    if solution.support is not None:
        _add_support(model, solution.support, root)
    attributes = _attributes(_layer(model, "surface", SURFACE, root), surface.origin.name)
    for key, value in surface.origin.attributes:
        attributes.SetUserString(key, value)
    model.Objects.AddMesh(_mesh(surface.vertices.tolist(), surface.faces.tolist()), attributes)
    return base64.b64decode(model.Encode())


def _path(model: rhino3dm.File3dm, path: str) -> int | None:
    """The lowest layer of a path such as ``Facade::Tower``, made with those above it; None for no path."""
    place = None
    for name in path.split("::") if path else ():
        place = _layer(model, one_line(name), PATH, place)
    return place


def _layer(
    model: rhino3dm.File3dm, name: str, colour: tuple[int, int, int], parent: int | None = None
) -> int:
    layer = rhino3dm.Layer()
    layer.Name = name
    layer.Color = (*colour, 255)
    if parent is not None:
        layer.ParentLayerId = model.Layers[parent].Id
    return int(model.Layers.Add(layer))


def _attributes(layer: int, name: str) -> rhino3dm.ObjectAttributes:
    attributes = rhino3dm.ObjectAttributes()
    attributes.LayerIndex = layer
    attributes.Name = name
    return attributes


def _closed(points: list[Any]) -> rhino3dm.Point3dList:
    return rhino3dm.Point3dList([rhino3dm.Point3d(*p) for p in (*points, points[0])])


def _mesh(vertices: list[Any], faces: list[Any]) -> rhino3dm.Mesh:
    mesh = rhino3dm.Mesh()
    mesh.Vertices.UseDoublePrecisionVertices = True
    for point in vertices:
        mesh.Vertices.AddPoint3d(*point)
    for face in faces:
        mesh.Faces.AddFace(*face)
    mesh.Normals.ComputeNormals()
    return mesh


def _add_components(
    model: rhino3dm.File3dm, panels: Panels, components: Components, names: list[str], root: int | None
) -> None:
    """A block per size, its outline and body in the panel's own plane; an instance for each panel like it.

    Panels without a block get outline and body of their own.
    """
    top = _layer(model, "components", COMPONENTS, root)
    blocks = Blocks.of(panels, components)
    layers = {size: _layer(model, x.name, x.colour, top) for size, x in size_layers(panels).items()}
    sizes = blocks.size.tolist()
    defined = []
    for number, (panel, size) in enumerate(zip(blocks.made_from.tolist(), sizes, strict=True)):
        name = blocks.name(number)
        parts = _parts(blocks.shape(panel), len(blocks.outline[panel]))
        looks = tuple(_attributes(layers[size], name) for _ in parts)
        index = model.InstanceDefinitions.Add(name, "", "", "", rhino3dm.Point3d(0, 0, 0), parts, looks)
        defined.append(model.InstanceDefinitions[index].Id)
    motions = np.zeros((panels.n_panels, 4, 4))
    motions[:, :3, :3] = np.swapaxes(blocks.axes, 1, 2)
    motions[:, :3, 3] = blocks.origin
    motions[:, 3, 3] = 1
    for panel, (block, size) in enumerate(zip(blocks.block.tolist(), panels.size.tolist(), strict=True)):
        attributes = _attributes(layers[size], names[panel])
        if block >= 0:
            motion = _transform(motions[panel])
            model.Objects.AddInstanceObject(rhino3dm.InstanceReference(defined[block], motion), attributes)
            continue
        for part in _parts(blocks.shape(panel), len(blocks.outline[panel])):
            part.Transform(_transform(motions[panel]))
            add = model.Objects.AddMesh if isinstance(part, rhino3dm.Mesh) else model.Objects.AddCurve
            add(part, attributes)


def _parts(shape: Shape, corners: int) -> tuple[rhino3dm.GeometryBase, ...]:
    """Outline, and the body where there is one."""
    outline = rhino3dm.PolylineCurve(_closed(shape.points[:corners].tolist()))
    return (outline, _mesh(shape.points.tolist(), shape.triangles.tolist())) if shape.closed else (outline,)


def _transform(motion: Floats) -> rhino3dm.Transform:
    made = rhino3dm.Transform(1.0)
    for i, row in enumerate(motion.tolist()):
        for j, value in enumerate(row):
            setattr(made, f"M{i}{j}", value)
    return made


def _add_support(model: rhino3dm.File3dm, support: Support, root: int | None) -> None:
    """Beams as one mesh of ruled strips with corners of their own; node axes as lines of the beams' depth,
    or of a quarter of the beams' length where they have no depth."""
    top = _layer(model, "support", SUPPORT, root)
    depth = np.linalg.norm(support.strips[:, 3] - support.strips[:, 0], axis=1).max(initial=0.0)
    if depth > 0:
        strips = Ragged.from_table(support.strips)
        corners: Ints = np.arange(len(strips.values)).reshape(-1, 4)
        beams = _attributes(_layer(model, "beams", SUPPORT, top), "beams")
        model.Objects.AddMesh(_mesh(strips.values.tolist(), corners.tolist()), beams)
    else:
        ends = support.nodes[support.edges]
        depth = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean() / 4
    axes = _attributes(_layer(model, "axes", SUPPORT, top), "node axis")
    ends = support.nodes - depth * support.axes
    for start, end in zip(support.nodes.tolist(), ends.tolist(), strict=True):
        model.Objects.AddLine(rhino3dm.Point3d(*start), rhino3dm.Point3d(*end), axes)
