"""Drawings as tables: numbers in rows, as spreadsheets of any country write them."""

from __future__ import annotations

import csv
import re

from hexwrap_server.errors import DrawingError
from hexwrap_server.input.readers.drawing import Drawing, curve
from hexwrap_server.input.readers.text import as_utf8

_LINE_ENDS = re.compile(r"\r\n|\r|\n")
#: A spreadsheet's own word on the separator, on the first line.
_SEPARATOR = re.compile(r"sep=(.)", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
#: 1.234.567,8 and 1,234,567.8
_GROUPED = re.compile(r"[+-]?\d{1,3}(?:([.,])\d{3})(?:\1\d{3})*([.,])\d+")
#: What looks almost like a number was meant to be one, and is not a heading.
_NEARLY = re.compile(r"[+-]?[.,]?\d")


def read_csv(data: bytes) -> Drawing:
    """One curve of successive rows, one point of a row alone; an empty row ends a curve.

    The first row may be a heading, if no cell of it begins like a number; lines that begin with # are passed
    over. Commas are decimal where ; or a tabulator separates the cells, or where each word between blanks
    holds just one. Raises DrawingError, which names the line.
    """
    lines = _LINE_ENDS.split(_decoded(as_utf8(data)))
    first = 0
    declared = _SEPARATOR.fullmatch(lines[0].strip())
    if declared:
        first = 1
    separator = declared[1] if declared else _separator(lines)
    curves: list[list[list[float]]] = [[]]
    heading = True
    for number, line in enumerate(lines[first:], first + 1):
        if line.lstrip().startswith("#"):
            continue
        cells = _cells(line, separator)
        if not any(cells):
            curves.append([])
            continue
        if heading and not any(_NEARLY.match(cell) for cell in cells):
            heading = False
            continue
        heading = False
        curves[-1].append(_row(cells, separator, number, line))
    return Drawing([curve(points) for points in curves if points])


def _decoded(data: bytes) -> str:
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _separator(lines: list[str]) -> str | None:
    """None: blanks."""
    text = "\n".join(lines)
    for mark in ";\t":
        if mark in text:
            return mark
    words = [word for line in lines for word in line.split()]
    decimal = all(_DECIMAL_COMMA.fullmatch(word) for word in words if "," in word)
    several = all(len(line.split()) != 1 for line in lines)
    return None if "," not in text or (decimal and several) else ","


def _cells(line: str, separator: str | None) -> list[str]:
    """Without the blanks, quotation marks and empty cells around and behind them."""
    if separator is None:
        cells = [word.strip('"') for word in line.split()]
    else:
        cells = [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _row(cells: list[str], separator: str | None, number: int, line: str) -> list[float]:
    try:
        row = [_number(cell) for cell in cells]
    except ValueError:
        empty = not all(cells)
        what = "has an empty cell between others" if empty else "is not made of numbers"
        raise DrawingError(f"Line {number} of the table {what}: '{line[:60]}'.") from None
    if len(row) in (2, 3):
        return row
    hint = ""
    if separator == "," and len(row) in (4, 6):
        hint = " Where commas are decimal, separate the cells by ; instead."
    raise DrawingError(
        f"Line {number} of the table holds {len(row)} numbers, '{line[:60]}': a point is two or three.{hint}"
    )


def _number(cell: str) -> float:
    """Raises ValueError."""
    cell = cell.replace("\N{MINUS SIGN}", "-")
    grouped = _GROUPED.fullmatch(cell)
    if grouped and grouped[1] != grouped[2]:
        return float(cell.replace(grouped[1], "").replace(",", "."))
    if _DECIMAL_COMMA.fullmatch(cell):
        return float(cell.replace(",", "."))
    return float(cell)
