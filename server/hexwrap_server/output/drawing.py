"""What all DXF files share: a document with its layers, and its bytes.

ezdxf is loaded when something is drawn: it takes a quarter second that most processes have no use for.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

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


def encode(document: Drawing) -> bytes:
    """The drawing as a DXF file."""
    text = io.StringIO()
    document.write(text)
    data: bytes = document.encode(text.getvalue())
    return data
