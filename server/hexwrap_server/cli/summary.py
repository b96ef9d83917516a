"""What came out, as a table for people: of the contract's Result, however it was obtained."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from hexwrap_server.output.text import angle, length, lengths

#: A table of sizes is not longer than this.
MOST_SIZES = 24
#: Numbers of sizes whose cost is shown, beside the number that was taken.
SHOWN = (1, 2, 3, 5, 8, 11, 16, 24, 40)
#: The distortion of a pattern in which a triangle of the surface turns over.
FOLDED = 1e6
#: Width of the longest bar of the chart, characters.
BAR = 28
Rows = Iterable[tuple[str, str]]


def print_summary(console: Console, name: str, result: dict[str, Any]) -> None:
    """Domain, panels, sizes with counts, quality and times of a Result; parts that are null are left out."""
    table = Table(
        title=name, title_justify="left", title_style="bold", show_header=False, box=None, pad_edge=False
    )
    table.add_column(style="dim", no_wrap=True)
    table.add_column()
    for heading, rows in (
        ("model", [("in", result["unit"])] if result.get("unit") else []),
        ("domain", _domain(result["map"])),
        ("pattern", _pattern(result["pattern"])),
        ("panels", _panels(result)),
        ("quality", _quality(result)),
        ("seconds", [(stage, f"{seconds:.2f}") for stage, seconds in result.get("timings", {}).items()]),
    ):
        words = Text("   ").join(Text.assemble((f"{key} ", "dim"), value) for key, value in rows)
        if words:
            table.add_row(heading, words)
    console.print(table)
    if result["panels"] is not None:
        console.print(_sizes(result["sizes"]))
        if result["quality"]["trade_off"]:
            console.print(_trade_off(result["quality"]["trade_off"]))
    if result["quality"].get("singularity_curve"):
        console.print(_curve(result["quality"]["singularity_curve"]))
    for note in (*result["mesh"]["repairs"], *result["quality"]["notes"]):
        console.print(Text(f"• {note}"))


def _domain(found: dict[str, Any]) -> Rows:
    yield "", found["kind"]
    if found["kind"] == "cone":
        yield "angle", angle(found["cone_angle"])
    if found["kind"] == "net":
        yield "loops", str(len(found["boundary_angles"]))
        yield "singularities", str(len(found["cones"]))
    else:
        yield "circumference", length(found["circumference"])
    yield "steps", str(found["iterations"])
    yield "residual", f"{found['residual']:.1e} rad"
    if found["flips"]:
        yield "flips", str(found["flips"])


def _pattern(found: dict[str, Any] | None) -> Rows:
    if found is None:
        return
    yield "", found["kind"]
    yield "cells", str(len(found["faces"]))
    yield "around", str(found["around"])
    yield "rings", str(found["rings"])
    yield "edge", length(found["edge_length"])
    yield "distortion", "folds over" if found["distortion"] >= FOLDED else f"{found['distortion']:.2%}"


def _panels(result: dict[str, Any]) -> Rows:
    if result["panels"] is None:
        return
    yield "", str(len(result["panels"]["face"]))
    along = sum(size["fold"] for size in result["sizes"])
    yield "sizes", str(len(result["sizes"]) - along) + (f", and {along} types along folds" if along else "")
    yield "distinct", str(result["quality"]["distinct_panels"])
    yield "overlaps", str(result["quality"]["overlaps"])
    yield "coverage", f"{result['quality']['coverage']:.1%}"


def _quality(result: dict[str, Any]) -> Rows:
    found = result["quality"]
    yield "scale ratio", f"{found['scale_ratio']:.3f}"
    if result["panels"] is None:
        return
    for key, words in (
        ("planarity", "planarity"),
        ("edge_deviation", "edges"),
        ("angle_deviation", "angles"),
    ):
        yield words, _small(found[key]["max"])
    watertight = result["panels"]["mode"] == "watertight"
    if not watertight:  # which has no joints
        gap = found["gap"]["tangential"]
        yield "gap", f"{_length(gap['mean'])} (at most {_length(gap['max'])}{_at_widest(result['panels'])})"
        if found["gap"]["over"] is not None:
            yield "wider than wanted", f"{found['gap']['over']} panels"
    yield "off the surface", f"at most {_length(found['surface_distance']['max'])}"
    if watertight:
        yield "moved", f"at most {_length(found['movement'])}"
        yield (
            "convex",
            f"{found['convex']:.1%}" + (f" ({left} are not)" if (left := found["not_convex"]) else ""),
        )
        if found["kink"]["max"] is not None:
            yield "kinks", f"at most {angle(found['kink']['max'])}"


def _at_widest(panels: dict[str, Any]) -> str:
    """Beside which panel the widest joint is."""
    gap = np.asarray([] if panels["gap_tangential"] is None else panels["gap_tangential"], dtype=float)
    return f" at {panels['label'][int(np.nanargmax(gap))]}" if np.isfinite(gap).any() else ""


def _trade_off(curve: dict[str, Any]) -> Table:
    """What fewer or more sizes would leave open."""
    taken = curve["taken"]
    table = _chart("sizes", "uncovered", "mean joint", "worst joint")
    most = max(max(curve["uncovered"]), 1e-12)
    for i, sizes in enumerate(curve["sizes"]):
        if sizes not in SHOWN and sizes != taken:
            continue
        uncovered = curve["uncovered"][i]
        joints = [_length(curve[key][i]) for key in ("joint_mean", "joint_max")]
        bar = _bar("▒", uncovered / most, "bold" if sizes == taken else "dim")
        table.add_row(str(sizes), f"{uncovered:.2%}", *joints, bar)
    return table


def _curve(found: dict[str, Any]) -> Table:
    """What fewer or more singularities would leave open."""
    table = _chart("singularities", f"uncovered, {found['sizes']} sizes", "max/min cell")
    most = max(*found["uncovered"], 1e-12)
    for i, number in enumerate(found["number"]):
        uncovered, taken = found["uncovered"][i], i == found["taken"]
        bar = _bar("▒", uncovered / most, "bold" if taken else "dim")
        about = "" if taken else "about "
        table.add_row(str(number), f"{about}{uncovered:.2%}", f"{found['scale_ratio'][i]:.2f}", bar)
    return table


def _chart(*headings: str) -> Table:
    """Columns of numbers, and one of bars."""
    table = Table(box=None, pad_edge=False)
    for heading in headings:
        table.add_column(heading, justify="right")
    table.add_column("")
    return table


def _bar(letter: str, share: float, style: str) -> Text:
    return Text(letter * max(1, round(BAR * share)), style=style)


def _small(value: float | None) -> str:
    return "not measured" if value is None else f"{value:.1e}"


def _length(value: float | None) -> str:
    return "not measured" if value is None else length(value)


def _sizes(sizes: list[dict[str, Any]]) -> Table:
    table = _chart("size", "edge", "panels")
    most = max((size["count"] for size in sizes), default=1)
    shown = sizes[:MOST_SIZES]
    words = lengths([size["edge_length"] for size in shown], [size["sides"] for size in shown])
    for size, word in zip(shown, words, strict=True):
        bar = _bar("█", size["count"] / most, size["color"])
        bar.append(f" {size['sides']} sides, at folds" if size["fold"] else "", "dim")
        table.add_row(str(size["size"]), word, str(size["count"]), bar)
    if len(sizes) > MOST_SIZES:
        table.add_row("…", "", f"{sum(size['count'] for size in sizes[MOST_SIZES:])}", "")
    return table
