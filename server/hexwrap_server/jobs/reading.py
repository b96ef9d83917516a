"""Bodies and files → requests and surfaces; points to lift and flatten. Runs in a process under the limits of
reading."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import orjson

from hexwrap_server.input.bodies import Body
from hexwrap_server.input.json_text import loads
from hexwrap_server.input.requests import (
    CacheSettings,
    Exploration,
    Intake,
    ParsedRequest,
    SentSurface,
    Wanted,
)
from hexwrap_server.input.schemas import (
    Request,
    parse_exploration,
    parse_points,
    parse_request,
    parse_surface,
)
from hexwrap_server.input.surface_files import FromFile
from hexwrap_server.input.uploads import sent_file
from hexwrap_server.jobs import codec
from hexwrap_server.jobs.cache import CachingRunner
from hexwrap_server.jobs.disk import keep_file, surface_file
from hexwrap_server.jobs.work import solution_at, stages, take_in
from hexwrap_server.jobs.worker import Report
from hexwrap_server.output import wire
from hexwrap_server.output.unrolled import in_pieces
from hexwrap_server.problems import body_is_the_surface
from hexwrap_server.settings import Settings
from hexwrap_solver import domain


def read_request(
    report: Report, body: Body, settings: Settings, folder: str, explore: bool = False
) -> ParsedRequest:
    """JSON → request, or what to explore. folder: where its surface is kept. Raises FormError, HttpError,
    StorageError."""
    document = loads(body.plain(settings.max_body_mib))
    parse = parse_exploration if explore else parse_request
    return kept(parse(document, settings.max_vertices, settings.max_panels), folder)


def kept(request: Request[Wanted] | Request[Exploration], folder: str) -> ParsedRequest:
    """The request, its surface written into folder and known by its content. Raises StorageError."""
    if isinstance(request.surface, str):
        return ParsedRequest(request.name, request.surface, request.wanted)
    return ParsedRequest(request.name, _keep(request.surface, folder), request.wanted)


@body_is_the_surface()
def read_surface(
    report: Report, body: Body, settings: Settings, folder: str, caching: CacheSettings
) -> Intake:
    """JSON → checked surface. Raises FormError, HttpError, SurfaceError, StorageError."""
    sent = parse_surface(loads(body.plain(settings.max_body_mib)), settings.max_vertices)
    return _checked(report, sent, folder, caching)


@body_is_the_surface(is_file=True)
def read_upload(
    report: Report,
    body: Body,
    settings: Settings,
    folder: str,
    caching: CacheSettings,
    content_type: str,
    name: str,
) -> Intake:
    """A file sent raw (with its name) or in a form → checked surface, with the objects of the file.

    Fields of the form choose among these, as ``surface.object`` and the like do. Raises UploadError,
    HttpError, SurfaceError, StorageError.
    """
    read = _file(body, settings, content_type, name)
    intake = _checked(report, read.sent, folder, caching)
    return replace(intake, answer=intake.answer | {"objects": read.objects})


@body_is_the_surface(is_file=True)
def preview(report: Report, body: Body, settings: Settings, content_type: str, name: str) -> bytes:
    """Vertices and faces of a file as JSON, unchecked. Raises UploadError, HttpError, SurfaceError."""
    sent = _file(body, settings, content_type, name).sent
    if sent.mesh is None:
        meshed = take_in(sent)
        vertices, faces = meshed.vertices, meshed.faces.tolist()
    else:
        vertices, faces = sent.mesh.vertices, sent.mesh.faces.to_lists()
    return orjson.dumps({"vertices": vertices, "faces": faces}, option=orjson.OPT_SERIALIZE_NUMPY)


def lift(report: Report, body: Body, settings: Settings, path: str) -> bytes:
    """Points of the unrolled domain → JSON answer of the lift route. path: of the solution.

    Raises FormError, HttpError, GoneError.
    """
    at = parse_points(loads(body.plain(settings.max_body_mib)), 2, settings.max_points)
    lifted = domain.lift(in_pieces(solution_at(path)).map, at[:, 0] + 1j * at[:, 1])
    return wire.dump({"points": lifted.points, "normals": lifted.normals, "inside": lifted.inside})


def flatten(report: Report, body: Body, settings: Settings, path: str) -> bytes:
    """Points near the surface → JSON answer of the flatten route. As ``lift``."""
    at = parse_points(loads(body.plain(settings.max_body_mib)), 3, settings.max_points)
    flat = domain.flatten(in_pieces(solution_at(path)).map, at)
    return wire.dump({"uv": flat.uv, "distance": flat.distance})


def _file(body: Body, settings: Settings, content_type: str, name: str) -> FromFile:
    data = body.plain(settings.max_body_mib)
    return sent_file(data, content_type, name, settings.max_vertices, settings.max_body_mib)


def _checked(report: Report, sent: SentSurface, folder: str, caching: CacheSettings) -> Intake:
    runner = CachingRunner(stages(caching), report)
    surface = runner("surface", (codec.digest(sent), None), lambda progress: take_in(sent))
    loops = [surface.input_vertex[loop].tolist() for loop in surface.loops]
    answer = {
        "vertices": len(surface.vertices),
        "faces": len(surface.faces),
        "loops": loops,
        "repairs": list(surface.repairs),
        "unit": surface.unit,
        "objects": [],
    }
    return Intake(_keep(sent, folder), answer)


def _keep(sent: SentSurface, folder: str) -> str:
    """The id of the surface, which is on disk from now on."""
    id = codec.digest(sent)
    keep_file(surface_file(Path(folder), id), codec.encode(sent))
    return id
