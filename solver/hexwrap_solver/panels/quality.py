"""What was reached, measured on the finished panels and on the map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Floats, Progress, no_progress
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.geometry import cross
from hexwrap_solver.panels.congruence import congruence_classes
from hexwrap_solver.panels.facing import Facing, edge_ends, facing_edges
from hexwrap_solver.panels.fewest import SLACK
from hexwrap_solver.panels.folds import parts_by_cell
from hexwrap_solver.panels.gaps import gaps
from hexwrap_solver.panels.overlap import overlapping_pairs
from hexwrap_solver.panels.polygons import (
    best_plane_distances,
    convex,
    edge_lengths,
    fan_areas,
    interior_angles,
    mean_edges,
    row_maxima,
    row_sums,
)
from hexwrap_solver.panels.types import Panels, Quality
from hexwrap_solver.pattern.halfedges import HalfEdges
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.surface.orient import inward_note
from hexwrap_solver.surface.types import Surface

#: A smaller share of the surface without cells is not worth a note.
BARE = 0.03


def measure(
    cmap: ConformalMap,
    pattern: Pattern | None,
    panels: Panels | None,
    progress: Progress = no_progress,
    facing: Facing | None = None,
) -> Quality:
    """Everything is measured on the finished geometry, nothing is taken over from how it was made.

    facing: edges of these panels, where it is known which face each other.
    """
    stretch, area = cmap.stretch, cmap.surface.areas
    quality = Quality(
        scale_ratio=float(np.exp(np.ptp(cmap.log_scale))),
        quasi_conformal_mean=float(np.average(stretch, weights=area)),
        quasi_conformal_max=float(stretch.max()),
        notes=inward_note(cmap.surface)
        + cmap.notes
        + (pattern.notes if pattern else ())
        + (panels.notes if panels else ()),
    )
    if pattern is None or panels is None:
        return quality
    progress(0.1, "measuring panels")
    polygons, cell_area = panels.polygons, float(fan_areas(pattern.cells).sum())
    bare = max(1 - cell_area / float(area.sum()), 0.0)
    edges = pattern.half_edges
    parts, owner = parts_by_cell(panels)
    angle = interior_angles(polygons, panels.normal)
    flat = parts is panels  # none is bent
    if facing is None or not flat:
        facing = _facing(pattern, edges, parts)
    part_angle = angle if flat else interior_angles(parts.polygons, parts.normal)
    between = gaps(facing, parts, len(edges.cell))
    row, count, edge = polygons.row, polygons.lengths, edge_lengths(polygons)
    mean = row_sums(edge, polygons.offsets) / count
    ideal = _ideal_angles(pattern, panels, angle, (np.pi * (count - 2) / count)[row])
    progress(0.5, "distances to the surface")
    away = _surface_distances(cmap.surface, pattern, parts)

    def worst(measured: Floats) -> Floats:
        """(q,) of the parts of each panel."""
        return np.asarray(np.maximum.reduceat(measured, np.flatnonzero(np.diff(owner, prepend=-1))))

    bent = row_maxima(np.abs(best_plane_distances(parts.polygons)), parts.polygons.offsets)
    hollow = ~convex(parts.polygons, part_angle)
    progress(0.9, "looking for overlaps")
    return replace(
        quality,
        planarity=worst(bent) / mean,
        edge_deviation=row_maxima(np.abs(edge - mean[row]), polygons.offsets) / mean,
        angle_deviation=row_maxima(np.abs(angle - ideal), polygons.offsets),
        surface_distance=worst(away),
        gap_tangential=between.tangential,
        gap_normal=between.normal,
        kink=between.kink,
        gaps_over=_count_wide(edges, parts, between.tangential),
        convex=~worst(hollow.astype(np.float64)).astype(bool),
        congruence=congruence_classes(polygons, angle),
        overlaps=_count_overlaps(facing, parts, mean_edges(parts.polygons)),
        coverage=float(fan_areas(parts.polygons).sum()) / cell_area,
        bare=bare,
        movement=_movement(pattern, panels),
        notes=quality.notes + _bare_note(pattern, bare),
    )


def _ideal_angles(pattern: Pattern, panels: Panels, angle: Floats, even: Floats) -> Floats:
    """(h,) angles of regular polygons (even), or, of cells that are none, the nearest of the cell's."""
    row, count = panels.polygons.row, panels.polygons.lengths
    lattice, ideal = LATTICES[pattern.kind], even
    for sides in lattice.outlines:
        outline = lattice.uneven_outline(sides)
        if outline is None:
            continue
        edge = np.roll(outline, -1, axis=0) - outline
        own = np.pi - np.angle((edge[:, 0] + 1j * edge[:, 1]) / (np.roll(edge[:, 0] + 1j * edge[:, 1], 1)))
        nearest = own[abs(angle[:, None] - own).argmin(axis=1)]
        ideal = np.where((count == sides)[row] & panels.whole[row], nearest, ideal)
    return np.asarray(ideal)


def _surface_distances(surface: Surface, pattern: Pattern, panels: Panels) -> Floats:
    """(q,) of corners and centre: where a panel spans a ridge its middle stands farther off."""
    tree, polygons, n = surface.tree, panels.polygons, panels.n_panels
    points = np.concatenate([np.asarray(polygons.values, dtype=np.float64), panels.center])
    row = polygons.row
    within = np.arange(len(row)) - polygons.offsets.take(row)  # a trimmed panel may have more
    within = np.minimum(within, pattern.faces.lengths.take(panels.face).take(row) - 1)
    corner = pattern.faces.values.take(pattern.faces.offsets.take(panels.face).take(row) + within)
    beside = pattern.triangle.take(corner)
    near = np.concatenate([beside, beside[polygons.offsets[:-1]]])
    return tree.farthest(points, np.concatenate([row, np.arange(n)]), n, near, surface.twin)


def _facing(pattern: Pattern, edges: HalfEdges, panels: Panels) -> Facing:
    """Of flat panels, corners in step with those of their cells."""
    panel = np.full(pattern.n_cells, -1, dtype=np.int64)
    panel[panels.face] = np.arange(panels.n_panels)
    normal = np.zeros((pattern.n_cells, 3))
    normal[panels.face] = panels.normal
    corner = np.arange(len(edges.cell)) - pattern.faces.offsets[edges.cell]
    return facing_edges(edges, panel, corner, normal)


def _count_wide(edges: HalfEdges, panels: Panels, gap: Floats) -> int | None:
    """Panels with a joint wider than ``max_gap``; joints as wide as that but for rounding are not."""
    if panels.max_gap is None:
        return None
    wide = np.unique(edges.cell[gap > panels.max_gap * (1 + SLACK)])
    return int(np.isin(wide, panels.face).sum())


def _count_overlaps(facing: Facing, panels: Panels, mean_edge: Floats) -> int:
    """Pairs of neighbours. As a rule the line of an edge that faces the other panel lies between them."""
    polygons, normal = panels.polygons, panels.normal
    pairs = np.stack([facing.left, facing.right], axis=1)
    start, end = edge_ends(polygons, facing.left, facing.start_left)
    outwards = cross(end - start, facing.mean)
    found = np.sort(pairs[overlapping_pairs(polygons, normal, mean_edge, pairs, outwards)], axis=1)
    return len(np.unique(found, axis=0))


def _bare_note(pattern: Pattern, share: float) -> tuple[str, ...]:
    """share: of the surface, without cells."""
    if share <= BARE:
        return ()
    trim = "; with boundary 'trim' cells reach its edges" if pattern.whole.all() else ""
    return (f"Cells cover {1 - share:.0%} of the surface; coverage is relative to them{trim}.",)


def _movement(pattern: Pattern, panels: Panels) -> float:
    """How far shared corners stand from the pattern's; 0 for split panels, which share none."""
    if panels.mode == "split":
        return 0.0
    return float(np.linalg.norm(panels.polygons.values - pattern.cells.values, axis=1).max(initial=0.0))
