"""``flat.dxf``: every outline laid flat, labelled, and packed on sheets, a layer per size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hexwrap_server.output.drawing import drawing, encode
from hexwrap_server.output.layers import size_layers
from hexwrap_server.output.meta import Meta, SheetError, panels_of
from hexwrap_server.output.table import neighbour_labels
from hexwrap_server.output.text import length, lengths, one_line
from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.panels.types import Panels
from hexwrap_solver.pipeline import Solution

if TYPE_CHECKING:
    from ezdxf.layouts.layout import Modelspace

#: Space left between outlines, and along the rim of a sheet, in parts of the largest panel's width.
SPACE = 0.04
#: Panels across and up a sheet where no size was asked for.
SHEET = (6, 4)
#: Heights of the texts and the distance of the neighbours' names from their edges, in parts of the inradius
#: (of a triangle these leave room for one another, too).
LABEL, SIZE, NEIGHBOUR, INSET = 0.20, 0.13, 0.11, 0.11


@dataclass(frozen=True)
class Outlines:
    """corners: (k, 2) of all panels, each with its box's lower corner at 0. extent: (q, 2) of the boxes."""

    corners: Ragged
    extent: Floats


@dataclass(frozen=True)
class Places:
    """sheet: (q,) and corner: (q, 2) lower left corner of each box on its sheet. size: of every sheet."""

    sheet: Ints
    corner: Floats
    size: tuple[float, float]


def flat_dxf(solution: Solution, meta: Meta) -> bytes:
    """Outlines at full size, seen from outside, first edges horizontal, sheets side by side.

    Inside each outline stand label and size, and along each edge the label of the panel across it.
    Raises SheetError where a panel is larger than the sheet.
    """
    pattern, panels = panels_of(solution, "flat.dxf")
    outlines = lay_flat(panels)
    labels = pattern.labels()
    names = [labels[face] for face in panels.face.tolist()]
    places = pack(outlines.extent, panels.size, meta.sheet, names)
    document = drawing(panels, meta.name, solution.map.surface.unit, "sheets", "labels", "neighbours")
    space = document.modelspace()
    width, height = places.size
    step = 1.1 * width
    for sheet in range(int(places.sheet.max()) + 1):
        x = sheet * step
        rim = [(x, 0.0), (x + width, 0.0), (x + width, height), (x, height)]
        space.add_lwpolyline(rim, close=True, dxfattribs={"layer": "sheets"})
        title = {"layer": "sheets", "insert": (x, height * 1.02)}
        space.add_text(f"{one_line(meta.name)} {sheet + 1}", height=0.03 * height, dxfattribs=title)
    moved = places.corner + np.stack([places.sheet * step, 0.0 * places.sheet], axis=1)
    corners: Floats = np.asarray(outlines.corners.values, dtype=np.float64) + moved[outlines.corners.row]
    layers = {size: layer.name for size, layer in size_layers(panels).items()}
    laid = Ragged(corners, outlines.corners.offsets)
    for points, size in zip(laid.to_lists(), panels.size.tolist(), strict=True):
        space.add_lwpolyline(points, close=True, dxfattribs={"layer": layers[size]})
    _write_inside(space, laid, panels, names)
    _write_along(space, laid, neighbour_labels(pattern, panels))
    return encode(document)


def lay_flat(panels: Panels) -> Outlines:
    """The outlines in their planes, seen from outside, with the first edge along x."""
    polygons = panels.polygons
    points: Floats = np.asarray(polygons.values, dtype=np.float64)
    rows, first = polygons.row, polygons.offsets[:-1]
    x_axis = points[first + 1] - points[first]
    x_axis -= np.sum(x_axis * panels.normal, axis=1, keepdims=True) * panels.normal
    x_axis /= np.linalg.norm(x_axis, axis=1, keepdims=True)
    y_axis = np.cross(panels.normal, x_axis)
    arms = points - panels.center[rows]
    flat = np.stack([np.sum(arms * x_axis[rows], axis=1), np.sum(arms * y_axis[rows], axis=1)], axis=1)
    low = np.minimum.reduceat(flat, first)
    return Outlines(Ragged(flat - low[rows], polygons.offsets), np.maximum.reduceat(flat, first) - low)


def pack(extent: Floats, size: Ints, sheet: tuple[float, float] | None, names: list[str]) -> Places:
    """Shelves: panels of one size after the other, row over row from the bottom, sheet after sheet."""
    space = SPACE * float(extent.max())
    limit = sheet or tuple(n * (m + space) + space for n, m in zip(SHEET, extent.max(axis=0), strict=True))
    width, height = float(limit[0]), float(limit[1])
    large = np.flatnonzero(np.any(extent + 2 * space > [width, height], axis=1))
    if len(large):
        w, h = extent[large[0]].tolist()
        raise SheetError(
            f"{len(large)} panels are larger than the sheets of {length(width)} × {length(height)}, the "
            f"first is {names[large[0]]} with {length(w)} × {length(h)} and a rim of {length(space)}; "
            "give larger sheets.",
            data={"panels": [names[i] for i in large.tolist()]},
        )
    sheets = np.zeros(len(extent), dtype=np.int64)
    corners = np.zeros((len(extent), 2))
    number, x, y, shelf = 0, space, space, 0.0
    order = np.lexsort((np.arange(len(size)), size))
    for row, (w, h) in zip(order.tolist(), extent[order].tolist(), strict=True):
        if x + w + space > width:
            x, y, shelf = space, y + shelf + space, 0.0
        if y + h + space > height:
            number, x, y, shelf = number + 1, space, space, 0.0
        sheets[row], corners[row] = number, (x, y)
        x, shelf = x + w + space, max(shelf, h)
    return Places(sheets, corners, (width, height))


def _write_inside(space: Modelspace, laid: Ragged, panels: Panels, names: list[str]) -> None:
    """Label and size in the middle of each panel."""
    rows, count = laid.row, laid.lengths
    points = np.asarray(laid.values, dtype=np.float64)
    centre = np.stack([np.bincount(rows, points[:, i]) / count for i in range(2)], axis=1)
    inradius = _inradius(laid)
    sizes, size_words = panels.size.tolist(), lengths(panels.class_length.tolist())
    for row, ((x, y), r, edge) in enumerate(
        zip(centre.tolist(), inradius.tolist(), panels.edge_length.tolist(), strict=True)
    ):
        size = sizes[row]
        told = f"– / {length(edge)}" if size < 0 else f"{size:02d} / {size_words[size]}"
        for words, high, up in ((names[row], LABEL, 0.10), (told, SIZE, -0.14)):
            _write(space, "labels", words, high * r, (x, y + up * r), 0.0)


def _write_along(space: Modelspace, laid: Ragged, names: list[list[str]]) -> None:
    """The neighbour's label inside along each edge, turned so that it is not upside down."""
    points, rows = np.asarray(laid.values), laid.row
    along = points[laid.next()] - points
    edge = np.linalg.norm(along, axis=1)
    inwards = np.stack([-along[:, 1], along[:, 0]], axis=1) / edge[:, None]
    inradius = _inradius(laid)[rows]
    middle = points + along / 2 + inwards * (INSET * inradius)[:, None]
    turn = np.degrees(np.arctan2(along[:, 1], along[:, 0]))
    turn = np.where((turn > 90.1) | (turn <= -89.9), turn - 180, turn)
    heights = np.minimum(NEIGHBOUR * inradius, edge / 8)
    flat_names = [name for row in names for name in row]
    for name, place, angle, high in zip(
        flat_names, middle.tolist(), turn.tolist(), heights.tolist(), strict=True
    ):
        if name != "-":
            _write(space, "neighbours", name, high, (place[0], place[1]), angle)


def _write(
    space: Modelspace, layer: str, words: str, height: float, place: tuple[float, float], turn: float
) -> None:
    """One line of text around a place."""
    attributes = {"layer": layer, "insert": place, "align_point": place, "rotation": turn}
    space.add_text(words, height=height, dxfattribs={**attributes, "halign": 1, "valign": 2})


def _inradius(laid: Ragged) -> Floats:
    """(q,) twice the area over the perimeter: the incircle's radius of a regular polygon."""
    points, rows, n = np.asarray(laid.values), laid.row, laid.n_rows
    following = points[laid.next()]
    cross = points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]
    around = np.bincount(rows, np.linalg.norm(following - points, axis=1), n)
    return np.asarray(np.abs(np.bincount(rows, cross, n)) / around)
