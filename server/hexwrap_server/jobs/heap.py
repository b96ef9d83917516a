"""Memory that the next job will need, fetched from the system in a pause.

Stages that are remembered keep their arrays, so that the next job needs as much again, and gets it page by
page while it computes: 4,600 pages for 20,000 vertices with their panels.
"""

from __future__ import annotations

import platform
from collections.abc import Callable

import numpy as np

#: Bytes that are fetched at most, and at the first time; and in one piece.
MOST, FIRST, PIECE = 64 * 2**20, 32 * 2**20, 2**20
#: What one pause fetched was enough where jobs got less than ENOUGH by themselves since: then the next one
#: fetches this share of it.
ENOUGH, FADE = PIECE, 0.95
PAGE = 4096


def page_faults() -> int | None:
    """Pages that this process got from the system so far. None where memory that was given back does not stay
    with the process (see ``worker.KEEP_MEMORY``): there is nothing to be gained."""
    if platform.libc_ver()[0] != "glibc":
        return None
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt


class Heap:
    """The heap of this process."""

    def __init__(self, count: Callable[[], int | None] = page_faults) -> None:
        self._count = count
        self._wanted = float(FIRST)
        self._seen = count()

    def fetch(self) -> int:
        """Get and give back as much as jobs needed since the last time. Returns how many bytes that was."""
        now = self._count()
        if now is None or self._seen is None:
            return 0
        missing = (now - self._seen) * PAGE  # besides what was fetched for them
        self._wanted = min(self._wanted + missing, MOST) if missing > ENOUGH else FADE * self._wanted
        pieces = [np.ones(PIECE // 8) for _ in range(int(self._wanted) // PIECE)]
        self._seen = self._count()
        return len(pieces) * PIECE
