"""Drawings in DXF, text or binary.

ezdxf is loaded with the first such file: it takes a quarter second that most processes have no use for.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np

from hexwrap_server.errors import DrawingError
from hexwrap_server.input.readers.drawing import (
    DEEPEST,
    FLATNESS,
    MOST_OBJECTS,
    Drawing,
    curve,
    too_many,
)
from hexwrap_server.input.readers.text import as_utf8

if TYPE_CHECKING:
    from ezdxf.document import Drawing as Document

_BINARY = b"AutoCAD Binary DXF"
#: Bytes at the end of a file where it says that it ends.
_TAIL = 100
_LINE_END = re.compile(rb"\r+\n|\r")
#: Entities that a path is made of; hatches are read by their boundaries.
_CURVES = {
    "LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "HELIX",
    "SOLID", "TRACE", "3DFACE", "HATCH", "MPOLYGON",
}  # fmt: skip


def read_dxf(data: bytes) -> Drawing:
    """Points, curves, and outlines of areas in the model space, blocks resolved.

    What is on layers that are off or frozen, and what is not a curve, is left out. Raises DrawingError.
    """
    try:
        document = _document(data)
    except DrawingError:
        raise
    except Exception as error:  # damaged structures show as any kind of error
        raise DrawingError(f"The drawing is not a DXF file, or is damaged: {error}.") from None
    drawing = Drawing()
    hidden = {layer.dxf.name.lower() for layer in document.layers if layer.is_off() or layer.is_frozen()}
    paths: list[Any] = []
    for entity in _resolved(document.modelspace(), drawing, count(), 0):
        kind = entity.dxftype()
        if entity.dxf.get("invisible", 0) or entity.dxf.get("layer", "0").lower() in hidden:
            drawing.left_out[f"hidden {kind}"] += 1
        elif kind == "POINT":
            drawing.curves.append(curve([list(entity.dxf.location.xyz)]))
        else:
            found = _paths(entity) if kind in _CURVES else []
            paths += found
            drawing.left_out[kind] += not found
    drawing.left_out = +drawing.left_out
    corners = [np.array([v.xyz for v in path.control_vertices()]) for path in paths]
    if corners:
        size = float(np.ptp(np.vstack(corners), axis=0).max())
        for path in paths:
            points = [list(v.xyz) for v in path.flattening(max(FLATNESS * size, 1e-12))]
            drawing.curves.append(curve(points[:-1] if path.is_closed else points, path.is_closed))
    return drawing


def _document(data: bytes) -> Document:
    from ezdxf import recover
    from ezdxf.document import Drawing as Document
    from ezdxf.lldxf.tagger import binary_tags_loader

    binary = data.startswith(_BINARY)
    text = data if binary else _LINE_END.sub(b"\n", as_utf8(data))
    if not text[-_TAIL:].rstrip(b"\0\r\n\t \x1a").upper().endswith(b"EOF"):
        raise DrawingError("The drawing is not a DXF file, or is truncated: it does not end with EOF.")
    if binary:
        return Document.load(binary_tags_loader(data, errors="surrogateescape"))
    return recover.read(io.BytesIO(text.strip() + b"\n"))[0]


def _resolved(entities: Iterable[Any], drawing: Drawing, seen: Iterator[int], depth: int) -> Iterator[Any]:
    """Entities other than block references, at any depth; multilines as the lines they show. seen: counts
    them."""
    for entity in entities:
        if next(seen) >= MOST_OBJECTS:
            raise too_many()
        kind = entity.dxftype()
        if kind == "INSERT":
            block = entity.block()
            if depth == DEEPEST or block is None or block.block.is_xref:
                drawing.left_out["external reference" if block is None or depth < DEEPEST else kind] += 1
                continue
            for one in entity.multi_insert() if entity.mcount > 1 else [entity]:
                if next(seen) >= MOST_OBJECTS:  # a grid of blocks, which may be empty
                    raise too_many()
                yield from _resolved(one.virtual_entities(), drawing, seen, depth + 1)
        elif kind == "MLINE":
            yield from entity.virtual_entities()
        else:
            yield entity


def _paths(entity: Any) -> list[Any]:
    """Empty where the entity draws nothing, is a mesh, or is faulty."""
    from ezdxf.path import from_hatch, make_path

    try:
        hatched = entity.dxftype() in ("HATCH", "MPOLYGON")
        return [path for path in (from_hatch(entity) if hatched else [make_path(entity)]) if len(path)]
    except Exception:  # faults of single entities come as any kind of error
        return []
