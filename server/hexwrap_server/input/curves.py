"""Points and curves drawn elsewhere, for ``hexwrap lift``: CSV, JSON, DXF and 3DM, in and out.

ezdxf is loaded with the first DXF file (see ``files.drawing``).
"""

from __future__ import annotations

import base64
import csv
import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rhino3dm

from hexwrap_server.output.drawing import encode
from hexwrap_solver.arrays import Floats
from hexwrap_solver.errors import HexwrapError

#: Arcs and splines become polylines about this close to them, in parts of the drawing's size.
FLATNESS = 1e-4
#: Points taken on a curve of a Rhino file that is no polyline.
SAMPLES = 200


class DrawingError(HexwrapError):
    slug = "drawing"
    title = "The drawing cannot be read"


@dataclass(frozen=True)
class Curve:
    """points: (k, 2 or 3), a single one for a point. closed: the last is joined to the first."""

    points: Floats
    closed: bool = False


def read_curves(path: Path) -> list[Curve]:
    """Raises DrawingError."""
    kind = path.suffix.lower()
    if kind not in READERS:
        raise DrawingError(f"{path.name}: drawings are read from {', '.join(READERS)} files.")
    try:
        data = path.read_bytes()
        curves = READERS[kind](data)
    except DrawingError:
        raise
    except (Exception, MemoryError) as error:  # foreign readers fail in every way on broken files
        raise DrawingError(
            f"{path.name} cannot be read: {type(error).__name__}: {str(error)[:200]}."
        ) from None
    if not curves or not all(np.all(np.isfinite(curve.points)) for curve in curves):
        raise DrawingError(f"{path.name} holds no points and no curves, or numbers that are not finite.")
    return curves


def write_curves(kind: str, curves: list[Curve]) -> bytes:
    """kind: the ending of the file. Raises KeyError for an ending that is not in WRITERS."""
    return WRITERS[kind](curves)


def refined(curve: Curve, step: float) -> Curve:
    """The curve with further points, so that no two neighbours are further apart than step."""
    points = np.vstack([curve.points, curve.points[:1]]) if curve.closed else curve.points
    if len(points) < 2:
        return curve
    along = np.diff(points, axis=0)
    pieces = np.maximum(np.ceil(np.linalg.norm(along, axis=1) / step), 1).astype(np.int64)
    at = np.repeat(np.arange(len(along)), pieces)
    share = (np.arange(len(at)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[at]
    fine = points[at] + share[:, None] * along[at]
    return Curve(fine if curve.closed else np.vstack([fine, points[-1:]]), curve.closed)


def _read_csv(data: bytes) -> list[Curve]:
    """Numbers in rows; an empty row ends a curve, a heading is skipped, one row alone is a point."""
    text = data.decode("utf-8-sig")
    separator = next((mark for mark in ",;\t" if mark in text), None)
    curves: list[list[list[float]]] = [[]]
    for number, line in enumerate(text.splitlines(), 1):
        words = [word.strip() for word in (line.split(separator) if separator else line.split())]
        if not any(words):
            curves.append([])
            continue
        try:
            curves[-1].append([float(word) for word in words if word])
        except ValueError:
            if number > 1:
                raise DrawingError(
                    f"Line {number} of the table is not made of numbers: {line[:60]}"
                ) from None
    return [_curve(points) for points in curves if points]


def _read_json(data: bytes) -> list[Curve]:
    """``{"points": […]}``, ``{"curves": [{"points": […], "closed": …}]}``, a list of points or of curves."""
    read = json.loads(data)
    if isinstance(read, dict) and "curves" in read:
        return [_curve(curve["points"], bool(curve.get("closed", False))) for curve in read["curves"]]
    points = read["points"] if isinstance(read, dict) else read
    if points and isinstance(points[0][0], list):
        return [_curve(curve) for curve in points]
    return [_curve([point]) for point in points]


def _read_dxf(data: bytes) -> list[Curve]:
    """Points, lines, polylines, arcs, circles, ellipses and splines of the model space."""
    from ezdxf.filemanagement import read
    from ezdxf.lldxf.const import DXFError
    from ezdxf.path import make_path

    try:
        document = read(io.StringIO(data.decode("utf-8", "replace")))
    except DXFError as error:
        raise DrawingError(f"The drawing is no DXF file: {error}.") from None
    space = document.modelspace()
    curves = [_curve([list(point.dxf.location.xyz)]) for point in space.query("POINT")]
    paths = [
        make_path(entity) for entity in space.query("LINE LWPOLYLINE POLYLINE ARC CIRCLE ELLIPSE SPLINE")
    ]
    corners = [np.array([v.xyz for v in path.control_vertices()]) for path in paths if len(path)]
    if not corners:
        return curves
    size = float(np.ptp(np.vstack(corners), axis=0).max())
    for path in paths:
        points = [list(v.xyz) for v in path.flattening(max(FLATNESS * size, 1e-12))]
        curves.append(_curve(points[:-1] if path.is_closed else points, path.is_closed))
    return curves


def _read_3dm(data: bytes) -> list[Curve]:
    """Points and curves."""
    model: Any = rhino3dm.File3dm.FromByteArray(data)
    if model is None:
        raise DrawingError("The drawing is no Rhino file, or it is cut short.")
    curves = []
    for item in model.Objects:
        geometry = item.Geometry
        if isinstance(geometry, rhino3dm.Point):
            curves.append(_curve([_xyz(geometry.Location)]))
        elif isinstance(geometry, rhino3dm.Curve):
            curves.append(rhino_curve(geometry))
    return curves


def rhino_curve(geometry: Any) -> Curve:
    """A curve of rhino3dm."""
    points = _curve_points(geometry)
    return _curve(points[:-1] if geometry.IsClosed else points, bool(geometry.IsClosed))


def _curve_points(curve: Any) -> list[list[float]]:
    if isinstance(curve, rhino3dm.PolylineCurve):
        return [_xyz(curve.Point(i)) for i in range(curve.PointCount)]
    if isinstance(curve, rhino3dm.LineCurve):
        return [_xyz(curve.PointAtStart), _xyz(curve.PointAtEnd)]
    domain = curve.Domain
    return [_xyz(curve.PointAt(t)) for t in np.linspace(domain.T0, domain.T1, SAMPLES + 1).tolist()]


def _xyz(point: Any) -> list[float]:
    return [point.X, point.Y, point.Z]


def _curve(points: list[Any], closed: bool = False) -> Curve:
    try:
        table = np.array(points, dtype=float)
    except (ValueError, TypeError):
        table = np.zeros(0)
    if table.ndim != 2 or table.shape[1] not in (2, 3):
        raise DrawingError("Every point of the drawing must be two or three numbers, as many in each curve.")
    return Curve(table, closed)


def _write_csv(curves: list[Curve]) -> bytes:
    """A heading, rows of numbers, an empty row between curves; closed ones return to their first point."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow("xyz"[: curves[0].points.shape[1]])
    for number, curve in enumerate(curves):
        if number:
            text.write("\r\n")
        writer.writerows(_drawn(curve).tolist())
    return text.getvalue().encode()


def _write_json(curves: list[Curve]) -> bytes:
    listed = [{"points": curve.points.tolist(), "closed": curve.closed} for curve in curves]
    return json.dumps({"curves": listed}).encode()


def _write_dxf(curves: list[Curve]) -> bytes:
    from ezdxf.filemanagement import new

    document = new("R2010")
    document.header["$INSUNITS"] = 0
    space = document.modelspace()
    for curve in curves:
        if len(curve.points) == 1:
            space.add_point(curve.points[0].tolist())
        else:
            space.add_polyline3d(curve.points.tolist(), close=curve.closed)
    return encode(document)


def _write_3dm(curves: list[Curve]) -> bytes:
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, "None")
    for curve in curves:
        points = [rhino3dm.Point3d(*p, *[0.0] * (3 - len(p))) for p in _drawn(curve).tolist()]
        if len(points) == 1:
            model.Objects.AddPoint(points[0])
        else:
            model.Objects.AddPolyline(rhino3dm.Point3dList(points), None)
    return base64.b64decode(model.Encode())


def _drawn(curve: Curve) -> Floats:
    return np.vstack([curve.points, curve.points[:1]]) if curve.closed else curve.points


READERS: dict[str, Callable[[bytes], list[Curve]]] = {
    ".csv": _read_csv, ".txt": _read_csv, ".json": _read_json, ".dxf": _read_dxf, ".3dm": _read_3dm,
}  # fmt: skip
WRITERS: dict[str, Callable[[list[Curve]], bytes]] = {
    ".csv": _write_csv, ".txt": _write_csv, ".json": _write_json, ".dxf": _write_dxf, ".3dm": _write_3dm,
}  # fmt: skip
