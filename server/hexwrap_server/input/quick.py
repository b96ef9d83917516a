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


#: What is left of a list of three numbers when everything in ``NUMBERS`` is left out.
TRIPLE, NUMBERS = b"[,,]", b"0123456789.-+eE \t\r\n"


class UnusualError(ValueError):
    """Not a body that can be read quickly."""


def read(text: bytes) -> Any:
    """The document; tables in it are arrays (n, k), and faces are Ragged. None where anything is unusual."""
    if simdjson is None or text.startswith(codecs.BOM_UTF8):  # which simdjson would pass over
        return None
    reader = _Reader()
    try:
        document = reader.value("", simdjson.Parser().parse(text))
    except (TypeError, ValueError, RuntimeError):
        return None
    return document if reader.has_seen_all(text) else None


class _Reader:
    """Reads, and keeps count of what the text must look like if it was read rightly.

    lists: in all. triples: rows taken for three numbers unseen. others: other lists that look like them.
    """

    def __init__(self) -> None:
        self._lists = 0
        self._triples = 0
        self._others = 0

    def has_seen_all(self, text: bytes) -> bool:
        """Whether the brackets in the text are those that were counted.

        There are more where lists are in rows, a name is given twice, or in text, which alone is harmless.
        """
        marks = text.translate(None, NUMBERS)
        return marks.count(b"[") == self._lists and marks.count(TRIPLE) - self._others >= self._triples

    def value(self, name: str, value: Any) -> Any:
        if isinstance(value, simdjson.Object):
            return self._object(value)
        if not isinstance(value, simdjson.Array):
            return value
        if name in TABLES:
            return self._table(value)
        if name == "faces":
            return self._faces(value)
        plain = value.as_list()
        self._count(plain)
        return plain

    def _object(self, value: Any) -> dict[str, Any]:
        if len(value) > MOST_NAMES:
            raise UnusualError
        names = list(value)
        if len(set(names)) < len(names):  # the last one counts, but only the first one can be had
            raise UnusualError
        if "\0" in "".join(names):  # what follows it is not looked at
            raise UnusualError
        return {name: self.value(name, value[name]) for name in names}

    def _table(self, rows: Any) -> Floats:
        numbers = np.frombuffer(rows.as_buffer(of_type="d"))
        lengths = self._lengths(rows, len(numbers))
        if not len(lengths) or np.any(lengths != lengths[0]) or not lengths[0]:
            raise UnusualError
        return numbers.reshape(len(lengths), -1)

    def _faces(self, rows: Any) -> Ragged:
        corners: Ints = np.frombuffer(rows.as_buffer(of_type="i"), dtype=np.int64)
        lengths = self._lengths(rows, len(corners))
        if np.any((lengths != 3) & (lengths != 4)):
            raise UnusualError
        return Ragged(corners, np.concatenate([[0], np.cumsum(lengths)]))

    def _lengths(self, rows: Any, size: int) -> Ints:
        """Numbers per row, of size numbers in all: looking at each row takes half of the reading."""
        n = len(rows)
        self._lists += 1 + n
        if size == 3 * n:
            self._triples += n
            return np.full(n, 3)
        return np.fromiter(map(len, rows), dtype=np.int64, count=n)

    def _count(self, value: Any) -> None:
        if isinstance(value, list):
            self._lists += 1
            self._others += [type(x) in (int, float) for x in value] == [True] * 3
        if isinstance(value, (list, dict)):
            for inner in value.values() if isinstance(value, dict) else value:
                self._count(inner)
