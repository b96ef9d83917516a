"""Processes load what they need, when they need it: a server and its workers start in the time of that, and
they listen before."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.server.patience import PATIENCE

#: Libraries of single file formats and pictures, and a third of SciPy that few steps use.
FORMATS = {"matplotlib", "ezdxf", "scipy.ndimage", "scipy.optimize"}


def environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": os.pathsep.join(os.path.abspath(p or ".") for p in sys.path)}


@contextmanager
def child(program: str) -> Iterator[subprocess.Popen[bytes]]:
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", program, "CRITICAL"]
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, env=environment()) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize(
    ("module", "not_loaded"),
    [
        ("http.app", FORMATS | {"hexwrap_server.http.openapi"}),
        ("jobs.work", FORMATS | {"fastapi"}),
        ("jobs.reading", FORMATS | {"fastapi"}),
        ("jobs.worker", FORMATS | {"scipy"}),  # it listens before it loads anything large
    ],
)
def test_what_is_not_loaded_at_the_start(module: str, not_loaded: set[str]) -> None:
    program = f"import sys, hexwrap_server.{module}; print(*sys.modules)"
    ran = subprocess.run(
        [sys.executable, "-c", program],
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = set(ran.stdout.split())
    assert "hexwrap_server" in loaded
    assert not loaded & not_loaded


def test_worker_that_cannot_be_spoken_to_leaves() -> None:
    """A word is announced that is larger than any memory."""
    with child("from hexwrap_server.jobs.worker import main; main()") as process:
        assert process.stdin is not None
        process.stdin.write((2**62).to_bytes(8, "little"))
        process.stdin.flush()
        assert process.wait(timeout=PATIENCE) == 0


def test_standard_input_is_left_to_nobody() -> None:
    """On Windows a library that looks at it while it is loaded waits for the thread that reads there."""
    program = (
        "import os; from hexwrap_server.jobs.pipes import pipes_of_child; inlet, outlet = pipes_of_child(); "
        "outlet.write(os.read(0, 9) + b', ' + inlet.read()); outlet.flush()"
    )
    with child(program) as process:
        said, _ = process.communicate(b"hear me", timeout=PATIENCE)
    assert said == b", hear me"
