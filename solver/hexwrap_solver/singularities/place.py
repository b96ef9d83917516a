"""Where singularities stand: those asked for, or as many as pay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.errors import SingularitiesError
from hexwrap_solver.singularities.linear import Responses, Tube, linear_model
from hexwrap_solver.singularities.search import STARTS, STARTS_ALIGNED, Search, State, curve
from hexwrap_solver.singularities.symmetry import OFF, Group, orbits, symmetries
from hexwrap_solver.singularities.types import Proposal, Rules, SingularityAt
from hexwrap_solver.surface.types import Surface

#: Share of the area that one more singularity must be worth, and the part of what is uncovered without any
#: that all of them together must save.
WORTH, CLEARLY = 0.001, 0.25
#: Groups of symmetries that are tried.
GROUPS = 5
#: The search ends where this many numbers more have brought nothing.
PATIENCE = 3
#: Where no number of singularities finds room, they may stand this near to each other, in cells.
NEAREST = 2.0
#: The final places are found within this many cells, again and again nearer, among vertices at such a part of
#: that apart, in this many steps.
REACHES, SPACING, ROUNDS = (1.5, 0.8, 0.4), 0.4, 20


@dataclass(frozen=True)
class Proposals:
    """proposals: the best with each number of singularities that is possible, ascending. chosen: index of
    the one to take. symmetry: of the surface, which they keep to; empty where that is not asked for.
    others: those that will do where it cannot be closed, best first. may_be_none: the finished map is taken
    only where it leaves less uncovered than one without any."""

    proposals: tuple[Proposal, ...]
    chosen: int
    symmetry: str = ""
    may_be_none: bool = False
    others: tuple[int, ...] = ()

    @property
    def proposal(self) -> Proposal:
        return self.proposals[self.chosen]


def place(
    surface: Surface, rules: Rules, count: int | Literal["auto"] = "auto", tube: Tube | None = None
) -> Proposals:
    """The whole curve over the number of singularities, up to ``rules.most``, and the number to take: with
    "auto" as many as pay, else at most ``count``, whatever leaves least uncovered.

    tube: see ``Responses``. Raises SingularitiesError where no number is possible.
    """
    known = Responses(surface, rules, tube)
    patience = PATIENCE if count == "auto" else None
    proposals, symmetry = _symmetric(known, patience) if rules.symmetric else (_curve(known, patience), "")
    if not proposals:
        if rules.apart > NEAREST:
            near = NEAREST / rules.apart
            return place(surface, replace(rules, apart=NEAREST, opposite=near * rules.opposite), count, tube)
        n = len(surface.vertices)
        few = f" The mesh has {n} vertices for them to stand at: refine it first." if n < rules.most else ""
        raise SingularitiesError(
            f"No {rules.most} singularities or fewer can make the angles of this surface add up, "
            f"{_index_rule(rules)}, and stand {rules.apart:g} cells apart (a cell is {rules.cell:.3g} wide): "
            f"smaller cells, smaller distances from boundary and folds, or more of them would help.{few}"
        )
    chosen = _choice(proposals, count)
    if proposals[chosen].count and not rules.symmetric:
        proposals[chosen] = _polished(known, proposals[chosen])
    others = [
        i
        for i in np.argsort([one.uncovered for one in proposals], kind="stable")
        if i != chosen and proposals[i].count > 0 and (count == "auto" or proposals[i].count <= count)
    ]
    return Proposals(tuple(proposals), chosen, symmetry, others=tuple(int(i) for i in others))


def _curve(known: Responses, patience: int | None, group: Group | None = None) -> list[Proposal]:
    """Raises SingularitiesError where rules that are asked for leave no place."""
    rules, kept = known.rules, None
    if group is not None:
        kept = partial(orbits, known.surface, group=group, rules=rules)
    model = known.model(known.seats(), kept)
    if not len(model.seat) and (rules.away or rules.creases or rules.only is not None):
        raise SingularitiesError(
            "The rules leave no place for a singularity: it would have to stand "
            f"{rules.from_loops:g} cells from the boundary (a cell is {rules.cell:.3g} wide), off the lines "
            "named in keep_off and the creases, and inside the balls of only. Ask for less.",
            field=("singularities",),
        )
    starts = STARTS if known.turn is None else STARTS_ALIGNED
    return curve(Search(model, rules), starts, patience=patience)


def _polished(known: Responses, proposal: Proposal) -> Proposal:
    """From seat to seat singularities move by about a cell; here from vertex to vertex."""
    for reach in REACHES:
        radius = reach * known.rules.cell
        seats = known.near(proposal.vertex, radius, SPACING * radius)
        search = Search(known.model(seats), known.rules)
        at = np.searchsorted(search.model.seat, proposal.vertex)
        pairs = [(int(i), int(k)) for i, k in zip(at, proposal.index, strict=True)]
        loops = tuple(proposal.loops[i] - search.model.loops[i] for i in search.model.free[1:])
        _, state = search.refined(
            State.of(pairs, loops), near=len(seats) // max(len(pairs), 1), rounds=ROUNDS
        )
        better = search.proposal(state)
        if better.uncovered < proposal.uncovered:
            proposal = better
    return proposal


def _symmetric(known: Responses, patience: int | None) -> tuple[list[Proposal], str]:
    """The best for each number among all symmetries of the surface, and what these are. Raises
    SingularitiesError where it has none."""
    groups = symmetries(known.surface, known.rules.cell)[:GROUPS]
    if not groups:
        raise SingularitiesError(
            "Singularities are to stand symmetrically, but no mirror plane and no axis carries this surface "
            f"to itself within {OFF:g} cells: leave 'symmetric' out.",
            field=("singularities", "symmetric"),
        )
    best: dict[int, Proposal] = {}
    for group in groups:
        for one in _curve(known, patience, group):
            if one.count not in best or one.uncovered < best[one.count].uncovered:
                best[one.count] = one
    names = list(dict.fromkeys(group.name for group in groups))
    return [best[number] for number in sorted(best)], ", ".join(names)


def _choice(proposals: list[Proposal], count: int | Literal["auto"]) -> int:
    """Index of the one to take."""
    uncovered = np.array([one.uncovered for one in proposals])
    number = np.array([one.count for one in proposals])
    if count != "auto":
        possible = np.flatnonzero(number <= count)
        if not len(possible):
            raise SingularitiesError(
                f"At most {count} singularities are asked for, but this surface takes at least {number[0]} "
                "(Gauss–Bonnet): ask for that many, or give an end of the surface the freedom to turn.",
                field=("singularities", "count"),
            )
        return int(possible[np.argmin(uncovered[possible])])
    return number_of(uncovered, number)


def number_of(uncovered: Floats, number: Ints) -> int:
    """Index of as many as pay."""
    best = int(np.argmin(uncovered + WORTH * number))
    return best if uncovered[best] <= (1 - CLEARLY) * uncovered[0] else 0


def given(surface: Surface, rules: Rules, listed: tuple[SingularityAt, ...]) -> Proposal:
    """The singularities that are listed, with the loop curvatures that suit them best.

    Raises SingularitiesError: places that cannot be used, indices that do not add up.
    """
    index = np.array([one.index for one in listed], dtype=np.int64)
    vertex = _vertices(surface, listed)
    search = Search(linear_model(surface, rules, seats=vertex), rules)
    state = State.of([(i, int(k)) for i, k in enumerate(index)], (0,) * max(len(search.model.free) - 1, 0))
    if not search.complete(state):
        raise SingularitiesError(
            f"The indices add up to {int(index.sum())}, but {_index_rule(rules)}, they must add up to "
            f"{search.model.total} (Gauss–Bonnet): add singularities of the other sign, or give an end the "
            "freedom to turn (boundary.mode isometric).",
            vertices=surface.input_vertex[vertex],
            field=("singularities", "at"),
            data={"sum": int(index.sum()), "wanted": search.model.total},
        )
    return search.proposal(search.refined(search.with_loops(state), near=0)[1])


def _index_rule(rules: Rules) -> str:
    return (
        f"the ends of the surface being {' and '.join(rules.ends)}"
        if rules.ends
        else "the surface being closed"
    )


def _vertices(surface: Surface, listed: tuple[SingularityAt, ...]) -> Ints:
    """(k,) mesh vertices of the list, all checked."""
    nothing = np.zeros(0, dtype=np.int64)
    inner = np.setdiff1d(np.arange(len(surface.vertices)), np.concatenate([nothing, *surface.loops]))
    tree = cKDTree(surface.vertices[inner])
    found: list[int] = []
    for i, one in enumerate(listed):
        if one.vertex is not None:
            vertex = _inside(surface, inner, i, one.vertex)
        else:
            vertex = int(inner[tree.query(np.array(one.point, dtype=float))[1]])
        if vertex in found:
            raise _refused(
                i,
                "vertex" if one.point is None else "point",
                f"Singularity {i} stands where singularity {found.index(vertex)} does: list each place once.",
                (int(surface.input_vertex[vertex]),),
            )
        found.append(vertex)
    return np.array(found, dtype=np.int64)


def _inside(surface: Surface, inner: Ints, i: int, sent: int) -> int:
    """The mesh vertex of a sent one."""
    if sent >= len(surface.vertex_of_input):
        last = len(surface.vertex_of_input) - 1
        raise _refused(
            i, "vertex", f"Singularity {i} names vertex {sent}, but only vertices 0 to {last} were sent."
        )
    vertex = int(surface.vertex_of_input[sent])
    if vertex not in inner:
        raise _refused(
            i,
            "vertex",
            f"Singularity {i} stands at vertex {sent}, which is not inside the surface: choose one at least "
            "two cells away from its boundary.",
            (sent,),
        )
    return vertex


def _refused(i: int, name: str, sentence: str, vertices: tuple[int, ...] = ()) -> SingularitiesError:
    return SingularitiesError(sentence, vertices=vertices, field=("singularities", "at", int(i), name))
