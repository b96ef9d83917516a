"""Whether an edge length makes sense for a model, which one was meant, and why cells would be too many."""

from __future__ import annotations

import sys
from math import log

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.errors import PatternError
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.words import box, length

#: Ratios of units that are mistaken for each other: metric ones, inches and feet.
RATIOS = (10.0, 100.0, 1000.0, 12.0, 25.4, 39.37, 304.8)
#: A usual edge length is this part of the model's diagonal.
USUAL = 1 / 50
#: The map shrinks a pinch by more than this, relative to the typical place.
PINCHED = 8.0
#: Larger ratios are not reported.
MANY = 1_000_000
#: An edge so many times as long as usual, or a part as small of it, is not proposed.
FAR = 100.0


def check_edge(surface: Surface, settings: PatternSettings) -> None:
    """Raises PatternError for an edge longer than the model."""
    edge = settings.edge_length
    if edge is not None and edge > _diagonal(surface):
        raise PatternError(
            f"An edge length of {edge:g}{unit(surface)} is larger than the model, {model(surface)}: did you "
            f"mean {_meant(surface, edge):g}?",
            field=("edge_length",),
        )


def too_many(
    surface: Surface, settings: PatternSettings, cells: float, log_scale: Floats | None = None
) -> PatternError:
    """Why that many cells would be needed, and what to do. cells: counted, or those of one ring where that is
    too many already. log_scale: of the map, where there is one."""
    edge, limit = settings.edge_length, settings.max_cells
    if edge is not None:
        lattice = LATTICES[settings.cell_kind]
        along = lattice.edge / edge
        whole = float(surface.areas.sum()) * along * along / lattice.cell_area
        cells = min(max(cells, whole), sys.float_info.max)
    data: dict[str, object] = {"cells": int(cells), "limit": limit}
    if edge is not None and edge * _nearest(surface, edge) != edge:
        return PatternError(
            f"The model is {model(surface)}, so that about {length(cells)} cells with edges of "
            f"{edge:g}{unit(surface)} would be needed, over the limit of {limit:,}: did you mean "
            f"{_meant(surface, edge):g}?",
            data=data,
            field=("edge_length",),
        )
    scale = np.zeros(len(surface.vertices)) if log_scale is None else log_scale
    narrow = int(np.argmax(scale))
    shrunk = float(np.exp(scale[narrow] - np.median(scale)))
    if shrunk > PINCHED:
        place = ", ".join(f"{x:.4g}" for x in _rounded(surface, narrow))
        vertex = int(surface.input_vertex[narrow])
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


def _rounded(surface: Surface, vertex: int) -> list[float]:
    """Where a vertex is, without digits that do not matter."""
    grain = 1e-6 * _diagonal(surface)
    place: list[float] = (np.round(surface.vertices[vertex] / grain) * grain + 0.0).tolist()
    return place


def unit(surface: Surface) -> str:
    """The unit behind a number, with a blank before it, or nothing."""
    return f" {surface.unit}" if surface.unit else ""


def model(surface: Surface) -> str:
    """Size of the bounding box in words."""
    return box(np.ptp(surface.vertices, axis=0).tolist()) + unit(surface)


def _diagonal(surface: Surface) -> float:
    return float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))


def _meant(surface: Surface, edge: float) -> float:
    """In another unit; or the usual length, where that is as senseless."""
    meant, usual = edge * _nearest(surface, edge), USUAL * _diagonal(surface)
    return float(f"{meant if 1 / FAR < meant / usual < FAR else usual:.4g}")


def _nearest(surface: Surface, edge: float) -> float:
    """The ratio of units that makes the edge length the most usual."""
    usual = USUAL * _diagonal(surface)
    ratios = (1.0, *RATIOS, *(1 / ratio for ratio in RATIOS))
    return min(ratios, key=lambda ratio: abs(log(edge * ratio / usual)))
