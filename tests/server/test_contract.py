"""The service as a stranger sees it: every sample and boundary condition, checked from the JSON alone."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from hexwrap_server import samples
from tests import contract
from tests.server.bodies import request
from tests.server.live import Live, running


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with running(tmp_path_factory.mktemp("contract"), workers=1) as client:
        yield client


def violations(result: contract.Json) -> list[str]:
    return [
        *contract.check_mesh(result),
        *contract.check_map(result),
        *contract.check_pattern(result),
        *contract.check_panels(result),
    ]


@pytest.mark.parametrize("name", samples.names())
def test_samples_keep_the_contract(live: Live, name: str) -> None:
    answer = live.post("/v1/solve", json=samples.load(name))
    assert answer.status_code == 200, answer.text[:500]
    assert violations(answer.json()) == []


CORNERS = {
    "mode": "angles",
    "angle_unit": "pi",
    "angles": [{"vertex": 0, "angle": 4 / 3}, {"vertex": 12, "angle": 2 / 3}],
}


@pytest.mark.parametrize(
    "boundary",
    [{"mode": "straight"}, {"mode": "isometric"}, {"mode": "isometric", "spread": "optimal"}, CORNERS],
    ids=["straight", "isometric", "optimal", "angles"],
)
@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
def test_boundary_conditions_and_kinds_keep_the_contract(live: Live, boundary: object, kind: str) -> None:
    if kind == "quad" and boundary is CORNERS:
        boundary = CORNERS | {"angles": [{"vertex": 0, "angle": 1.5}, {"vertex": 12, "angle": 0.5}]}
    body = request(boundary=boundary, pattern={"kind": kind, "around": 12})
    answer = live.post("/v1/solve", json=body)
    assert answer.status_code == 200, answer.text[:500]
    result = answer.json()
    found = [
        *contract.check_mesh(result),
        *contract.check_map(result),
        *contract.check_pattern(result),
        *contract.check_panels(result, regular=kind == "hex"),
        *contract.check_quality(result),
    ]
    assert found == []


def test_the_checker_notices_what_is_wrong(live: Live) -> None:
    result = live.post("/v1/solve", json=request()).json()
    assert violations(result) == []
    result["map"]["sheet"][0][0] += 1
    assert contract.check_map(result)
    result["pattern"]["neighbours"][0][0] = 7
    assert contract.check_pattern(result)
    for polygon in result["panels"]["polygons"]:
        polygon[0][2] += 0.01
    assert contract.check_panels(result)
    assert contract.check_quality(result)
    result["mesh"]["loops"].reverse()
    result["mesh"]["loops"][0].reverse()
    assert contract.check_mesh(result)
