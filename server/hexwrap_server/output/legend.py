"""A rendered scene with its title and the legend of sizes, as PNG.

matplotlib is loaded when a picture is made: it takes half a second that most processes have no use for.
"""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING

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
INK, GREY = "#23262b", "#70757d"


def compose(image: Floats, panels: Panels, meta: Meta, unit: str | None = None) -> bytes:
    """PNG of the image (h, w, 3) with the legend on its right. unit: of the lengths."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    height, width = image.shape[:2]
    figure = Figure(figsize=((width + WIDTH) / DPI, height / DPI), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    picture = figure.add_axes((0, 0, width / (width + WIDTH), 1))
    picture.imshow(np.rint(255 * image).astype(np.uint8), interpolation="none", aspect="auto")
    picture.set_axis_off()
    axes = figure.add_axes((width / (width + WIDTH), 0, WIDTH / (width + WIDTH), 1))
    axes.set(xlim=(0, WIDTH), ylim=(height, 0))
    axes.set_axis_off()
    _legend(axes, height, panels, meta, behind(unit))
    out = io.BytesIO()
    with warnings.catch_warnings():  # a name in a script that the bundled font lacks shows boxes, no warning
        warnings.simplefilter("ignore", UserWarning)
        figure.savefig(out, format="png", dpi=DPI)
    return out.getvalue()


def _legend(axes: Axes, height: int, panels: Panels, meta: Meta, unit: str) -> None:
    n_sizes = len(panels.class_length)
    rows = n_sizes if n_sizes <= ROWS else 10
    cut = int(np.sum(panels.size < 0))
    top = (height - ROW * (rows + (cut > 0))) / 2
    title = text.one_line(meta.name)
    title = title if len(title) <= 28 else title[:27] + "…"
    axes.text(0, top - 96, title.replace("$", r"\$"), size=25, color=INK, va="center", weight="bold")
    named = panels.n_sizes
    sizes = {0: "", 1: ", 1 size"}.get(named, f", {named:,} sizes")
    axes.text(0, top - 48, f"{panels.n_panels:,} panels{sizes}", size=17, color=GREY, va="center")
    if n_sizes <= ROWS:
        _swatches(axes, top, panels, unit)
    else:
        _bar(axes, top, rows * ROW - 20, panels, unit)
    if cut:
        y = top + ROW * (rows + 0.5)
        _swatch(axes, y, panels, colours.UNSIZED)
        axes.text(64, y, "of no size class", size=17, color=GREY, va="center")
        axes.text(WIDTH - 60, y, f"{cut:,}", size=17, color=GREY, va="center", ha="right")


def _swatches(axes: Axes, top: float, panels: Panels, unit: str) -> None:
    """One row per size: colour, edge length, how many."""
    counts, words = panels.class_count.tolist(), text.lengths(panels.class_length.tolist())
    for i, colour in enumerate(colours.class_colours(panels)):
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
