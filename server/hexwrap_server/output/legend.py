"""A rendered scene with its title and the legend of sizes, as PNG."""

from __future__ import annotations

import io
import textwrap
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from hexwrap_server.output import colours, text
from hexwrap_server.output.meta import Meta
from hexwrap_server.output.units import behind
from hexwrap_solver.arrays import Floats
from hexwrap_solver.panels.types import Panels

#: Pixels: the legend, a row of it; drawn this many times finer and averaged.
WIDTH, ROW, FINE = 420, 54, 2
#: What the file says of its resolution.
DPI = 100
#: Pixels: letters of the title, of one in many lines, of the rows, of a row's first and second line.
TITLE, SMALL_TITLE, LARGE, NORMAL, SMALL = 35, 21, 24, 21, 15
#: More sizes than this are shown as a bar of colours, as high as so many rows.
ROWS, BAR = 24, 10
#: Letters of the title in a line, and lines before it becomes smaller.
LETTERS, LINES = 18, 4
NAMES = {
    3: "triangles",
    4: "quads",
    5: "pentagons",
    6: "hexagons",
    7: "heptagons",
    8: "octagons",
    12: "dodecagons",
}
INK, GREY = "#23262b", "#70757d"


@dataclass(frozen=True)
class Row:
    """A line of the legend. sides: of its polygon; 0: as most panels have. below: a smaller line under it."""

    tint: str
    sides: int
    words: str
    count: int
    below: str = ""


def compose(image: NDArray[np.uint8], panels: Panels, meta: Meta, unit: str | None = None) -> bytes:
    """PNG of the image (h, w, 3) with the legend on its right. unit: of the lengths."""
    ground = Image.new("RGB", (FINE * WIDTH, FINE * image.shape[0]), "white")
    _draw(Sheet(ImageDraw.Draw(ground)), image.shape[0], panels, meta, behind(unit))
    pixels = np.concatenate([image, np.asarray(ground.reduce(FINE))], axis=1)
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "png", compress_level=4, dpi=(DPI, DPI))
    return out.getvalue()


@lru_cache(maxsize=32)
def _font(size: int, bold: bool) -> ImageFont.FreeTypeFont:
    """DejaVu, which matplotlib brings along; found without loading matplotlib, which takes half a second."""
    spec = find_spec("matplotlib")
    if spec is None or spec.origin is None:  # not without the package's own requirements
        raise ImportError("matplotlib, whose fonts pictures use, is not installed.")
    fonts = Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf"
    return ImageFont.truetype(fonts / f"DejaVuSans{'-Bold' if bold else ''}.ttf", size)


@dataclass(frozen=True)
class Sheet:
    """What the legend is drawn on, in pixels of the picture, y down."""

    draw: ImageDraw.ImageDraw

    def write(self, x: float, y: float, words: str, size: float, ink: str, *, anchor: str = "lm") -> None:
        """anchor: Pillow's; left or right, middle."""
        font = _font(round(FINE * size), False)
        self.draw.text((FINE * x, FINE * y), words, fill=ink, font=font, anchor=anchor)

    def headline(self, y: float, words: str, size: float, width: float) -> None:
        """One bold line, made smaller where it would be wider than that."""
        wide = _font(FINE * round(size), True).getlength(words) / FINE
        font = _font(int(FINE * size * min(1.0, width / max(wide, 1.0))), True)
        self.draw.text((0, FINE * y), words, fill=INK, font=font, anchor="lm")

    def polygon(self, corners: Floats, colour: str) -> None:
        """corners: (n, 2)."""
        self.draw.polygon([(x, y) for x, y in (FINE * corners).tolist()], fill=colour)


def _title(sheet: Sheet, top: float, name: str) -> None:
    """The name above the legend, its last line at ``top``, in as many lines as it needs."""
    lines, size = textwrap.wrap(name, LETTERS, break_on_hyphens=False) or [""], TITLE
    if len(lines) > LINES:
        size = SMALL_TITLE
        lines = textwrap.wrap(name, LETTERS * TITLE // SMALL_TITLE, break_on_hyphens=False)
    for k, line in enumerate(reversed(lines)):
        sheet.headline(top - k * size * 1.35, line, size, WIDTH - 12)


def _draw(sheet: Sheet, height: int, panels: Panels, meta: Meta, unit: str) -> None:
    """Title, number of panels, a bar of colours where there are many sizes, and the rows."""
    by_shape = panels.mode == "watertight"
    rows = _shapes(panels, unit) if by_shape else _sizes(panels, unit)
    bar = BAR if panels.n_sizes > ROWS and not by_shape else 0
    top = (height - ROW * (bar + len(rows))) / 2
    _title(sheet, top - 96, text.one_line(meta.name))
    sizes = {0: "", 1: ", 1 size"}.get(panels.n_sizes, f", {panels.n_sizes:,} sizes")
    what = "flat panels" if by_shape else f"panels{sizes}"
    sheet.write(0, top - 48, f"{panels.n_panels:,} {what}", LARGE, GREY)
    if bar:
        _bar(sheet, top, bar * ROW - 20, panels, unit)
    for k, row in enumerate(rows):
        y, size = top + ROW * (bar + k + 0.5), NORMAL if row.below else LARGE
        _swatch(sheet, y, panels, row.tint, row.sides)
        sheet.write(64, y - 9 * bool(row.below), row.words, size, INK)
        sheet.write(64, y + 14, row.below, SMALL, GREY)
        sheet.write(WIDTH - 30, y, f"{row.count:,}", size, GREY, anchor="rm")


def _sizes(panels: Panels, unit: str) -> list[Row]:
    """One row per size unless there are too many: colour, edge length, how many; then the other panels."""
    n = len(panels.class_length)
    shown = n if n <= ROWS else panels.n_sizes
    listed = zip(
        colours.class_colours(panels),
        panels.class_sides.tolist(),
        text.lengths(panels.class_length.tolist(), panels.class_sides.tolist()),
        panels.class_count.tolist(),
        strict=True,
    )
    rows = [Row(tint, sides, word + unit, count) for tint, sides, word, count in listed]
    others = [
        Row(colours.UNSIZED, 0, f"{n - shown:,} other types", int(np.sum(panels.size >= shown))),
        Row(colours.UNSIZED, 0, "of no size class", int(np.sum(panels.size < 0))),
    ]
    return [*(rows[:shown] if shown <= ROWS else []), *(row for row in others if row.count)]


def _shapes(panels: Panels, unit: str) -> list[Row]:
    """Of watertight panels, which have no sizes: one row per shape, its mean edges below its name."""
    index, kinds, tints = colours.shapes(panels)
    found = [
        (i, tint, sides, f"{NAMES.get(sides, f'{sides}-gons')}{'' if plain else ', not convex'}")
        for i, ((sides, plain), tint) in enumerate(zip(kinds, tints, strict=True))
    ]
    if (index < 0).any():
        found.append((-1, colours.UNSIZED, 0, "cut at the boundary"))
    rows = []
    for i, tint, sides, name in found:
        edge = panels.edge_length[index == i]
        ends = sorted({text.length(float(end)) for end in (edge.min(), edge.max())}, key=float)
        rows.append(Row(tint, sides, name, len(edge), f"edges {' to '.join(ends)}{unit}"))
    return rows


def _swatch(sheet: Sheet, y: float, panels: Panels, colour: str, sides: int = 0) -> None:
    """A polygon with this number of corners (None: as most panels have), standing on a side."""
    p = sides or int(np.bincount(panels.polygons.lengths, minlength=7)[3:7].argmax()) + 3
    turn = np.pi / 2 + np.pi / p * (2 * np.arange(p) + 1)
    sheet.polygon(np.stack([22 + 20 * np.cos(turn), y + 20 * np.sin(turn)], axis=1), colour)


def _bar(sheet: Sheet, top: float, length: float, panels: Panels, unit: str) -> None:
    """A bar from the shortest edge to the longest, for many sizes."""
    ends = (top + np.linspace(0, length, 257)).tolist()
    tints = colours.to_hex(colours.gradient(np.linspace(0, 1, 256)))
    for tint, low, high in zip(tints, ends[:-1], ends[1:], strict=True):
        sheet.polygon(np.array([[2, low], [42, low], [42, high], [2, high]]), tint)
    at = np.linspace(0, panels.n_sizes - 1, 5).round().astype(int)
    words = text.lengths(panels.class_length[at].tolist())
    for share, word in zip(np.linspace(0, 1, 5).tolist(), words, strict=True):
        sheet.write(64, top + share * length, word + unit, LARGE, INK)
