"""What writers get besides the solution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from hexwrap_server.errors import NotMadeError
from hexwrap_solver.panels.types import Panels
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.pipeline import Solution

#: How ``flat.dxf`` can gather panels on its sheets.
GROUPS = ("size", "ring", "zone")
Group = Literal["size", "ring", "zone"]


@dataclass(frozen=True)
class Meta:
    """name: of the job, any text. timings: seconds per stage.

    unit: of all lengths (``m``, ``cm``, ``mm``, ``ft``, ``in``); None: the surface's own, if it has one.
    sheet: width and height of the sheets of ``flat.dxf`` in model units; None: the first of
    3 × 1.5 m, 4 × 2 m, 6 × 3.21 m that holds the largest panel, or, where none does, a size that holds about
    six by four of it. group: what shares a sheet there.
    storey: height of the storeys of ``panels.ifc`` in model units, None: no storeys.
    """

    name: str = "hexwrap"
    timings: Mapping[str, float] = field(default_factory=dict)
    sheet: tuple[float, float] | None = None
    unit: str | None = None
    group: Group = "size"
    storey: float | None = None


def panels_of(solution: Solution, name: str) -> tuple[Pattern, Panels]:
    """The pattern and its panels. Raises NotMadeError where the request stopped before them, or none fit."""
    check_stages(name, pattern=solution.pattern is not None, panels=solution.panels is not None)
    assert solution.pattern is not None
    assert solution.panels is not None
    if solution.panels.n_panels == 0:
        raise NotMadeError(
            f"{name} shows panels, but no cell of the pattern became one "
            f'({solution.pattern.n_cells} cells); ask for smaller cells, or for "boundary": "trim".',
            field=("pattern",),
        )
    return solution.pattern, solution.panels


def check_stages(name: str, *, pattern: bool, panels: bool) -> None:
    """Raises NotMadeError where a stage that the file shows was not asked for."""
    if not pattern:
        raise NotMadeError(
            f'{name} shows panels, but the request has "pattern": null; ask for a pattern and panels.',
            field=("pattern",),
        )
    if not panels:
        raise NotMadeError(
            f'{name} shows panels, but the request has "panels": null; ask for panels.', field=("panels",)
        )
