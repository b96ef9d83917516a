"""Requests to test the service with."""

from __future__ import annotations

from typing import Any

import numpy as np


def tube(around: int = 24, rings: int = 10, radius: float = 3.0, height: float = 10.0) -> dict[str, Any]:
    """A waisted tube of triangles, as JSON."""
    t = 2 * np.pi * np.arange(around) / around
    z = np.linspace(0, height, rings)
    r = radius * (1 + 0.3 * np.cos(2 * np.pi * z / height))
    vertices = np.stack(
        [r[:, None] * np.cos(t), r[:, None] * np.sin(t), np.repeat(z[:, None], around, axis=1)], axis=-1
    ).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(around), np.arange(rings - 1))
    a, b = (j * around + i).ravel(), (j * around + (i + 1) % around).ravel()
    faces = np.concatenate([np.stack([a, b, b + around], 1), np.stack([a, b + around, a + around], 1)])
    return {"vertices": vertices.tolist(), "faces": faces.tolist()}


def request(**changes: Any) -> dict[str, Any]:
    """A small request that can be solved."""
    return {"surface": tube(), "pattern": {"around": 12}} | changes
