"""Memory for factorisations that is used again by the next one.

Memory that a process has not touched before comes page by page from the system, which on some machines takes
as long as the arithmetic in it. So the last array that was given back is kept for whoever asks next.
"""

from __future__ import annotations

import weakref

import numpy as np

from hexwrap_solver.arrays import Floats

#: The largest array that is kept, in numbers (64 MiB); and how many times larger than asked for it may be.
LARGEST, SLACK = 2**23, 4

_SPARE: list[Floats] = []


def borrow(size: int, owner: object) -> Floats:
    """(size,) numbers, not initialized. They are lent until ``owner`` is gone, and no view of them may
    outlive it."""
    try:
        array = _SPARE.pop()
    except IndexError:
        array = np.zeros(0)
    if not size <= len(array) <= SLACK * size:
        array = np.empty(size)
    if len(array) <= LARGEST:
        weakref.finalize(owner, _give_back, array).atexit = False
    return array[:size]


def _give_back(array: Floats) -> None:
    _SPARE[:] = [array]
