"""``cutting-list.csv``: what the workshop has to make, size by size."""

from __future__ import annotations

import csv
import io

import numpy as np

from hexwrap_server.output.flat import lay_flat
from hexwrap_server.output.layers import size_name
from hexwrap_server.output.meta import Meta, panels_of
from hexwrap_server.output.units import heading
from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.pipeline import Solution


def cutting_list(solution: Solution, meta: Meta) -> bytes:
    """UTF-8, one row per size, then one per panel without a size, then the total.

    Width and height are those of the outline as ``flat.dxf`` lays it; areas and perimeters are of one
    panel, and ``total_area`` of all of the row.
    """
    pattern, panels = panels_of(solution, "cutting-list.csv")
    outlines = lay_flat(panels)
    area, around = measures(np.asarray(outlines.corners.values), outlines.corners.offsets)
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
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")  # RFC 4180
    lengths = [heading(name, meta.unit) for name in ("edge_length", "perimeter", "width", "height")]
    areas = [heading(name, meta.unit, 2) for name in ("area", "total_area")]
    writer.writerow(["size", "sides", "count", *lengths, *areas, "label"])
    writer.writerows(rows)
    writer.writerow(["total", "", panels.n_panels, "", "", "", "", "", float(area.sum()), ""])
    return text.getvalue().encode()


def measures(points: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Area and perimeter of flat polygons, rows of points (·, 2)."""
    count = np.diff(offsets)
    following = np.arange(len(points)) + 1
    following[offsets[1:] - 1] = offsets[:-1]
    row = np.repeat(np.arange(len(count)), count)
    after = points[following]
    twice = points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]
    around: Floats = np.bincount(row, np.linalg.norm(after - points, axis=1), len(count)).astype(np.float64)
    return np.abs(np.bincount(row, twice, len(count))) / 2, around
