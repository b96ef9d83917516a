"""Panels: what is asked for, what comes out, and what was measured on it (paper, section 5)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.panels.facing import Facing


@dataclass(frozen=True)
class Weights:
    """Weights of the dimensionless energies: E_pl, E_α (λ_P), E_ℓ (μ_P), distance to the surface."""

    planarity: float = 1.0
    angle: float = 1.0
    edge: float = 1.0
    surface: float = 0.0


@dataclass(frozen=True)
class ComponentSettings:
    """Figure 9. Lengths in model units. inset: outline moved inwards; thickness: of the solid, outward;
    depth: of the support's beams."""

    inset: float = 0.0
    thickness: float = 0.0
    depth: float = 0.0


@dataclass(frozen=True)
class PanelSettings:
    """How panels are rationalized. Lengths in model units.

    sizes: number of edge-length classes, fewer where more would be alike, None: one length per panel;
    ``fewest``: as few as leave no joint wider than max_gap. max_gap: joints above it are counted.
    edge_range: allowed (min, max).
    size_cost: ``area`` (least uncovered area) or ``worst`` (least greatest loss).
    target: upper limit of a panel's edge length. joint: least width left open between neighbours.
    increment: lengths are rounded down to its multiples, 0: not at all.
    """

    mode: Literal["split", "watertight"] = "split"
    sizes: int | Literal["fewest"] | None = 11
    max_gap: float | None = None
    size_cost: Literal["area", "worst"] = "area"
    edge_range: tuple[float, float] | None = None
    target: Literal["shortest", "inscribed", "best", "mean"] = "inscribed"
    orientation: Literal["fit", "tangent"] = "fit"
    joint: float = 0.0
    method: Literal["exact", "energy"] = "exact"
    weights: Weights = field(default_factory=Weights)
    increment: float = 0.0
    components: ComponentSettings | None = None


@dataclass(frozen=True)
class TradeOff:
    """From this curve an architect chooses the number of sizes: the least that so many can leave open.

    sizes: (k,) numbers of classes 1…; uncovered: (k,) fraction of the cells' area left open;
    worst_gap: (k,) greatest mean gap of a panel to its cell, model units.
    joint_mean, joint_max: (k,) mean and greatest width of the joints between neighbours, model units, as they
    would be were all facing edges parallel.
    """

    sizes: Ints
    uncovered: Floats
    worst_gap: Floats
    joint_mean: Floats
    joint_max: Floats


@dataclass(frozen=True)
class FittedPanels:
    """Panels before their lengths are chosen: everything that does not depend on the size classes.

    mode: as asked for. face: (q,) cell of the pattern. regular: (q,) panels that become regular polygons;
    the others (trimmed cells, watertight panels) are finished in ``shapes``. spokes: (r, p, 3) corners
    around the centre at edge length 1, of the r regular panels in order. shapes: polygons of the others in
    order. center, normal: (q, 3). limit: (q,) greatest edge length (mean edge of the others). whole: (q,).
    cell_area: (q,) of the panels' cells. energy, notes: as in ``Panels``. spare_limit, spare_center: another
    choice of limit and center without overlap, which few classes may suit better. facing: edges of
    neighbouring panels, None for watertight ones.
    """

    mode: Literal["split", "watertight"]
    face: Ints
    regular: Bools
    spokes: Floats
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


@dataclass(frozen=True)
class Panels:
    """Finished panels.

    polygons: (·, 3) points per panel, counter-clockwise from outside, not repeated at the end.
    face: (q,) cell of the pattern. size: (q,) class, −1 for panels without one (trimmed cells).
    edge_length: (q,) ℓ_P (the mean edge for polygons that are not equilateral). limit: (q,) largest
    length allowed before quantization. center, normal: (q, 3). whole: (q,).
    class_length, class_count: (s,) the size classes, ascending. trade_off: None where sizes make no sense.
    energy: (steps,) value of the weighted energy, None for method ``exact``.
    outside: panels whose limit lies below the allowed ``edge_range``.
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
    trade_off: TradeOff | None = None
    energy: Floats | None = None
    notes: tuple[str, ...] = ()
    outside: Ints | None = None

    @property
    def n_panels(self) -> int:
        return self.polygons.n_rows


@dataclass(frozen=True)
class Quality:
    """Measured on the finished panels; None where a stage was left out. Lengths in model units.

    planarity, edge_deviation, angle_deviation (rad): relative to ℓ, per panel arrays.
    gap_tangential, gap_normal, kink (rad): aligned with the pattern's neighbours, NaN where there is none.
    surface_distance: (q,) greatest distance of a panel's corners and its centre to the input surface.
    convex: (q,). congruence: (q,) class of congruent shapes (mirror images told apart).
    movement: greatest distance a shared vertex was moved (watertight), 0 otherwise.
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
    convex: Bools | None = None
    congruence: Ints | None = None
    overlaps: int = 0
    coverage: float = 0.0
    movement: float = 0.0
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
