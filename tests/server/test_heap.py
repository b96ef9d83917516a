"""What jobs fetched from the system is fetched again in the next pause, and no more."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from hexwrap_server.jobs.heap import FADE, FIRST, MOST, PAGE, PIECE, Heap, page_faults
from hexwrap_server.jobs.worker import KEEP_MEMORY


def test_as_much_as_was_needed_fading_and_bounded() -> None:
    count = [0]
    heap = Heap(lambda: count[0])
    assert heap.fetch() == int(FADE * FIRST) // PIECE * PIECE
    for _ in range(100):
        heap.fetch()
    assert heap.fetch() == 0
    count[0] += 5 * PIECE // PAGE
    assert heap.fetch() == 5 * PIECE
    assert heap.fetch() == 4 * PIECE
    count[0] += 10 * MOST // PAGE
    assert heap.fetch() == MOST


def test_what_was_missing_comes_on_top_of_what_was_fetched() -> None:
    need, count = 20 * PIECE, [0]
    heap = Heap(lambda: count[0])
    missing = []
    for _ in range(100):
        fetched = heap.fetch()
        missing.append(max(need - fetched, 0))
        count[0] += missing[-1] // PAGE
    assert 0 < max(missing[50:]) <= (1 - FADE) * need + 2 * PIECE


def test_elsewhere_nothing_is_done() -> None:
    assert Heap(lambda: None).fetch() == 0


KEPT = """
import numpy as np
from hexwrap_server.jobs.heap import Heap, page_faults
kept, heap = [], Heap()
for fetch in (False, True):
    if fetch:
        heap.fetch()
    before = page_faults()
    kept.append([np.ones(2**15) for _ in range(64)])
    print(page_faults() - before)
"""


@pytest.mark.skipif(page_faults() is None, reason="not the GNU C library")
def test_memory_that_was_fetched_costs_no_page_faults() -> None:
    paths = os.pathsep.join(os.path.abspath(p or ".") for p in sys.path)
    ran = subprocess.run(
        [sys.executable, "-c", KEPT],
        env=os.environ | KEEP_MEMORY | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=True,
    )
    without, with_it = map(int, ran.stdout.split())
    assert without > 64 * np.ones(2**15).nbytes / PAGE / 2
    assert with_it < without / 10
