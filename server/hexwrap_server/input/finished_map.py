"""The map inside a finished result (``result.json``, ``result.npz``): lifting need not solve again."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hexwrap_server.errors import UsageError
from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap, Deck, Unrolled
from hexwrap_solver.surface import Surface
from hexwrap_solver.surface.topology import vertex_normals

#: Value of ``part.field``.
Getter = Callable[[str], Any]


def map_in_result(path: Path) -> ConformalMap | None:
    """The map, or None where the file is not a result. Raises UsageError for a result that is broken."""
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
            return arrays.__getitem__ if "map.log_scale" in arrays else None
        if path.suffix.lower() != ".json":
            return None
        result = json.loads(path.read_bytes())
    except (OSError, ValueError):  # the reader of surfaces says what is wrong with it
        return None
    if not isinstance(result, dict) or not isinstance(result.get("map"), dict):
        return None

    return _in_dictionary(result)


def _in_dictionary(result: dict[str, Any]) -> Getter:
    def get(name: str) -> Any:
        value: Any = result
        for step in name.split("."):
            value = value[int(step)] if isinstance(value, list) else value[step]
        return value

    return get


def _known(get: Getter, name: str) -> Any:
    """None where the value is missing."""
    try:
        return get(name)
    except (KeyError, IndexError):
        return None


def _domain(get: Getter, surface: Surface) -> Unrolled | Net:
    uv = _known(get, "map.uv")
    if uv is None:
        corners = np.asarray(get("map.corners"), dtype=float)
        return Net.of_corners(corners[..., 0] + 1j * corners[..., 1], surface.twin)
    uv, translation = np.asarray(uv, dtype=float), np.asarray(get("map.deck.translation"), dtype=float)
    return Unrolled(
        uv[:, 0] + 1j * uv[:, 1],
        np.asarray(get("map.sheet"), dtype=np.int64).reshape(-1, 3),
        Deck(float(get("map.deck.angle")), complex(*translation.tolist())),
        float(get("map.circumference")),
    )


def _map(get: Getter) -> ConformalMap:
    vertices = np.asarray(get("mesh.vertices"), dtype=float).reshape(-1, 3)
    faces = np.asarray(get("mesh.faces"), dtype=np.int64).reshape(-1, 3)
    stands_at = np.asarray(get("mesh.input_vertex"), dtype=np.int64)
    of_input = np.full(int(stands_at.max(initial=-1)) + 1, -1)
    of_input[stands_at[stands_at >= 0]] = np.flatnonzero(stands_at >= 0)
    loops: list[Ints] = []
    angles: list[Floats] = []
    while (loop := _known(get, f"mesh.loops.{len(loops)}")) is not None:
        angles.append(np.asarray(get(f"map.boundary_angles.{len(loops)}"), dtype=np.float64))
        loops.append(np.asarray(loop, dtype=np.int64))
    normals = vertex_normals(vertices, faces)
    surface = Surface(vertices, faces, tuple(loops), stands_at, of_input, normals)
    return ConformalMap(
        surface=surface,
        log_scale=np.asarray(get("map.log_scale"), dtype=float),
        domain=_domain(get, surface),
        boundary_angles=tuple(angles),
        iterations=0,
        residual=float(get("map.residual")),
        flips=int(get("map.flips")),
    )
