"""Straight sides made straight to the last digit."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Complexes, Ints
from hexwrap_solver.conformal.types import Deck, Targets
from hexwrap_solver.surface.types import Surface

#: Target angles this near to π are meant to be π.
ROUNDING = 1e-13


def straighten(surface: Surface, targets: Targets, uv: Complexes, sheet: Ints, deck: Deck) -> Complexes:
    """uv with the boundary vertices of target angle π moved onto the line between the corners of their side.

    They stand there up to rounding already; but triangles at the boundary may be as thin as rounding.
    """
    uv = uv.copy()
    step = np.full(len(uv), 0)
    following = np.full(len(uv), -1)
    for loop in surface.loops:
        following[loop] = np.roll(loop, -1)
    tail, head = surface.faces.ravel(), np.roll(surface.faces, -1, axis=1).ravel()
    along = following[tail] == head
    step[tail[along]] = (np.roll(sheet, -1, axis=1) - sheet).ravel()[along]
    for loop in surface.loops:
        corner = (np.abs(targets.angle[loop] - np.pi) > ROUNDING) | (targets.shared[loop] >= 0)
        if corner.any():
            loop = np.roll(loop, -int(np.argmax(corner)))
            _project(uv, loop, np.roll(corner, -int(np.argmax(corner))), step[loop], deck)
        else:  # a cylinder, see ``normalise``
            uv.imag[loop] = uv.imag[loop].mean()
    return uv


def _project(uv: Complexes, loop: Ints, corner: np.ndarray, step: Ints, deck: Deck) -> None:
    """One loop, starting at a corner. step: (k,) power of g from each vertex's copy to the next one's."""
    power = np.concatenate([[0], np.cumsum(step)])
    place = deck.apply(uv[np.append(loop, loop[0])], power)
    ends = np.append(np.flatnonzero(corner), len(loop))
    side = np.cumsum(corner) - 1
    start = place[ends[side]]
    direction = place[ends[side + 1]] - start
    direction /= np.maximum(np.abs(direction), np.finfo(float).tiny)  # a side may have no length in doubles
    moved = start + (np.conj(direction) * (place[:-1] - start)).real * direction
    inside = ~corner
    uv[loop[inside]] = deck.apply(moved[inside], -power[:-1][inside])
