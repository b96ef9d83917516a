"""Settings of the solver → the request that says them: the way back from ``schemas``."""

from __future__ import annotations

from dataclasses import asdict
from math import inf, nextafter
from typing import Any

from hexwrap_server.input.requests import Wanted
from hexwrap_server.input.schemas import QUANTA
from hexwrap_solver.conformal.types import ANGLE_UNITS, BoundaryCondition


def request_document(name: str, surface_id: str, wanted: Wanted) -> dict[str, Any]:
    """A body for POST /v1/jobs that leads to the same work; angles in radians."""
    document: dict[str, Any] = {"name": name, "surface": {"id": surface_id}}
    document["boundary"] = _boundary(wanted.boundary)
    document["pattern"] = None if wanted.pattern is None else _without(asdict(wanted.pattern), "max_cells")
    document["panels"] = None if wanted.panels is None else asdict(wanted.panels)
    document["support"] = wanted.support
    return document


def _boundary(asked: BoundaryCondition) -> dict[str, Any]:
    quantum = next((kind for kind, value in QUANTA.items() if value == asked.quantum), "none")
    document: dict[str, Any] = {"mode": asked.mode, "quantum": quantum, "spread": asked.spread}
    if asked.angles is not None and asked.vertices is not None and asked.points is not None:
        angles = [_in_unit(angle, ANGLE_UNITS[asked.unit]) for angle in asked.angles.tolist()]
        rows = zip(asked.vertices.tolist(), asked.points.tolist(), angles, strict=True)
        document["angle_unit"] = asked.unit
        document["angles"] = [
            {"vertex": v, "angle": angle} if v >= 0 else {"point": p, "angle": angle} for v, p, angle in rows
        ]
    return document


def _in_unit(angle: float, unit: float) -> float:
    """The number that was asked for, or one that comes to the same radians."""
    near = angle / unit
    tries = (round(near, 9), near, nextafter(near, inf), nextafter(near, 0.0))
    return next((value for value in tries if value * unit == angle), near)


def _without(table: dict[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in table.items() if key != name}
