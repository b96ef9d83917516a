"""``result.json``: the contract's Result, as the service answers it."""

from __future__ import annotations

from hexwrap_server.output import wire
from hexwrap_server.output.meta import Meta
from hexwrap_solver.pipeline import Solution


def result_json(solution: Solution, meta: Meta) -> bytes:
    """All parts of the Result, UTF-8."""
    return wire.result_json(solution, dict(meta.timings))
