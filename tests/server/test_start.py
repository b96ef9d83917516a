"""Processes load what they need, when they need it: a server and its workers start in the time of that."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

#: Libraries of single file formats and pictures.
FORMATS = {"matplotlib", "ezdxf", "trimesh"}


@pytest.mark.parametrize(
    ("module", "not_loaded"),
    [
        ("app", FORMATS),
        ("work", FORMATS | {"fastapi"}),
        ("scribe", FORMATS | {"fastapi", "pydantic"}),
        ("worker", FORMATS | {"scipy"}),  # these two listen before they load anything large
        ("scribe_main", FORMATS | {"scipy"}),
    ],
)
def test_what_is_not_loaded_at_the_start(module: str, not_loaded: set[str]) -> None:
    paths = os.pathsep.join(os.path.abspath(p or ".") for p in sys.path)
    program = f"import sys, hexwrap_server.{module}; print(*{{name.split('.')[0] for name in sys.modules}})"
    ran = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = set(ran.stdout.split())
    assert "hexwrap_server" in loaded
    assert not loaded & not_loaded
