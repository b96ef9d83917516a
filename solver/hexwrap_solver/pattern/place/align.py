"""Placement where the boundary has corners: every straight side on a lattice line (Figures 5–7).

The lattice is W = s·(z − a) + o before any deformation: a is the apex (or the layout's origin), o where it
stands on the lattice, s scale and rotation. A side k with inward unit normal n_k, at mean depth
h_k = Re(n̄_k·(z − a)) in the domain, then lies at depth |s|·h_k + Re(n̄_k·o) on the lattice. Its lattice lines
lie at depths first + period·m (``Rows``), m an integer per side:

                 domain                        lattice, normals upwards
          ______________ side k          - - - - - - - - - - first + 2·period
         |      | h_k   |                ================== |s|·h_k + Re(n̄_k·o)   side k as it comes
         |      a       |                - - - - - - - - - - first + period       where it is moved to
         |______________|                - - - - - - - - - - first

What is free, and how it is chosen:

1. *Directions.* The sides of one loop differ by multiples of the quantum, so that one rotation brings all of
   them onto directions of the lattice; the loops of a cone may each need their own (``_turns``).
2. *Origin.* On a cone o must be a centre of symmetry of the kind that the cone angle needs
   (``symmetry_centres``). For a translation, or a disk, two sides that are not parallel are put on lines:
   o is the place where these meet (``meeting``), one choice for each way of picking the second line.
3. *Scale.* |s| is tried over the range that the size asked for leaves open.
4. *Lines.* Each side moves to its nearest line by δ_k; the layout follows, conformally by least squares.
   That response is linear in δ, so that its error is a quadratic form, computed once (``Strain``); single
   lines change as long as that lessens it.
5. *Corners.* Two successive sides meet in a place of the lattice that should be a node, or, where three edges
   meet at nodes, one about which the lattice is mirrored along with the corner (``misplaced_corners``).

The placements that cost least are then deformed for good (``deform``), and the best one is kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Isometry, Lattice
from hexwrap_solver.pattern.place.deform import System, deform
from hexwrap_solver.pattern.place.features import Chain, FeatureLines, lines_from
from hexwrap_solver.pattern.place.glued import Glued
from hexwrap_solver.pattern.place.meeting import meeting
from hexwrap_solver.pattern.place.placement import Placement, edge_angle
from hexwrap_solver.pattern.place.rows import rows_along
from hexwrap_solver.pattern.place.sheet import translations
from hexwrap_solver.pattern.place.sides import Lines, Sides, lines_of, sides_of
from hexwrap_solver.pattern.place.size import (
    cells_around,
    counts_near,
    edges_around,
    size_spread,
    wanted_edge,
    width_per_cell,
)
from hexwrap_solver.pattern.place.strain import Strain
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.tolerances import RELATIVE

#: Scales tried, from the smallest to the largest admissible.
SCALES = 241

#: Costs, beside the distortion: of a size off the wanted one by its whole spread; of all corners standing on
#: cells instead of nodes.
COST_OF_SIZE, COST_OF_CORNERS = 0.002, 0.004

#: Corners standing on cells that one which the lattice does not mirror there outweighs: at an entrance the
#: tip goes before the two corners beside it.
COST_OF_LOPSIDED = 3.0

#: Parallel lines of a lattice are of this many kinds at most, up to translations.
MOST_LINES = 3

#: This many placements with the least mean strain are compared by their sharp one, and this many of these, in
#: order, are deformed, until one of them distorts by less than ENOUGH.
COMPARED, DEFORMED, ENOUGH = 12, 3, 0.03

#: With features: sizes that are tried at most, and places along the first side.
SCALES_OF_FEATURES, PHASES = 61, 48


@dataclass(frozen=True)
class _Trial:
    """W = scale·(z − apex) + origin before the deformation, what g becomes, and the line of each side.

    moved: by how much the sides (and g) are moved, and the scale, as ``Strain`` wants it. extra: costs beside
    its own.
    """

    scale: complex
    origin: complex
    motion: Isometry
    depth: Floats
    moved: Floats
    extra: float

    def cost(self, strain: float) -> float:
        return 2 * strain / abs(self.scale) + self.extra


@dataclass(frozen=True)
class _Frame:
    """The sides turned to the lattice's directions. first, period: (s,) of the lattice lines of each side.
    normal: (s,) inward; depth: (s,) of the sides at scale 1, from the apex or the layout's origin; unit: the
    turn common to all; around: cells that are asked for. spread: instead of the freedom of the size that goes
    with what is asked, where not None."""

    cmap: ConformalMap
    lattice: Lattice
    cone_index: int
    around: int | None
    sides: Sides
    first: Floats
    period: Floats
    normal: Complexes
    depth: Floats
    unit: complex

    @property
    def turned(self) -> Floats:
        """(k,) mean depth of their side less the depth of the sides' vertices, at scale 1."""
        place = (self.sides.place - (self.cmap.deck.apex or 0)) * self.unit
        side = self.sides.side
        return np.asarray(self.depth[side] - (self.normal[side].conj() * place).real)

    @cached_property
    def following(self) -> tuple[Ints, Ints]:
        """(s,) the side after each, and the sheet on which the frame of the loop shows it: the first one
        comes again a turn further."""
        bounding = int((self.sides.loop >= 0).sum())
        side, sheet = np.arange(1, bounding + 1), np.zeros(bounding, dtype=np.int64)
        for loop in np.unique(self.sides.loop[self.sides.loop >= 0]):
            members = np.flatnonzero(self.sides.loop == loop)
            side[members[-1]] = members[0]
            sheet[members[-1]] = self.sides.sheet[self.sides.side == members[-1]][-1]
        return side, sheet


@dataclass(frozen=True)
class Straightening:
    """All that moving the sides of a domain onto lattice lines takes, whatever the size of the cells."""

    frame: _Frame
    lines: Lines
    system: System
    strain: Strain
    features: FeatureLines | None = None

    @classmethod
    def of(
        cls,
        cmap: ConformalMap,
        lattice: Lattice,
        settings: PatternSettings,
        cone_index: int,
        loops: list[int],
        chains: list[Chain] | None = None,
    ) -> Straightening:
        """settings: their sizes do not matter. loops: the ones to straighten, polygons. chains: features to
        straighten."""
        rotation = Isometry(lattice, cone_index, (0, 0))
        frame, features = frame_of(cmap, lattice, settings, rotation, loops, chains or [])
        lines = lines_of(len(cmap.uv), frame.sides, frame.normal, rotation)
        system = System(cmap, Glued.by_sheets(cmap, rotation), lines.normal)
        return cls(frame, lines, system, Strain.of(system, frame.sides, lines, frame.turned), features)


def place_by_sides(
    straightening: Straightening,
    settings: PatternSettings,
    spread: float | None = None,
    *,
    gathered: bool = False,
) -> Placement:
    """Scale, centre and lines whose deformation distorts least, then that deformation.

    spread: relative freedom of the size, instead of what goes with the size asked for. gathered: where little
    of the surface bears what it costs, see ``deform``.
    """
    frame, lines = replace(straightening.frame, around=settings.around), straightening.lines
    system, strain = straightening.system, straightening.strain
    cmap, lattice = frame.cmap, frame.lattice
    angle = edge_angle(lattice, settings)
    trials = _trials(straightening, settings, spread)
    tried = []
    # With features many come near, most of them alike, and each takes as long as the whole search.
    most = DEFORMED if straightening.features is None else 1
    for trial in _best_of(trials, strain)[:most]:
        rest = trial.scale * (cmap.uv - (cmap.deck.apex or 0)) + trial.origin
        glued = Glued.by_sheets(cmap, trial.motion)
        depth = lines.depths(trial.depth, trial.motion)
        place, distortion = deform(system, glued, trial.scale, rest, depth, gathered=gathered)
        tried.append((distortion, trial, place))
        if tried[-1][0] < ENOUGH:
            break
    distortion, best, place = min(tried, key=lambda found: found[0] + found[1].extra)
    around = _cells_around(frame, best, angle)
    notes = (
        ("phase has no effect: lattice lines on all sides leave no freedom.",) if any(settings.phase) else ()
    )
    return Placement.on_sheet(cmap, place, best.motion, angle, around, distortion, notes)


def predicted(
    straightening: Straightening, settings: PatternSettings, spread: float | None = None
) -> tuple[Floats, int]:
    """(m,) predicted ratios of singular values − 1 of the best way to place the pattern, and its number of
    cells around."""
    strain, frame = straightening.strain, straightening.frame
    best = _best_of(_trials(straightening, settings, spread), strain)[0]
    around = _cells_around(frame, best, edge_angle(frame.lattice, settings))
    return strain.ratios(best.moved, abs(best.scale)), around


def _cells_around(frame: _Frame, trial: _Trial, angle: float) -> int:
    width = width_per_cell(frame.lattice, angle) * frame.lattice.edge
    return cells_around(frame.cmap, trial.motion, abs(trial.scale), width)


def _trials(
    straightening: Straightening, settings: PatternSettings, spread: float | None = None
) -> list[_Trial]:
    frame, strain = replace(straightening.frame, around=settings.around), straightening.strain
    cmap, lattice = frame.cmap, frame.lattice
    angle = edge_angle(lattice, settings)
    edge = wanted_edge(cmap, lattice, settings, angle)
    if cmap.deck.apex is None:
        edges_around(cmap, settings, edge)
    size = lattice.edge / edge
    spread = size_spread(settings) if spread is None else spread
    if spread > size_spread(settings):
        frame = replace(frame, around=None)
    return [
        trial
        for x in _sizes(frame, size, spread)
        for trial in trials_at(frame, strain, size * (1 + spread * x) * frame.unit, COST_OF_SIZE * x**2)
    ]


def _sizes(frame: _Frame, size: float, spread: float) -> Floats:
    """Sizes to try, from −1 to 1. With features on a cylinder, those at which a row of cells closes up, once
    each; for then the places along it are tried, too."""
    if not (frame.sides.loop < 0).any():
        return np.linspace(-1, 1, SCALES)
    if not frame.sides.closed.any() or frame.cone_index or frame.cmap.deck.translation == 0:
        return np.linspace(-1, 1, SCALES_OF_FEATURES)
    row = frame.lattice.shortest_towards(frame.unit * frame.cmap.deck.translation)
    cells = size * abs(frame.cmap.deck.translation) / abs(complex(frame.lattice.position(row)))
    near = counts_near(cells, spread, SCALES_OF_FEATURES)
    return np.asarray((near / cells - 1) / max(spread, RELATIVE))


def frame_of(
    cmap: ConformalMap,
    lattice: Lattice,
    settings: PatternSettings,
    rotation: Isometry,
    loops: list[int],
    chains: list[Chain],
) -> tuple[_Frame, FeatureLines | None]:
    angle = edge_angle(lattice, settings)
    sides = sides_of(cmap, lattice, loops)
    zero = complex(lattice.forward * np.exp(-1j * angle))
    turn = _turns(cmap, lattice, sides, zero)
    unit = _common(cmap, lattice, turn, zero, chains)
    # Directions are exact up to rounding of the boundary angles; from here on they are exact.
    steps = np.rint(np.angle(sides.direction * turn / zero) / lattice.quantum)
    normal = 1j * zero * np.exp(1j * lattice.quantum * steps)
    rows = rows_along(lattice, angle, settings.boundary)
    first, period = np.full(sides.n, rows.first), np.full(sides.n, rows.period)
    features = None
    if chains:
        features = lines_from(cmap, chains, rotation, zero, unit, sides, normal)
        halves = np.rint(np.angle(features.normal / (1j * zero)) / (lattice.quantum / 2))
        own = [rows_along(lattice, angle + half * lattice.quantum / 2, "trim") for half in halves.tolist()]
        sides = sides.and_also(features.sides)
        normal = np.concatenate([normal, features.normal])
        first = np.concatenate([first, [rows.first for rows in own]])
        period = np.concatenate([period, [rows.period for rows in own]])
        turn = np.concatenate([turn, np.full(len(own), unit)])
    frame = _Frame(
        cmap,
        lattice,
        rotation.cone_index,
        settings.around,
        sides,
        first,
        period,
        normal,
        _mean_depth(cmap, sides, normal, turn),
        unit,
    )
    return frame, features


def _common(
    cmap: ConformalMap, lattice: Lattice, turn: Complexes, zero: complex, chains: list[Chain]
) -> complex:
    """The turn common to all sides. Of features alone, that of one turn around, or of the longest one; but
    where none of them closes around the surface, the one nearest to that at which they lean least on the
    whole: the pattern then winds along with them."""
    if len(turn):
        return complex(turn.mean() / abs(turn.mean()))
    along = cmap.deck.translation if cmap.deck.apex is None else 0j
    if along == 0:
        along = max(chains, key=lambda chain: chain.length).axis
    if not along:  # a ring on a disk has no direction
        return zero
    unit = zero * abs(along) / along
    if not any(chain.closed for chain in chains):
        fold = 4 * np.pi / lattice.quantum  # of lines: turned by half a quantum, they may lie on others
        lean = sum(chain.length * (chain.axis * unit / zero) ** fold for chain in chains)
        unit *= np.exp(-1j * np.angle(lean) / fold)
    return complex(unit)


def trials_at(frame: _Frame, strain: Strain, scale: complex, cost_of_size: float) -> list[_Trial]:
    """For every centre the best lines at one scale."""
    lattice, sides, first, period = frame.lattice, frame.sides, frame.first, frame.period
    trials = []
    for motion, origins in _origins(frame, scale):
        depth = frame.depth * abs(scale) + (frame.normal.conj() * origins[:, None]).real
        also = [abs(scale)]
        if frame.cmap.deck.apex is None:
            apart = complex(lattice.position(np.array(motion.shift))) - scale * frame.cmap.deck.translation
            also = [apart.real, apart.imag, *also]
        moved = first + period * np.rint((depth - first) / period) - depth
        moved = strain.nearest(np.append(moved, np.tile(also, (len(origins), 1)), axis=1), period)
        lines = depth + moved[:, : sides.n]
        extra = cost_of_size + COST_OF_CORNERS * misplaced_corners(frame, motion, lines)
        each = zip(origins.tolist(), lines, moved, extra.tolist(), strict=True)
        trials += [_Trial(scale, origin, motion, line, move, cost) for origin, line, move, cost in each]
    return trials


def _best_of(trials: list[_Trial], strain: Strain) -> list[_Trial]:
    """Those with the least costs, the least first, each choice of lines once."""
    different: dict[tuple[object, ...], _Trial] = {}
    means = strain.mean(np.stack([trial.moved for trial in trials]))
    costs = [trial.cost(mean) for trial, mean in zip(trials, means.tolist(), strict=True)]
    for trial in (trials[i] for i in np.argsort(costs, kind="stable")):
        lines = (*trial.motion.shift, *np.rint(1e6 * trial.depth).tolist())
        if different.setdefault(lines, trial) is trial and len(different) == COMPARED:
            break
    return sorted(different.values(), key=lambda trial: trial.cost(strain.sharp(trial.moved)))


def _turns(cmap: ConformalMap, lattice: Lattice, sides: Sides, zero: complex) -> Complexes:
    """(s,) rotations after which the sides have lattice directions, one for each loop on a cone.

    The sides of one loop differ by multiples of the quantum. Those of the other may be turned against them
    about the apex by any angle, which the deformation then has to make up for; the least one is taken. For
    a translation, no loop can turn by itself: one rotation for all.
    """
    loops = sides.loop if cmap.deck.apex is not None else np.zeros(sides.n, dtype=np.int64)
    turn = np.ones(sides.n, dtype=complex)
    before: complex | None = None
    for loop in np.unique(loops):
        on = loops == loop
        mean = complex((sides.length[on] * sides.direction[on] ** lattice.fold).sum())
        unit = zero / complex(np.exp(1j * np.angle(mean) / lattice.fold))
        if before is not None:
            steps = round(float(np.angle(before / unit)) / lattice.quantum)
            unit *= complex(np.exp(1j * lattice.quantum * steps))
        before = unit
        turn[on] = unit
    return turn


def turn_between_loops(cmap: ConformalMap, lattice: Lattice, loops: list[int]) -> float:
    """Angle about the apex between the sides of the two loops, modulo the quantum, 0 for one loop; rad."""
    turn = _turns(cmap, lattice, sides_of(cmap, lattice, loops), 1.0)
    return float(np.angle(turn[-1] / turn[0]))


def _mean_depth(cmap: ConformalMap, sides: Sides, normal: Complexes, turn: Complexes) -> Floats:
    """(s,) depth of each side's line at scale 1, measured from the apex, or from the layout's origin."""
    place = (sides.place - (cmap.deck.apex or 0)) * turn[sides.side]
    value = (normal[sides.side].conj() * place).real
    return np.asarray(np.bincount(sides.side, weights=value) / np.bincount(sides.side))


def _origins(frame: _Frame, scale: complex) -> Sequence[tuple[Isometry, Complexes]]:
    """Every way in which g can be a motion of the lattice, and where the apex, or the layout's origin, may
    stand then: on a cone at a symmetry centre of each kind; for a translation as two sides may lie on
    lines."""
    lattice, normal, first = frame.lattice, frame.normal, frame.first
    if frame.cmap.deck.apex is not None:
        centres = symmetry_centres(lattice, frame.cone_index)
        return [(motion, np.array([centre])) for motion, centre in centres]
    shift = _translation(frame, scale * frame.cmap.deck.translation)
    motion = Isometry(lattice, frame.cone_index, (int(shift[0]), int(shift[1])))
    depth = frame.depth * abs(scale)
    across = np.flatnonzero(abs((normal.conj() * normal[0]).imag) > 1e-6)
    if not len(across):
        return [(motion, np.array([normal[0] * (first[0] - depth[0])]))]
    if (frame.sides.loop < 0).any():
        # One side on a line; places along it, as features across it share what they cannot all have.
        along = lattice.period_along(1j * normal[0])
        places = along * np.arange(PHASES) / PHASES
        return [(motion, normal[0] * (first[0] - depth[0] + 1j * places))]
    p, q = normal[0], normal[across[0]]
    d = first[0] - depth[0]
    lines = first[across[0]] + frame.period[across[0]] * np.arange(MOST_LINES) - depth[across[0]]
    return [(motion, meeting(p, d, q, lines))]


def _translation(frame: _Frame, wanted: complex) -> Ints:
    """The translation of the lattice that g becomes, near the wanted one.

    A loop that is one closed line runs along it exactly. On a cylinder it has the number of cells asked for.
    """
    if wanted == 0:  # a disk
        return np.zeros(2, dtype=np.int64)
    rows, around = bool(frame.sides.closed.any()), frame.around if frame.cone_index == 0 else None
    return np.asarray(translations(frame.lattice, wanted, rows=rows, around=around)[0])


@lru_cache(maxsize=64)  # asked for at every size that is tried
def symmetry_centres(lattice: Lattice, cone_index: int) -> Sequence[tuple[Isometry, complex]]:
    """Motions p ↦ ζ^cone_index·p + τ that differ by more than a translation of the lattice, with their fixed
    points: centres of 6-, 4-, 3- or 2-fold symmetry, the highest first."""
    zeta = np.exp(1j * lattice.step_angle * cone_index)
    e1 = complex(lattice.position(lattice.basis[0]))
    found: list[tuple[Isometry, complex]] = []
    reach = range(-2, 3)
    shifts = sorted(((x, y) for x in reach for y in reach), key=lambda v: abs(v[0] + v[1] * lattice.unit))
    for x, y in shifts:
        shift = x * lattice.basis[0] + y * lattice.basis[1]
        centre = complex(lattice.position(shift)) / (1 - zeta)
        apart = [lattice.coordinates(np.array((centre - other) / e1)) for _, other in found]
        if all(abs(a - np.rint(a)).max() > RELATIVE for a in apart):
            found.append((Isometry(lattice, cone_index, (int(shift[0]), int(shift[1]))), centre))
    return tuple(found)


def misplaced_corners(frame: _Frame, motion: Isometry, lines: Floats) -> Floats:
    """(…) part of the corners between successive sides that stand badly, for depths (…, s) of the sides.

    Corners stand well on nodes. Where three edges meet there, though, the lattice is mirrored at the
    bisector of 2π/3 and 4π/3, but not of π/3 and 5π/3: those stand well on the centres of cells.
    """
    lattice = frame.lattice
    following, sheet = frame.following
    p = frame.normal[: len(sheet)]
    q = p[following] * np.exp(1j * lattice.step_angle * motion.rotation(sheet))
    inner = abs((p.conj() * q).imag) > 1e-6
    if not inner.any():
        return np.zeros(lines.shape[:-1])
    shift = lattice.position(motion.apply(np.zeros((len(sheet), 2), dtype=np.int64), sheet))
    d, e = lines[..., : len(sheet)], lines[..., following] + (q.conj() * shift).real
    p, q = p[inner], q[inner]
    corner = meeting(p, d[..., inner], q, e[..., inner])
    point = np.rint(lattice.coordinates(corner)).astype(np.int64)
    on_lattice = abs(lattice.position(point) - corner) < 1e-6
    on_node = on_lattice & lattice.is_node(point)
    odd = np.rint(np.angle(q / p) / lattice.quantum) % 2 == 1
    lopsided = odd & on_node if lattice.kind == "hex" else np.zeros_like(on_node)
    mirrored = odd & on_lattice & ~on_node if lattice.kind == "hex" else lopsided
    return np.asarray((COST_OF_LOPSIDED * lopsided + ~(on_node | mirrored)).mean(axis=-1))
