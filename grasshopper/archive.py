"""The archive format of Grasshopper: a tree of chunks with typed items.

One tree, three clothes: ``.ghuser`` and ``.gh`` are the binary form in a raw DEFLATE stream, ``.ghx`` is
XML. Nothing here knows what the items mean; ``components.py`` and ``network.py`` do.
"""

from __future__ import annotations

import base64
import struct
import xml.etree.ElementTree as ET
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any
from uuid import UUID


class ArchiveError(ValueError):
    """Bytes or text that are no archive of Grasshopper."""


@dataclass(frozen=True)
class Item:
    """One value. type: a name of TYPES; index −1: the item is not one of a row."""

    name: str
    type: str
    value: Any
    index: int = -1


@dataclass
class Chunk:
    """A named group of items and further chunks."""

    name: str
    index: int = -1
    items: list[Item] = field(default_factory=list)
    chunks: list[Chunk] = field(default_factory=list)

    def add(self, type: str, name: str, value: Any, index: int = -1) -> Chunk:
        """Adds an item, in the order in which GH_IO writes them; returns the chunk itself, for chains."""
        self.items.append(Item(name, type, value, index))
        self.items.sort(key=lambda item: (item.name, item.index))
        return self

    def child(self, name: str, index: int = -1) -> Chunk:
        """Adds an empty chunk and returns it."""
        self.chunks.append(Chunk(name, index))
        return self.chunks[-1]

    def __getitem__(self, name: str | tuple[str, int]) -> Any:
        """Value of the item; KeyError if there is none."""
        wanted = name if isinstance(name, tuple) else (name, -1)
        for item in self.items:
            if (item.name, item.index) == wanted:
                return item.value
        raise KeyError(wanted)

    def find(self, *path: str | tuple[str, int]) -> Chunk:
        """The chunk at the end of a path of names; KeyError if there is none."""
        here = self
        for step in path:
            wanted = step if isinstance(step, tuple) else (step, -1)
            match = [c for c in here.chunks if (c.name, c.index) == wanted]
            if not match:
                raise KeyError(wanted)
            here = match[0]
        return here

    def walk(self) -> Iterator[Chunk]:
        """This chunk and all below it."""
        yield self
        for chunk in self.chunks:
            yield from chunk.walk()


# --- binary values ---------------------------------------------------------------------------------------


class _Reader:
    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0

    def take(self, count: int) -> bytes:
        if count < 0 or self.at + count > len(self.data):
            raise ArchiveError(f"{count} bytes wanted at {self.at}, the archive has {len(self.data)}")
        self.at += count
        return self.data[self.at - count : self.at]

    def int32(self) -> int:
        return int(struct.unpack("<i", self.take(4))[0])

    def string(self) -> str:
        length = shift = 0
        while True:
            byte = self.take(1)[0]
            length |= (byte & 0x7F) << shift
            if byte < 0x80:
                break
            shift += 7
            if shift > 28:
                raise ArchiveError(f"a string at {self.at} announces an impossible length")
        return self.take(length).decode("utf-8")


def _string(text: str) -> bytes:
    data = text.encode("utf-8")
    out, length = bytearray(), len(data)
    while length >= 0x80:
        out.append(length & 0x7F | 0x80)
        length >>= 7
    out.append(length)
    return bytes(out) + data


@dataclass(frozen=True)
class _Type:
    """How one type of item is written. tags: its XML children, empty where it is plain text."""

    code: int
    name: str
    read: Callable[[_Reader], Any]
    write: Callable[[Any], bytes]
    tags: tuple[str, ...] = ()
    parse: Callable[[str], Any] = str
    print: Callable[[Any], str] = str


def _scalar(code: int, name: str, form: str, parse: Any, show: Any = str) -> _Type:
    size = struct.calcsize("<" + form)

    def read(reader: _Reader) -> Any:
        return struct.unpack("<" + form, reader.take(size))[0]

    return _Type(code, name, read, lambda v: struct.pack("<" + form, v), (), parse, show)


def _tuple(code: int, name: str, form: str, tags: tuple[str, ...], parse: Any, show: Any = str) -> _Type:
    size = struct.calcsize("<" + form)

    def read(reader: _Reader) -> Any:
        return struct.unpack("<" + form, reader.take(size))

    return _Type(code, name, read, lambda v: struct.pack("<" + form, *v), tags, parse, show)


def _bytes(code: int, name: str) -> _Type:
    return _Type(
        code,
        name,
        lambda reader: reader.take(reader.int32()),
        lambda v: struct.pack("<i", len(v)) + bytes(v),
        (),
        base64.b64decode,
        lambda v: base64.b64encode(v).decode("ascii"),
    )


def _single(value: float) -> str:
    """The shortest decimal that reads back as the same 4-byte number."""
    for digits in range(6, 10):
        text = f"{value:.{digits}g}"
        if struct.pack("<f", float(text)) == struct.pack("<f", value):
            return text
    return repr(value)


def _to_single(text: str) -> float:
    return float(struct.unpack("<f", struct.pack("<f", float(text)))[0])


def _bool(text: str) -> bool:
    return text.strip() == "true"


def _argb(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(";"))


_COLOUR = _Type(  # stored as one little-endian integer, so blue comes first
    36,
    "gh_drawing_color",
    lambda reader: tuple(reversed(reader.take(4))),
    lambda v: bytes(reversed(v)),
    ("ARGB",),
    _argb,
    lambda v: ";".join(str(part) for part in v),
)

_TYPES = [
    _scalar(1, "gh_bool", "?", _bool, lambda v: "true" if v else "false"),
    _scalar(2, "gh_byte", "B", int),
    _scalar(3, "gh_int32", "i", int),
    _scalar(4, "gh_int64", "q", int),
    _scalar(5, "gh_single", "f", _to_single, _single),
    _scalar(6, "gh_double", "d", float, repr),
    _scalar(8, "gh_date", "q", int),
    _Type(9, "gh_guid", lambda r: UUID(bytes_le=r.take(16)), lambda v: v.bytes_le, (), UUID),
    _Type(10, "gh_string", _Reader.string, _string),
    _bytes(20, "gh_bytearray"),
    _tuple(30, "gh_drawing_point", "2i", ("X", "Y"), int),
    _tuple(31, "gh_drawing_pointf", "2f", ("X", "Y"), _to_single, _single),
    _tuple(32, "gh_drawing_size", "2i", ("W", "H"), int),
    _tuple(33, "gh_drawing_sizef", "2f", ("W", "H"), _to_single, _single),
    _tuple(34, "gh_drawing_rectangle", "4i", ("X", "Y", "W", "H"), int),
    _tuple(35, "gh_drawing_rectanglef", "4f", ("X", "Y", "W", "H"), _to_single, _single),
    _COLOUR,
    _bytes(37, "gh_drawing_bitmap"),
    _tuple(80, "gh_version", "3i", ("Major", "Minor", "Revision"), int),
]
TYPES = {kind.name: kind for kind in _TYPES}
_BY_CODE = {kind.code: kind for kind in _TYPES}
_WRAPPED = {"gh_bytearray": "stream", "gh_drawing_bitmap": "bitmap"}


# --- binary ----------------------------------------------------------------------------------------------


def to_binary(chunk: Chunk) -> bytes:
    """The chunk tree as GH_IO's bytes, not yet deflated."""
    out = [_string(chunk.name), struct.pack("<3i", chunk.index, len(chunk.items), len(chunk.chunks))]
    for item in chunk.items:
        kind = TYPES[item.type]
        out += [_string(item.name), struct.pack("<2i", item.index, kind.code), kind.write(item.value)]
    out += [to_binary(child) for child in chunk.chunks]
    return b"".join(out)


def from_binary(data: bytes) -> Chunk:
    """Inverse of ``to_binary``. Raises ArchiveError."""
    reader = _Reader(data)
    chunk = _read_chunk(reader)
    if reader.at != len(data):
        raise ArchiveError(f"{len(data) - reader.at} bytes follow the archive")
    return chunk


def _read_chunk(reader: _Reader) -> Chunk:
    name, index = reader.string(), reader.int32()
    n_items, n_chunks = reader.int32(), reader.int32()
    if n_items < 0 or n_chunks < 0:
        raise ArchiveError(f"chunk {name!r} announces {n_items} items and {n_chunks} chunks")
    items = [_read_item(reader) for _ in range(n_items)]
    return Chunk(name, index, items, [_read_chunk(reader) for _ in range(n_chunks)])


def _read_item(reader: _Reader) -> Item:
    name, index, code = reader.string(), reader.int32(), reader.int32()
    if code not in _BY_CODE:
        raise ArchiveError(f"item {name!r} has the type code {code}, which this codec does not know")
    kind = _BY_CODE[code]
    return Item(name, kind.name, kind.read(reader), index)


def deflate(chunk: Chunk) -> bytes:
    """A ``.ghuser`` or ``.gh`` file."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    return packer.compress(to_binary(chunk)) + packer.flush()


def inflate(data: bytes) -> Chunk:
    """Reads a ``.ghuser`` or ``.gh`` file. Raises ArchiveError."""
    try:
        return from_binary(zlib.decompress(data, -15))
    except (zlib.error, UnicodeDecodeError) as error:
        raise ArchiveError(f"no deflated archive: {error}") from error


# --- XML -------------------------------------------------------------------------------------------------


def to_xml(root: Chunk) -> str:
    """A ``.ghx`` file; the root becomes the element ``Archive``."""
    element = ET.Element("Archive", name=root.name)
    _fill(element, root)
    ET.indent(element)
    return (
        '<?xml version="1.0" encoding="utf-8" standalone="yes"?>\n' + ET.tostring(element, "unicode") + "\n"
    )


def _fill(element: ET.Element, chunk: Chunk) -> None:
    if chunk.items:
        items = ET.SubElement(element, "items", count=str(len(chunk.items)))
        for item in chunk.items:
            _add_item(items, item)
    if chunk.chunks:
        chunks = ET.SubElement(element, "chunks", count=str(len(chunk.chunks)))
        for child in chunk.chunks:
            index = {} if child.index < 0 else {"index": str(child.index)}
            _fill(ET.SubElement(chunks, "chunk", {"name": child.name, **index}), child)


def _add_item(items: ET.Element, item: Item) -> None:
    kind = TYPES[item.type]
    index = {} if item.index < 0 else {"index": str(item.index)}
    kinds = {"type_name": kind.name, "type_code": str(kind.code)}
    element = ET.SubElement(items, "item", {"name": item.name, **index, **kinds})
    if kind.name in _WRAPPED:
        stream = ET.SubElement(element, _WRAPPED[kind.name], length=str(len(item.value)))
        stream.text = kind.print(item.value)
    elif kind is _COLOUR:
        ET.SubElement(element, "ARGB").text = kind.print(item.value)
    elif kind.tags:
        for tag, part in zip(kind.tags, item.value, strict=True):
            ET.SubElement(element, tag).text = kind.print(part)
    else:
        element.text = kind.print(item.value)


def from_xml(text: str) -> Chunk:
    """Inverse of ``to_xml``. Raises ArchiveError."""
    try:
        element = ET.fromstring(text)
    except ET.ParseError as error:
        raise ArchiveError(f"no XML: {error}") from error
    if element.tag != "Archive":
        raise ArchiveError(f"the root element is {element.tag!r}, not 'Archive'")
    return _from_element(element)


def _from_element(element: ET.Element) -> Chunk:
    chunk = Chunk(element.get("name", ""), int(element.get("index", "-1")))
    chunk.items = [_from_item(item) for item in element.findall("items/item")]
    chunk.chunks = [_from_element(child) for child in element.findall("chunks/chunk")]
    return chunk


def _from_item(element: ET.Element) -> Item:
    name, type_name = element.get("name", ""), element.get("type_name", "")
    if type_name not in TYPES:
        raise ArchiveError(f"item {name!r} has the type {type_name!r}, which this codec does not know")
    kind = TYPES[type_name]
    value: Any
    if kind.name in _WRAPPED:
        value = kind.parse(element.findtext(_WRAPPED[kind.name], ""))
    elif kind is _COLOUR:
        value = kind.parse(element.findtext("ARGB", ""))
    elif kind.tags:
        value = tuple(kind.parse(element.findtext(tag, "")) for tag in kind.tags)
    else:
        value = kind.parse(element.text or "")
    return Item(name, type_name, value, int(element.get("index", "-1")))
