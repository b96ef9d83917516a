"""What a worker does when its answer is sent, and not before."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

_TASKS: deque[Callable[[], None]] = deque()


def put_off(task: Callable[[], None]) -> None:
    """task: fails silently or not at all."""
    _TASKS.append(task)


def catch_up() -> None:
    """Do everything that was put off."""
    while _TASKS:
        _TASKS.popleft()()
