"""What all DXF files share: a document with its layers, what it shows, and its bytes.

ezdxf is loaded when something is drawn: it takes a quarter second that most processes have no use for.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from hexwrap_server.output.layers import size_layers
from hexwrap_server.output.meta import Meta
from hexwrap_server.output.text import one_line
from hexwrap_server.output.units import unit_of
from hexwrap_solver.panels.types import Panels

if TYPE_CHECKING:
    from ezdxf.document import Drawing


def drawing(panels: Panels, meta: Meta, *others: str, prefix: str = "") -> Drawing:
    """An empty drawing with a coloured layer per size and further grey ones."""
    document = grey_drawing(meta, *others)
    for layer in size_layers(panels).values():
        document.layers.add(prefix + layer.name).rgb = layer.colour
    return document


def grey_drawing(meta: Meta, *others: str) -> Drawing:
    """An empty drawing in the model's unit, with grey layers."""
    from ezdxf.filemanagement import new

    document = new("R2010")
    document.header["$INSUNITS"] = unit_of(meta.unit).dxf
    document.header["$MEASUREMENT"] = 0 if meta.unit in ("ft", "in") else 1
    document.header["$PROJECTNAME"] = one_line(meta.name)
    for other in others:
        document.layers.add(other).rgb = (110, 115, 124)
    return document


class Entities:
    """What a drawing shows, written as tags at once: as objects of ezdxf they take half a millisecond each.

    Points are rows of two or three numbers.
    """

    def __init__(self, document: Drawing) -> None:
        self._document = document
        self._owner = document.modelspace().layout_key
        self._next = int(str(document.entitydb.handles), 16)
        self._tags: list[str] = []

    def line(self, start: Sequence[float], end: Sequence[float], layer: str) -> None:
        self._add("LINE", layer, "Line", _point(start), _point(end, 1))

    def point(self, place: Sequence[float], layer: str) -> None:
        self._add("POINT", layer, "Point", _point(place))

    def polyline(self, points: Sequence[Any], layer: str, *, close: bool = False) -> None:
        """Of points in the plane."""
        count = f" 90\n{len(points)}\n 70\n{int(close)}\n"
        corners = "".join(f" 10\n{x}\n 20\n{y}\n" for x, y in points)
        self._add("LWPOLYLINE", layer, "Polyline", count, corners)

    def path(self, points: Sequence[Any], layer: str, *, close: bool = False) -> None:
        """A polyline in space."""
        flags = f" 70\n{8 + close}\n"
        owner = self._add("POLYLINE", layer, "3dPolyline", " 66\n1\n", _point((0.0, 0.0)), flags)
        for point in points:
            self._add("VERTEX", layer, "Vertex\n100\nAcDb3dPolylineVertex", _point(point), " 70\n32\n")
        self._add("SEQEND", layer, "", owner=owner)

    def text(
        self,
        words: str,
        height: float,
        place: Sequence[float],
        layer: str,
        *,
        turn: float = 0.0,
        normal: Sequence[float] | None = None,
        centred: bool = True,
    ) -> None:
        """One line around a place, or from there on. turn: degrees. normal: of the plane, to whose object
        coordinates the place then belongs."""
        tags = [_point(place), f" 40\n{height}\n  1\n{words}\n"]
        if turn:
            tags.append(f" 50\n{turn}\n")
        if centred:
            tags += [" 72\n1\n", _point(place, 1)]
        if normal is not None:
            tags.append("210\n{}\n220\n{}\n230\n{}\n".format(*normal))
        tags.append("100\nAcDbText\n 73\n2\n" if centred else "100\nAcDbText\n")
        self._add("TEXT", layer, "Text", *tags)

    def _add(self, kind: str, layer: str, subclass: str, *tags: str, owner: str = "") -> str:
        handle = f"{self._next:X}"
        self._next += 1
        head = f"  0\n{kind}\n  5\n{handle}\n330\n{owner or self._owner}\n100\nAcDbEntity\n  8\n{layer}\n"
        self._tags += (head, f"100\nAcDb{subclass}\n" if subclass else "", *tags)
        return handle

    def encode(self) -> bytes:
        """The drawing with them as a DXF file."""
        text = io.StringIO()
        self._document.entitydb.handles.reset(f"{self._next:X}")
        self._document.write(text)
        head, mark, rest = text.getvalue().partition("  0\nSECTION\n  2\nENTITIES\n")
        data: bytes = self._document.encode("".join((head, mark, *self._tags, rest)))
        return data


def _point(at: Sequence[float], which: int = 0) -> str:
    x, y, z = at if len(at) == 3 else (*at, 0.0)
    return f" 1{which}\n{x}\n 2{which}\n{y}\n 3{which}\n{z}\n"
