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
#: The end of a deflate stream: an empty last block.
_END = b"\x03\x00"


@dataclass(frozen=True)
class Packed:
    """Text as raw deflate, up to a whole byte. size, checksum: bytes and CRC-32 of the text."""

    data: bytes | memoryview
    size: int
    checksum: int

    @classmethod
    def of(cls, text: bytes) -> Packed:
        packer = isal_zlib.compressobj(LEVEL, isal_zlib.DEFLATED, -isal_zlib.MAX_WBITS)
        data = packer.compress(text) + packer.flush(isal_zlib.Z_FULL_FLUSH)
        return cls(data, len(text), isal_zlib.crc32(text))

    @classmethod
    def joined(cls, pieces: Sequence[Packed]) -> Packed:
        """Their texts one after the other."""
        return cls(b"".join(piece.data for piece in pieces), *_sum(pieces))


def packed_part(name: str, value: bytes) -> Packed:
    """One member of a JSON object."""
    return Packed.of(b'"%s":%s' % (name.encode(), value))


def document(parts: Mapping[str, Packed]) -> bytes:
    """A JSON object of parts as gzip."""
    begin, comma, end = (Packed.of(mark) for mark in (b"{", b",", b"}"))
    table = [(name, len(part.data), part.size, part.checksum) for name, part in parts.items()]
    pieces = [begin]
    for part in parts.values():
        pieces += [part, comma]
    pieces = [*(pieces[:-1] if parts else pieces), end]
    listed = orjson.dumps([len(begin.data), len(comma.data), table])
    field = _FIELD + struct.pack("<H", len(listed)) + listed
    size, checksum = _sum(pieces)
    tail = struct.pack("<II", checksum, size & 0xFFFFFFFF)
    data = (piece.data for piece in pieces)
    return b"".join([_HEAD, struct.pack("<H", len(field)), field, *data, _END, tail])


def picked(packed: bytes, names: Iterable[str]) -> bytes | None:
    """A smaller ``document`` of some of its parts; None where it has not all of them."""
    if packed[: len(_HEAD)] != _HEAD or packed[12:14] != _FIELD:
        return None
    (length,) = struct.unpack_from("<H", packed, 14)
    begin, comma, table = orjson.loads(packed[16 : 16 + length])
    at, found, view = 16 + length + begin, {}, memoryview(packed)
    for name, count, size, checksum in table:
        found[name] = Packed(view[at : at + count], size, checksum)
        at += count + comma
    if not found.keys() >= set(names):
        return None
    return document({name: found[name] for name in names})


def _sum(pieces: Iterable[Packed]) -> tuple[int, int]:
    """Bytes and CRC-32 of their texts one after the other."""
    size = checksum = 0
    for piece in pieces:
        checksum = isal_zlib.crc32_combine(checksum, piece.checksum, piece.size)
        size += piece.size
    return size, checksum
