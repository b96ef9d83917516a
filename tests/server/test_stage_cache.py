"""Stages on disk and in memory: what was put comes out, what is damaged does not."""

from __future__ import annotations

import errno
import json
import os
import time
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from hexwrap_server import samples
from hexwrap_server.errors import CodecError, StorageError
from hexwrap_server.input.requests import SentSurface, Wanted
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs import codec
from hexwrap_server.jobs.cache import SHARES, CachingRunner, StageCache, size_of
from hexwrap_server.jobs.codec import decode, digest, encode
from hexwrap_server.jobs.disk import prune, write_whole
from hexwrap_server.jobs.work import packed_result, run_stages
from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal.types import BoundaryCondition, Deck
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern.types import PatternSettings
from tests.server.analytic import cylinder

numbers = st.integers() | st.floats(allow_nan=False) | st.complex_numbers(allow_nan=False)
scalars = st.none() | st.booleans() | st.text() | numbers
values = st.recursive(
    scalars, lambda inner: st.lists(inner) | st.tuples(inner, inner) | st.dictionaries(st.text(), inner)
)


@given(values)
@settings(deadline=None)
def test_values_come_out_as_they_went_in(value: Any) -> None:
    assert decode(encode(value)) == value


@settings(deadline=None)
@given(arrays.arrays(st.sampled_from([np.float64, np.int64, np.bool_, np.complex128]), arrays.array_shapes()))
def test_arrays_come_out_as_they_went_in(array: np.ndarray[Any, Any]) -> None:
    back = decode(encode(array))
    assert back.dtype == array.dtype
    assert np.array_equal(back, array, equal_nan=array.dtype.kind in "fc")


def test_arrays_come_out_where_numbers_may_stand_and_cannot_be_changed() -> None:
    back = decode(encode([np.ones(3, dtype=bool), np.ones(3), np.ones(3, dtype=complex)]))
    assert all(array.flags.aligned and not array.flags.writeable for array in back)


def test_solutions_come_out_as_they_went_in() -> None:
    solution = cylinder()
    back = decode(encode(solution))
    assert digest(back) == digest(solution)
    assert isinstance(back.panels.polygons, Ragged)
    assert back.map.deck == solution.map.deck


def test_digest_depends_on_every_value() -> None:
    basis = PatternSettings(around=12)
    assert digest(basis) == digest(PatternSettings(around=12))
    others = [PatternSettings(around=13), PatternSettings(around=12, kind="quad"), BoundaryCondition(), None]
    assert len({digest(basis), *map(digest, others)}) == 5
    assert digest(BoundaryCondition(angle_unit="deg")) == digest(BoundaryCondition())  # presentation
    assert decode(encode(BoundaryCondition(angle_unit="deg"))).angle_unit == "deg"
    assert digest(np.zeros(2)) != digest(np.zeros(3))
    assert digest(np.arange(6).reshape(2, 3)) != digest(np.arange(6).reshape(3, 2))
    assert digest(np.arange(6).reshape(2, 3).T) == digest(np.arange(6).reshape(2, 3).T.copy())


@pytest.mark.parametrize(
    "damage", [lambda b: b[:-1], lambda b: b[:20] + b"?" + b[21:], lambda b: b"", lambda b: b"x" * 99]
)
def test_damage_is_noticed(damage: Any) -> None:
    with pytest.raises(CodecError):
        decode(damage(encode(Deck(0.0, 1 + 2j))))


@pytest.mark.parametrize("value", [object(), {1, 2}, np.array(["text"]), Path("/")])
def test_foreign_things_are_not_stored(value: object) -> None:
    with pytest.raises(TypeError):
        encode(value)


@pytest.mark.parametrize("place", ["subprocess:Popen", "hexwrap_solver.arrays:np", "hexwrap_solver.gone:X"])
def test_foreign_classes_do_not_come_out(place: str) -> None:
    header = json.dumps({"value": {"object": place, "fields": {}}, "arrays": []}).encode()
    forged = codec._HEAD.pack(codec._MAGIC, len(header), zlib.crc32(header)) + header
    with pytest.raises(CodecError, match="version"):
        decode(forged)


def runner(folder: Path | None, memory: int = 10**8) -> CachingRunner:
    return CachingRunner(StageCache(folder, memory), lambda stage, fraction, what: None)


def stages(run: CachingRunner, asked: tuple[int, int]) -> int:
    """Two stages; how many were computed."""
    computed = []

    def compute(name: str) -> np.ndarray[Any, Any]:
        computed.append(name)
        return np.ones(100)

    run("map", asked[0], lambda progress: compute("map"))
    run("pattern", asked[1], lambda progress: compute("pattern"))
    return len(computed)


def test_stage_is_known_by_its_settings_and_all_before(tmp_path: Path) -> None:
    assert stages(runner(tmp_path), (1, 1)) == 2
    assert stages(runner(tmp_path), (1, 1)) == 0
    assert stages(runner(tmp_path), (1, 2)) == 1
    assert stages(runner(tmp_path), (2, 1)) == 2
    assert stages(runner(None), (1, 1)) == 2


def test_full_disk_costs_no_stage(tmp_path: Path) -> None:
    cache = StageCache(tmp_path / "missing", 1000)
    cache.put("a", 1)
    assert cache.get("a") == (1, "memory")


def test_files_are_written_whole_or_not_at_all(tmp_path: Path) -> None:
    def content() -> Iterator[bytes]:
        yield b"half"
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(StorageError, match="No space left on device"):
        write_whole(tmp_path / "file", content())
    assert list(tmp_path.iterdir()) == []


def test_damaged_stage_is_computed_again(tmp_path: Path) -> None:
    stages(runner(tmp_path), (1, 1))
    for path in tmp_path.glob("*.stage"):
        path.write_bytes(path.read_bytes()[:-3])
    assert stages(runner(tmp_path), (1, 1)) == 2
    assert stages(runner(tmp_path), (1, 1)) == 0


def test_memory_has_a_limit_and_keeps_the_last_used() -> None:
    cache = StageCache(None, 3 * 8000)
    for name in "abc":
        cache.put(name, np.zeros(1000))
    assert cache.get("a") is not None
    cache.put("d", np.zeros(1000))
    assert [name for name in "abcd" if cache.get(name)] == ["a", "c", "d"]
    cache.put("large", np.zeros(10_000))
    assert cache.get("large") is None


def test_memory_counts_what_was_derived_from_a_stage() -> None:
    surface = cylinder().map.surface
    plain = size_of(surface)
    cache = StageCache(None, 2 * plain)
    cache.put("surface", surface)
    assert cache.get("surface") is not None
    assert surface.tree is not None
    assert size_of(surface) > 2 * plain
    cache.weigh()
    assert cache.get("surface") is None


def test_a_stage_beside_the_others_is_kept_whatever_changes_between() -> None:
    cache = StageCache(None, 10**8)
    found = []
    for around in (10, 11):
        run = CachingRunner(cache, lambda stage, fraction, what: None)
        run("map", 1, lambda progress: 1)
        run("pattern", around, lambda progress: 1)
        assert run("outlook", None, lambda progress: 7, after="map") == 7
        run("panels", None, lambda progress: 1)
        found.append(run.found)
    assert found[1] == {"map": "memory", "pattern": "computed", "outlook": "memory", "panels": "computed"}


def test_a_change_answers_to_the_byte_as_if_nothing_were_remembered() -> None:
    request = parse_request(samples.load("box"), 10**6, 10**6)
    assert isinstance(request.surface, SentSurface)
    assert isinstance(request.wanted, Wanted)
    kept = StageCache(None, 10**8)

    def solved(cache: StageCache, around: int, sizes: int) -> tuple[bytes, bytes]:
        assert isinstance(request.surface, SentSurface)
        pattern = PatternSettings(around=around, boundary="trim")
        wanted = replace(request.wanted, pattern=pattern, panels=PanelSettings(sizes=sizes))
        run = CachingRunner(cache, lambda stage, fraction, what: None)
        solution = run_stages(request.surface, wanted, run)
        run.timings.clear()
        return encode(solution), b"".join(packed_result(solution, run))

    for around, sizes in ((40, 5), (24, 5), (20, 5), (20, 7)):  # from 40 to 20 other singularities are near
        answer = solved(kept, around, sizes)
    assert answer == solved(StageCache(None, 0), 20, 7)


def test_another_number_of_sizes_changes_nothing_but_panels() -> None:
    """Not even what else could be proposed is looked for anew."""
    request = parse_request(samples.load("isometric"), 10**6, 10**6)
    assert isinstance(request.surface, SentSurface)
    assert isinstance(request.wanted, Wanted)
    kept, found = StageCache(None, 10**8), []
    for sizes in (3, 4):
        wanted = replace(
            request.wanted, boundary=BoundaryCondition("straight"), panels=PanelSettings(sizes=sizes)
        )
        run = CachingRunner(kept, lambda stage, fraction, what: None)
        run_stages(request.surface, wanted, run)
        found.append(run.found)
    assert found[0]["other boundary"] == "computed"
    assert {stage for stage, where in found[1].items() if where == "computed"} == {"panels", "quality"}


def test_progress_never_goes_back() -> None:
    heard: list[float] = []
    run = CachingRunner(StageCache(None, 0), lambda stage, fraction, what: heard.append(fraction))

    def compute(progress: Any) -> int:
        for fraction in (-1, 0.2, 0.9, 3):
            progress(fraction, "")
        return 1

    for stage in SHARES:
        run(stage, None, compute)
    assert heard == sorted(heard)
    assert (heard[0], heard[-1]) == (0.0, pytest.approx(1.0))


def test_pruning_keeps_the_last_used(tmp_path: Path) -> None:
    for i in range(5):
        write_whole(tmp_path / f"{i}.stage", [bytes(1000)])
        os.utime(tmp_path / f"{i}.stage", (time.time() - 10_000 + i,) * 2)
    os.utime(tmp_path / "0.stage")
    for name, age in (("2.stage.ab.part", 10_000), ("3.stage.cd.part", 0)):
        write_whole(tmp_path / name, [b""])
        os.utime(tmp_path / name, (time.time() - age,) * 2)
    prune(tmp_path, 3000, keep=lambda name: name == "1.stage")
    left = ["0.stage", "1.stage", "3.stage", "3.stage.cd.part", "4.stage"]
    assert sorted(p.name for p in tmp_path.iterdir()) == left
    prune(tmp_path, 0)
    # young: somebody may be about to name them
    assert sorted(p.name for p in tmp_path.iterdir()) == ["0.stage", "3.stage.cd.part"]


def test_sizes_count_arrays() -> None:
    assert size_of(np.zeros(1000)) == 8000
    assert size_of(Ragged(np.zeros((10, 3)), np.arange(6))) > 240
