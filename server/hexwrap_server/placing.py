"""The lift and flatten routes' work: points between a finished job's surface and its unrolled domain."""

from __future__ import annotations

from hexwrap_server import codec, wire
from hexwrap_server.work import solution_at
from hexwrap_server.worker import Report
from hexwrap_solver import domain


def lift(report: Report, path: str, points: bytes) -> bytes:
    """JSON answer of the lift route. path: of the solution; points: (k, 2), encoded."""
    at = codec.decode(points)
    lifted = domain.lift(solution_at(path).map, at[:, 0] + 1j * at[:, 1])
    return wire.dump({"points": lifted.points, "normals": lifted.normals, "inside": lifted.inside})


def flatten(report: Report, path: str, points: bytes) -> bytes:
    """JSON answer of the flatten route. points: (k, 3), encoded."""
    flat = domain.flatten(solution_at(path).map, codec.decode(points))
    return wire.dump({"uv": wire.plane(flat.uv), "distance": flat.distance})
