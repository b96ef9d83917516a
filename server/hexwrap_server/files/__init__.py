"""Writers: a finished Solution as a file. One module per file; pictures share ``raster``."""

from __future__ import annotations

from collections.abc import Callable

from hexwrap_server.files.meta import Meta, NotMadeError, SheetError
from hexwrap_server.files.obj import panels_obj
from hexwrap_server.files.picture import panels_png
from hexwrap_server.files.table import panels_csv
from hexwrap_solver.pipeline import Solution

#: File name → writer; the names of the contract's ``/files/{name}``.
WRITERS: dict[str, Callable[[Solution, Meta], bytes]] = {
    "panels.obj": panels_obj,
    "panels.csv": panels_csv,
    "panels.png": panels_png,
}


def write(name: str, solution: Solution, meta: Meta) -> bytes:
    """The file of that name. Raises KeyError for an unknown name, HexwrapError where it cannot be made."""
    return WRITERS[name](solution, meta)


__all__ = ["WRITERS", "Meta", "NotMadeError", "SheetError", "write"]
