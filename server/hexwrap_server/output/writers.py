"""Writers: a finished Solution as a file. One module per file; pictures share ``raster``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from hexwrap_server.input.requests import Wanted
from hexwrap_server.output.arrays_npz import result_npz
from hexwrap_server.output.cutting import cutting_list
from hexwrap_server.output.domain_dxf import domain_dxf
from hexwrap_server.output.domain_svg import domain_svg
from hexwrap_server.output.dxf import panels_dxf
from hexwrap_server.output.flat import flat_dxf
from hexwrap_server.output.glb import panels_glb
from hexwrap_server.output.ifc import panels_ifc
from hexwrap_server.output.meta import Meta, check_stages
from hexwrap_server.output.obj import panels_obj
from hexwrap_server.output.picture import panels_png
from hexwrap_server.output.rhino import panels_3dm
from hexwrap_server.output.table import panels_csv
from hexwrap_server.output.wire import result_json
from hexwrap_solver.pipeline import Solution

#: File name → writer; the names of the contract's ``/files/{name}``.
WRITERS: dict[str, Callable[[Solution, Meta], bytes]] = {
    "panels.obj": panels_obj,
    "panels.3dm": panels_3dm,
    "panels.dxf": panels_dxf,
    "panels.csv": panels_csv,
    "panels.ifc": panels_ifc,
    "panels.glb": panels_glb,
    "cutting-list.csv": cutting_list,
    "flat.dxf": flat_dxf,
    "domain.svg": domain_svg,
    "domain.dxf": domain_dxf,
    "panels.png": panels_png,
    "result.json": lambda solution, meta: result_json(solution, dict(meta.timings)),
    "result.npz": result_npz,
}

#: Files that do without panels.
WITHOUT_PANELS = {"domain.svg", "domain.dxf", "result.json", "result.npz"}


def write(name: str, solution: Solution, meta: Meta) -> bytes:
    """The file of that name. Raises KeyError for an unknown name, HexwrapError where it cannot be made."""
    return WRITERS[name](solution, replace(meta, unit=meta.unit or solution.map.surface.unit))


def check_wanted(name: str, wanted: Wanted) -> None:
    """Before the work, whether it will lead to that file. Raises NotMadeError."""
    if name not in WITHOUT_PANELS:
        check_stages(name, pattern=wanted.pattern is not None, panels=wanted.panels is not None)


__all__ = ["WRITERS", "Meta", "check_wanted", "write"]
