"""Faults of form say what was sent and what would be right."""

from __future__ import annotations

from typing import Any

import pytest

from hexwrap_server.problems import FormError
from hexwrap_server.schemas import parse_request

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
        ({"panels": {"sizes": 0}}, "/panels/sizes", "greater than or equal to 1, not 0"),
        ({"panels": {"sizes": 1.5}}, "/panels/sizes", "not 1.5"),
        ({"pattern": {"kind": "pentagon"}}, "/pattern/kind", "'hex', 'triangle' or 'quad', not 'pentagon'"),
        ({"panels": {"joint": None}}, "/panels/joint", "not null"),
        ({"panels": {"weights": {"edge": True}}}, "/panels/weights/edge", "not true"),
    ],
)
def test_what_was_sent_and_what_would_be_right(body: dict[str, Any], pointer: str, words: str) -> None:
    assert words in refused(body)[pointer]


def test_long_texts_are_not_repeated() -> None:
    assert "xxx" not in refused({"name": "x" * 300})["/name"]
