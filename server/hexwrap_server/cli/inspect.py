"""``hexwrap inspect``: what a file holds, and what would be done with it."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from hexwrap_server.input.choose import Chosen, choose
from hexwrap_server.input.parts import parts_of
from hexwrap_server.input.readers.found import FileContent, Found
from hexwrap_server.input.surface_files import read_file
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.surface.types import SurfaceSettings

#: Rows that are printed; the loops of more objects are not counted either.
MOST_ROWS = 200


def print_content(console: Console, data: bytes, filename: str, settings: SurfaceSettings) -> int:
    """Prints a table of the objects; returns the exit status. Raises FileTypeError, UnreadableFileError."""
    content = read_file(data, filename)
    unit = settings.unit or content.unit
    chosen: Chosen | None = None
    refusal = ""
    try:
        chosen = choose(content, settings.object, settings.layer, unit)
    except HexwrapError as error:
        refusal = error.detail
    tolerance = f", tolerance {content.tolerance:g}" if content.tolerance else ""
    console.print(f"{filename}: {len(content.objects)} surfaces, unit {unit or 'not known'}{tolerance}")
    console.print(_table(content, chosen, unit))
    if len(content.objects) > MOST_ROWS:
        console.print(f"… and {len(content.objects) - MOST_ROWS} more")
    if content.others:
        others = ", ".join(f"{count} {kind}" for kind, count in sorted(content.others.items()))
        console.print(f"Besides: {others}")
    for sentence in (refusal,) if refusal else chosen.told if chosen else ():
        console.print(sentence)
    return 1 if refusal else 0


def _table(content: FileContent, chosen: Chosen | None, unit: str | None) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in (
        "no.",
        "object",
        "layer",
        "kind",
        f"size{f' ({unit})' if unit else ''}",
        "loops",
        "would be",
    ):
        table.add_column(heading, justify="right" if heading == "no." else "left", no_wrap=True)
    used = {id(item) for item in chosen.used} if chosen else set()
    for number, item in enumerate(content.objects[:MOST_ROWS]):
        size = " × ".join(f"{x:.4g}" for x in item.size)
        name = item.name or item.id
        table.add_row(
            str(number), name, item.layer, item.kind, size, _loops(content, item), _fate(item, used, chosen)
        )
    return table


def _loops(content: FileContent, item: Found) -> str:
    """The number of boundary curves of each of its pieces."""
    try:
        parts = parts_of(content, [item]).parts
    except HexwrapError as error:
        return f"cannot be read: {error.detail[:60]}"
    counts = [str(part.loops) for part in parts]
    return " + ".join(counts[:4]) + (" + …" if len(counts) > 4 else "")


def _fate(item: Found, used: set[int], chosen: Chosen | None) -> str:
    if id(item) in used:
        return "joined" if len(used) > 1 else "taken"
    if not item.visible or item.locked:
        return f"left out ({'locked' if item.visible else 'hidden'})"
    return "left out" if chosen else "to be chosen"
