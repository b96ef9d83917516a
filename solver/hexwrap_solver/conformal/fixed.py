"""Newton's method on the triangulation as it is (Springborn, Schröder, Pinkall 2008): the fast way, where it
leads to a metric at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Progress, no_progress, positions
from hexwrap_solver.conformal.energy import Corners, Energy
from hexwrap_solver.conformal.newton import Rules, descend, largest
from hexwrap_solver.linalg.factor import Factorisation

#: Accepted residual, radians: boundary angles are promised to 1e-9.
ACCEPTED = 3e-10
#: Degenerate triangles make Newton leap: no single step may change the logarithm of a length by more than
#: ``leap``. A chord step costs a fourth of one with a
#: factorisation.
RULES = Rules(
    steps=60,
    leap=8.0,
    accepted=ACCEPTED,
    stalls=1,
    large=ACCEPTED,
    share=0.1,
    settled=0.05,
    usual=10,
    promising=0.5,
)
#: Multiples of its largest diagonal entry that make a singular Hessian definite.
SHIFTS = (0.0, 1e-12, 1e-9, 1e-6)
#: Where more than VIOLATING_AT_FIRST triangles violate the triangle inequality after the first step, more
#: than VIOLATING after others, or any near the minimum, some do so at the minimum as well: the search ends
#: there.
VIOLATING_AT_FIRST, VIOLATING = 16, 8


@dataclass(frozen=True)
class Minimum:
    """u: (n,) log scale factors. residual: max |angle sum − target| over the unknowns. violating: number of
    triangles that violate the triangle inequality (then the original triangulation has no solution here).
    iterations: steps taken, of which ``factorisations`` had a Hessian of their own. factorisation: of the
    last of these."""

    u: Floats
    corners: Corners
    residual: float
    iterations: int
    factorisations: int
    factorisation: Factorisation

    @property
    def converged(self) -> bool:
        return self.residual <= ACCEPTED

    @property
    def violating(self) -> int:
        return int(self.corners.violating.sum())


def minimise(energy: Energy, start: Floats | None = None, progress: Progress = no_progress) -> Minimum:
    """Minimises the energy from ``start`` (u = 0 by default), see ``newton``; not converged where some
    triangles will plainly not come to satisfy the triangle inequality."""
    x = np.zeros(energy.n_dof) if start is None else energy.unknowns_of(start)
    fixed = _Fixed(energy)
    found = descend(fixed, x, RULES, progress, energy.target)
    point = found.point
    return Minimum(
        energy.scale_of(point.x),
        point.corners,
        largest(point.gradient),
        found.iterations,
        found.factorisations,
        fixed.factorisation,
    )


@dataclass(frozen=True)
class _Point:
    """The unknowns, and what the energy says there."""

    x: Floats
    corners: Corners
    gradient: Floats


class _Fixed:
    """See ``Convex``."""

    def __init__(self, energy: Energy) -> None:
        self.energy = energy
        self.factorisation = Factorisation(energy.points, energy.rows, energy.columns)

    def at(self, x: Floats) -> _Point:
        corners = self.energy.corners(self.energy.scale_of(x))
        return _Point(x, corners, self.energy.gradient(corners))

    def again(self, point: _Point) -> _Point:
        return point

    def edges(self) -> tuple[Ints, Ints]:
        return self.energy.rows, self.energy.columns

    def change(self, direction: Floats) -> float:
        return largest(direction)

    def direction(self, point: _Point) -> Floats | None:
        return _solved(self.factorisation, *self.energy.hessian(point.corners), point.gradient, point.corners)

    def local_direction(self, point: _Point, among: Ints) -> Floats | None:
        local = positions(among, len(point.x))
        rows, columns = local[self.energy.rows], local[self.energy.columns]
        inside = (rows >= 0) & (columns >= 0)
        part = Factorisation(self.energy.points[among], rows[inside], columns[inside])
        diagonal, off_diagonal = self.energy.hessian(point.corners)
        found = _solved(part, diagonal[among], off_diagonal[inside], point.gradient[among], point.corners)
        if found is None:
            return None
        direction = np.zeros(len(point.x))
        direction[among] = found
        return direction

    def solve(self, right: Floats) -> Floats:
        return self.factorisation.solve(right)

    def is_hopeless(self, point: _Point, iterations: int, settled: bool) -> bool:
        count = int(point.corners.violating.sum())
        return count > (0 if settled else VIOLATING if iterations > 1 else VIOLATING_AT_FIRST)


def _solved(
    factorisation: Factorisation, diagonal: Floats, off_diagonal: Floats, gradient: Floats, corners: Corners
) -> Floats | None:
    """H⁻¹(−∇E), if it leads downhill; None where the system cannot be solved.

    Triangles that violate the triangle inequality add nothing to H; where a vertex has no other ones H is
    singular, so a small multiple of the diagonal is added, more where that does not suffice (Levenberg 1944).
    """
    scale = max(largest(diagonal), 1.0)
    for shift in SHIFTS[int(corners.violating.any()) :]:
        try:
            factorisation.factorise(diagonal + shift * scale, off_diagonal)
        except np.linalg.LinAlgError:
            continue
        direction = factorisation.solve(-gradient)
        if np.isfinite(direction).all() and gradient @ direction < 0:
            return np.asarray(direction)
    return None
