"""Frozen dataclasses of arrays as bytes and back: for the disk, for other processes, and for hashing.

A file is a magic word, the length of a JSON header and a checksum, the header, then the raw arrays. Nothing
is executed on reading: only the solver's dataclasses and requests can come out of it.
"""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from isal import isal_zlib

from hexwrap_server.errors import CodecError

_MAGIC = b"HXWRAP01"
_HEAD = struct.Struct("<8sQI")
_ALIGNMENT = 16
#: Where the dataclasses that may be stored are defined.
_PACKAGES = ("hexwrap_solver.", "hexwrap_server.input.requests")


def encode(value: Any) -> bytes:
    """Bytes of a dataclass, array, number, text, or list, tuple or dict of such. Raises TypeError."""
    return b"".join(pieces(value))


def pieces(value: Any) -> list[bytes | memoryview]:
    """What ``encode`` joins; the arrays are not copied."""
    header, arrays = _split(value)
    body = [header, *_padded(len(header), arrays)]
    checksum = 0
    for piece in body:
        checksum = isal_zlib.crc32(piece, checksum)  # zlib's, at a tenth of its time
    return [_HEAD.pack(_MAGIC, len(header), checksum), *body]


def is_whole(data: bytes) -> bool:
    """Whether the bytes are as ``encode`` wrote them."""
    if len(data) < _HEAD.size:
        return False
    magic, length, checksum = _HEAD.unpack_from(data)
    body = memoryview(data)[_HEAD.size :]
    return bool(magic == _MAGIC and length <= len(body) and isal_zlib.crc32(body) == checksum)


def decode(data: bytes) -> Any:
    """What was encoded; arrays are read-only. Raises CodecError."""
    if not is_whole(data):
        raise CodecError("damaged, or of another version")
    _, length, _ = _HEAD.unpack_from(data)
    try:
        body = _aligned(data, _HEAD.size)
        header = json.loads(bytes(body[:length]))
        return _join(header["value"], _arrays(header["arrays"], body, length))
    except (AttributeError, ImportError, KeyError, TypeError, ValueError) as error:
        raise CodecError(f"does not fit this version: {error}") from error


def digest(*values: Any) -> str:
    """SHA-256, in hex, of what the values say: not of how they are laid out in memory, nor of fields that do
    not count when they are compared."""
    sha = hashlib.sha256()
    for value in values:
        header, arrays = _split(value, all_fields=False)
        sha.update(header)
        for array in arrays:
            sha.update(_raw(array))
    return sha.hexdigest()


def _split(value: Any, all_fields: bool = True) -> tuple[bytes, list[np.ndarray[Any, Any]]]:
    arrays: list[np.ndarray[Any, Any]] = []
    tree = _tree(value, arrays, all_fields)
    shapes = [[a.dtype.str, list(a.shape)] for a in arrays]
    return json.dumps({"value": tree, "arrays": shapes}, separators=(",", ":")).encode(), arrays


def _tree(value: Any, arrays: list[np.ndarray[Any, Any]], all_fields: bool) -> Any:
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "biufc":
            raise TypeError(f"arrays of {value.dtype} cannot be stored")
        arrays.append(np.ascontiguousarray(value))
        return {"array": len(arrays) - 1}
    if isinstance(value, np.generic):
        return _tree(value.item(), arrays, all_fields)
    if isinstance(value, complex):
        return {"complex": [value.real, value.imag]}
    if isinstance(value, (list, tuple)):
        return {type(value).__name__: [_tree(v, arrays, all_fields) for v in value]}
    if isinstance(value, dict):
        return {
            "dict": [[_tree(k, arrays, all_fields), _tree(v, arrays, all_fields)] for k, v in value.items()]
        }
    if is_dataclass(value) and type(value).__module__.startswith(_PACKAGES):
        return {
            "object": f"{type(value).__module__}:{type(value).__name__}",
            "fields": {
                f.name: _tree(getattr(value, f.name), arrays, all_fields)
                for f in fields(value)
                if f.compare or all_fields
            },
        }
    raise TypeError(f"{type(value).__qualname__} cannot be stored")


def _join(tree: Any, arrays: list[np.ndarray[Any, Any]]) -> Any:
    if not isinstance(tree, dict):
        return tree
    if "object" in tree:
        kind = _class(tree["object"])
        return kind(**{name: _join(v, arrays) for name, v in tree["fields"].items()})
    ((kind, content),) = tree.items()
    if kind == "array":
        return arrays[content]
    if kind == "complex":
        return complex(*content)
    if kind == "dict":
        return {_join(k, arrays): _join(v, arrays) for k, v in content}
    items = [_join(v, arrays) for v in content]
    return tuple(items) if kind == "tuple" else items


def _padded(position: int, arrays: list[np.ndarray[Any, Any]]) -> Iterator[bytes | memoryview]:
    for array in arrays:
        gap = -position % _ALIGNMENT
        yield bytes(gap)
        yield _raw(array)
        position += gap + array.nbytes


def _raw(array: np.ndarray[Any, Any]) -> memoryview:
    """The bytes of a contiguous array, in place."""
    return array.reshape(-1).view(np.uint8).data


def _aligned(data: bytes, start: int) -> memoryview:
    """A read-only copy of data from start, at an address where numbers may stand.

    NumPy takes numbers that stand elsewhere to such a place piece by piece, in each operation anew.
    """
    copy = np.frombuffer(data, np.uint8, offset=start).copy()
    copy.flags.writeable = False
    return copy.data


def _arrays(shapes: list[Any], body: memoryview, position: int) -> list[np.ndarray[Any, Any]]:
    arrays = []
    for name, shape in shapes:
        dtype = np.dtype(name)
        count = int(np.prod(shape, dtype=np.int64))
        position += -position % _ALIGNMENT
        arrays.append(np.frombuffer(body, dtype, count, position).reshape(shape))
        position += count * dtype.itemsize
    return arrays


@cache
def _class(place: str) -> Any:
    module, _, name = place.partition(":")
    kind = getattr(import_module(module), name) if module.startswith(_PACKAGES) else None
    if not (isinstance(kind, type) and is_dataclass(kind)):
        raise ValueError(f"{place} is not a dataclass of this version")
    return kind
