"""The table of watertight panels: every pattern on surfaces of either curvature.

    python benchmarks/watertight.py [--write] [--kinds hex trihexagonal] [--obj FILE ...]

Everything is measured on the finished panels. ``--write`` puts the table into docs/results.md.
"""

from __future__ import annotations

import argparse
import os

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import get_args

import numpy as np

from hexwrap_server import samples
from hexwrap_server.input.readers.obj import read_obj
from hexwrap_server.input.requests import SentSurface
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.work import take_in
from hexwrap_solver.arrays import Floats, Ragged
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern.types import Kind, PatternSettings
from hexwrap_solver.pipeline import PlainRunner, SolveSettings, solve
from hexwrap_solver.surface import SentMesh, Surface, surface_from_mesh

AROUND = 24
PAGE = Path(__file__).parent.parent / "docs" / "results.md"
BEGIN, END = "<!-- watertight: made by its benchmark -->", "<!-- end of watertight -->"
HEAD = """
Flatness, distance from the surface and movement from the pattern are those of the worst corner (distance:
or centre), relative to the mean edge; kinks are the angles between neighbouring panels. Seconds: of the
processor, for making the panels flat. This table is made by `python benchmarks/watertight.py --write`.

"""
COLUMNS = ("surface", "pattern", "panels", "flat to", "convex", "distance", "moved", "kink, mean / max", "s")


def ring(place: Callable[[Floats, Floats], Floats], around: int = 120, rows: int = 60) -> SentMesh:
    """Quads of place(angle, t), t from 0 to 1."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(around), np.arange(rows + 1)))
    vertices = place(2 * np.pi * i / around, j / rows)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(around), np.arange(rows)))
    right = (i + 1) % around
    faces = np.stack(
        [j * around + i, j * around + right, (j + 1) * around + right, (j + 1) * around + i], axis=1
    )
    return SentMesh(vertices, Ragged.from_table(faces))


def turned(radius: Callable[[Floats], Floats], height: Callable[[Floats], Floats]) -> SentMesh:
    return ring(lambda a, t: np.stack([radius(t) * np.cos(a), radius(t) * np.sin(a), height(t)], axis=1))


def monkey(a: Floats, t: Floats) -> Floats:
    """z = r³ cos 3φ / 3, without its middle."""
    r = 0.35 + 0.75 * t
    return np.stack([r * np.cos(a), r * np.sin(a), r**3 * np.cos(3 * a) / 3], axis=1)


SHAPES = {
    "catenoid": turned(lambda t: np.cosh(2.4 * t - 1.2), lambda t: 2.4 * t - 1.2),
    "hyperboloid": turned(lambda t: np.hypot(1, 2 * t - 1), lambda t: 2.4 * t),
    "dome": turned(lambda t: np.cos(1.2 * t), lambda t: np.sin(1.2 * t)),
    "monkey saddle": ring(monkey),
}
SAMPLES = ("waist", "tower")


def surfaces(files: list[Path]) -> Iterator[tuple[str, Surface]]:
    for name, mesh in SHAPES.items():
        yield name, surface_from_mesh(mesh)
    for name in SAMPLES:
        wanted = parse_request(samples.load(name), 10**7, 10**6)
        assert isinstance(wanted.surface, SentSurface)
        yield name, take_in(wanted.surface, wanted.wanted.surface)
    for file in files:
        mesh = read_obj(file.read_bytes()).mesh
        assert mesh is not None
        yield file.stem, surface_from_mesh(mesh)


def rows(kinds: list[Kind], files: list[Path], around: int) -> Iterator[str]:
    for name, surface in surfaces(files):
        for kind in kinds:
            try:
                yield row(name, surface, kind, around)
            except HexwrapError as error:
                yield line_of([name, kind, error.detail, *[""] * (len(COLUMNS) - 3)])


class Processor(PlainRunner):
    """Processor seconds per stage."""

    def __call__(self, stage, settings, compute, after=None):  # type: ignore[no-untyped-def]
        start = time.process_time()
        result = compute(self.progress)
        self.timings[stage] = time.process_time() - start
        return result


def row(name: str, surface: Surface, kind: Kind, around: int) -> str:
    settings = SolveSettings(
        boundary=BoundaryCondition("straight"),
        pattern=PatternSettings(kind=kind, around=around),
        panels=PanelSettings(mode="watertight"),
    )
    run = Processor()
    made = solve(lambda: surface, settings, run)
    found, edge = made.quality, made.pattern.edge_length if made.pattern else 1.0
    assert found.planarity is not None
    assert found.convex is not None
    assert found.surface_distance is not None
    assert found.kink is not None
    kink = np.degrees(found.kink)
    return line_of(
        [
            name,
            kind,
            len(found.convex),
            f"{found.planarity.max():.0e}",
            f"{found.convex.mean():.1%}",
            f"{found.surface_distance.max() / edge:.3f}",
            f"{found.movement / edge:.3f}",
            f"{np.nanmean(kink):.1f}° / {np.nanmax(kink):.0f}°",
            f"{run.timings['fit']:.1f}",
        ]
    )


def line_of(cells: list[object]) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="write the table into docs/results.md")
    parser.add_argument("--kinds", nargs="+", default=list(get_args(Kind)), choices=get_args(Kind))
    parser.add_argument("--around", type=int, default=AROUND)
    parser.add_argument("--obj", nargs="+", type=Path, default=[])
    asked = parser.parse_args()
    lines = [line_of(list(COLUMNS)), line_of(["---"] * len(COLUMNS))]
    for line in rows(asked.kinds, asked.obj, asked.around):
        print(line, flush=True)
        lines.append(line)
    if asked.write:
        before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
        table = HEAD + "\n".join(lines) + "\n"
        PAGE.write_text(f"{before}{BEGIN}{table}{END}{rest.split(END)[1]}", encoding="utf-8")


if __name__ == "__main__":
    main()
