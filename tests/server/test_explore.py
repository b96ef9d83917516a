"""Explorations: every point is a request that gives what it says."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hexwrap_server.input.requests import Exploration, Order
from hexwrap_server.jobs.engine import ProcessEngine
from hexwrap_server.jobs.explore import begin
from hexwrap_solver.explore.foresee import Candidate
from hexwrap_solver.explore.types import Figures
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pipeline import SolveSettings
from tests.server.bodies import tube
from tests.server.live import Live, finished, running
from tests.server.patience import until

VARY = {"around": [10, 12], "sizes": [1, 5], "singularities": [0]}
BODY = {"name": "tube", "surface": tube(), "vary": VARY, "variants": 6, "seed": 3}


class Counting(ProcessEngine):
    """Keeps the names of the functions that were called, and fails from one on."""

    def __init__(self) -> None:
        super().__init__(1)
        self.called: list[str] = []

    async def run(self, function: str, *arguments: Any, **rest: Any) -> Any:
        self.called.append(function.rpartition(":")[2])
        return await super().run(function, *arguments, **rest)


@pytest.fixture(scope="module")
def engine() -> Counting:
    return Counting()


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory, engine: Counting) -> Iterator[Live]:
    with running(tmp_path_factory.mktemp("explore"), engine) as client:
        yield client


@pytest.fixture(scope="module")
def job(live: Live) -> dict[str, Any]:
    answer = live.post("/v1/explore", json=BODY)
    assert answer.status_code == 202, answer.text
    assert answer.headers["Location"] == f"/v1/jobs/{answer.json()['id']}"
    assert answer.json()["kind"] == "explore"
    return finished(live, answer.json()["id"])


@pytest.fixture(scope="module")
def result(live: Live, job: dict[str, Any]) -> dict[str, Any]:
    assert job["status"] == "done", job
    found: dict[str, Any] = live.get(f"/v1/jobs/{job['id']}/result").json()
    return found


def test_every_request_gives_what_is_said_to_be_measured(live: Live, result: dict[str, Any]) -> None:
    solved = [one for one in result["variants"] if one["measured"]]
    assert len(solved) >= 3
    for one in solved:
        sent = live.post("/v1/jobs", json=one["request"]).json()
        assert sent["status"] == "done"  # it is the very work that was measured
        found = live.get(f"/v1/jobs/{sent['id']}/result?include=panels,sizes,quality").json()
        said = one["measured"]
        assert said["uncovered"] == pytest.approx(1 - found["quality"]["coverage"])
        assert said["panels"] == len(found["panels"]["face"])
        assert said["types"] == len(found["sizes"])
        assert said["gap_max"] == found["quality"]["gap"]["tangential"]["max"]


def test_front_is_what_no_other_beats(result: dict[str, Any]) -> None:
    variants = result["variants"]
    assert len(variants) == BODY["variants"]
    assert result["front"] == [i for i, one in enumerate(variants) if one["front"]]
    assert result["best"] in result["front"]
    measured = [variants[i]["measured"] for i in result["front"]]
    for a in measured:
        for b in measured:
            names = ("uncovered", "types", "cost")
            assert a is b or not all(b[name] < a[name] for name in names)


def test_as_many_variants_as_asked_for_though_some_are_alike_and_some_cannot_be_made() -> None:
    def candidate(sizes: int, place: int, problem: str = "") -> Candidate:
        settings = SolveSettings(panels=PanelSettings(sizes=sizes))
        return Candidate(settings, None if problem else Figures(0.1, 10, sizes, 1.0), problem, place)

    order = Order("id", b"", Exploration(variants=2), None)
    drawn = [
        candidate(1, 3),
        candidate(5, 0, "there is none"),
        candidate(2, 4),
        candidate(1, 1),
        candidate(3, 2),
        candidate(5, 5, "not even looked at"),
    ]
    documents, _, refused = begin(lambda stage, fraction, what: None, order, "", drawn)
    assert [one["request"]["panels"]["sizes"] for one in documents] == [1, 3]
    assert refused == ["there is none"]


def test_what_is_foreseen_is_near_what_is_measured(result: dict[str, Any]) -> None:
    for one in result["variants"]:
        if one["measured"] and one["request"]["singularities"] is None and one["measured"]["types"] > 2:
            assert one["predicted"]["uncovered"] == pytest.approx(one["measured"]["uncovered"], abs=0.08)
            assert one["predicted"]["panels"] == pytest.approx(one["measured"]["panels"], rel=0.15)


def test_table(live: Live, job: dict[str, Any], result: dict[str, Any]) -> None:
    text = live.get(f"/v1/jobs/{job['id']}/files/explore.csv").text
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [float(row["predicted_cost"]) for row in rows] == [
        one["predicted"]["cost"] for one in result["variants"]
    ]
    assert [row["front"] == "1" for row in rows] == [one["front"] for one in result["variants"]]


def test_an_exploration_has_no_map(live: Live, job: dict[str, Any], result: dict[str, Any]) -> None:
    at = f"/v1/jobs/{job['id']}"
    for answer in (
        live.get(f"{at}/result?include=map"),
        live.post(f"{at}/lift", json={"points": [[0, 0]]}),
    ):
        assert answer.status_code == 409
        assert answer.json()["type"] == "/problems/exploration"
    refused = live.get(f"{at}/files/panels.3dm")
    assert refused.status_code == 404
    assert "explore.csv" in refused.json()["detail"]
    assert live.get(f"{at}/files/result.json").json() == result
    solved = live.post("/v1/jobs", json=result["variants"][result["best"]]["request"]).json()["id"]
    assert live.get(f"/v1/jobs/{solved}/files/explore.csv").status_code == 404


def test_another_seed_tries_other_variants(live: Live, result: dict[str, Any]) -> None:
    job = finished(live, live.post("/v1/explore", json=BODY | {"seed": 4, "variants": 3}).json()["id"])
    listed = live.get(f"/v1/jobs/{job['id']}/result").json()["variants"]
    assert [one["request"] for one in listed] != [one["request"] for one in result["variants"][:3]]


def test_variants_are_streamed_as_they_come(live: Live) -> None:
    id = live.post("/v1/explore", json=BODY | {"variants": 4, "seed": 7}).json()["id"]
    events: list[tuple[str, Any]] = []
    with live.stream("GET", f"/v1/jobs/{id}/events") as stream:
        name = ""
        for line in stream.iter_lines():
            kind, _, content = line.partition(": ")
            if kind == "event":
                name = content
            elif kind == "data":
                events.append((name, json.loads(content)))
    assert events[-1][0] == "done"
    result = live.get(f"/v1/jobs/{id}/result").json()
    latest = {one["index"]: one["variant"] for name, one in events if name == "variant"}
    known = [{**one, "front": False} for one in result["variants"]]
    assert [latest[i] for i in range(len(known))] == known


def test_a_restart_changes_nothing_and_does_nothing_twice(result: dict[str, Any], tmp_path: Path) -> None:
    """Nor does another server, which remembers nothing."""
    engines = [Counting(), Counting()]
    with running(tmp_path, engines[0]) as client:
        id = client.post("/v1/explore", json=BODY).json()["id"]
        until(lambda: engines[0].called.count("solve") >= 2, "the second variant")  # the first is finished
    with running(tmp_path, engines[1]) as client:
        job = finished(client, id)
        assert job["status"] == "done", job
        assert client.get(f"/v1/jobs/{id}/result").json() == result
    solved = sum(one["measured"] is not None for one in result["variants"])
    assert engines[1].called.count("solve") < solved


def test_cancelled_with_all_that_it_started(live: Live, engine: Counting) -> None:
    before = engine.called.count("solve")
    id = live.post("/v1/explore", json=BODY | {"seed": 8}).json()["id"]
    until(lambda: engine.called.count("solve") > before, "the first variant")
    assert live.delete(f"/v1/jobs/{id}").status_code == 204
    assert live.get(f"/v1/jobs/{id}").json()["status"] == "cancelled"
    until(lambda: live.get("/health").json()["running"] == 0, "nothing that runs")
    calls = len(engine.called)
    assert live.post("/v1/solve", json={"surface": tube(), "pattern": None}).status_code == 200
    assert len(engine.called) == calls + 1


@pytest.mark.parametrize(
    ("changes", "pointer"),
    [
        ({"variants": 100_000}, "/variants"),
        ({"variants": 0}, "/variants"),
        ({"seed": -1}, "/seed"),
        ({"vary": {"sizes": [5, 2]}}, "/vary"),
        ({"vary": {"boundary": []}}, "/vary"),
        ({"vary": {"boundary": ["crooked"]}}, "/vary/boundary/0"),
        ({"vary": {"around": [8, 10], "edge_length": [1, 2]}}, "/vary"),
        ({"vary": {"singularities": [40]}}, "/vary/singularities/0"),
        ({"cost": {"per_type": -1}}, "/cost/per_type"),
        ({"limits": {"panels": 0}}, "/limits/panels"),
        ({"panels": {"mode": "watertight"}}, ""),
        ({"vari": 3}, "/vari"),
    ],
)
def test_faults_of_form(live: Live, changes: dict[str, Any], pointer: str) -> None:
    answer = live.post("/v1/explore", json={"surface": tube()} | changes)
    assert answer.status_code == 422, answer.text
    assert any(fault["pointer"].startswith(pointer) for fault in answer.json()["errors"]), answer.text


def test_limits_and_rates_are_kept(live: Live) -> None:
    body = BODY | {"limits": {"sizes": 3, "panels": 120}, "cost": {"per_type": 0, "per_panel": 7}}
    body["cost"] |= {"per_area": 0, "per_joint_length": 0}
    job = finished(live, live.post("/v1/explore", json=body).json()["id"])
    result = live.get(f"/v1/jobs/{job['id']}/result").json()
    for i in result["front"]:
        one = result["variants"][i]
        assert one["request"]["panels"]["sizes"] <= 3
        assert one["measured"]["panels"] <= 120
        assert one["measured"]["cost"] == pytest.approx(7 * one["measured"]["panels"])


def test_singularities_are_part_of_the_requests(live: Live) -> None:
    vary = {"around": [12, 12], "singularities": [2], "boundary": ["isometric"], "sizes": [3, 3]}
    job = finished(live, live.post("/v1/explore", json=BODY | {"vary": vary}).json()["id"])
    variants = live.get(f"/v1/jobs/{job['id']}/result").json()["variants"]
    (with_two,) = [one for one in variants if one["request"]["singularities"]]
    assert len(with_two["request"]["singularities"]["at"]) == 2
    assert with_two["measured"]["types"] == 5
    assert live.post("/v1/jobs", json=with_two["request"]).json()["status"] == "done"


def test_a_surface_that_cannot_be_used(live: Live) -> None:
    surface = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5], [6, 5, 5], [5, 6, 5]]}
    surface["faces"] = [[0, 1, 2], [3, 4, 5]]
    job = finished(live, live.post("/v1/explore", json={"surface": surface}).json()["id"])
    assert job["status"] == "failed"
    assert live.get(f"/v1/jobs/{job['id']}/result").status_code == 422
