"""What the scribe writes is what the worker would write, and it outlives nobody."""

from __future__ import annotations

import gzip
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest

from hexwrap_server.jobs.disk import StorageError
from hexwrap_server.jobs.scribe import Scribe, There
from hexwrap_server.jobs.writing import Writer, Written
from hexwrap_server.output.wire import result_json
from hexwrap_solver.pipeline import Solution
from tests.server.analytic import cylinder
from tests.server.process import children, free_port, is_gone, served

TIMINGS = {"map": 0.5}


@pytest.fixture
def scribe() -> Iterator[Scribe]:
    made = Scribe()
    made.start()
    until(lambda: made.is_ready)
    yield made
    made.give_up()


def until(holds, seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.02)


def write(writer: Writer, solution: Solution, path: Path | None = None, renewed: bool = False) -> Written:
    taken_in = solution.map.surface
    if renewed:
        taken_in = replace(taken_in, vertices=taken_in.vertices + 1.0)
    with writer:
        writer.made("surface", taken_in)
        writer.made("map", solution.map)
        if solution.pattern is not None:
            writer.made("pattern", solution.pattern)
        writer.made("fit", None)
        if solution.panels is not None:
            writer.made("panels", solution.panels)
        writer.made("quality", solution.quality)
        writer.rest(solution, TIMINGS)
        return writer.finish(None if path is None else str(path))


def test_what_the_scribe_writes_is_the_result(scribe: Scribe, tmp_path: Path) -> None:
    whole = cylinder()
    for solution in (whole, replace(whole, panels=None), replace(whole, panels=None, pattern=None)):
        for renewed in (False, True):
            written = write(There(scribe), solution, renewed=renewed)
            assert written.result is not None
            assert len(written.result) == written.size
            text = gzip.decompress(written.result)
            assert text == result_json(solution, TIMINGS)
            start, stop = written.parts["map"]
            assert text[start:stop] == result_json(solution, include=["map"])[len(b'{"map":') : -1]
    assert write(There(scribe), whole, tmp_path / "result").result is None
    assert gzip.decompress((tmp_path / "result").read_bytes()) == result_json(whole, TIMINGS)


def test_a_job_that_is_given_up_leaves_nothing_to_the_next(scribe: Scribe) -> None:
    solution = cylinder()
    with There(scribe) as writer:
        writer.made("surface", replace(solution.map.surface, vertices=solution.map.surface.vertices * 2.0))
        writer.made("map", solution.map)
    written = write(There(scribe), solution)
    assert written.result is not None
    assert gzip.decompress(written.result) == result_json(solution, TIMINGS)


@pytest.mark.parametrize("stage", ["before", "between"])
def test_without_its_scribe_the_worker_writes_by_itself(scribe: Scribe, stage: str) -> None:
    solution = cylinder()
    assert scribe._process is not None
    if stage == "before":
        scribe._process.kill()
        scribe._process.wait()
        written = write(There(scribe), solution)
    else:
        with There(scribe) as writer:
            writer.made("surface", solution.map.surface)
            scribe._process.kill()
            scribe._process.wait()
            writer.made("map", solution.map)
            writer.rest(solution, TIMINGS)
            written = writer.finish(None)
    assert written.result is not None
    assert gzip.decompress(written.result) == result_json(solution, TIMINGS)
    assert not scribe.is_ready


def test_a_fault_of_the_scribe_costs_its_help_only(scribe: Scribe) -> None:
    solution = cylinder()
    with There(scribe) as writer:
        writer.made("map", solution.map)  # before its surface
        writer.rest(solution, TIMINGS)
        written = writer.finish(None)
    assert written.result is not None
    assert gzip.decompress(written.result) == result_json(solution, TIMINGS)
    assert scribe.is_ready


def test_what_cannot_be_sent_leaves_no_answer_to_the_next(scribe: Scribe) -> None:
    solution = cylinder()
    with There(scribe) as writer:
        writer.made("surface", object())
        writer.rest(solution, TIMINGS)
        written = writer.finish(None)
    assert written.result is not None
    assert gzip.decompress(written.result) == result_json(solution, TIMINGS)
    assert not scribe.is_ready


def test_a_file_that_cannot_be_written_is_told(scribe: Scribe, tmp_path: Path) -> None:
    with pytest.raises(StorageError):
        write(There(scribe), cylinder(), tmp_path / "nowhere" / "result")


def test_scribes_go_with_their_workers(tmp_path: Path) -> None:
    port = free_port()
    with served(tmp_path, port, workers=1) as process:
        url = f"http://127.0.0.1:{port}/v1/solve"

        def scribes() -> list[psutil.Process]:
            return [p for p in children(process) if "jobs.scribe_main" in " ".join(p.cmdline())]

        for turn in range(2):  # it is started after the first job, and used for the second
            answer = httpx.post(url, json=body(turn), trust_env=False, timeout=60)
            assert answer.status_code == 200
            until(scribes)
        (scribe,) = scribes()
        worker = scribe.parent()
        assert worker is not None
        worker.kill()
        until(lambda: is_gone(scribe))


def body(turn: int) -> dict[str, Any]:
    """A request like no other."""
    surface = cylinder().map.surface
    vertices = surface.vertices * (1.0 + turn)
    return {"surface": {"vertices": vertices.tolist(), "faces": surface.faces.tolist()}}
