"""Panels: what is asked for, what comes out, and what was measured on it (paper, section 5)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Literal

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.errors import SettingError
from hexwrap_solver.panels.facing import Facing
from hexwrap_solver.panels.regular import outline_areas
from hexwrap_solver.setting import Setting
from hexwrap_solver.singularities.types import Choices


@dataclass(frozen=True)
class Weights:
    """Weights of the dimensionless energies: E_pl, E_α (λ_P), E_ℓ (μ_P), distance to the surface."""

    planarity: Annotated[float, Setting("weight of planarity in the energy", ge=0)] = 1.0
    angle: Annotated[float, Setting("weight of equal angles", ge=0)] = 1.0
    edge: Annotated[float, Setting("weight of equal edges", ge=0)] = 1.0
    surface: Annotated[float, Setting("weight of closeness to the surface", ge=0)] = 0.0


@dataclass(frozen=True)
class ComponentSettings:
    """Figure 9."""

    inset: Annotated[float, Setting("components: outline moved inwards", ge=0, unit="length")] = 0.0
    thickness: Annotated[
        float, Setting("components: thickness of the solids, outwards", ge=0, unit="length")
    ] = 0.0
    depth: Annotated[float, Setting("depth of the support's beams", ge=0, unit="length")] = 0.0


@dataclass(frozen=True)
class PanelSettings:
    """How panels are rationalized (paper, section 5).

    sizes: fewer where more would be alike; ``fewest``: as few as leave no joint wider than ``max_gap``; None:
    one length per panel. method: ``exact`` is the closed form of split panels, and the nearest flat faces of
    watertight ones, unless weights are given; ``energy`` minimises the functionals with their weights.
    size_cost: ``area`` (least uncovered area) or ``worst`` (least greatest loss).
    Raises SettingError for an ``edge_range`` out of order.
    """

    mode: Annotated[Literal["split", "watertight"], Setting("individual panels, or one watertight mesh")] = (
        "split"
    )
    sizes: Annotated[
        int | Literal["fewest"] | None,
        Setting(
            "number of edge lengths, fewer where some would be alike; 'fewest': as few as max_gap allows; "
            "'none': one per panel",
            ge=1,
            le=1000,
        ),
    ] = 11
    max_gap: Annotated[
        float | None, Setting("widest joint wanted; wider ones are counted", ge=0, unit="length", rare=True)
    ] = None
    size_cost: Annotated[Literal["area", "worst"], Setting("what the sizes are best for", rare=True)] = "area"
    edge_range: Annotated[
        tuple[float, float] | None, Setting("allowed edge lengths", unit="length", rare=True)
    ] = None
    target: Annotated[
        Literal["shortest", "inscribed", "best", "mean"], Setting("upper limit of a panel's size")
    ] = "inscribed"
    orientation: Annotated[
        Literal["fit", "tangent"], Setting("planes of best fit, or tangent to the surface", rare=True)
    ] = "fit"
    joint: Annotated[
        float, Setting("least width left open between neighbouring panels", ge=0, unit="length")
    ] = 0.0
    method: Annotated[
        Literal["exact", "energy"], Setting("exact shapes, or minimized energies", rare=True)
    ] = "exact"
    weights: Annotated[Weights, Setting("weights of the energies", rare=True)] = Weights()
    increment: Annotated[
        float,
        Setting("edge lengths are rounded down to its multiples; 0: not", ge=0, unit="length", rare=True),
    ] = 0.0
    fold: Annotated[
        Literal["halves", "folded"],
        Setting("cells that a fold divides: two flat halves each, or one bent panel", rare=True),
    ] = "halves"
    components: Annotated[ComponentSettings | None, Setting("what each panel is built from", rare=True)] = (
        None
    )

    def __post_init__(self) -> None:
        low, high = self.edge_range or (0.0, 1.0)
        if not (0 <= low <= high and high > 0):
            raise SettingError("'edge_range' must be [min, max] with 0 ≤ min ≤ max and max > 0")


@dataclass(frozen=True)
class TradeOff:
    """From this curve an architect chooses the number of sizes: the least that this many can leave open.

    sizes: (k,) numbers of classes 1…; uncovered: (k,) fraction of the cells' area left open;
    worst_gap: (k,) greatest mean gap of a panel to its cell, model units.
    joint_mean, joint_max: (k,) mean and greatest width of the joints between neighbours, model units, as they
    would be were all facing edges parallel. taken: how many the panels have, singularities and pieces of
    cells apart; of patterns with several kinds of cells, of the kind that has most.
    """

    sizes: Ints
    uncovered: Floats
    worst_gap: Floats
    joint_mean: Floats
    joint_max: Floats
    taken: int = 0


@dataclass(frozen=True)
class Bends:
    """Panels of two flat halves that a hinge joins, all arrays (b,).

    panel: rows of the panels, ascending. The hinge runs from the panel's corner 0 to its corner ``hinge``:
    the corners from one to the other are those of the half in the panel's own cell, the others, with both
    again, those of the half in the cell ``other``. side: (b, 2) the corner of each cell at which its side
    along the fold begins.
    """

    panel: Ints
    other: Ints
    hinge: Ints
    side: Ints


@dataclass(frozen=True)
class FittedPanels:
    """Panels before their lengths are chosen: everything that does not depend on the size classes.

    mode: as asked for. face: (q,) cell of the pattern. regular: (q,) panels that become regular polygons; the
    others (trimmed cells, watertight panels) are finished in ``shapes``. spokes: r rows of corners (·, 3)
    around the centre at edge length 1, of the r regular panels in order. shapes: polygons of the others in
    order. center, normal: (q, 3). limit: (q,) greatest edge length (mean edge of the others). whole: (q,).
    cell_area: (q,) of the panels' cells. energy, notes: as in ``Panels``. spare_limit, spare_center: another
    choice of limit and center without overlap, which few classes may suit better. facing: edges of
    neighbouring panels, None for watertight ones. special: (q,) those in ``shapes`` that are types of their
    own: regular polygons with another number of sides, around a singularity, and pieces along folds. kind:
    (r,) number of the regular panels' kind, which size classes keep apart, those of the pattern's cells
    before those of pieces along folds; sides: (kinds,) corners of each that are not straight; pieces: first
    kind of pieces. bends: None where no panel is bent.
    """

    mode: Literal["split", "watertight"]
    face: Ints
    regular: Bools
    spokes: Ragged
    shapes: Ragged
    center: Floats
    normal: Floats
    limit: Floats
    whole: Bools
    cell_area: Floats
    energy: Floats | None = None
    notes: tuple[str, ...] = ()
    spare_limit: Floats | None = None
    spare_center: Floats | None = None
    facing: Facing | None = None
    special: Bools | None = None
    kind: Ints | None = None
    sides: Ints | None = None
    pieces: int = 0
    bends: Bends | None = None

    @cached_property
    def area(self) -> Floats:
        """(r,) of the regular panels at edge length 1. Not to be written to."""
        return outline_areas(self.spokes)


@dataclass(frozen=True)
class Panels:
    """Finished panels.

    polygons: (·, 3) points per panel, counter-clockwise from outside, not repeated at the end. face: (q,)
    cell of the pattern. size: (q,) class, −1 for panels without one (trimmed cells). edge_length: (q,) ℓ_P
    (the mean edge for polygons that are not equilateral). limit: (q,) largest length allowed before
    quantization. center, normal: (q, 3). whole: (q,). class_length, class_count, class_sides: (s,) the size
    classes, ascending for each kind of cell, the kind with most sides first; after them, n_special, those of
    pieces along folds and what is a type of its own, around singularities or along folds. bends: panels of
    two halves, None where there are none. trade_off: None where sizes make no sense. energy: (steps,) value
    of the weighted energy, None for split panels of method ``exact``. outside: panels whose limit lies below
    the allowed ``edge_range``. max_gap: widest joint wanted.
    """

    mode: Literal["split", "watertight"]
    polygons: Ragged
    face: Ints
    size: Ints
    edge_length: Floats
    limit: Floats
    center: Floats
    normal: Floats
    whole: Bools
    class_length: Floats
    class_count: Ints
    class_sides: Ints
    trade_off: TradeOff | None = None
    energy: Floats | None = None
    notes: tuple[str, ...] = ()
    outside: Ints | None = None
    max_gap: float | None = None
    n_special: int = 0
    bends: Bends | None = None

    @property
    def n_panels(self) -> int:
        return self.polygons.n_rows

    @property
    def n_sizes(self) -> int:
        """The classes but those of special panels."""
        return len(self.class_length) - self.n_special

    def part(self, rows: Ints) -> Panels:
        """Some of the panels, none of them bent; their classes are kept."""
        fields = ("face", "size", "edge_length", "limit", "center", "normal", "whole")
        taken = {name: getattr(self, name)[rows] for name in fields}
        return replace(self, polygons=self.polygons.take(rows), bends=None, **taken)

    @property
    def divided(self) -> Bools:
        """(s,) the classes of pieces along folds."""
        pieces = np.arange(len(self.class_length)) >= self.n_sizes
        pieces[self.size[self.whole & (self.size >= 0)]] = False
        return pieces


@dataclass(frozen=True)
class Quality:
    """Measured on the finished panels; None where a stage was left out. Lengths in model units.

    planarity, edge_deviation, angle_deviation (rad): relative to ℓ, per panel arrays.
    gap_tangential, gap_normal, kink (rad): aligned with the pattern's neighbours, NaN where there is none.
    surface_distance: (q,) greatest distance of a panel's corners and its centre to the input surface.
    convex: (q,). congruence: (q,) class of congruent shapes (mirror images distinguished).
    gaps_over: panels with a joint wider than was wanted, None where nothing was said of that.
    coverage: area of the panels over that of the cells. bare: share of the surface without cells.
    movement: greatest distance a shared vertex was moved (watertight), 0 otherwise.
    singularities: what other numbers of them would leave open; None where none was looked at.
    """

    scale_ratio: float
    quasi_conformal_mean: float
    quasi_conformal_max: float
    planarity: Floats | None = None
    edge_deviation: Floats | None = None
    angle_deviation: Floats | None = None
    surface_distance: Floats | None = None
    gap_tangential: Floats | None = None
    gap_normal: Floats | None = None
    kink: Floats | None = None
    gaps_over: int | None = None
    convex: Bools | None = None
    congruence: Ints | None = None
    overlaps: int = 0
    coverage: float = 0.0
    bare: float = 0.0
    movement: float = 0.0
    singularities: Choices | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Components:
    """Figure 9, one entry per panel.

    outline: inset polygons. origin, x_axis, y_axis, z_axis: (q, 3) the panel's plane, x along the first edge.
    solid_vertices, solid_faces: a closed solid per panel (rows = panels; face rows are triangles as
    flat triples indexing into the panel's own vertices).
    """

    outline: Ragged
    origin: Floats
    x_axis: Floats
    y_axis: Floats
    z_axis: Floats
    solid_vertices: Ragged | None = None
    solid_faces: Ragged | None = None


@dataclass(frozen=True)
class Support:
    """Torsion-free support structure (paper, conclusion).

    nodes: (p, 3) pattern vertices; axes: (p, 3) unit node axes. edges: (e, 2) beams between nodes.
    strips: (e, 4, 3) ruled strips of the given depth, planar where torsion vanishes.
    torsion, tilt: (e,) and (p,) radians: twist of each beam; angle between axis and surface normal.
    """

    nodes: Floats
    axes: Floats
    edges: Ints
    strips: Floats
    torsion: Floats
    tilt: Floats
