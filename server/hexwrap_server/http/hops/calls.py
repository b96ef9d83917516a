"""What the Hops components do: their calls → requests, solutions → their outputs.

Runs in a worker process: reading and writing Rhino's geometry takes the interpreter for itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hexwrap_server.errors import HopsError
from hexwrap_server.http.hops.components import COMPONENTS, LIFT, PANELS
from hexwrap_server.http.hops.values import output, read_inputs
from hexwrap_server.input.bodies import Body
from hexwrap_server.input.choose import choose
from hexwrap_server.input.json_text import loads
from hexwrap_server.input.readers.drawing import Curve
from hexwrap_server.input.readers.found import FileContent
from hexwrap_server.input.readers.rhino import UNITS, found_alone
from hexwrap_server.input.readers.rhino_curves import rhino_curve
from hexwrap_server.input.requests import ParsedRequest, SentSurface, Wanted
from hexwrap_server.input.schemas import Request, parse_request
from hexwrap_server.input.surface_files import as_sent
from hexwrap_server.jobs.lift_curves import lift_curves
from hexwrap_server.jobs.reading import kept
from hexwrap_server.jobs.work import solution_at
from hexwrap_server.jobs.worker import Report
from hexwrap_server.output import wire
from hexwrap_server.output.blocks import frames
from hexwrap_server.output.unrolled import cells, in_pieces
from hexwrap_server.settings import Settings
from hexwrap_solver.pipeline import Solution
from hexwrap_solver.surface.types import SentMesh, SurfaceSettings


@dataclass(frozen=True)
class Call:
    """A call that was read. branch: where in the tree its geometry came from.

    request: for PANELS; job and curves: for LIFT.
    """

    pointer: str
    branch: tuple[int, ...]
    request: ParsedRequest | None = None
    job: str = ""
    curves: tuple[Curve, ...] = ()


def read_call(report: Report, body: Body, settings: Settings, folder: str) -> Call:
    """The body of POST /solve. Raises HopsError, FormError, UnreadableFileError."""
    sent = loads(body.plain(settings.max_body_mib))
    pointer = sent.get("pointer") if isinstance(sent, dict) else None
    if not isinstance(sent, dict) or not isinstance(pointer, str):
        raise HopsError("The body must be an object with 'pointer' and 'values'.")
    pointer = "/" + pointer.split("//")[-1].partition("/")[2] if "//" in pointer else pointer
    if pointer not in COMPONENTS:
        raise HopsError(f"No component is at '{pointer[:100]}'; choose one of {', '.join(COMPONENTS)}.")
    values, branch = read_inputs(COMPONENTS[pointer].inputs, sent.get("values"))
    if pointer == LIFT:
        curves = tuple(rhino_curve(curve) for curve in values["Curves"])
        return Call(pointer, tuple(branch), job=values["Job"].strip().rpartition("/")[2], curves=curves)
    wanted = _wanted(values, settings.max_vertices, settings.max_panels)
    surface = _surface(values["Mesh"], sent, settings.max_vertices)
    return Call(pointer, tuple(branch), kept(Request("hops", surface, wanted), folder))


def _wanted(values: dict[str, Any], max_vertices: int, max_panels: int) -> Wanted:
    points, angles = values["Points"], values["Angles"]
    boundary: dict[str, Any] = {"mode": values["Mode"] or ("angles" if points else "auto")}
    if boundary["mode"] == "angles":
        angles = angles * len(points) if len(angles) == 1 else angles
        if len(angles) != len(points):
            raise HopsError(f"{len(points)} points and {len(angles)} angles: give one angle per point.")
        corners = [{"point": p, "angle": a} for p, a in zip(points, angles, strict=True)]
        boundary |= {"angle_unit": "deg", "angles": corners}
    body = {
        "surface": {"id": "", "unit": values["Unit"] or None},
        "boundary": boundary,
        "pattern": {"kind": values["Kind"], "around": values["Around"] or None},
        "panels": {"sizes": values["Sizes"] or None, "target": values["Target"]},
    }
    return parse_request(body, max_vertices, max_panels).wanted


def _surface(geometry: Any, sent: dict[str, Any], max_vertices: int) -> SentSurface:
    """What is meant of a geometry; strays are left out as those of a file are. sent: Hops tells the unit and
    the tolerance of the document. Raises SurfaceError."""
    asked = sent.get("absolutetolerance")
    tolerance = float(asked) if isinstance(asked, int | float) and 0 < asked < 1e9 else None
    found = found_alone(geometry, tolerance or 0.0)
    content = FileContent((found,), UNITS.get(str(sent.get("modelunits"))), tolerance)
    chosen = choose(content)
    if isinstance(chosen.geometry, SentMesh) and len(chosen.geometry.vertices) > max_vertices:
        n = len(chosen.geometry.vertices)
        raise HopsError(f"The mesh has {n} vertices, this server takes {max_vertices}.")
    return as_sent(content, chosen, SurfaceSettings(), max_vertices)


def panels_answer(report: Report, path: str, call: Call, job: str) -> dict[str, Any]:
    """The outputs of PANELS for the solution at path."""
    solution = solution_at(path)
    made, laid = solution.panels, solution.pattern
    assert made is not None
    assert laid is not None
    order = np.lexsort((laid.place[made.face], laid.ring[made.face]))
    rings = laid.ring[made.face][order].tolist()
    labels = laid.labels()
    polygons = made.polygons.to_lists()
    flat = _flat_cells(solution)
    per_panel = {
        "Panels": [_closed(polygons[k]) for k in order],
        "Labels": [labels[made.face[k]] for k in order],
        "Size": [int(made.size[k]) for k in order],
        "Planes": np.concatenate([made.center[:, None], frames(made)], axis=1)[order].tolist(),
        "Flat": [flat[made.face[k]] for k in order],
    }
    whole = {"Report": [_report(solution)], "Job": [job]}
    outputs = []
    for parameter in COMPONENTS[PANELS].outputs:
        branches: dict[tuple[int, ...], list[Any]] = {}
        if parameter.name in whole:
            branches[call.branch] = whole[parameter.name]
        else:
            for ring, value in zip(rings, per_panel[parameter.name], strict=True):
                branches.setdefault((*call.branch, ring), []).append(value)
        outputs.append(output(parameter, branches))
    return _answer(outputs)


def lift_answer(report: Report, path: str, call: Call, job: str) -> dict[str, Any]:
    """The outputs of LIFT for the solution at path."""
    cmap = solution_at(path).map
    branches: dict[tuple[int, ...], list[Any]] = {}
    outside = 0
    for number, curve in enumerate(call.curves):
        carried = lift_curves(cmap, [curve], None)
        outside += carried.outside
        pieces = [_closed(c.points.tolist()) if c.closed else c.points.tolist() for c in carried.curves]
        branches[*call.branch, number] = [piece for piece in pieces if len(piece) > 1]
    lifted, count = COMPONENTS[LIFT].outputs
    return _answer([output(lifted, branches), output(count, {call.branch: [outside]})])


def _answer(values: list[dict[str, Any]]) -> dict[str, Any]:
    return {"values": values, "errors": [], "warnings": []}


def _flat_cells(solution: Solution) -> list[list[list[float]]]:
    """Closed outlines of the cells in the unrolled domain, each in one piece, at z = 0."""
    laid = in_pieces(solution).pattern
    assert laid is not None
    return [[[x, y, 0.0] for x, y in _closed(outline)] for outline in cells(laid).to_lists()]


def _closed(points: list[Any]) -> list[Any]:
    return [*points, points[0]]


def _report(solution: Solution) -> str:
    quality = wire.quality(solution)
    assert solution.panels is not None
    lines = [
        f"{solution.panels.n_panels} panels, {len(solution.panels.class_length)} sizes",
        f"covered: {100 * quality['coverage']:.2f} %",
        f"overlaps: {quality['overlaps']}",
        *(f"note: {note}" for note in (*solution.map.surface.repairs, *quality["notes"])),
    ]
    return "\n".join(lines)
