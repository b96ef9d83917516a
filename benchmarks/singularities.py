"""What singularities bring on the samples: real panels, measured.

    python benchmarks/singularities.py [--write] [SAMPLE …]
    python benchmarks/singularities.py --greedy [SAMPLE …]

``--write`` puts the table into docs/results.md. ``--greedy`` compares with greedy placement (Springborn,
Schröder and Pinkall 2008): the standard deviation of u over the area for each number of singularities.

One row per sample and way to treat its ends: number of singularities, cells, uncovered part of the cells
with 3, 5 and 11 sizes and the gaps at 11, the share of the whole surface that is left open at 11, moves,
processor seconds.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from hexwrap_server import samples
from hexwrap_server.input.requests import SentSurface
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.work import take_in
from hexwrap_solver.arrays import Ints
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.panels import measure, rationalize
from hexwrap_solver.panels.polygons import fan_areas
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from hexwrap_solver.singularities.linear import Responses, vertex_areas
from hexwrap_solver.singularities.search import Search, State, curve
from hexwrap_solver.singularities.solve import closed_map, frame_of, seated
from hexwrap_solver.singularities.types import SingularitySettings
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.threads import one_blas_thread

SAMPLES = ("tower", "waist", "diagrid", "facade", "entrance", "cone", "isometric", "ring")
SIZES = (3, 5, 11)
#: Numbers of singularities that are compared.
MOST = 6
GREEDY = ("sample", "spread of u with 0, 1, 2, … singularities", "the same, placed greedily")
PAGE = Path(__file__).parent.parent / "docs" / "results.md"
BEGIN, END = "<!-- singularities: made by their benchmark -->", "<!-- end of singularities -->"
COLUMNS = (
    "sample",
    "ends",
    "singularities",
    "cells",
    *(f"uncovered, {k} sizes" for k in SIZES),
    "gap at 11, mm",
    "of the surface open at 11",
    "moved, cells",
    "placing, closing, processor s",
)
#: Ends and cells at them, and how many singularities at most (None: no search).
WAYS = (
    ("straight, none", "straight", "whole", None),
    ("free", "isometric", "whole", "auto"),
    ("free, trimmed", "isometric", "trim", "auto"),
    ("both aligned", "straight", "whole", "auto"),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="write the table into docs/results.md")
    parser.add_argument("--greedy", action="store_true", help="compare with greedy placement")
    parser.add_argument("samples", nargs="*")
    asked = parser.parse_args()
    columns, made = (GREEDY, against_greedy) if asked.greedy else (COLUMNS, rows)
    table = []
    with one_blas_thread():
        for row in chain(
            (line(columns), line(["---"] * len(columns))), *(made(name) for name in asked.samples or SAMPLES)
        ):
            print(row, flush=True)
            table.append(f"{row}\n")
    if asked.write:
        text = PAGE.read_text(encoding="utf-8")
        before, rest = text.split(BEGIN)
        PAGE.write_text(f"{before}{BEGIN}\n{''.join(table)}{END}{rest.split(END)[1]}", encoding="utf-8")


def against_greedy(name: str) -> Iterator[str]:
    """One row: ends free, spread of u with 0, 1, 2, … singularities, ours and greedily placed."""
    asked = parse_request(samples.load(name), 10**7, 10**6)
    assert isinstance(asked.surface, SentSurface)
    surface = take_in(asked.surface, asked.wanted.surface)
    shape = replace(asked.wanted.pattern or PatternSettings(), kind="hex", rotation="edge", align="none")
    condition = BoundaryCondition("isometric", quantum="hex")
    rules = frame_of(surface, condition, SingularitySettings(MOST), shape, max(SIZES)).rules
    known = Responses(surface, rules)
    search = Search(known.model(known.seats()), rules)
    ours = [one.spread for one in curve(search, refine=False)]
    yield line([name, spreads(ours), spreads(greedy(search, known.middle))])


def greedy(search: Search, middle: Ints) -> list[float]:
    """One at a time where u is largest in size, as far as the rules leave places; a cone of negative
    curvature where u is high. The loops then take what is left as suits best."""
    state = search.with_loops(State((), (), (0,) * max(len(search.model.free) - 1, 0)))
    found = [search.proposal(state).spread]
    every = {int(vertex): i for i, vertex in enumerate(middle)}
    patch = np.array([every[int(vertex)] for vertex in search.model.seat])
    for _ in range(MOST):
        u = search.scale(state)
        height = (u - search.model.weight @ u)[patch]
        choices = []
        for k in (-1, 1):
            clear = np.flatnonzero(search.open_seats(state, k) & (k * height < 0))
            if len(clear):
                seat = int(clear[np.argmax(-k * height[clear])])
                choices.append((abs(height[seat]), State.of([*state.pairs, (seat, k)], state.loops)))
        if not choices:
            break
        state = search.with_loops(max(choices, key=lambda one: one[0])[1])
        found.append(search.proposal(state).spread)
    return found


def spreads(values: list[float]) -> str:
    return " ".join(f"{value:.3f}" for value in values)


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
            start = time.process_time()
            if count is None:
                cmap, took = conformal_map(surface, condition), (0.0, 0.0)
            else:
                seats = seated(surface, condition, SingularitySettings(count), pattern, max(SIZES))
                between = time.process_time()
                cmap = closed_map(surface, seats.frame, seats.placing, condition)
                took = (between - start, time.process_time() - between)
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
