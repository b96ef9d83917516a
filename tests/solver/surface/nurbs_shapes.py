"""NURBS surfaces with known geometry, and the samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexwrap_server import samples
from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface import NurbsSurface

#: The unit circle as a rational quadratic curve of four arcs: corners of its control polygon, weights, knots.
CORNERS = np.array(
    [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float
)
WEIGHTS = np.array([1, np.sqrt(0.5)] * 4 + [1])
ARCS = np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], dtype=float)


def revolution(profile: Floats, weights: Floats, knots: Floats, degree: int) -> NurbsSurface:
    """A profile (m, 2) of radius and height turned once around the z axis."""
    net = np.zeros((9, len(profile), 4))
    net[..., :2] = CORNERS[:, None] * profile[:, 0, None]
    net[..., 2] = profile[:, 1]
    net[..., 3] = WEIGHTS[:, None] * weights
    return NurbsSurface((2, degree), (ARCS, knots), net, (True, False))


def cylinder(
    radius: float = 2.0, height: float = 5.0, power: float = 1.0, shear: float = 0.0
) -> NurbsSurface:
    """power: heights of the control points go as this power of their number. shear: turns them, radians."""
    z = np.linspace(0, 1, 8)
    knots = np.array([0, 0, 0, 0, 1, 2, 3, 4, 5, 5, 5, 5], dtype=float)
    out = revolution(np.stack([np.full(8, radius), height * z**power], axis=1), np.ones(8), knots, 3)
    net = out.control_points.copy()
    turn = np.exp(1j * shear * z) * (net[..., 0] + 1j * net[..., 1])
    net[..., 0], net[..., 1] = turn.real, turn.imag
    return replace(out, control_points=net)


def torus_part(big: float = 5.0, small: float = 2.0) -> NurbsSurface:
    """The outer half of a torus, exact: an arc of half a circle, closed around the z axis."""
    profile = big * np.array([1, 0]) + small * CORNERS[[6, 7, 8, 1, 2]]
    knots = np.array([0, 0, 0, 1, 1, 2, 2, 2], dtype=float)
    return revolution(profile, WEIGHTS[[6, 7, 8, 1, 2]], knots, 2)


def swapped(surface: NurbsSurface) -> NurbsSurface:
    """u and v exchanged."""
    (p, q), (ku, kv), (cu, cv) = surface.degree, surface.knots, surface.closed
    return NurbsSurface((q, p), (kv, ku), surface.control_points.transpose(1, 0, 2), (cv, cu))


def sample(name: str) -> NurbsSurface:
    sent = samples.load(name)["surface"]["nurbs"]
    return NurbsSurface(
        tuple(sent["degree"]),
        tuple(np.array(k, dtype=float) for k in sent["knots"]),
        np.array(sent["control_points"], dtype=float),
        tuple(sent["closed"]),
    )


def random_parameters(surface: NurbsSurface, count: int, seed: int = 0) -> Floats:
    low = [k[p] for k, p in zip(surface.knots, surface.degree, strict=True)]
    high = [k[-1 - p] for k, p in zip(surface.knots, surface.degree, strict=True)]
    return np.random.default_rng(seed).uniform(low, high, (count, 2))
