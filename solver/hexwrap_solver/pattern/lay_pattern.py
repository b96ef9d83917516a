"""Laying a pattern on the domain of a conformal map (paper, definition 2; Figures 1, 5–7)."""

from __future__ import annotations

import contextlib
import sys
from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, Progress, Ragged, no_progress, positions
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.domain.interpolate import surface_weights
from hexwrap_solver.domain.lift import points_at
from hexwrap_solver.domain.locate import barycentric
from hexwrap_solver.errors import PatternError
from hexwrap_solver.geometry import cross, dot, lengths, orbits, plane_areas
from hexwrap_solver.pattern.along import feature_notes, on_features
from hexwrap_solver.pattern.lattice import LATTICES, Lattice
from hexwrap_solver.pattern.lay.cells import (
    Cells,
    WholeCells,
    awkward_cells,
    largest_part,
    manifold_corners,
    only_whole_cells,
    sides_by_edge,
    whole_cells,
)
from hexwrap_solver.pattern.lay.edges import PatternEdges, find_edges
from hexwrap_solver.pattern.lay.labels import azimuth, first_on_net, places, rows_from, turns_around, winding
from hexwrap_solver.pattern.lay.layout import Layout
from hexwrap_solver.pattern.lay.nodes import Nodes, find_nodes
from hexwrap_solver.pattern.pieces import fold_pieces
from hexwrap_solver.pattern.place.choose import PlacementFamily
from hexwrap_solver.pattern.place.placement import FOLDED, Placement, anchor_vertex, edge_angle
from hexwrap_solver.pattern.place.rotation import with_rotation
from hexwrap_solver.pattern.place.sense import check_edge, too_many
from hexwrap_solver.pattern.place.size import ASKED, fitting_number, mean_stretch, wanted_edge
from hexwrap_solver.pattern.trim.arrangement import Points
from hexwrap_solver.pattern.trim.boundary import Boundary, boundary_of
from hexwrap_solver.pattern.trim.enclosed import around_enclosed, met_by_pattern
from hexwrap_solver.pattern.trim.folds import cut_open
from hexwrap_solver.pattern.trim.tips import ending_at_tips
from hexwrap_solver.pattern.trim.trim import Folded, TooCoarse, Trimmed, trim
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from hexwrap_solver.surface.features import FeatureEdges
from hexwrap_solver.surface.normals import with_tangents
from hexwrap_solver.surface.projection import project, start_parameters
from hexwrap_solver.tolerances import RELATIVE
from hexwrap_solver.words import were

#: Relative error of an edge length asked for that calls for a second attempt.
CLOSE = 0.005

#: Parts of the default edge length that are tried where cells of it do not close up.
FINER = (2, 4, 8)

#: Above this many cells, where the map is STEEP, it is the map that does not suit, not the size of the cells.
MANY = 1e12
#: Differences of u that alone make this many: areas e^24 = 3e10 times as large as others.
STEEP = 12.0

#: Of the layout, relative to its extent; points this near to an edge count as on it.
ROUNDING = 1e-11
#: Factor of that distance for a second attempt.
WIDER = 100.0


def lay_pattern(cmap: ConformalMap, settings: PatternSettings, progress: Progress = no_progress) -> Pattern:
    """A closed pattern of regular cells in the domain, carried to the surface.

    Raises NotAdaptedError where the cone angle does not suit the kind of pattern, PatternError where the
    cells are too many (``settings.max_cells``) or too large to close up around the surface.
    """
    check_edge(cmap.surface, settings)
    lattice = LATTICES[settings.cell_kind]
    settings, notes = with_rotation(cmap, lattice, settings)
    placing = PlacementFamily.of(cmap, lattice, settings)
    pattern, finer = _laid(cmap, placing, settings, progress)
    notes += finer
    if settings.around is not None and pattern.around != settings.around and cmap.fitted is None:
        why = "the nearest that closes up"
        if any(feature.straight for feature in pattern.features):
            why = "lines of the pattern follow the folds with less distortion"
        notes.append(f"{pattern.around} cells around instead of {settings.around}: {why}.")
    wanted = settings.edge_length
    if wanted is not None and abs(pattern.edge_length / wanted - 1) > CLOSE:
        corrected = replace(settings, edge_length=wanted**2 / pattern.edge_length)
        again = _lay(cmap, placing, corrected, no_progress)
        pattern = min(pattern, again, key=lambda one: off_by(one.edge_length, wanted, one.distortion))
        if abs(pattern.edge_length / wanted - 1) > ASKED:
            notes.append(
                f"The mean edge length is {pattern.edge_length:.6g} instead of {wanted:.6g}, so that the "
                f"pattern closes up with little distortion ({pattern.around} cells around); others may be "
                "had with around."
            )
    if not pattern.distortion < FOLDED:
        notes.append(
            "The pattern is bent so much that triangles of the surface turn over in it; smaller cells are "
            "bent less."
        )
        pattern = replace(pattern, distortion=FOLDED)
    return replace(pattern, notes=(*notes, *pattern.notes))


def off_by(edge: float, wanted: float, distortion: float) -> float:
    """How far a pattern is from what is wanted: of two that miss the length by as much the less stretched one
    is taken."""
    return abs(edge / wanted - 1) + distortion


class _CoarseError(PatternError):
    """The cells are too large to close up."""


def _laid(
    cmap: ConformalMap, placing: PlacementFamily, settings: PatternSettings, progress: Progress
) -> tuple[Pattern, list[str]]:
    """In cells small enough to close up, where no size is asked for; and a note if the default is not."""
    try:
        return _lay(cmap, placing, settings, progress), []
    except _CoarseError:
        if settings.around is not None or settings.edge_length is not None or cmap.fitted is not None:
            raise
        lattice = LATTICES[settings.cell_kind]
        edge = wanted_edge(cmap, lattice, settings, edge_angle(lattice, settings)) * mean_stretch(cmap)
        for part in FINER:
            with contextlib.suppress(_CoarseError):
                pattern = _lay(cmap, placing, replace(settings, edge_length=edge / part), progress)
                break
        else:
            raise
    return pattern, [
        f"Cells of the default size, {edge:.3g} long edges, do not close up around the narrowest place: "
        f"these are {pattern.edge_length:.3g} long."
    ]


def _lay(
    cmap: ConformalMap,
    placing: PlacementFamily,
    settings: PatternSettings,
    progress: Progress,
    wider: float = 1.0,
) -> Pattern:
    """wider: factor of the distance within which points are one."""
    lattice = placing.lattice
    placement = placing.at(settings)
    progress(0.1, "placing the lattice")
    layout = layout_of(placing.cmap, lattice, placement)
    layout = replace(layout, tolerance=wider * layout.tolerance)
    check_count(cmap, layout.corners, layout.lattice, settings)
    surface = placing.cmap.surface
    numbers = sorted(placing.features)
    features = FeatureEdges.of(surface, [surface.features[i] for i in numbers])
    if len(features):
        layout = cut_open(layout, features)
    nodes = find_nodes(layout)
    if not nodes.n:
        raise _too_coarse(cmap, settings, placement)
    progress(0.3, f"{nodes.n} nodes")
    edges, nodes = find_edges(layout, nodes)
    progress(0.6, "edges")
    boundary = boundary_of(cmap.surface, layout)
    if len(features):
        edges = ending_at_tips(layout, nodes, edges, boundary)
    edges = edges.both_ways()
    whole = whole_cells(lattice, edges)
    met = met_by_pattern(layout, nodes, edges, boundary)
    # Where folds meet the boundary, cells are cut anyway.
    met[boundary.loop[boundary.surface_loop < 0]] = True
    if cmap.kind != "net":
        # It would go around the surface.
        met[boundary.loop[(boundary.surface_loop == 0) | (boundary.surface_loop == 1)]] = True
    if len(boundary.face) and (settings.boundary == "trim" or len(features)):
        folded = Folded(surface.faces, placement.glued, features) if len(features) else None
        try:
            cut = trim(
                layout, boundary, met, nodes, edges, whole, folded, keep_cut=settings.boundary == "trim"
            )
        except TooCoarse:
            # Points at just about that distance from the boundary are on it for one step and not for another.
            if wider == 1:
                return _lay(cmap, placing, settings, progress, WIDER)
            raise _too_coarse(cmap, settings, placement) from None
    else:
        cut = _uncut(layout, boundary, met, nodes, edges, whole)
    progress(0.8, f"{cut.cells.n} cells")
    return _finish(cmap, settings, placing, placement, layout, cut)


def _uncut(
    layout: Layout,
    boundary: Boundary,
    met: Bools,
    nodes: Nodes,
    edges: PatternEdges,
    whole: WholeCells,
) -> Trimmed:
    """The whole cells alone."""
    own = nodes.own
    side = sides_by_edge(edges, whole)[around_enclosed(layout, boundary, nodes, edges, met)]
    keep = np.ones(whole.n, dtype=bool)
    keep[whole.corner.row[side[side >= 0]]] = False
    cells = only_whole_cells(edges, whole).part(keep)
    points = Points(nodes.face[own], layout.lattice.stand(nodes.point[own]), np.zeros(nodes.n, dtype=bool))
    return Trimmed(cells, np.ones(cells.n, dtype=bool), points, holed=int((~keep).sum()))


def layout_of(cmap: ConformalMap, lattice: Lattice, placement: Placement) -> Layout:
    """The domain's triangles in lattice units."""
    net = cmap.net
    corners = placement.glued.corners(cmap.surface.faces, placement.place)
    extent = float(abs(corners).max())
    tolerance = max(RELATIVE, ROUNDING * extent, 2 * cmap.closing_error * extent)
    return Layout(
        corners,
        net.across,
        net.crossing,
        placement.isometries,
        net.inverse,
        cmap.surface.twin,
        _corner_of(cmap.surface.faces, cmap.cones.vertex),
        lattice,
        tolerance,
    )


def _corner_of(faces: Ints, vertex: Ints) -> Ints:
    """(k,) a corner 3·face + c at each vertex."""
    return positions(faces.ravel(), int(faces.max()) + 1)[vertex]


def check_count(cmap: ConformalMap, corners: Complexes, lattice: Lattice, settings: PatternSettings) -> None:
    """Before cells are made, whether they are too many. corners: (m, 3) of the triangles in the plane of the
    lattice. Raises PatternError."""
    extent = float(abs(corners).max())
    # on cones that shrink beyond all measure areas would overflow
    area = float(plane_areas(corners / extent).sum())
    cells = min(area / lattice.cell_area * extent * extent, sys.float_info.max)
    if cells > MANY and np.ptp(cmap.log_scale) > STEEP:
        raise PatternError(
            f"About {cells:.0e} cells would be needed: under this boundary condition the map shrinks some "
            "parts of the surface far too much for cells of one size; ask for a smaller cone angle.",
            data={"cells": cells, "limit": settings.max_cells},
        )
    if cells > settings.max_cells:
        raise too_many(cmap.surface, settings, cells, cmap.log_scale)


def _finish(
    cmap: ConformalMap,
    settings: PatternSettings,
    placing: PlacementFamily,
    placement: Placement,
    layout: Layout,
    cut: Trimmed,
) -> Pattern:
    triangle, place = cut.points.face, cut.points.place
    weights = barycentric(layout.corners[triangle], place)
    on_surface = surface_weights(cmap, triangle, weights)
    vertices, normals = _on_input_surface(cmap, triangle, on_surface)
    area = area_vectors(cut.cells.corner, vertices)
    outward = faces_outward(cut.cells.corner, area, normals)
    folded = int(np.count_nonzero(~outward))
    keep, narrow, (corner, point) = _usable(cut.cells, outward, placement.narrows or cut.seams is not None)
    if not keep.any():
        raise _too_coarse(cmap, settings, placement)
    cells, whole = cut.cells.part(keep), cut.whole[keep]
    triangle, place, weights = triangle[point], place[point], weights[point]
    on_surface, vertices, normals = on_surface[point], vertices[point], normals[point]
    uv = dot(weights, cmap.corners()[triangle])
    faces, neighbours = Ragged(corner, cells.corner.offsets), cells.neighbours()
    net = cmap.kind == "net"
    first: Bools | None = None
    if not net:
        first = _at_first_loop(cmap, layout, faces, neighbours, cells.isometry[:, 3])
        turn_of_cell = _turn_of_cells(cmap, faces, cells, triangle, weights)
    if first is None:
        # Around a window near the edge of a facade no ring of cells need go.
        if not net and not cmap.deck.is_flat_ring:
            raise _too_coarse(cmap, settings, placement)
        centers = np.add.reduceat(vertices[corner], faces.offsets[:-1], axis=0) / faces.lengths[:, None]
        first, turn_of_cell = first_on_net(cmap, centers, neighbours), azimuth(cmap, centers)
    ring = rows_from(neighbours, first)
    ring = ring // layout.lattice.counted  # a row of triangles: those that stand and those that hang
    features = on_features(cmap, placing, placement, cut.seams, cells, corner, whole)
    beside = layout.lattice.carry(cells.isometry, place[corner])
    return Pattern(
        kind=settings.cell_kind,
        vertices=vertices,
        normals=normals,
        uv=uv,
        faces=faces,
        corners=_corners(cmap, layout, faces, cells.isometry, triangle, place, uv),
        index=cells.index,
        sheet=None if net else cells.isometry[:, 3],
        neighbours=neighbours,
        triangle=triangle,
        barycentric=on_surface,
        whole=whole,
        ring=ring,
        place=places(ring, turn_of_cell),
        rings=int(ring.max()) + 1,
        around=int(np.bincount(ring).max()) if net else placement.around,
        rotation=placement.rotation,
        edge_length=mean_edge(vertices, faces, lengths(area[keep])),
        distortion=placement.distortion,
        proposes=placement.proposes,
        notes=(
            *placement.notes,
            *feature_notes(features),
            *_trim_notes(cut, narrow, folded, int(np.count_nonzero(~keep)) - narrow - folded),
        ),
        features=features,
        pieces=fold_pieces(layout.lattice, features, cells, corner, beside, whole) if features else None,
    )


def _turn_of_cells(
    cmap: ConformalMap, faces: Ragged, cells: Cells, triangle: Ints, weights: Floats
) -> Floats:
    """(c,) how many turns around the surface each cell stands from the anchor."""
    vertex_turn = turns_around(cmap)
    turn = dot(weights, (vertex_turn[cmap.surface.faces] + cmap.sheet)[triangle])
    turn = turn[faces.values] - vertex_turn[anchor_vertex(cmap)] + cells.isometry[:, 3]
    return np.asarray(np.add.reduceat(turn, faces.offsets[:-1]) / faces.lengths)


def _corners(
    cmap: ConformalMap,
    layout: Layout,
    faces: Ragged,
    isometry: Ints,
    triangle: Ints,
    place: Complexes,
    uv: Complexes,
) -> Complexes:
    """(k,) the corners of each cell beside its first one. On nets, those across a cut are found from their
    places on the lattice, by the affine map of the first corner's triangle."""
    corner = faces.values.astype(np.int64)
    if cmap.kind != "net":
        return cmap.deck.apply(uv[corner], isometry[:, 3])
    z = uv[corner]
    moved = np.flatnonzero(isometry.any(axis=1))
    beside = layout.lattice.carry(isometry[moved], place[corner[moved]])
    first = triangle[corner[faces.offsets[faces.row[moved]]]]
    weights = barycentric(layout.corners[first], beside)
    z[moved] = dot(weights, cmap.corners()[first])
    return z


def area_vectors(corner: Ragged, points: Floats) -> Floats:
    """(c, 3) twice the areas of cells, along their normals; about their first corners, since far off those
    about the origin would lose digits. points: (p, 3)."""
    at = corner.values.astype(np.int64)
    first = points.take(at[corner.offsets[:-1]], axis=0).take(corner.row, axis=0)
    spoke = points.take(at, axis=0) - first
    turn = cross(spoke, spoke.take(corner.next(), axis=0))
    return np.asarray(np.add.reduceat(turn, corner.offsets[:-1], axis=0))


def faces_outward(corner: Ragged, area: Floats, normals: Floats) -> Bools:
    """(c,) cells that run counter-clockwise seen from outside. Where the surface folds back within one, it
    may have no side that looks there. area: (c, 3) their ``area_vectors``. normals: (p, 3)."""
    side = np.add.reduceat(normals.take(corner.values.astype(np.int64), axis=0), corner.offsets[:-1], axis=0)
    return np.asarray(dot(area, side) > 0)


def _usable(cells: Cells, outward: Bools, narrows: bool) -> tuple[Bools, int, tuple[Ints, Ints]]:
    """(c,) the largest part of the outward cells (c,) without those that no mesh of shared vertices can tell
    apart, how many these are, and the ``manifold_corners`` of the part. narrows: towards one end fewer go
    around, and those left out may be the few there; none are usable otherwise."""
    keep = outward.copy()
    narrow, corners = 0, (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
    while keep.any():
        members = np.flatnonzero(keep)
        part = cells.part(keep)
        keep[members] = largest_part(part)
        members, part = np.flatnonzero(keep), cells.part(keep)
        corners = manifold_corners(part)
        awkward = awkward_cells(Ragged(corners[0], part.corner.offsets), part.twin)
        if not awkward.any():
            break
        keep[members[awkward]] = False
        keep &= narrows
        narrow += int(awkward.sum())
    return keep, narrow, corners


def _trim_notes(cut: Trimmed, narrow: int, folded: int, apart: int) -> list[str]:
    notes = []
    if cut.joined:
        notes.append(f"{were(cut.joined, 'sliver')} joined at the boundary to the next cut cell.")
    if cut.lost:
        notes.append(f"{were(cut.lost, 'sliver')} left out at the boundary, {cut.dropped:.2f} cells in area.")
    if narrow:
        notes.append(
            f"{were(narrow, 'cell')} left out where the surface is so narrow that a cell touches itself."
        )
    if cut.holed:
        notes.append(
            f"{were(cut.holed, 'cell')} left out because an opening lies inside; smaller cells would go "
            "around it."
        )
    if folded:
        notes.append(
            f"{were(folded, 'cell')} left out because the surface folds back there; smaller cells would "
            "follow it."
        )
    if apart:
        what = "1 cell shares no edge with the rest of the pattern and was"
        what = what if apart == 1 else f"{apart} cells share no edge with the rest of the pattern and were"
        notes.append(f"{what} left out.")
    return notes


def _on_input_surface(cmap: ConformalMap, triangle: Ints, weights: Floats) -> tuple[Floats, Floats]:
    """Points and normals on the mesh, or on the NURBS surface where the mesh was made from one."""
    points, normals = points_at(cmap, triangle, weights)
    surface = cmap.surface
    if surface.nurbs is None:
        return points, normals
    start = start_parameters(surface, triangle, weights)
    points, _, exact = project(surface.nurbs, points, start)
    return points, with_tangents(exact, normals)


def mean_edge(vertices: Floats, faces: Ragged, area: Floats) -> float:
    """Mean edge length of the cells, each weighted with its area (the mean over the surface)."""
    corner = faces.values.astype(np.int64)
    tail = vertices.take(corner, axis=0)
    edge = lengths(tail.take(faces.next(), axis=0) - tail)
    length = np.add.reduceat(edge, faces.offsets[:-1]) / faces.lengths
    return float(length @ area / area.sum())


def _too_coarse(cmap: ConformalMap, settings: PatternSettings, placement: Placement) -> _CoarseError:
    if cmap.kind == "net":
        return _CoarseError(
            f"No cell of this size fits on the surface: its longest loop would take {placement.around} of "
            "them. Ask for more cells around, or a shorter edge."
        )
    around, step, asked = placement.around, placement.step, ""
    if settings.around not in (None, around):
        only = f" (only multiples of {step} close up at this rotation)" if step > 1 else ""
        asked = f", the nearest to the {settings.around} asked for{only}"
    return _CoarseError(
        f"With {around} cell{'s' if around > 1 else ''} around{asked}, the cells do not close up to a ring "
        "around the surface, since they are too large for its narrowest place: ask for more cells around, or "
        f"a shorter edge{_that_fits(cmap, settings, placement)}."
    )


def _that_fits(cmap: ConformalMap, settings: PatternSettings, placement: Placement) -> str:
    """A size that would do, where it is not that of the placement."""
    lattice = LATTICES[settings.cell_kind]
    enough, edge = fitting_number(cmap, lattice, edge_angle(lattice, settings))
    enough = placement.step * -(-enough // placement.step)
    return (
        "" if enough <= placement.around else f": {enough} cells around, or an edge length of {edge:.3g}, fit"
    )


def _at_first_loop(
    cmap: ConformalMap, layout: Layout, faces: Ragged, neighbours: Ragged, sheet: Ints
) -> Bools | None:
    """(c,) cells with an edge on the loop of the pattern that faces the surface's loop 0.

    None unless the pattern goes around once: all of its boundary loops but two, one each way around, are
    openings.
    """
    following = faces.next()
    edge = np.flatnonzero(neighbours.values < 0)
    tail, head = faces.values[edge], faces.values[following[edge]]
    n = int(faces.values.max()) + 1
    which, loops = orbits(positions(tail.astype(np.int64), n)[head])  # boundaries are simple loops
    gained = np.rint(np.bincount(which, weights=sheet[following[edge]] - sheet[edge]))
    euler = n - (len(faces.values) + len(edge)) // 2 + faces.n_rows
    if sorted(gained[gained != 0]) != [-1, 1] or euler != 2 - loops:
        return None
    side = int(np.argmax(gained * winding(cmap, layout)))
    first = np.zeros(faces.n_rows, dtype=bool)
    first[faces.row[edge[which == side]]] = True
    return first
