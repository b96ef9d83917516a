"""What the page asks besides the contract's routes."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi, sin

import pytest

from hexwrap_server import samples
from tests.server.bodies import request
from tests.server.live import Live, finished, running


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with running(tmp_path_factory.mktemp("page"), workers=1) as client:
        yield client


def test_the_page_loads_only_what_the_server_serves(live: Live) -> None:
    page = live.get("/")
    assert page.status_code == 200
    assert "default-src 'self'" in page.headers["content-security-policy"]
    for name in ("app.js", "app.css", "icon.svg"):
        assert f"/static/{name}" in page.text
        assert live.get(f"/static/{name}").status_code == 200


def test_samples_are_listed_and_complete(live: Live) -> None:
    listed = [entry["name"] for entry in live.get("/v1/samples").json()["samples"]]
    assert listed == samples.names()
    assert live.get("/v1/samples/tower").json() == samples.load("tower")


def test_an_unknown_sample_is_a_problem_that_names_those_there_are(live: Live) -> None:
    answer = live.get("/v1/samples/castle")
    assert (answer.status_code, answer.headers["content-type"]) == (404, "application/problem+json")
    assert "tower" in answer.json()["detail"]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"pattern": None},
        {"panels": None},
        {"boundary": {"mode": "isometric", "spread": "optimal"}},
        {
            "boundary": {
                "mode": "angles",
                "angle_unit": "deg",
                "angles": [{"vertex": 0, "angle": 240}, {"point": [-3.9, 0, 0], "angle": 120}],
            }
        },
        {
            "boundary": {
                "mode": "angles",
                "angle_unit": "pi",
                "angles": [{"vertex": 0, "angle": 1.3333333}, {"vertex": 3, "angle": 0.6666667}],
            }
        },
        {"panels": {"sizes": 3, "components": {"depth": 0.1}, "weights": {"surface": 0.5}}, "support": True},
    ],
)
def test_a_recalled_request_leads_to_the_same_work(live: Live, changes: dict[str, object]) -> None:
    first = live.post("/v1/jobs", json=request(**changes)).json()
    finished(live, first["id"])
    recalled = live.get(f"/v1/jobs/{first['id']}/request").json()
    again = live.post("/v1/jobs", json=recalled).json()
    assert len({live.service.manager.get(job["id"]).identity for job in (first, again)}) == 1
    asked = changes.get("boundary", {})
    if isinstance(asked, dict) and "angles" in asked:  # in the words it was asked in
        assert recalled["boundary"]["angle_unit"] == asked["angle_unit"]
        assert [a["angle"] for a in recalled["boundary"]["angles"]] == [a["angle"] for a in asked["angles"]]


def test_settings_beside_an_id_replace_those_sent_with_the_surface(live: Live) -> None:
    t = [2 * pi * k / 24 for k in range(25)]
    net = [[[cos(a), sin(a), z, 1] for z in (0, 1)] for a in t]
    nurbs = {"degree": [1, 1], "knots": [[0, *range(25), 24], [0, 0, 1, 1]], "control_points": net}
    sent = live.post("/v1/surfaces", json={"nurbs": nurbs, "mesh": {"max_edge": 0.5}}).json()
    counts = {}
    for beside in ({}, {"mesh": {"max_edge": 0.5}}, {"mesh": {"max_edge": 0.25}}):
        body = {"surface": {"id": sent["id"], **beside}, "pattern": None}
        job = live.post("/v1/jobs", json=body).json()["id"]
        finished(live, job)
        counts[str(beside)] = len(live.get(f"/v1/jobs/{job}/result?include=mesh").json()["mesh"]["vertices"])
        recalled = live.get(f"/v1/jobs/{job}/request").json()["surface"]
        assert recalled["id"] == sent["id"]
        assert recalled.get("mesh", {}).get("max_edge") == beside.get("mesh", {}).get("max_edge")
    as_sent, same, finer = counts.values()
    assert sent["vertices"] == as_sent == same < finer


def test_a_preview_shows_a_file_as_it_stands_even_one_that_would_be_refused(live: Live) -> None:
    n, m = 8, 6  # a torus
    turns = [(2 * pi * i / n, 2 * pi * j / m) for i in range(n) for j in range(m)]
    vertices = [[(3 + cos(b)) * cos(a), (3 + cos(b)) * sin(a), sin(b)] for a, b in turns]
    quads = [[[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]] for i in range(n) for j in range(m)]
    mesh = {"vertices": vertices, "faces": [[i % n * m + j % m for i, j in quad] for quad in quads]}
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in mesh["vertices"])
    text += "".join("f " + " ".join(str(v + 1) for v in face) + "\n" for face in mesh["faces"])
    files = {"file": ("torus.obj", text)}
    assert live.post("/v1/surfaces", files=files).status_code == 422
    shown = live.post("/v1/surfaces/preview", files=files).json()
    assert shown["vertices"] == mesh["vertices"]
    assert shown["faces"] == mesh["faces"]


def test_a_preview_of_nonsense_is_a_problem(live: Live) -> None:
    answer = live.post("/v1/surfaces/preview", files={"file": ("x.obj", b"\x00\x01garbage")})
    assert answer.status_code == 422
    assert answer.json()["type"] == "/problems/unreadable-file"
