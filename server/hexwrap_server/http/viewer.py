"""The page for people who would rather look than read, and what it needs besides the contract's routes.

The page itself is built from ``server/viewer`` into ``static``, which ships in the wheel.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import orjson
from fastapi import APIRouter, FastAPI, Query, Request
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles

from hexwrap_server import samples
from hexwrap_server.http import openapi
from hexwrap_server.http.answers import json_response, packed_response
from hexwrap_server.http.bodies import read_body
from hexwrap_server.http.routes import JobId, service_of
from hexwrap_server.input.form import Body, document, schema
from hexwrap_server.input.uploads import sent_file
from hexwrap_server.jobs.work import take_in
from hexwrap_server.jobs.worker import Report
from hexwrap_server.problems import body_is_the_surface, not_found
from hexwrap_server.settings import MIB

STATIC = Path(__file__).parents[1] / "static"
#: The page loads nothing from elsewhere, and says so to the browser.
POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; frame-ancestors 'none'"
)

router = APIRouter()


def add_viewer(app: FastAPI) -> None:
    """Serves the page at ``/``."""
    app.include_router(router)
    app.mount("/static", StaticFiles(directory=STATIC), name="static")


@router.get("/", include_in_schema=False)
async def page() -> Response:
    """The viewer."""
    return FileResponse(
        STATIC / "index.html", headers={"Content-Security-Policy": POLICY, "Cache-Control": "no-cache"}
    )


@router.get("/v1/settings", openapi_extra=openapi.SETTINGS)
async def settings() -> Response:
    """JSON Schema of a request but for the arrays of its surface, with help, units and bounds: for forms."""
    return json_response(schema(Body))


@router.get("/v1/samples", openapi_extra=openapi.SAMPLES)
async def list_samples() -> Response:
    """The bundled surfaces."""
    return json_response({"samples": [{"name": name} for name in samples.names()]})


@router.get("/v1/samples/{name}", openapi_extra=openapi.SAMPLE)
async def sample(request: Request, name: str) -> Response:
    """A bundled surface as a complete request body."""
    if name not in samples.names():
        raise not_found(
            "sample", f"There is no sample '{name[:64]}'; there are {', '.join(samples.names())}."
        )
    return await packed_response(request, orjson.dumps(samples.load(name)))


@router.get("/v1/jobs/{id}/request", openapi_extra=openapi.REQUEST)
async def job_request(request: Request, id: JobId) -> Response:
    """What a job was asked to do, its surface by id: to be changed and sent again."""
    service = service_of(request)
    job = service.manager.get(id)
    work = service.store.work(job.identity)
    if work is None:
        raise not_found("request", "The request of this job is no longer kept.")
    asked = document(work.wanted)
    surface = {"id": work.surface} | (asked.pop("surface") or {})
    return json_response({"name": job.name, "surface": surface} | asked)


@router.post("/v1/surfaces/preview", openapi_extra=openapi.PREVIEW)
async def preview(
    request: Request,
    name: Annotated[str | None, Query(max_length=200, description="name of a raw file")] = None,
) -> Response:
    """A file's mesh as it stands, unchecked: to have something to point at when it is refused."""
    service = service_of(request)
    body = await read_body(request, service.settings.max_body_mib)
    kind = request.headers.get("content-type", "")
    limits = (service.settings.max_vertices, int(service.settings.max_body_mib * MIB))
    data = await service.reading("hexwrap_server.http.viewer:read_preview", body, kind, name or "", *limits)
    return await packed_response(request, data)


@body_is_the_surface(is_file=True)
def read_preview(
    report: Report, body: bytes, content_type: str, name: str, max_vertices: int, max_bytes: int
) -> bytes:
    """Vertices and faces of a file as JSON; runs in a worker. Raises UploadError, SurfaceError."""
    read = sent_file(body, content_type, name, max_vertices, max_bytes).sent
    if read.mesh is None:
        meshed = take_in(read)
        vertices, faces = meshed.vertices, meshed.faces.tolist()
    else:
        vertices, faces = read.mesh.vertices, read.mesh.faces.to_lists()
    return orjson.dumps({"vertices": vertices, "faces": faces}, option=orjson.OPT_SERIALIZE_NUMPY)
