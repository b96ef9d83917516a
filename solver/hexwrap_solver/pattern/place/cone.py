"""Placement on a cone: the apex stands at a centre of symmetry, scale and rotation are free."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Isometry, Lattice
from hexwrap_solver.pattern.place.deform import System, deform, distortion_of
from hexwrap_solver.pattern.place.glued import Glued
from hexwrap_solver.pattern.place.placement import Placement, anchor_vertex, edge_angle, main_loops
from hexwrap_solver.pattern.place.size import ASKED, edges_around, wanted_edge, width_per_cell
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.surface.topology import half_edges
from hexwrap_solver.tolerances import TINY

#: A translation g shorter than this part of the circumference is none.
NO_SHIFT = 1e-9
#: Half an edge towards the apex must not turn cells as large as the cone inside out.
LEAST_GROWTH = 0.1


def boundary_direction(cmap: ConformalMap, lattice: Lattice, anchor: int) -> complex:
    """Unit direction along the boundary, meaningful up to the rotations of the pattern, which g respects.

    The mean of (boundary edge)^fold over the boundary; where that cancels (round boundaries, none), the
    direction around the apex, or the middle, at the anchor; on nets that are glued, of the boundary there.
    """
    corners, faces = cmap.corners(), cmap.surface.faces
    on_ends = np.zeros(len(cmap.surface.vertices), dtype=bool)
    on_ends[np.concatenate([np.zeros(0, dtype=np.int64), *main_loops(cmap)])] = True
    on_boundary = (cmap.surface.twin < 0).reshape(-1, 3) & on_ends[faces]
    edges = (np.roll(corners, -1, axis=1) - corners)[on_boundary]
    length = abs(edges)
    mean = complex((length * (edges / length) ** lattice.fold).sum() / max(length.sum(), TINY))
    if abs(mean) > 0.05:
        return complex(np.exp(1j * np.angle(mean) / lattice.fold))
    if cmap.kind == "net":
        if np.any(cmap.net.crossing):
            return _direction_at(cmap, lattice, anchor)
        stands = complex(corners.ravel()[np.flatnonzero(faces.ravel() == anchor)[0]])
    else:
        stands = complex(cmap.uv[anchor])
    around = 1j * (stands - _middle(cmap))
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


def _middle(cmap: ConformalMap) -> complex:
    """The apex, or where there is none the centre of the boundary."""
    if cmap.kind == "net":
        return complex(cmap.corners().mean())
    apex = cmap.deck.apex
    return complex(np.mean([cmap.uv[loop].mean() for loop in main_loops(cmap)])) if apex is None else apex


@dataclass(frozen=True)
class _Frame:
    """What is asked: scale and rotation as one factor, the angle of edges, and the width of a cell."""

    factor: complex
    angle: float
    width: float


def _frame(cmap: ConformalMap, lattice: Lattice, settings: PatternSettings) -> _Frame:
    angle = edge_angle(lattice, settings)
    scale = lattice.edge / wanted_edge(cmap, lattice, settings, angle)
    along = boundary_direction(cmap, lattice, anchor_vertex(cmap))
    return _Frame(
        complex(scale * np.exp(-1j * angle) * lattice.forward / along),
        angle,
        width_per_cell(lattice, angle) * lattice.edge,
    )


def place_on_cone(
    cmap: ConformalMap, lattice: Lattice, settings: PatternSettings, cone_index: int
) -> Placement:
    """Paper, definition 2. The apex becomes the lattice point 0, a centre of the full symmetry.

    phase: moves the pattern around by cells at the middle ring, and up or down by edges there; whole edges
    are left out, since they would change the size, and so are turns by which the lattice is symmetric.
    """
    frame = _frame(cmap, lattice, settings)
    radius = cmap.circumference / abs(cmap.deck.angle) * abs(frame.factor)
    turn = math.remainder(settings.phase[0] * frame.width / radius, lattice.quantum)
    up = settings.phase[1] - math.ceil(settings.phase[1] - 0.5)
    factor = frame.factor * np.exp(1j * turn) * max(1 + up * lattice.edge / radius, LEAST_GROWTH)
    place = (cmap.uv - _middle(cmap)) * factor
    around = round(cmap.circumference * abs(factor) / frame.width)
    return Placement.on_annulus(
        cmap, place, Isometry(lattice, cone_index, (0, 0)), frame.angle, around, 0.0, ()
    )


def place_on_flat_ring(
    cmap: ConformalMap, lattice: Lattice, settings: PatternSettings, cone_index: int
) -> Placement:
    """K a multiple of 2π: g is a translation, usually not zero, and must become one of the lattice.

    Where a lattice vector is near, scale and rotation follow from it; where none is, because the translation
    is short against the cells, the layout is deformed a little so that it closes up with the nearest.
    """
    frame = _frame(cmap, lattice, settings)
    edges_around(cmap, lattice, settings, frame.angle)
    wanted = frame.factor * cmap.deck.translation
    shift = lattice.translation_near(wanted)
    nearest = complex(lattice.position(shift))
    motion = Isometry(lattice, cone_index, (int(shift[0]), int(shift[1])))
    phase = lattice.without_translations(
        complex(frame.width * settings.phase[0], lattice.edge * settings.phase[1])
    )
    closes = abs(wanted) < NO_SHIFT * abs(frame.factor) * cmap.circumference
    origin = _middle(cmap) if closes else cmap.uv[anchor_vertex(cmap)]
    fits = nearest != 0 and abs(nearest / wanted - 1) < ASKED if not closes else True
    factor = nearest / cmap.deck.translation if fits and not closes else frame.factor
    place = (cmap.uv - origin) * factor + phase
    around = round(cmap.circumference * abs(factor) / frame.width)
    angle = frame.angle - float(np.angle(factor / frame.factor))
    if fits:
        return Placement.on_annulus(cmap, place, motion, angle, around, 0.0, ())
    nowhere = np.zeros((len(place), 2))
    glued = Glued.by_sheets(cmap, motion)
    place = deform(System(cmap, glued, nowhere.astype(complex)), glued, factor, place, nowhere)
    return Placement.on_annulus(cmap, place, motion, angle, around, distortion_of(cmap, glued, place), ())
