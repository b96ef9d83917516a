"""What a worker does when its answer is sent, and not before."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable

log = logging.getLogger("hexwrap.later")
_TASKS: deque[Callable[[], None]] = deque()


def put_off(task: Callable[[], None]) -> None:
    """task: nothing depends on it."""
    _TASKS.append(task)


def catch_up() -> None:
    """Do everything that was put off."""
    while _TASKS:
        try:
            _TASKS.popleft()()
        except Exception:  # the worker goes on
            log.exception("what was put off failed")
