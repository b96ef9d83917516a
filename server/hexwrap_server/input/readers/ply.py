"""PLY: text and binary, faces of any size, triangle strips."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexwrap_server.errors import UnreadableFileError
from hexwrap_server.input.readers.found import FileContent, of_mesh
from hexwrap_server.input.readers.text import MARKS, Width, as_utf8, count, floats, rows
from hexwrap_solver.arrays import Ragged
from hexwrap_solver.surface import SentMesh

#: Names of types, and the letter that ``struct`` and numpy know them by.
_TYPES = {
    "char": "b", "int8": "b", "uchar": "B", "uint8": "B", "short": "h", "int16": "h", "ushort": "H",
    "uint16": "H", "int": "i", "int32": "i", "uint": "I", "uint32": "I", "long": "q", "int64": "q",
    "ulong": "Q", "uint64": "Q", "float": "f", "float32": "f", "double": "d", "float64": "d",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_END = re.compile(rb"(?<=[\r\n])[ \t]*end_header[ \t]*(\r\n|\n|\r)", re.IGNORECASE)
FACES = ("face", "tristrips")
_CORNERS = ("vertex_indices", "vertex_index", "indices")


@dataclass(frozen=True)
class _Property:
    """count: the type of a list's length, None for a single number."""

    name: str
    kind: str
    count: str | None = None


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]


@dataclass(frozen=True)
class _Rows:
    """What was read of an element: columns of single numbers, and lists."""

    single: dict[str, NDArray[np.float64]]
    lists: dict[str, Ragged]


def read_ply(data: bytes) -> FileContent:
    """The vertices with their normals, where it has some, and the faces or strips.

    Raises UnreadableFileError.
    """
    order, elements, body = _head(data)
    found = _text(body, elements) if order == "" else _binary(body, elements, order)
    vertex = found.get("vertex")
    if vertex is None or not {"x", "y", "z"} <= vertex.single.keys():
        raise UnreadableFileError("The PLY file holds no mesh: it has no vertices with x, y and z.")
    faces = _faces(found)
    if faces is None or faces.n_rows == 0:
        raise UnreadableFileError("The PLY file holds no mesh: it has no faces, only points.")
    normals = None
    if {"nx", "ny", "nz"} <= vertex.single.keys():
        normals = np.stack([vertex.single[name] for name in ("nx", "ny", "nz")], axis=1)
    points = np.stack([vertex.single[name] for name in "xyz"], axis=1)
    return of_mesh(SentMesh(points, faces, normals))


def _head(data: bytes) -> tuple[str, list[_Element], bytes]:
    """Byte order ("" for text), the elements, and what follows the header. Raises UnreadableFileError."""
    if data.startswith(tuple(MARKS)):
        data = as_utf8(data)
    end = _END.search(data)
    if not data[:3].lower() == b"ply" or end is None:
        raise UnreadableFileError("The file is not a PLY file: it has no header from 'ply' to 'end_header'.")
    start = end.end()
    if end[1] == b"\r\n" and b"\r\n" not in data[: end.start()]:
        start -= 1  # lines end with \r alone, and the first byte of the body happens to be a \n
    order = None
    elements: list[_Element] = []
    for line in data[: end.start()].decode("latin-1").splitlines():
        match line.lower().split():
            case ["format", name, *_]:
                order = _ORDERS.get(name)
            case ["element", name, count, *_] if count.isdecimal():
                elements.append(_Element(name, int(count), ()))
            case ["property", "list", count, kind, name, *_] if elements:
                _add(elements, _Property(name, _type(kind), _type(count)))
            case ["property", kind, name, *_] if elements:
                _add(elements, _Property(name, _type(kind)))
            case ["element" | "property", *_]:
                raise UnreadableFileError(f"The header of the PLY file cannot be read: '{line[:60]}'.")
    if order is None:
        raise UnreadableFileError("The PLY file does not tell whether it is text or binary.")
    return order, elements, data[start:]


def _type(name: str) -> str:
    if name not in _TYPES:
        raise UnreadableFileError(f"The PLY file names a type '{name[:40]}', which is not one of PLY.")
    return _TYPES[name]


def _add(elements: list[_Element], found: _Property) -> None:
    last = elements[-1]
    elements[-1] = _Element(last.name, last.count, (*last.properties, found))


def _text(body: bytes, elements: list[_Element]) -> dict[str, _Rows]:
    lines = [line for raw in body.splitlines() if (line := raw.split())]
    held = [element for element in elements if element.properties]
    parts = [(element.name, element.count, _width(element)) for element in held]
    cut = rows(lines, parts)
    return {element.name: _text_rows(element, found) for element, found in zip(held, cut, strict=True)}


def _width(element: _Element) -> Width:
    def width(words: list[bytes], at: int) -> int:
        place = at
        for item in element.properties:
            place += 1 if item.count is None else 1 + count(words[place])
        return place - at

    return width


def _text_rows(element: _Element, found: list[list[bytes]]) -> _Rows:
    single: dict[str, NDArray[np.float64]] = {}
    lists: dict[str, Ragged] = {}
    what = f"rows of '{element.name}' in the PLY file"
    at = [0] * len(found)  # where the property stands in each row
    for item in element.properties:
        if item.count is None:
            single[item.name] = floats([row[k] for row, k in zip(found, at, strict=True)], what)
            at = [k + 1 for k in at]
        else:
            counts = [int(row[k]) for row, k in zip(found, at, strict=True)]
            words = [x for row, k, c in zip(found, at, counts, strict=True) for x in row[k + 1 : k + 1 + c]]
            lists[item.name] = Ragged(floats(words, what), np.append(0, np.cumsum(counts)).astype(np.int64))
            at = [k + 1 + c for k, c in zip(at, counts, strict=True)]
    return _Rows(single, lists)


def _binary(body: bytes, elements: list[_Element], order: str) -> dict[str, _Rows]:
    found: dict[str, _Rows] = {}
    at = 0
    for element in elements:
        if "vertex" in found and any(found[name].lists for name in FACES if name in found):
            break  # edges, materials and other things behind the faces do not matter
        found[element.name], at = _binary_rows(body, at, element, order)
    return found


def _binary_rows(body: bytes, at: int, element: _Element, order: str) -> tuple[_Rows, int]:
    """The rows of an element that begins there, and where the next one begins. Raises UnreadableFileError
    where the file ends before."""
    items = element.properties
    if all(item.count is None for item in items):
        table = np.dtype([(str(k), order + item.kind) for k, item in enumerate(items)])
        held = element.count if not items else (len(body) - at) // table.itemsize
        if held < element.count:
            raise _cut_short(element, held)
        read = np.frombuffer(body, table, element.count if items else 0, at)
        columns = {item.name: read[str(k)].astype(np.float64) for k, item in enumerate(items)}
        return _Rows(columns, {}), at + element.count * table.itemsize
    values: list[list[float]] = [[] for _ in items]
    counts: list[list[int]] = [[] for _ in items]
    for row in range(element.count):  # where one begins is known only when the one before has been read
        for item, numbers, lengths in zip(items, values, counts, strict=True):
            many = 1
            try:
                if item.count is not None:
                    (many,) = struct.unpack_from(order + item.count, body, at)
                    lengths.append(many)
                    at += struct.calcsize(item.count)
                numbers += struct.unpack_from(f"{order}{many}{item.kind}", body, at)
            except struct.error:  # too few bytes, or a length below 0
                raise _cut_short(element, row) from None
            at += many * struct.calcsize(item.kind)
    columns, lists = {}, {}
    for item, numbers, lengths in zip(items, values, counts, strict=True):
        if item.count is None:
            columns[item.name] = np.array(numbers, dtype=np.float64)
        else:
            offsets = np.append(0, np.cumsum(lengths)).astype(np.int64)
            lists[item.name] = Ragged(np.array(numbers, dtype=np.float64), offsets)
    return _Rows(columns, lists), at


def _cut_short(element: _Element, held: int) -> UnreadableFileError:
    return UnreadableFileError(
        f"The PLY file announces {element.count} rows of '{element.name}' but holds {held}: it is truncated "
        "or damaged, so export it again."
    )


def _faces(found: dict[str, _Rows]) -> Ragged | None:
    """The corners of the faces; strips are taken apart."""
    for element in FACES:
        lists = found[element].lists if element in found else {}
        named = next((name for name in _CORNERS if name in lists), next(iter(lists), None))
        if named is None or lists[named].n_rows == 0:
            continue
        corners = lists[named]
        whole = Ragged(np.asarray(corners.values).astype(np.int64), corners.offsets)
        return whole if element == "face" else _strips(whole)
    return None


def _strips(strips: Ragged) -> Ragged:
    """Each corner from the third on makes a triangle with the two before it; −1 ends a strip within a row.

    Every second triangle is turned over, since a strip zigzags.
    """
    index, row = np.asarray(strips.values, dtype=np.int64), strips.row
    ends = np.flatnonzero(index < 0)
    piece = row + np.searchsorted(ends, np.arange(len(index)))
    kept = index >= 0
    index, piece = index[kept], piece[kept]
    first = np.searchsorted(piece, piece)  # pieces do not decrease
    at = np.flatnonzero(np.arange(len(index)) - first >= 2)
    odd = (at - first[at]) % 2 == 1
    a, b, c = index[at - 2], index[at - 1], index[at]
    triangles = np.stack([np.where(odd, b, a), np.where(odd, a, b), c], axis=1)
    real = (a != b) & (b != c) & (c != a)  # repeated corners steer a strip around a turn
    return Ragged.from_table(triangles[real])
