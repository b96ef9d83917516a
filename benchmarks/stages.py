"""Time and memory of every stage, from a mesh to panels, and of the files.

    python benchmarks/stages.py [--vertices 2000 20000 200000] [--files]

Each size runs in a process of its own, so that peaks do not add up. Processor seconds of one thread, the best
of a few runs, because other programs only ever add to them; peak memory of the process up to the end of each
stage of the first run.
"""

from __future__ import annotations

import argparse
import os

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import subprocess
import sys
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np
import psutil

from hexwrap_server.output.writers import WRITERS, Meta, write
from hexwrap_solver import pipeline
from hexwrap_solver.arrays import Progress, Ragged, no_progress
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.surface import SentMesh, surface_from_mesh

RUNS = 3
T = TypeVar("T")


class Meter:
    """A stage runner that keeps each stage's least processor time, and its first peak of memory."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.peak: dict[str, float] = {}

    def __call__(self, stage: str, settings: object, compute: Callable[[Progress], T]) -> T:
        start = time.process_time()
        result = compute(no_progress)
        self.seconds[stage] = min(self.seconds.get(stage, np.inf), time.process_time() - start)
        self.peak.setdefault(stage, peak_mib())
        return result


def tower(n: int) -> SentMesh:
    """A waisted, leaning tube of about n vertices: no surface of revolution."""
    columns = max(12, round(np.sqrt(0.8 * n)))
    t, z = np.meshgrid(
        np.arange(columns) * 2 * np.pi / columns, np.linspace(0, 1, max(4, round(n / columns)))
    )
    r = 8 + 14 * (z - 0.55) ** 2
    x = r * np.cos(t) * (1 + 0.15 * np.cos(2 * t + 2 * z)) + 4 * z**2
    y = r * np.sin(t) + 2 * np.sin(3 * z)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(columns), np.arange(len(z) - 1)))
    a, b = j * columns + i, j * columns + (i + 1) % columns
    faces = np.concatenate([np.stack([a, b, b + columns], 1), np.stack([a, b + columns, a + columns], 1)])
    return SentMesh(np.stack([x, y, 40 * z], axis=-1).reshape(-1, 3), Ragged.from_table(faces))


def measure(n: int, files: bool) -> None:
    """One size, in this process."""
    sent, meter = tower(n), Meter()
    settings = PatternSettings(around=max(12, round(np.sqrt(n) / 2)))
    for _ in range(RUNS):
        solution = pipeline.solve(
            lambda: surface_from_mesh(sent), pipeline.SolveSettings(pattern=settings), meter
        )
    stages = sum(meter.seconds.values())
    if files:
        for name in WRITERS:
            meter(name, None, lambda progress, name=name: write(name, solution, Meta("tower")))
    assert solution.panels is not None
    print(f"\n{len(sent.vertices)} vertices, {solution.panels.n_panels} panels: {stages:.2f} s")
    for stage, seconds in meter.seconds.items():
        print(f"  {stage:<12} {seconds:8.3f} s {meter.peak[stage]:8.0f} MiB")


def peak_mib() -> float:
    """Peak resident memory of this process."""
    memory = psutil.Process().memory_info()
    if hasattr(memory, "peak_wset"):  # Windows
        return float(memory.peak_wset) / 2**20
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak) / (2**20 if sys.platform == "darwin" else 2**10)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--vertices", type=int, nargs="+", default=[2_000, 20_000, 200_000])
    parser.add_argument("--files", action="store_true", help="also write every file")
    asked = parser.parse_args()
    if len(asked.vertices) == 1:
        measure(asked.vertices[0], asked.files)
        return
    for n in asked.vertices:
        options = ["--files"] if asked.files else []
        subprocess.run([sys.executable, __file__, "--vertices", str(n), *options], check=True)


if __name__ == "__main__":
    main()
