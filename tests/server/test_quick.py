"""Bodies read the quick way: the same document as by the long way, or none."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import orjson
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexwrap_server.input import quick
from hexwrap_server.input.json_text import loads
from hexwrap_server.input.schemas import parse_points, parse_request
from hexwrap_server.problems import FormError
from hexwrap_solver.arrays import Ragged
from tests.server.bodies import request, tube

pytestmark = pytest.mark.skipif(quick.simdjson is None, reason="simdjson is not installed")

SQUARES = [[0, 1, 2, 3], [3, 2, 1]]
names = st.sampled_from(["vertices", "faces", "normals", "points", "surface", "name", "[", "a/b", ""])
numbers = st.integers(-(2**70), 2**70) | st.floats(allow_nan=False, allow_infinity=False)
rows = st.lists(st.lists(numbers | st.integers(0, 9), min_size=2, max_size=4), max_size=4)
values = st.recursive(
    st.none() | st.booleans() | numbers | st.text('[]a\\"é', max_size=3) | rows,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(names, inner, max_size=3),
    max_leaves=8,
)


def plain(value: Any) -> Any:
    """Arrays as the lists that they were."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Ragged):
        return value.to_lists()
    if isinstance(value, dict):
        return {name: plain(inner) for name, inner in value.items()}
    return value


@given(st.dictionaries(names, values | rows, max_size=3) | values)
def test_what_is_read_is_what_was_sent(document: Any) -> None:
    text = json.dumps(document).encode()
    read = quick.read(text)
    assert read is None or plain(read) == json.loads(text)


def test_usual_bodies_are_read() -> None:
    read = quick.read(orjson.dumps(request()))
    assert isinstance(read["surface"]["vertices"], np.ndarray)
    assert isinstance(read["surface"]["faces"], Ragged)
    assert plain(read) == request()
    mixed = quick.read(orjson.dumps({"faces": SQUARES, "vertices": [[0, 1, 2.5]], "name": "x"}))
    assert plain(mixed) == {"faces": SQUARES, "vertices": [[0.0, 1.0, 2.5]], "name": "x"}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        '{"vertices": [[1, 2, 3], [1, 2]]}',
        '{"vertices": [[1, [2], 3]]}',
        '{"vertices": [[[1], [2], [3]]]}',
        '{"vertices": [[1, true, 3]]}',
        '{"vertices": [[1, null, 3]]}',
        '{"vertices": [[1, "2", 3]]}',
        '{"vertices": [[1, 1e999, 3]]}',
        '{"vertices": [[1, NaN, 3]]}',
        '{"vertices": [1, 2, 3]}',
        '{"vertices": [{"x": 1, "y": 2, "z": 3}]}',
        '{"vertices": []}',
        '{"vertices": [[]]}',
        '{"faces": [[1, 2]]}',
        '{"faces": [[1, 2, 3.0]]}',
        '{"faces": [[1, 2, 18446744073709551616]]}',
        '{"faces": [[1, 2, [3]]]}',
        '{"faces": [[1, 2, 3]], "faces": [[1, 2, 3]]}',
        '{"name": "a", "name": "b"}',
        '{"name": "a", "n\\u0061me": "b"}',
        '{"name\\u0000": "a"}',
        '{"name": "a", "name\\u0000": "b"}',
        "\ufeff{}",
        '{"name": "[", "faces": [[1, 2, 3]]}',
        '{"name": "\\u005b", "faces": [[1, [2], 3]]}',
    ],
)
def test_unusual_bodies_go_the_long_way(text: str) -> None:
    assert quick.read(text.encode()) is None


@pytest.mark.parametrize(
    ("surface", "pointer"),
    [
        ({"vertices": [[0, 0]], "faces": [[0, 0, 0]]}, "/surface/vertices/0"),
        ({"vertices": [[0, 0, 0]], "faces": [[0, 0, 0], [0, 0, 0, 1]]}, "/surface/faces/1/3"),
        ({"vertices": [[0, 0, 0]], "faces": [[0, -1, 0]]}, "/surface/faces/0/1"),
        ({"vertices": [[0, 0, 0]] * 2000, "faces": [[0, 0, 0]]}, "/surface/vertices"),
        ({"vertices": [[0, 0, 0]], "faces": [[0, 0, 0]] * 5000}, "/surface/faces"),
        ({"vertices": [[0, 0, 0]], "faces": [[0, 0, 0]], "normals": [[0, 0, 1]] * 2}, "/surface/normals"),
    ],
)
def test_faults_in_what_was_read_are_pointed_at(surface: dict[str, Any], pointer: str) -> None:
    text = orjson.dumps({"surface": surface})
    assert quick.read(text) is not None
    told = []
    for body in (quick.read(text), orjson.loads(text)):
        with pytest.raises(FormError) as caught:
            parse_request(body, 1000, 1000)
        told.append(caught.value.faults)
    assert told[0] == told[1]
    assert told[0][0][0] == pointer


def test_many_names_go_the_long_way() -> None:
    """One by one they took two minutes for 4 MB."""
    assert quick.read(orjson.dumps({f"name {i}": i for i in range(quick.MOST_NAMES)})) is not None
    assert quick.read(orjson.dumps({f"name {i}": i for i in range(quick.MOST_NAMES + 1)})) is None


def test_points_are_read_too() -> None:
    assert parse_points(loads(b'{"points": [[1, 2], [3, 4]]}'), 2, 10).tolist() == [[1, 2], [3, 4]]
    for text in (b'{"points": [[1, 2]]}', b'{"points": [[1, 2, 3], [1, 2, 3]]}'):
        with pytest.raises(FormError):
            parse_points(loads(text), 3, 1)


def test_without_simdjson_everything_goes_the_long_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(quick, "simdjson", None)
    text = orjson.dumps(request(surface=tube(12, 5)))
    assert quick.read(text) is None
    assert loads(text) == request(surface=tube(12, 5))


@pytest.mark.parametrize(
    "rows",
    [
        [[1, 2], [3, 4, 5, 6]],
        [[], [1, 2, 3, 4, 5, 6]],
        [[1, 2, 3], [4, 5], [6, 7, 8, 9]],
        [[1, [2], 3], [4, 5, 6]],
    ],
)
@pytest.mark.parametrize("name", ["vertices", "faces"])
@pytest.mark.parametrize("beside", [{}, {"phase": [1, 2, 3]}, {"a": "[,,]"}, {"a": [[1, 2, 3], [1, 2, 3]]}])
def test_rows_are_not_taken_for_triples_when_they_are_three_long_on_average(
    rows: Any, name: str, beside: Any
) -> None:
    assert quick.read(orjson.dumps({name: rows} | beside)) is None


def test_other_lists_of_three_do_not_keep_triples_from_being_read() -> None:
    document = {
        "points": [[1.0, 2.0, 3.0]],
        "angles": [[1, 2, 3], {"point": [1.0, 2.0, 3.5]}],
        "x": [[], 1, 2],
    }
    assert plain(quick.read(json.dumps(document).encode())) == document
