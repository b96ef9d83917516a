"""What is packed on the way out, for whom, and what never is."""

from __future__ import annotations

import asyncio
import gzip
from collections.abc import AsyncIterator, Iterator

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from hexwrap_server.http.compressed import Compressed
from tests.server.bodies import request
from tests.server.live import Live, finished, running


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with running(tmp_path_factory.mktemp("data"), workers=1) as live:
        yield live


@pytest.fixture(scope="module")
def done(client: Live) -> str:
    """Id of a finished job."""
    id: str = client.post("/v1/jobs", json=request()).json()["id"]
    assert finished(client, id)["status"] == "done"
    return id


@pytest.mark.parametrize(
    ("accepted", "packed"),
    [
        *(("gzip", True), ("GZIP; Q=0.5", True), ("*", True), ("br, *;q=0.1", True), ("*;q=0, gzip", True)),
        *(("deflate, br", False), ("", False), ("gzip;q=0", False), ("identity, gzip; q=0.0", False)),
        *(("gzip;q=0, *", False), ("*, gzip;q=0.000", False), ("gzip;q=few", False), ("gzip;q=nan", False)),
    ],
)
@pytest.mark.parametrize(
    "path",
    [
        *("/openapi.json", "/docs", "/static/app.js", "/v1/samples/tower"),
        *("/v1/jobs/{}/result", "/v1/jobs/{}/result?include=mesh", "/v1/jobs/{}/files/panels.csv"),
    ],
)
def test_answers_are_packed_for_those_who_take_it(
    client: Live, done: str, path: str, accepted: str, packed: bool
) -> None:
    with client.stream("GET", path.format(done), headers={"Accept-Encoding": accepted}) as answer:
        sent = b"".join(answer.iter_raw())
    assert (answer.headers.get("content-encoding") == "gzip") is packed
    assert answer.headers["vary"].lower().split(", ").count("accept-encoding") == 1
    if "content-length" in answer.headers:
        assert int(answer.headers["content-length"]) == len(sent)
    plain = client.get(path.format(done), headers={"Accept-Encoding": "identity"}).content
    assert (gzip.decompress(sent) if packed else sent) == plain


def test_events_are_never_packed(client: Live, done: str) -> None:
    answer = client.get(f"/v1/jobs/{done}/events", headers={"Accept-Encoding": "gzip"})
    assert "content-encoding" not in answer.headers


# --- the middleware by itself ----------------------------------------------------------------------------


async def stream(request: Request) -> Response:
    """Pieces of the sizes in the query, as the type in the query."""

    async def pieces() -> AsyncIterator[bytes]:
        for size in request.query_params.getlist("size"):
            yield b"x" * int(size)

    return StreamingResponse(pieces(), media_type=request.query_params.get("type", "text/plain"))


async def whole(request: Request) -> Response:
    size, status = (int(request.query_params[name]) for name in ("size", "status"))
    return Response(b"x" * size, status)


def asked(path: str) -> httpx.Response:
    app = Compressed(Starlette(routes=[Route("/stream", stream), Route("/whole", whole)]))

    async def ask() -> httpx.Response:
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test") as client:
            return await client.get(path)

    return asyncio.run(ask())


@pytest.mark.parametrize("sizes", [[1], [1, 0, 2000], [200_000, 5, 200_000], []])
def test_streams_are_packed_piece_by_piece(sizes: list[int]) -> None:
    answer = asked("/stream?" + "&".join(f"size={size}" for size in sizes))
    assert answer.content == b"x" * sum(sizes)
    assert answer.headers.get("content-encoding") == ("gzip" if sizes else None)
    assert "content-length" not in answer.headers


def test_streams_of_events_pass_as_they_are() -> None:
    answer = asked("/stream?size=5000&size=5000&type=text/event-stream")
    assert (len(answer.content), answer.headers.get("content-encoding")) == (10_000, None)


@pytest.mark.parametrize(("size", "status"), [(1000, 200), (5000, 206), (0, 204), (0, 304)])
def test_small_answers_and_parts_pass_as_they_are(size: int, status: int) -> None:
    answer = asked(f"/whole?size={size}&status={status}")
    assert (len(answer.content), answer.headers.get("content-encoding")) == (size, None)
