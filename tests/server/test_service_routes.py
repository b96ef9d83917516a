"""The contract's routes, against a real server."""

from __future__ import annotations

import asyncio
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import ezdxf.filemanagement
import httpx
import numpy as np
import pytest
from ezdxf.entities import LWPolyline
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_server.input import json_text
from hexwrap_server.jobs import reading
from hexwrap_server.jobs.engine import nobody
from tests.server.bodies import request, tube
from tests.server.live import Live, finished, running
from tests.server.patience import PATIENCE, until


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with running(tmp_path_factory.mktemp("data"), workers=1) as live:
        yield live


@pytest.fixture(scope="module")
def done(client: Live) -> str:
    """Id of a finished job."""
    id: str = client.post("/v1/jobs", json=request(name="tower")).json()["id"]
    assert finished(client, id)["status"] == "done"
    return id


def test_health_tells_version_and_load(client: Live) -> None:
    answer = client.get("/health")
    assert answer.json()["status"] == "ok"
    assert {"version", "workers", "queued", "running"} <= answer.json().keys()
    assert answer.headers["server"].startswith("hexwrap/")


@pytest.mark.parametrize(
    "path",
    [
        *("/health", "/ready", "/metrics", "/openapi.json", "/", "/docs", "/v1/jobs", "/v1/jobs/none"),
        *("/v1/jobs/{}", "/v1/jobs/{}/result", "/v1/jobs/{}/result?include=sizes"),
        "/v1/jobs/{}/files/panels.csv",
    ],
)
def test_head_is_get_without_the_body(client: Live, done: str, path: str) -> None:
    full, head = (client.request(method, path.format(done)) for method in ("GET", "HEAD"))
    assert (head.status_code, head.content) == (full.status_code, b"")
    assert full.content
    differing = {"date"} | ({"content-length"} if path in ("/health", "/metrics", "/ready") else set())
    for name in set(full.headers) - differing:
        assert head.headers[name] == full.headers[name], name


def test_head_of_events_does_not_wait(client: Live, done: str) -> None:
    full, answer = (client.request(method, f"/v1/jobs/{done}/events") for method in ("GET", "HEAD"))
    assert (answer.status_code, answer.content) == (200, b"")
    assert answer.headers["content-type"].startswith("text/event-stream")
    assert answer.headers.keys() == full.headers.keys()
    assert client.head("/v1/solve").status_code == 405


def test_job_is_accepted_with_its_address(client: Live) -> None:
    answer = client.post("/v1/jobs", json=request(pattern={"around": 10}))
    assert answer.status_code == 202
    assert answer.headers["location"] == f"/v1/jobs/{answer.json()['id']}"
    job = finished(client, answer.json()["id"])
    assert job["status"] == "done"
    assert job["progress"] == 1.0
    assert job["timings"].keys() >= {"surface", "map", "pattern", "panels", "quality"}


def test_result_has_every_part_and_the_parts_agree(client: Live, done: str) -> None:
    result = client.get(f"/v1/jobs/{done}/result").json()
    assert {"mesh", "map", "pattern", "panels", "sizes", "quality"} <= result.keys()
    n, m = len(result["mesh"]["vertices"]), len(result["mesh"]["faces"])
    assert np.shape(result["map"]["uv"]) == (n, 2)
    assert np.shape(result["map"]["sheet"]) == (m, 3)
    panels = result["panels"]
    assert set(panels.pop("outside")) <= set(range(len(panels["polygons"])))
    assert {len(v) for v in panels.values() if isinstance(v, list)} == {len(panels["polygons"])}
    assert sum(size["count"] for size in result["sizes"]) == len(panels["polygons"])
    assert len(set(panels["label"])) == len(panels["label"])
    assert result["quality"]["overlaps"] == 0


def test_corners_of_faces_have_the_scaled_lengths(client: Live, done: str) -> None:
    """The contract's reading of uv, sheet and deck: e^{(u_i+u_j)/2} l_ij is measured in the plane."""
    result = client.get(f"/v1/jobs/{done}/result", params={"include": "mesh,map"}).json()
    vertices, faces = np.array(result["mesh"]["vertices"]), np.array(result["mesh"]["faces"])
    uv = np.array(result["map"]["uv"]) @ [1, 1j]
    deck = result["map"]["deck"]
    assert deck["angle"] == 0
    corners = uv[faces] + np.array(result["map"]["sheet"]) * complex(*deck["translation"])
    u = np.array(result["map"]["log_scale"])[faces]
    scale = np.exp((u + np.roll(u, -1, 1)) / 2)
    length = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, -1, 1)], axis=2)
    assert np.allclose(np.abs(corners - np.roll(corners, -1, 1)), scale * length, rtol=1e-7)


def test_include_picks_parts(client: Live, done: str) -> None:
    full = client.get(f"/v1/jobs/{done}/result").json()
    some = client.get(f"/v1/jobs/{done}/result", params={"include": "sizes,map"}).json()
    assert some == {"map": full["map"], "sizes": full["sizes"]}
    solved = client.post("/v1/solve", params={"include": "sizes,map"}, json=request(name="tower"))
    assert solved.json() == some
    assert client.get(solved.headers["content-location"]).json() == some
    wrong = client.get(f"/v1/jobs/{done}/result", params={"include": "sizes,mops"})
    assert wrong.status_code == 422
    assert wrong.json()["errors"][0]["parameter"] == "include"


def test_solve_answers_with_the_result_itself(client: Live, done: str) -> None:
    answer = client.post("/v1/solve", json=request(name="tower"))
    assert answer.status_code == 200
    assert answer.json() == client.get(f"/v1/jobs/{done}/result").json()
    assert answer.json() == client.get(answer.headers["content-location"]).json()


@pytest.mark.parametrize(
    ("left_out", "parts"),
    [({"panels": None}, ("panels",)), ({"pattern": None}, ("pattern", "panels"))],
)
def test_null_stops_after_a_stage(client: Live, left_out: dict[str, None], parts: tuple[str, ...]) -> None:
    result = client.post("/v1/solve", json=request(**left_out)).json()
    assert all(result[part] is None for part in parts)
    assert result["quality"]["scale_ratio"] >= 1
    assert result["quality"]["overlaps"] is result["quality"]["coverage"] is None  # nothing was measured


def test_surface_is_sent_once_and_named_afterwards(client: Live) -> None:
    answer = client.post("/v1/surfaces", json=tube())
    assert answer.status_code == 201
    known = answer.json()
    assert (known["vertices"], known["faces"], len(known["loops"])) == (240, 432, 2)
    by_id = client.post("/v1/solve", json={"surface": {"id": known["id"]}, "pattern": {"around": 12}})
    assert by_id.json() == client.post("/v1/solve", json=request()).json()


def test_jobs_are_listed_newest_first(client: Live, done: str) -> None:
    newer = client.post("/v1/jobs", json=request(name="newer")).json()["id"]
    listed = [job["id"] for job in client.get("/v1/jobs", params={"limit": 1000}).json()["jobs"]]
    assert listed.index(newer) < listed.index(done)
    assert len(client.get("/v1/jobs", params={"limit": 1}).json()["jobs"]) == 1


def test_events_end_with_how_the_job_ended(client: Live) -> None:
    id = client.post("/v1/jobs", json=request(pattern={"around": 14})).json()["id"]
    with client.stream("GET", f"/v1/jobs/{id}/events") as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        lines = list(stream.iter_lines())
    names = [line.removeprefix("event: ") for line in lines if line.startswith("event: ")]
    assert names[-1] == "done"
    assert set(names[:-1]) == {"progress"}


def test_finished_job_is_forgotten(client: Live) -> None:
    id = client.post("/v1/jobs", json=request(name="short-lived")).json()["id"]
    finished(client, id)
    assert client.delete(f"/v1/jobs/{id}").status_code == 204
    assert client.get(f"/v1/jobs/{id}").status_code == 404


@pytest.mark.parametrize(
    ("method", "path", "status", "slug"),
    [
        ("GET", "/nowhere", 404, "not-found"),
        ("PUT", "/v1/jobs", 405, "method-not-allowed"),
        ("GET", "/v1/jobs/unknown", 404, "not-found"),
        ("DELETE", "/v1/jobs/unknown", 404, "not-found"),
        ("GET", "/v1/jobs/unknown/events", 404, "not-found"),
        ("GET", "/v1/jobs?limit=0", 422, "invalid-request"),
        ("GET", "/v1/jobs/unknown?wait=nan", 422, "invalid-request"),
        ("GET", "/v1/jobs/unknown/files/panels.exe", 404, "not-found"),
        ("GET", "/v1/jobs/../../etc/passwd", 404, "not-found"),
    ],
)
def test_refusals_are_problems(client: Live, method: str, path: str, status: int, slug: str) -> None:
    answer = client.request(method, path)
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["type"] == f"/problems/{slug}"
    assert answer.json()["status"] == status


@pytest.mark.parametrize(
    ("method", "path", "allowed"),
    [
        ("PUT", "/v1/jobs", "GET, HEAD, POST"),
        ("PUT", "/v1/jobs/x", "DELETE, GET, HEAD"),
        ("INVENTED", "/v1/jobs/x/result", "GET, HEAD"),
        ("GET", "/v1/solve", "POST"),
        ("POST", "/docs", "GET, HEAD"),
        ("POST", "/openapi.json", "GET, HEAD"),
        ("POST", "/static/app.js", "GET, HEAD"),
        ("DELETE", "/v1/surfaces/preview", "POST"),
        ("GET", "/solve", "POST"),
    ],
)
def test_allow_names_every_method_of_a_path(client: Live, method: str, path: str, allowed: str) -> None:
    answer = client.request(method, path)
    assert (answer.status_code, answer.headers["allow"]) == (405, allowed)
    for other in allowed.split(", "):
        assert client.request(other, path).status_code != 405


def test_half_characters_are_told(client: Live) -> None:
    answer = client.post("/v1/jobs", content=b'{"surface": {"\\ud800": [NaN]}}')
    assert (answer.status_code, answer.json()["errors"][0]["pointer"]) == (422, "/surface/?/0")


def test_unsolvable_surface_is_a_problem_with_its_faults(client: Live) -> None:
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1]]
    fin = {"vertices": corners, "faces": [[0, 1, 2], [0, 1, 3], [0, 1, 4]]}
    id = client.post("/v1/jobs", json={"surface": fin}).json()["id"]
    job = finished(client, id)
    assert job["status"] == "failed"
    answer = client.get(f"/v1/jobs/{id}/result")
    assert answer.status_code == 422
    assert answer.json() == job["problem"] == client.post("/v1/solve", json={"surface": fin}).json()
    assert client.post("/v1/surfaces", json=fin).json()["type"] == job["problem"]["type"]


@pytest.mark.parametrize(
    "name", ["panels.obj", "panels.3dm", "panels.dxf", "panels.csv", "flat.dxf", "domain.svg", "result.npz"]
)
def test_files_are_written(client: Live, done: str, name: str) -> None:
    answer = client.get(f"/v1/jobs/{done}/files/{name}")
    assert answer.status_code == 200
    assert answer.headers["content-disposition"] == f'attachment; filename="{name}"'
    assert len(answer.content) > 1000


def test_sheets_of_flat_drawings_have_the_size_asked_for(client: Live, done: str) -> None:
    path = f"/v1/jobs/{done}/files/flat.dxf"
    drawing = ezdxf.filemanagement.read(io.StringIO(client.get(path, params={"sheet": "9x7.5"}).text))
    rim = drawing.modelspace().query('LWPOLYLINE[layer=="sheets"]').first
    assert isinstance(rim, LWPolyline)
    assert [tuple(p) for p in rim.get_points("xy")] == [(0, 0), (9, 0), (9, 7.5), (0, 7.5)]
    for sheet in ("", "9", "x", "9x", "-9x7", "0x7", "9x7x5", "nanxinf", "1e9x5", "٣x٤"):
        answer = client.get(path, params={"sheet": sheet})
        assert (answer.status_code, answer.json()["errors"][0]["parameter"]) == (422, "sheet"), sheet
    small = client.get(path, params={"sheet": "0.01x0.01"})
    assert (small.status_code, small.json()["type"]) == (422, "/problems/sheet")


def test_result_file_is_the_result(client: Live, done: str) -> None:
    file = client.get(f"/v1/jobs/{done}/files/result.json")
    assert file.json() == client.get(f"/v1/jobs/{done}/result").json()


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/v1/surfaces", b"{}"),
        ("/v1/surfaces?name=a.obj", b"v 0 0 0"),
        ("/v1/jobs/{}/lift", b'{"points": [[1, 2, 3]]}'),
        ("/v1/jobs", b"{}"),
        ("/v1/solve", b"[1e999]"),
        ("/solve", b"{}"),
    ],
)
def test_no_body_is_read_in_the_server_itself(
    client: Live, done: str, monkeypatch: pytest.MonkeyPatch, path: str, body: bytes
) -> None:
    def not_here(*ignored: object) -> None:
        raise AssertionError("it holds the interpreter")

    for name in ("loads", "parse_request", "parse_surface", "sent_file"):
        monkeypatch.setattr(reading, name, not_here)
    monkeypatch.setattr(json_text, "orjson", None)
    answer = client.post(path.format(done), content=body)
    assert answer.status_code in (400, 422, 500)
    assert "AssertionError" not in answer.text
    assert "AttributeError" not in answer.text


def test_small_bodies_do_not_wait_for_large_ones_and_files(client: Live, tmp_path: Path) -> None:
    """All readers are at something that does not end."""
    service = client.service

    async def occupy() -> None:
        for i in range(service.settings.readers):
            call = service.readers.run(
                "tests.server.calls:sleep", 3600, str(tmp_path / f"{i}"), report=nobody, seconds=1e6, mib=1e6
            )
            tasks.append(asyncio.create_task(call))

    async def free() -> None:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    tasks: list[asyncio.Task[Any]] = []
    client.run(occupy())
    try:
        until(lambda: len(list(tmp_path.iterdir())) == service.settings.readers, "all readers")
        assert client.post("/v1/solve", json=request(pattern={"around": 9})).status_code == 200
        with pytest.raises(httpx.ReadTimeout):
            client.post(
                "/v1/surfaces",
                params={"name": "a.obj"},
                content=b"v 0 0 0",
                timeout=httpx.Timeout(PATIENCE, read=0.3),
            )
    finally:
        client.run(free())
    assert client.post("/v1/surfaces", params={"name": "a.obj"}, content=b"v 0 0 0").status_code == 422


def test_drawings_are_carried_to_the_surface_and_back(client: Live, done: str) -> None:
    result = client.get(f"/v1/jobs/{done}/result", params={"include": "map,mesh"}).json()
    uv = np.array(result["map"]["uv"])
    turn = np.array(result["map"]["deck"]["translation"])
    inner = np.setdiff1d(np.arange(len(uv)), np.concatenate(result["mesh"]["loops"]))
    lifted = client.post(f"/v1/jobs/{done}/lift", json={"points": (uv[inner] + 3 * turn).tolist()}).json()
    assert all(lifted["inside"])
    assert np.allclose(lifted["points"], np.array(result["mesh"]["vertices"])[inner], atol=1e-9)
    assert np.allclose(np.linalg.norm(lifted["normals"], axis=1), 1)
    back = client.post(f"/v1/jobs/{done}/flatten", json={"points": lifted["points"]}).json()
    assert np.allclose(back["distance"], 0, atol=1e-9)
    turns = (np.array(back["uv"]) - uv[inner]) @ turn / (turn @ turn)
    assert np.allclose(turns, np.round(turns), atol=1e-9)


def test_points_outside_are_told(client: Live, done: str) -> None:
    answer = client.post(f"/v1/jobs/{done}/lift", json={"points": [[0.0, 1e6]]}).json()
    assert answer == {"points": [[None] * 3], "normals": [[None] * 3], "inside": [False]}
    for route in ("lift", "flatten"):
        assert client.post(f"/v1/jobs/{done}/{route}", json={"points": []}).status_code == 200
    wrong = client.post(f"/v1/jobs/{done}/lift", json={"points": [[0, 1, 2]]})
    assert (wrong.status_code, wrong.json()["errors"][0]["pointer"]) == (422, "/points/0")


@pytest.mark.parametrize(
    "boundary",
    [
        {"mode": "straight"},
        {
            "mode": "angles",
            "angle_unit": "deg",
            "quantum": "none",
            "angles": [{"vertex": 0, "angle": 120}, {"vertex": 239, "angle": 240}],
        },
    ],
    ids=("cylinder", "cone"),
)
def test_points_anywhere_are_answered(client: Live, boundary: dict[str, object]) -> None:
    """Any finite numbers, the largest ones too: a place, or that there is none."""
    id = client.post("/v1/jobs", json=request(boundary=boundary, pattern=None)).json()["id"]
    assert finished(client, id)["status"] == "done"
    numbers = st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(10**40), 10**40)

    @settings(max_examples=60, deadline=None, derandomize=True)
    @given(st.lists(st.tuples(numbers, numbers, numbers), max_size=8))
    def answered(points: list[tuple[float, float, float]]) -> None:
        flat = client.post(f"/v1/jobs/{id}/flatten", json={"points": points})
        assert flat.status_code == 200, flat.text
        assert np.isfinite(np.array(flat.json()["uv"])).all()
        assert len(flat.json()["distance"]) == len(points)
        assert all(isinstance(distance, float) for distance in flat.json()["distance"])
        lifted = client.post(f"/v1/jobs/{id}/lift", json={"points": [point[:2] for point in points]})
        assert lifted.status_code == 200, lifted.text
        for inside, place in zip(lifted.json()["inside"], lifted.json()["points"], strict=True):
            assert (place == [None] * 3) is not inside

    answered()
