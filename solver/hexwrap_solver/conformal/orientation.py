"""Which triangles of an unrolled map are positively oriented, beyond the rounding of their corners."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes

#: Corners are good to a few roundings of their distance from the origin.
ROUNDINGS = 32 * np.finfo(np.float64).eps


def positive(corners: Complexes) -> Bools:
    """(m,) whether the area of each triangle, corners (m, 3), is certainly above zero."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = (np.conj(a) * b).imag
    longest = np.maximum(np.maximum(np.abs(a), np.abs(b)), np.abs(b - a))
    return np.asarray(area > ROUNDINGS * np.abs(corners).max(axis=1) * longest)
