"""What singularities would bring a surface that was solved without."""

from __future__ import annotations

from dataclasses import replace

from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.singularities.linear import linear_model, vertex_areas
from hexwrap_solver.singularities.place import number_of
from hexwrap_solver.singularities.search import Search, curve
from hexwrap_solver.singularities.sizes import uncovered
from hexwrap_solver.singularities.solve import told
from hexwrap_solver.singularities.types import Choices, End, Rules

#: A coarse look: so many patches and singularities; larger meshes are not looked at.
PATCHES, MOST, LARGEST = 200, 4, 30_000
#: What singularities must save to be told, as a share of the area and of what is uncovered.
SAVED, SHARE = 0.01, 0.3


def outlook(cmap: ConformalMap, laid: Pattern, sizes: int, left: float) -> Choices | None:
    """What numbers of singularities would leave open, by a coarse linear model, the ends being free; the
    first is none, which leaves ``left``. None where all of them together cannot save much."""
    surface = cmap.surface
    if (
        LATTICES[laid.kind].fold < LATTICES[laid.kind].order
        or len(cmap.cones)
        or not 1 <= len(surface.loops) <= 2
        or len(surface.vertices) > LARGEST
    ):
        return None
    weight = vertex_areas(surface)
    now = uncovered(cmap.log_scale, weight / weight.sum(), sizes)
    if now < max(SAVED, SHARE * left):  # no singularities can save more than the sizes cost
        return None
    lattice = LATTICES[laid.kind]
    width = laid.edge_length * abs(complex(lattice.position(lattice.basis[0]))) / lattice.edge
    free: End = "free"
    ends = (free,) * len(surface.loops)
    rules = Rules(lattice.quantum, width, sizes, ends, most=MOST)
    model = linear_model(surface, rules, patches=PATCHES, steps=False)
    if not len(model.seat):
        return None
    proposals = curve(Search(model, rules), starts=0, refine=False)
    if len(proposals) < 2 or proposals[0].count:
        return None
    found = Choices.of(proposals, 0, sizes, surface.vertices)
    then = found.uncovered.copy()
    then[0] = left  # measured, and with the ends as they are now
    return replace(found, uncovered=then, coarse=True)


def outlook_note(laid: Pattern, found: Choices) -> tuple[str, ...]:
    """A sentence where they would leave clearly less than now."""
    left, best = float(found.uncovered[0]), number_of(found.uncovered, found.number)
    then = float(found.uncovered[best])
    if not best or left - then < max(SAVED, SHARE * left) or then <= 0:
        return ()
    return (
        f"{told(laid.kind, found.index[best]).capitalize()} would leave about {then:.1%} uncovered instead "
        f"of {left:.1%}, the ends being free: ask for singularities auto with boundary.mode isometric.",
    )
