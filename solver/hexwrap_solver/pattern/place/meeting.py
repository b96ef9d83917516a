"""Where two lines of the plane meet."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats


def meeting(p: Complexes, d: Floats, q: Complexes, e: Floats) -> Complexes:
    """(…) the place z with Re(p̄·z) = d and Re(q̄·z) = e, for lines of unit normals p, q at depths d, e.

    With A = Im(p̄·q), the area that the normals span: Re(p̄·ip) = 0, Re(p̄·iq) = −A and Re(q̄·ip) = A, so that
    z = i·(e·p − d·q)/A satisfies both. The lines must not be parallel.
    """
    return np.asarray(1j * (e * p - d * q) / (np.conj(p) * q).imag)
