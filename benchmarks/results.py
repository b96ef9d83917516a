"""The table of results: what rationalization reaches on the samples, per boundary condition.

    python benchmarks/results.py [--write]

Everything is measured on the finished panels. ``--write`` puts the table into docs/results.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from hexwrap_server import samples
from hexwrap_server.input.requests import SentSurface
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.work import take_in
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.panels import measure, rationalize
from hexwrap_solver.panels.types import Panels, PanelSettings, Quality
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import Pattern, PatternSettings

SAMPLES = ("tower", "facade", "waist", "entrance")
PAGE = Path(__file__).parent.parent / "docs" / "results.md"
BEGIN, END = "<!-- results: made by the panels' benchmark -->", "<!-- end of results -->"

HEAD = """
Gaps between neighbours in mm, mean / worst: by the paper's shortest-edge rule, with `inscribed` (the
default) and `best`, each panel at its own length; then `inscribed` in 11 sizes. Uncovered is the cells'
area left open.
Planarity and regularity (edges; relative to the edge length) are the worst panel's. This table is made by
`python benchmarks/results.py --write`.

"""
COLUMNS = (
    "sample",
    "boundary",
    "panels",
    "shortest",
    "inscribed",
    "best",
    "uncovered",
    "11 sizes: lengths, m",
    "gap",
    "uncovered",
    "overlaps",
    "planarity",
    "regularity",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="write the table into docs/results.md")
    table = HEAD + "".join(
        f"{line}\n" for line in (line_of(COLUMNS), line_of(["---"] * len(COLUMNS)), *rows())
    )
    if parser.parse_args().write:
        text = PAGE.read_text(encoding="utf-8")
        before, rest = text.split(BEGIN)
        PAGE.write_text(f"{before}{BEGIN}{table}{END}{rest.split(END)[1]}", encoding="utf-8")
    print(table)


def rows() -> Iterator[str]:
    """One row per sample and boundary condition."""
    for name in SAMPLES:
        wanted = parse_request(samples.load(name), 10**7, 10**6)
        assert isinstance(wanted.surface, SentSurface)
        surface = take_in(wanted.surface, wanted.wanted.surface)
        own = wanted.wanted.boundary.adapted("hex")
        conditions = {
            own.mode: own,
            "straight": BoundaryCondition("straight"),
            "isometric": BoundaryCondition("isometric", quantum="hex"),
            "isometric, optimal": BoundaryCondition("isometric", quantum="hex", spread="optimal"),
        }
        pattern = wanted.wanted.pattern or PatternSettings()
        for label, condition in conditions.items():
            try:
                cmap = conformal_map(surface, condition)
                # Only boundary curves that are straight in the domain can carry a lattice line.
                align = pattern.align if condition.mode != "isometric" else "none"
                laid = lay_pattern(cmap, replace(pattern, align=align))
                yield row(name, label, cmap, laid)
            except HexwrapError as error:
                yield line_of([name, label, error.detail, *[""] * (len(COLUMNS) - 3)])


def row(name: str, label: str, cmap: ConformalMap, laid: Pattern) -> str:
    own = {target: panelized(cmap, laid, target, None) for target in ("shortest", "inscribed", "best")}
    panels, few = panelized(cmap, laid, "inscribed", 11)
    largest = max([few, *(quality for _, quality in own.values())], key=lambda quality: quality.overlaps)
    assert few.planarity is not None
    assert few.edge_deviation is not None
    cells = [
        name,
        label,
        panels.n_panels,
        *(gap(quality) for _, quality in own.values()),
        f"{1 - own['inscribed'][1].coverage:.2%}",
        f"{panels.class_length[0]:.3f}–{panels.class_length[-1]:.3f}",
        gap(few),
        f"{1 - few.coverage:.2%}",
        largest.overlaps,
        f"{few.planarity.max():.0e}",
        f"{few.edge_deviation.max():.0e}",
    ]
    return line_of(cells)


def line_of(cells: Iterable[object]) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"


def panelized(cmap: ConformalMap, laid: Pattern, target: str, sizes: int | None) -> tuple[Panels, Quality]:
    settings = PanelSettings(target=target, sizes=sizes)  # type: ignore[arg-type]
    panels = rationalize(cmap, laid, settings)
    return panels, measure(cmap, laid, panels)


def gap(quality: Quality) -> str:
    """Mean / worst in mm."""
    assert quality.gap_tangential is not None
    width = 1000 * quality.gap_tangential
    return f"{np.nanmean(width):.1f} / {np.nanmax(width):.0f}"


if __name__ == "__main__":
    main()
