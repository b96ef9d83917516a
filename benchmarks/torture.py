"""Hard annuli in all modes: solved, refused with the reason, or wrong by an independent judge.

    python -m benchmarks.torture [--seeds 3] [--only name ...] [--modes mode ...]

Public meshes are taken from ../shared/meshes where that folder exists.
"""

from __future__ import annotations

import argparse
import os

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import time

import numpy as np

from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.surface.types import Surface
from tests.solver.conformal.checks import asked_angles, faults
from tests.solver.conformal.shared import MESHES, load
from tests.solver.conformal.torture import MODES, TORTURE


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[*MESHES, *TORTURE])
    parser.add_argument("--modes", nargs="*", default=list(MODES))
    options = parser.parse_args()
    counts = {"solved": 0, "refused": 0, "wrong": 0}
    print(f"{'mesh':24s} {'seed':>4s} {'mode':18s} {'vertices':>8s} {'verdict':8s} "
          f"{'flips':>7s} {'inserted':>8s} {'steps':>5s} {'residual':>8s} {'seconds':>7s}")  # fmt: skip
    for name in options.only:
        for seed in range(options.seeds if name in TORTURE else 1):
            surface = TORTURE[name](np.random.default_rng(seed)) if name in TORTURE else load(MESHES[name])
            for mode in options.modes:
                counts[_row(name, seed, mode, surface)] += 1
    print(", ".join(f"{count} {verdict}" for verdict, count in counts.items()))


def _row(name: str, seed: int, mode: str, surface: Surface) -> str:
    condition = MODES[mode](surface, np.random.default_rng(seed + 1000))
    head = f"{name:24s} {seed:4d} {mode:18s} {len(surface.vertices):8d}"
    start = time.perf_counter()
    try:
        found = conformal_map(surface, condition)
    except HexwrapError as refusal:
        print(f"{head} refused  {time.perf_counter() - start:7.2f} s: {refusal.detail}", flush=True)
        return "refused"
    seconds = time.perf_counter() - start
    wrong = faults(found, asked_angles(found, surface, condition))
    verdict = "wrong" if wrong else "solved"
    print(f"{head} {verdict:8s} {found.flips:7d} {found.inserted:8d} {found.iterations:5d} "
          f"{found.residual:8.1e} {seconds:7.2f} {'; '.join(wrong)}", flush=True)  # fmt: skip
    return verdict


if __name__ == "__main__":
    main()
