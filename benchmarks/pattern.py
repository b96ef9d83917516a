"""Seconds for laying patterns, lifting and flattening: ``python benchmarks/pattern.py``."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap, Deck, Unrolled
from hexwrap_solver.domain import flatten, lift
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.surface.types import Surface


def catenoid(around: int, along: int) -> ConformalMap:
    """A catenoid of 4:1 girth with its exact map; around × (along + 1) vertices."""
    z = np.linspace(-1, 2, along + 1)
    theta = 2 * np.pi * np.arange(around) / around
    uv: Complexes = (theta[None, :] + 1j * z[:, None]).ravel()
    r = np.repeat(np.cosh(z), around)
    points: Floats = np.stack([r * np.cos(uv.real), r * np.sin(uv.real), uv.imag], axis=1)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(around), np.arange(along)))
    a, b = i + around * j, (i + 1) % around + around * j
    faces: Ints = np.concatenate([np.stack([a, b, b + around], 1), np.stack([a, b + around, a + around], 1)])
    last = (i == around - 1).astype(np.int64)
    sheet = np.concatenate([np.stack([0 * i, last, last], 1), np.stack([0 * i, last, 0 * i], 1)])
    ids = np.arange(len(points))
    loops = (ids[:around], ids[-around:][::-1])
    surface = Surface(points, faces, loops, ids, ids, points / np.linalg.norm(points, axis=1, keepdims=True))
    straight = np.full(around, np.pi)
    return ConformalMap(
        surface,
        -np.log(r),
        Unrolled(uv, sheet, Deck(0.0, 2 * np.pi + 0j), 2 * np.pi),
        (straight, straight),
        0,
        0.0,
    )


def best_of(run: Callable[[], object], repeats: int = 3) -> float:
    """Shortest wall time in seconds."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    print(f"{'vertices':>9} {'cells':>9} {'whole':>8} {'trim':>8} {'lift':>8} {'flatten':>8}   (seconds)")
    for side, around in ((100, 48), (320, 220), (630, 48), (630, 460)):
        cmap = catenoid(side, side // 2 * 2 if side < 600 else 320)
        whole = PatternSettings(around=around)
        trimmed = PatternSettings(around=around, boundary="trim")
        pattern = lay_pattern(cmap, whole)
        up = lift(cmap, pattern.uv)
        seconds = [
            best_of(lambda c=cmap, s=whole: lay_pattern(c, s)),
            best_of(lambda c=cmap, s=trimmed: lay_pattern(c, s)),
            best_of(lambda c=cmap, p=pattern: lift(c, p.uv), 1),
            best_of(lambda c=cmap, u=up: flatten(c, u.points[u.inside]), 1),
        ]
        figures = " ".join(f"{s:8.3f}" for s in seconds)
        print(f"{len(cmap.uv):9,} {pattern.n_cells:9,} {figures}")


if __name__ == "__main__":
    main()
