"""What runs in a worker process. Nothing here knows HTTP; plain, picklable data in and out."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import replace
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from isal import igzip

from hexwrap_server import logs
from hexwrap_server.errors import CodecError, FormError, GoneError, StorageError
from hexwrap_server.input.choose import slits
from hexwrap_server.input.parts import size_of
from hexwrap_server.input.requests import CacheSettings, Order, Outcome, SentSurface, Wanted
from hexwrap_server.jobs import codec
from hexwrap_server.jobs.cache import CachingRunner, StageCache
from hexwrap_server.jobs.disk import read_whole, write_whole
from hexwrap_server.jobs.worker import AFTERWARDS, Report
from hexwrap_server.output import wire
from hexwrap_server.output.packed import LEVEL, Packed, Pieces, document, packed_part
from hexwrap_server.output.unrolled import moved_to, pieces_of_net
from hexwrap_server.output.writers import Meta, write
from hexwrap_solver import pipeline
from hexwrap_solver.surface import surface_from_mesh, with_openings
from hexwrap_solver.surface.brep import surface_from_brep, surface_from_patch
from hexwrap_solver.surface.drawn import with_lines
from hexwrap_solver.surface.types import Origin, Surface, SurfaceSettings

#: Finished solutions that a worker keeps for lift, flatten and files.
KEPT_SOLUTIONS = 4
#: The stages on which parts of the Result depend that are often the same as before, the last of each that
#: was run.
DEPENDS = {"mesh": ("map",), "map": ("map",), "pattern": ("pattern",)}


def solve(report: Report, order: Order, caching: CacheSettings) -> Outcome:
    """The whole way, stage by stage, each looked up first. Raises HexwrapError, StorageError."""
    logs.at_work_for(order.job)
    cache = stages(caching)
    runner = CachingRunner(cache, report)
    assert isinstance(order.wanted, Wanted)
    solution = _staged(order.surface_id, lambda: sent_surface_of(order), order.wanted, runner)
    kept = codec.pieces(solution)
    result = packed_result(solution, runner)
    cache.weigh()
    return replace(outcome_of(order, result, kept), timings=runner.timings, found=runner.found)


def outcome_of(order: Order, result: Pieces, kept: Pieces) -> Outcome:
    """What is sent back, or put into the files of the order. result, kept: pieces of the Result and of the
    solution. Raises StorageError."""
    size = sum(map(len, [*result, *kept]))
    if order.files is None:
        return Outcome(b"".join(result), b"".join(kept), size)
    write_whole(Path(order.files[0]), result)
    write_whole(Path(order.files[1]), kept)
    return Outcome(None, None, size)


def packed_result(solution: pipeline.Solution, runner: CachingRunner) -> Pieces:
    """The whole Result, see ``output.packed``. Only what may be used again is worth compressing."""

    pieces = runner.remembered("pieces", ("map",), lambda: pieces_of_net(solution.map))
    solution, panels = moved_to(pieces, solution), solution.panels

    def made(name: str) -> Packed:
        if name == "panels" and panels is not None:
            lies = f"panels {codec.digest(panels.limit, panels.center)}"
            end = Packed.stored(b"," + wire.dump(wire.sized(solution))[1:])
            return Packed.joined([runner.remembered(lies, ("fit",), placed), end])
        return packed_part(name, wire.dump(wire.part(solution, name, runner.timings)))

    def placed() -> Packed:
        return packed_part("panels", wire.dump(wire.placed(solution))[:-1])

    depends: dict[str, tuple[str, ...]] = dict(DEPENDS)
    if runner.remembered("overlaps itself", ("map",), lambda: wire.drawn_apart(solution) is not None):
        depends["map"] = ("map", "pattern")  # where its cells are drawn
    return document(
        {name: runner.remembered(name, depends.get(name, ()), partial(made, name)) for name in wire.PARTS}
    )


def sent_surface_of(order: Order) -> SentSurface:
    """Raises FormError where the surface is gone or damaged, and then it is forgotten."""
    data = order.surface
    if isinstance(data, str):
        data = read_whole(Path(data), codec.is_whole) or b""
    try:
        sent: SentSurface = codec.decode(data)
    except CodecError:
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
        surface = surface_from_mesh(sent.mesh, settings)
    elif sent.brep is not None:
        surface = surface_from_brep(sent.brep, settings)
    else:
        assert sent.nurbs is not None
        surface = surface_from_patch(sent.nurbs, settings, sent.origin.tolerance)
    if settings.features is not None:
        surface = with_lines(surface, settings.features.lines)
    surface = with_openings(surface, settings.openings)
    unit, notes = settings.unit or sent.unit, sent.notes
    if sent.mesh is not None and (sent.origin, notes) == (Origin(), ()):  # no reader has looked
        loops = [surface.vertices[np.stack([loop, np.roll(loop, -1)], axis=1)] for loop in surface.loops]
        notes = tuple(slits(np.concatenate([np.zeros((0, 2, 3)), *loops]), size_of(surface.vertices), None))
    if (unit, sent.origin, notes) == (None, Origin(), ()):
        return surface
    repairs = (*notes, *surface.repairs)
    return replace(surface, unit=unit, origin=sent.origin, repairs=repairs).knowing(surface)


def result_parts(report: Report, path: str, names: list[str], timings: dict[str, float]) -> bytes:
    """Some parts of the Result, gzip. Raises GoneError."""
    return igzip.compress(wire.result_json(solution_at(path), timings, names), LEVEL)


def write_file(
    report: Report, path: str, name: str, title: str, timings: dict[str, float], options: dict[str, Any]
) -> bytes:
    """The finished work as a file. options: further fields of ``Meta``. Raises HexwrapError."""
    return write(name, solution_at(path), Meta(title or "hexwrap", timings, **options))


@cache
def stages(caching: CacheSettings) -> StageCache:
    """The cache of this process."""
    folder = Path(caching.folder) if caching.folder else None
    return StageCache(folder, caching.memory_bytes, AFTERWARDS.append)


@lru_cache(KEPT_SOLUTIONS)
def solution_at(path: str) -> pipeline.Solution:
    """A finished solution. Raises GoneError, StorageError."""
    try:
        solution: pipeline.Solution = codec.decode(Path(path).read_bytes())
    except (FileNotFoundError, CodecError):
        with contextlib.suppress(OSError):
            Path(path).unlink()  # so that the job is run again when it is sent again
        raise GoneError from None
    except OSError as error:
        raise StorageError.of(error) from error
    return solution
