"""Trims in the parameters' plane: edges pulled onto the surface of a face, and lifted over its seams.

Files hold the edges in space; where they run in (u, v) follows from the nearest points on the surface. On a
closed surface that is known up to whole periods, which continuity along each loop settles: a seam, passed
twice, comes to lie on both ends of the period. At a pole one parameter is free; the loop runs straight there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Bools, Floats
from hexwrap_solver.surface.brep.types import Face
from hexwrap_solver.surface.errors import TrimError
from hexwrap_solver.surface.nurbs import domain, evaluate, evaluate_points
from hexwrap_solver.surface.nurbs_checks import closed_within, spans
from hexwrap_solver.surface.projection import project, settle
from hexwrap_solver.surface.types import NurbsSurface

#: The search for closest points starts from a grid with at least and at most this many lines per direction.
LINES, MOST_LINES = 16, 160
#: This many grid points are tried where the nearest one leads astray.
ATTEMPTS = 6
#: Points far off are pulled again from their neighbours in this many rounds.
FOLLOWED = 8
#: A parameter whose whole range moves a point by less than this part of the surface's size is free there.
POLE = 1e-6
#: Edges may lie off a face by this many times the file's tolerance; further off, the face is refused.
FAR = 100.0


@dataclass(frozen=True)
class Patch:
    """A face's surface made ready: where it closes up, its size, and a grid to look for nearest points."""

    surface: NurbsSurface
    low: Floats
    width: Floats
    size: float
    grid: Floats
    tree: cKDTree

    @cached_property
    def opened(self) -> NurbsSurface:
        """The surface as one that is closed nowhere: both ends of a period are different places."""
        return replace(self.surface, closed=(False, False))


def patch_of(surface: NurbsSurface, tolerance: float) -> Patch:
    surface = replace(surface, closed=closed_within(surface, tolerance))
    low, high = np.array([domain(surface, d) for d in (0, 1)]).T
    lines = []
    for d in (0, 1):
        count = len(spans(surface, d, 1)) - 1
        line = spans(surface, d, max(1, -(-LINES // count)))
        lines.append(line[:: max(1, len(line) // MOST_LINES)])
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    points = evaluate_points(replace(surface, closed=(False, False)), grid)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    return Patch(surface, low, high - low, size, grid, cKDTree(points))


def pull(
    patch: Patch, points: Floats, near: Floats | None = None, tolerance: float = 0.0
) -> tuple[Floats, Floats]:
    """(k, 2) parameters of the nearest points on the surface, and (k,) the distances.

    near: (k, 2) where to begin, when known; parameters then come out in the same period. Without, more starts
    are tried for points that seem further off than the tolerance.
    """
    if near is not None:
        uv = settle(patch.surface, points, near)
        period = np.where(patch.surface.closed, patch.width, np.inf)
        uv = uv + _rounded(near - uv, period) * patch.width
        return uv, np.linalg.norm(points - evaluate_points(patch.surface, uv), axis=1)
    attempts = min(ATTEMPTS, len(patch.grid))
    _, nearest = patch.tree.query(points, k=attempts)
    nearest = nearest.reshape(len(points), attempts)
    uv = settle(patch.surface, points, patch.grid[nearest[:, 0]])
    distance = np.linalg.norm(points - evaluate_points(patch.surface, uv), axis=1)
    for k in range(attempts):
        again = np.flatnonzero(distance > tolerance)
        if len(again) == 0:
            break
        foot, other, _ = project(patch.surface, points[again], patch.grid[nearest[again, k]])
        trial = np.linalg.norm(points[again] - foot, axis=1)
        better = trial < distance[again]
        uv[again[better]], distance[again[better]] = other[better], trial[better]
    follow(patch, points, uv, distance, tolerance)
    return uv, distance


def follow(patch: Patch, points: Floats, uv: Floats, distance: Floats, tolerance: float) -> None:
    """Points (k, 3) of a curve that are far off the surface are pulled again, in place, from where their
    neighbours along the curve came to lie."""
    k = len(points)
    for _ in range(FOLLOWED):
        before = distance.copy()
        for step in (1, -1):
            again = np.flatnonzero(distance > tolerance)
            beside = (again + step) % max(k, 1)
            closer = distance[beside] < distance[again]
            again, beside = again[closer], beside[closer]
            if len(again) == 0:
                continue
            foot, other, _ = project(patch.surface, points[again], uv[beside])
            trial = np.linalg.norm(points[again] - foot, axis=1)
            better = trial < distance[again]
            uv[again[better]], distance[again[better]] = other[better], trial[better]
        if np.array_equal(before, distance):
            break


def lifted(
    patch: Patch, face: Face, edge_points: dict[int, Floats], tolerance: float, name: int
) -> list[list[Floats | None]]:
    """For every loop and trim of a face, (k, 2) parameters of the samples in the trim's direction, on one
    sheet of the parameters' plane inside the domain; None at poles.

    edge_points: samples of each edge, in the edge's direction. name: the face's number, for errors.
    Raises TrimError.
    """
    loops: list[list[Floats | None]] = []
    for loop in face.loops:
        trims = [None if t.edge < 0 else edge_points[t.edge][:: -1 if t.reversed else 1] for t in loop]
        solid = [t for t in trims if t is not None]
        if not solid:
            raise TrimError(
                f"Face {name} of the polysurface has a boundary without edges.", data={"face": name}
            )
        uv, distance = pull(patch, np.concatenate(solid), None, 2 * tolerance)
        worst = float(distance.max())
        if worst > FAR * tolerance + 1e-6 * patch.size:
            raise TrimError(
                f"An edge of face {name} of the polysurface lies up to {worst:.3g} off the face's surface "
                f"(file tolerance {tolerance:.3g}): run ExtractBadSrf in Rhino, or rebuild that face.",
                data={"face": name},
            )
        first = np.cumsum([0, *map(len, solid)])
        _settle_ends(patch, np.concatenate(solid), uv, first, FAR * tolerance)
        _settle_poles(patch, uv, first)
        pieces = iter(np.split(uv, np.cumsum([len(t) for t in solid])[:-1]))
        loops.append(_chained(patch, [None if t is None else next(pieces) for t in trims], name))
    return loops


def free(patch: Patch, uv: Floats) -> Bools:
    """(k, 2) whether the point stays where it is over the whole range of u, of v."""
    jet = evaluate(patch.opened, patch.low + np.mod(uv - patch.low, patch.width * (1 + 1e-12)))
    moves = np.stack([np.linalg.norm(jet.du, axis=1), np.linalg.norm(jet.dv, axis=1)], axis=1)
    return np.asarray(moves * patch.width <= POLE * patch.size)


def _settle_ends(patch: Patch, points: Floats, uv: Floats, first: Floats, allowed: float) -> None:
    """Ends of trims lie on the side of a slit that the trim comes from, in place.

    Where a surface almost closes, by more than the tolerance, its two ends are equally near.
    """
    ends = np.concatenate([first[:-1], first[1:] - 1])
    inward = np.concatenate([first[:-1] + 1, first[1:] - 2])

    def jumps(own: Floats, beside: Floats) -> Bools:
        return np.asarray(((np.abs(own - beside) > patch.width / 2) & ~closed).any(axis=1))

    closed = np.array(patch.surface.closed)
    torn = jumps(uv[ends], uv[inward])
    ends, inward = ends[torn], inward[torn]
    if len(ends) == 0:
        return
    foot, other, _ = project(patch.surface, points[ends], uv[inward])
    good = (np.linalg.norm(points[ends] - foot, axis=1) <= allowed) & ~jumps(other, uv[inward])
    uv[ends[good]] = other[good]


def _settle_poles(patch: Patch, uv: Floats, first: Floats) -> None:
    """At poles the free parameter is that of the neighbour on the trim, in place."""
    ends = np.concatenate([first[:-1], first[1:] - 1])
    inward = np.concatenate([first[:-1] + 1, first[1:] - 2])
    loose = free(patch, uv[ends])
    uv[ends] = np.where(loose, uv[inward], uv[ends])


def _chained(patch: Patch, trims: list[Floats | None], name: int) -> list[Floats | None]:
    """Trims of one loop lifted over the seams so that each begins where the one before ends."""
    period = np.where(patch.surface.closed, patch.width, np.inf)
    start = next(i for i, t in enumerate(trims) if t is not None)
    order = [*range(start, len(trims)), *range(start)]
    out: list[Floats | None] = [None] * len(trims)
    end: Floats | None = None
    pole = False
    for i in order:
        trim = trims[i]
        if trim is None:
            pole = True
            continue
        trim = _unwrapped(trim, period)
        if end is not None:
            gap = end - trim[0]
            turns = _rounded(gap, period)
            if pole:
                turns = turns + _around_pole(patch, end, trim[0] + turns * patch.width, period)
            trim = trim + turns * patch.width
        out[i] = trim
        end, pole = trim[-1], False
    first = next(t for t in out if t is not None)
    assert end is not None
    if trims[start - 1] is not None and np.any(np.abs(_rounded(end - first[0], period)) > 0):
        raise TrimError(
            f"The boundary of face {name} of the polysurface runs around its closed surface without a seam: "
            "split the face at its seam in Rhino (SplitFace).",
            data={"face": name},
        )
    corner = np.min([t.min(axis=0) for t in out if t is not None], axis=0)
    # A boundary may begin a hair before the domain; it is a whole period that is to be taken off.
    shift = np.where(np.isfinite(period), np.floor((corner - patch.low) / patch.width + 1e-3), 0.0)
    return [None if t is None else t - shift * patch.width for t in out]


def _unwrapped(uv: Floats, period: Floats) -> Floats:
    step = np.diff(uv, axis=0)
    turns = np.concatenate([np.zeros((1, 2)), -np.cumsum(_rounded(step, period), axis=0)])
    return np.asarray(uv + turns * np.where(np.isfinite(period), period, 0.0))


def _rounded(difference: Floats, period: Floats) -> Floats:
    return np.where(np.isfinite(period), np.round(difference / period), 0.0)


def _around_pole(patch: Patch, end: Floats, start: Floats, period: Floats) -> Floats:
    """(2,) whole periods by which the loop goes further along a pole, the face on its left.

    At the upper end of v a loop runs towards lower u, and so on; it never stands still there.
    """
    loose = np.logical_or(*free(patch, np.stack([end, start])))
    extra = np.zeros(2)
    for d in (0, 1):
        if not (loose[d] and np.isfinite(period[d])):
            continue
        upper = end[1 - d] > patch.low[1 - d] + patch.width[1 - d] / 2
        sign = (-1.0 if upper else 1.0) * (1.0 if d == 0 else -1.0)
        run = (start[d] - end[d]) * sign / period[d]
        extra[d] = sign if run < 1e-6 else 0.0
    return extra
