"""Explorations: every point is a request that gives what it says."""

from __future__ import annotations

import asyncio
import csv
import io
import json
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexwrap_server.input.requests import CacheSettings, Exploration, Order
from hexwrap_server.jobs.engine import ProcessEngine
from hexwrap_server.jobs.explore import pick
from hexwrap_server.jobs.exploring import explore
from hexwrap_server.output import front_png
from hexwrap_solver.errors import RequestError
from hexwrap_solver.explore.front import MOST_SOLVED
from hexwrap_solver.explore.types import Limits, Vary
from hexwrap_solver.explore.variants import variants
from tests.server.bodies import tube
from tests.server.live import Live, finished, running
from tests.server.patience import until

VARY = {"around": [10, 12], "sizes": [1, 5], "singularities": [0]}
BODY = {"name": "tube", "surface": tube(), "vary": VARY, "variants": 6, "seed": 3}


class Counting(ProcessEngine):
    """Keeps the names of the functions that were called, and holds one call of a step for good."""

    def __init__(self, step: str = "", number: int = 0) -> None:
        super().__init__(1)
        self.called: list[str] = []
        self.held = threading.Event()
        self._at = step, number

    async def run(self, function: str, *arguments: Any, **rest: Any) -> Any:
        step = function.rpartition(":")[2]
        if (step, self.called.count(step) + 1) == self._at:
            self.held.set()
            await asyncio.Event().wait()
        self.called.append(step)
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


class Hands:
    """Foresees without a surface: variants of these sizes cannot be made, and odd counts are one less."""

    caching = CacheSettings("", 0)

    def __init__(self, at_once: int, impossible: tuple[int, ...] = ()) -> None:
        self.at_once = at_once
        self.impossible = impossible
        self.looked: list[int] = []

    async def call(self, function: str, order: Order, *rest: Any) -> Any:
        step = function.rpartition(":")[2]
        await asyncio.sleep(0)
        if step == "plan":
            return variants(order.wanted, 1.0)
        if step == "pick":
            return []
        if step == "finish":
            return rest
        if step == "seat":
            await asyncio.sleep(0.002)
            listed = {}
            for one in rest[1]:
                listed.setdefault(one.singularities // 2 * 2, []).append(one)
            return [((count,), tuple(listed[count])) for count in sorted(listed)]
        (_, _, (at, listed)) = rest
        self.looked += [one.sizes for one in listed]
        await asyncio.sleep(0.001 * (hash((at, listed[0].frame)) % 5))
        return [
            RequestError(f"{one.sizes} cannot be")
            if one.sizes in self.impossible
            else {"request": [str(one.frame), at, one.sizes, one.joint]}
            for one in listed
        ]

    errand = call

    async def solved(self, work: Any) -> str:
        raise AssertionError("nothing was picked")


def foreseen(hands: Hands, wanted: Exploration) -> tuple[list[Any], list[str], list[tuple[int, Any]]]:
    """Documents, why others cannot be made, and what was told meanwhile."""
    told: list[tuple[int, Any]] = []
    order = Order("id", b"", wanted, None)
    documents, refused = asyncio.run(
        explore(hands, order, "", lambda one: one, lambda *_: None, lambda i, one: told.append((i, one)))
    )
    return documents, refused, told


def test_each_variant_is_told_once_when_it_is_foreseen_with_its_number() -> None:
    """Whatever the number of workers, and which of them is the fastest."""
    wanted = Exploration(variants=60, vary=Vary(singularities=(0, 2, 3, 4), sizes=(1, 4)))
    alone = foreseen(Hands(1), wanted)
    assert len(alone[0]) == 60
    assert alone[2] == list(enumerate(alone[0]))
    assert all(one not in alone[0][:i] for i, one in enumerate(alone[0]))
    for workers in (2, 5, 100):
        assert foreseen(Hands(workers), wanted) == alone


def test_as_many_variants_as_asked_for_though_some_are_alike_and_some_cannot_be_made() -> None:
    wanted = Exploration(variants=10, vary=Vary(singularities=(0, 1), sizes=(1, 5)))
    hands = Hands(3, impossible=(2, 5))
    documents, refused, _ = foreseen(hands, wanted)
    assert len(documents) == 10
    assert set(refused) <= {"2 cannot be", "5 cannot be"}
    assert len(hands.looked) <= 2 * wanted.variants
    with pytest.raises(RequestError, match="None of the 20 variants can be made"):
        foreseen(Hands(3, impossible=tuple(range(13))), wanted)


def test_what_is_foreseen_is_near_what_is_measured(result: dict[str, Any]) -> None:
    for one in result["variants"]:
        if one["measured"] and one["request"]["panels"]["sizes"] > 1:
            assert one["predicted"]["uncovered"] == pytest.approx(one["measured"]["uncovered"], abs=0.03)
            assert one["predicted"]["panels"] == pytest.approx(one["measured"]["panels"], rel=0.05)


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
    first = next(i for i, (name, _) in enumerate(events) if name == "variant")
    foreseeing = [one["stage"] for name, one in events[first:] if name == "progress"]
    assert "foresee" in foreseeing  # the first was known while others were not
    result = live.get(f"/v1/jobs/{id}/result").json()
    latest = {one["index"]: one["variant"] for name, one in events if name == "variant"}
    known = [{**one, "front": False} for one in result["variants"]]
    assert [latest[i] for i in range(len(known))] == known


def test_a_restart_changes_nothing_and_does_nothing_twice(live: Live, tmp_path: Path) -> None:
    """Nor does another server, which remembers nothing. Each stops, or is killed, at its call of a step."""
    body = BODY | {"vary": VARY | {"singularities": [0, 2]}, "variants": 4, "seed": 1}
    id = finished(live, live.post("/v1/explore", json=body).json()["id"])["id"]
    result = live.get(f"/v1/jobs/{id}/result").json()
    foreseen = [(i, one | {"measured": None, "front": False}) for i, one in enumerate(result["variants"])]
    folder, id, solved = tmp_path / "0", "", 0
    for step, number, is_killed, known in (
        ("look", 3, True, 2), ("seat", 1, False, 3), ("solve", 2, False, 4),
    ):  # fmt: skip
        engine = Counting(step, number)
        with running(folder, engine) as client:
            id = id or client.post("/v1/explore", json=body).json()["id"]
            until(engine.held.is_set, f"{step} no. {number}")
            told = client.service.manager.found(id)
            assert [one for one in told if not one[1]["measured"]] == foreseen[:known]
            if is_killed:  # the next one finds what would be there then
                ignored = shutil.ignore_patterns("lock*", "*-shm", "stages")
                shutil.copytree(folder, folder := folder.with_name(step + str(number)), ignore=ignored)
        solved += engine.called.count("solve")
    engine = Counting()
    with running(folder, engine) as client:
        job = finished(client, id)
        assert job["status"] == "done", job
        assert client.get(f"/v1/jobs/{id}/result").json() == result
    solved += engine.called.count("solve")
    assert solved == sum(one["measured"] is not None for one in result["variants"])


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


def test_limits_that_none_keeps_are_named_with_what_comes_nearest(live: Live) -> None:
    body = BODY | {"limits": {"max_gap": 0, "panels": 1}}
    job = finished(live, live.post("/v1/explore", json=body).json()["id"])
    result = live.get(f"/v1/jobs/{job['id']}/result").json()
    assert result["front"] == []
    assert all(one["measured"] for one in result["variants"])  # any might have kept them
    gap = [one["measured"]["gap_max"] for one in result["variants"]]
    assert result["best"] == gap.index(min(gap))
    note = next(note for note in result["notes"] if "limits" in note)
    assert f"max_gap is to be 0 at most, and {min(gap):.4g} is the least (no. {gap.index(min(gap))})" in note
    assert "panels is to be 1 at most" in note


def test_cells_are_as_large_as_a_limit_of_panels_asks_for(live: Live) -> None:
    body = {"surface": tube(), "vary": {"singularities": [0]}, "limits": {"panels": 40}, "variants": 6}
    job = finished(live, live.post("/v1/explore", json=body).json()["id"])
    result = live.get(f"/v1/jobs/{job['id']}/result").json()
    assert result["best"] in result["front"]
    assert 15 <= result["variants"][result["best"]]["measured"]["panels"] <= 40


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        ({"edge_length": [1e-6, 1e-6], "singularities": [2]}, "cells with edges of 1e-06 would be needed"),
        ({"edge_length": [8, 9], "kind": ["trihexagonal"]}, "do not close up to a ring"),
        ({"edge_length": [1e9, 1e10]}, "is larger than the model"),
        ({"joint": [1e3, 1e4]}, "No cell has room for a panel"),
    ],
)
def test_what_cannot_be_made_is_left_out_and_told(live: Live, vary: dict[str, Any], words: str) -> None:
    body = {"surface": tube(), "vary": {"singularities": [0]} | vary, "variants": 2}
    job = finished(live, live.post("/v1/explore", json=body).json()["id"])
    assert job["status"] == "done", job
    result = live.get(f"/v1/jobs/{job['id']}/result").json()
    assert result["best"] in result["front"]
    assert words in result["notes"][-1]


#: No search for singularities.
PLAIN = {"vary": {"singularities": [0]}}


@pytest.mark.parametrize(
    ("changes", "place", "words"),
    [
        ({"pattern": {"rotation": "u"}}, "/pattern/rotation", "Only a NURBS surface"),
        ({"pattern": {"edge_length": 1e9}}, "/pattern/edge_length", "is larger than the model"),
        (PLAIN | {"panels": {"joint": 1e6}}, "/panels/joint", "the 4 variants can be made: No cell has room"),
    ],
)
def test_what_no_variant_can_have_is_refused_where_it_was_asked_for(
    live: Live, engine: Counting, changes: dict[str, Any], place: str, words: str
) -> None:
    sought = engine.called.count("seat")
    job = finished(
        live, live.post("/v1/explore", json={"surface": tube(), "variants": 2} | changes).json()["id"]
    )
    assert job["status"] == "failed"
    assert words in job["problem"]["detail"]
    assert [fault["pointer"] for fault in job["problem"]["errors"]] == [place]
    assert engine.called.count("seat") == sought


def test_a_size_that_is_not_tried_need_not_be_possible(live: Live) -> None:
    vary = {"edge_length": [1, 1], "boundary": ["straight"], "singularities": [0]}
    body = {"surface": tube(), "pattern": {"edge_length": 1e9}, "vary": vary, "variants": 2}
    job = finished(live, live.post("/v1/explore", json=body).json()["id"])
    assert job["status"] == "done", job


def test_more_are_solved_until_one_keeps_the_limits() -> None:
    def document(n: int, gap: float | None = None) -> dict[str, Any]:
        request = {"surface": {"id": "0" * 64}, "panels": {"sizes": 3}}
        figures = {"uncovered": n / 100, "panels": 9, "types": 3, "cost": float(n), "bare": 0.0}
        measured = None if gap is None else figures | {"gap_max": gap}
        return {"request": request, "predicted": figures, "measured": measured, "problem": None}

    def picked(*documents: dict[str, Any]) -> list[int]:
        order = Order("id", b"", Exploration(limits=Limits(max_gap=0.1)), None)
        return [i for i, _ in pick(lambda *_: None, order, list(documents))]

    assert picked(document(2), document(1), document(3)) == [1]
    assert picked(document(2), document(1, gap=0.2), document(3)) == [0]
    assert picked(document(2, gap=0.1), document(1, gap=0.2), document(3)) == []
    assert picked(document(2, gap=0.2)) == []
    assert picked(*[document(n, gap=0.2) for n in range(MOST_SOLVED)], document(99)) == []


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


def test_no_number_lies_over_a_disc_of_the_picture_or_another_number() -> None:
    places, radius = np.array([[0, 0], [22, 4], [44, 0], [30, 40.0], [0, 18]]), np.array([8, 8, 14, 5, 8.0])
    words = {0: "12", 1: "7", 2: "103", 4: "5"}
    boxes = [(place, np.array([r, r])) for place, r in zip(places, radius, strict=True)]
    for k, at in front_png.beside(places, radius, words):
        own = np.array([front_png.HALF_DIGIT * len(words[k]), front_png.HALF_HEIGHT])
        assert all((abs(at - middle) > own + half).any() for middle, half in boxes)
        boxes.append((at, own))
    assert len(boxes) == 9


def test_a_picture_without_anything_measured_is_drawn() -> None:
    seen = {"uncovered": 0.1, "types": 3, "cost": 5.0}
    one = {"request": {"name": "x"}, "predicted": seen, "measured": None, "front": False}
    assert front_png.front_png({"variants": [one], "best": None}).startswith(b"\x89PNG")
