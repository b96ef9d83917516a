"""Corners that make a map needlessly bad are told with a better place, others are not."""

from __future__ import annotations

import re

import numpy as np
import pytest

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryAngle, BoundaryCondition
from hexwrap_solver.surface import SentMesh, surface_from_mesh

N = 16


def square_with(*corners: int) -> tuple[str, ...]:
    """Notes on the map of a flat square of N × N with angles of 90° at four vertices of its boundary."""
    x, y = np.divmod(np.arange((N + 1) ** 2, dtype=float), N + 1)
    i, j = np.divmod(np.arange(N * N), N)
    a = i * (N + 1) + j
    faces = Ragged.from_table(np.stack([a, a + N + 1, a + N + 2, a + 1], axis=1))
    surface = surface_from_mesh(SentMesh(np.stack([x, y, 0 * x], axis=1), faces))
    angles = tuple(BoundaryAngle(np.pi / 2, vertex=v) for v in corners)
    return conformal_map(surface, BoundaryCondition("angles", angles)).notes


@pytest.mark.parametrize(("listed", "better"), [(0, None), (1, None), (4, 0), (3 * (N + 1), 0)])
def test_a_square_has_its_corners_where_it_turns(listed: int, better: int | None) -> None:
    """There it maps to itself with scale 1; a corner next to it does no harm worth a word."""
    notes = square_with(listed, N, N * (N + 1), (N + 1) ** 2 - 1)
    if better is None:
        assert not notes
    else:
        (note,) = notes
        assert re.search(rf"90° at vertex {listed}, .* at vertex {better}, \(0, 0, 0\), .* 1 times", note)
