"""``panels.png``: the panels in space, lit and coloured by size (watertight ones by shape), with a legend;
drawn without a display."""

from __future__ import annotations

from hexwrap_server.output import colours
from hexwrap_server.output.legend import compose
from hexwrap_server.output.meta import Meta, panels_of
from hexwrap_server.output.raster import Polygons
from hexwrap_server.output.scene import Scene, render
from hexwrap_server.output.viewpoint import viewpoint
from hexwrap_solver.arrays import Floats, Ragged
from hexwrap_solver.panels.folds import parts_of
from hexwrap_solver.pipeline import Solution

#: The shell behind the joints lies this many edge lengths inside the surface, so that panels,
#: which cut through a curved surface, do not dip below it.
SINK = 0.2


def panels_png(solution: Solution, meta: Meta) -> bytes:
    """A picture of 1600 pixels in height on white."""
    _, panels = panels_of(solution, "panels.png")
    return compose(render(panels_scene(solution)), panels, meta, solution.map.surface.unit)


def panels_scene(solution: Solution) -> Scene:
    """The panels in the colours of their sizes, or shapes, before the surface that they cover."""
    _, panels = panels_of(solution, "panels.png")
    surface = solution.map.surface
    middle = (surface.vertices.max(axis=0) + surface.vertices.min(axis=0)) / 2
    parts, owner, _ = parts_of(panels)
    outline = Ragged(parts.values - middle, parts.offsets)
    sunk = surface.vertices - middle - SINK * _typical(panels.edge_length) * surface.normals
    # A watertight mesh has no joints to look through, and may lie far from the surface.
    faces = surface.faces if panels.mode == "split" else surface.faces[:0]
    if panels.mode == "watertight":
        shape, _, tints = colours.shapes(panels)
        colour = colours.panel_colours(shape, tints)
    else:
        colour = colours.panel_colours(panels.size, colours.class_colours(panels))
    return Scene(
        Polygons.of(outline),
        colour[owner],
        Polygons.of(Ragged.from_table(sunk[faces])),
        viewpoint(solution.map),
    )


def _typical(lengths: Floats) -> float:
    return float(sorted(lengths.tolist())[len(lengths) // 2])
