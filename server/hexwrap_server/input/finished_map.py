"""The map inside a finished result (``result.json``, ``result.npz``): lifting need not solve again."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hexwrap_server.cli.local import UsageError
from hexwrap_solver.conformal.types import ConformalMap, Deck, Unrolled
from hexwrap_solver.surface import Surface
from hexwrap_solver.surface.topology import vertex_normals

#: Value of ``part.field``.
Getter = Callable[[str], Any]


def map_in_result(path: Path) -> ConformalMap | None:
    """The map, or None where the file is no result. Raises UsageError for a result that is broken."""
    get = _getter(path)
    if get is None:
        return None
    try:
        return _map(get)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise UsageError(f"{path}: the result is incomplete ({type(error).__name__}: {error}).") from None


def _getter(path: Path) -> Getter | None:
    try:
        if path.suffix.lower() == ".npz":
            arrays = np.load(io.BytesIO(path.read_bytes()), allow_pickle=False)
            return arrays.__getitem__ if "map.uv" in arrays else None
        if path.suffix.lower() != ".json":
            return None
        result = json.loads(path.read_bytes())
    except (OSError, ValueError):  # the reader of surfaces says what is wrong with it
        return None
    if not isinstance(result, dict) or not isinstance(result.get("map"), dict):
        return None

    def get(name: str) -> Any:
        value: Any = result
        for step in name.split("."):
            value = value[int(step)] if isinstance(value, list) else value[step]
        return value

    return get


def _map(get: Getter) -> ConformalMap:
    vertices = np.asarray(get("mesh.vertices"), dtype=float).reshape(-1, 3)
    faces = np.asarray(get("mesh.faces"), dtype=np.int64).reshape(-1, 3)
    stands_at = np.asarray(get("mesh.input_vertex"), dtype=np.int64)
    of_input = np.full(int(stands_at.max(initial=-1)) + 1, -1)
    of_input[stands_at[stands_at >= 0]] = np.flatnonzero(stands_at >= 0)
    first, second = (np.asarray(get(f"mesh.loops.{i}"), dtype=np.int64) for i in range(2))
    normals = vertex_normals(vertices, faces)
    surface = Surface(vertices, faces, (first, second), stands_at, of_input, normals)
    theta, eta = (np.asarray(get(f"map.boundary_angles.{i}"), dtype=float) for i in range(2))
    uv, translation = (np.asarray(get(f"map.{name}"), dtype=float) for name in ("uv", "deck.translation"))
    return ConformalMap(
        surface=surface,
        log_scale=np.asarray(get("map.log_scale"), dtype=float),
        domain=Unrolled(
            uv[:, 0] + 1j * uv[:, 1],
            np.asarray(get("map.sheet"), dtype=np.int64).reshape(-1, 3),
            Deck(float(get("map.deck.angle")), complex(*translation.tolist())),
            float(get("map.circumference")),
        ),
        boundary_angles=(theta, eta),
        iterations=0,
        residual=float(get("map.residual")),
        flips=int(get("map.flips")),
    )
