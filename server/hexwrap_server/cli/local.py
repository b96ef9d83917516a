"""The pipeline without the server: an input of the command line → a checked request → a solution."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic

from hexwrap_server import samples
from hexwrap_server.cli.options import asked_body
from hexwrap_server.errors import UsageError
from hexwrap_server.input.json_text import loads
from hexwrap_server.input.readers.text import as_utf8
from hexwrap_server.input.requests import SentSurface, Wanted
from hexwrap_server.input.schemas import Asked, Request, parse_request
from hexwrap_server.input.surface_files import sent_surface
from hexwrap_server.jobs.cache import CachingRunner, StageCache
from hexwrap_server.jobs.work import run_stages
from hexwrap_server.jobs.worker import Report
from hexwrap_solver.pipeline import Solution
from hexwrap_solver.surface.types import SurfaceSettings

#: Only the user waits here, so only what exceeds any memory is refused.
MAX_VERTICES, MAX_PANELS = 20_000_000, 5_000_000
SAMPLE = "sample:"


@dataclass(frozen=True)
class Task(Generic[Asked]):
    """A request whose form has been checked."""

    name: str
    surface: SentSurface
    wanted: Asked


def read_body(given: str) -> tuple[dict[str, Any], bytes | None]:
    """The request body in a request file or sample, or the contents of any other file.

    given: a path or ``sample:NAME``. Raises UsageError, HexwrapError.
    """
    if given.startswith(SAMPLE):
        return sample_body(given.removeprefix(SAMPLE)), None
    path, data = Path(given), read_bytes(given)
    if path.suffix.lower() != ".json":
        return {"name": path.stem[:200]}, data
    body = loads(as_utf8(data))
    if not isinstance(body, dict):
        raise UsageError(f"{given} does not hold a JSON object: a request or a surface.")
    body = body if "surface" in body else {"surface": body}
    return {"name": path.stem[:200], **body}, None


def read_bytes(path: str) -> bytes:
    """Raises UsageError."""
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}.") from None


def sample_body(name: str) -> dict[str, Any]:
    """The request of a bundled sample. Raises UsageError."""
    if name not in samples.names():
        raise UsageError(f"unknown sample '{name}'; choose one of {', '.join(samples.names())}.")
    return samples.load(name)


def task(given: str, arguments: argparse.Namespace) -> Task[Wanted]:
    """What an input and the options ask for. Raises UsageError, HexwrapError."""
    return checked_task(
        given, lambda body: parse_request(asked_body(arguments, body), MAX_VERTICES, MAX_PANELS)
    )


def checked_task(given: str, parse: Callable[[dict[str, Any]], Request[Asked]]) -> Task[Asked]:
    """What parse makes of an input's body. Raises UsageError, HexwrapError."""
    body, data = read_body(given)
    if data is not None:
        body["surface"] = {"id": ""}  # stands for the file's surface while the rest is checked
    request = parse(body)
    sent = request.surface
    if data is not None:
        settings = request.wanted.surface or SurfaceSettings()
        sent = sent_surface(data, Path(given).name, settings, MAX_VERTICES).sent
    if not isinstance(sent, SentSurface):
        raise UsageError(f"{given} holds a surface id, which needs a server; give the surface itself.")
    return Task(request.name, sent, request.wanted)


def surface_settings(arguments: argparse.Namespace) -> SurfaceSettings:
    """What the options ask for as to the surface alone. Raises FormError."""
    body = asked_body(arguments, {"surface": {"id": ""}})
    return parse_request(body, MAX_VERTICES, MAX_PANELS).wanted.surface or SurfaceSettings()


def solve_here(asked: Task[Wanted], report: Report) -> tuple[Solution, dict[str, float]]:
    """The solution and seconds per stage. Raises HexwrapError."""
    runner = CachingRunner(StageCache(None, 0), report)
    return run_stages(asked.surface, asked.wanted, runner), runner.timings


def only_map(asked: Task[Wanted]) -> Task[Wanted]:
    """The same surface and boundary, without a pattern."""
    return replace(asked, wanted=replace(asked.wanted, pattern=None, panels=None))
