"""What it costs to move the sides of a domain: the conformal error of the least deformation that does it.

The least-squares deformation of ``deform`` is linear in the distances by which the sides are moved, so that
one solution per side tells the error of every way of choosing lines. The estimate leaves out what reweighting
gains later, and is good enough to choose by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats
from hexwrap_solver.pattern.place.deform import System
from hexwrap_solver.pattern.place.sides import Lines, Sides
from hexwrap_solver.tolerances import RELATIVE

#: Moves that are solved for together: a compromise of time and memory.
TOGETHER = 8


@dataclass(frozen=True)
class Strain:
    """Columns: one per side, moved by 1 into the domain; on translations two more, for the deck
    transformation moved by 1 and by i; and one for a scale of 1 itself, at which sides that are turned out of
    the lattice's directions are turned back. response: (m, columns) ∂/∂z̄ of the least deformation. area:
    (m,) parts of the whole. squares: (columns, columns) ∫ of products of the columns."""

    response: Complexes
    area: Floats
    squares: Floats

    @classmethod
    def of(cls, system: System, sides: Sides, lines: Lines, turned: Floats) -> Strain:
        """system: for the sides' lines. turned: (k,) how much deeper, at scale 1, the sides' mean depth is
        than their vertices are."""
        area = system.change.area / system.change.area.sum()
        moves = [(np.where(lines.side == k, 1.0, 0.0), 0j) for k in range(sides.n)]
        if system.cmap.deck.apex is None:
            moves += [(-(lines.normal.conj() * lines.sheet * step).real, step) for step in (1 + 0j, 1j)]
        moves.append((np.where(lines.side >= 0, turned[lines.entry], 0.0), 0j))
        blocks = [
            _responses(system, np.sqrt(area), moves[i : i + TOGETHER]) for i in range(0, len(moves), TOGETHER)
        ]
        response = np.concatenate(blocks, axis=1)
        squares = ((response.conj() * area[:, None]).T @ response).real
        return cls(response, np.asarray(area), np.asarray(squares))

    def mean(self, moved: Floats) -> Floats:
        """(…) root mean square of |∂/∂z̄| where the columns are moved by so much, (…, columns)."""
        return np.asarray(np.sqrt(np.maximum(((moved @ self.squares) * moved).sum(axis=-1), 0.0)))

    def sharp(self, moved: Floats) -> float:
        """Its fourth-power mean, which heeds the worst places more."""
        return float((self.area @ np.abs(self.response @ moved) ** 4) ** 0.25)

    def ratios(self, moved: Floats, scale: float) -> Floats:
        """(m,) predicted ratios of singular values − 1."""
        bent = abs(self.response @ moved)
        return np.asarray(2 * bent / np.maximum(scale - bent, RELATIVE * scale))

    def nearest(self, moved: Floats, period: Floats) -> Floats:
        """(t, columns) moves of the first columns, one per period, changed by multiples of them, as long as
        any single change lessens ``mean``."""
        moved, sides = moved.copy(), len(period)
        own = period * period * np.diag(self.squares)[:sides]
        product = moved @ self.squares[:, :sides]
        rows = np.arange(len(moved))
        for _ in range(4 * sides):
            slope = 2 * period * product[rows]
            gain = own - np.abs(slope)
            k = gain.argmin(axis=1)
            better = np.flatnonzero(gain[np.arange(len(k)), k] < -1e-12 * own[k])
            if not len(better):
                break
            rows, k = rows[better], k[better]
            change = -period[k] * np.sign(slope[better, k])
            moved[rows, k] += change
            product[rows] += change[:, None] * self.squares[k, :sides]
        return moved


def _responses(system: System, weight: Floats, moves: list[tuple[Floats, complex]]) -> Complexes:
    """(m, moves) ∂/∂z̄ of the least deformations for moves of the lines (n, 2) and of g."""
    change, freedom = system.change, system.freedom
    fixed = np.stack([freedom.place_on_lines(depth) for depth, _ in moves], axis=1)
    shifts = [change.of_shift(np.asarray(system.cmap.sheet * step)) for _, step in moves]
    shift = np.stack([one for one, _ in shifts], axis=1), np.stack([two for _, two in shifts], axis=1)
    angles, sizes = change.of(fixed, shift)
    still = np.zeros((freedom.basis.shape[1], len(moves)))
    return change.of(fixed + system.solve(weight, -angles, -sizes, still), shift)[0]
