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
#: More sizes than this are shown as a bar of colours.
ROWS = 24
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


def compose(image: NDArray[np.uint8], panels: Panels, meta: Meta, unit: str | None = None) -> bytes:
    """PNG of the image (h, w, 3) with the legend on its right. unit: of the lengths."""
    ground = Image.new("RGB", (FINE * WIDTH, FINE * image.shape[0]), "white")
    draw = _shapes if panels.mode == "watertight" else _legend
    draw(Sheet(ImageDraw.Draw(ground)), image.shape[0], panels, meta, behind(unit))
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


def _legend(sheet: Sheet, height: int, panels: Panels, meta: Meta, unit: str) -> None:
    n_sizes = len(panels.class_length)
    shown = n_sizes if n_sizes <= ROWS else panels.n_sizes
    rows = shown if shown <= ROWS else 10
    others = [
        (f"{n_sizes - shown:,} other types", int(np.sum(panels.size >= shown))),
        ("of no size class", int(np.sum(panels.size < 0))),
    ]
    others = [(words, count) for words, count in others if count]
    top = (height - ROW * (rows + len(others))) / 2
    _title(sheet, top - 96, text.one_line(meta.name))
    named = panels.n_sizes
    sizes = {0: "", 1: ", 1 size"}.get(named, f", {named:,} sizes")
    sheet.write(0, top - 48, f"{panels.n_panels:,} panels{sizes}", LARGE, GREY)
    if shown <= ROWS:
        _swatches(sheet, top, panels, unit, shown)
    else:
        _bar(sheet, top, rows * ROW - 20, panels, unit)
    for k, (words, count) in enumerate(others):
        y = top + ROW * (rows + k + 0.5)
        _swatch(sheet, y, panels, colours.UNSIZED)
        sheet.write(64, y, words, LARGE, GREY)
        sheet.write(WIDTH - 60, y, f"{count:,}", LARGE, GREY, anchor="rm")


def _shapes(sheet: Sheet, height: int, panels: Panels, meta: Meta, unit: str) -> None:
    """Of watertight panels, which have no sizes: one row per shape, its mean edges below its name."""
    index, kinds, tints = colours.shapes(panels)
    rows = [
        (i, tint, sides, f"{NAMES.get(sides, f'{sides}-gons')}{'' if plain else ', not convex'}")
        for i, ((sides, plain), tint) in enumerate(zip(kinds, tints, strict=True))
    ]
    if (index < 0).any():
        rows.append((-1, colours.UNSIZED, 0, "cut at the boundary"))
    top = (height - ROW * len(rows)) / 2
    _title(sheet, top - 96, text.one_line(meta.name))
    sheet.write(0, top - 48, f"{panels.n_panels:,} flat panels", LARGE, GREY)
    for k, (i, tint, sides, name) in enumerate(rows):
        y, edge = top + ROW * (k + 0.5), panels.edge_length[index == i]
        _swatch(sheet, y, panels, tint, sides)
        words = sorted({text.length(float(end)) for end in (edge.min(), edge.max())}, key=float)
        sheet.write(64, y - 9, name, NORMAL, INK)
        sheet.write(64, y + 14, f"edges {' to '.join(words)}{unit}", SMALL, GREY)
        sheet.write(WIDTH - 30, y, f"{len(edge):,}", NORMAL, GREY, anchor="rm")


def _swatches(sheet: Sheet, top: float, panels: Panels, unit: str, shown: int) -> None:
    """One row per size, of this many: colour, edge length, how many."""
    counts, words = panels.class_count.tolist(), text.lengths(panels.class_length.tolist())
    for i, colour in enumerate(colours.class_colours(panels)[:shown]):
        y = top + ROW * (i + 0.5)
        _swatch(sheet, y, panels, colour, int(panels.class_sides[i]))
        sheet.write(64, y, words[i] + unit, LARGE, INK)
        sheet.write(WIDTH - 60, y, f"{counts[i]:,}", LARGE, GREY, anchor="rm")


def _swatch(sheet: Sheet, y: float, panels: Panels, colour: str, sides: int = 0) -> None:
    """A polygon with this number of corners (None: as most panels have), standing on a side."""
    p = sides or int(np.bincount(panels.polygons.lengths, minlength=7)[3:7].argmax()) + 3
    turn = np.pi / 2 + np.pi / p * (2 * np.arange(p) + 1)
    sheet.polygon(np.stack([22 + 20 * np.cos(turn), y + 20 * np.sin(turn)], axis=1), colour)


def _bar(sheet: Sheet, top: float, length: float, panels: Panels, unit: str) -> None:
    """A bar from the shortest edge to the longest, for many sizes."""
    ends = top + np.linspace(0, length, 257)
    ends = (top + np.linspace(0, length, 257)).tolist()
    tints = colours.to_hex(colours.gradient(np.linspace(0, 1, 256)))
    for tint, low, high in zip(tints, ends[:-1], ends[1:], strict=True):
        sheet.polygon(np.array([[2, low], [42, low], [42, high], [2, high]]), tint)
    at = np.linspace(0, panels.n_sizes - 1, 5).round().astype(int)
    words = text.lengths(panels.class_length[at].tolist())
    for share, word in zip(np.linspace(0, 1, 5).tolist(), words, strict=True):
        sheet.write(64, top + share * length, word + unit, LARGE, INK)
