"""The lift and flatten routes' work: points between a finished job's surface and its unrolled domain."""

from __future__ import annotations

from hexwrap_server.input.json_text import loads
from hexwrap_server.input.schemas import parse_points
from hexwrap_server.jobs.work import solution_at
from hexwrap_server.jobs.worker import Report
from hexwrap_server.output import wire
from hexwrap_solver import domain


def lift(report: Report, path: str, text: bytes, most: int) -> bytes:
    """JSON answer of the lift route. path: of the solution; text: the body, of at most this many points.

    Raises FormError, GoneError.
    """
    at = parse_points(loads(text), 2, most)
    lifted = domain.lift(solution_at(path).map, at[:, 0] + 1j * at[:, 1])
    return wire.dump({"points": lifted.points, "normals": lifted.normals, "inside": lifted.inside})


def flatten(report: Report, path: str, text: bytes, most: int) -> bytes:
    """JSON answer of the flatten route. As ``lift``."""
    at = parse_points(loads(text), 3, most)
    flat = domain.flatten(solution_at(path).map, at)
    return wire.dump({"uv": wire.plane(flat.uv), "distance": flat.distance})
