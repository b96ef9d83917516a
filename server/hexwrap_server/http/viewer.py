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
from hexwrap_server.errors import not_found
from hexwrap_server.http.answers import JSON, json_response
from hexwrap_server.http.bodies import sent_body
from hexwrap_server.http.routes import JobId, service_of
from hexwrap_server.input.form import Body, document, schema

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


@router.get("/v1/settings")
async def settings() -> Response:
    """JSON Schema of a request but for the arrays of its surface, with help, units and bounds: for forms."""
    return json_response(schema(Body))


@router.get("/v1/samples")
async def list_samples() -> Response:
    """The bundled surfaces."""
    return json_response({"samples": [{"name": name} for name in samples.names()]})


@router.get("/v1/samples/{name}")
async def sample(name: str) -> Response:
    """A bundled surface as a complete request body."""
    if name not in samples.names():
        raise not_found(
            "sample", f"Unknown sample '{name[:64]}'; choose one of {', '.join(samples.names())}."
        )
    return Response(orjson.dumps(samples.load(name)), media_type=JSON)


@router.get("/v1/jobs/{id}/request")
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


@router.post("/v1/surfaces/preview")
async def preview(
    request: Request,
    name: Annotated[str | None, Query(max_length=200, description="name of a raw file")] = None,
) -> Response:
    """A file's mesh as it stands, unchecked: to have something to point at when it is refused."""
    kind = request.headers.get("content-type", "")
    async with sent_body(request) as body:
        data = await service_of(request).read(
            "hexwrap_server.jobs.reading:preview", body, kind, name or "", is_file=True
        )
    return Response(data, media_type=JSON)
