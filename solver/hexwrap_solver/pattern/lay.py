"""Laying a pattern on the domain of a conformal map (paper, definition 2; Figures 1, 5–7)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Bools, Floats, Ints, Progress, Ragged, no_progress
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.domain.cover import cover_of
from hexwrap_solver.domain.interpolate import surface_weights
from hexwrap_solver.domain.lift import points_at
from hexwrap_solver.domain.locate import barycentric
from hexwrap_solver.errors import PatternError
from hexwrap_solver.pattern.cells import Cells, largest_part, manifold_corners, whole_cells
from hexwrap_solver.pattern.cone import place_on_cone
from hexwrap_solver.pattern.cylinder import place_on_cylinder
from hexwrap_solver.pattern.lattice import LATTICES, Lattice
from hexwrap_solver.pattern.links import link_nodes
from hexwrap_solver.pattern.nodes import Layout, Nodes, find_nodes
from hexwrap_solver.pattern.placement import Placement, anchor_vertex, quantum_turns
from hexwrap_solver.pattern.rings import places, rows_from, turns_around, winding
from hexwrap_solver.pattern.types import Pattern, PatternSettings

#: Rounding of the layout, relative to its extent; points this near to an edge count as on it.
REACH = 1e-11


def lay_pattern(cmap: ConformalMap, settings: PatternSettings, progress: Progress = no_progress) -> Pattern:
    """A closed pattern of regular cells in the domain, carried to the surface.

    Raises NotAdaptedError where the cone angle does not suit the kind of pattern, PatternError where the
    cells are too many (``settings.max_cells``) or too large to close up around the surface.
    """
    lattice = LATTICES[settings.kind]
    turns = quantum_turns(cmap, lattice)
    if turns == 0:
        placement = place_on_cylinder(cmap, lattice, settings)
    else:
        placement = place_on_cone(cmap, lattice, settings, turns)
    progress(0.1, "placing the lattice")
    layout = layout_of(cmap, lattice, placement)
    _check_count(layout, settings)
    nodes = find_nodes(layout)
    progress(0.3, f"{nodes.n} nodes")
    links = link_nodes(layout, nodes)
    progress(0.6, "edges")
    cells, lost = largest_part(whole_cells(lattice, layout.motion, links))
    if not len(cells.corner):
        raise PatternError(
            f"No whole cell fits on the surface at {placement.around} around: ask for smaller cells."
        )
    return _finish(cmap, settings, placement, layout, nodes, cells, lost)


def layout_of(cmap: ConformalMap, lattice: Lattice, placement: Placement) -> Layout:
    """The domain's triangles in lattice units."""
    corners = placement.motion.carry(placement.place[cmap.surface.faces], cmap.sheet)
    extent = float(abs(corners).max())
    reach = max(1e-9, REACH * extent, 2 * cmap.closing_error * extent)
    return Layout(corners, cover_of(cmap), lattice, placement.motion, reach)


def _check_count(layout: Layout, settings: PatternSettings) -> None:
    p, q, r = layout.corners.T
    area = float((abs(((q - p).conj() * (r - p)).imag) / 2).sum())
    cells = area / layout.lattice.cell_area
    if cells > settings.max_cells:
        raise PatternError(
            f"About {cells:,.0f} cells would be needed, over the limit of {settings.max_cells:,}: ask for "
            "a larger edge length or fewer cells around.",
            data={"cells": int(cells), "limit": settings.max_cells},
        )


def _finish(
    cmap: ConformalMap,
    settings: PatternSettings,
    placement: Placement,
    layout: Layout,
    nodes: Nodes,
    cells: Cells,
    lost: int,
) -> Pattern:
    corner, node = manifold_corners(cells)
    own = nodes.own[node]
    triangle, place = nodes.face[own], layout.lattice.position(nodes.point[own])
    weights = barycentric(layout.corners[triangle], place)
    uv = (weights * cmap.corners()[triangle]).sum(axis=1)
    on_surface = surface_weights(cmap, triangle, weights)
    vertices, normals = points_at(cmap, triangle, on_surface)
    faces, neighbours = Ragged.from_table(corner), Ragged.from_table(cells.twin // layout.lattice.sides)
    sheet = cells.turns.ravel()
    first = _at_first_loop(cmap, faces, neighbours, sheet)
    ring = rows_from(neighbours, first)
    if settings.kind == "triangle":
        ring = ring // 2  # a row of triangles: those that stand and those that hang
    turn = (weights * (turns_around(cmap)[cmap.surface.faces] + cmap.sheet)[triangle]).sum(axis=1)
    turn = (turn - turns_around(cmap)[anchor_vertex(cmap)])[corner] + cells.turns
    notes = list(placement.notes)
    if lost:
        notes.append(f"{lost} cells hung on the pattern by no edge and were left out.")
    return Pattern(
        kind=settings.kind,
        vertices=vertices,
        normals=normals,
        uv=uv,
        faces=faces,
        sheet=sheet,
        neighbours=neighbours,
        triangle=triangle,
        barycentric=on_surface,
        whole=np.ones(faces.n_rows, dtype=bool),
        ring=ring,
        place=places(ring, turn.mean(axis=1)),
        rings=int(ring.max()) + 1,
        around=placement.around,
        rotation=placement.rotation,
        edge_length=mean_edge(vertices, faces),
        distortion=placement.distortion,
        notes=tuple(notes),
    )


def mean_edge(vertices: Floats, faces: Ragged) -> float:
    """Mean edge length of the cells, each weighted with its area (the mean over the surface)."""
    corner = faces.values
    tail, head = vertices[corner], vertices[corner[faces.next()]]
    length = np.add.reduceat(np.linalg.norm(head - tail, axis=1), faces.offsets[:-1]) / faces.lengths
    vector = np.add.reduceat(np.cross(tail, head), faces.offsets[:-1])
    area = np.linalg.norm(vector, axis=1)
    return float(length @ area / area.sum())


def _at_first_loop(cmap: ConformalMap, faces: Ragged, neighbours: Ragged, sheet: Ints) -> Bools:
    """(c,) cells with an edge on the loop of the pattern that faces the surface's loop 0.

    Raises PatternError unless the pattern is an annulus: two boundary loops, one each way around.
    """
    following = faces.next()
    edge = np.flatnonzero(neighbours.values < 0)
    tail, head = faces.values[edge], faces.values[following[edge]]
    n = int(faces.values.max()) + 1
    _, part = connected_components(
        coo_array((np.ones(len(edge)), (tail, head)), shape=(n, n)), directed=False
    )
    loops, which = np.unique(part[tail], return_inverse=True)
    gained = np.bincount(which, weights=sheet[following[edge]] - sheet[edge])
    euler = n - (len(faces.values) + len(edge)) // 2 + faces.n_rows
    if len(loops) != 2 or sorted(np.rint(gained)) != [-1, 1] or euler != 0:
        raise PatternError(
            "The whole cells do not close up to a ring around the surface, since the cells are too large for "
            "its narrowest place: ask for more cells around, or a shorter edge length."
        )
    side = int(np.argmax(gained * winding(cmap)))
    first = np.zeros(faces.n_rows, dtype=bool)
    first[faces.row[edge[which == side]]] = True
    return first
