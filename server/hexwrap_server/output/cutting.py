"""``cutting-list.csv``: what the workshop has to make, size by size."""

from __future__ import annotations

import numpy as np

from hexwrap_server.output.flat import lay_flat, measures
from hexwrap_server.output.layers import size_name
from hexwrap_server.output.meta import Meta, panels_of
from hexwrap_server.output.text import csv_table
from hexwrap_server.output.units import heading
from hexwrap_solver.pipeline import Solution


def cutting_list(solution: Solution, meta: Meta) -> bytes:
    """UTF-8, one row per size, then one per panel without a size, then the total.

    Width and height are those of the outline as ``flat.dxf`` lays it; areas and perimeters are of one
    panel, and ``total_area`` of all of the row.
    """
    pattern, panels = panels_of(solution, "cutting-list.csv")
    outlines = lay_flat(panels)
    area, around = measures(outlines.corners)
    labels = pattern.labels()
    groups = [np.flatnonzero(panels.size == size) for size in np.unique(panels.size[panels.size >= 0])]
    groups += [np.array([panel]) for panel in np.flatnonzero(panels.size < 0)]
    rows: list[list[object]] = []
    for of in groups:
        one = of[int(np.argmax(area[of]))]  # the largest, should a size have several shapes
        size = int(panels.size[one])
        figures = [panels.edge_length[one], around[one], *outlines.extent[one], area[one], area[of].sum()]
        label = labels[panels.face[one]] if size < 0 else ""
        rows.append(
            [size_name(size), len(panels.polygons[int(one)]), len(of), *(float(v) for v in figures), label]
        )
    lengths = [heading(name, meta.unit) for name in ("edge_length", "perimeter", "width", "height")]
    areas = [heading(name, meta.unit, 2) for name in ("area", "total_area")]
    head = ["size", "sides", "count", *lengths, *areas, "label"]
    return csv_table([head, *rows, ["total", "", panels.n_panels, *[""] * 5, float(area.sum()), ""]])
