"""Hops: the same work for Rhino's own component, without a script on the canvas.

``GET /hops/panels`` describes a component, ``POST /solve`` runs whichever the body's ``pointer`` names; this
is the protocol of Rhino Compute. Only answers with status 200 are kept by Hops, so errors are 500.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastapi import APIRouter, Request
from starlette.responses import Response

from hexwrap_server.errors import HopsError, JobFailedError
from hexwrap_server.http.answers import json_response
from hexwrap_server.http.bodies import sent_body
from hexwrap_server.http.hops.components import COMPONENTS, LIFT, PANELS
from hexwrap_server.http.service import Service
from hexwrap_server.jobs.store import Job
from hexwrap_solver.errors import HexwrapError

if TYPE_CHECKING:  # reading geometry is left to a worker; this process need not load what it takes
    from hexwrap_server.http.hops.calls import Call

#: Hops itself gives up after 100 seconds.
PATIENCE = 90.0


router = APIRouter(tags=["hops"], include_in_schema=False)


@router.get(PANELS)
async def describe_panels() -> Response:
    return json_response(COMPONENTS[PANELS].document())


@router.get(LIFT)
async def describe_lift() -> Response:
    return json_response(COMPONENTS[LIFT].document())


@router.post("/solve")
async def solve(request: Request) -> Response:
    try:
        return await _solve(request)
    except HexwrapError as error:
        return json_response({"values": [], "errors": [error.detail], "warnings": []}, 500)


async def _solve(request: Request) -> Response:
    service: Service = request.app.state.service
    async with sent_body(request) as body:
        call: Call = await service.read(
            "hexwrap_server.http.hops.calls:read_call", body, str(service.store.surfaces)
        )
    if call.request is None:
        job = _finished(service.manager.get(call.job))
    else:
        sent = await service.manager.submit(call.request)
        job = _finished(await service.manager.wait(sent.id, PATIENCE))
    step = "panels_answer" if call.request else "lift_answer"
    path = str(service.store.solution_path(job.identity))
    return json_response(await service.errand(f"hexwrap_server.http.hops.calls:{step}", path, call, job.id))


def _finished(job: Job) -> Job:
    """Raises HopsError unless the job is done."""
    if job.status == "done":
        return job
    if job.status == "failed" and job.problem:
        raise JobFailedError(job.problem)
    raise HopsError(f"The job is {job.status}. Recompute to see whether it is done; it goes on meanwhile.")
