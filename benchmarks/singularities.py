"""What singularities bring on the samples: real panels, measured.

    python benchmarks/singularities.py [SAMPLE …]

One row per sample and way to treat its ends: number of singularities, cells, uncovered part of the cells
with 3, 5 and 11 sizes and the gaps at 11, the share of the whole surface that is left open at 11, moves and
seconds.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hexwrap_server import samples
from hexwrap_server.input.requests import SentSurface
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.work import take_in
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.panels import measure, rationalize
from hexwrap_solver.panels.polygons import fan_areas
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from hexwrap_solver.singularities.linear import vertex_areas
from hexwrap_solver.singularities.solve import closed_map, seated
from hexwrap_solver.singularities.types import SingularitySettings
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.threads import one_blas_thread

SAMPLES = ("tower", "waist", "diagrid", "facade", "entrance", "cone", "isometric", "ring")
SIZES = (3, 5, 11)
COLUMNS = (
    "sample",
    "ends",
    "singularities",
    "cells",
    *(f"uncovered, {k} sizes" for k in SIZES),
    "gap at 11, mm",
    "of the surface open at 11",
    "moved, cells",
    "placing, closing, s",
)
#: Ends and cells at them, and how many singularities at most (None: no search).
WAYS = (
    ("straight, none", "straight", "whole", None),
    ("free", "isometric", "whole", "auto"),
    ("free, trimmed", "isometric", "trim", "auto"),
    ("both aligned", "straight", "whole", "auto"),
)


def main() -> None:
    print(line(COLUMNS))
    print(line(["---"] * len(COLUMNS)))
    with one_blas_thread():
        for name in sys.argv[1:] or SAMPLES:
            for row in rows(name):
                print(row, flush=True)


def rows(name: str) -> Iterator[str]:
    """One row per way to treat the ends."""
    asked = parse_request(samples.load(name), 10**7, 10**6)
    assert isinstance(asked.surface, SentSurface)
    surface = take_in(asked.surface, asked.wanted.surface)
    shape = replace(asked.wanted.pattern or PatternSettings(), kind="hex", rotation="edge")
    for label, mode, cells, count in WAYS:
        condition = BoundaryCondition("straight" if mode == "straight" else "isometric", quantum="hex")
        pattern = replace(shape, boundary=cells, align="both" if mode == "straight" else "none")
        try:
            start = time.perf_counter()
            if count is None:
                cmap, took = conformal_map(surface, condition), (0.0, 0.0)
            else:
                seats = seated(surface, condition, SingularitySettings(count), pattern, max(SIZES))
                between = time.perf_counter()
                cmap = closed_map(surface, seats.frame, seats.placing, condition)
                took = (between - start, time.perf_counter() - between)
            yield measured(name, label, surface, cmap, lay_pattern(cmap, pattern), took)
        except HexwrapError as error:
            yield line([name, label, error.detail, *[""] * (len(COLUMNS) - 3)])


def measured(
    name: str, label: str, surface: Surface, cmap: ConformalMap, laid: Pattern, took: tuple[float, float]
) -> str:
    cells = [name, label, told(cmap), laid.n_cells]
    left, gap = 0.0, ""
    for sizes in SIZES:
        panels = rationalize(cmap, laid, PanelSettings(target="inscribed", sizes=sizes))
        quality = measure(cmap, laid, panels)
        cells.append(f"{1 - quality.coverage:.2%}")
        assert quality.gap_tangential is not None
        width = 1000 * quality.gap_tangential
        gap = f"{np.nanmean(width):.1f} / {np.nanmax(width):.0f}"
        left = 1 - float(fan_areas(panels.polygons).sum() / vertex_areas(surface).sum())
    width_of_cell = laid.edge_length * np.sqrt(3)
    moved = cmap.cones.moved.max(initial=0.0) / width_of_cell
    return line([*cells, gap, f"{left:.1%}", f"{moved:.2f}", f"{took[0]:.1f}, {took[1]:.1f}"])


def told(cmap: ConformalMap) -> str:
    """Such as −1 −1 +1."""
    return " ".join(f"{k:+d}" for k in sorted(cmap.cones.index.tolist())) or "none"


def line(cells: object) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"  # type: ignore[call-overload]


if __name__ == "__main__":
    main()
