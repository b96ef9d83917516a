"""How large the cells are: from what is asked on the surface to an edge length in the domain."""

from __future__ import annotations

import sys

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.geometry import plane_areas
from hexwrap_solver.pattern.lattice import Isometry, Lattice
from hexwrap_solver.pattern.place.placement import is_disk, main_loops
from hexwrap_solver.pattern.place.sense import too_many
from hexwrap_solver.pattern.types import Kind, PatternSettings
from hexwrap_solver.surface.topology import next_half_edge
from hexwrap_solver.tolerances import RELATIVE, TINY

#: Where neither a number nor a length is asked for: this many cells around, but fewer where that would make
#: more cells altogether, and more where fewer rows would fit between the loops, or where fewer cells
#: than the last would go around the shorter loop.
DEFAULT_AROUND, DEFAULT_CELLS, DEFAULT_ROWS, DEFAULT_NARROWEST = 48, 3000, 3.0, 3
#: On nets: this many cells, or more where fewer rows than that would fit.
DEFAULT_ON_NETS = 1000
#: Whole cells may stay away from so much of the surface at its narrow end.
DEFAULT_OPEN = 0.01
#: Cells are smaller where whole ones would leave more of the surface bare along its loops, openings included,
#: but no more than ``DEFAULT_CELLS`` for that.
DEFAULT_BARE = 0.1

#: Half a row of cells, in edges, where every other cell of a row stands half a cell higher.
HALF_ROW: dict[Kind, float] = {"hex": 3**0.5 / 4}

#: No cell is more than this many edges wide.
EDGES_PER_CELL = 4.0


def face_areas(cmap: ConformalMap) -> tuple[Floats, Floats]:
    """(m,) areas of the triangles on the surface and in the domain."""
    return cmap.surface.areas, plane_areas(cmap.corners())


def mean_stretch(cmap: ConformalMap) -> float:
    """Length on the surface over length in the domain, averaged over the surface's area."""
    on_surface, in_domain = face_areas(cmap)
    stretch = np.sqrt(on_surface / np.maximum(in_domain, TINY))
    return float(stretch @ on_surface / on_surface.sum())


def width_per_cell(lattice: Lattice, angle: float) -> float:
    """Length of a ring of edge-adjacent cells per cell, in edges, when edges are at an angle to the ring."""
    direction = np.exp(-1j * angle) * lattice.forward
    x, y = lattice.coordinates(np.asarray(direction / lattice.position(lattice.basis[0])))
    return float(1 / (lattice.cells_along(x, y) * lattice.edge))


def wanted_edge(cmap: ConformalMap, lattice: Lattice, settings: PatternSettings, angle: float) -> float:
    """Edge length in the domain that gives the size asked for; angle: of the edges to the boundary."""
    if settings.edge_length is not None:
        return settings.edge_length / mean_stretch(cmap)
    if settings.around is None:
        return default_edge(cmap, lattice, settings, angle)
    return girth(cmap) / (settings.around * width_per_cell(lattice, angle))


def default_edge(cmap: ConformalMap, lattice: Lattice, settings: PatternSettings, angle: float) -> float:
    """Edge length in the domain that suits its shape, whatever it is: short and long, conical and flat."""
    area = float(face_areas(cmap)[1].sum())
    width = width_per_cell(lattice, angle)
    edge = girth(cmap) / (DEFAULT_AROUND * width)
    of_cells = float(np.sqrt(area / (DEFAULT_CELLS * _unit_area(lattice))))
    bare = np.inf if settings.boundary == "trim" else max(_edge_of_bare(cmap, lattice, settings), of_cells)
    if cmap.kind == "net" or is_disk(cmap):
        few = float(np.sqrt(area / (DEFAULT_ON_NETS * _unit_area(lattice))))
        return min(few, bare, _edge_of_rows(cmap, lattice, angle))
    narrow = min(_lengths_of_loops(cmap)) if settings.boundary == "trim" else _narrow_ring(cmap)
    fitting = min(_edge_of_rows(cmap, lattice, angle), narrow / (DEFAULT_NARROWEST * width))
    return min(max(edge, of_cells), bare, fitting)


def girth(cmap: ConformalMap) -> float:
    """Length in the domain of once around: the circumference of cylinders and cones; else of the longest
    loop, or, of closed surfaces, of the equator of a sphere of equal area."""
    if cmap.kind != "net":
        return cmap.circumference
    area = float(face_areas(cmap)[1].sum())
    return max(_lengths_of_loops(cmap), default=float(np.sqrt(np.pi * area)))


def _narrow_ring(cmap: ConformalMap) -> float:
    """Length of the ring around the apex, in the domain, that cuts off ``DEFAULT_OPEN`` of the surface."""
    if cmap.deck.apex is None:
        return cmap.circumference
    area, _ = face_areas(cmap)
    distance = abs(cmap.uv[cmap.surface.faces] - cmap.deck.apex).max(axis=1)
    order = np.argsort(distance, kind="stable")
    at = int(np.searchsorted(np.cumsum(area[order]), DEFAULT_OPEN * area.sum()))
    return abs(cmap.deck.angle) * float(distance[order[at]])


def _edge_of_rows(cmap: ConformalMap, lattice: Lattice, angle: float) -> float:
    """Edge length in the domain at which ``DEFAULT_ROWS`` fit between the loops, on the average."""
    height = float(face_areas(cmap)[1].sum()) / girth(cmap)
    return height * width_per_cell(lattice, angle) / (DEFAULT_ROWS * _unit_area(lattice))


def _edge_of_bare(cmap: ConformalMap, lattice: Lattice, settings: PatternSettings) -> float:
    """Edge length in the domain at which whole cells leave ``DEFAULT_BARE`` of the surface bare: middles stay
    as far from the loops as cells reach, and half a row from ends that are lines of the pattern."""
    surface, strip, in_domain = cmap.surface, 0.0, _boundary_lengths(cmap)
    for i, loop in enumerate(surface.loops):
        on_line = cmap.kind == "cylinder" and i < 2 and settings.align != "none"
        reach = HALF_ROW.get(lattice.kind, 0.0) if on_line else lattice.sides / (2 * np.pi)
        along = np.linalg.norm(surface.vertices[np.roll(loop, -1)] - surface.vertices[loop], axis=1)
        strip += reach * float((along**2 / np.maximum(in_domain[loop], TINY)).sum())
    return DEFAULT_BARE * float(surface.areas.sum()) / strip if strip else np.inf


def cells_around(cmap: ConformalMap, motion: Isometry | None, scale: float, width: float) -> int:
    """Along the translation that g becomes on a cylinder, else as many of a width as fit around. scale: from
    the domain to the lattice; width: in lattice units."""
    if motion is not None and motion.cone_index == 0 and any(motion.shift):
        return int(motion.lattice.cells_around(np.array(motion.shift)))
    return max(round(girth(cmap) * scale / width), 1)


def counts_near(count: float, spread: float, most: int) -> Floats:
    """Whole numbers within the relative spread of a count, and the nearest one, the nearest first; at most so
    many, none below 1."""
    near = np.arange(np.ceil(count * (1 - spread)), count * (1 + spread) + RELATIVE)
    near = np.unique(np.append(near, max(1.0, round(count))))
    return np.asarray(near[np.argsort(abs(near - count), kind="stable")][:most])


def fitting_number(cmap: ConformalMap, lattice: Lattice, angle: float) -> tuple[int, float]:
    """Cells around, and their edge length on the surface, that leave room for ``DEFAULT_ROWS`` and for
    ``DEFAULT_NARROWEST`` cells around the shorter loop."""
    width = width_per_cell(lattice, angle)
    narrowest = min(_lengths_of_loops(cmap)) / (DEFAULT_NARROWEST * width)
    edge = min(_edge_of_rows(cmap, lattice, angle), narrowest)
    return int(np.ceil(cmap.circumference / (edge * width))), edge * mean_stretch(cmap)


def _unit_area(lattice: Lattice) -> float:
    """Area of a cell of edge 1."""
    return lattice.cell_area / lattice.edge**2


def _lengths_of_loops(cmap: ConformalMap) -> list[float]:
    """Of the loops that matter, in the domain."""
    length = _boundary_lengths(cmap)
    return [float(length[loop].sum()) for loop in main_loops(cmap)]


def _boundary_lengths(cmap: ConformalMap) -> Floats:
    """(n,) length in the domain of the boundary edge that starts at each vertex, 0 where none does."""
    surface, corners = cmap.surface, cmap.corners().ravel()
    rim = np.flatnonzero(surface.twin < 0)
    length = np.zeros(len(surface.vertices))
    length[surface.faces.ravel()[rim]] = abs(corners[next_half_edge(rim)] - corners[rim])
    return length


def edges_around(cmap: ConformalMap, settings: PatternSettings, edge: float) -> float:
    """How many edges of a length in the domain the circumference is long, where g becomes a translation.

    Raises PatternError where a single ring would already have too many cells, before anything counts them.
    """
    edges = cmap.circumference / edge
    if not edges <= EDGES_PER_CELL * settings.max_cells:
        cells = min(edges / EDGES_PER_CELL, sys.float_info.max)
        raise too_many(cmap.surface, settings, cells, cmap.log_scale)
    return edges


#: How far the size may depart from an edge length asked for, or from the default, to fit the boundary better.
ASKED, FREE = 0.02, 0.10


def size_spread(settings: PatternSettings) -> float:
    """Relative freedom of the size: half a cell of a number around, 2 % of a length, else 10 %."""
    if settings.around is not None:
        return 0.5 / settings.around
    return FREE if settings.edge_length is None else 0.75 * ASKED
