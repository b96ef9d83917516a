"""The lift and flatten routes' work: points between a finished job's surface and its unrolled domain."""

from __future__ import annotations

from hexwrap_server.input.bodies import Body
from hexwrap_server.input.json_text import loads
from hexwrap_server.input.schemas import parse_points
from hexwrap_server.jobs.work import solution_at
from hexwrap_server.jobs.worker import Report
from hexwrap_server.output import wire
from hexwrap_server.settings import Settings
from hexwrap_solver import domain


def lift(report: Report, body: Body, settings: Settings, path: str) -> bytes:
    """JSON answer of the lift route. path: of the solution.

    Raises FormError, HttpError, GoneError.
    """
    at = parse_points(loads(body.plain(settings.max_body_mib)), 2, settings.max_points)
    lifted = domain.lift(solution_at(path).map, at[:, 0] + 1j * at[:, 1])
    return wire.dump({"points": lifted.points, "normals": lifted.normals, "inside": lifted.inside})


def flatten(report: Report, body: Body, settings: Settings, path: str) -> bytes:
    """JSON answer of the flatten route. As ``lift``."""
    at = parse_points(loads(body.plain(settings.max_body_mib)), 3, settings.max_points)
    flat = domain.flatten(solution_at(path).map, at)
    return wire.dump({"uv": flat.uv, "distance": flat.distance})
