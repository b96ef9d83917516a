"""What OpenAPI says of the Result (written by ``output.wire``). Fields may be added, none renamed."""

from __future__ import annotations

from typing import Any

from hexwrap_solver.pattern.lattice import LATTICES


def listed(items: dict[str, Any], length: int | None = None) -> dict[str, Any]:
    """A list of such items."""
    sized = {"minItems": length, "maxItems": length} if length is not None else {}
    return {"type": "array", "items": items} | sized


def record(required: tuple[str, ...] = (), more: bool = True, **properties: Any) -> dict[str, Any]:
    """An object. more: whether it may have properties that are not named here."""
    closed = {} if more else {"additionalProperties": False}
    return {"type": "object", "properties": properties, "required": list(required)} | closed


def nullable(schema: dict[str, Any]) -> dict[str, Any]:
    return {"anyOf": [schema, {"type": "null"}]}


NUMBER = {"type": "number"}
POINT = listed(NUMBER, 3)
PLANE = listed(NUMBER, 2)
_INDEX = {"type": "integer", "minimum": 0}
_COUNT = _INDEX
_INTEGER = {"type": "integer"}
_TEXT = {"type": "string"}
_TRUTH = {"type": "boolean"}
_MEASURE = nullable(NUMBER)  # null where nothing was measured
_KIND = {"enum": list(LATTICES)}


def _all(**properties: Any) -> dict[str, Any]:
    """An object that has all of these, and perhaps more."""
    return record(tuple(properties), **properties)


_MESH = _all(
    vertices=listed(POINT),
    faces=listed(listed(_INDEX, 3)),
    input_vertex=listed({"type": "integer", "minimum": -1}),
    vertex_of_input=listed({"type": "integer", "minimum": -1}),
    loops=listed(listed(_INDEX)),
    features=listed(listed(_INDEX)),
    repairs=listed(_TEXT),
)
_MAP = _all(
    kind={"enum": ["cylinder", "cone", "net"]},
    cone_angle=nullable(NUMBER),
    log_scale=listed(NUMBER),
    uv=nullable(listed(PLANE)),
    sheet=nullable(listed(listed(_INTEGER, 3))),
    deck=nullable(_all(angle=NUMBER, translation=PLANE)),
    circumference=nullable(NUMBER),
    apex=nullable(PLANE),
    boundary_angles=listed(listed(NUMBER)),
    iterations=_COUNT,
    residual=NUMBER,
    flips=_COUNT,
    apart=nullable(_all(face=listed(_INDEX), cell=nullable(listed(_INDEX)), shift=listed(PLANE))),
)
_PATTERN = _all(
    kind=_KIND,
    vertices=listed(POINT),
    normals=listed(POINT),
    uv=listed(PLANE),
    faces=listed(listed(_INDEX)),
    whole=listed(_TRUTH),
    index=listed(_INTEGER),
    neighbours=listed(listed({"type": "integer", "minimum": -1})),
    rings=_COUNT,
    around=_COUNT,
    distortion=NUMBER,
    features=listed(listed(_INDEX)),
    along=listed(_all(straight=_TRUTH, cut=_COUNT, width=NUMBER, distortion=nullable(NUMBER), fold=NUMBER)),
)
_PANELS = _all(
    mode={"enum": ["split", "watertight"]},
    polygons=listed(listed(POINT)),
    face=listed(_INDEX),
    label=listed(_TEXT),
    size=listed(_INTEGER),
    edge_length=listed(NUMBER),
    center=listed(POINT),
    normal=listed(POINT),
    whole=listed(_TRUTH),
    bend=listed(nullable(listed(_INDEX, 2))),
    bend_angle=listed(NUMBER),
    other_face=listed({"type": "integer", "minimum": -1}),
)
_SIZE = _all(
    size=_INDEX,
    edge_length=NUMBER,
    count=_COUNT,
    sides=_COUNT,
    color=_TEXT | {"pattern": "^#[0-9a-fA-F]{6}$"},
    fold=_TRUTH,
)
_CURVE = _all(
    sizes=_COUNT,
    taken=_INDEX,
    coarse=_TRUTH,
    number=listed(_COUNT),
    uncovered=listed(NUMBER),
    scale_ratio=listed(NUMBER),
    at=listed(listed(_all(point=POINT, index=_INTEGER))),
)
_QUALITY = _all(
    scale_ratio=NUMBER,
    quasi_conformal=_all(mean=NUMBER, max=NUMBER),
    planarity=_all(max=_MEASURE, mean=_MEASURE),
    edge_deviation=_all(max=_MEASURE),
    angle_deviation=_all(max=_MEASURE),
    surface_distance=_all(max=_MEASURE, mean=_MEASURE),
    gap=_all(
        tangential=_all(min=_MEASURE, mean=_MEASURE, max=_MEASURE),
        normal=_all(mean=_MEASURE, max=_MEASURE),
        over=nullable(_COUNT),
    ),
    kink=_all(mean=_MEASURE, max=_MEASURE),
    convex=_MEASURE,
    movement=NUMBER,
    overlaps=nullable(_COUNT),
    coverage=_MEASURE,
    bare=_MEASURE,
    distinct_panels=_COUNT,
    singularity_curve=nullable(_CURVE),
    notes=listed(_TEXT),
)
#: The parts that ``?include=`` picks, by default all.
RESULT = record(
    unit=nullable({"enum": ["m", "cm", "mm", "ft", "in"]}),
    mesh=_MESH,
    map=_MAP,
    pattern=nullable(_PATTERN),
    panels=nullable(_PANELS),
    sizes=listed(_SIZE),
    quality=_QUALITY,
) | {"minProperties": 1}
