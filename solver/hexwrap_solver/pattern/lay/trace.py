"""Straight walks through the universal cover, many at a time.

A walk starts in a triangle, heads for a lattice point and crosses edge after edge; at the cut it goes on in
the coordinates of the next sheet, in exact integers. It ends where the target lies in the triangle, or at
the boundary. Because it knows every triangle it passes, self-overlapping domains are no special case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Ints
from hexwrap_solver.pattern.lay.nodes import Layout, edge_distances


@dataclass(frozen=True)
class Walks:
    """Where each walk ended.

    face: (k,) last triangle; target: (k, 2) the target in its coordinates; sheet: (k,) sheet of the last
    triangle, the first being 0. exit: (k,) number of the boundary edge at which it stopped, −1 if it arrived.
    touched: (k,) whether a vertex lay on the way, so that there was a choice.
    """

    face: Ints
    target: Ints
    sheet: Ints
    exit: Ints
    touched: Bools


def walk(layout: Layout, face: Ints, start: Ints, target: Ints) -> Walks:
    """Walk from start to target, both (k, 2) lattice points in the coordinates of the first triangle.

    A boundary vertex on the way can be passed on two sides; what fails on one side is tried on the other.
    """
    found = _walk(layout, face, start, target, pass_left=True)
    retry = np.flatnonzero((found.exit >= 0) & found.touched)
    if len(retry):
        again = _walk(layout, face[retry], start[retry], target[retry], pass_left=False)
        better = again.exit < 0
        for old, new in (
            (found.face, again.face),
            (found.target, again.target),
            (found.sheet, again.sheet),
            (found.exit, again.exit),
        ):
            old[retry[better]] = new[better]
    return found


def _walk(layout: Layout, face: Ints, start: Ints, target: Ints, *, pass_left: bool) -> Walks:
    lattice, motion, cover, reach = layout.lattice, layout.motion, layout.cover, layout.reach
    face, start, target = face.copy(), start.copy(), target.copy()
    sheet = np.zeros(len(face), dtype=np.int64)
    exit_edge = np.full(len(face), -1, dtype=np.int64)
    touched = np.zeros(len(face), dtype=bool)
    active = np.arange(len(face))
    for _ in range(len(layout.corners) + 3):  # a straight line meets no triangle of the cover twice
        corners = layout.corners[face[active]]
        goal = lattice.position(target[active])
        beyond = edge_distances(corners, goal) < -reach
        moving = beyond.any(axis=1)
        active, corners, goal, beyond = active[moving], corners[moving], goal[moving], beyond[moving]
        if not len(active):
            break
        edge = np.argmax(beyond, axis=1)
        two = np.flatnonzero(beyond.sum(axis=1) >= 2)
        if len(two):
            pick, tie = _which_edge(
                corners[two], lattice.position(start[active[two]]), goal[two], beyond[two], reach, pass_left
            )
            edge[two] = pick
            touched[active[two]] |= tie
        at = face[active]
        across = cover.across[at, edge]
        out = across < 0
        exit_edge[active[out]] = edge[out]
        active, at, edge, across = active[~out], at[~out], edge[~out], across[~out]
        shift = cover.shift[at, edge]
        face[active] = across
        cut = np.flatnonzero(shift)
        moved = active[cut]
        sheet[moved] += shift[cut]
        target[moved] = motion.apply(target[moved], -shift[cut])
        start[moved] = motion.apply(start[moved], -shift[cut])
    return Walks(face, target, sheet, exit_edge, touched)


def _which_edge(
    corners: Complexes, origin: Complexes, goal: Complexes, beyond: Bools, reach: float, pass_left: bool
) -> tuple[Ints, Bools]:
    """Of two edges that both separate the target, the one which the straight line crosses."""
    first = np.where(beyond[:, 0] & beyond[:, 1], 0, np.where(beyond[:, 1] & beyond[:, 2], 1, 2))
    vertex = corners[np.arange(len(first)), (first + 1) % 3]
    heading = goal - origin
    offset = vertex - origin
    side = (heading.real * offset.imag - heading.imag * offset.real) / np.maximum(abs(heading), 1e-300)
    tie = abs(side) <= reach
    on_left = np.where(tie, pass_left, side > 0)  # the vertex between the edges, seen from the walker
    return np.where(on_left, first, (first + 1) % 3), tie
