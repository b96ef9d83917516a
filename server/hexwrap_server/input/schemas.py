"""Bodies of requests → settings of the solver. Every fault of form is found here and pointed at.

Large arrays never pass through pydantic: ``bulk`` checks them whole. All else is checked by strict models, in
which ``true`` is no number and an unknown field is a fault.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from math import isfinite, pi
from typing import Annotated, Any, Literal, TypeVar, get_args

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    FiniteFloat,
    PlainValidator,
    ValidationError,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import ErrorDetails

from hexwrap_server.input.arrays import Fault, faces, numbers, table
from hexwrap_server.input.requests import SentSurface, Wanted
from hexwrap_server.problems import MOST_LISTED, FormError
from hexwrap_solver.conformal.types import ANGLE_UNITS, AngleUnit, BoundaryCondition
from hexwrap_solver.panels.types import ComponentSettings, PanelSettings, Weights
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.surface.types import MeshSettings, NurbsSurface, SentMesh

#: Steps from the body to a section of it.
Path = tuple[str, ...]
#: Longer texts are not shown in problems.
MOST_SHOWN = 60
QUANTA = {"hex": pi / 3, "triangle": pi / 3, "quad": pi / 2}
ROTATIONS = ("edge", "vertex", "u", "v")


def _whole_number(value: object) -> object:
    """48.0 is a whole number too, as in JSON Schema."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _rotation(value: object) -> float | str:
    if isinstance(value, str) and value in ROTATIONS:
        return value
    if isinstance(value, (int, float)) and not isinstance(value, bool) and isfinite(value):
        return float(value)
    raise ValueError("must be 'edge', 'vertex', 'u', 'v' or a number of degrees")


Whole = Annotated[int, BeforeValidator(_whole_number)]
Positive = Annotated[FiniteFloat, Field(gt=0)]
NotNegative = Annotated[FiniteFloat, Field(ge=0)]
Pair = Annotated[list[FiniteFloat], Field(min_length=2, max_length=2)]
Phase = Annotated[list[Annotated[FiniteFloat, Field(ge=-1e6, le=1e6)]], Field(min_length=2, max_length=2)]
Point = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]
Rotation = Annotated[
    float | str,
    PlainValidator(_rotation),
    WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string", "enum": list(ROTATIONS)}]}),
]


class Model(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid")


M = TypeVar("M", bound=Model)


class Angle(Model):
    """A target angle at one boundary vertex, given by index in the sent mesh or by a point near it."""

    vertex: Annotated[Whole, Field(ge=0, lt=2**53)] | None = None
    point: Point | None = None
    angle: FiniteFloat

    @model_validator(mode="after")
    def one_place(self) -> Angle:
        if (self.vertex is None) == (self.point is None):
            raise ValueError("give either 'vertex' or 'point'")
        return self


class Boundary(Model):
    mode: Literal["straight", "angles", "isometric"] = "straight"
    angles: Annotated[list[Angle], Field(max_length=10_000)] = []
    angle_unit: AngleUnit = "rad"
    quantum: Literal["auto", "hex", "triangle", "quad", "none"] = "auto"
    spread: Literal["even", "optimal"] = "even"


class Pattern(Model):
    kind: Literal["hex", "triangle", "quad"] = "hex"
    around: Annotated[Whole, Field(ge=1, le=1_000_000)] | None = None
    edge_length: Positive | None = None
    rotation: Rotation = "edge"
    align: Literal["none", "first", "both"] = "both"
    boundary: Literal["whole", "trim"] = "whole"
    phase: Phase = [0.0, 0.0]

    @model_validator(mode="after")
    def one_size(self) -> Pattern:
        if self.around is not None and self.edge_length is not None:
            raise ValueError("give either 'around' or 'edge_length', the other one null")
        return self


class EnergyWeights(Model):
    planarity: NotNegative = 1.0
    angle: NotNegative = 1.0
    edge: NotNegative = 1.0
    surface: NotNegative = 0.0


class Components(Model):
    inset: NotNegative = 0.0
    thickness: NotNegative = 0.0
    depth: NotNegative = 0.0


class Panels(Model):
    mode: Literal["split", "watertight"] = "split"
    sizes: Annotated[Whole, Field(ge=1, le=1000)] | None = 11
    size_cost: Literal["area", "worst"] = "area"
    edge_range: Pair | None = None
    target: Literal["shortest", "inscribed", "best", "mean"] = "inscribed"
    orientation: Literal["fit", "tangent"] = "fit"
    joint: NotNegative = 0.0
    method: Literal["exact", "energy"] = "exact"
    weights: EnergyWeights = EnergyWeights()
    increment: NotNegative = 0.0
    components: Components | None = None

    @model_validator(mode="after")
    def range_in_order(self) -> Panels:
        if self.edge_range is None:
            return self
        low, high = self.edge_range
        if not (0 <= low <= high and high > 0):
            raise ValueError("'edge_range' must be [min, max] with 0 ≤ min ≤ max and max > 0")
        return self


class Body(Model):
    """Everything of a request but its surface."""

    name: Annotated[str, Field(max_length=200)] = ""
    boundary: Boundary = Boundary()
    pattern: Pattern | None = Pattern()
    panels: Panels | None = Panels()
    support: bool = False


class Meshing(Model):
    max_edge: Positive | None = None
    tolerance: Positive | None = None


class NurbsForm(Model):
    """The part of a NURBS surface that is no large array."""

    degree: Annotated[list[Annotated[Whole, Field(ge=1, le=25)]], Field(min_length=2, max_length=2)]
    closed: Annotated[list[bool], Field(min_length=2, max_length=2)] = [False, False]


@dataclass(frozen=True)
class Request:
    """surface: as sent, or the id of one that was sent before."""

    name: str
    surface: SentSurface | str
    wanted: Wanted


def parse_request(body: object, max_vertices: int, max_panels: int) -> Request:
    """Raises FormError with a JSON pointer for each fault."""
    if not isinstance(body, dict):
        raise FormError.at("", 'the body must be a JSON object such as {"surface": …}')
    if "surface" not in body:
        raise FormError.at("/surface", "'surface' is missing; it is the one field without a default")
    rest = _validated(Body, {k: v for k, v in body.items() if k != "surface"}, "")
    surface = parse_surface(body["surface"], max_vertices, allow_id=True)
    if isinstance(surface, SentSurface) and surface.mesh is not None:
        _vertices_exist(rest.boundary, len(surface.mesh.vertices))
    wanted = Wanted(_boundary(rest), _pattern(rest, max_panels), _panels(rest), rest.support)
    return Request(rest.name, surface, wanted)


def parse_surface(
    surface: object, max_vertices: int, *, allow_id: bool = False, root: str = "/surface"
) -> SentSurface | str:
    """A mesh, a NURBS surface or an id. Raises FormError."""
    if not isinstance(surface, dict):
        raise FormError.at(root, "must be an object with 'vertices' and 'faces', or 'nurbs', or 'id'")
    if allow_id and "id" in surface:
        _known(surface, ("id",), root)
        if not isinstance(surface["id"], str):
            raise FormError.at(f"{root}/id", "must be the id that POST /v1/surfaces answered")
        return surface["id"]
    if "nurbs" in surface:
        _known(surface, ("nurbs", "mesh"), root)
        meshing = surface.get("mesh")
        settings = _validated(Meshing, {} if meshing is None else meshing, f"{root}/mesh")
        return SentSurface(
            nurbs=_nurbs(surface["nurbs"], f"{root}/nurbs"),
            meshing=MeshSettings(settings.max_edge, settings.tolerance, max_vertices),
        )
    _known(surface, ("vertices", "faces", "normals"), root)
    for name in ("vertices", "faces"):
        if name not in surface:
            raise FormError.at(f"{root}/{name}", f"'{name}' is missing")
    try:
        return SentSurface(mesh=_mesh(surface, max_vertices, root))
    except Fault as fault:
        raise FormError.at(root + fault.pointer, fault.detail, fault.kind) from None


def parse_points(body: object, dimension: int, most: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(n, dimension) of a lift or flatten request. Raises FormError."""
    if not isinstance(body, dict):
        raise FormError.at("", 'the body must be a JSON object such as {"points": …}')
    _known(body, ("points",), "")
    if "points" not in body:
        raise FormError.at("/points", "'points' is missing")
    try:
        return table(body["points"], "/points", dimension, most)
    except Fault as fault:
        raise FormError.at(fault.pointer, fault.detail, fault.kind) from None


def _mesh(surface: dict[str, object], max_vertices: int, root: str) -> SentMesh:
    vertices = table(surface["vertices"], "/vertices", 3, max_vertices)
    corners = faces(surface["faces"], "/faces", len(vertices), 4 * max_vertices)
    normals = surface.get("normals")
    if normals is None:
        return SentMesh(vertices, corners)
    directions = table(normals, "/normals", 3, max_vertices)
    if len(directions) != len(vertices):
        raise Fault(
            "/normals", f"{len(directions)} normals for {len(vertices)} vertices; send one per vertex"
        )
    return SentMesh(vertices, corners, directions)


def _nurbs(nurbs: object, root: str) -> NurbsSurface:
    if not isinstance(nurbs, dict):
        raise FormError.at(root, "must be an object with 'degree', 'knots' and 'control_points'")
    large = ("knots", "control_points")
    form = _validated(NurbsForm, {k: v for k, v in nurbs.items() if k not in large}, root)
    for name in large:
        if not isinstance(nurbs.get(name), list):
            raise FormError.at(f"{root}/{name}", f"'{name}' must be a list")
    knots, net = nurbs["knots"], nurbs["control_points"]
    try:
        if len(knots) != 2:
            raise Fault("/knots", f"must be two lists of numbers, one per direction, not {len(knots)}")
        u, v = (numbers(row, f"/knots/{i}", 10_000) for i, row in enumerate(knots))
        points = _net(net)
    except Fault as fault:
        raise FormError.at(root + fault.pointer, fault.detail, fault.kind) from None
    degree = (form.degree[0], form.degree[1])
    return NurbsSurface(degree, (u, v), points, (form.closed[0], form.closed[1]))


def _net(rows: list[Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
    if not rows or not isinstance(rows[0], list) or not rows[0] or not isinstance(rows[0][0], list):
        raise Fault("/control_points", "must be rows of points [x, y, z] or [x, y, z, weight]")
    width = 4 if len(rows[0][0]) == 4 else 3
    lines = [table(row, f"/control_points/{i}", width, 100_000) for i, row in enumerate(rows)]
    for i, line in enumerate(lines):
        if len(line) != len(lines[0]):
            raise Fault(f"/control_points/{i}", f"has {len(line)} points, the first row {len(lines[0])}")
    net = np.stack(lines)
    return net if width == 4 else np.concatenate([net, np.ones((*net.shape[:2], 1))], axis=2)


def _boundary(body: Body) -> BoundaryCondition:
    asked = body.boundary
    name = asked.quantum
    if name == "auto":
        name = body.pattern.kind if body.pattern else "none"
    quantum = QUANTA.get(name)
    if asked.mode != "angles":
        return BoundaryCondition(mode=asked.mode, quantum=quantum, spread=asked.spread)
    return BoundaryCondition(
        mode="angles",
        vertices=np.array([-1 if a.vertex is None else a.vertex for a in asked.angles], dtype=np.int64),
        points=np.array([a.point or [np.nan] * 3 for a in asked.angles], dtype=float).reshape(-1, 3),
        angles=np.array([a.angle * ANGLE_UNITS[asked.angle_unit] for a in asked.angles], dtype=float),
        unit=asked.angle_unit,
        quantum=quantum,
        spread=asked.spread,
    )


def _pattern(body: Body, max_panels: int) -> PatternSettings | None:
    asked = body.pattern
    if asked is None:
        return None
    return PatternSettings(
        kind=asked.kind,
        around=asked.around,
        edge_length=asked.edge_length,
        rotation=asked.rotation,  # type: ignore[arg-type]
        align=asked.align,
        boundary=asked.boundary,
        phase=(asked.phase[0], asked.phase[1]),
        max_cells=max_panels,
    )


def _panels(body: Body) -> PanelSettings | None:
    asked = body.panels
    if asked is None or body.pattern is None:
        return None
    return PanelSettings(
        mode=asked.mode,
        sizes=asked.sizes,
        size_cost=asked.size_cost,
        edge_range=(asked.edge_range[0], asked.edge_range[1]) if asked.edge_range else None,
        target=asked.target,
        orientation=asked.orientation,
        joint=asked.joint,
        method=asked.method,
        weights=Weights(**asked.weights.model_dump()),
        increment=asked.increment,
        components=_components(body, asked),
    )


def _components(body: Body, asked: Panels) -> ComponentSettings | None:
    """Asked for by themselves, or as far as a support structure needs them."""
    if asked.components is None:
        return ComponentSettings() if body.support else None
    return ComponentSettings(**asked.components.model_dump())


def _vertices_exist(boundary: Boundary, n: int) -> None:
    for i, angle in enumerate(boundary.angles if boundary.mode == "angles" else []):
        if angle.vertex is not None and angle.vertex >= n:
            raise FormError.at(
                f"/boundary/angles/{i}/vertex",
                f"vertex {angle.vertex} of a mesh of {n} vertices (0 to {n - 1})",
            )


def _known(given: dict[str, object], names: Sequence[str], root: str) -> None:
    unknown = [name for name in given if name not in names]
    if unknown:
        known = ", ".join(f"'{n}'" for n in names)
        raise FormError(
            [(f"{root}/{escaped(name)}", f"unknown field; known here: {known}") for name in unknown]
        )


def _validated(model: type[M], given: object, root: str) -> M:
    try:
        return model.model_validate(given)
    except ValidationError as error:
        faults = [
            (
                root + _pointer(given, e["loc"], e["type"]),
                _sentence(model, e) if i < MOST_LISTED else e["msg"],
            )
            for i, e in enumerate(error.errors(include_url=False, include_context=False))
        ]
        raise FormError(faults) from None


def _sentence(model: type[BaseModel], error: ErrorDetails) -> str:
    """What is wrong, what was sent, and what would be right."""
    if error["type"] == "extra_forbidden":
        return _unknown(model, error["loc"])
    text, sent = error["msg"].removeprefix("Value error, "), error["input"]
    if sent is not None and not isinstance(sent, (bool, int, float, str)):
        return text
    shown = json.dumps(sent, ensure_ascii=False)
    return f"{text}, not {shown}" if len(shown) <= MOST_SHOWN else text


def _unknown(model: type[BaseModel], place: tuple[int | str, ...]) -> str:
    """A field that there is not; but perhaps elsewhere, or under a name like it."""
    *above, name = (str(step) for step in place)
    sections = _sections(model)
    here = sections.get(tuple(step for step in above if not step.isdigit()), model)
    text = f"unknown field; known here: {', '.join(repr(known) for known in here.model_fields)}"
    homes = ["/".join(("", *path)) for path, section in sections.items() if name in section.model_fields]
    like = get_close_matches(name, here.model_fields, 1)
    if homes:
        return f"{text}; '{name}' belongs to {' or '.join(home or 'the body itself' for home in homes)}"
    return f"{text}; did you mean '{like[0]}'?" if like else text


@cache
def _sections(model: type[BaseModel]) -> dict[Path, type[BaseModel]]:
    """The model, and those of its fields that are models themselves or lists of them, by their paths."""
    found: dict[Path, type[BaseModel]] = {(): model}
    for name, field in model.model_fields.items():
        for kind in _kinds(field.annotation):
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                found |= {(name, *path): section for path, section in _sections(kind).items()}
    return found


def _kinds(annotation: Any) -> Iterator[Any]:
    """The types that an annotation is made of."""
    parts = get_args(annotation)
    if parts:
        for part in parts:
            yield from _kinds(part)
    else:
        yield annotation


def _pointer(given: object, place: tuple[int | str, ...], kind: str) -> str:
    """pydantic names the branches of unions in its paths; a JSON pointer holds only what was sent."""
    parts = []
    at: Any = given
    for i, step in enumerate(place):
        try:
            at = at[step]
        except (KeyError, IndexError, TypeError):
            if not (kind == "missing" and i == len(place) - 1):
                continue
        parts.append(escaped(str(step)))
    return "".join(f"/{part}" for part in parts)


def escaped(step: str) -> str:
    """A name as a step of a JSON pointer."""
    return step.replace("~", "~0").replace("/", "~1")
