"""``hexwrap inspect``: what a file holds, and what would be done with it."""

from __future__ import annotations

import numpy as np
from rich.console import Console
from rich.table import Table

from hexwrap_server.input.choose import Chosen
from hexwrap_server.input.parts import parts_of
from hexwrap_server.input.readers.found import FileContent, Found
from hexwrap_server.input.surface_files import as_sent, chosen_of, read_file
from hexwrap_server.jobs.work import take_in
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.surface.types import Surface, SurfaceSettings
from hexwrap_solver.words import box

#: Rows that are printed; the loops of more objects are not counted either.
MOST_ROWS = 200
#: Letters of a layer's path that are shown on a console of usual width.
LAYER = 20


def print_content(console: Console, data: bytes, filename: str, settings: SurfaceSettings) -> int:
    """Prints a table of the objects; returns the exit status. Raises FileTypeError, UnreadableFileError."""
    content = read_file(data, filename)
    unit = settings.unit or content.unit
    chosen: Chosen | None = None
    surface: Surface | None = None
    refusal = ""
    try:
        chosen = chosen_of(content, filename, settings)
        surface = take_in(as_sent(content, chosen, settings), settings)
    except HexwrapError as error:
        refusal = error.detail
    tolerance = f", tolerance {content.tolerance:g}" if content.tolerance else ""
    count = len(content.objects)
    console.print(f"{filename}: {count} surface{'s' * (count != 1)}, unit {unit or 'not known'}{tolerance}")
    console.print(_table(content, chosen, unit))
    if len(content.objects) > MOST_ROWS:
        console.print(f"… and {len(content.objects) - MOST_ROWS} more")
    if content.others:
        others = ", ".join(f"{count} {kind}" for kind, count in sorted(content.others.items()))
        console.print(f"Besides: {others}")
    for sentence in surface.repairs if surface else chosen.notes if chosen else ():
        console.print(sentence)
    console.print(_summary(surface) if surface else refusal)
    return 1 if refusal else 0


def _summary(surface: Surface) -> str:
    """What would be mapped."""
    size = box(np.ptp(surface.vertices, axis=0))
    walls = len(surface.loops) - surface.openings
    counts = {"opening": surface.openings, "crease": len(surface.features)}
    found = {"boundary curve": walls} | {noun: count for noun, count in counts.items() if count}
    parts = [f"{count} {noun}{'s' * (count != 1)}" for noun, count in found.items()]
    unit = f" {surface.unit}" if surface.unit else ""
    return f"To be panelized: a surface of {size}{unit} with {', '.join(parts)}."


def _table(content: FileContent, chosen: Chosen | None, unit: str | None) -> Table:
    """Numbers, sizes and loops stand on one line each; words wrap where the console is narrow."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("no.", justify="right", no_wrap=True)
    table.add_column("object", overflow="fold")
    if any(item.layer for item in content.objects):
        table.add_column("layer", overflow="fold")
    table.add_column("kind")
    table.add_column(f"size{f' ({unit})' if unit else ''}", no_wrap=True)
    table.add_column("loops", no_wrap=True)
    table.add_column("would be", overflow="fold")
    used = {id(item) for item in chosen.used} if chosen else set()
    for number, item in enumerate(content.objects[:MOST_ROWS]):
        loops, fault = _loops(content, item)
        table.add_row(
            str(number),
            item.name or "unnamed",
            *([_short(item.layer)] if len(table.columns) == 7 else []),
            item.kind,
            "×".join(f"{x:.3g}" if x < 1000 else f"{x:.0f}" for x in item.size),
            loops,
            fault or _fate(item, used, chosen),
        )
    return table


def _short(layer: str) -> str:
    """The last steps of a layer's path, as many as fit; at least one, which --layer takes, too."""
    steps, shown = layer.split("::"), ""
    while steps and (not shown or len(steps[-1]) + len(shown) <= LAYER):
        shown = steps.pop() + (f"::{shown}" if shown else "")
    return f"…::{shown}" if steps else shown


def _loops(content: FileContent, item: Found) -> tuple[str, str]:
    """The number of boundary curves of each of its pieces, or why it cannot be read."""
    try:
        parts = parts_of(content, [item]).parts
    except HexwrapError as error:
        return "?", f"cannot be read: {error.detail[:60]}"
    counts = [str(part.loops) for part in parts]
    return "+".join(counts[:3]) + ("+…" if len(counts) > 3 else ""), ""


def _fate(item: Found, used: set[int], chosen: Chosen | None) -> str:
    if id(item) in used:
        return "joined" if len(used) > 1 else "taken"
    if not item.visible or item.locked:
        return "hidden" if not item.visible else "locked"
    return "left out" if chosen else "to choose"
