"""Bodies of requests → settings of the solver. Every fault of form is found here and pointed at.

Large arrays never pass through pydantic: ``arrays`` checks them whole. All else is checked by ``form``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, Generic, TypeVar

import numpy as np

from hexwrap_server.errors import FormError
from hexwrap_server.input.arrays import faces, numbers, table
from hexwrap_server.input.faults import escaped
from hexwrap_server.input.form import Body, ExploreBody, read, values
from hexwrap_server.input.requests import Exploration, SentSurface, Wanted
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.setting import Setting
from hexwrap_solver.surface.nurbs_checks import HIGHEST_DEGREE
from hexwrap_solver.surface.types import MeshSettings, NurbsSurface, SentMesh, SurfaceSettings


@dataclass(frozen=True)
class NurbsForm:
    """The part of a NURBS surface besides its large arrays."""

    degree: Annotated[tuple[int, int], Setting("degrees in u and v", ge=1, le=HIGHEST_DEGREE)]
    closed: Annotated[tuple[bool, bool], Setting("whether it closes up in u and in v")] = (False, False)


Asked = TypeVar("Asked", Wanted, Exploration)


@dataclass(frozen=True)
class Request(Generic[Asked]):
    """surface: as sent, or the id of one that was sent before."""

    name: str
    surface: SentSurface | str
    wanted: Asked


def parse_request(body: object, max_vertices: int, max_panels: int) -> Request[Wanted]:
    """Raises FormError with a JSON pointer for each fault."""
    request = _parsed(Body, Wanted, body, max_vertices, max_panels)
    surface, boundary = request.surface, request.wanted.boundary
    if isinstance(surface, SentSurface) and surface.mesh is not None:
        _vertices_exist(boundary.adapted(None), len(surface.mesh.vertices))
    return request


def parse_exploration(body: object, max_vertices: int, max_panels: int) -> Request[Exploration]:
    """The body of ``POST /v1/explore``. Raises FormError with a JSON pointer for each fault."""
    request = _parsed(ExploreBody, Exploration, body, max_vertices, max_panels)
    limited = replace(request.wanted, max_panels=max_panels, max_vertices=max_vertices)
    return replace(request, wanted=limited)


def _parsed(
    form: type[Body | ExploreBody], kind: type[Asked], body: object, max_vertices: int, max_panels: int
) -> Request[Asked]:
    opened, arrays, beside = _opened(body)
    asked = read(form, opened | {"surface": beside or None})
    surface = _id(arrays["id"]) if "id" in arrays else _sent(arrays, max_vertices, "/surface")
    wanted = kind(**{f.name: getattr(asked, f.name) for f in fields(kind)})
    if wanted.surface is not None or "nurbs" in arrays:
        wanted = replace(wanted, surface=_limited(wanted.surface or SurfaceSettings(), max_vertices))
    if wanted.pattern is not None:
        wanted = replace(wanted, pattern=replace(wanted.pattern, max_cells=max_panels))
    return Request(asked.name, surface, wanted)


def _opened(body: object) -> tuple[dict[str, Any], dict[str, Any], dict[str, object]]:
    """The body, and its surface divided. Raises FormError."""
    if not isinstance(body, dict):
        raise FormError.at("", 'must be a JSON object such as {"surface": …}')
    if "surface" not in body:
        raise FormError.at("/surface", "'surface' is missing; it is the one field without a default")
    return body, *_divided(body["surface"], "/surface", allow_id=True)


def parse_surface(surface: object, max_vertices: int) -> SentSurface:
    """A body that is a surface: a mesh or a NURBS surface, and how to take it in. Raises FormError."""
    arrays, beside = _divided(surface, "")
    settings = read(SurfaceSettings, beside)
    sent = _sent(arrays, max_vertices, "")
    if sent.nurbs is not None or beside:
        sent = replace(sent, settings=_limited(settings, max_vertices))
    return sent


def parse_points(body: object, dimension: int, most: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(n, dimension) of a lift or flatten request. Raises FormError."""
    if not isinstance(body, dict):
        raise FormError.at("", 'must be a JSON object such as {"points": …}')
    _known(body, ("points",), "")
    if "points" not in body:
        raise FormError.at("/points", "'points' is missing")
    return table(body["points"], "/points", dimension, most)


def _divided(
    surface: object, root: str, *, allow_id: bool = False
) -> tuple[dict[str, Any], dict[str, object]]:
    """The arrays of a surface, or its id, and what is said beside them. Raises FormError."""
    if not isinstance(surface, dict):
        raise FormError.at(root, "must be an object with 'vertices' and 'faces', or 'nurbs', or 'id'")
    arrays: tuple[str, ...] = ("vertices", "faces", "normals")
    settings = [f.name for f in fields(SurfaceSettings) if f.name != "mesh"]
    if "nurbs" in surface or (allow_id and "id" in surface):
        arrays, settings = ("nurbs",) if "nurbs" in surface else ("id",), [*settings, "mesh"]
    _known(surface, (*arrays, *settings), root)
    return tuple({k: v for k, v in surface.items() if k in names} for names in (arrays, settings))  # type: ignore[return-value]


def _limited(settings: SurfaceSettings, max_vertices: int) -> SurfaceSettings:
    return replace(settings, mesh=replace(settings.mesh or MeshSettings(), max_vertices=max_vertices))


def _id(given: object) -> str:
    if not isinstance(given, str):
        raise FormError.at("/surface/id", "must be the id that POST /v1/surfaces answered")
    return given


def _sent(arrays: dict[str, Any], max_vertices: int, root: str) -> SentSurface:
    if "nurbs" in arrays:
        return SentSurface(nurbs=_nurbs(arrays["nurbs"], f"{root}/nurbs"))
    for name in ("vertices", "faces"):
        if name not in arrays:
            raise FormError.at(f"{root}/{name}", f"'{name}' is missing")
    return SentSurface(mesh=_mesh(arrays, max_vertices, root))


def _mesh(surface: dict[str, Any], max_vertices: int, root: str) -> SentMesh:
    vertices = table(surface["vertices"], f"{root}/vertices", 3, max_vertices)
    corners = faces(surface["faces"], f"{root}/faces", len(vertices), 4 * max_vertices)
    normals = surface.get("normals")
    if normals is None:
        return SentMesh(vertices, corners)
    directions = table(normals, f"{root}/normals", 3, max_vertices)
    if len(directions) != len(vertices):
        detail = f"{len(directions)} normals for {len(vertices)} vertices; send one per vertex"
        raise FormError.at(f"{root}/normals", detail)
    return SentMesh(vertices, corners, directions)


def _nurbs(nurbs: object, root: str) -> NurbsSurface:
    if not isinstance(nurbs, dict):
        raise FormError.at(root, "must be an object with 'degree', 'knots' and 'control_points'")
    large = ("knots", "control_points")
    form = read(NurbsForm, {k: v for k, v in nurbs.items() if k not in large}, root)
    for name in large:
        if not isinstance(nurbs.get(name), list):
            raise FormError.at(f"{root}/{name}", f"'{name}' must be a list")
    knots, net = nurbs["knots"], nurbs["control_points"]
    if len(knots) != 2:
        detail = f"must be two lists of numbers, one per direction, not {len(knots)}"
        raise FormError.at(f"{root}/knots", detail)
    u, v = (numbers(row, f"{root}/knots/{i}", 10_000) for i, row in enumerate(knots))
    return NurbsSurface(form.degree, (u, v), _net(net, f"{root}/control_points"), form.closed)


def _net(rows: list[Any], root: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    if not rows or not isinstance(rows[0], list) or not rows[0] or not isinstance(rows[0][0], list):
        raise FormError.at(root, "must be rows of points [x, y, z] or [x, y, z, weight]")
    width = 4 if len(rows[0][0]) == 4 else 3
    lines = [table(row, f"{root}/{i}", width, 100_000) for i, row in enumerate(rows)]
    for i, line in enumerate(lines):
        if len(line) != len(lines[0]):
            raise FormError.at(f"{root}/{i}", f"has {len(line)} points, the first row {len(lines[0])}")
    net = np.stack(lines)
    return net if width == 4 else np.concatenate([net, np.ones((*net.shape[:2], 1))], axis=2)


def _vertices_exist(boundary: BoundaryCondition, n: int) -> None:
    """Raises FormError where a boundary condition names a vertex that was not sent."""
    for place, setting, value in values(boundary, ("boundary",)):
        if setting.unit == "vertex" and value is not None and value >= n:
            raise FormError.at(place, f"vertex {value} of a mesh of {n} vertices (0 to {n - 1})")


def _known(given: dict[str, object], names: Sequence[str], root: str) -> None:
    unknown = [name for name in given if name not in names]
    if unknown:
        known = ", ".join(f"'{n}'" for n in names)
        raise FormError(
            [(f"{root}/{escaped(name)}", f"unknown field; known here: {known}") for name in unknown]
        )
