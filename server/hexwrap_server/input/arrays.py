"""Large arrays of a JSON body: checked as a whole, searched for the fault only when there is one."""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain
from typing import Any

import numpy as np

from hexwrap_server.errors import FormError
from hexwrap_solver.arrays import Floats, Ragged
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.surface.errors import IndexRangeError, NonFiniteError, PolygonSizeError


def table(rows: object, pointer: str, width: int, most: int) -> Floats:
    """(n, width) finite numbers. Raises FormError."""
    flat = list(chain.from_iterable(_rows(rows, pointer, (width,), most)))
    return _numbers(flat, lambda i: f"{pointer}/{i // width}/{i % width}").reshape(-1, width)


def numbers(row: object, pointer: str, most: int) -> Floats:
    """(n,) finite numbers. Raises FormError."""
    if not isinstance(row, list):
        raise FormError.at(pointer, f"must be a list of numbers, not {_kind(row)}")
    if len(row) > most:
        raise FormError.at(pointer, f"{len(row)} numbers, at most {most} are taken")
    return _numbers(row, lambda i: f"{pointer}/{i}")


def faces(rows: object, pointer: str, n_vertices: int, most: int) -> Ragged:
    """Rows of three or four indices in 0 … n_vertices − 1. Raises FormError."""
    listed = _rows(rows, pointer, (3, 4), most, PolygonSizeError)
    offsets = np.cumsum([0, *map(len, listed)])
    flat = list(chain.from_iterable(listed))

    def place(i: int) -> str:
        face = int(np.searchsorted(offsets, i, side="right")) - 1
        return f"{pointer}/{face}/{i - int(offsets[face])}"

    _are(flat, {int}, "a vertex index", place)
    try:
        index = np.fromiter(flat, dtype=np.int64, count=len(flat))
    except OverflowError:  # of those beyond all limits any other that is wrong will do
        index = np.array([i if abs(i) < 2**63 else -1 for i in flat])
    wrong = np.flatnonzero((index < 0) | (index >= n_vertices))
    if len(wrong):
        i = int(wrong[0])
        what = f"vertex {flat[i]} of a mesh of {n_vertices} vertices (0 to {n_vertices - 1})"
        raise FormError.at(place(i), what, IndexRangeError)
    return Ragged(index, offsets)


def _numbers(flat: list[Any], place: Callable[[int], str]) -> Floats:
    """Finite numbers. place: where each stands."""
    _are(flat, {int, float}, "a number", place)
    values = np.fromiter(flat, dtype=float, count=len(flat))
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        raise FormError.at(place(int(wrong[0])), "must be a finite number", NonFiniteError)
    return values


def _are(flat: list[Any], kinds: set[type], what: str, place: Callable[[int], str]) -> None:
    """Raises FormError where one of the values is of another kind."""
    if not set(map(type, flat)) <= kinds:
        i = next(i for i, x in enumerate(flat) if type(x) not in kinds)
        raise FormError.at(place(i), f"must be {what}, not {_kind(flat[i])}")


def _rows(
    rows: object, pointer: str, widths: tuple[int, ...], most: int, kind: type[HexwrapError] | None = None
) -> list[list[Any]]:
    if not isinstance(rows, list):
        raise FormError.at(pointer, f"must be a list, not {_kind(rows)}")
    if len(rows) > most:
        raise FormError.at(pointer, f"{len(rows)} entries, this server takes at most {most}")
    wanted = " or ".join(map(str, widths))
    if not set(map(type, rows)) <= {list}:
        i = next(i for i, row in enumerate(rows) if type(row) is not list)
        raise FormError.at(f"{pointer}/{i}", f"must be a list of {wanted} numbers, not {_kind(rows[i])}")
    if not set(map(len, rows)) <= set(widths):
        i = next(i for i, row in enumerate(rows) if len(row) not in widths)
        raise FormError.at(
            f"{pointer}/{i}", f"must be a list of {wanted} numbers, not of {len(rows[i])}", kind
        )
    return rows


def _kind(value: object) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return f"{value!r}"[:40]
    return "text" if isinstance(value, str) else "a list" if isinstance(value, list) else "an object"
