"""Documents → responses."""

from __future__ import annotations

from typing import Any

from starlette.responses import Response

from hexwrap_server.problems import MEDIA_TYPE, dumped, problem
from hexwrap_solver.errors import HexwrapError

JSON = "application/json"


def json_response(document: object, status: int = 200, headers: dict[str, str] | None = None) -> Response:
    """A small document."""
    return Response(dumped(document), status, headers, JSON)


def problem_response(error: HexwrapError | dict[str, Any]) -> Response:
    """A refusal, or the problem of a failed job."""
    document = error if isinstance(error, dict) else problem(error)
    headers = {"Cache-Control": "no-store"} | getattr(error, "headers", {})
    if document["status"] == 503:
        headers.setdefault("Retry-After", "5")
    return Response(dumped(document), document["status"], headers, MEDIA_TYPE)
