"""The Result as gzip, put together from parts that are compressed one by one.

So a part that is the same as in another Result is neither written nor compressed again, and some parts are
picked without any being made anew. To others the file is plain gzip; where its parts are stands in an extra
field of the header (RFC 1952, 2.3.1.1).
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import orjson
from isal import isal_zlib

#: Higher ones take longer and hardly make numbers smaller.
LEVEL = 1
#: Magic, deflate, with an extra field, no time, no hints, unknown system; the length of the field follows.
_HEAD = b"\x1f\x8b\x08\x04\0\0\0\0\0\xff"
_FIELD = b"HX"
#: Most bytes of a block of a deflate stream that holds them as they are, and its head.
_BLOCK, _STORED = 0xFFFF, struct.Struct("<BHH")
#: The end of a deflate stream: an empty last block.
_END = b"\x03\x00"
#: Bytes that were not copied together.
Pieces = Sequence[bytes | memoryview]


@dataclass(frozen=True)
class Packed:
    """Text as raw deflate, up to a whole byte. size, checksum: bytes and CRC-32 of the text."""

    pieces: Pieces
    size: int
    checksum: int

    @property
    def length(self) -> int:
        return sum(map(len, self.pieces))

    @classmethod
    def of(cls, text: bytes) -> Packed:
        packer = isal_zlib.compressobj(LEVEL, isal_zlib.DEFLATED, -isal_zlib.MAX_WBITS)
        pieces = packer.compress(text), packer.flush(isal_zlib.Z_FULL_FLUSH)
        return cls(pieces, len(text), isal_zlib.crc32(text))

    @classmethod
    def stored(cls, text: bytes) -> Packed:
        """Not compressed (RFC 1951, 3.2.4): for what is read once, that takes longer than it saves, and to
        undo it as long again."""
        pieces: list[bytes | memoryview] = []
        for at in range(0, len(text), _BLOCK):
            block = memoryview(text)[at : at + _BLOCK]
            pieces += [_STORED.pack(0, len(block), _BLOCK - len(block)), block]
        return cls(pieces, len(text), isal_zlib.crc32(text))

    @classmethod
    def joined(cls, parts: Sequence[Packed]) -> Packed:
        """Their texts one after the other."""
        return cls([piece for part in parts for piece in part.pieces], *_sum(parts))


def packed_part(name: str, value: bytes) -> Packed:
    """One member of a JSON object."""
    return Packed.of(b'"%s":%s' % (name.encode(), value))


def document(parts: Mapping[str, Packed]) -> Pieces:
    """A JSON object of parts as gzip."""
    begin, comma, end = (Packed.of(mark) for mark in (b"{", b",", b"}"))
    table = [(name, part.length, part.size, part.checksum) for name, part in parts.items()]
    row = [begin]
    for part in parts.values():
        row += [part, comma]
    whole = Packed.joined([*(row[:-1] if parts else row), end])
    listed = orjson.dumps([begin.length, comma.length, table])
    field = _FIELD + struct.pack("<H", len(listed)) + listed
    tail = struct.pack("<II", whole.checksum, whole.size & 0xFFFFFFFF)
    return [_HEAD, struct.pack("<H", len(field)), field, *whole.pieces, _END, tail]


def picked(packed: bytes, names: Iterable[str]) -> Pieces | None:
    """A smaller ``document`` of some of its parts; None where it has not all of them."""
    if packed[: len(_HEAD)] != _HEAD or packed[12:14] != _FIELD:
        return None
    (length,) = struct.unpack_from("<H", packed, 14)
    begin, comma, table = orjson.loads(packed[16 : 16 + length])
    at, found, view = 16 + length + begin, {}, memoryview(packed)
    for name, count, size, checksum in table:
        found[name] = Packed([view[at : at + count]], size, checksum)
        at += count + comma
    if not found.keys() >= set(names):
        return None
    return document({name: found[name] for name in names})


def _sum(parts: Iterable[Packed]) -> tuple[int, int]:
    """Bytes and CRC-32 of their texts one after the other."""
    size = checksum = 0
    for part in parts:
        checksum = isal_zlib.crc32_combine(checksum, part.checksum, part.size)
        size += part.size
    return size, checksum
