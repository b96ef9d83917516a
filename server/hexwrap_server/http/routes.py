"""The contract's routes."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated, Literal

from fastapi import APIRouter, Path, Query, Request
from isal import igzip
from starlette.responses import Response, StreamingResponse

from hexwrap_server.errors import GoneError, JobFailedError, bad_parameters, not_found, refusal
from hexwrap_server.http import head
from hexwrap_server.http.answers import JSON, json_response, problem_response
from hexwrap_server.http.bodies import sent_body
from hexwrap_server.http.metrics import MEDIA_TYPE as METRICS_TYPE
from hexwrap_server.http.service import Service
from hexwrap_server.input.requests import Intake, ParsedRequest
from hexwrap_server.jobs.manager import JobManager
from hexwrap_server.jobs.store import Job
from hexwrap_server.output.wire import CORNERS, PARTS
from hexwrap_server.problems import dumped

#: Longest time that ``?wait=`` holds an answer.
MAX_WAIT = 60.0
#: Seconds between two signs of life on an event stream.
HEARTBEAT = 15.0
#: Files of a finished job and their media types; ``hexwrap_server.output.writers`` writes them.
FILES = {
    "panels.obj": "model/obj",
    "panels.3dm": "model/vnd.3dm",
    "panels.dxf": "image/vnd.dxf",
    "panels.csv": "text/csv; charset=utf-8",
    "panels.ifc": "application/x-step",
    "panels.glb": "model/gltf-binary",
    "cutting-list.csv": "text/csv; charset=utf-8",
    "flat.dxf": "image/vnd.dxf",
    "domain.svg": "image/svg+xml",
    "domain.dxf": "image/vnd.dxf",
    "panels.png": "image/png",
    "result.json": JSON,
    "result.npz": "application/octet-stream",
}
#: Those of an exploration.
EXPLORED = {"explore.csv": "text/csv; charset=utf-8", "result.json": JSON}

router = APIRouter()
JobId = Annotated[str, Path(description="a job's id", max_length=64)]


def service_of(request: Request) -> Service:
    service: Service = request.app.state.service
    return service


def manager_of(request: Request) -> JobManager:
    return service_of(request).manager


@router.get("/health")
async def health(request: Request) -> Response:
    """Whether the server lives."""
    return json_response(service_of(request).health())


@router.get("/ready")
async def ready(request: Request) -> Response:
    """Whether a job would be run now."""
    service = service_of(request)
    if not service.is_ready:
        raise refusal("not-ready", "The worker processes are starting.", {"Retry-After": "1"})
    return json_response(service.health())


@router.get("/metrics")
async def metrics(request: Request) -> Response:
    """Prometheus text."""
    return Response(service_of(request).metrics.text(), media_type=METRICS_TYPE)


@router.post("/v1/jobs", status_code=202)
async def post_job(request: Request) -> Response:
    """Have a surface panelized."""
    return await _taken(request, await _read(request))


@router.post("/v1/explore", status_code=202)
async def post_explore(request: Request) -> Response:
    """Have variants of a surface looked at, and the promising ones solved."""
    return await _taken(request, await _read(request, explore=True))


@router.get("/v1/jobs")
async def list_jobs(
    request: Request,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
    before: Annotated[str | None, Query(max_length=64, description="only jobs older than this one")] = None,
) -> Response:
    """Jobs, newest first; ``next`` is where the list goes on."""
    jobs = await manager_of(request).latest(limit, before)
    more = f"/v1/jobs?limit={limit}&before={jobs[-1]['id']}" if len(jobs) == limit else None
    return await asyncio.to_thread(json_response, {"jobs": jobs, "next": more})


@router.get("/v1/jobs/{id}")
async def get_job(
    request: Request, id: JobId, wait: Annotated[float, Query(ge=0, le=MAX_WAIT, allow_inf_nan=False)] = 0.0
) -> Response:
    """A job, at once or when it ends."""
    manager = manager_of(request)
    job = await manager.wait(id, wait) if wait else manager.get(id)
    return json_response(manager.document(job), headers={"Cache-Control": "no-store"} | _timing(job))


@router.get("/v1/jobs/{id}/events")
async def events(request: Request, id: JobId) -> Response:
    """A job's progress as Server-Sent Events."""
    manager = manager_of(request)
    manager.get(id)
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    nobody_listens = request.scope.get(head.MARK)
    stream = iter(()) if nobody_listens else _events(manager, id)
    return StreamingResponse(stream, headers=headers, media_type="text/event-stream")


@router.get("/v1/jobs/{id}/result")
async def get_result(
    request: Request, id: JobId, include: Annotated[str | None, Query(description=", ".join(PARTS))] = None
) -> Response:
    """A job's Result, or its problem."""
    return await _result(request, manager_of(request).get(id), _parts(include))


@router.delete("/v1/jobs/{id}", status_code=204)
async def delete_job(request: Request, id: JobId) -> Response:
    """Stop a job, or forget it."""
    await manager_of(request).delete(id)
    return Response(status_code=204)


@router.post("/v1/solve")
async def solve(
    request: Request, include: Annotated[str | None, Query(description=", ".join(PARTS))] = None
) -> Response:
    """The Result itself, when it is there."""
    parts = _parts(include)
    parsed = await _read(request)
    try:
        return await _solved(request, parsed, parts)
    except GoneError:  # the result was kept, and found damaged: then it is computed anew
        return await _solved(request, parsed, parts)


async def _solved(request: Request, parsed: ParsedRequest, parts: list[str] | None) -> Response:
    manager = manager_of(request)
    job = await manager.submit(parsed)
    job = await manager.wait(job.id, None)
    if not job.is_over:
        raise refusal(
            "shutting-down",
            f"The job is kept and goes on when the server runs again; then ask for /v1/jobs/{job.id}/result.",
            {"Retry-After": "5", "Location": f"/v1/jobs/{job.id}"},
        )
    return await _result(request, job, parts)


@router.post("/v1/surfaces", status_code=201)
async def post_surface(
    request: Request,
    name: Annotated[str | None, Query(max_length=200, description="name of a raw file")] = None,
) -> Response:
    """Send a surface once, as JSON or as a file."""
    service = service_of(request)
    kind = request.headers.get("content-type", "")
    keep = str(service.store.surfaces), service.manager.caching
    reader = "hexwrap_server.jobs.reading:read_"
    async with sent_body(request) as body:
        if name is not None or kind.lower().startswith("multipart/"):
            intake: Intake = await service.read(
                f"{reader}upload", body, *keep, kind, name or "", is_file=True
            )
        else:
            intake = await service.read(f"{reader}surface", body, *keep)
    return json_response({"id": intake.id} | intake.answer, 201)


@router.post("/v1/jobs/{id}/lift")
async def lift(request: Request, id: JobId) -> Response:
    """Points of the unrolled domain → points of the surface."""
    return await _carry(request, id, "lift")


@router.post("/v1/jobs/{id}/flatten")
async def flatten(request: Request, id: JobId) -> Response:
    """Points near the surface → points of the unrolled domain."""
    return await _carry(request, id, "flatten")


@router.get("/v1/jobs/{id}/files/{name}")
async def get_file(
    request: Request,
    id: JobId,
    name: Annotated[str, Path(max_length=64)],
    sheet: Annotated[
        str | None,
        Query(
            pattern=r"^[0-9]+(\.[0-9]+)?[xX][0-9]+(\.[0-9]+)?$",
            max_length=64,
            description="flat.dxf: width and height of its sheets in model units, such as 2500x1250",
        ),
    ] = None,
    group: Annotated[
        Literal["size", "ring", "zone"],
        Query(description="flat.dxf: what shares a sheet: all sizes, a ring, or a side of the building"),
    ] = "size",
    storey: Annotated[
        float | None,
        Query(gt=0, allow_inf_nan=False, description="panels.ifc: height of the storeys in model units"),
    ] = None,
) -> Response:
    """The finished work as a file."""
    if name not in FILES and name not in EXPLORED:
        raise not_found("file", f"Unknown file '{name[:64]}'; choose one of {', '.join(FILES | EXPLORED)}.")
    service = service_of(request)
    size = None if sheet is None else _sheet(sheet)
    job = service.manager.get(id)
    files = EXPLORED if job.kind == "explore" else FILES
    if name not in files:
        what = "An exploration" if job.kind == "explore" else "A solved job"
        raise not_found("file", f"{what} has no file '{name}'; choose one of {', '.join(files)}.")
    _finished(job)
    if name == "result.json":
        data = await asyncio.to_thread(igzip.decompress, await service.manager.result(job))
    elif job.kind == "explore":
        path = str(service.store.solution_path(job.identity))
        data = await service.errand("hexwrap_server.jobs.explore:write_table", path)
    else:
        path = str(service.store.solution_path(job.identity))
        options = {"sheet": size, "group": group, "storey": storey}
        data = await service.errand(
            "hexwrap_server.jobs.work:write_file", path, name, job.name, job.timings, options
        )
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(data, 200, headers, files[name])


async def _read(request: Request, explore: bool = False) -> ParsedRequest:
    service = service_of(request)
    async with sent_body(request) as body:
        parsed: ParsedRequest = await service.read(
            "hexwrap_server.jobs.reading:read_request", body, str(service.store.surfaces), explore
        )
    return parsed


async def _taken(request: Request, parsed: ParsedRequest) -> Response:
    manager = manager_of(request)
    job = await manager.submit(parsed)
    return json_response(manager.document(job), 202, {"Location": f"/v1/jobs/{job.id}"})


async def _carry(request: Request, id: str, what: str) -> Response:
    service = service_of(request)
    job = service.manager.get(id)
    _is_solved(job)
    async with sent_body(request) as body:
        _finished(job)
        path = str(service.store.solution_path(job.identity))
        data = await service.read(f"hexwrap_server.jobs.reading:{what}", body, path)
    return Response(data, media_type=JSON)


async def _result(request: Request, job: Job, include: list[str] | None) -> Response:
    if job.status == "failed" and job.problem:
        return problem_response(job.problem)
    _finished(job)
    picked = "" if include is None else f"?include={','.join(include)}"
    headers = {"Content-Location": f"/v1/jobs/{job.id}/result{picked}"} | _timing(job)
    service = service_of(request)
    if include is None:
        packed = await service.manager.result(job)
    else:
        _is_solved(job)
        packed = await service.manager.parts(job, include, service.errand)
    if request.headers["accept-encoding"] == "gzip":  # as the middleware has found
        headers |= {"Content-Encoding": "gzip", "Vary": "Accept-Encoding"}
        return Response(packed, 200, headers, JSON)
    return Response(await asyncio.to_thread(igzip.decompress, packed), 200, headers, JSON)


def _finished(job: Job) -> None:
    """Raises HttpError unless the job is done."""
    if job.status == "failed" and job.problem:
        raise JobFailedError(job.problem)
    if job.status == "cancelled":
        raise refusal("cancelled", "The job was cancelled, so it has no result.")
    if job.status != "done":
        raise refusal(
            "not-finished", f"The job is {job.status}; wait with GET …?wait=60.", {"Retry-After": "1"}
        )


def _is_solved(job: Job) -> None:
    """Raises HttpError for an exploration, which has variants and no map of its own."""
    if job.kind == "explore":
        raise refusal(
            "exploration",
            "An exploration has no map and no panels of its own: send the request of one of its "
            "variants to "
            "/v1/jobs, and ask that job.",
        )


def _parts(include: str | None) -> list[str] | None:
    if include is None:
        return None
    wanted = [name.strip() for name in include.split(",") if name.strip()]
    known = [name for name in (*PARTS, CORNERS) if name in wanted]
    if not known or len(known) < len(set(wanted)):
        detail = f"'include' names parts of the Result: {', '.join(PARTS)}."
        raise bad_parameters(detail, [("include", detail)])
    return known


def _sheet(text: str) -> tuple[float, float]:
    """Width and height of ``2500x1250``."""
    width, height = (float(side) for side in text.lower().split("x"))
    if width <= 0 or height <= 0:
        detail = f"Both sides of the sheet must be greater than 0, not {text}."
        raise bad_parameters(detail, [("sheet", detail)])
    return width, height


def _timing(job: Job) -> dict[str, str]:
    """Server-Timing: milliseconds per stage and where it came from."""
    entries = [
        f'{stage};dur={seconds * 1000:.1f};desc="{job.found.get(stage, "computed")}"'
        for stage, seconds in job.timings.items()
    ]
    return {"Server-Timing": ", ".join(entries)} if entries else {}


async def _events(manager: JobManager, id: str) -> AsyncIterator[bytes]:
    """The job as it changes; of an exploration, each variant when it is foreseen, and when it is measured."""
    found, sent = manager.found(id), 0
    async for job in manager.changes(id, HEARTBEAT):
        while sent < len(found):
            index, variant = found[sent]
            sent += 1
            yield _event("variant", {"index": index, "variant": variant})
        if job is None:
            yield b": still here\n\n"
        else:
            yield _event(job.status if job.is_over else "progress", manager.document(job))


def _event(name: str, data: object) -> bytes:
    return b"event: %s\ndata: %s\n\n" % (name.encode(), dumped(data))
