"""What is asked of the lattice on a domain, before anything is rounded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.place.placement import anchor_vertex, edge_angle, main_loops
from hexwrap_solver.pattern.place.size import wanted_edge, width_per_cell
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.surface.topology import half_edges
from hexwrap_solver.tolerances import TINY


@dataclass(frozen=True)
class Target:
    """factor: the scale and rotation A = ∂W/∂z that are asked for. angle: of edges to the boundary, radians.
    edge: length of edges in the domain. width: of a cell around, in lattice units."""

    lattice: Lattice
    factor: complex
    angle: float
    edge: float
    width: float

    @classmethod
    def of(cls, cmap: ConformalMap, lattice: Lattice, settings: PatternSettings) -> Target:
        angle = edge_angle(lattice, settings)
        edge, width = wanted_edge(cmap, lattice, settings, angle), width_per_cell(lattice, angle)
        along = boundary_direction(cmap, lattice)
        factor = complex(lattice.edge / edge * np.exp(-1j * angle) * lattice.forward / along)
        return cls(lattice, factor, angle, edge, width * lattice.edge)

    def rotation(self, factor: complex) -> float:
        """The angle of edges to the boundary under another factor."""
        return self.angle - float(np.angle(factor / self.factor))

    def phase(self, settings: PatternSettings, up: float, along: complex = 1.0) -> complex:
        """Where the anchor stands on the lattice, less translations of the tiling, which change nothing: far
        ones would cost digits. up: length of one step up; along: unit direction of those around."""
        asked = complex(self.width * settings.phase[0], up * settings.phase[1])
        return self.lattice.without_translations(asked * along)


def boundary_direction(cmap: ConformalMap, lattice: Lattice) -> complex:
    """Unit direction along the boundary, meaningful up to the rotations of the pattern, which g respects.

    That of g on cylinders; else the mean of (boundary edge)^fold over the boundary; where that cancels (round
    boundaries, none), the direction around the apex, or the middle, at the anchor; on nets that are glued, of
    the boundary there.
    """
    if cmap.kind == "cylinder" and cmap.deck.translation:
        return cmap.deck.translation / abs(cmap.deck.translation)
    corners, faces = cmap.corners(), cmap.surface.faces
    on_ends = np.zeros(len(cmap.surface.vertices), dtype=bool)
    on_ends[np.concatenate([np.zeros(0, dtype=np.int64), *main_loops(cmap)])] = True
    on_boundary = (cmap.surface.twin < 0).reshape(-1, 3) & on_ends[faces]
    edges = (np.roll(corners, -1, axis=1) - corners)[on_boundary]
    length = abs(edges)
    mean = complex((length * (edges / length) ** lattice.fold).sum() / max(length.sum(), TINY))
    if abs(mean) > 0.05:
        return complex(np.exp(1j * np.angle(mean) / lattice.fold))
    anchor = anchor_vertex(cmap)
    if cmap.kind == "net":
        return _direction_at(cmap, lattice, anchor)
    around = 1j * (complex(cmap.uv[anchor]) - middle(cmap))
    return complex(around / abs(around))


def _direction_at(cmap: ConformalMap, lattice: Lattice, vertex: int) -> complex:
    """Unit direction of the boundary at a vertex of it; of the edge to the greatest of its neighbours (x, y,
    z) at one inside. A net has no middle that would not depend on how it was cut."""
    surface, corners = cmap.surface, cmap.corners()
    tail, head = half_edges(surface.faces)
    edge = (np.roll(corners, -1, axis=1) - corners).ravel()
    met = np.flatnonzero((tail == vertex) | (head == vertex))
    rim = met[surface.twin[met] < 0]
    if not len(rim):
        unit = 1e-7 * float(np.ptp(surface.vertices, axis=0).max())
        other = np.where(tail[met] == vertex, head[met], tail[met])
        x, y, z = np.rint(surface.vertices[other] / unit).T
        rim = met[np.lexsort((z, y, x))[-1:]]
    mean = complex(((edge[rim] / abs(edge[rim])) ** lattice.fold).sum())
    if abs(mean) < 0.05:  # two sides that meet half-way between directions
        leaving = edge[rim[np.argmax(tail[rim] == vertex)]]
        mean = complex((leaving / abs(leaving)) ** lattice.fold)
    return complex(np.exp(1j * np.angle(mean) / lattice.fold))


def middle(cmap: ConformalMap) -> complex:
    """Of a sheet: the apex, or where there is none the centre of the boundary."""
    apex = cmap.deck.apex
    return complex(np.mean([cmap.uv[loop].mean() for loop in main_loops(cmap)])) if apex is None else apex
