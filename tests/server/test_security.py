"""Closed to strangers, and to bodies that are too much."""

from __future__ import annotations

import gzip
import json
import socket
import zlib
from collections.abc import Iterator

import httpx
import numpy as np
import pytest

from hexwrap_server.http.security import host_name
from hexwrap_server.input.bodies import Body
from tests.server.bodies import request, tube
from tests.server.live import Live, finished, running
from tests.server.patience import PATIENCE


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    data = tmp_path_factory.mktemp("data")
    with running(data, workers=1, max_body_mib=0.5, max_vertices=500, max_panels=2000, max_points=10) as live:
        yield live


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:6789", "127.0.0.1.evil.example", "", "169.254.0.1"]
)
def test_foreign_host_names_are_refused(client: Live, host: str) -> None:
    answer = client.get("/health", headers={"Host": host})
    assert answer.status_code in (400, 421)
    if host:
        assert answer.json()["type"] == "/problems/host-not-allowed"


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:6789", "127.0.0.1:80", "[::1]:6789"])
def test_loopback_names_pass(client: Live, host: str) -> None:
    assert client.get("/health", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Origin": "http://[::1"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
)
def test_other_sites_cannot_change_anything(client: Live, headers: dict[str, str]) -> None:
    answer = client.post("/v1/jobs", json=request(), headers=headers)
    assert (answer.status_code, answer.json()["type"]) == (403, "/problems/cross-site")
    assert client.delete("/v1/jobs/x", headers=headers).status_code == 403
    assert client.get("/health", headers=headers).status_code == 200
    assert "access-control-allow-origin" not in client.get("/health", headers=headers).headers


def test_own_pages_pass(client: Live) -> None:
    own = str(client.base_url).rstrip("/")
    answer = client.delete("/v1/jobs/x", headers={"Origin": own, "Sec-Fetch-Site": "same-origin"})
    assert answer.status_code == 404


@pytest.mark.parametrize(
    ("host", "name"), [("a:1", "a"), ("[::1]:6789", "[::1]"), ("[::1]", "[::1]"), ("", ""), (":5", "")]
)
def test_names_in_host_headers(host: str, name: str) -> None:
    assert host_name(host) == name


def test_declared_size_is_refused_before_reading(client: Live) -> None:
    address = (client.base_url.host, client.base_url.port or 80)
    with socket.create_connection(address, timeout=PATIENCE) as wire:
        wire.sendall(b"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1099511627776\r\n\r\n")
        answer = b"".join(iter(lambda: wire.recv(65536), b""))
    assert answer.startswith(b"HTTP/1.1 413")
    assert b"/problems/body-too-large" in answer


def test_streamed_size_is_refused(client: Live) -> None:
    def endless() -> Iterator[bytes]:
        for _ in range(100):
            yield b" " * 65536

    try:
        answer = client.post("/v1/jobs", content=endless())
    except (httpx.WriteError, httpx.RemoteProtocolError):  # the server had heard enough
        return
    assert answer.status_code == 413


def test_gzip_bombs_are_refused(client: Live) -> None:
    bomb = gzip.compress(b" " * 20_000_000, 9)
    assert len(bomb) < 250_000
    answer = client.post("/v1/jobs", content=bomb, headers={"Content-Encoding": "gzip"})
    assert (answer.status_code, answer.json()["type"]) == (413, "/problems/body-too-large")


def test_gzip_goes_both_ways(client: Live) -> None:
    plain = json.dumps(request()).encode()
    halves = gzip.compress(plain[:5000]) + gzip.compress(plain[5000:])
    answer = client.post("/v1/solve", content=halves, headers={"Content-Encoding": "gzip"})
    assert answer.status_code == 200
    assert answer.headers["content-encoding"] == "gzip"
    bare = client.post("/v1/solve", content=plain, headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in bare.headers
    assert bare.json() == answer.json()


@pytest.mark.parametrize(
    ("sizes", "padding"),
    [((70_000, 0, 5, 200_000), b""), ((3,), b"\0" * 200_000), ((0, 0, 9), b"\0" * 70_000)],
)
def test_members_of_every_size_are_unpacked(sizes: tuple[int, ...], padding: bytes) -> None:
    parts = [np.random.default_rng(size).bytes(size) for size in sizes]
    packed = b"".join(gzip.compress(part) + padding for part in parts)
    assert Body(packed, "gzip").plain(1.0) == b"".join(parts) == gzip.decompress(packed)


def test_known_bytes_are_read_again_when_they_are_said_to_be_packed(client: Live) -> None:
    plain = json.dumps(request()).encode()
    assert client.post("/v1/solve", content=plain).status_code == 200
    answer = client.post("/v1/solve", content=plain, headers={"Content-Encoding": "gzip"})
    assert (answer.status_code, answer.json()["type"]) == (400, "/problems/not-gzip")


@pytest.mark.parametrize(
    ("body", "encoding", "status"),
    [
        (b"not gzip", "gzip", 400),
        (gzip.compress(b"{}", mtime=0)[:-6], "gzip", 400),
        (gzip.compress(b"{}", mtime=0) + b"rest", "gzip", 400),
        (zlib.compress(b"{}"), "deflate", 415),
        (b"{}", "br", 415),
        (b"", "identity", 400),
        (b"{", "identity", 400),
        (b"\xff\xfe", "identity", 400),
        (b'{"surface": NaN}', "identity", 400),
        (b"[" * 100_000, "identity", 400),
    ],
)
def test_broken_bodies_are_refused(client: Live, body: bytes, encoding: str, status: int) -> None:
    answer = client.post("/v1/jobs", content=body, headers={"Content-Encoding": encoding})
    assert answer.status_code == status
    assert answer.json()["status"] == status


def test_limits_of_counts_are_told(client: Live) -> None:
    answer = client.post("/v1/jobs", json={"surface": tube(40, 20)})
    assert answer.status_code == 422
    assert "at most 500" in answer.json()["detail"]
    many = client.post("/v1/solve", json=request(pattern={"around": 100}))
    assert (many.status_code, many.json()["limit"]) == (422, 2000)


@pytest.mark.parametrize(("route", "point"), [("lift", [0, 0]), ("flatten", [0, 0, 0])])
def test_limit_of_points_is_told(client: Live, route: str, point: list[float]) -> None:
    id = client.post("/v1/jobs", json=request()).json()["id"]
    assert finished(client, id)["status"] == "done"
    most = client.post(f"/v1/jobs/{id}/{route}", json={"points": [point] * 10})
    assert most.status_code == 200
    more = client.post(f"/v1/jobs/{id}/{route}", json={"points": [point] * 11})
    assert (more.status_code, more.json()["errors"][0]["pointer"]) == (422, "/points")
    assert "at most 10" in more.json()["detail"]


@pytest.mark.parametrize(
    "id",
    ["../../etc/passwd", "a" * 64, "..", "0" * 63 + "/", "x.surface", "../evil", "evil", "../surfaces/evil"],
)
def test_ids_open_no_paths(client: Live, id: str) -> None:
    surfaces = client.service.store.surfaces
    for folder in (surfaces, surfaces.parent):  # they would be found if only the path were looked at
        (folder / "evil.surface").write_bytes(b"")
    answer = client.post("/v1/jobs", json={"surface": {"id": id}})
    assert (answer.status_code, answer.json()["errors"][0]["pointer"]) == (422, "/surface/id")


def test_token_is_asked_of_everybody(tmp_path_factory: pytest.TempPathFactory) -> None:
    with running(tmp_path_factory.mktemp("data"), workers=1, token="secret") as client:
        assert client.get("/health").status_code == 200
        wrongs = [b"Bearer guess", b"Basic secret", b"Bearer", "Bearer secr\u00e9t".encode(), b"Bearer \xe9"]
        for wrong in ({}, *({"Authorization": said} for said in wrongs)):
            answer = client.get("/v1/jobs", headers=wrong)
            assert (answer.status_code, answer.headers["www-authenticate"]) == (401, "Bearer")
        assert client.get("/v1/jobs", headers={"Authorization": "Bearer secret"}).status_code == 200
        plain = {"Authorization": "bearer   secret"}
        assert client.get("/v1/jobs", headers=plain).status_code == 200
        # the page must load to be able to ask for the token; it holds no secrets
        assert client.get("/").status_code == client.get("/static/app.js").status_code == 200
