"""Text as programs write it: any line ends and encoding, numbers that are named when they are none."""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Sequence
from itertools import accumulate

import numpy as np

from hexwrap_server.errors import UnreadableFileError
from hexwrap_solver.arrays import Floats, Ints

#: Byte order marks; the longer one first where one begins like another.
MARKS = {
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF32_LE: "utf-32-le",
    codecs.BOM_UTF32_BE: "utf-32-be",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
#: Characters that are looked at to recognise UTF-16 without a mark.
_HEAD = 64
_COMMA = re.compile(rb"[+-]?\d*,\d+")

#: The number of words of the row that begins at a place in a list of words.
Width = Callable[[list[bytes], int], int]


def as_utf8(data: bytes) -> bytes:
    """A text file without its byte order mark, in UTF-8 where it was in UTF-16 or UTF-32."""
    for mark, encoding in MARKS.items():
        if data.startswith(mark):
            content = data[len(mark) :]
            return content if encoding == "utf-8" else _recoded(content, encoding)
    first, second = data[: 2 * _HEAD : 2], data[1 : 2 * _HEAD : 2]
    if 2 * second.count(0) > len(second) and all(first):
        return _recoded(data, "utf-16-le")
    if 2 * first.count(0) > len(first) and all(second):
        return _recoded(data, "utf-16-be")
    return data


def _recoded(data: bytes, encoding: str) -> bytes:
    return data.decode(encoding, "replace").encode()


def floats(words: Sequence[bytes], what: str) -> Floats:
    """The words as numbers. what: of what they are, for the message. Raises UnreadableFileError."""
    try:
        return np.fromiter(map(float, words), np.float64, len(words))
    except ValueError:
        raise _no_number(words, what, float) from None


def integers(words: Sequence[bytes], what: str) -> Ints:
    """The words as integers. Raises UnreadableFileError."""
    try:
        return np.fromiter(map(int, words), np.int64, len(words))
    except (ValueError, OverflowError):
        raise _no_number(words, what, int) from None


def _no_number(words: Sequence[bytes], what: str, kind: Callable[[bytes], float]) -> UnreadableFileError:
    for word in words:
        try:
            if abs(kind(word)) < 2**63 or kind is float:
                continue
        except ValueError:
            pass
        comma = _COMMA.fullmatch(word)
        advice = "write numbers with a decimal point instead of a comma" if comma else "export it again"
        shown = word[:40].decode("utf-8", "replace")
        noun = "a number" if kind is float else "an integer"
        return UnreadableFileError(f"The {what} hold '{shown}', which is not {noun}: {advice}.")
    return UnreadableFileError(f"The {what} are not made of numbers: export the file again.")


def count(word: bytes) -> int:
    """Raises ValueError where the word is not a count."""
    if not word.isdigit():
        raise ValueError(word)
    return int(word)


def rows(lines: list[list[bytes]], parts: Sequence[tuple[str, int, Width]]) -> list[list[list[bytes]]]:
    """The rows of each part of a file, one part after the other.

    parts: what a row is, how many there are, and how many words each needs. There is one row a line, and
    words behind those needed are left in it. Only where the lines are not as many as the rows, a row may go
    on over several lines, or a line may hold several rows. Raises UnreadableFileError.
    """
    total = sum(number for _, number, _ in parts)
    held = sum(map(len, lines))
    if total > held:  # before a list of that length is made
        raise UnreadableFileError(
            f"The file announces {total} rows but holds {held} numbers: it is truncated, so export it again."
        )
    flat = [(what, k, width) for what, number, width in parts for k in range(number)]
    if len(lines) < total:
        found = _run_on(lines, flat)
        if len(found) < total:
            what, k, _ = flat[len(found)]
            raise UnreadableFileError(
                f"The file ends before {what} {k}, of the {total} rows that it announces: it is truncated, "
                "so export it again."
            )
    else:
        found, pairs = lines[:total], enumerate(zip(lines, flat, strict=False))
        short = next((i for i, (line, row) in pairs if len(line) < _needed(line, 0, row[2])), None)
        if short is not None:
            found = _run_on(lines, flat, whole_lines=True)
            if len(found) < total:
                what, k, _ = flat[short]
                text = b" ".join(lines[short])[:60].decode("utf-8", "replace")
                raise UnreadableFileError(
                    f"The row of {what} {k} is '{text}': it holds fewer numbers than it needs. Export the "
                    "file again."
                )
    cut: list[list[list[bytes]]] = []
    at = 0
    for _, number, _ in parts:
        cut.append(found[at : at + number])
        at += number
    return cut


def _needed(words: list[bytes], at: int, width: Width) -> int:
    try:
        needed = width(words, at)
    except IndexError:
        return len(words) + 1
    except ValueError:
        text = b" ".join(words[at : at + 8])[:60].decode("utf-8", "replace")
        raise UnreadableFileError(
            f"A row '{text}' does not begin with the number of its entries: export the file again."
        ) from None
    return needed


def _run_on(
    lines: list[list[bytes]], flat: Sequence[tuple[str, int, Width]], *, whole_lines: bool = False
) -> list[list[bytes]]:
    """Rows of just the words they need, one after the other, as many as there are. whole_lines: each begins
    and ends with a line."""
    words = [word for line in lines for word in line]
    ends = set(accumulate(map(len, lines)))
    found: list[list[bytes]] = []
    at = 0
    for _, _, width in flat:
        end = at + _needed(words, at, width)
        if end > len(words) or (whole_lines and end not in ends):
            break
        found.append(words[at:end])
        at = end
    return found
