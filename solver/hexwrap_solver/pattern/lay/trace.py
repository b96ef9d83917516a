"""Straight lines traced from triangle to triangle, many at a time.

A line starts in a triangle, heads for a lattice point and crosses edge after edge; where a motion glues the
edges it goes on in the coordinates of the face beyond, in exact integers. It ends where the target lies in
the triangle, or at the boundary. Because every triangle on the way is known, nets that overlap themselves are
no special case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Ints
from hexwrap_solver.pattern.lay.layout import Layout
from hexwrap_solver.tolerances import TINY


@dataclass(frozen=True)
class Traces:
    """Where each line ended.

    face: (k,) last triangle; target: (k, 2) the target in its coordinates; isometry: (k, 4) carries these to
    the coordinates of the first triangle. exit: (k,) half-edge of the last face, at the boundary, at which
    the line stopped, −1 if it arrived. touched: (k,) whether a vertex lay on the way, so that there was a
    choice.
    """

    face: Ints
    target: Ints
    isometry: Ints
    exit: Ints
    touched: Bools


def trace(layout: Layout, face: Ints, origin: Complexes, target: Ints) -> Traces:
    """Straight lines from places, (k,), to nodes, (k, 2), in the coordinates of the first triangle.

    A boundary vertex on the way can be passed on two sides; what fails on one side is tried on the other.
    """
    found = _trace(layout, face, origin, target, pass_left=True)
    retry = np.flatnonzero((found.exit >= 0) & found.touched)
    if len(retry):
        again = _trace(layout, face[retry], origin[retry], target[retry], pass_left=False)
        better = again.exit < 0
        for old, new in (
            (found.face, again.face),
            (found.target, again.target),
            (found.isometry, again.isometry),
            (found.exit, again.exit),
        ):
            old[retry[better]] = new[better]
    return found


def _trace(layout: Layout, face: Ints, origin: Complexes, target: Ints, *, pass_left: bool) -> Traces:
    lattice, tolerance = layout.lattice, layout.tolerance
    face, origin, target = face.copy(), origin.copy(), target.copy()
    isometry = np.zeros((len(face), 4), dtype=np.int64)
    exit_edge = np.full(len(face), -1, dtype=np.int64)
    touched = np.zeros(len(face), dtype=bool)
    active = np.arange(len(face))
    for _ in range(len(layout.corners) + 3):  # a straight line as short as these meets no triangle twice
        goal = lattice.stand(target.take(active, axis=0))
        one, other, third = layout.edge_distances(face.take(active), goal) < -tolerance
        moving = np.flatnonzero(one | other | third)
        active, goal = active.take(moving), goal.take(moving)
        one, other, third = (beyond.take(moving) for beyond in (one, other, third))
        if not len(active):
            break
        edge = np.where(one, 0, np.where(other, 1, 2))
        two = np.flatnonzero(one & other | other & third | third & one)
        if len(two):
            begin, corners = origin[active[two]], layout.corners[face[active[two]]]
            beyond = np.stack([one[two], other[two], third[two]], axis=1)
            pick, tie = _which_edge(corners, begin, goal[two], beyond, tolerance, pass_left)
            edge[two] = pick
            touched[active[two]] |= tie
        at = face[active]
        across = layout.across[at, edge]
        out = across < 0
        exit_edge[active[out]] = edge[out]
        active, at, edge, across = active[~out], at[~out], edge[~out], across[~out]
        crossing = layout.crossing[at, edge]
        face[active] = across
        glued = np.flatnonzero(crossing)
        moved, crossing = active[glued], crossing[glued]
        if not len(moved):
            continue
        isometry[moved] = lattice.compose(isometry[moved], layout.isometries[crossing])
        into = layout.into(crossing)
        target[moved] = lattice.apply(into, target[moved])
        origin[moved] = lattice.carry(into, origin[moved])
    return Traces(face, target, isometry, exit_edge, touched)


def _which_edge(
    corners: Complexes, origin: Complexes, goal: Complexes, beyond: Bools, tolerance: float, pass_left: bool
) -> tuple[Ints, Bools]:
    """Of two edges that both separate the target, the one which the straight line crosses."""
    first = np.where(beyond[:, 0] & beyond[:, 1], 0, np.where(beyond[:, 1] & beyond[:, 2], 1, 2))
    vertex = corners[np.arange(len(first)), (first + 1) % 3]
    heading = goal - origin
    offset = vertex - origin
    side = (heading.real * offset.imag - heading.imag * offset.real) / np.maximum(abs(heading), TINY)
    tie = abs(side) <= tolerance
    on_left = np.where(tie, pass_left, side > 0)  # of the vertex between the edges
    return np.where(on_left, first, (first + 1) % 3), tie
