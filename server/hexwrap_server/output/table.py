"""``panels.csv``: one row per panel with everything that is known of it."""

from __future__ import annotations

import numpy as np

from hexwrap_server.output.meta import Meta, panels_of
from hexwrap_server.output.text import csv_table
from hexwrap_server.output.units import heading
from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.panels.folds import bend_angles, places_of
from hexwrap_solver.panels.types import Panels
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.pipeline import Solution

#: Columns of lengths begin so.
LENGTHS = ("edge_length", "limit", "center_", "surface_distance", "gap_")


def panels_csv(solution: Solution, meta: Meta) -> bytes:
    """UTF-8, comma separated, a heading row. Lengths in model units, which the headings name where they are
    known (``edge_length [mm]``); angles in radians.

    ``neighbours`` names the panels across each edge in order, ``-`` where there is none; gaps are to
    those neighbours, along the surface (``tangential``) and across it (``normal``).
    """
    panels_of(solution, "panels.csv")
    known = columns(solution)
    headings = [heading(name, meta.unit if name.startswith(LENGTHS) else None) for name in known]
    return csv_table([headings, *zip(*known.values(), strict=True)])


def columns(solution: Solution) -> dict[str, list[object]]:
    """Column name → one entry per panel, empty text where something was not measured."""
    pattern, panels = panels_of(solution, "a table")
    quality, n = solution.quality, panels.n_panels
    labels = np.array(pattern.labels(), dtype=object)
    known: dict[str, list[object]] = {
        "label": labels[panels.face].tolist(),
        "ring": pattern.ring[panels.face].tolist(),
        "place": pattern.place[panels.face].tolist(),
        "size": ["" if s < 0 else s for s in panels.size.tolist()],
        "edge_length": _numbers(panels.edge_length, n),
        "limit": _numbers(panels.limit, n),
        "corners": panels.polygons.lengths.tolist(),
        "whole": panels.whole.astype(int).tolist(),
    }
    for name, vectors in (("center", panels.center), ("normal", panels.normal)):
        for axis, letter in enumerate("xyz"):
            known[f"{name}_{letter}"] = _numbers(vectors[:, axis], n)
    for name in ("planarity", "edge_deviation", "angle_deviation", "surface_distance"):
        known[name] = _numbers(getattr(quality, name), n)
    known["convex"] = [""] * n if quality.convex is None else quality.convex.astype(int).tolist()
    for name in ("gap_tangential", "gap_normal", "kink"):
        for what, numbers in _over_edges(getattr(quality, name), pattern, panels.face).items():
            known[f"{name}_{what}"] = _numbers(numbers, n)
    known["bend_angle"] = ["" if a == 0 else a for a in bend_angles(panels).tolist()]
    known["neighbours"] = [" ".join(names) for names in neighbour_labels(pattern, panels)]
    return known


def neighbour_labels(pattern: Pattern, panels: Panels) -> list[list[str]]:
    """Per panel, the label across each edge of its cell, or cells; ``-`` where no panel stands."""
    panel, _ = places_of(pattern, panels.face, panels.bends)
    labels = np.array([*pattern.labels(), "-"], dtype=object)
    names = np.append(labels[panels.face], "-")
    across = np.asarray(pattern.neighbours.values)
    named = names[np.where(across >= 0, panel[across], -1)]
    rows = np.split(named, pattern.neighbours.offsets[1:-1])
    found = [rows[cell].tolist() for cell in panels.face.tolist()]
    if panels.bends is not None:
        bends = panels.bends
        for row, other, (one, two) in zip(
            bends.panel.tolist(), bends.other.tolist(), bends.side.tolist(), strict=True
        ):  # from the hinge on, around both halves
            mine, others = found[row], rows[other].tolist()
            found[row] = [*mine[one + 1 :], *mine[:one], *others[two + 1 :], *others[:two]]
    return found


def _numbers(values: Floats | None, n: int) -> list[object]:
    """n numbers, printed as the shortest text that reads back the same; empty where not measured."""
    if values is None:
        return [""] * n
    return ["" if bad else v for v, bad in zip(values.tolist(), ~np.isfinite(values), strict=True)]


def _over_edges(values: Floats | None, pattern: Pattern, cells: Ints) -> dict[str, Floats | None]:
    """min, mean and max over the edges of each given cell, NaN where it has no neighbour at all."""
    if values is None:
        return {"min": None, "mean": None, "max": None}
    row, n = pattern.neighbours.row, pattern.n_cells
    there = np.isfinite(values)
    count = np.bincount(row[there], minlength=n)
    total = np.bincount(row[there], weights=values[there], minlength=n)
    least, most = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(least, row[there], values[there])
    np.maximum.at(most, row[there], values[there])
    mean = np.divide(total, count, out=np.full(n, np.nan), where=count > 0)
    return {"min": least[cells], "mean": mean[cells], "max": most[cells]}
