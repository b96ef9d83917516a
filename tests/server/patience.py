"""How long a test waits for what must come. Only a test that fails waits as long."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

#: Seconds; the one figure for all waits, whatever else the machine has to do.
PATIENCE = 300.0


def until(look: Callable[[], T], what: str = "it") -> T:
    """What look answers, once that is true."""
    deadline = time.monotonic() + PATIENCE
    while not (found := look()):
        assert time.monotonic() < deadline, f"{what} did not come"
        time.sleep(0.02)
    return found
