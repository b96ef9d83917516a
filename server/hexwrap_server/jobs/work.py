"""What runs in a worker process. Nothing here knows HTTP; plain, picklable data in and out."""

from __future__ import annotations

import contextlib
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from hexwrap_server import logs
from hexwrap_server.input.json_text import loads
from hexwrap_server.input.requests import CacheSettings, Intake, Order, Outcome, SentSurface, Wanted
from hexwrap_server.input.schemas import parse_surface
from hexwrap_server.jobs import codec, later
from hexwrap_server.jobs.cache import CachingRunner, StageCache
from hexwrap_server.jobs.disk import read_whole, write_whole
from hexwrap_server.jobs.scribe import Scribe, There
from hexwrap_server.jobs.worker import Report
from hexwrap_server.jobs.writing import Here, Writer
from hexwrap_server.output.writers import WRITERS, Meta
from hexwrap_server.problems import FormError, body_is_the_surface
from hexwrap_solver import pipeline
from hexwrap_solver.arrays import Ragged
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.surface import SentMesh, surface_from_mesh, surface_from_nurbs, with_openings
from hexwrap_solver.surface.brep import mesh_brep
from hexwrap_solver.surface.types import Origin, Surface, SurfaceSettings

#: Of this worker process.
_SCRIBE = Scribe()
#: Finished solutions that a worker keeps for lift, flatten and files.
KEPT_SOLUTIONS = 4


def solve(report: Report, order: Order, caching: CacheSettings) -> Outcome:
    """The whole way, stage by stage, each looked up first. Raises HexwrapError, StorageError."""
    logs.at_work_for(order.job)
    with _writer() as writer:
        runner = CachingRunner(_stages(caching), report, writer.made)
        solution = _staged(order.surface_id, lambda: _sent(order), order.wanted, runner)
        writer.rest(solution, runner.timings)
        return _outcome(order, solution, writer, runner)


def _writer() -> Writer:
    """From the second job on, the scribe's: those who ask for one thing only do not wait for its start."""
    if _SCRIBE.is_ready:
        return There(_SCRIBE)
    later.put_off(_SCRIBE.start)
    return Here()


def _outcome(order: Order, solution: pipeline.Solution, writer: Writer, runner: CachingRunner) -> Outcome:
    content = codec.pieces(solution)
    if order.files:  # beside the writing of the last parts
        write_whole(Path(order.files[1]), content)
    written = writer.finish(order.files[0] if order.files else None)
    return Outcome(
        result=written.result,
        solution=None if order.files else b"".join(content),
        parts=written.parts,
        size=written.size + sum(map(len, content)),
        timings=runner.timings,
        found=runner.found,
    )


def _sent(order: Order) -> SentSurface:
    """Raises FormError where the surface is gone or damaged, and then it is forgotten."""
    data = order.surface
    if isinstance(data, str):
        data = read_whole(Path(data), codec.is_whole) or b""
    try:
        sent: SentSurface = codec.decode(data)
    except codec.CodecError:
        raise FormError.at("/surface/id", "the surface is no longer kept here; send it again") from None
    return sent


def run_stages(sent: SentSurface, wanted: Wanted, runner: CachingRunner) -> pipeline.Solution:
    """A sent surface and what is wanted of it → the solution. Raises HexwrapError."""
    return _staged(codec.digest(sent), lambda: sent, wanted, runner)


def _staged(
    surface_id: str, sent: Callable[[], SentSurface], wanted: Wanted, runner: CachingRunner
) -> pipeline.Solution:
    """sent: asked only where the checked surface is not remembered."""
    return pipeline.solve(
        lambda: take_in(sent(), wanted.surface), wanted, runner, source=(surface_id, wanted.surface)
    )


def take_in(sent: SentSurface, asked: SurfaceSettings | None = None) -> Surface:
    """asked: instead of the settings that were sent along. Raises SurfaceError."""
    settings = asked or sent.settings or SurfaceSettings()
    if sent.mesh is not None:
        surface = with_openings(surface_from_mesh(sent.mesh), settings.openings)
    elif sent.brep is not None:
        meshed = mesh_brep(sent.brep, settings.mesh)
        mesh = SentMesh(meshed.vertices, Ragged.from_table(meshed.faces), meshed.normals)
        surface = with_openings(surface_from_mesh(mesh), settings.openings)
    else:
        assert sent.nurbs is not None
        surface = surface_from_nurbs(sent.nurbs, settings.mesh)
    unit = settings.unit or sent.unit
    if (unit, sent.origin, sent.told) == (None, Origin(), ()):
        return surface
    repairs = (*sent.told, *surface.repairs)
    return replace(surface, unit=unit, origin=sent.origin, repairs=repairs).knowing(surface)


@body_is_the_surface()
def read_surface(report: Report, text: bytes, max_vertices: int, caching: CacheSettings) -> Intake:
    """JSON → checked surface. Raises FormError, SurfaceError."""
    return checked(report, parse_surface(loads(text), max_vertices), caching)


def checked(report: Report, sent: SentSurface, caching: CacheSettings) -> Intake:
    runner = CachingRunner(_stages(caching), report)
    id = codec.digest(sent)
    surface = runner("surface", (id, None), lambda progress: take_in(sent))
    loops = [surface.input_vertex[loop].tolist() for loop in surface.loops]
    answer = {
        "vertices": len(surface.vertices),
        "faces": len(surface.faces),
        "loops": loops,
        "repairs": list(surface.repairs),
        "unit": surface.unit,
        "objects": [],
    }
    return Intake(id, codec.encode(sent), answer)


def write_file(
    report: Report, path: str, name: str, title: str, timings: dict[str, float], options: dict[str, Any]
) -> bytes:
    """The finished work as a file. options: further fields of ``Meta``. Raises HexwrapError."""
    return WRITERS[name](solution_at(path), Meta(title or "hexwrap", timings, **options))


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
