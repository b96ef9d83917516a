"""Where each panel lies and how large it may become: all of the rationalization but the size classes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, Progress, Ragged, no_progress, positions
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.errors import ConvergenceError, PanelsError
from hexwrap_solver.geometry import normalize
from hexwrap_solver.panels import limits
from hexwrap_solver.panels.best import Bound, jointly_largest
from hexwrap_solver.panels.energy import NEAREST, functionals, minimise_watertight
from hexwrap_solver.panels.facing import facing_edges
from hexwrap_solver.panels.folds import AlongFolds, places_of
from hexwrap_solver.panels.planar import crossing_themselves
from hexwrap_solver.panels.polygons import (
    best_plane_distances,
    convex,
    edge_lengths,
    fan_areas,
    interior_angles,
    mean_edges,
    means,
    row_maxima,
    row_minima,
)
from hexwrap_solver.panels.poses import fit_poses, target_lengths
from hexwrap_solver.panels.regular import Poses, bending, corners, outline_areas
from hexwrap_solver.panels.separation import Separation, separating_planes
from hexwrap_solver.panels.trimmed import flatten_and_clear, plane_normals
from hexwrap_solver.panels.types import Bends, FittedPanels, PanelSettings, Weights
from hexwrap_solver.pattern.halfedges import HalfEdges
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.surface.curvature import saddle_share
from hexwrap_solver.surface.types import Surface

#: A trimmed cell of whose size (root of the area) less than this fraction is left gets no panel.
LEAST_TRIMMED = 0.05

#: Corners farther from the surface than this fraction of the mean edge are worth a note.
FAR = 0.1

#: Weight of the surface that halves such distances, with few panels that collapse or cross themselves.
HOLD = 50.0

#: An edge shorter than this fraction of its panel's mean edge has collapsed.
LEAST_EDGE = 0.01


def fit_key(s: PanelSettings) -> tuple[object, ...]:
    """The settings that ``fit_panels`` depends on."""
    return s.mode, s.target, s.orientation, s.joint, s.method, s.weights, s.fold


NO_POLYGONS = Ragged(np.zeros((0, 3)), np.zeros(1, dtype=np.int64))
WATERTIGHT_NOTES = (
    "Watertight panels share their corners: joint, orientation and size classes do not apply.",
)
WEIGHTS_NOTE = ("Weights were given, so the energies were minimised, as with method energy.",)

#: Corners farther from their panel's plane than this fraction of its mean edge: it did not become flat.
FLAT = 1e-9

#: An energy above this that no step lowers is worth a note.
MINIMAL = 1e-12
STUCK_NOTE = ("No step lowered the energy: the corners stand where the pattern has them.",)

#: Where panels have all but no room, rounding can leave the programme for their sizes without an answer.
JOINTLY_NOTE = (
    "The linear programme for the best panel sizes did not converge; the panels have the sizes inscribed in"
    " their cells, as with target inscribed.",
)


def fit_panels(
    cmap: ConformalMap, pattern: Pattern, settings: PanelSettings, progress: Progress = no_progress
) -> FittedPanels:
    """Poses and size limits of split panels, or the finished faces of a watertight mesh (paper, section 5).

    Depends on the settings in ``fit_key`` only. Raises PanelsError where no whole cell has room for a panel.
    """
    progress(0.0, "fitting panels")
    if settings.mode == "watertight":
        return _fit_watertight(cmap.surface, pattern, settings, progress)
    return _fit_split(cmap.surface, pattern, settings, progress)


@dataclass(frozen=True)
class _Group:
    """Cells with the same number of sides, and the panels nearest to them. face: (k,) cells. at: (k, sides)
    their half-edges. regular: whether they are a kind of the pattern, not around singularities."""

    face: Ints
    at: Ints
    points: Floats
    poses: Poses
    regular: bool

    @property
    def sides(self) -> int:
        return int(self.at.shape[1])

    @property
    def spokes(self) -> Ragged:
        return Ragged.from_table(self.poses.spokes(self.sides))

    @property
    def bends(self) -> int:
        """Corners of the panels that are not straight."""
        outline = corners(self.sides) if self.poses.outline is None else self.poses.outline[0]
        return bending(outline[:, 0] + 1j * outline[:, 1])

    def inscribed(self, planes: Separation) -> tuple[Floats, Floats]:
        return limits.inscribed(self.poses, planes.direction[self.at], planes.offset[self.at])

    def finished(self, planes: Separation, cells: int) -> tuple[Ragged, Floats, Bools]:
        """As ``_trimmed``: the largest that fit, for any target, since they belong to no size class."""
        length, center = self.inscribed(planes)
        kept = np.zeros(cells, dtype=bool)
        kept[self.face[length > 0]] = True
        corner = center[:, None] + length[:, None, None] * self.poses.spokes(self.sides)
        return Ragged.from_table(corner[length > 0]), center[length > 0], kept


def _groups(
    surface: Surface, pattern: Pattern, settings: PanelSettings, progress: Progress
) -> tuple[list[_Group], Floats | None, tuple[str, ...]]:
    """Whole cells by kind, those of the pattern first, the largest kind before the others; the curve of
    energy, summed over the kinds, and notes."""
    cells, lattice = pattern.cells, LATTICES[pattern.kind]
    groups, curves, notes = [], [], []
    for regular in (True, False):
        chosen = pattern.whole & ((pattern.index == 0) == regular)
        for sides in np.unique(cells.lengths[chosen])[::-1].tolist():
            face = np.flatnonzero(chosen & (cells.lengths == sides))
            at = cells.offsets[face][:, None] + np.arange(sides)
            points = np.asarray(cells.values[at], dtype=np.float64)
            outline = lattice.uneven_outline(sides) if regular else None
            how = settings if regular else replace(settings, method="exact")
            poses, energy, said = fit_poses(surface, points, how, progress, outline)
            groups.append(_Group(face, at, points, poses, regular))
            curves += [] if energy is None else [energy]
            notes += [one for one in said if one not in notes]
    return groups, _summed(curves), tuple(notes)


def _summed(curves: list[Floats]) -> Floats | None:
    """Curves of different lengths keep their last value."""
    if not curves:
        return None
    most = max(len(curve) for curve in curves)
    return np.asarray(sum(np.pad(curve, (0, most - len(curve)), mode="edge") for curve in curves))


def _fit_split(
    surface: Surface, pattern: Pattern, settings: PanelSettings, progress: Progress
) -> FittedPanels:
    cells, n = pattern.cells, pattern.n_cells
    groups, energy, notes = _groups(surface, pattern, settings, progress)
    kinds, others = [g for g in groups if g.regular], [g for g in groups if not g.regular]
    edges = pattern.half_edges
    normal = plane_normals(cells)
    for group in groups:
        normal[group.face] = group.poses.normal
    folds = AlongFolds.of(surface, pattern, normal, settings)
    planes = separating_planes(pattern, edges, folds.normal, folds.joints(edges, settings.joint))
    progress(0.4, "limiting sizes")
    face = np.concatenate([np.zeros(0, dtype=np.int64), *(group.face for group in (*kinds, *folds.kinds))])
    spokes = Ragged.chained([NO_POLYGONS, *(group.spokes for group in (*kinds, *folds.kinds))])
    kind = np.repeat(np.arange(len(kinds) + len(folds.kinds)), [len(g.face) for g in (*kinds, *folds.kinds)])
    length, center, said = _limits(kinds, planes, edges, settings, progress)
    pieces = [group.inscribed(planes) for group in folds.kinds]
    length, center = _together([(length, center), *pieces])
    notes += said
    regular = np.zeros(n, dtype=bool)
    regular[face] = True
    kept = np.zeros(n, dtype=bool)
    kept[face] = length > 0
    notes += _room_note(np.flatnonzero(regular & ~kept), int(kept.sum()), settings.joint)
    special: Bools = pattern.whole & (pattern.index != 0)
    left = ~regular & ~special & ~folds.taken
    parts = [_trimmed(cells, folds.normal, planes, edges, left, folds.origin)]
    parts += [group.finished(planes, n) for group in others]
    shapes, shape_center, cut = _joined(parts)
    dropped = int((left & ~cut).sum())
    single = folds.joined(pattern, shapes, shape_center, np.flatnonzero(cut))
    cut = np.zeros(n, dtype=bool)
    cut[single.face] = True
    special |= folds.divided
    order = np.argsort(face, kind="stable")
    order = order[(length > 0)[order]]  # the regular panels that are kept, by cell
    made = np.flatnonzero(kept | cut)
    spare = _spare(kinds, planes, settings)
    if spare is not None:
        spare = _together([spare, *pieces])
    bends = folds.bends(made, kept, single)
    whole_normal = folds.normal.copy()
    if bends is not None:
        own = made[bends.panel]
        whole_normal[own] = normalize(folds.normal[own] + folds.normal[bends.other])
    return FittedPanels(
        mode="split",
        face=made,
        regular=kept[made],
        spokes=spokes.take(order),
        shapes=single.shapes,
        center=_merge(kept, center[order], cut, single.center)[made],
        normal=whole_normal[made],
        limit=_merge(kept, length[order], cut, mean_edges(single.shapes))[made],
        whole=pattern.whole[made],
        cell_area=_areas(fan_areas(cells), made, bends),
        energy=energy,
        notes=notes + _joint_note(settings) + _dropped_note(dropped, settings.joint),
        spare_limit=spare and _merge(kept, spare[0][order], cut, mean_edges(single.shapes))[made],
        spare_center=spare and _merge(kept, spare[1][order], cut, single.center)[made],
        facing=facing_edges(edges, *places_of(pattern, made, bends), folds.normal),
        special=special[made] & ~kept[made],
        kind=kind[order],
        sides=np.array([group.bends for group in (*kinds, *folds.kinds)], dtype=np.int64),
        pieces=len(kinds),
        bends=bends,
    )


def _areas(area: Floats, made: Ints, bends: Bends | None) -> Floats:
    """(q,) of the cells of each panel, (c,) of the cells given."""
    own = area[made]
    if bends is not None:
        own[bends.panel] += area[bends.other]
    return own


def _joined(parts: list[tuple[Ragged, Floats, Bools]]) -> tuple[Ragged, Floats, Bools]:
    """Polygons, centres and cells of several kinds, in the order of the cells."""
    if len(parts) == 1:
        return parts[0]
    order = np.argsort(np.concatenate([np.flatnonzero(kept) for _, _, kept in parts]), kind="stable")
    center = np.concatenate([center for _, center, _ in parts])[order]
    shapes = Ragged.chained([shapes for shapes, _, _ in parts]).take(order)
    return shapes, center, np.logical_or.reduce([kept for _, _, kept in parts])


def _fit_watertight(
    surface: Surface, pattern: Pattern, settings: PanelSettings, progress: Progress
) -> FittedPanels:
    """All cells, trimmed ones too, as polygons over shared corners."""
    energies = settings.method == "energy" or settings.weights != Weights()
    aims = functionals(settings.weights) if energies else NEAREST
    moved, energy = minimise_watertight(
        pattern, target_lengths(pattern.cells, settings), aims, surface, progress
    )
    shapes = Ragged(moved[pattern.faces.values.astype(np.int64)], pattern.faces.offsets)
    unmoved = 2 if aims.flat else 1  # energies: the beginning, and the end made flat
    stuck = energies and len(energy) <= unmoved and (not len(energy) or energy[0] > MINIMAL)
    center, normal = means(shapes), plane_normals(shapes)
    away = surface.tree.nearest(moved).distance / mean_edges(shapes).mean()
    notes = (
        *(WEIGHTS_NOTE if energies and settings.method == "exact" else ()),
        *(STUCK_NOTE if stuck else ()),
        *(_bent_note(shapes) if aims.flat else ()),
        *collapsed_note(shapes),
        *_crossing_note(crossing_themselves(shapes, center, normal), pattern, surface),
        *_convex_note(shapes, normal, pattern, surface),
        *(_pulled_note if energies else _far_note)(away, settings.weights),
    )
    return FittedPanels(
        mode="watertight",
        face=np.arange(pattern.n_cells),
        regular=np.zeros(pattern.n_cells, dtype=bool),
        spokes=NO_POLYGONS,
        shapes=shapes,
        center=center,
        normal=normal,
        limit=mean_edges(shapes),
        whole=pattern.whole,
        cell_area=fan_areas(pattern.cells),
        energy=energy,
        notes=WATERTIGHT_NOTES + notes,
    )


def _bent_note(shapes: Ragged) -> tuple[str, ...]:
    bend = row_maxima(np.abs(best_plane_distances(shapes)), shapes.offsets) / mean_edges(shapes)
    count = int(np.sum(bend > FLAT))
    if not count:
        return ()
    return (
        f"Watertight panels that could not be made flat: {count}, bent by up to {bend.max():.1e} of their"
        " mean edge; smaller cells, or another pattern, leave them more room.",
    )


def _convex_note(shapes: Ragged, normal: Floats, pattern: Pattern, surface: Surface) -> tuple[str, ...]:
    """How many are not, and the pattern that would be."""
    count = int(np.sum(~convex(shapes, interior_angles(shapes, normal))))
    if not count:
        return ()
    better = _better(pattern, surface)
    return (f"Watertight panels that are not convex: {count} of {shapes.n_rows}; {better}.",)


def _better(pattern: Pattern, surface: Surface) -> str:
    """The pattern whose panels stay convex."""
    # Where three panels meet at each node, flat convex ones follow no saddle (Li, Liu and Wang 2015).
    saddle = saddle_share(surface)
    if pattern.kind == ("trihexagonal" if saddle > 0 else "hex"):
        return "smaller cells leave fewer"
    if saddle > 0:
        return (
            f"{max(saddle, 0.01):.0%} of the surface is curved like a saddle, which flat convex panels follow"
            " with kind trihexagonal"
        )
    return "on this surface, which is nowhere curved like a saddle, ask for kind hex"


def collapsed_note(shapes: Ragged) -> tuple[str, ...]:
    """Says so where flatness was bought with edges that have all but vanished."""
    length, mean = edge_lengths(shapes), mean_edges(shapes)
    shortest = row_minima(length / mean[shapes.row], shapes.offsets)
    count = int(np.sum(shortest < LEAST_EDGE))
    if not count:
        return ()
    return (
        f"Watertight panels with an edge shorter than {LEAST_EDGE:.0%} of their mean edge: {count}; flatness"
        " took a corner away there: give planarity less weight, or angle and edge more, or ask for split.",
    )


def _crossing_note(crossing: Bools, pattern: Pattern, surface: Surface) -> tuple[str, ...]:
    count = int(crossing.sum())
    if not count:
        return ()
    return (
        f"Watertight panels whose outline crosses itself: {count} of {len(crossing)};"
        f" {_better(pattern, surface)}; split panels cannot cross.",
    )


def _far_note(away: Floats, weights: Weights, cure: str = "smaller cells stay nearer") -> tuple[str, ...]:
    """away: (p,) distances of the corners from the surface / mean edge."""
    if away.max(initial=0.0) <= FAR:
        return ()
    return (
        f"Watertight panels leave the surface by up to {away.max():.0%} of their mean edge,"
        f" {away.mean():.0%} on average; {cure}, and split panels stay beside it.",
    )


def _pulled_note(away: Floats, weights: Weights) -> tuple[str, ...]:
    """The same of the energies, whose weight of the surface is the user's."""
    nearer = f"a weight of {HOLD:g} on surface holds them nearer, with less even shapes"
    return _far_note(away, weights, nearer if weights.surface < HOLD else "other weights may hold them")


def _limits(
    groups: list[_Group],
    planes: Separation,
    edges: HalfEdges,
    settings: PanelSettings,
    progress: Progress,
) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Greatest length of each panel of the groups, its centre, and notes."""
    if settings.target == "best" and groups:
        areas = [float(outline_areas(group.spokes).max()) for group in groups]
        bound = [
            Bound(g.poses, planes.direction[g.at], planes.offset[g.at], area / max(areas))
            for g, area in zip(groups, areas, strict=True)
        ]
        partner = _partners(np.concatenate([group.at.ravel() for group in groups]), edges)
        try:
            return *jointly_largest(bound, partner, progress), ()
        except ConvergenceError:
            return *_together([group.inscribed(planes) for group in groups]), JOINTLY_NOTE
    return *_together([_limit(group, planes, settings) for group in groups]), ()


def _limit(group: _Group, planes: Separation, settings: PanelSettings) -> tuple[Floats, Floats]:
    points = group.points
    if settings.target == "mean":
        edge = np.linalg.norm(np.roll(points, -1, axis=1) - points, axis=2)
        return edge.mean(axis=1), group.poses.center
    if settings.target == "shortest":
        direction, offset = planes.direction[group.at], planes.offset[group.at]
        return limits.shortest_edge(group.poses, points, direction, offset)
    return group.inscribed(planes)


def _together(found: list[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    length = np.concatenate([np.zeros(0), *(length for length, _ in found)])
    return length, np.concatenate([np.zeros((0, 3)), *(center for _, center in found)])


def _spare(groups: list[_Group], planes: Separation, settings: PanelSettings) -> tuple[Floats, Floats] | None:
    """Beside the jointly largest panels, which differ more in size from each other, the inscribed ones."""
    if settings.target != "best":
        return None
    return _together([group.inscribed(planes) for group in groups])


def _partners(at: Ints, edges: HalfEdges) -> Ints:
    """Positions of the twins among the half-edges ``at`` of the regular cells, −1 where they are not among
    them."""
    position = positions(at, len(edges.twin))
    twin = edges.twin[at]
    return np.where(twin >= 0, position[twin], -1)


def _room_note(empty: Ints, others: int, joint: float) -> tuple[str, ...]:
    """Raises PanelsError where no cell at all has room."""
    if not len(empty):
        return ()
    some = f"{len(empty)} cells (first: {', '.join(map(str, empty[:5]))})"
    if not others:
        raise PanelsError(
            f"{some} have no room for a regular panel beside joints of {joint:g}; ask for larger cells or a"
            " narrower joint.",
            data={"cells": empty[:100].tolist()},
        )
    return (f"{some} have no room for a regular panel beside joints of {joint:g} and were left open.",)


def _joint_note(settings: PanelSettings) -> tuple[str, ...]:
    if settings.target != "mean" or settings.joint <= 0:
        return ()
    return (
        f"Panels of mean size overlap, so joints of {settings.joint:g} are not kept; a target of shortest,"
        " inscribed or best keeps them.",
    )


def _trimmed(
    cells: Ragged, normal: Floats, planes: Separation, edges: HalfEdges, chosen: Bools, origin: Floats
) -> tuple[Ragged, Floats, Bools]:
    """Flat polygons for the chosen cells, their centres, and which cells (of all) keep a panel. origin: (c,
    3) points of the planes."""
    if not chosen.any():
        return NO_POLYGONS, np.zeros((0, 3)), chosen.copy()
    shapes, at = cells.take(chosen), cells.places(chosen)
    flat, center, size = flatten_and_clear(
        shapes, normal[chosen], planes.direction[at], planes.offset[at], edges.across[at], origin[chosen]
    )
    enough = size >= LEAST_TRIMMED
    kept = np.zeros(len(chosen), dtype=bool)
    kept[np.flatnonzero(chosen)[enough]] = True
    return flat.take(enough), center[enough], kept


def _merge(first: Bools, a: Floats, second: Bools, b: Floats) -> Floats:
    merged = np.zeros((len(first), *a.shape[1:]))
    merged[first] = a
    merged[second] = b
    return merged


def _dropped_note(dropped: int, joint: float) -> tuple[str, ...]:
    if not dropped:
        return ()
    beside = f"joints of {joint:g}" if joint > 0 else "their neighbours"
    return (
        f"{dropped} trimmed cells at the boundary have no room for a flat panel beside {beside} and were"
        " left open.",
    )
