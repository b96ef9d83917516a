"""The whole OpenAPI document, fuzzed: every answer is one that the document announces, and none is a 5xx."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import cache
from typing import Any

import httpx
import pytest
from hypothesis import HealthCheck, given, settings

from hexwrap_server.http.docs import DocumentedApp
from hexwrap_server.http.openapi import OPERATIONS
from hexwrap_server.http.routes import router
from hexwrap_server.http.viewer import router as viewer
from tests.server.bodies import request
from tests.server.live import Live, running
from tests.server.patience import PATIENCE

ordinary = settings(max_examples=8, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
thorough = settings(max_examples=500, deadline=None, suppress_health_check=list(HealthCheck))


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with running(tmp_path_factory.mktemp("data"), workers=1, job_seconds=20.0) as live:
        while live.get("/ready").status_code != 200:
            time.sleep(0.05)
        yield live


def read_by_schemathesis(document: dict[str, Any]) -> Any:
    import schemathesis  # here: only the process that runs these tests has to spend its seconds

    return schemathesis.openapi.from_dict(document)


@cache
def operations() -> dict[str, Any]:
    """Every route of the application, by method and path."""
    app = DocumentedApp()
    app.include_router(router)
    app.include_router(viewer)
    read = read_by_schemathesis(app.openapi()).get_all_operations()
    return {operation.ok().label: operation.ok() for operation in read}


def test_every_route_is_described() -> None:
    assert operations().keys() == OPERATIONS.keys()


def test_document_names_every_route_of_the_contract(client: Live) -> None:
    paths = client.get("/openapi.json").json()["paths"]
    job = "/v1/jobs/{id}"
    assert paths.keys() >= {"/health", "/v1/jobs", job, "/v1/solve", "/v1/surfaces"}
    assert paths.keys() >= {
        f"{job}/{name}" for name in ("events", "result", "lift", "flatten", "files/{name}")
    }
    assert paths[job].keys() >= {"get", "delete"}


def test_documentation_is_served(client: Live) -> None:
    page = client.get("/docs")
    assert page.status_code == 200
    assert "/v1/solve" in page.text
    assert "//" not in page.text


def described(client: Live, path: str, method: str) -> Any:
    """The operation in the document, which can tell whether an answer is one of those announced."""
    return read_by_schemathesis(client.get("/openapi.json").json())[path][method]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"panels": {"mode": "watertight"}},
        {"panels": {"components": {"depth": 0.1}}, "support": True},
        {"pattern": {"kind": "quad", "around": 12, "boundary": "trim"}},
        {"pattern": {"kind": "triangle", "around": 12}, "boundary": {"mode": "isometric"}},
        {"pattern": None},
    ],
)
@pytest.mark.parametrize("include", [None, "quality", "mesh,map,sizes"])
def test_results_are_as_described(client: Live, changes: dict[str, Any], include: str | None) -> None:
    answer = client.post("/v1/solve", json=request(**changes), params={"include": include} if include else {})
    assert answer.status_code == 200
    described(client, "/v1/solve", "POST").validate_response(answer)


@pytest.mark.parametrize(
    ("part", "name", "value"),
    [
        ("mesh", "faces", [[0, 1]]),
        ("mesh", "vertices", [[0, 0, None]]),
        ("map", "kind", "sphere"),
        ("map", "residual", None),
        ("pattern", "whole", [1]),
        ("pattern", "neighbours", [[-2]]),
        ("panels", "label", None),
        ("panels", "center", [[0, 0]]),
        ("quality", "gap", {"tangential": {}}),
        ("quality", "notes", "none"),
    ],
)
def test_other_results_are_not_as_described(client: Live, part: str, name: str, value: object) -> None:
    from schemathesis.core.failures import Failure, FailureGroup

    operation = described(client, "/v1/solve", "POST")
    answer = client.post("/v1/solve", json=request())
    headers = {"Content-Type": "application/json"}
    for change in ({name: value}, None):  # another value, and none at all
        result = answer.json()
        result[part] = {k: v for k, v in result[part].items() if k != name} | (change or {})
        wrong = httpx.Response(200, headers=headers, json=result, request=answer.request)
        wrong.elapsed = answer.elapsed
        with pytest.raises((Failure, FailureGroup)):
            operation.validate_response(wrong)


def attack(client: Live, operation: Any, how: settings) -> None:
    from schemathesis.checks import not_a_server_error
    from schemathesis.specs.openapi import checks

    announced = [
        not_a_server_error,
        checks.status_code_conformance,
        checks.content_type_conformance,
        checks.response_schema_conformance,
    ]

    @how
    @given(case=operation.as_strategy())
    def answers(case: Any) -> None:
        case.call_and_validate(base_url=str(client.base_url), checks=announced, timeout=PATIENCE)

    answers()


@pytest.mark.parametrize("route", OPERATIONS)
def test_answers_are_those_announced(client: Live, route: str) -> None:
    attack(client, operations()[route], ordinary)


@pytest.mark.long
@pytest.mark.parametrize("route", OPERATIONS)
def test_answers_are_those_announced_in_many_cases(client: Live, route: str) -> None:
    attack(client, operations()[route], thorough)


@pytest.mark.parametrize("accept", [httpx.Headers({"Accept": "*/*"}), httpx.Headers({"Accept": "text/html"})])
def test_problems_are_problems_whatever_is_accepted(client: Live, accept: httpx.Headers) -> None:
    answer = client.get("/v1/nothing", headers=accept)
    assert answer.headers["content-type"] == "application/problem+json"
