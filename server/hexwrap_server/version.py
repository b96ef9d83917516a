"""Which code made a result: remembered work is used again only by the very code that made it."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import hexwrap_server
import hexwrap_solver


@cache
def solver_version() -> str:
    """Version of the solver and a digest of its source."""
    return f"{hexwrap_solver.__version__}+{_source(hexwrap_solver.__file__)}"


@cache
def service_version() -> str:
    """Version and digest of solver and server together: what the text of a result depends on."""
    return f"{solver_version()}.{_source(hexwrap_server.__file__)}"


def _source(init: str) -> str:
    sha = hashlib.sha256()
    root = Path(init).parent
    for path in sorted(root.rglob("*.py")):
        sha.update(path.relative_to(root).as_posix().encode())
        sha.update(path.read_bytes())
    return sha.hexdigest()[:12]
