"""Points and curves drawn elsewhere, for ``hexwrap lift``: CSV, JSON, DXF and 3DM, in and out.

ezdxf is loaded with the first DXF file (see ``output.drawing``).
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rhino3dm

from hexwrap_server.errors import DrawingError
from hexwrap_server.input.readers.drawing import Curve, Drawing
from hexwrap_server.input.readers.drawing_3dm import read_3dm_drawing
from hexwrap_server.input.readers.drawing_csv import read_csv
from hexwrap_server.input.readers.drawing_dxf import read_dxf
from hexwrap_server.input.readers.drawing_json import read_json
from hexwrap_server.output.drawing import Entities
from hexwrap_server.output.text import csv_table
from hexwrap_server.output.units import heading, unit_of
from hexwrap_solver.arrays import Floats, runs


def read_drawing(path: Path) -> Drawing:
    """Raises DrawingError."""
    kind = path.suffix.lower()
    if kind not in READERS:
        raise DrawingError(f"{path.name}: drawings are read from {', '.join(READERS)} files.")
    try:
        data = path.read_bytes()
        drawing = READERS[kind](data)
    except DrawingError as error:
        raise DrawingError(f"{path.name}: {error.detail}") from None
    except (Exception, MemoryError) as error:  # foreign readers fail in every way on broken files
        raise DrawingError(
            f"{path.name} cannot be read: {type(error).__name__}: {str(error)[:200]}."
        ) from None
    if not drawing.curves:
        left_out = "".join(f"; {note}" for note in drawing.notes())
        raise DrawingError(f"{path.name} holds no points and no curves{left_out}.")
    if not all(np.all(np.isfinite(curve.points)) for curve in drawing.curves):
        raise DrawingError(f"{path.name} holds numbers that are not finite.")
    return drawing


def write_curves(kind: str, curves: list[Curve], unit: str | None = None) -> bytes:
    """kind: the ending of the file; unit: of the lengths. Raises KeyError for an ending not in WRITERS."""
    return WRITERS[kind](curves, unit)


def refined(curve: Curve, step: float) -> Curve:
    """The curve with further points, so that no two neighbours are further apart than step."""
    points = drawn(curve)
    if len(points) < 2:
        return curve
    along = np.diff(points, axis=0)
    pieces = np.maximum(np.ceil(np.linalg.norm(along, axis=1) / step), 1).astype(np.int64)
    at, number = runs(pieces)
    share = number / pieces[at]
    fine = points[at] + share[:, None] * along[at]
    return Curve(fine if curve.closed else np.vstack([fine, points[-1:]]), curve.closed)


def _write_csv(curves: list[Curve], unit: str | None) -> bytes:
    """A heading, rows of numbers, an empty row between curves; closed ones return to their first point."""
    rows: list[list[object]] = [[heading(letter, unit) for letter in "xyz"[: curves[0].points.shape[1]]]]
    for curve in curves:
        rows += [*drawn(curve).tolist(), []]
    return csv_table(rows[:-1])


def _write_json(curves: list[Curve], unit: str | None) -> bytes:
    listed = [{"points": curve.points.tolist(), "closed": curve.closed} for curve in curves]
    return json.dumps({"curves": listed} | ({"unit": unit} if unit else {})).encode()


def _write_dxf(curves: list[Curve], unit: str | None) -> bytes:
    from ezdxf.filemanagement import new

    document = new("R2010")
    document.header["$INSUNITS"] = unit_of(unit).dxf
    space = Entities(document)
    for curve in curves:
        if len(curve.points) == 1:
            space.point(curve.points[0].tolist(), "0")
        else:
            space.path(curve.points.tolist(), "0", close=curve.closed)
    return space.encode()


def _write_3dm(curves: list[Curve], unit: str | None) -> bytes:
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, unit_of(unit).rhino)
    for curve in curves:
        points = [rhino3dm.Point3d(*p, *[0.0] * (3 - len(p))) for p in drawn(curve).tolist()]
        if len(points) == 1:
            model.Objects.AddPoint(points[0])
        else:
            model.Objects.AddPolyline(rhino3dm.Point3dList(points), None)
    return base64.b64decode(model.Encode())


def drawn(curve: Curve) -> Floats:
    """(k, 2 or 3) its points, the first one again where it is closed."""
    return np.vstack([curve.points, curve.points[:1]]) if curve.closed else curve.points


READERS: dict[str, Callable[[bytes], Drawing]] = {
    ".csv": read_csv, ".txt": read_csv, ".json": read_json, ".dxf": read_dxf, ".3dm": read_3dm_drawing,
}  # fmt: skip
WRITERS: dict[str, Callable[[list[Curve], str | None], bytes]] = {
    ".csv": _write_csv, ".txt": _write_csv, ".json": _write_json, ".dxf": _write_dxf, ".3dm": _write_3dm,
}  # fmt: skip
