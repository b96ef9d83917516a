"""The usual body straight to arrays, without a Python object per number.

At the least doubt ``read`` gives up; then ``parsing`` goes the long way, which finds the fault and points at
it.
"""

from __future__ import annotations

import codecs
from typing import Any

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged

try:
    import simdjson
except ImportError:  # nobody has built it for this Python; every body goes the long way
    simdjson = None  # type: ignore[assignment]

#: Fields that hold rows of equally many floats.
TABLES = ("vertices", "normals", "points")
#: Objects of more names go the long way: every name is looked for among all of them.
MOST_NAMES = 100


class UnusualError(ValueError):
    """Not a body that can be read quickly."""


def read(text: bytes) -> Any:
    """The document; tables in it are arrays (n, k), and faces are Ragged. None where anything is unusual."""
    if simdjson is None or text.startswith(codecs.BOM_UTF8):  # which simdjson would pass over
        return None
    try:
        document, n_lists = _value("", simdjson.Parser().parse(text))
    except (TypeError, ValueError, RuntimeError):
        return None
    # brackets that were not counted: lists in rows, names given twice, or text, which alone is harmless
    return document if text.count(b"[") == n_lists else None


def _value(name: str, value: Any) -> tuple[Any, int]:
    """A value, and how many lists it is made of."""
    if isinstance(value, simdjson.Object):
        return _object(value)
    if not isinstance(value, simdjson.Array):
        return value, 0
    if name in TABLES:
        return _table(value), 1 + len(value)
    if name == "faces":
        return _faces(value), 1 + len(value)
    plain = value.as_list()
    return plain, _n_lists(plain)


def _object(value: Any) -> tuple[dict[str, Any], int]:
    if len(value) > MOST_NAMES:
        raise UnusualError
    names = list(value)
    if len(set(names)) < len(names):  # the last one counts, but only the first one can be had
        raise UnusualError
    if "\0" in "".join(names):  # what follows it is not looked at
        raise UnusualError
    members = {name: _value(name, value[name]) for name in names}
    return {name: inner for name, (inner, _) in members.items()}, sum(n for _, n in members.values())


def _table(rows: Any) -> Floats:
    lengths = _lengths(rows)
    if not len(lengths) or np.any(lengths != lengths[0]) or not lengths[0]:
        raise UnusualError
    return np.frombuffer(rows.as_buffer(of_type="d")).reshape(len(lengths), -1)


def _faces(rows: Any) -> Ragged:
    lengths = _lengths(rows)
    if np.any((lengths != 3) & (lengths != 4)):
        raise UnusualError
    corners: Ints = np.frombuffer(rows.as_buffer(of_type="i"), dtype=np.int64)
    return Ragged(corners, np.concatenate([[0], np.cumsum(lengths)]))


def _lengths(rows: Any) -> Ints:
    return np.fromiter(map(len, rows), dtype=np.int64, count=len(rows))


def _n_lists(value: Any) -> int:
    if isinstance(value, list):
        return 1 + sum(map(_n_lists, value))
    return sum(map(_n_lists, value.values())) if isinstance(value, dict) else 0
