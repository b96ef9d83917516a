"""What was reached, measured on the finished panels and on the map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, Progress, no_progress
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.geometry import cross_first
from hexwrap_solver.panels.congruence import congruence_classes
from hexwrap_solver.panels.facing import Facing, facing_edges, sides
from hexwrap_solver.panels.fewest import SLACK
from hexwrap_solver.panels.folds import parts_by_cell
from hexwrap_solver.panels.gaps import gaps
from hexwrap_solver.panels.overlap import overlapping_pairs
from hexwrap_solver.panels.polygons import STRAIGHT, Outlines, outlines
from hexwrap_solver.panels.types import Panels, Quality
from hexwrap_solver.pattern.halfedges import HalfEdges
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.surface.orient import inward_note
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.words import place

#: A smaller share of the surface without cells is not worth a note.
BARE = 0.03
#: Panels farther from the surface than this part of their edges are worth a note.
OFF = 0.5


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
    parts, owner = parts_by_cell(panels)
    edges = pattern.half_edges
    if facing is None or parts is not panels:
        facing = _facing(pattern, edges, parts)
    ends = sides(parts.polygons, facing)
    between = gaps(facing, ends, len(edges.cell))
    (mean, uneven, crooked), (bent, widest, mean_part, area), congruence = _shapes(pattern, panels, parts)
    progress(0.5, "distances to the surface")
    away = _surface_distances(cmap.surface, pattern, parts)
    progress(0.9, "looking for overlaps")
    first = np.flatnonzero(np.diff(owner, prepend=-1))  # part of each panel
    distance = np.maximum.reduceat(away, first)
    bare = max(1 - pattern.area / float(cmap.surface.areas.sum()), 0.0)
    return replace(
        quality,
        planarity=np.maximum.reduceat(bent, first) / mean,
        edge_deviation=uneven,
        angle_deviation=crooked,
        surface_distance=distance,
        gap_tangential=between.tangential,
        gap_normal=between.normal,
        kink=between.kink,
        gaps_over=_count_wide(edges, parts, between.tangential),
        convex=np.maximum.reduceat(widest, first) <= np.pi + STRAIGHT,
        congruence=congruence,
        overlaps=_count_overlaps(facing, ends[0], parts, mean_part),
        coverage=float(area.sum()) / pattern.area,
        bare=bare,
        movement=_movement(pattern, panels),
        notes=quality.notes + _bare_note(bare) + _off_note(panels, distance, mean),
    )


def _shapes(pattern: Pattern, panels: Panels, parts: Panels) -> tuple[Floats, Floats, Ints]:
    """(3, q) of the panels: mean edge, and how far edges, relative to it, and angles deviate; (4, k) of their
    parts, the panels themselves where none is bent: how far corners lie off the plane, greatest angle, mean
    edge, area; and (q,) the classes of congruent panels."""
    whole = outlines(panels.polygons, panels.normal)
    pieces = whole if parts is panels else outlines(parts.polygons, parts.normal)
    of_panels, of_parts = np.zeros((3, panels.n_panels)), np.zeros((4, parts.n_panels))
    for one in whole:
        mean = one.length.mean(axis=0)
        uneven = np.abs(one.length - mean).max(axis=0) / mean
        crooked = np.abs(one.angle - _ideal_angles(pattern, panels.whole, one)).max(axis=0)
        of_panels[:, one.row] = mean, uneven, crooked
    for one in pieces:
        bent, widest = np.abs(one.off_plane).max(axis=0), one.angle.max(axis=0)
        of_parts[:, one.row] = bent, widest, one.length.mean(axis=0), one.area
    return of_panels, of_parts, congruence_classes(whole)


def _ideal_angles(pattern: Pattern, whole: Bools, shapes: Outlines) -> Floats:
    """(n, k) angles of regular polygons, or, of whole cells that are none, the nearest of the cell's."""
    n = len(shapes.length)
    even = np.full(shapes.length.shape, np.pi * (n - 2) / n)
    lattice = LATTICES[pattern.kind]
    outline = lattice.uneven_outline(n) if n in lattice.outlines else None
    if outline is None:
        return even
    edge = np.roll(outline, -1, axis=0) - outline
    own = np.pi - np.angle((edge[:, 0] + 1j * edge[:, 1]) / (np.roll(edge[:, 0] + 1j * edge[:, 1], 1)))
    nearest = own[abs(shapes.angle[..., None] - own).argmin(axis=-1)]
    return np.where(whole[shapes.row], nearest, even)


def _surface_distances(surface: Surface, pattern: Pattern, panels: Panels) -> Floats:
    """(q,) of corners and centre: where a panel spans a ridge its middle stands farther off."""
    tree, polygons, n = surface.tree, panels.polygons, panels.n_panels
    points = np.concatenate([np.asarray(polygons.values, dtype=np.float64), panels.center])
    row = polygons.row
    # a trimmed panel may have more corners than its cell
    within = np.minimum(polygons.within, pattern.faces.lengths.take(panels.face).take(row) - 1)
    corner = pattern.faces.values.take(pattern.faces.offsets.take(panels.face).take(row) + within).astype(
        np.int64
    )
    beside = pattern.triangle.take(corner)
    near = np.concatenate([beside, beside[polygons.offsets[:-1]]])
    return tree.farthest(points, np.concatenate([row, np.arange(n)]), n, near, surface.twin)


def _facing(pattern: Pattern, edges: HalfEdges, panels: Panels) -> Facing:
    """Of flat panels, corners in step with those of their cells."""
    panel = np.full(pattern.n_cells, -1, dtype=np.int64)
    panel[panels.face] = np.arange(panels.n_panels)
    normal = np.zeros((pattern.n_cells, 3))
    normal[panels.face] = panels.normal
    return facing_edges(edges, panel, pattern.faces.within, normal)


def _count_wide(edges: HalfEdges, panels: Panels, gap: Floats) -> int | None:
    """Panels with a joint wider than ``max_gap``; joints as wide as that but for rounding are not."""
    if panels.max_gap is None:
        return None
    wide = np.unique(edges.cell[gap > panels.max_gap * (1 + SLACK)])
    return int(np.isin(wide, panels.face).sum())


def _count_overlaps(facing: Facing, edge: Floats, panels: Panels, mean_edge: Floats) -> int:
    """Pairs of neighbours. As a rule the line of an edge that faces the other panel lies between them; edge:
    (3, k) those of the left panels."""
    pairs = np.stack([facing.left, facing.right], axis=1)
    outwards = cross_first(edge, facing.frame[2])
    found = np.sort(
        pairs[overlapping_pairs(panels.polygons, panels.normal, mean_edge, pairs, outwards)], axis=1
    )
    return len(np.unique(found, axis=0))


def _bare_note(share: float) -> tuple[str, ...]:
    """share: of the surface, without cells."""
    if share <= BARE:
        return ()
    return (f"Cells cover {1 - share:.0%} of the surface; coverage is relative to them.",)


def _off_note(panels: Panels, distance: Floats, edge: Floats) -> tuple[str, ...]:
    """distance: (q,) to the surface, edge: (q,) mean lengths."""
    off = np.flatnonzero(distance > OFF * edge)
    if len(off) == 0 or panels.mode == "watertight":
        return ()
    worst = off[distance[off].argmax()]
    count = "1 panel stands" if len(off) == 1 else f"{len(off)} panels stand"
    return (
        f"{count} off the surface by more than half an edge, the worst by {distance[worst]:.3g} at "
        f"{place(panels.center[worst])}: the surface bends too much within a cell for a flat panel; smaller "
        "cells, or singularities, follow it.",
    )


def _movement(pattern: Pattern, panels: Panels) -> float:
    """How far shared corners stand from the pattern's; 0 for split panels, which share none."""
    if panels.mode == "split":
        return 0.0
    return float(np.linalg.norm(panels.polygons.values - pattern.cells.values, axis=1).max(initial=0.0))
