"""Bundled surfaces, each a complete request body."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

_FOLDER = Path(__file__).parent


def names() -> list[str]:
    """The samples, alphabetically."""
    return sorted(file.stem for file in _FOLDER.glob("*.json"))


def load(name: str) -> dict[str, Any]:
    """The request body of a sample. Raises KeyError for a name that is not in names()."""
    if name not in names():
        raise KeyError(name)
    body: dict[str, Any] = json.loads((_FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return body


def path_3dm(name: str) -> Path:
    """The same surface as a Rhino file. Raises KeyError for a name that is not in names()."""
    if name not in names():
        raise KeyError(name)
    return _FOLDER / f"{name}.3dm"
