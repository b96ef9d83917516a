"""What explorations foresee against what is measured, on all samples; and one exploration, timed.

    python benchmarks/explore.py [SAMPLE …]            the table
    python benchmarks/explore.py --run [SAMPLE]        an exploration of 200 variants on two processes

Foreseen / measured: the part of the cells that is left uncovered, per cent. Samples with their own pattern,
under each boundary condition that they can have.
"""

from __future__ import annotations

import sys
import time

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
from hexwrap_solver.panels import fit_panels, measure, quantize
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern import lay_pattern

SIZES = (3, 6, 11, None)


def main(names: list[str]) -> None:
    columns = ("sample", "ends", "cells", *(f"{k or 'own'} sizes" for k in SIZES), "s")
    print("| " + " | ".join(columns) + " |\n" + "|---" * len(columns) + "|")
    for name in names:
        request = parse_request(samples.load(name), 10**7, 10**6)
        assert isinstance(request.surface, SentSurface)
        surface = take_in(request.surface, request.wanted.surface)
        for mode in ("straight", "isometric"):
            print_row(name, surface, mode, request.wanted.pattern)


def print_row(name, surface, mode, pattern) -> None:  # type: ignore[no-untyped-def]
    try:
        cmap = conformal_map(surface, BoundaryCondition(mode).adapted(pattern.kind))
        start = time.process_time()
        seen = outlook(cmap, pattern)
        seconds = time.process_time() - start
        laid = lay_pattern(cmap, pattern)
        fitted = fit_panels(cmap, laid, PanelSettings())
    except HexwrapError:  # no such condition on a disk
        return
    row = [name, mode, str(laid.n_cells)]
    for sizes in SIZES:
        found = seen.foresee(sizes)
        measured = 1 - measure(cmap, laid, quantize(fitted, PanelSettings(sizes=sizes))).coverage
        row.append(f"{100 * found.uncovered:.2f} / {100 * measured:.2f}")
    print("| " + " | ".join([*row, f"{seconds:.2f}"]) + " |", flush=True)


def run(name: str) -> None:
    body = {"name": name, "surface": samples.load(name)["surface"], "variants": 200}
    request = parse_exploration(body, 10**7, 10**6)
    start = time.perf_counter()
    result = explore_here(name, request.surface, request.wanted, nobody)  # type: ignore[arg-type]
    print(f"{name}: {result['notes'][0]} {time.perf_counter() - start:.0f} s")
    for i in sorted(result["front"], key=lambda i: result["variants"][i]["measured"]["uncovered"]):
        print("*" if i == result["best"] else " ", i, result["variants"][i]["measured"])


if __name__ == "__main__":
    if sys.argv[1:2] == ["--run"]:
        run((sys.argv[2:] or ["tower"])[0])
    else:
        main(sys.argv[1:] or samples.names())
