"""``domain.dxf``: the unrolled domain in its own units, to draw over: what is drawn there can be lifted."""

from __future__ import annotations

import numpy as np

from hexwrap_server.output.drawing import Entities, grey_drawing
from hexwrap_server.output.meta import Meta
from hexwrap_server.output.unrolled import Unrolled, cells, drawn, plane
from hexwrap_server.output.viewpoint import corners
from hexwrap_solver.pipeline import Solution


def domain_dxf(solution: Solution, meta: Meta) -> bytes:
    """Boundary loops, the cut, corners (points) and the pattern's cells, each on a layer of its own."""
    pattern = solution.pattern
    cmap, pieces = drawn(solution.map)
    names = [f"loop-{number}" for number in range(len(cmap.surface.loops))]
    space = Entities(grey_drawing(meta, *names, "cut", "corners", "pattern"))
    unrolled = Unrolled.of(cmap)
    for layer, sides in (*zip(names, unrolled.loops, strict=True), ("cut", unrolled.cut)):
        for line in unrolled.lines(sides):
            space.polyline(plane(line).tolist(), layer)
    marked = [vertex for vertex, _ in corners(cmap)]
    for loop, sides in zip(cmap.surface.loops, unrolled.loops, strict=True):
        for place in plane(unrolled.start[sides[np.isin(loop, marked)]]).tolist():
            space.point(place, "corners")
    if pattern is not None:
        for outline in cells(pattern, pieces).to_lists():
            space.polyline(outline, "pattern", close=True)
    return space.encode()
