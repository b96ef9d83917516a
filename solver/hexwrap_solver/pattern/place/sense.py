"""Whether an edge length makes sense for a model, which one was meant, and why cells would be too many."""

from __future__ import annotations

from math import log

import numpy as np

from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.errors import PatternError
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.words import box

#: Ratios of units that are mistaken for each other: metric ones, inches and feet.
RATIOS = (10.0, 100.0, 1000.0, 12.0, 25.4, 39.37, 304.8)
#: A usual edge length is this part of the model's diagonal.
USUAL = 1 / 50
#: The map shrinks a pinch by more than this, relative to the typical place.
PINCHED = 8.0
#: Larger ratios are not reported.
MANY = 1_000_000


def check_edge(cmap: ConformalMap, settings: PatternSettings) -> None:
    """Raises PatternError for an edge longer than the model."""
    edge = settings.edge_length
    if edge is not None and edge > _diagonal(cmap):
        raise PatternError(
            f"An edge length of {edge:g}{unit(cmap)} is larger than the model, {model(cmap)}: did you mean "
            f"{_meant(cmap, edge):g}?",
            field=("pattern", "edge_length"),
        )


def too_many(cmap: ConformalMap, settings: PatternSettings, cells: float) -> PatternError:
    """Why that many cells would be needed, and what to do."""
    edge, limit = settings.edge_length, settings.max_cells
    data: dict[str, object] = {"cells": int(cells), "limit": limit}
    if edge is not None and edge * _nearest(cmap, edge) != edge:
        return PatternError(
            f"The model is {model(cmap)}, so that about {cells:,.0f} cells with edges of "
            f"{edge:g}{unit(cmap)} would be needed, over the limit of {limit:,}: did you mean "
            f"{_meant(cmap, edge):g}?",
            data=data,
            field=("pattern", "edge_length"),
        )
    narrow = int(np.argmax(cmap.log_scale))
    shrunk = float(np.exp(cmap.log_scale[narrow] - np.median(cmap.log_scale)))
    if shrunk > PINCHED:
        place = ", ".join(f"{x:.4g}" for x in _rounded(cmap, narrow))
        vertex = int(cmap.surface.input_vertex[narrow])
        times = f"{shrunk:,.0f} times" if shrunk < MANY else f"more than {MANY:,} times"
        return PatternError(
            f"The surface is pinched at ({place}): a map that keeps angles makes cells there {times} smaller "
            f"than at a typical place, so that about {cells:,.0f} would be needed, over the limit of "
            f"{limit:,}. Widen the surface there, or split it there and panelize both parts.",
            vertices=[vertex] if vertex >= 0 else [],
            data=data,
        )
    return PatternError(
        f"About {cells:,.0f} cells would be needed, over the limit of {limit:,}: ask for a larger edge "
        "length or fewer cells around.",
        data=data,
    )


def _rounded(cmap: ConformalMap, vertex: int) -> list[float]:
    """Where a vertex is, without digits that do not matter."""
    grain = 1e-6 * _diagonal(cmap)
    place: list[float] = (np.round(cmap.surface.vertices[vertex] / grain) * grain + 0.0).tolist()
    return place


def unit(cmap: ConformalMap) -> str:
    """The unit behind a number, with a blank before it, or nothing."""
    return f" {cmap.surface.unit}" if cmap.surface.unit else ""


def model(cmap: ConformalMap) -> str:
    """Size of the bounding box in words."""
    return box(np.ptp(cmap.surface.vertices, axis=0).tolist()) + unit(cmap)


def _diagonal(cmap: ConformalMap) -> float:
    return float(np.linalg.norm(np.ptp(cmap.surface.vertices, axis=0)))


def _meant(cmap: ConformalMap, edge: float) -> float:
    return float(f"{edge * _nearest(cmap, edge):.4g}")


def _nearest(cmap: ConformalMap, edge: float) -> float:
    """The ratio of units that makes the edge length the most usual."""
    usual = USUAL * _diagonal(cmap)
    ratios = (1.0, *RATIOS, *(1 / ratio for ratio in RATIOS))
    return min(ratios, key=lambda ratio: abs(log(edge * ratio / usual)))
