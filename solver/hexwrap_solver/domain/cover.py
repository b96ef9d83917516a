"""The universal cover of the annulus, triangle by triangle.

A triangle of the cover is a pair (face f, sheet s): the triangle g^s(corners of f). Neighbourhood in the
cover is carried by one integer per half-edge, so that "the same place, one turn further" is never confused
with "the same place", even where the unrolled domain overlaps itself (|K| > 2π).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Ints
from hexwrap_solver.conformal.types import ConformalMap


@dataclass(frozen=True)
class Cover:
    """Half-edge c of face f runs from corner c to corner c + 1.

    across: (m, 3) face on the other side of each half-edge, −1 at the boundary.
    shift: (m, 3) triangle (f, s) has the neighbour (across, s + shift).
    """

    across: Ints
    shift: Ints


def cover_of(cmap: ConformalMap) -> Cover:
    """Adjacency of the universal cover, from the map's faces and sheets."""
    sheet, twin = cmap.sheet, cmap.surface.twin
    inner = twin >= 0
    # The tail of a half-edge is the head of its twin: both must name the same vertex of the cover.
    head_sheet = np.roll(sheet, -1, axis=1).ravel()
    across = np.where(inner, twin // 3, -1)
    shift = np.where(inner, sheet.ravel() - head_sheet[twin], 0)
    return Cover(across.reshape(-1, 3), shift.reshape(-1, 3))
