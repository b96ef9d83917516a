"""Nested dissection of a mesh by planes (George 1973): the elimination order of its sparse matrices.

The unknowns are first halved again and again by planes across each part's longest direction; a bit per level
says on which side of its part's plane an unknown lies. An edge is cut at the first level at which the bits of
its ends differ. Part by part, the ends of its cut edges on one side become its separator, which is
eliminated after both halves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.geometry import stable_order

#: Parts of about this many vertices are not cut any further: dense algebra is faster there.
LEAF = 160
#: Steps that bring each cutting plane to its part's median.
MEDIAN_STEPS = 3
#: Where a plane leaves this much more than half of its part on one side, as happens where vertices were
#: inserted in clusters, the median is found by sorting.
LOPSIDED = 0.2
#: Planes are found from about this many unknowns per part, and from one in four of all at most: a plane that
#: is a little off costs nothing.
SAMPLE, SHARE = 512, 4


@dataclass(frozen=True)
class Dissection:
    """A binary tree of separators. Node 0 is the root, nodes 2k + 1 and 2k + 2 are the halves of node k.

    order: (n,) unknowns in the order of elimination, deepest nodes first; those of one node by the part they
    lie in, so that unknowns which touch the same part stand together. start: (nodes + 1,) the unknowns of a
    node are order[start[position]:start[position + 1]] with position = nodes − 1 − node.
    depth: number of levels below the root.
    """

    order: Ints
    start: Ints
    depth: int


def dissect(points: Floats, rows: Ints, columns: Ints) -> Dissection:
    """points: (n, 3) places of the unknowns, NaN for unknowns that touch very many others (they go into the
    root). rows, columns: (e,) unknowns that share a matrix entry."""
    placed: Bools = np.asarray(np.isfinite(points[:, 0]))
    depth = max(0, int(np.ceil(np.log2(max(int(placed.sum()), 1) / LEAF))))
    part = _parts(points, placed, depth)
    node = np.where(placed, 2**depth - 1 + part, 0)
    done: Bools = np.logical_not(placed)
    differing = part[rows] ^ part[columns]
    cut = np.flatnonzero(differing)
    level = depth - np.frexp(differing[cut].astype(float))[1]
    by_level = np.argsort(level.astype(np.uint8), kind="stable")
    bounds = np.searchsorted(level[by_level], np.arange(depth + 1))
    mark = np.zeros(len(points), dtype=bool)
    for k in range(depth):
        edge = cut[by_level[bounds[k] : bounds[k + 1]]]
        first, second = rows[edge], columns[edge]
        across = ~(done[first] | done[second])
        mark[first[across]] = mark[second[across]] = True
        ends = np.flatnonzero(mark)
        mark[ends] = False
        separator = ends[_on_thinner_side(part[ends] >> (depth - k - 1), k)]
        done[separator] = True
        node[separator] = 2**k - 1 + (part[separator] >> (depth - k))
    nodes = 2 ** (depth + 1) - 1
    start = np.concatenate([[0], np.cumsum(np.bincount(node, minlength=nodes)[::-1])])
    by_part = stable_order(part, 2**depth)
    return Dissection(by_part[stable_order(nodes - 1 - node[by_part], nodes)], start, depth)


def _parts(points: Floats, placed: Bools, depth: int) -> Ints:
    """(n,) the part in which each unknown lies: one bit per level, the first level's highest."""
    part = np.zeros(len(points), dtype=np.int64)
    if not depth:
        return part
    centred = np.ascontiguousarray(points.T)
    everywhere = np.flatnonzero(placed)
    random = np.random.default_rng(0)  # independent of the numbering, and the same every time
    sample = everywhere[random.integers(0, len(everywhere), len(everywhere) // SHARE)]
    # Second moments far from the origin lose their digits.
    centred -= centred[:, sample].mean(axis=1)[:, None]
    centred[:, ~placed] = 0.0
    sampled = centred[:, sample]
    for level in range(depth):
        k = min(SAMPLE << level, len(sample))
        axis, threshold = _planes(sampled[:, :k], part[sample[:k]], 2**level)
        part = 2 * part + _beyond(centred, axis, threshold, part)
    return part


def _beyond(points: Floats, axis: Floats, threshold: Floats, part: Ints) -> Bools:
    """(n,) whether each point, points (3, n), lies beyond the plane of its part."""
    along = points[0] * axis[0][part]
    along += points[1] * axis[1][part]
    along += points[2] * axis[2][part]
    return np.asarray(along > threshold[part])


def _planes(points: Floats, part: Ints, parts: int) -> tuple[Floats, Floats]:
    """(3, parts) longest directions and (parts,) medians along them of points (3, n)."""
    weight = np.maximum(np.bincount(part, minlength=parts), 1)
    mean = np.stack([np.bincount(part, weights=x, minlength=parts) / weight for x in points])
    spread = np.zeros((parts, 3, 3))
    for i in range(3):
        for j in range(i + 1):
            product = np.bincount(part, weights=points[i] * points[j], minlength=parts) / weight
            spread[:, i, j] = spread[:, j, i] = product - mean[i] * mean[j]
    variance, axes = np.linalg.eigh(spread)
    axis = np.ascontiguousarray(axes[:, :, 2].T)
    along = points[0] * axis[0][part] + points[1] * axis[1][part] + points[2] * axis[2][part]
    threshold = (axis * mean).sum(axis=0)
    # From the mean to the median by Newton's method, as if the density at it were the normal one.
    step = np.sqrt(2 * np.pi * np.maximum(variance[:, 2], 0))
    for _ in range(MEDIAN_STEPS):
        share = np.bincount(part, weights=along > threshold[part], minlength=parts) / weight
        threshold += (share - 0.5) * step
    share = np.bincount(part, weights=along > threshold[part], minlength=parts) / weight
    lopsided = np.abs(share - 0.5) > LOPSIDED
    if lopsided.any():
        threshold = np.where(lopsided, _medians(along, part, parts, threshold), threshold)
    return axis, threshold


def _medians(along: Floats, part: Ints, parts: int, otherwise: Floats) -> Floats:
    """(parts,) exact medians of the numbers (k,) of each part; ``otherwise`` where it has none."""
    order = np.lexsort((along, part))
    count = np.bincount(part, minlength=parts)
    middle = np.minimum(np.cumsum(count) - count + (count - 1) // 2, len(order) - 1)
    return np.where(count > 0, along[order[np.maximum(middle, 0)]], otherwise)


def _on_thinner_side(half: Ints, level: int) -> Bools:
    """(k,) which ends of cut edges lie on the side that has fewer of them, part by part. half: (k,) the part
    one level further down."""
    count = np.bincount(half, minlength=2 ** (level + 1)).reshape(-1, 2)
    thinner = (count[:, 1] <= count[:, 0]).astype(np.int64)
    return np.asarray(half % 2 == thinner[half // 2])
