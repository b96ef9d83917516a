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
    partner: (m, 3) the same edge's number inside the other face, −1 at the boundary.
    """

    across: Ints
    shift: Ints
    partner: Ints


def cover_of(cmap: ConformalMap) -> Cover:
    """Adjacency of the universal cover, from the map's faces and sheets. O(m log m)."""
    faces, sheet = cmap.surface.faces, cmap.sheet
    m = len(faces)
    tail, head = faces, np.roll(faces, -1, axis=1)
    n = len(cmap.uv)
    key = (np.minimum(tail, head) * n + np.maximum(tail, head)).ravel()
    order = np.argsort(key, kind="stable")
    twins = np.flatnonzero(key[order][1:] == key[order][:-1])
    first, second = order[twins], order[twins + 1]
    partner_of = np.full(3 * m, -1, dtype=np.int64)
    partner_of[first], partner_of[second] = second, first
    inner = partner_of >= 0
    across = np.where(inner, partner_of // 3, -1)
    partner = np.where(inner, partner_of % 3, -1)
    # The tail of a half-edge is the head of its twin: both must name the same vertex of the cover.
    head_sheet = np.roll(sheet, -1, axis=1).ravel()
    shift = np.where(inner, sheet.ravel() - head_sheet[partner_of], 0)
    return Cover(across.reshape(m, 3), shift.reshape(m, 3), partner.reshape(m, 3))
