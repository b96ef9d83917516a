"""What goes to a worker, after everything about its form has been checked, and what comes back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

from hexwrap_solver.explore.types import ExploreSettings
from hexwrap_solver.pipeline import SolveSettings
from hexwrap_solver.setting import Setting
from hexwrap_solver.surface.brep import Brep
from hexwrap_solver.surface.types import NurbsSurface, Origin, SentMesh, SurfaceSettings


@dataclass(frozen=True)
class SentSurface:
    """A surface as it was sent: a mesh, a NURBS surface or a Brep.

    settings: how to take it in, for requests that say nothing of that beside its id. unit, origin: of
    the file it is from. notes: what was found and done when that was read, a sentence each.
    """

    mesh: SentMesh | None = None
    nurbs: NurbsSurface | None = None
    settings: SurfaceSettings | None = None
    brep: Brep | None = None
    unit: str | None = None
    origin: Origin = field(default_factory=Origin)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Wanted(SolveSettings):
    """What is to be done with a surface; identical for identical work."""

    surface: Annotated[
        SurfaceSettings | None, Setting("how the surface is taken in; null: as it was sent", rare=True)
    ] = None


@dataclass(frozen=True)
class Exploration(ExploreSettings):
    """Which choices for a surface are to be explored. max_panels, max_vertices: of each of them."""

    surface: Annotated[
        SurfaceSettings | None, Setting("how the surface is taken in; null: as it was sent", rare=True)
    ] = None
    max_panels: Annotated[int, Setting("most panels of a variant", limit=True)] = 1_000_000
    max_vertices: Annotated[int, Setting("most vertices of its mesh", limit=True)] = 1_000_000


@dataclass(frozen=True)
class ParsedRequest:
    """A request that was read; its surface is kept under that id."""

    name: str
    surface_id: str
    wanted: Wanted | Exploration


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
    wanted: Wanted | Exploration
    files: tuple[str, str] | None
    job: str = ""


@dataclass(frozen=True)
class Outcome:
    """A finished job. result: the Result, gzip; solution: for lift, flatten and files; None: put into files.

    size: bytes of both. found: per stage ``memory``, ``disk`` or ``computed``.
    """

    result: bytes | None
    solution: bytes | None
    size: int
    timings: dict[str, float] = field(default_factory=dict)
    found: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Intake:
    """A surface that was checked and kept, and what POST /v1/surfaces answers besides its id."""

    id: str
    answer: dict[str, Any] = field(default_factory=dict)
