"""What singularities would bring a surface that was solved without."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import Kind, Pattern
from hexwrap_solver.singularities.linear import linear_model, vertex_areas
from hexwrap_solver.singularities.place import number_of
from hexwrap_solver.singularities.search import Search, ranked
from hexwrap_solver.singularities.sizes import uncovered, uncovered_by
from hexwrap_solver.singularities.solve import in_words
from hexwrap_solver.singularities.types import Choices, End, Rules
from hexwrap_solver.surface.holes import fill_openings
from hexwrap_solver.surface.types import Surface

#: A coarse look: this many patches and singularities; larger meshes are not looked at.
PATCHES, MOST, LARGEST = 200, 4, 30_000
#: Numbers of sizes that are told apart; more leave hardly less open.
CURVE = 24
#: What singularities must save to be told, as a share of the area and of what is uncovered.
SAVED, SHARE = 0.01, 0.3


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
        return cls(laid.kind, round(float(np.log2(surface.areas.sum() / _width(laid) ** 2))))


def worth_a_look(cmap: ConformalMap, laid: Pattern, sizes: int, left: float) -> bool:
    """Whether singularities can be looked at, and all of them together could save much. left: share of the
    area that panels leave open now."""
    surface, lattice = cmap.surface, LATTICES[laid.kind]
    if (
        lattice.fold < lattice.order
        or len(cmap.cones)
        or not 1 <= len(surface.loops) - surface.openings <= 2
        or len(surface.vertices) > LARGEST
    ):
        return False
    weight = vertex_areas(surface)
    # no singularities can save more than the sizes cost
    return uncovered(cmap.log_scale, weight / weight.sum(), sizes) >= max(SAVED, SHARE * left)


def prospects(surface: Surface, key: ProspectKey) -> Prospects:
    """By a coarse linear model. None are found where no place is allowed."""
    surface = fill_openings(surface)
    free: End = "free"
    ends = (free,) * len(surface.loops)
    cell = float(np.sqrt(surface.areas.sum() / 2.0**key.doublings))
    rules = Rules(LATTICES[key.kind].quantum, cell, None, ends, most=MOST)
    model = linear_model(surface, rules, patches=PATCHES, steps=False)
    if not len(model.seat):
        return Prospects(Choices.of((), 0, CURVE, surface.vertices), np.zeros((0, CURVE)))
    search = Search(model, rules)
    best = [states[0] for states in ranked(search, starts=0, refine=False) if states]
    choices = Choices.of([search.proposal(state) for state in best], 0, CURVE, surface.vertices)
    return Prospects(
        replace(choices, uncovered=choices.uncovered / cell, coarse=True),
        np.array([uncovered_by(search.scale(state), model.weight, CURVE) for state in best]),
    )


def outlook(found: Prospects, laid: Pattern, sizes: int, left: float) -> Choices | None:
    """What numbers of singularities would leave open with this many sizes; the first is none, which leaves
    ``left``. None where there is no choice."""
    number = found.choices.number
    if len(number) < 2 or number[0]:
        return None
    then = found.choices.uncovered * _width(laid)
    then += found.left[:, min(sizes, CURVE) - 1]
    then[0] = left  # measured, and with the ends as they are now
    return replace(found.choices, sizes=sizes, uncovered=then)


def outlook_note(laid: Pattern, found: Choices) -> tuple[str, ...]:
    """A sentence where they would leave clearly less than now."""
    left, best = float(found.uncovered[0]), number_of(found.uncovered, found.number)
    then = float(found.uncovered[best])
    if not best or left - then < max(SAVED, SHARE * left) or then <= 0:
        return ()
    return (
        f"{in_words(laid.kind, found.index[best]).capitalize()} would leave about {then:.1%} uncovered "
        f"instead of {left:.1%}, the ends being free: ask for singularities {found.number[best]}, or auto, "
        "which may find more, with boundary.mode isometric.",
    )


def _width(laid: Pattern) -> float:
    """Of a cell, in units of the model."""
    lattice = LATTICES[laid.kind]
    return laid.edge_length * abs(complex(lattice.position(lattice.basis[0]))) / lattice.edge
