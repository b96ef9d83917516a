"""Faults of form say what was sent and what would be right."""

from __future__ import annotations

from typing import Any

import pytest

from hexwrap_server.input import faults
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.problems import MOST_LISTED, FormError

SURFACE = {"vertices": [[0, 0, 0]], "faces": []}


def refused(body: dict[str, Any]) -> dict[str, str]:
    with pytest.raises(FormError) as caught:
        parse_request({"surface": SURFACE, **body}, 10, 10)
    return dict(caught.value.faults)


@pytest.mark.parametrize(
    ("body", "pointer", "words"),
    [
        ({"patern": {}}, "/patern", "did you mean 'pattern'?"),
        ({"pattern": {"sizes": 5}}, "/pattern/sizes", "'sizes' belongs to /panels"),
        ({"panels": {"support": True}}, "/panels/support", "'support' belongs to the body itself"),
        ({"panels": {"size": 5}}, "/panels/size", "known here: 'mode', 'sizes', "),
        ({"boundary": {"angles": [{"angel": 1}]}}, "/boundary/angles/0/angel", "did you mean 'angle'?"),
        ({"panels": {"weights": {"surfaces": 1}}}, "/panels/weights/surfaces", "did you mean 'surface'?"),
        ({"panels": {"sizes": 0}}, "/panels/sizes", "greater than or equal to 1, or 'fewest', not 0"),
        ({"panels": {"sizes": 1.5}}, "/panels/sizes", "not 1.5"),
        ({"pattern": {"kind": "pentagon"}}, "/pattern/kind", "'hex', 'triangle' or 'quad', not \"pentagon\""),
        ({"panels": {"joint": None}}, "/panels/joint", "not null"),
        ({"panels": {"weights": {"edge": True}}}, "/panels/weights/edge", "not true"),
    ],
)
def test_what_was_sent_and_what_would_be_right(body: dict[str, Any], pointer: str, words: str) -> None:
    assert words in refused(body)[pointer]


def test_long_values_are_not_repeated() -> None:
    assert "xxx" not in refused({"name": "x" * 300})["/name"]
    assert "000" not in refused({"panels": {"sizes": 10**80}})["/panels/sizes"].replace("1000", "")


def test_only_faults_that_are_listed_are_put_into_words(monkeypatch: pytest.MonkeyPatch) -> None:
    """A body may hold a million names that there are not."""
    worded = []
    monkeypatch.setattr(faults, "_sentence", lambda model, errors: worded.append(errors) or errors[0]["msg"])
    with pytest.raises(FormError, match="1999 more faults") as caught:
        parse_request({"surface": SURFACE, "panels": {f"name{i}": 1 for i in range(2000)}}, 10, 10)
    assert len(worded) == len(caught.value.faults) == MOST_LISTED
