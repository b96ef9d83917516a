"""Results that are packed part by part are the same as those made in one piece."""

from __future__ import annotations

import gzip
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hexwrap_server.jobs.packing import Packer
from hexwrap_server.jobs.parts import PARTS, chosen
from hexwrap_server.jobs.writing import pack_rest, packing
from hexwrap_server.output import wire
from hexwrap_server.output.wire import result_json
from tests.server.analytic import cylinder


def test_parts_packed_one_by_one_make_the_result() -> None:
    solution = cylinder()
    with Packer(wire.dump) as packer:
        for name in PARTS:
            packer.add(name, lambda name=name: wire.part(solution, name, {"map": 0.5}))
        text = gzip.decompress(packer.finish())
    assert text == result_json(solution, {"map": 0.5})
    assert chosen(text, packer.places, ["map", "sizes"]) == result_json(solution, include=["map", "sizes"])


def test_an_object_may_be_packed_in_two_goes() -> None:
    with Packer(wire.dump) as packer:
        packer.begin("panels", lambda: {"mode": "split", "size": [1, 2]})
        text = packer.foresee(lambda: {"a": 1})
        assert "panels" not in packer
        packer.add("panels", lambda: {"planarity": [0.5]})
        packer.add_text("sizes", text)
        whole = gzip.decompress(packer.finish())
    assert whole == b'{"panels":{"mode":"split","size":[1,2],"planarity":[0.5]},"sizes":{"a":1}}'
    assert {name: whole[slice(*place)] for name, place in packer.places.items()} == {
        "panels": b'{"mode":"split","size":[1,2],"planarity":[0.5]}',
        "sizes": b'{"a":1}',
    }


@pytest.mark.parametrize("renewed", [False, True])
def test_what_is_packed_stage_by_stage_is_the_result(renewed: bool) -> None:
    """renewed: the map needed vertices of its own, so that its mesh is not the one taken in."""
    solution = cylinder()
    assert solution.pattern is not None
    assert solution.panels is not None
    taken_in = solution.map.surface
    if renewed:
        taken_in = replace(taken_in, vertices=taken_in.vertices + 1.0)
    with Packer(wire.dump) as packer:
        made = packing(packer)
        for stage, value in (
            ("surface", taken_in),
            ("map", solution.map),
            ("pattern", solution.pattern),
            ("fit", None),
            ("panels", solution.panels),
            ("quality", solution.quality),
        ):
            made(stage, value)
        pack_rest(packer, solution, {"map": 0.5})
        text = gzip.decompress(packer.finish())
    assert text == result_json(solution, {"map": 0.5})
    assert chosen(text, packer.places, ["panels"]) == result_json(solution, include=["panels"])


def test_faults_of_a_part_are_raised_at_the_end() -> None:
    def stumble() -> Any:
        raise KeyError("a bug")

    with Packer(wire.dump) as packer:
        packer.add("map", stumble)
        packer.add("mesh", dict)
        assert "map" in packer
        with pytest.raises(KeyError, match="a bug"):
            packer.finish()


@pytest.mark.parametrize("n", [0, 1, 5, 200])
@pytest.mark.parametrize("share", [0.0, 0.1, 1.0])
def test_sheets_are_written_as_any_table(n: int, share: float) -> None:
    r = np.random.default_rng(n)
    table = r.integers(-12, 13, (n, 3)) * (r.random((n, 1)) < share)
    assert wire.dump(wire.mostly_zero(table)) == wire.dump(table)
