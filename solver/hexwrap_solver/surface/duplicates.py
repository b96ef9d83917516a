"""Faces sent twice."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Ints


def first_of_equals(faces: Ints, order: Ints, first: Ints) -> Bools:
    """(m,) False for every face whose three vertices are those of an earlier face.

    order, first: ``edge_groups`` of the faces. Two such faces meet at all their edges, so only faces at an
    edge with more than two faces, or with the same vertex on both sides, are compared.
    """
    keep = np.ones(len(faces), dtype=bool)
    count = np.diff(first)
    crowded = np.repeat(count > 2, count)
    pair = first[:-1][count == 2]
    left, right = order[pair], order[pair + 1]
    opposite = faces[:, [2, 0, 1]].ravel()
    same = opposite[left] == opposite[right]
    suspects = np.unique(np.concatenate([order[crowded], left[same], right[same]]) // 3)
    if len(suspects):
        _, kept = np.unique(np.sort(faces[suspects], axis=1), axis=0, return_index=True)
        keep[suspects] = False
        keep[suspects[kept]] = True
    return keep
