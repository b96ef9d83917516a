"""What explorations foresee against what is measured, on all samples; and one exploration, timed.

    python benchmarks/explore.py [--write] [SAMPLE …]  the table
    python benchmarks/explore.py --solved [SAMPLE …]  of 40 variants of each, those that are solved
    python benchmarks/explore.py --run [SAMPLE]        an exploration of 200 variants on two processes
    python benchmarks/explore.py --run --vertices 20000  the same of a doubly curved tower with that many
    python benchmarks/explore.py --same [SAMPLE]       ten explorations of 20 variants with the same seed

Foreseen / measured: the part of the cells that is left uncovered, per cent. Samples with their own pattern,
under each boundary condition that they can have. ``--write`` puts the table into docs/results.md.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import orjson
from service import tower

from hexwrap_server import samples
from hexwrap_server.cli.explore import explore_here
from hexwrap_server.input.requests import SentSurface
from hexwrap_server.input.schemas import parse_exploration, parse_request
from hexwrap_server.jobs.engine import nobody
from hexwrap_server.jobs.work import take_in
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.explore.predict import outlook
from hexwrap_solver.panels import fit_panels, quantize
from hexwrap_solver.panels.polygons import fan_areas
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.surface.types import Surface

#: Points by which what is foreseen may be off.
BOUND = 0.6
SIZES = (1, 2, 3, 4, 6, 8, 11, None)
PAGE = Path(__file__).resolve().parents[1] / "docs" / "results.md"
BEGIN, END = "<!-- explore: made by its benchmark -->", "<!-- end of explore -->"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("samples", nargs="*", metavar="SAMPLE")
    parser.add_argument("--write", action="store_true", help="write the table into docs/results.md")
    parser.add_argument("--solved", action="store_true", help="explore each, and compare what is solved")
    parser.add_argument("--run", action="store_true", help="explore the first sample, or the tower")
    parser.add_argument("--same", action="store_true", help="explore it ten times with the same seed")
    parser.add_argument("--vertices", type=int, help="run: a tower of that many, not a sample")
    asked = parser.parse_args()
    first = (asked.samples or ["tower"])[0]
    if asked.run:
        run(first, asked.vertices)
        return
    if asked.same:
        same(first)
        return
    if asked.solved:
        for name in asked.samples or samples.names():
            solved(name)
        return
    worst = 0.0
    columns = ("sample", "ends", "cells", *(f"{k or 'own'} sizes" for k in SIZES), "s")
    table = ["| " + " | ".join(columns) + " |", "| --- " * len(columns) + "|"]
    print("\n".join(table))
    for name in asked.samples or samples.names():
        request = parse_request(samples.load(name), 10**7, 10**6)
        assert isinstance(request.surface, SentSurface)
        surface = take_in(request.surface, request.wanted.surface)
        for mode in ("straight", "isometric"):
            found = row(name, surface, mode, request.wanted.pattern)
            if found is not None:
                worst = max(worst, found[1])
                table.append(found[0])
                print(found[0], flush=True)
    print(f"The greatest difference: {worst:.2f}")
    if asked.write:
        text = f"\n{chr(10).join(table)}\n"
        before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
        PAGE.write_text(f"{before}{BEGIN}{text}{END}{rest.split(END)[1]}", encoding="utf-8")


def row(name: str, surface: Surface, mode: str, pattern: PatternSettings) -> tuple[str, float] | None:
    """A line of the table and its greatest difference; None where there is no such condition, as on disks."""
    try:
        cmap = conformal_map(surface, BoundaryCondition(mode).adapted(pattern.kind))
        start = time.process_time()
        seen = outlook(cmap, pattern)
        seconds = time.process_time() - start
        laid = lay_pattern(cmap, pattern)
        fitted = fit_panels(cmap, laid, PanelSettings())
    except HexwrapError:
        return None
    cells, figures = float(fan_areas(laid.cells).sum()), []
    for sizes in SIZES:
        panels = quantize(fitted, PanelSettings(sizes=sizes)).polygons
        measured = 1 - float(fan_areas(panels).sum()) / cells
        figures.append((100 * seen.foresee(sizes).uncovered, 100 * measured))
    words = (f"{abs(foreseen):.2f} / {measured:.2f}" for foreseen, measured in figures)
    line = "| " + " | ".join([name, mode, str(laid.n_cells), *words, f"{seconds:.2f}"]) + " |"
    return line, max(abs(foreseen - measured) for foreseen, measured in figures)


def explored(name: str, variants: int, vertices: int | None = None) -> dict[str, Any]:
    surface = samples.load(name)["surface"] if vertices is None else tower(vertices)
    body = {"name": name, "surface": surface, "variants": variants}
    request = parse_exploration(body, 10**7, 10**6)
    return explore_here(name, request.surface, request.wanted, nobody)  # type: ignore[arg-type]


def solved(name: str) -> None:
    """How far solved variants of an exploration are from what was foreseen of them, and the worst ones."""
    found = []
    for variant in explored(name, 40)["variants"]:
        if variant["measured"]:
            foreseen, measured = (100 * variant[key]["uncovered"] for key in ("predicted", "measured"))
            request = variant["request"]
            at = len((request["singularities"] or {"at": ()})["at"])
            words = f"{request['boundary']['mode']}, {at} singularities, {request['panels']['sizes']} sizes"
            found.append((abs(foreseen - measured), f"{words}: {foreseen:.2f} / {measured:.2f}"))
    beyond = sorted((one for one in found if one[0] > BOUND), reverse=True)
    print(f"{name}: {len(found) - len(beyond)} of {len(found)} within {BOUND}", flush=True)
    for _, words in beyond:
        print(f"  {words}")


def run(name: str, vertices: int | None) -> None:
    start, used = time.perf_counter(), time.process_time()
    result = explored(name, 200, vertices)
    spent = time.perf_counter() - start, time.process_time() - used
    print(f"{name}: {result['notes'][0]} {spent[0]:.0f} s, {spent[1]:.0f} s of this process")
    for i in sorted(result["front"], key=lambda i: result["variants"][i]["measured"]["uncovered"]):
        print("*" if i == result["best"] else " ", i, result["variants"][i]["measured"])


def same(name: str) -> None:
    """Whether everything that an exploration says comes out the same each time, to the last digit."""
    first = orjson.dumps(explored(name, 20), option=orjson.OPT_SERIALIZE_NUMPY)
    again = [orjson.dumps(explored(name, 20), option=orjson.OPT_SERIALIZE_NUMPY) for _ in range(9)]
    front = orjson.loads(first)["front"]
    print(f"{name}: {1 + again.count(first)} of 10 the same, a front of {len(front)}")


if __name__ == "__main__":
    main()
