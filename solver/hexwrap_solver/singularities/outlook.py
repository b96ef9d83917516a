"""What singularities would bring a surface that was solved without."""

from __future__ import annotations

from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.singularities.linear import linear_model, vertex_areas
from hexwrap_solver.singularities.place import chosen_of
from hexwrap_solver.singularities.search import Search, curve
from hexwrap_solver.singularities.sizes import uncovered
from hexwrap_solver.singularities.solve import told
from hexwrap_solver.singularities.types import End, Rules

#: A coarse look: so many patches and singularities; larger meshes are not looked at.
PATCHES, MOST, LARGEST = 200, 4, 30_000
#: What singularities must save to be told, as a share of the area and of what is uncovered.
SAVED, SHARE = 0.01, 0.3


def outlook(cmap: ConformalMap, laid: Pattern, sizes: int, left: float) -> tuple[str, ...]:
    """A sentence where singularities would leave clearly less uncovered than ``left``, what is left now; by
    the linear model alone."""
    surface = cmap.surface
    if (
        LATTICES[laid.kind].fold < LATTICES[laid.kind].order
        or len(cmap.cones)
        or not 1 <= len(surface.loops) <= 2
        or len(surface.vertices) > LARGEST
    ):
        return ()
    weight = vertex_areas(surface)
    now = uncovered(cmap.log_scale, weight / weight.sum(), sizes)
    least = max(SAVED, SHARE * left)
    if now < least:  # no singularities can save more than the sizes cost
        return ()
    lattice = LATTICES[laid.kind]
    width = laid.edge_length * abs(complex(lattice.position(lattice.basis[0]))) / lattice.edge
    free: End = "free"
    ends = (free,) * len(surface.loops)
    rules = Rules(lattice.quantum, width, sizes, ends, most=MOST)
    model = linear_model(surface, rules, patches=PATCHES, steps=False)
    if not len(model.seat):
        return ()
    proposals = curve(Search(model, rules), starts=0, refine=False)
    best = proposals[chosen_of(proposals)]
    then = left - (now - best.uncovered)
    if not best.count or left - then < least or then <= 0:
        return ()
    return (
        f"{told(laid.kind, best.index).capitalize()} would leave about {then:.1%} uncovered instead of "
        f"{left:.1%}, the ends being free: ask for singularities auto with boundary.mode isometric.",
    )
