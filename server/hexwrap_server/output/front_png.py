"""The front of an exploration as a picture: what is left uncovered over the cost, in colours of the types."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from hexwrap_server.output import text
from hexwrap_server.output.legend import GREY, INK
from hexwrap_solver.arrays import Floats

#: Pixels of the picture; dots per inch only relates them to matplotlib's points.
SIZE, DPI = (1400, 900), 100
#: Areas of discs as matplotlib takes them, points²: of the front, others, and the ring of the proposed one.
FRONT, MEASURED, PROPOSED = 150, 60, 420
#: Where a number may stand beside its disc, as tried; half its width per digit, half its height, and what is
#: left free around it, pixels.
SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))
HALF_DIGIT, HALF_HEIGHT, FREE = 4.5, 6.0, 3.0


def front_png(result: dict[str, Any]) -> bytes:
    """Measured variants as discs, those of the front with a rim and their number of types, the proposed one
    named; foreseen ones as small dots."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patheffects import withStroke

    variants = result["variants"]
    figure = Figure(figsize=(SIZE[0] / DPI, SIZE[1] / DPI), dpi=DPI, facecolor="white", layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    foreseen = [one["predicted"] for one in variants if not one["measured"]]
    axes.scatter(
        [one["cost"] for one in foreseen],
        [100 * one["uncovered"] for one in foreseen],
        s=9,
        color=GREY,
        alpha=0.4,
        label="foreseen",
        linewidths=0,
    )
    solved = [(i, one) for i, one in enumerate(variants) if one["measured"]]
    found = axes.scatter(
        [one["measured"]["cost"] for _, one in solved],
        [100 * one["measured"]["uncovered"] for _, one in solved],
        c=[one["measured"]["types"] for _, one in solved],
        s=[FRONT if one["front"] else MEASURED for _, one in solved],
        cmap="viridis",
        linewidths=[1.5 if one["front"] else 0 for _, one in solved],
        edgecolors=INK,
        label="measured (front: with a rim)",
    )
    if result["best"] is not None:
        best = variants[result["best"]]["measured"]
        axes.scatter(
            [best["cost"]], [100 * best["uncovered"]], s=PROPOSED, facecolors="none", edgecolors="#d9480f",
            linewidths=2, label="proposed",
        )  # fmt: skip
    figure.colorbar(found, ax=axes, label="types")
    axes.set_yscale("log")
    for formatted in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
        formatted(lambda value, _: f"{value:g}")
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
    axes.set(xlabel="cost", ylabel="uncovered, % of the cells")
    name = variants[0]["request"].get("name") if variants else ""
    axes.set_title(text.one_line(name or "front").replace("$", r"\$"), loc="left", weight="bold", color=INK)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, labelspacing=1.2, borderpad=1)
    figure.draw_without_rendering()  # then it is known where discs are
    places = axes.transData.transform(found.get_offsets())
    area = [PROPOSED if i == result["best"] else FRONT if one["front"] else MEASURED for i, one in solved]
    radius = np.sqrt(area) / 2 * DPI / 72
    for k, at in beside(places, radius, {k: str(i) for k, (i, one) in enumerate(solved) if one["front"]}):
        axes.annotate(
            str(solved[k][0]), at, xycoords="figure pixels", ha="center", va="center_baseline", color=INK,
            size=10, zorder=4, path_effects=[withStroke(linewidth=3, foreground="white")],
        )  # fmt: skip
    out = io.BytesIO()
    canvas.print_png(out)
    return out.getvalue()


def beside(places: Floats, radius: Floats, words: dict[int, str]) -> Iterator[tuple[int, Floats]]:
    """Middles of words beside discs, (n, 2) and (n,) pixels: each on the first side of its disc where it lies
    least over discs and the words before it."""
    middle, half = places, np.repeat(radius[:, None], 2, axis=1)
    for k, word in words.items():
        own = np.array([HALF_DIGIT * len(word), HALF_HEIGHT]) + FREE
        tried = places[k] + np.array(SIDES) * (radius[k] + own)
        low = np.maximum(tried[:, None] - own, middle - half)
        common = np.minimum(tried[:, None] + own, middle + half) - low
        over = np.maximum(common, 0).prod(axis=2).sum(axis=1)
        at = tried[int(over.round(6).argmin())]
        middle, half = np.vstack([middle, at]), np.vstack([half, own])
        yield k, at
