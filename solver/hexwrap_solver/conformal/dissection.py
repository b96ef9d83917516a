"""Nested dissection of a mesh by planes (George 1973): the elimination order of its sparse matrices.

The vertices of each part are halved by a plane across the part's longest direction; the vertices along the
cut on one side become the part's separator and are eliminated after both halves. All parts of one level
are cut at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints

#: Parts of about this many vertices are not cut any further: dense algebra is faster there.
LEAF = 128
#: Steps that bring each cutting plane to its part's median.
MEDIAN_STEPS = 2
#: Planes are found from every fourth unknown.
SAMPLE = 4


@dataclass(frozen=True)
class Dissection:
    """A binary tree of separators. Node 0 is the root, nodes 2k + 1 and 2k + 2 are the halves of node k.

    order: (n,) unknowns in the order of elimination, deepest nodes first. start: (nodes + 1,) the unknowns of
    a node are order[start[position]:start[position + 1]] with position = nodes − 1 − node.
    depth: number of levels below the root.
    """

    order: Ints
    start: Ints
    depth: int


def dissect(points: Floats, rows: Ints, columns: Ints) -> Dissection:
    """points: (n, 3) places of the unknowns, NaN for unknowns that touch very many others (they go into the
    root). rows, columns: (e,) unknowns that share a matrix entry."""
    n = len(points)
    placed: Bools = np.asarray(np.isfinite(points).all(axis=1))
    depth = max(0, int(np.ceil(np.log2(max(placed.sum(), 1) / LEAF))))
    if depth:
        points = points - points[placed].mean(axis=0)  # second moments far from the origin lose their digits
    node = np.zeros(n, dtype=np.int64)
    done: Bools = np.logical_not(placed)
    first, second = rows, columns
    for level in range(depth):
        keep = ~(done[first] | done[second])  # no edge but those with a separator leads out of its part
        first, second = first[keep], second[keep]
        side = _halve(points, node, done, level)
        cut = side[first] != side[second]
        done[_thinner_side(first[cut], second[cut], side, node, level)] = True
        node = np.where(done, node, 2 * node + 1 + side)
    count = np.bincount(node, minlength=2 ** (depth + 1) - 1)
    start = np.concatenate([[0], np.cumsum(count[::-1])])
    return Dissection(np.argsort(-node, kind="stable"), start, depth)


def _halve(points: Floats, node: Ints, done: Bools, level: int) -> Bools:
    """(n,) on which side of its part's plane each unknown lies."""
    parts = 2**level
    active = np.flatnonzero(~done)
    part = node[active] - (parts - 1)
    count = np.maximum(np.bincount(part, minlength=parts), 1)
    # directions from every fourth unknown: a plane that is a little off costs nothing
    sampled, of = points[active[::SAMPLE]].T, part[::SAMPLE]
    weight = np.maximum(np.bincount(of, minlength=parts), 1)
    mean = np.stack([np.bincount(of, weights=x, minlength=parts) / weight for x in sampled])
    spread = np.empty((parts, 3, 3))
    for i in range(3):
        for j in range(i + 1):
            product = np.bincount(of, weights=sampled[i] * sampled[j], minlength=parts) / weight
            spread[:, i, j] = spread[:, j, i] = product - mean[i] * mean[j]
    variance, axes = np.linalg.eigh(spread)
    axis = axes[:, :, 2]
    along = np.einsum("nd,nd->n", points[active], axis[part]) - np.einsum("dp,pd->p", mean, axis)[part]
    # from the mean to the median by Newton's method, as if the density at it were the normal one
    step = np.sqrt(2 * np.pi * np.maximum(variance[:, 2], 0))
    threshold = np.zeros(parts)
    for _ in range(MEDIAN_STEPS):
        share = np.bincount(part, weights=along > threshold[part], minlength=parts) / count
        threshold += (share - 0.5) * step
    side = np.zeros(len(points), dtype=bool)
    side[active] = along > threshold[part]
    return side


def _thinner_side(first: Ints, second: Ints, side: Bools, node: Ints, level: int) -> Bools:
    """(n,) ends of the cut edges on the side that has fewer of them, part by part."""
    touched = np.zeros(len(side), dtype=bool)
    touched[first] = touched[second] = True
    ends = np.flatnonzero(touched)
    part = node[ends] - (2**level - 1)
    balance = np.bincount(part, weights=np.where(side[ends], 1.0, -1.0), minlength=2**level)
    chosen = np.zeros(len(side), dtype=bool)
    chosen[ends] = side[ends] == (balance[part] < 0)
    return chosen
