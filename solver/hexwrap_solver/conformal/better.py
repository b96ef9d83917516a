"""Better places for listed corners: where the map bends by itself, and a corner costs no scale.

The map's u is nearly linear in the boundary angles (Springborn, Schröder, Pinkall 2008, section 5): with the
Hessian of the last step that had its own, a corner moved from v to w adds κ(Gδ_w − Gδ_v). What that promises
is told only once the map with the corner moved has been found as well.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.fixed import Minimum, minimise
from hexwrap_solver.linalg.factor import Factorisation
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.tolerances import ANGLE
from hexwrap_solver.words import place

#: Places that are tried for each corner, at most, and corners that are looked at: at first every COARSE-th
#: place, then those beside the best of these.
TRIED, CORNERS, COARSE = 24, 12, 3
#: Responses that are solved for together, for the sake of memory.
TOGETHER = 48
#: Scales are foreseen at about so many vertices.
SAMPLE = 4000
#: Of the area, this part is left out at either end when scales are compared: next to a corner they have none.
TAIL = 0.01
#: Told only where cells differ in scale by this factor, and by this factor less with the corner moved.
NEEDLESS, WORTH = 1.5, 1.3


def corner_notes(surface: Surface, energy: Energy, minimum: Minimum) -> tuple[str, ...]:
    """A sentence about the corner that makes scales differ needlessly most, if there is one.

    energy, minimum: of a map with prescribed boundary angles, all free.
    """
    targets, u = energy.targets, minimum.u
    area = _vertex_areas(surface)
    ratio = _ratio(u, area)
    corners = [
        (int(loop[i]), loop, int(i))
        for loop in surface.loops
        for i in np.flatnonzero(np.abs(targets.angle[loop] - np.pi) > 1e3 * ANGLE)
    ]
    if ratio < NEEDLESS or not 0 < len(corners) <= CORNERS or (targets.shared >= 0).any():
        return ()
    if not minimum.factorisations:
        minimum.factorisation.factorise(*energy.hessian(minimum.corners))
    taken = np.array([v for v, _, _ in corners])
    places = [_between(loop, i, taken) for _, loop, i in corners]
    few = np.arange(0, len(u), max(1, len(u) // SAMPLE))

    def foreseen(tried: list[tuple[int, Ints]]) -> tuple[float, int, int]:
        """The least ratio, and with which corner at which of its places, (k,) numbers of them."""
        where = np.concatenate([np.append(places[c][at], taken[c]) for c, at in tried])
        rows = _responses(energy, minimum.factorisation, where, few)
        best, before = (np.inf, 0, 0), 0
        for c, at in tried:
            own = rows[before : before + len(at)] - rows[before + len(at)]
            before += len(at) + 1
            moved = u[few] + (np.pi - targets.angle[taken[c]]) * own
            found = [(_ratio(row, area[few]), c, k) for row, k in zip(moved, at.tolist(), strict=True)]
            # at the end of the stretch it would rather meet its neighbour: no place of its own is better
            least = min(found, default=best)
            if 0 < least[2] < len(places[c]) - 1:
                best = min(best, least)
        return best

    every = [np.unique([*range(0, len(at), COARSE), max(len(at) - 1, 0)])[: len(at)] for at in places]
    best = foreseen(list(enumerate(every)))
    if np.isfinite(best[0]):
        _, c, k = best
        best = foreseen([(c, np.arange(max(k - COARSE, 0), min(k + COARSE, len(places[c]) - 1) + 1))])
    if best[0] * WORTH > ratio:
        return ()
    v, w = int(taken[best[1]]), int(places[best[1]][best[2]])
    angle = targets.angle.copy()
    angle[v], angle[w] = angle[w], angle[v]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        found = minimise(Energy(surface, replace(targets, angle=angle)), u)
    after = _ratio(found.u, area)
    if not found.converged or found.violating or after * WORTH > ratio:
        return ()
    sent = surface.input_vertex
    far = float(np.linalg.norm(surface.vertices[v] - surface.vertices[w]))
    return (
        f"With its corner of {np.degrees(targets.angle[v]):.4g}° at vertex {sent[v]}, "
        f"{place(surface.vertices[v])}, the map stretches some parts {ratio:.2g} times as much as others; "
        f"{far:.3g} away, at vertex {sent[w]}, {place(surface.vertices[w])}, it would be {after:.2g} times.",
    )


def _between(loop: Ints, i: int, taken: Ints) -> Ints:
    """Vertices of the loop around its i-th, up to half-way to the next corner on either side, in order."""
    count = len(loop)
    others = np.flatnonzero(np.isin(loop, taken))
    others = others[others != i]
    ahead = int(((others - i) % count).min()) if len(others) else count
    behind = int(((i - others) % count).min()) if len(others) else count
    steps = np.arange(-((behind - 1) // 2), (ahead - 1) // 2 + 1)
    if len(steps) > TRIED:  # densest near the corner
        pace = np.unique(np.round(np.geomspace(1, max(len(steps) // 2, 2), TRIED // 2)).astype(int))
        steps = np.concatenate([-pace[::-1], pace])
        steps = steps[(steps >= -((behind - 1) // 2)) & (steps <= (ahead - 1) // 2)]
    return np.asarray(loop[(i + steps[steps != 0]) % count])


def _responses(energy: Energy, factor: Factorisation, vertices: Ints, few: Ints) -> Floats:
    """(k, m) what u becomes more at the m ``few`` by one unit of curvature at each of the vertices."""
    at, parts = energy.dof[few], []
    for some in np.split(vertices, range(TOGETHER, len(vertices), TOGETHER)):
        right = np.zeros((energy.n_dof, len(some)))
        dof = energy.dof[some]
        inside = np.flatnonzero(dof >= 0)
        right[dof[inside], inside] = 1.0
        parts.append(np.where(at >= 0, factor.solve(right)[at].T, 0.0))
    return np.concatenate(parts)


def _vertex_areas(surface: Surface) -> Floats:
    third = np.repeat(surface.areas / 3, 3)
    return np.asarray(np.bincount(surface.faces.ravel(), third, len(surface.vertices)))


def _ratio(u: Floats, area: Floats) -> float:
    """e^u at the upper end of the area over e^u at the lower end, without the tails."""
    order = np.argsort(u)
    share = np.cumsum(area[order]) / area.sum()
    low, high = np.searchsorted(share, [TAIL, 1 - TAIL])
    return float(np.exp(u[order[min(high, len(u) - 1)]] - u[order[low]]))
