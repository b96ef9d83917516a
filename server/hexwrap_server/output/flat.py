"""``flat.dxf``: every outline laid flat, labelled, and packed on sheets, for the workshop.

What is cut lies on layers ``cut-…``, one per size; what is engraved, all of it on the outside face, on layers
``engrave-…``. Texts stand upright when the panel is mounted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_server.errors import SheetError
from hexwrap_server.output.blocks import frames
from hexwrap_server.output.drawing import Entities, drawing
from hexwrap_server.output.layers import size_layers
from hexwrap_server.output.meta import Group, Meta, panels_of
from hexwrap_server.output.table import neighbour_labels
from hexwrap_server.output.text import length, lengths, one_line
from hexwrap_server.output.units import unit_of
from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.panels.folds import blanks
from hexwrap_solver.panels.types import Panels
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.pipeline import Solution

#: Space left between outlines, and along the rim of a sheet, in parts of the largest panel's width.
SPACE = 0.04
#: Sheets in metres where no size was asked for: the smallest that holds the largest panel. Usual stock of
#: metal and board; the last is a whole pane of float glass.
SHEETS = ((3.0, 1.5), (4.0, 2.0), (6.0, 3.21))
#: Panels across and up a sheet where they are larger than all of these.
ACROSS = (6, 4)
#: Heights of the texts and the distance of the neighbours' names from their edges, in parts of the inradius
#: (of a triangle these leave room for one another, too).
LABEL, SIZE, SIDE, NEIGHBOUR, INSET = 0.20, 0.13, 0.10, 0.11, 0.11
#: Where texts and the arrow stand above the middle, in parts of the inradius; head of the arrow, half its
#: width.
LABEL_AT, SIZE_AT, SIDE_AT, ARROW, HEAD = 0.08, -0.13, -0.31, (0.30, 0.58), 0.07
#: Width that texts across the middle may take, in parts of the inradius; width of a letter in its height.
ROOM, LETTER = 1.5, 0.75
#: Panels whose normal is steeper than this have no upper edge: their arrow points along y, to the north.
LEVEL = 0.999
#: Panels steeper than this face neither of the four sides of the building.
ROOF = 0.9
ZONES = ("east", "north", "west", "south", "top", "bottom")


@dataclass(frozen=True)
class Outlines:
    """corners: (k, 2) of all panels, each with its box's lower corner at 0. extent: (q, 2) of the boxes.
    up: (q, 2) unit, where the panel's upper side lies."""

    corners: Ragged
    extent: Floats
    up: Floats


@dataclass(frozen=True)
class Places:
    """sheet: (q,) and corner: (q, 2) lower left corner of each box on its sheet. size: of every sheet."""

    sheet: Ints
    corner: Floats
    size: tuple[float, float]


def flat_dxf(solution: Solution, meta: Meta) -> bytes:
    """Outlines at full size, seen from outside, first edges horizontal, sheets side by side.

    Inside each outline stand label, size and an arrow that points up; along each edge the label of the
    panel across it. Bent panels are unfolded, with their bend line on a layer of its own. Raises
    SheetError where a panel is larger than the sheet.
    """
    pattern, panels = panels_of(solution, "flat.dxf")
    outlines = lay_flat(panels)
    labels = pattern.labels()
    names = [labels[face] for face in panels.face.tolist()]
    group = groups(panels, pattern, meta.group)
    places = pack(outlines.extent, panels.size, sheet_size(outlines.extent, meta), names, group)
    bent = ("bend",) if panels.bends is not None else ()
    grey = ("sheets", "engrave-label", "engrave-up", "engrave-neighbours", *bent)
    space = Entities(drawing(panels, meta, *grey, prefix="cut-"))
    step = 1.1 * places.size[0]
    _draw_sheets(space, places, group, step, meta)
    moved = places.corner + np.stack([places.sheet * step, 0.0 * places.sheet], axis=1)
    corners: Floats = np.asarray(outlines.corners.values, dtype=np.float64) + moved[outlines.corners.row]
    layers = {size: f"cut-{layer.name}" for size, layer in size_layers(panels).items()}
    laid = Ragged(corners, outlines.corners.offsets)
    for points, size in zip(laid.to_lists(), panels.size.tolist(), strict=True):
        space.polyline(points, layers[size], close=True)
    if panels.bends is not None:
        for start, hinge in zip(laid.offsets[panels.bends.panel], panels.bends.hinge, strict=True):
            space.polyline(corners[[start, start + hinge]].tolist(), "bend")
    _write_inside(space, laid, panels, names, outlines.up)
    _write_along(space, laid, neighbour_labels(pattern, panels))
    return space.encode()


def groups(panels: Panels, pattern: Pattern, kind: Group) -> Ints:
    """(q,) what shares sheets: one group of all sizes, one per ring, or one per side of the building."""
    if kind == "ring":
        return np.asarray(pattern.ring[panels.face])
    if kind == "zone":
        x, y, z = panels.normal.T
        side = np.rint(np.arctan2(y, x) / (np.pi / 2)).astype(np.int64) % 4
        return np.where(z > ROOF, 4, np.where(z < -ROOF, 5, side))
    return np.zeros(panels.n_panels, dtype=np.int64)


def sheet_size(extent: Floats, meta: Meta) -> tuple[float, float]:
    """Width and height of the sheets, model units."""
    if meta.sheet is not None:
        return meta.sheet
    space = SPACE * float(extent.max())
    for stock in SHEETS:
        width, height = (side / unit_of(meta.unit).metres for side in stock)
        if np.all(extent + 2 * space <= [width, height]):
            return width, height
    width, height = (
        n * (m + space) + space for n, m in zip(ACROSS, extent.max(axis=0).tolist(), strict=True)
    )
    return width, height


def _draw_sheets(space: Entities, places: Places, group: Ints, step: float, meta: Meta) -> None:
    """The rims of the sheets, and above each what it is."""
    width, height = places.size
    name, unit = one_line(meta.name), f" {meta.unit}" if meta.unit else ""
    size = f"{width:g} × {height:g}{unit}, outside face up, arrows point up"
    for sheet in range(int(places.sheet.max()) + 1):
        x = sheet * step
        rim = [(x, 0.0), (x + width, 0.0), (x + width, height), (x, height)]
        space.polyline(rim, "sheets", close=True)
        kind = int(group[np.argmax(places.sheet == sheet)])
        where = {"ring": f", ring {kind}", "zone": f", {ZONES[kind]}" if meta.group == "zone" else ""}
        titles = (f"{name}, sheet {sheet + 1}{where.get(meta.group, '')}", 0.03, 1.05), (size, 0.018, 1.02)
        for words, high, above in titles:
            room = width / (LETTER * len(words))
            space.text(words, min(high * height, room), (x, height * above), "sheets", centred=False)


def lay_flat(panels: Panels) -> Outlines:
    """The outlines in their planes, unfolded where they are bent, seen from outside, with the first edge
    along x."""
    polygons, normal = blanks(panels)
    rows, first = polygons.row, polygons.offsets[:-1]
    axes = frames(replace(panels, polygons=polygons, normal=normal))[:, :2]
    arms = np.asarray(polygons.values, dtype=np.float64) - panels.center[rows]
    flat = np.einsum("kij,kj->ki", axes[rows], arms)
    low = np.minimum.reduceat(flat, first)
    upward = np.where(np.abs(normal[:, 2]) > LEVEL, 1, 2)
    up = axes[np.arange(len(axes)), :, upward]
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    return Outlines(Ragged(flat - low[rows], polygons.offsets), np.maximum.reduceat(flat, first) - low, up)


def pack(
    extent: Floats, size: Ints, sheet: tuple[float, float], names: list[str], group: Ints | None = None
) -> Places:
    """Shelves: panels of one size after the other, row over row from the bottom, sheet after sheet.

    Each group begins a sheet of its own.
    """
    space = SPACE * float(extent.max())
    width, height = float(sheet[0]), float(sheet[1])
    group = np.zeros(len(extent), dtype=np.int64) if group is None else group
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
    order = np.lexsort((np.arange(len(size)), size, group))
    fresh = np.diff(group[order], prepend=group[order[0]]) != 0
    for row, (w, h), new in zip(order.tolist(), extent[order].tolist(), fresh.tolist(), strict=True):
        if x + w + space > width:
            x, y, shelf = space, y + shelf + space, 0.0
        if new or y + h + space > height:
            number, x, y, shelf = number + 1, space, space, 0.0
        sheets[row], corners[row] = number, (x, y)
        x, shelf = x + w + space, max(shelf, h)
    return Places(sheets, corners, (width, height))


def _write_inside(space: Entities, laid: Ragged, panels: Panels, names: list[str], up: Floats) -> None:
    """Label, size and side in the middle of each panel, and an arrow above them."""
    rows, count = laid.row, laid.lengths
    points = np.asarray(laid.values, dtype=np.float64)
    centre = np.stack([np.bincount(rows, points[:, i]) / count for i in range(2)], axis=1)
    inradius = _inradius(laid)
    sizes = panels.size.tolist()
    size_words = lengths(panels.class_length.tolist(), panels.class_sides.tolist())
    turn = np.degrees(np.arctan2(-up[:, 0], up[:, 1])).tolist()
    ways = zip(centre.tolist(), up.tolist(), strict=True)
    for row, (edge, r) in enumerate(zip(panels.edge_length.tolist(), inradius.tolist(), strict=True)):
        size, ((x, y), (up_x, up_y)) = sizes[row], next(ways)
        label = f"– / {length(edge)}" if size < 0 else f"{size:02d} / {size_words[size]}"
        for layer, words, high, at in (
            ("engrave-label", names[row], LABEL, LABEL_AT),
            ("engrave-label", label, SIZE, SIZE_AT),
            ("engrave-up", "outside", SIDE, SIDE_AT),
        ):
            height = min(high, ROOM / (LETTER * len(words))) * r
            space.text(words, height, (x + at * r * up_x, y + at * r * up_y), layer, turn=turn[row])
    across = np.stack([up[:, 1], -up[:, 0]], axis=1)
    foot, tip = (centre + (at * inradius)[:, None] * up for at in ARROW)
    barbs = [tip + (HEAD * inradius)[:, None] * (side * across - 1.5 * up) for side in (-1, 1)]
    for line in np.stack([foot, tip, barbs[0], barbs[1], tip], axis=1).tolist():
        space.polyline(line, "engrave-up")


def _write_along(space: Entities, laid: Ragged, names: list[list[str]]) -> None:
    """The neighbour's label inside along each edge, turned so that it is not upside down."""
    points, rows = np.asarray(laid.values), laid.row
    along = points[laid.next()] - points
    edge = np.linalg.norm(along, axis=1)
    inwards = np.stack([-along[:, 1], along[:, 0]], axis=1) / edge[:, None]
    inradius = _inradius(laid)[rows]
    middle = points + along / 2 + inwards * (INSET * inradius)[:, None]
    turn = np.degrees(np.arctan2(along[:, 1], along[:, 0]))
    turn = np.where((turn > 90.1) | (turn <= -89.9), turn - 180, turn)
    longest = max((len(name) for row in names for name in row), default=1)
    heights = np.minimum(NEIGHBOUR * inradius, edge / max(8.0, 1.1 * LETTER * longest))
    flat_names = [name for row in names for name in row]
    for name, place, angle, high in zip(
        flat_names, middle.tolist(), turn.tolist(), heights.tolist(), strict=True
    ):
        if name != "-":
            space.text(name, high, place, "engrave-neighbours", turn=angle)


def measures(flat: Ragged) -> tuple[Floats, Floats]:
    """(n,) area and (n,) perimeter of plane polygons, rows of points (·, 2)."""
    points, rows, n = np.asarray(flat.values), flat.row, flat.n_rows
    after = points[flat.next()]
    twice = points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]
    around: Floats = np.bincount(rows, np.linalg.norm(after - points, axis=1), n).astype(np.float64)
    return np.abs(np.bincount(rows, twice, n)) / 2, around


def _inradius(laid: Ragged) -> Floats:
    """(q,) twice the area over the perimeter: the incircle's radius of a regular polygon."""
    area, around = measures(laid)
    return 2 * area / around
