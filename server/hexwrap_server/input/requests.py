"""What goes to a worker, after everything about its form has been checked, and what comes back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

from hexwrap_solver.pipeline import SolveSettings
from hexwrap_solver.setting import Setting
from hexwrap_solver.surface.types import NurbsSurface, SentMesh, SurfaceSettings


@dataclass(frozen=True)
class SentSurface:
    """A surface as it was sent: a mesh or a NURBS surface.

    settings: how to take it in, for requests that say nothing of that beside its id.
    """

    mesh: SentMesh | None = None
    nurbs: NurbsSurface | None = None
    settings: SurfaceSettings | None = None


@dataclass(frozen=True)
class Wanted(SolveSettings):
    """What is to be done with a surface; identical for identical work."""

    surface: Annotated[
        SurfaceSettings | None, Setting("how the surface is taken in; null: as it was sent", rare=True)
    ] = None


@dataclass(frozen=True)
class ParsedRequest:
    """A request that was read from JSON. surface: encoded, None where an id was given."""

    name: str
    surface_id: str
    surface: bytes | None
    wanted: Wanted


@dataclass(frozen=True)
class CacheSettings:
    """folder: where stages are kept on the worker's machine, or none. memory_bytes: in the worker itself."""

    folder: str
    memory_bytes: int


@dataclass(frozen=True)
class Order:
    """A job for a worker. surface: as sent, encoded, or the file where it is.

    files: where the result and the solution are to be put; None: they are sent back. job: one of those that
    want it, for log lines.
    """

    surface_id: str
    surface: bytes | str
    wanted: Wanted
    files: tuple[str, str] | None
    job: str = ""


@dataclass(frozen=True)
class Outcome:
    """A finished job. result: the Result, gzip; solution: for lift, flatten and files; None: put into files.

    parts: where each part of the Result stands in the unpacked text. size: bytes of both.
    found: per stage ``memory``, ``disk`` or ``computed``.
    """

    result: bytes | None
    solution: bytes | None
    parts: dict[str, tuple[int, int]]
    size: int
    timings: dict[str, float]
    found: dict[str, str]


@dataclass(frozen=True)
class Intake:
    """A surface that was checked: what POST /v1/surfaces answers, and what is kept."""

    id: str
    surface: bytes
    answer: dict[str, Any] = field(default_factory=dict)
