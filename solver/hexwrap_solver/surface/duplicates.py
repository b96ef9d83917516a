"""Faces sent twice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexwrap_solver.arrays import Floats, Ints, Ragged


def equal_faces(points: Floats, faces: Ragged) -> Ints:
    """(m,) the first face whose corners lie in the same places as those of each face, in any order.

    points: (n, d), of the vertices. Faces are compared by sums over their corners of 64-bit numbers that
    stand for places.
    """
    places = np.zeros(len(points), dtype=np.uint64)
    for bits in (np.ascontiguousarray(points, dtype=float) + 0.0).view(np.uint64).T:  # −0 becomes 0
        places = _mixed(places + bits)
    sums = np.add.reduceat(places[faces.values], faces.offsets[:-1])
    _, first, same = np.unique(sums, return_index=True, return_inverse=True)
    equal: Ints = first[same]
    return equal


def _mixed(bits: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Numbers of which every bit depends on every bit of the given ones: the finalizer of SplitMix64
    (Steele, Lea and Flood 2014)."""
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))
