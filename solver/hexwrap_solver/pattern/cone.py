"""Placement on a cone: the apex stands at a centre of symmetry, scale and rotation are free."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Lattice, Motion
from hexwrap_solver.pattern.placement import Placement, anchor_vertex, edge_angle
from hexwrap_solver.pattern.size import wanted_edge, width_per_cell
from hexwrap_solver.pattern.types import PatternSettings


def boundary_direction(cmap: ConformalMap, lattice: Lattice, anchor: int) -> complex:
    """Unit direction along the boundary, meaningful up to the symmetry ζ of the lattice, which g respects.

    The mean of (boundary edge)^order over both loops; where that cancels (round boundaries), the direction
    around the apex at the anchor.
    """
    faces = cmap.surface.faces
    corners = cmap.corners()
    n = len(cmap.uv)
    rim = np.concatenate([loop * n + np.roll(loop, -1) for loop in cmap.surface.loops])
    on_rim = np.isin(faces * n + np.roll(faces, -1, axis=1), rim)
    edges = (np.roll(corners, -1, axis=1) - corners)[on_rim]
    length = abs(edges)
    mean = complex((length * (edges / length) ** lattice.order).sum() / length.sum())
    if abs(mean) > 0.05:
        return complex(np.exp(1j * np.angle(mean) / lattice.order))
    apex = cmap.deck.apex
    around = 1j * (cmap.uv[anchor] - (0 if apex is None else apex))
    return complex(around / abs(around))


def place_on_cone(cmap: ConformalMap, lattice: Lattice, settings: PatternSettings, turns: int) -> Placement:
    """Paper, definition 2. The apex becomes the lattice point 0, a centre of the full symmetry."""
    angle = edge_angle(lattice, settings)
    anchor = anchor_vertex(cmap)
    apex = cmap.deck.apex
    if apex is None:
        raise ValueError("a translation has no apex")
    edge = wanted_edge(cmap, lattice, settings, angle)
    scale = lattice.edge / edge
    middle = cmap.circumference / abs(cmap.deck.angle) * scale
    width = width_per_cell(lattice, angle) * lattice.edge
    scale *= 1 + settings.phase[1] * lattice.edge / middle
    along = boundary_direction(cmap, lattice, anchor)
    step = complex(lattice.position(lattice.steps[0])) / lattice.edge
    turn = np.exp(-1j * angle) * step / along * np.exp(1j * settings.phase[0] * width / middle)
    place = (cmap.uv - apex) * scale * turn
    around = round(cmap.circumference * scale / width)
    return Placement(place, Motion(lattice, turns, (0, 0)), angle, around, 0.0, ())
