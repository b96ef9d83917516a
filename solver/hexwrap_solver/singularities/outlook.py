"""What singularities would bring a surface that was solved without."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Floats
from hexwrap_solver.conformal.robust.refine import fine_enough
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import Kind, Pattern
from hexwrap_solver.singularities.linear import Model, Responses, vertex_areas
from hexwrap_solver.singularities.search import Search, ranked, state_of_cones
from hexwrap_solver.singularities.sizes import uncovered, uncovered_by, within
from hexwrap_solver.singularities.types import Choices, End, Rules
from hexwrap_solver.surface.holes import fill_openings
from hexwrap_solver.surface.types import Surface

#: A coarse look: this many patches and singularities.
PATCHES, MOST = 200, 8
#: A seat in each patch up to 30,000 vertices; larger meshes get fewer, for the time of the solves to stay,
#: but this number at least.
SOLVED, FEWEST = 6e6, 50
#: What cells beside a fold leave open more than others (measured on houses).
FOLDED = 0.2
#: Numbers of sizes that are told apart; more leave hardly less open.
CURVE = 24
#: What singularities must save to be told, as a share of the area and of what is uncovered.
SAVED, SHARE = 0.01, 0.3


@dataclass(frozen=True)
class Seats:
    """Where singularities could stand, whatever the cells are, the ends being free.

    model: a coarse one. inside: (q,) distances of its seats from the ends. vertices: (n, 3) of the surface
    with its openings filled.
    """

    model: Model
    inside: Floats
    vertices: Floats


@dataclass(frozen=True)
class Prospects:
    """Singularities that a map could have, the best of each number from none upwards, the ends being free.

    choices: their ``uncovered`` is with a length for each cell, per width of a cell, which it grows with.
    left: (c, CURVE) what 1 … CURVE sizes leave open then.
    """

    choices: Choices
    left: Floats


@dataclass(frozen=True)
class ProspectKey:
    """What ``prospects`` depends on beside the map. kind: of the pattern. doublings: log₂ of the number of
    cells: how far singularities stand apart is counted in cells, and to the nearest power of two is enough
    for a coarse look. So it stays the same where the cells change a little."""

    kind: Kind
    doublings: int

    @classmethod
    def of(cls, surface: Surface, laid: Pattern) -> ProspectKey:
        return cls(laid.kind, round(float(np.log2(surface.areas.sum() / width_of(laid) ** 2))))


def worth_a_look(cmap: ConformalMap, laid: Pattern, sizes: int, left: float) -> bool:
    """Whether singularities can be looked at, and all of them together could save much. left: share of the
    area that panels leave open now."""
    surface, lattice = cmap.surface, LATTICES[laid.kind]
    if lattice.fold < lattice.order or len(cmap.cones) or not 1 <= len(surface.loops) - surface.openings <= 2:
        return False
    if len(surface.vertices) < PATCHES:  # u at so few says little of the cells between
        return left >= SAVED
    weight = vertex_areas(surface)
    # no singularities can save more than the sizes cost
    return uncovered(cmap.log_scale, weight / weight.sum(), sizes) >= max(SAVED, SHARE * left)


def seats(surface: Surface, kind: Kind) -> Seats:
    """kind: of the pattern."""
    surface = fill_openings(fine_enough(surface, PATCHES))
    known = Responses(surface, _rules(surface, kind, 0.0), patches=PATCHES, steps=False)
    model = known.model(known.seats(SOLVED, FEWEST))
    ends = np.concatenate([surface.vertices[loop] for loop in surface.loops])
    return Seats(model, np.asarray(cKDTree(ends).query(model.place)[0]), surface.vertices)


def prospects(found: Seats, surface: Surface, key: ProspectKey) -> Prospects:
    """None are found where no place is allowed."""
    rules = _rules(surface, key.kind, float(np.sqrt(surface.areas.sum() / 2.0**key.doublings)))
    model = found.model.on(found.inside >= rules.from_loops * rules.cell)
    if not len(model.seat):
        return Prospects(Choices.of((), 0, CURVE, found.vertices), np.zeros((0, CURVE)))
    search = Search(model, rules)
    best = [states[0] for states in ranked(search, starts=0, refine=False) if states]
    cones = state_of_cones(search)
    if cones is not None:  # for as many, they are the best, or all others are as good
        best = sorted(
            [one for one in best if len(one.seat) != len(cones.seat)] + [cones], key=lambda one: len(one.seat)
        )
    choices = Choices.of([search.proposal(state) for state in best], 0, CURVE, found.vertices)
    area = model.weight * surface.areas.sum()
    left = [uncovered_by(*within(u, model.steepness.of(u), area), CURVE) for u in map(search.scale, best)]
    folds = [surface.vertices[feature.vertices] for feature in surface.features]
    length = sum(float(np.linalg.norm(np.diff(fold, axis=0), axis=1).sum()) for fold in folds)
    own = choices.uncovered / rules.cell + FOLDED * length / area.sum()
    return Prospects(replace(choices, uncovered=own, coarse=True), np.array(left))


def _rules(surface: Surface, kind: Kind, cell: float) -> Rules:
    """cell: its width."""
    free: End = "free"
    ends = (free,) * (len(surface.loops) - surface.openings)
    return Rules(LATTICES[kind].quantum, cell, None, ends, most=MOST)


def uncovered_then(found: Prospects, laid: Pattern, sizes: int) -> Floats:
    """(c,) what each number of singularities would leave open, all ends being free."""
    own = found.choices.uncovered * width_of(laid)
    return np.asarray(own + found.left[:, min(sizes, CURVE) - 1])


def outlook(found: Prospects, laid: Pattern, sizes: int, left: float) -> Choices | None:
    """What numbers of singularities would leave open with this many sizes; the first is none, which leaves
    ``left``. None where there is no choice."""
    number = found.choices.number
    if len(number) < 2 or number[0]:
        return None
    then = uncovered_then(found, laid, sizes)
    then[0] = left  # measured, and with the ends as they are now
    return replace(found.choices, sizes=sizes, uncovered=then)


def width_of(laid: Pattern) -> float:
    """Of a cell, in units of the model, were all as large as each other: in their mean edge the few large
    cells at a tip outweigh all others."""
    lattice = LATTICES[laid.kind]
    scale = float(np.sqrt(laid.area / laid.n_cells / lattice.cell_area))
    return scale * abs(complex(lattice.position(lattice.basis[0])))
