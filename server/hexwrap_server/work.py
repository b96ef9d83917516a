"""What runs in a worker process. Nothing here knows HTTP; plain, picklable data in and out."""

from __future__ import annotations

import contextlib
from collections import OrderedDict
from functools import cache
from pathlib import Path

from isal import igzip

from hexwrap_server import codec, wire
from hexwrap_server.answers import GZIP_LEVEL
from hexwrap_server.cache import CachingRunner, StageCache
from hexwrap_server.files import WRITERS, Meta
from hexwrap_server.parsing import loads
from hexwrap_server.parts import join_parts, places
from hexwrap_server.requests import CacheSettings, Intake, Outcome, SentSurface, Wanted
from hexwrap_server.schemas import parse_surface
from hexwrap_server.worker import Report
from hexwrap_solver import pipeline
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.surface import surface_from_mesh, surface_from_nurbs
from hexwrap_solver.surface.types import Surface

#: Finished solutions that a worker keeps for lift, flatten and files.
KEPT_SOLUTIONS = 4


def solve(report: Report, surface: bytes, wanted: Wanted, caching: CacheSettings) -> Outcome:
    """The whole way, stage by stage, each looked up first."""
    sent: SentSurface = codec.decode(surface)
    runner = CachingRunner(_stages(caching), report)
    solution = run_stages(sent, wanted, runner)
    parts = wire.parts_json(solution, runner.timings)
    text = join_parts(parts)
    return Outcome(
        result=igzip.compress(text, GZIP_LEVEL, mtime=0),
        parts=places(parts),
        size=len(text),
        solution=codec.encode(solution),
        timings=runner.timings,
        found=runner.found,
    )


def run_stages(sent: SentSurface, wanted: Wanted, runner: CachingRunner) -> pipeline.Solution:
    """A sent surface and what is wanted of it → the solution. Raises HexwrapError."""
    return pipeline.solve(
        lambda: take_in(sent),
        wanted.boundary,
        wanted.pattern,
        wanted.panels,
        runner,
        source=sent,
        with_support=wanted.support,
    )


def take_in(sent: SentSurface) -> Surface:
    """Raises SurfaceError."""
    if sent.mesh is not None:
        return surface_from_mesh(sent.mesh)
    assert sent.nurbs is not None
    return surface_from_nurbs(sent.nurbs, sent.meshing)


def read_surface(report: Report, text: bytes, max_vertices: int, caching: CacheSettings) -> Intake:
    """JSON → checked surface. Raises FormError, SurfaceError."""
    sent = parse_surface(loads(text), max_vertices, root="")
    assert isinstance(sent, SentSurface)
    return checked(report, sent, caching)


def checked(report: Report, sent: SentSurface, caching: CacheSettings) -> Intake:
    runner = CachingRunner(_stages(caching), report)
    surface = runner("surface", sent, lambda progress: take_in(sent))
    loops = [surface.input_vertex[loop].tolist() for loop in surface.loops]
    answer = {
        "vertices": len(surface.vertices),
        "faces": len(surface.faces),
        "loops": loops,
        "repairs": list(surface.repairs),
    }
    return Intake(codec.digest(sent), codec.encode(sent), answer)


def write_file(
    report: Report,
    path: str,
    name: str,
    title: str,
    timings: dict[str, float],
    sheet: tuple[float, float] | None,
) -> bytes:
    """The finished work as a file. Raises HexwrapError where it cannot be made."""
    return WRITERS[name](solution_at(path), Meta(name=title or "hexwrap", timings=timings, sheet=sheet))


@cache
def _stages(caching: CacheSettings) -> StageCache:
    return StageCache(Path(caching.folder) if caching.folder else None, caching.memory_bytes)


_SOLUTIONS: OrderedDict[str, pipeline.Solution] = OrderedDict()


def solution_at(path: str) -> pipeline.Solution:
    if path not in _SOLUTIONS:
        try:
            _SOLUTIONS[path] = codec.decode(Path(path).read_bytes())
        except (OSError, codec.CodecError):
            with contextlib.suppress(OSError):
                Path(path).unlink()  # so that the job is run again when it is sent again
            raise GoneError(
                "The work of this job is no longer kept on the server; send the job again."
            ) from None
        while len(_SOLUTIONS) > KEPT_SOLUTIONS:
            _SOLUTIONS.popitem(last=False)
    _SOLUTIONS.move_to_end(path)
    return _SOLUTIONS[path]


class GoneError(HexwrapError):
    slug = "gone"
    title = "The work is no longer kept"
