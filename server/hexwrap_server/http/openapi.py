"""What OpenAPI says about bodies and answers that the routes read and write by hand."""

from __future__ import annotations

from typing import Any

from hexwrap_server.http.openapi_result import NUMBER, PLANE, POINT, listed, nullable, record
from hexwrap_server.http.openapi_result import RESULT as _RESULT
from hexwrap_server.input.form import Body, ExploreBody, schema
from hexwrap_server.input.schemas import NurbsForm
from hexwrap_solver.surface.types import SurfaceSettings

_SETTINGS = schema(SurfaceSettings)["properties"]
_BESIDE_A_MESH = {name: part for name, part in _SETTINGS.items() if name != "mesh"}
_MESH = record(
    ("vertices", "faces"),
    more=False,
    **_BESIDE_A_MESH,
    vertices=listed(POINT),
    faces=listed(listed({"type": "integer", "minimum": 0}) | {"minItems": 3, "maxItems": 4}),
    normals=nullable(listed(POINT)),
)
_NURBS = record(
    ("nurbs",),
    more=False,
    nurbs=record(
        ("degree", "knots", "control_points"),
        more=False,
        **schema(NurbsForm)["properties"],
        knots=listed(listed(NUMBER), 2),
        control_points=listed(listed(listed(NUMBER) | {"minItems": 3, "maxItems": 4})),
    ),
    **_SETTINGS,
)
_SURFACE = {"anyOf": [_MESH, _NURBS, record(("id",), more=False, id={"type": "string"}, **_SETTINGS)]}

_JOB = record(
    ("id", "name", "status", "stage", "progress", "created", "started", "finished", "timings", "problem"),
    id={"type": "string"},
    name={"type": "string"},
    status={"enum": ["queued", "running", "done", "failed", "cancelled"]},
    stage={"type": "string"},
    progress={"type": "number", "minimum": 0, "maximum": 1},
    created={"type": "string", "format": "date-time"},
    started=nullable({"type": "string", "format": "date-time"}),
    finished=nullable({"type": "string", "format": "date-time"}),
    timings={"type": "object", "additionalProperties": NUMBER},
    found={"type": "object", "additionalProperties": {"type": "string"}},
    problem=nullable({"type": "object"}),
    queue_position=nullable({"type": "integer"}),
    kind={"enum": ["solve", "explore"]},
)
_PROBLEM = record(
    ("type", "title", "status", "detail", "errors"),
    type={"type": "string"},
    title={"type": "string"},
    status={"type": "integer"},
    detail={"type": "string"},
    errors=listed(record(("pointer", "detail"), pointer={"type": "string"}, detail={"type": "string"})),
)
_HEALTH = record(("status", "version", "workers", "queued", "running"), status={"const": "ok"})


def _answers(media: dict[str, Any], status: int = 200, *problems: int) -> dict[str, Any]:
    refused = {"description": "Refused", "content": {"application/problem+json": {"schema": _PROBLEM}}}
    good: dict[str, Any] = {"description": "Done"} | ({"content": media} if media else {})
    return {str(status): good} | {str(code): refused for code in (401, 403, 421, 422, *problems)}


def _json(schema: dict[str, Any]) -> dict[str, Any]:
    return {"application/json": {"schema": schema}}


def _route(answers: dict[str, Any], body: dict[str, Any] | None = None) -> dict[str, Any]:
    content = {"requestBody": {"required": True, "content": body}} if body else {}
    return {"responses": answers} | content


def _request_schema(body: type = Body) -> dict[str, Any]:
    """The request with its definitions inside, so that it can stand anywhere in the document."""
    rest = schema(body)
    return rest | {"properties": {"surface": _SURFACE} | rest["properties"], "required": ["surface"]}


_BODY_FAULTS = (400, 413, 415)
_FILE = {"multipart/form-data": {"schema": record(("file",), file={"type": "string", "format": "binary"})}}
_POINTS = record(("points",), more=False, points=listed(PLANE))
_PLACES = record(("points",), more=False, points=listed(POINT))

#: By method and path; FastAPI adds what it knows of parameters.
OPERATIONS: dict[str, dict[str, Any]] = {
    "GET /health": _route(_answers(_json(_HEALTH))),
    "GET /ready": _route(_answers(_json(_HEALTH), 200, 503)),
    "GET /metrics": _route(_answers({"text/plain": {"schema": {"type": "string"}}})),
    "GET /v1/jobs": _route(_answers(_json(record(("jobs",), jobs=listed(_JOB))))),
    "GET /v1/jobs/{id}": _route(_answers(_json(_JOB), 200, 404)),
    "GET /v1/jobs/{id}/events": _route(
        _answers({"text/event-stream": {"schema": {"type": "string"}}}, 200, 404)
    ),
    "GET /v1/jobs/{id}/result": _route(_answers(_json(_RESULT), 200, 404, 409, 410, 500, 503)),
    "DELETE /v1/jobs/{id}": _route(_answers({}, 204, 404)),
    "POST /v1/jobs": _route(_answers(_json(_JOB), 202, *_BODY_FAULTS, 503), _json(_request_schema())),
    "POST /v1/explore": _route(
        _answers(_json(_JOB), 202, *_BODY_FAULTS, 503), _json(_request_schema(ExploreBody))
    ),
    "POST /v1/solve": _route(
        _answers(_json(_RESULT), 200, *_BODY_FAULTS, 409, 410, 500, 503), _json(_request_schema())
    ),
    "POST /v1/surfaces": _route(
        _answers(
            _json(record(("id", "vertices", "faces", "loops", "repairs"))), 201, *_BODY_FAULTS, 500, 503
        ),
        _json({"anyOf": [_MESH, _NURBS]}) | _FILE,
    ),
    "POST /v1/jobs/{id}/lift": _route(
        _answers(_json(record(("points", "normals", "inside"))), 200, *_BODY_FAULTS, 404, 409, 410, 503),
        _json(_POINTS),
    ),
    "POST /v1/jobs/{id}/flatten": _route(
        _answers(_json(record(("uv", "distance"))), 200, *_BODY_FAULTS, 404, 409, 410, 503), _json(_PLACES)
    ),
    "GET /v1/jobs/{id}/files/{name}": _route(
        _answers({"application/octet-stream": {"schema": {"type": "string"}}}, 200, 404, 409, 410, 500, 503)
    ),
    "GET /v1/settings": _route(_answers(_json(record(("type", "properties"))))),
    "GET /v1/samples": _route(_answers(_json(record(("samples",), samples=listed(record(("name",))))))),
    "GET /v1/samples/{name}": _route(_answers(_json(record(("surface",))), 200, 404)),
    "GET /v1/jobs/{id}/request": _route(
        _answers(_json(record(("surface", "boundary", "pattern", "panels"))), 200, 404)
    ),
    "POST /v1/surfaces/preview": _route(
        _answers(_json(record(("vertices", "faces"))), 200, *_BODY_FAULTS, 500, 503), _FILE
    ),
}
