"""How a worker comes from stages to the text of their Result, part by part while later ones are computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

from hexwrap_server.jobs.disk import write_whole
from hexwrap_server.jobs.packing import Packer
from hexwrap_server.jobs.parts import PARTS, Places
from hexwrap_server.output import wire
from hexwrap_solver.pipeline import Solution


@dataclass(frozen=True)
class Written:
    """A Result, gzip. result: None where it was put into a file. size: its bytes. parts: where each part
    stands in the unpacked text."""

    result: bytes | None
    size: int
    parts: Places


class Writer(Protocol):
    """Writes one Result. To be left (``with``) in any case."""

    def __enter__(self) -> Writer: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def made(self, stage: str, value: Any) -> None:
        """To be told of every stage."""
        ...

    def rest(self, solution: Solution, timings: dict[str, float]) -> None:
        """To be told when all stages are done."""
        ...

    def finish(self, path: str | None) -> Written:
        """After ``rest``; path: the file for the result. Raises StorageError."""
        ...


class Here:
    """In a thread of this process."""

    def __init__(self) -> None:
        self._packer = Packer(wire.dump)
        self.made = packing(self._packer)

    def __enter__(self) -> Here:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._packer.__exit__(kind, error, trace)

    def rest(self, solution: Solution, timings: dict[str, float]) -> None:
        pack_rest(self._packer, solution, timings)

    def finish(self, path: str | None) -> Written:
        result = self._packer.finish()
        if path is not None:
            write_whole(Path(path), [result])
        return Written(None if path else result, len(result), self._packer.places)


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


def pack_rest(packer: Packer, solution: Solution, timings: dict[str, float]) -> None:
    """Pack what is known when all stages are done."""
    for name in PARTS:
        if packer.has_begun(name):  # the panels, when they were made
            packer.add(name, partial(wire.measures, solution))
        elif name not in packer:
            packer.add(name, partial(wire.part, solution, name, timings))
