"""Functions for worker processes to call in tests: well behaved, slow, hungry, deadly."""

from __future__ import annotations

import gc
import logging
import os
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from hexwrap_server import logs
from hexwrap_server.jobs.worker import Report
from hexwrap_solver.errors import RequestError


def echo(report: Report, value: Any) -> Any:
    return value


def pid(report: Report) -> int:
    return os.getpid()


def environment(report: Report, name: str) -> str | None:
    return os.environ.get(name)


def frozen(report: Report) -> int:
    """Objects that are left out when garbage is looked for."""
    return gc.get_freeze_count()


def complain(report: Report, job: str) -> None:
    logs.at_work_for(job)
    logging.getLogger("hexwrap.calls").warning("something is odd")
    warnings.warn("a library says", stacklevel=1)
    raise ValueError("a bug")


def talk(report: Report) -> str:
    print("this must not end up between the frames")
    report("first", 0.25, "a quarter")
    report("second", 0.75, "three quarters")
    return "talked"


def refuse(report: Report) -> None:
    raise RequestError("It cannot be.", vertices=[3], data={"missing": 0.5})


def refuse_with(report: Report, data: dict[str, Any], *arguments: Any) -> None:
    raise RequestError("It cannot be.", data=data)


def stumble(report: Report) -> None:
    raise KeyError("a bug")


def die(report: Report) -> None:
    os._exit(7)


def sleep(report: Report, seconds: float, mark: str = "") -> str:
    """Busy for seconds; mark: a file made at the start."""
    if mark:
        Path(mark).touch()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(0.01)
    return "slept"


def wait_for(report: Report, gate: str) -> str:
    """Until there is a file; says that it waits."""
    report("waiting", 0.5, gate)
    while not Path(gate).exists():
        time.sleep(0.01)
    return "waited"


def crunch(report: Report, n: int, mark: str) -> None:
    """Inside of one numpy call for a long time."""
    Path(mark).touch()
    np.linalg.svd(np.ones((n, n)) + np.eye(n))


def hoard(report: Report, mib: int) -> int:
    """Hold memory until somebody minds."""
    kept = bytearray(mib * 2**20)
    kept[::4096] = b"x" * len(kept[::4096])
    time.sleep(120)
    return len(kept)


def unpicklable(report: Report) -> Any:
    return lambda: None


def solve_after(report: Report, seconds: float, *arguments: Any) -> Any:
    """A job that takes its time first."""
    from hexwrap_server.jobs.work import solve

    report("surface", 0.01, "waiting")
    time.sleep(seconds)
    return solve(report, *arguments)


def solve_held(report: Report, stage: str, gate: str, *arguments: Any) -> Any:
    """A job that stays at a stage until there is a file."""
    from hexwrap_server.jobs.work import solve

    def held(at: str, fraction: float, what: str) -> None:
        report(at, fraction, what)
        while at == stage and not Path(gate).exists():
            time.sleep(0.01)

    return solve(held, *arguments)


def die_at_once(report: Report, *arguments: Any) -> None:
    os._exit(9)
