"""Where the regular panels lie, before their sizes: closed form or energy, best-fit or tangent planes."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Progress, Ragged
from hexwrap_solver.panels.energy import minimise_singly
from hexwrap_solver.panels.polygons import edge_lengths, mean_edges, row_minima
from hexwrap_solver.panels.regular import Poses, nearest_copy, nearest_regular, nearest_regular_in_plane
from hexwrap_solver.panels.tangents import surface_normals
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.surface.types import Surface

#: Minimisers this near to regular panels (relative to the edge) are regular to rounding.
REGULAR = 1e-9


def fit_poses(
    surface: Surface,
    cells: Floats,
    settings: PanelSettings,
    progress: Progress,
    outline: Floats | None = None,
) -> tuple[Poses, Floats | None, tuple[str, ...]]:
    """Poses for cells (r, p, 3); with method ``energy`` also the energy curve, and a note where it is not
    regular. outline: (p, 2) what the panels are copies of, None for regular polygons; always exact."""
    if settings.method == "exact" or outline is not None:
        return _nearest(surface, cells, settings, outline), None, ()
    target = target_lengths(Ragged.from_table(cells), settings)
    tree = surface.tree if settings.weights.surface > 0 else None
    shape, energy = minimise_singly(cells, target, settings.weights, tree, progress)
    poses = _nearest(surface, shape, settings)
    ideal = poses.center[:, None] + poses.free_length[:, None, None] * poses.spokes(cells.shape[1])
    miss = float((np.linalg.norm(shape - ideal, axis=2).max(axis=1) / target).max(initial=0.0))
    if miss <= REGULAR:
        return poses, energy, ()
    note = (
        f"The minimisers of the energy differ from regular panels by up to {miss:.1e} of the edge length; the"
        " panels are the regular ones nearest to them."
    )
    return poses, energy, (note,)


def target_lengths(cells: Ragged, settings: PanelSettings) -> Floats:
    """ℓ_P of the energies: the shortest edge of each cell, or its mean edge (paper, section 5)."""
    if settings.target == "shortest":
        return row_minima(edge_lengths(cells), cells.offsets)
    return mean_edges(cells)


def _nearest(
    surface: Surface, shape: Floats, settings: PanelSettings, outline: Floats | None = None
) -> Poses:
    normal = None
    if settings.orientation != "fit":
        normal = surface_normals(surface, shape.mean(axis=1))
    if outline is not None:
        return nearest_copy(shape, outline, normal)
    return nearest_regular(shape) if normal is None else nearest_regular_in_plane(shape, normal)
