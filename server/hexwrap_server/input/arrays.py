"""Large arrays of a JSON body: checked as a whole, searched for the fault only when there is one."""

from __future__ import annotations

from itertools import chain, islice
from typing import Any

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.surface.errors import IndexRangeError, NonFiniteError, PolygonSizeError


class Fault(ValueError):
    """What is wrong, and where (JSON pointer). kind: the solver's error for the same fault, if it has one."""

    def __init__(self, pointer: str, detail: str, kind: type[HexwrapError] | None = None) -> None:
        super().__init__(detail)
        self.pointer = pointer
        self.detail = detail
        self.kind = kind


def table(rows: object, pointer: str, width: int, most: int) -> Floats:
    """(n, width) finite numbers. Raises Fault."""
    listed = _rows(rows, pointer, (width,), most)
    return _finite(listed, pointer, width).reshape(-1, width)


def numbers(row: object, pointer: str, most: int) -> Floats:
    """(n,) finite numbers. Raises Fault."""
    if not isinstance(row, list):
        raise Fault(pointer, f"must be a list of numbers, not {_kind(row)}")
    if len(row) > most:
        raise Fault(pointer, f"{len(row)} numbers, at most {most} are taken")
    parent, _, last = pointer.rpartition("/")
    if not set(map(type, row)) <= {int, float}:
        i = next(i for i, x in enumerate(row) if type(x) not in (int, float))
        raise Fault(f"{parent}/{last}/{i}", f"must be a number, not {_kind(row[i])}")
    values = np.array(row, dtype=float)
    if not np.isfinite(values).all():
        raise Fault(
            f"{pointer}/{np.flatnonzero(~np.isfinite(values))[0]}", "must be a finite number", NonFiniteError
        )
    return values


def faces(rows: object, pointer: str, n_vertices: int, most: int) -> Ragged:
    """Rows of three or four indices in 0 … n_vertices − 1. Raises Fault."""
    read = _corners(rows, pointer, n_vertices, most)
    wrong = np.flatnonzero((read.values < 0) | (read.values >= n_vertices))
    if len(wrong):
        raise _no_vertex(read.offsets, int(wrong[0]), int(read.values[wrong[0]]), pointer, n_vertices)
    return read


def _corners(rows: object, pointer: str, n_vertices: int, most: int) -> Ragged:
    listed = _rows(rows, pointer, (3, 4), most, PolygonSizeError)
    lengths = np.fromiter(map(len, listed), dtype=np.int64, count=len(listed))
    offsets = np.concatenate([[0], np.cumsum(lengths)])
    flat = list(chain.from_iterable(listed))
    if not set(map(type, flat)) <= {int}:
        _raise_not_whole(listed, pointer)
    try:
        return Ragged(np.fromiter(flat, dtype=np.int64, count=len(flat)), offsets)
    except OverflowError:
        i = next(i for i, x in enumerate(flat) if abs(x) >= 2**63)
        raise _no_vertex(offsets, i, flat[i], pointer, n_vertices) from None


def _no_vertex(offsets: Ints, i: int, said: int, pointer: str, n_vertices: int) -> Fault:
    """i: the place in all corners of all faces."""
    face = int(np.searchsorted(offsets, i, side="right")) - 1
    return Fault(
        f"{pointer}/{face}/{i - int(offsets[face])}",
        f"vertex {said} of a mesh of {n_vertices} vertices (0 to {n_vertices - 1})",
        IndexRangeError,
    )


def _rows(
    rows: object, pointer: str, widths: tuple[int, ...], most: int, kind: type[HexwrapError] | None = None
) -> list[list[Any]]:
    if not isinstance(rows, list):
        raise Fault(pointer, f"must be a list, not {_kind(rows)}")
    if len(rows) > most:
        raise _too_many(len(rows), pointer, most)
    wanted = " or ".join(map(str, widths))
    if not set(map(type, rows)) <= {list}:
        i = next(i for i, row in enumerate(rows) if type(row) is not list)
        raise Fault(f"{pointer}/{i}", f"must be a list of {wanted} numbers, not {_kind(rows[i])}")
    if not set(map(len, rows)) <= set(widths):
        i = next(i for i, row in enumerate(rows) if len(row) not in widths)
        raise Fault(f"{pointer}/{i}", f"must be a list of {wanted} numbers, not of {len(rows[i])}", kind)
    return rows


def _too_many(count: int, pointer: str, most: int) -> Fault:
    return Fault(pointer, f"{count} entries, this server takes at most {most}")


def _finite(rows: list[list[Any]], pointer: str, width: int) -> Floats:
    if not set(map(type, chain.from_iterable(rows))) <= {int, float}:
        i = next(i for i, x in enumerate(chain.from_iterable(rows)) if type(x) not in (int, float))
        found = next(islice(chain.from_iterable(rows), i, None))
        raise Fault(f"{pointer}/{i // width}/{i % width}", f"must be a number, not {_kind(found)}")
    values = np.fromiter(chain.from_iterable(rows), dtype=float, count=width * len(rows))
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        raise Fault(
            f"{pointer}/{wrong[0] // width}/{wrong[0] % width}", "must be a finite number", NonFiniteError
        )
    return values


def _raise_not_whole(rows: list[list[Any]], pointer: str) -> None:
    for i, row in enumerate(rows):
        for k, x in enumerate(row):
            if type(x) is not int:
                raise Fault(f"{pointer}/{i}/{k}", f"must be a vertex index, not {_kind(x)}")


def _kind(value: object) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return f"{value!r}"[:40]
    return "text" if isinstance(value, str) else "a list" if isinstance(value, list) else "an object"
