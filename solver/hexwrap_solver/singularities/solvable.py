"""Triangles that can follow a map with singularities.

Newton's method ends where triangles would have to be flipped. The surface must stay the same set of points,
on which singularities move, so that edges are split instead: a smaller triangle sees less of the map's
change, and one with a wide angle, the kind that breaks, is cut at the foot of its altitude.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.fixed import Minimum, minimise
from hexwrap_solver.conformal.robust.refine import Problem, split_edges, split_places, spread
from hexwrap_solver.conformal.span import MAX_SPAN
from hexwrap_solver.conformal.types import Targets
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.surface.types import Surface

#: Rounds of splitting, and how many times the vertices there may be in the end, and this many more.
ROUNDS, MOST, MOST_MORE = 12, 2, 2000


def solvable(surface: Surface, wanted: Callable[[Surface], Targets]) -> tuple[Energy, Surface, Minimum]:
    """The surface with edges split until there is a map on its triangles, its energy and the map's u. Old
    vertices keep their numbers. wanted: targets for the surface with more vertices. Raises
    ConvergenceError."""
    most = MOST * len(surface.vertices) + MOST_MORE
    start = None
    for attempt in range(ROUNDS):
        energy = Energy(surface, wanted(surface))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = minimise(energy, start)
        if found.converged and not found.violating:
            return energy, surface, found
        runs_away = not np.ptp(found.u) < MAX_SPAN
        if runs_away and attempt:
            break
        u = np.zeros(energy.n) if runs_away else found.u
        problem = Problem(surface, energy.targets, u, np.arange(len(surface.faces)))
        wrong = np.flatnonzero(found.corners.violating)
        if attempt == 0:
            problem = spread(problem, 0)
        elif len(wrong):
            problem = split_edges(problem, *split_places(surface, energy.targets, wrong, attempt))
        before, surface, start = len(surface.vertices), problem.surface, problem.u
        if (before == len(surface.vertices) and attempt) or len(surface.vertices) > most:
            break
    raise ConvergenceError(
        "With these singularities there is no map on the triangles of the surface, not even on smaller ones: "
        "send a finer or more regular mesh, or ask for fewer singularities."
    )
