"""A rendered scene with its title and the legend of sizes, as PNG.

matplotlib is loaded when a picture is made: it takes half a second that most processes have no use for.
"""

from __future__ import annotations

import io
import textwrap
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from hexwrap_server.output import colours, text
from hexwrap_server.output.meta import Meta
from hexwrap_server.output.units import behind
from hexwrap_solver.arrays import Floats
from hexwrap_solver.panels.types import Panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Pixels; dots per inch only relates them to matplotlib's points.
WIDTH, ROW, DPI = 420, 54, 100
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


def compose(image: Floats, panels: Panels, meta: Meta, unit: str | None = None) -> bytes:
    """PNG of the image (h, w, 3) in 0..1 with the legend on its right. unit: of the lengths."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    height = image.shape[0]
    figure = Figure(figsize=(WIDTH / DPI, height / DPI), dpi=DPI, facecolor="white")
    canvas: Any = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, WIDTH), ylim=(height, 0))
    axes.set_axis_off()
    (_shapes if panels.mode == "watertight" else _legend)(axes, height, panels, meta, behind(unit))
    with warnings.catch_warnings():  # a name in a script that the bundled font lacks shows boxes, no warning
        warnings.simplefilter("ignore", UserWarning)
        canvas.draw()
    legend = np.asarray(canvas.buffer_rgba())[:height, :WIDTH, :3]
    pixels = np.concatenate([np.rint(255 * image).astype(np.uint8), legend], axis=1)
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "png", compress_level=4, dpi=(DPI, DPI))
    return out.getvalue()


def _title(axes: Axes, top: float, name: str) -> None:
    """The name above the legend, its last line at ``top``, in as many lines as it needs."""
    lines = textwrap.wrap(name, LETTERS, break_on_hyphens=False) or [""]
    size = 25
    if len(lines) > LINES:
        lines, size = textwrap.wrap(name, int(LETTERS * 25 / 15), break_on_hyphens=False), 15
    step = size * 1.35 * DPI / 72
    canvas: Any = axes.figure.canvas
    renderer = canvas.get_renderer()
    for k, line in enumerate(reversed(lines)):
        place: dict[str, Any] = {"color": INK, "va": "center", "weight": "bold"}
        shown = axes.text(0, top - k * step, line.replace("$", r"\$"), size=size, **place)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            width = shown.get_window_extent(renderer).width
        shown.set_fontsize(size * min(1.0, (WIDTH - 12) / max(width, 1.0)))


def _legend(axes: Axes, height: int, panels: Panels, meta: Meta, unit: str) -> None:
    n_sizes = len(panels.class_length)
    shown = n_sizes if n_sizes <= ROWS else panels.n_sizes
    rows = shown if shown <= ROWS else 10
    others = [
        (f"{n_sizes - shown:,} other types", int(np.sum(panels.size >= shown))),
        ("of no size class", int(np.sum(panels.size < 0))),
    ]
    others = [(words, count) for words, count in others if count]
    top = (height - ROW * (rows + len(others))) / 2
    _title(axes, top - 96, text.one_line(meta.name))
    named = panels.n_sizes
    sizes = {0: "", 1: ", 1 size"}.get(named, f", {named:,} sizes")
    axes.text(0, top - 48, f"{panels.n_panels:,} panels{sizes}", size=17, color=GREY, va="center")
    if shown <= ROWS:
        _swatches(axes, top, panels, unit, shown)
    else:
        _bar(axes, top, rows * ROW - 20, panels, unit)
    for k, (words, count) in enumerate(others):
        y = top + ROW * (rows + k + 0.5)
        _swatch(axes, y, panels, colours.UNSIZED)
        axes.text(64, y, words, size=17, color=GREY, va="center")
        axes.text(WIDTH - 60, y, f"{count:,}", size=17, color=GREY, va="center", ha="right")


def _shapes(axes: Axes, height: int, panels: Panels, meta: Meta, unit: str) -> None:
    """Of watertight panels, which have no sizes: one row per shape, its mean edges below its name."""
    index, kinds, tints = colours.shapes(panels)
    rows = [
        (i, tint, sides, f"{NAMES.get(sides, f'{sides}-gons')}{'' if plain else ', not convex'}")
        for i, ((sides, plain), tint) in enumerate(zip(kinds, tints, strict=True))
    ]
    if (index < 0).any():
        rows.append((-1, colours.UNSIZED, 0, "cut at the boundary"))
    top = (height - ROW * len(rows)) / 2
    _title(axes, top - 96, text.one_line(meta.name))
    axes.text(0, top - 48, f"{panels.n_panels:,} flat panels", size=17, color=GREY, va="center")
    for k, (i, tint, sides, name) in enumerate(rows):
        y, edge = top + ROW * (k + 0.5), panels.edge_length[index == i]
        _swatch(axes, y, panels, tint, sides)
        words = sorted({text.length(float(end)) for end in (edge.min(), edge.max())}, key=float)
        axes.text(64, y - 9, name, size=15, color=INK, va="center")
        axes.text(64, y + 14, f"edges {' to '.join(words)}{unit}", size=11, color=GREY, va="center")
        axes.text(WIDTH - 30, y, f"{len(edge):,}", size=15, color=GREY, va="center", ha="right")


def _swatches(axes: Axes, top: float, panels: Panels, unit: str, shown: int) -> None:
    """One row per size, of so many: colour, edge length, how many."""
    counts, words = panels.class_count.tolist(), text.lengths(panels.class_length.tolist())
    for i, colour in enumerate(colours.class_colours(panels)[:shown]):
        y = top + ROW * (i + 0.5)
        _swatch(axes, y, panels, colour, int(panels.class_sides[i]))
        axes.text(64, y, words[i] + unit, size=17, color=INK, va="center")
        axes.text(WIDTH - 60, y, f"{counts[i]:,}", size=17, color=GREY, va="center", ha="right")


def _swatch(axes: Axes, y: float, panels: Panels, colour: str, sides: int = 0) -> None:
    """A polygon with this number of corners (None: as most panels have), standing on a side."""
    from matplotlib.patches import RegularPolygon

    p = sides or int(np.bincount(panels.polygons.lengths, minlength=7)[3:7].argmax()) + 3
    axes.add_patch(RegularPolygon((22, y), p, radius=20, orientation=np.pi / p, color=colour))


def _bar(axes: Axes, top: float, length: float, panels: Panels, unit: str) -> None:
    """A bar from the shortest edge to the longest, for many sizes."""
    steps = colours.gradient(np.linspace(0, 1, 256))[:, None]
    axes.imshow(steps, extent=(2, 42, top + length, top), aspect="auto", interpolation="bilinear")
    axes.set(xlim=(0, WIDTH), ylim=axes.get_ylim())
    at = np.linspace(0, panels.n_sizes - 1, 5).round().astype(int)
    words = text.lengths(panels.class_length[at].tolist())
    for share, word in zip(np.linspace(0, 1, 5).tolist(), words, strict=True):
        axes.text(64, top + share * length, word + unit, size=17, color=INK, va="center")
