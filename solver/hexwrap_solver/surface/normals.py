"""Normals beside those of the faces: sent ones, where they can be used, and those of a NURBS surface."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.geometry import dot, normalize
from hexwrap_solver.surface.topology import sum_rows


def with_tangents(exact: Floats, interpolated: Floats) -> Floats:
    """(k, 3) unit normals: those of the NURBS surface's tangents on the mesh normals' side. Where the
    parameterization is singular, the cross product of the tangents vanishes and the mesh's stand in."""
    side = np.sign(dot(exact, interpolated))[:, None]
    return normalize(np.where(side == 0, interpolated, side * exact))


def sent_normals(own: Floats, sent: Floats, stand: Ints) -> tuple[Floats, list[str]]:
    """(n, 3) unit normals outward, and a sentence where not all sent ones could be used.

    own: (n, 3) normals from the faces. sent: (n_sent, 3) of any length. stand: (n_sent,) the vertex at
    which each sent vertex stands, or −1. All are turned over where most of them look inward; those that
    are zero, not finite or still inward give way to the faces'.
    """
    here = stand >= 0
    finite = np.isfinite(sent).all(axis=1, keepdims=True)
    directions = normalize(np.where(finite, sent, 0.0))[here]
    total = sum_rows(directions, stand[here], len(own))
    outward = (total * own).sum(axis=1)
    sentences = []
    if (outward < 0).sum() > (outward > 0).sum():
        total, outward = -total, -outward
        sentences.append("The sent normals look inward, as most faces are oriented, and were turned over.")
    bad = outward <= 0
    if bad.any():
        sentences.append(f"{bad.sum()} sent normals could not be used; the faces around stand in for them.")
    return np.where(bad[:, None], own, normalize(total)), sentences
