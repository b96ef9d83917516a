"""The unrolled domain as a net: triangles in the plane, glued across their edges by motions.

Cylinders, cones, disks, rings with openings and domains with singularities are all nets. Beside face f,
across its half-edge c, stands the triangle M(corners[across[f, c]]) where M is the motion crossing[f, c] of a
table. "The same place" is therefore a matter of faces and motions, never of coordinates, so that a net may
overlap itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap


@dataclass(frozen=True)
class Net:
    """Half-edge c of face f runs from corner c to corner c + 1.

    corners: (m, 3) complex; every face positively oriented. across: (m, 3) face on the other side of each
    half-edge, −1 at the boundary. crossing: (m, 3) row in the table of motions z ↦ e^{i·angle} z +
    translation, 0 the identity. angle: (t,) radians, not reduced where whole turns mean something.
    translation: (t,) complex. inverse: (t,) row of the inverse motion. winding: (t,) on annuli: which power
    of the deck transformation each motion is; None elsewhere.
    """

    corners: Complexes
    across: Ints
    crossing: Ints
    angle: Floats
    translation: Complexes
    inverse: Ints
    winding: Ints | None


def net_of(cmap: ConformalMap) -> Net:
    """The net of an annulus: every motion is a power of the deck transformation."""
    sheet, twin = cmap.sheet, cmap.surface.twin
    inner = twin >= 0
    # The tail of a half-edge is the head of its twin: both must name the same vertex of the cover.
    head_sheet = np.roll(sheet, -1, axis=1).ravel()
    across = np.where(inner, twin // 3, -1)
    shift = np.where(inner, sheet.ravel() - head_sheet[twin], 0)
    farthest = int(abs(shift).max(initial=0))
    winding = np.concatenate([np.arange(farthest + 1), -np.arange(1, farthest + 1)])
    crossing = np.where(shift >= 0, shift, farthest - shift)
    inverse = np.concatenate([[0], farthest + np.arange(1, farthest + 1), np.arange(1, farthest + 1)])
    _, translation = cmap.deck.power(winding)
    return Net(
        cmap.corners(),
        across.reshape(-1, 3),
        crossing.reshape(-1, 3),
        cmap.deck.angle * winding,
        np.asarray(translation),
        inverse,
        winding,
    )
