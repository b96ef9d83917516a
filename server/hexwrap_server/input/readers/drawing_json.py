"""Drawings in JSON."""

from __future__ import annotations

import json

from hexwrap_server.errors import DrawingError
from hexwrap_server.input.readers.drawing import Drawing, curve
from hexwrap_server.input.readers.text import as_utf8


def read_json(data: bytes) -> Drawing:
    """``{"points": […]}``, ``{"curves": [{"points": […], "closed": …}]}``, a list of points or of curves.

    Raises DrawingError.
    """
    try:
        read = json.loads(as_utf8(data))
    except ValueError as error:
        raise DrawingError(f"The drawing is not JSON: {error}.") from None
    if isinstance(read, dict) and isinstance(read.get("curves"), list):
        curves = read["curves"]
        if not all(isinstance(item, dict) and isinstance(item.get("points"), list) for item in curves):
            raise DrawingError("Every one of 'curves' must be an object with 'points'.")
        return Drawing([curve(item["points"], bool(item.get("closed", False))) for item in curves])
    points = read.get("points") if isinstance(read, dict) else read
    if not isinstance(points, list) or not all(isinstance(point, list) and point for point in points):
        raise DrawingError("The drawing must hold 'points', a list of points, or 'curves', a list of curves.")
    if points and isinstance(points[0][0], list):
        return Drawing([curve(item) for item in points])
    return Drawing([curve([point]) for point in points])
