"""Time of rationalization, stage by stage, after the pattern.

    python benchmarks/panels.py [--panels 1000 10000 100000] [--target inscribed]

Processor seconds, best of three runs on the ``tower`` sample; one thread.
"""

from __future__ import annotations

import argparse
import os

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from hexwrap_server import samples
from hexwrap_server.input.requests import SentSurface
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.work import take_in
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.panels import fit_panels, measure, quantize, support
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import PatternSettings

T = TypeVar("T")
REPEATS = 3


def best(run: Callable[[], T]) -> tuple[float, T]:
    """Least seconds of a few runs, and the result of the last."""
    least = np.inf
    for _ in range(REPEATS):
        start = time.process_time()
        result = run()
        least = min(least, time.process_time() - start)
    return least, result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--panels", type=int, nargs="+", default=[1000, 10_000, 100_000])
    parser.add_argument("--target", default="inscribed", choices=["shortest", "inscribed", "best", "mean"])
    asked = parser.parse_args()
    request = parse_request(samples.load("tower"), 10**7, 10**6)
    assert isinstance(request.surface, SentSurface)
    cmap = conformal_map(take_in(request.surface, request.wanted.surface), BoundaryCondition())
    first = lay_pattern(cmap, PatternSettings(around=24))
    print(f"{len(cmap.surface.vertices)} vertices; processor seconds")
    heads = ("fit", "11 sizes", "12 sizes", "measure", "total", "support")
    print("   panels" + "".join(f"{head:>10}" for head in heads))
    for wanted in asked.panels:
        around = 2 * round(12 * (wanted / first.n_cells) ** 0.5)
        pattern = lay_pattern(cmap, PatternSettings(around=around))
        settings = PanelSettings(target=asked.target)
        fit, fitted = best(lambda: fit_panels(cmap, pattern, settings))  # noqa: B023
        eleven, panels = best(lambda: quantize(fitted, settings))  # noqa: B023
        twelve, _ = best(lambda: quantize(fitted, replace(settings, sizes=12)))  # noqa: B023
        measured, _ = best(lambda: measure(cmap, pattern, panels))  # noqa: B023
        beams, _ = best(lambda: support(pattern, 0.3))  # noqa: B023
        total = fit + eleven + measured
        seconds = (fit, eleven, twelve, measured, total, beams)
        print(f"{panels.n_panels:9d}" + "".join(f"{value:10.3f}" for value in seconds))


if __name__ == "__main__":
    main()
