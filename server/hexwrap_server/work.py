"""What runs in a worker process. Nothing here knows HTTP; plain, picklable data in and out."""

from __future__ import annotations

import contextlib
from collections import OrderedDict
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

from hexwrap_server import codec, logs, wire
from hexwrap_server.cache import CachingRunner, StageCache
from hexwrap_server.disk import read_whole, write_whole
from hexwrap_server.files import WRITERS, Meta
from hexwrap_server.packing import Packer
from hexwrap_server.parsing import loads
from hexwrap_server.parts import PARTS
from hexwrap_server.problems import FormError, body_is_the_surface
from hexwrap_server.requests import CacheSettings, Intake, Order, Outcome, SentSurface, Wanted
from hexwrap_server.schemas import parse_surface
from hexwrap_server.worker import Report
from hexwrap_solver import pipeline
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.surface import surface_from_mesh, surface_from_nurbs
from hexwrap_solver.surface.types import Surface

#: Finished solutions that a worker keeps for lift, flatten and files.
KEPT_SOLUTIONS = 4


def solve(report: Report, order: Order, caching: CacheSettings) -> Outcome:
    """The whole way, stage by stage, each looked up first. Raises HexwrapError, StorageError."""
    logs.at_work_for(order.job)
    with Packer(wire.dump) as packer:
        runner = CachingRunner(_stages(caching), report, packing(packer))
        solution = _staged(order.surface_id, lambda: _sent(order), order.wanted, runner)
        pack_rest(packer, solution, runner.timings)
        return _outcome(order, solution, packer, runner)


def _outcome(order: Order, solution: pipeline.Solution, packer: Packer, runner: CachingRunner) -> Outcome:
    content = codec.pieces(solution)
    if order.files:  # beside the packing of the last parts
        write_whole(Path(order.files[1]), content)
    result = packer.finish()
    if order.files:
        write_whole(Path(order.files[0]), [result])
    return Outcome(
        result=None if order.files else result,
        solution=None if order.files else b"".join(content),
        parts=packer.places,
        size=len(result) + sum(map(len, content)),
        timings=runner.timings,
        found=runner.found,
    )


def packing(packer: Packer) -> Callable[[str, Any], None]:
    """A listener to stages that packs what is known by then."""
    known: dict[str, Any] = {}
    texts: dict[str, Callable[[], bytes]] = {}

    def made(stage: str, value: Any) -> None:
        known[stage] = value
        match stage:
            case "surface":  # written beside the map, whose long steps leave the interpreter to others
                texts["mesh"] = packer.foresee(partial(wire.mesh, value))
            case "map":
                if value.surface is known["surface"]:
                    packer.add_text("mesh", texts["mesh"])
                else:  # the map needed vertices of its own
                    packer.add("mesh", partial(wire.mesh, value.surface))
                packer.add("map", partial(wire.conformal, value))
            case "pattern":
                packer.add("pattern", partial(wire.pattern, value))
            case "panels":
                packer.begin("panels", partial(wire.shapes, value, known["pattern"]))

    return made


def pack_rest(packer: Packer, solution: pipeline.Solution, timings: dict[str, float]) -> None:
    """Pack what is known when all stages are done."""
    for name in PARTS:
        if name == "panels" and solution.panels is not None:  # begun when they were made
            packer.add(name, partial(wire.measures, solution))
        elif name not in packer:
            packer.add(name, partial(wire.part, solution, name, timings))


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
        lambda: take_in(sent()),
        wanted.boundary,
        wanted.pattern,
        wanted.panels,
        runner,
        source=surface_id,
        with_support=wanted.support,
    )


def take_in(sent: SentSurface) -> Surface:
    """Raises SurfaceError."""
    if sent.mesh is not None:
        return surface_from_mesh(sent.mesh)
    assert sent.nurbs is not None
    return surface_from_nurbs(sent.nurbs, sent.meshing)


@body_is_the_surface()
def read_surface(report: Report, text: bytes, max_vertices: int, caching: CacheSettings) -> Intake:
    """JSON → checked surface. Raises FormError, SurfaceError."""
    sent = parse_surface(loads(text), max_vertices, root="")
    assert isinstance(sent, SentSurface)
    return checked(report, sent, caching)


def checked(report: Report, sent: SentSurface, caching: CacheSettings) -> Intake:
    runner = CachingRunner(_stages(caching), report)
    id = codec.digest(sent)
    surface = runner("surface", id, lambda progress: take_in(sent))
    loops = [surface.input_vertex[loop].tolist() for loop in surface.loops]
    answer = {
        "vertices": len(surface.vertices),
        "faces": len(surface.faces),
        "loops": loops,
        "repairs": list(surface.repairs),
    }
    return Intake(id, codec.encode(sent), answer)


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
