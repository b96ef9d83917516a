"""The front of an exploration as a picture: what is left uncovered over the cost, in colours of the types."""

from __future__ import annotations

import io
from typing import Any

from hexwrap_server.output import text
from hexwrap_server.output.legend import GREY, INK

#: Pixels of the picture; dots per inch only relates them to matplotlib's points.
SIZE, DPI = (1400, 900), 100


def front_png(result: dict[str, Any]) -> bytes:
    """Measured variants as discs, those of the front with a rim and their number of types, the proposed one
    named; foreseen ones as small dots."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

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
        s=[150 if one["front"] else 60 for _, one in solved],
        cmap="viridis",
        linewidths=[1.5 if one["front"] else 0 for _, one in solved],
        edgecolors=INK,
        label="measured (front: with a rim)",
    )
    for i, one in solved:
        if one["front"]:
            place = one["measured"]["cost"], 100 * one["measured"]["uncovered"]
            axes.annotate(str(i), place, (7, 5), textcoords="offset points", color=INK, size=10)
    if result["best"] is not None:
        best = variants[result["best"]]["measured"]
        axes.scatter(
            [best["cost"]], [100 * best["uncovered"]], s=420, facecolors="none", edgecolors="#d9480f",
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
    axes.legend(frameon=False)
    out = io.BytesIO()
    canvas.print_png(out)
    return out.getvalue()
