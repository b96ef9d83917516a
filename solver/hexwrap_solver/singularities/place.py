"""Where singularities stand: those asked for, or as many as pay."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.errors import SingularitiesError
from hexwrap_solver.singularities.linear import linear_model
from hexwrap_solver.singularities.search import Search, State, curve
from hexwrap_solver.singularities.types import Proposal, Rules, SingularitySettings
from hexwrap_solver.surface.types import Surface

#: Share of the area that one more singularity must be worth, and the part of what is uncovered without any
#: that all of them together must save.
WORTH, CLEARLY = 0.002, 0.25
#: Greatest |k|, and greatest number that may be listed.
LARGEST, MOST = 2, 200


@dataclass(frozen=True)
class Placing:
    """proposals: the best with each number of singularities that is possible, ascending. chosen: index of
    the one to take."""

    proposals: tuple[Proposal, ...]
    chosen: int

    @property
    def proposal(self) -> Proposal:
        return self.proposals[self.chosen]


def place(
    surface: Surface, rules: Rules, count: int | Literal["auto"] = "auto", turn: Floats | None = None
) -> Placing:
    """The whole curve over the number of singularities, up to ``rules.most``, and the number to take: with
    "auto" as many as pay, else at most ``count``, whatever leaves least uncovered.

    turn: see ``linear.Model``. Raises SingularitiesError where no number is possible.
    """
    proposals = curve(Search(linear_model(surface, rules, turn), rules))
    if not proposals:
        raise SingularitiesError(
            f"No {rules.most} singularities or fewer can make the angles of this surface add up, "
            f"{_told(rules)}, and keep the distances asked for: allow more."
        )
    return Placing(tuple(proposals), _choice(proposals, count))


def _choice(proposals: list[Proposal], count: int | Literal["auto"]) -> int:
    uncovered = np.array([one.uncovered for one in proposals])
    number = np.array([one.count for one in proposals])
    if count != "auto":
        possible = np.flatnonzero(number <= count)
        if not len(possible):
            raise SingularitiesError(
                f"At most {count} singularities are asked for, but this surface takes at least {number[0]} "
                "(Gauss–Bonnet): ask for so many, or give an end of the surface the freedom to turn.",
                field=("singularities", "count"),
            )
        return int(possible[np.argmin(uncovered[possible])])
    best = int(np.argmin(uncovered + WORTH * number))
    return best if uncovered[best] <= (1 - CLEARLY) * uncovered[0] else 0


def given(surface: Surface, rules: Rules, settings: SingularitySettings) -> Proposal:
    """The singularities that are listed, with the loop curvatures that suit them best.

    Raises SingularitiesError: places that cannot be used, indices that do not add up.
    """
    index = np.zeros(0, dtype=np.int64) if settings.indices is None else np.asarray(settings.indices)
    vertex = _vertices(surface, settings, index)
    search = Search(linear_model(surface, rules, seats=vertex), rules)
    state = State.of([(i, int(k)) for i, k in enumerate(index)], (0,) * max(len(search.model.free) - 1, 0))
    if not search.complete(state):
        raise SingularitiesError(
            f"The indices add up to {int(index.sum())}, but {_told(rules)}, they must add up to "
            f"{search.model.total} (Gauss–Bonnet): add singularities of the other sign, or give an end the "
            "freedom to turn (boundary.mode isometric).",
            vertices=surface.input_vertex[vertex],
            field=("singularities", "at"),
            data={"sum": int(index.sum()), "wanted": search.model.total},
        )
    return search.proposal(search.with_loops(state))


def _told(rules: Rules) -> str:
    return (
        f"the ends of the surface being {' and '.join(rules.ends)}"
        if rules.ends
        else "the surface being closed"
    )


def _vertices(surface: Surface, settings: SingularitySettings, index: Ints) -> Ints:
    """(k,) mesh vertices of the list, all checked."""
    count = len(index)
    if count > MOST:
        raise _refused(MOST, "index", f"Singularity {MOST} is one too many: at most {MOST} can be listed.")
    for i in np.flatnonzero((index == 0) | (np.abs(index) > LARGEST))[:1]:
        raise _refused(
            i,
            "index",
            f"Singularity {i} has index {index[i]}; it must be 1, −1, 2 or −2 (sides fewer or more).",
        )
    sent = np.full(count, -1, dtype=np.int64) if settings.vertices is None else np.asarray(settings.vertices)
    points = (
        np.full((count, 3), np.nan) if settings.points is None else np.asarray(settings.points, dtype=float)
    )
    loops = [*surface.loops, np.zeros(0, dtype=np.int64)]
    inner = np.setdiff1d(np.arange(len(surface.vertices)), np.concatenate(loops))
    tree = cKDTree(surface.vertices[inner])
    found = np.zeros(count, dtype=np.int64)
    for i in range(count):
        if sent[i] < 0:
            if not np.isfinite(points[i]).all():
                raise _refused(i, "point", f"Singularity {i} names neither a vertex nor a point.")
            found[i] = inner[tree.query(points[i])[1]]
            continue
        if sent[i] >= len(surface.vertex_of_input):
            last = len(surface.vertex_of_input) - 1
            raise _refused(
                i,
                "vertex",
                f"Singularity {i} names vertex {sent[i]}, but only vertices 0 to {last} were sent.",
            )
        found[i] = surface.vertex_of_input[sent[i]]
        if found[i] < 0 or found[i] not in inner:
            raise _refused(
                i,
                "vertex",
                f"Singularity {i} stands at vertex {sent[i]}, which is not inside the surface: choose one at "
                "least two cells away from its boundary.",
                (int(sent[i]),),
            )
    again = [i for i in range(count) if found[i] in found[:i]]
    if again:
        i = again[0]
        raise _refused(
            i,
            "vertex" if sent[i] >= 0 else "point",
            f"Singularity {i} stands where singularity {list(found).index(found[i])} does: list each place "
            "once.",
            (int(surface.input_vertex[found[i]]),),
        )
    return found


def _refused(i: int, name: str, sentence: str, vertices: tuple[int, ...] = ()) -> SingularitiesError:
    return SingularitiesError(sentence, vertices=vertices, field=("singularities", "at", int(i), name))
