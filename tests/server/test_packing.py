"""Results that are packed part by part are the same as those made in one piece."""

from __future__ import annotations

import gzip
from typing import Any

import pytest

from hexwrap_server import wire
from hexwrap_server.packing import Packer
from hexwrap_server.parts import PARTS, chosen
from hexwrap_server.wire import result_json
from tests.server.analytic import cylinder


def test_parts_packed_one_by_one_make_the_result() -> None:
    solution = cylinder()
    with Packer(wire.dump) as packer:
        for name in PARTS:
            packer.add(name, lambda name=name: wire.part(solution, name, {"map": 0.5}))
        text = gzip.decompress(packer.finish())
    assert text == result_json(solution, {"map": 0.5})
    assert chosen(text, packer.places, ["map", "sizes"]) == result_json(solution, include=["map", "sizes"])


def test_early_parts_are_those_of_the_result() -> None:
    solution = cylinder()
    for stage, parts in wire.EARLY.items():
        for name, make in parts.items():
            early = wire.dump(make(getattr(solution, stage)))
            assert early == wire.dump(wire.part(solution, name, {}))


def test_faults_of_a_part_are_raised_at_the_end() -> None:
    def stumble() -> Any:
        raise KeyError("a bug")

    with Packer(wire.dump) as packer:
        packer.add("map", stumble)
        packer.add("mesh", dict)
        assert "map" in packer
        with pytest.raises(KeyError, match="a bug"):
            packer.finish()
