"""Which singularities make the cells' sizes most equal: a search over the linear model.

The area-weighted variance of u is a quadratic form in the indices of the singularities and the curvatures
of the loops, so that every move of one of them is judged for all seats at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.singularities.linear import Model
from hexwrap_solver.singularities.sizes import uncovered, uncovered_of_many
from hexwrap_solver.singularities.types import Proposal, Rules

Counts = NDArray[np.int8]

#: States carried from one number of singularities to the next; random starts for each number.
BEAM, STARTS = 5, 16
#: Random starts where straight ends must stand in lattice directions to each other: the best is hard to find.
STARTS_ALIGNED = 48
#: States of each number that are refined.
REFINED = 8
#: Best seats that an addition tries per state.
TRIED = 4
#: Seats next to a singularity that the refinement tries, and its rounds.
NEAR, ROUNDS = 8, 10
#: Gains below this, relative to the variance without singularities, are rounding.
GAIN = 1e-6
#: Variance of u below which cells are equal to everybody who builds (sizes differ by 0.003 %); gains are
#: relative to no less, for rounding alone would go on for ever on a straight tube.
EQUAL = 1e-9
#: Sweeps over all singularities in which they are relocated at most.
SWEEPS = 100
#: Cost of a turn by a quantum between straight loops, in the variance without singularities; it rises with
#: the square, and is nothing at whole quanta.
DIRECTION = 100.0
#: What a panel leaves open in a cell whose size changes by the share |∇u| over one cell's width: so much of
#: that share (measured: 0.46 to 0.53 on real panels of tubes and domes, hexagons inside their cells).
FIT = 0.5
#: Changes of the uncovered area that are none.
SMALL = 2e-5


@dataclass(frozen=True)
class State:
    """seat: indices of seats, ascending. index: k of each. loops: curvature beyond the reference's of every
    free loop but the first."""

    seat: tuple[int, ...]
    index: tuple[int, ...]
    loops: tuple[int, ...]

    @classmethod
    def of(cls, pairs: list[tuple[int, int]], loops: tuple[int, ...]) -> State:
        pairs = sorted(pairs)
        return cls(tuple(s for s, _ in pairs), tuple(k for _, k in pairs), loops)

    @property
    def pairs(self) -> list[tuple[int, int]]:
        return list(zip(self.seat, self.index, strict=True))


@dataclass
class Search:
    """The quadratic form value = constant + 2·linear·s + s·square·s, s being indices by seat and then the
    loops' curvatures; and what the rules forbid."""

    model: Model
    rules: Rules
    constant: float = field(init=False)
    linear: Floats = field(init=False)
    square: Floats = field(init=False)
    alone: Floats = field(init=False)
    moves: list[tuple[int, ...]] = field(init=False)
    direction: float = DIRECTION
    _moves: tuple[Floats, Floats] = field(init=False)
    _quadratic: Floats = field(init=False)
    _near: cKDTree = field(init=False)
    _by_seat: Floats = field(init=False)
    _close: list[Counts] = field(init=False)

    def __post_init__(self) -> None:
        model = self.model
        every = np.concatenate([model.response, model.loop_response], axis=1)
        root = np.sqrt(model.weight)[:, None]
        every = root * (every - model.weight @ every)
        reference = root[:, 0] * (model.reference - model.weight @ model.reference)
        self.constant = float(reference @ reference)
        self.linear = every.T @ reference
        self.square = every.T @ every
        self.alone = np.diag(self.square)
        self.moves = _loop_moves(len(model.free) - 1)
        change = np.array(self.moves, dtype=float).reshape(len(self.moves), -1)
        self._moves = change, change @ self.square[self.seats :, : self.seats]
        self._quadratic = np.einsum("mf,fg,mg->m", change, self.square[self.seats :, self.seats :], change)
        self._near = cKDTree(model.place)
        self._by_seat = np.ascontiguousarray(model.response.T)
        apart = self._apart() / self.rules.cell
        self._close = [  # too near for opposite signs, and for equal ones
            (apart < least).astype(np.int8) for least in (self.rules.opposite, self.rules.apart)
        ]

    @property
    def seats(self) -> int:
        return len(self.model.seat)

    def _apart(self) -> Floats:
        """(q, q) least distance between singularities of two seats; those of one are apart enough."""
        model = self.model
        if model.orbits is None or model.member_place is None:
            return np.asarray(cdist(model.place, model.place))
        first = model.orbits.offsets[:-1]
        apart = cdist(model.member_place, model.member_place)
        least = np.minimum.reduceat(np.minimum.reduceat(apart, first, axis=0), first, axis=1)
        return np.asarray(least)

    def members(self, state: State) -> tuple[Ints, Ints]:
        """Vertices of all singularities, and the index of each."""
        seat, index = list(state.seat), np.array(state.index, dtype=np.int64)
        if self.model.orbits is None:
            return self.model.seat[seat], index
        rows = np.split(np.asarray(self.model.orbits.values, dtype=np.int64), self.model.orbits.offsets[1:-1])
        none = np.zeros(0, dtype=np.int64)
        return np.concatenate([none, *(rows[i] for i in seat)]), np.repeat(index, self.model.size[seat])

    def sum_of(self, state: State) -> int:
        """Σ k over all singularities."""
        return int(self.model.size[list(state.seat)] @ np.array(state.index, dtype=np.int64))

    def count_of(self, state: State) -> int:
        return int(self.model.size[list(state.seat)].sum())

    def scale(self, state: State) -> Floats:
        """(p,) u of the patches."""
        seat, index = list(state.seat), np.array(state.index, dtype=float)
        u = self.model.reference + index @ self._by_seat[seat]
        return np.asarray(u + self.model.loop_response @ np.array(state.loops, dtype=float))

    def value(self, state: State) -> float:
        """Variance of u over the area, and the cost of wrong directions."""
        return self._seen(state)[0] + self._misdirected(state)

    def _seen(self, state: State) -> tuple[float, Floats]:
        """The value, and (q + f,) half its derivative."""
        at = [*state.seat, *range(self.seats, self.seats + len(state.loops))]
        s = np.array([*state.index, *state.loops], dtype=float)
        gradient = self.linear + s @ self.square[at]
        return float(self.constant + self.linear[at] @ s + gradient[at] @ s), gradient

    def _misdirected(self, state: State) -> float:
        """What it costs that straight loops do not stand in lattice directions to each other, by their turn
        in quanta."""
        if self.model.turn is None:
            return 0.0
        return float(
            self._cost_of_turn(self.model.turn[list(state.seat)] @ np.array(state.index, dtype=float))
        )

    def _cost_of_turn(self, turn: Floats | float) -> Floats:
        return np.asarray(self.direction * self.constant * (turn - np.rint(turn)) ** 2)

    def open_seats(self, state: State, k: int) -> Bools:
        """(q,) where one more of index k may stand."""
        crowd = np.zeros(self.seats, dtype=np.int8)
        for seat, index in state.pairs:
            crowd += self._close[int(index * k > 0)][seat]
        return np.asarray(crowd == 0)

    def additions(self, state: State, k: int, most: int) -> list[tuple[float, State]]:
        """The best ways to add a singularity of index k, loops changed along with it."""
        draft = _Draft(self, state)
        values = draft.with_one_more(k, draft.crowd[int(k > 0)])
        if not values.size:
            return []
        best = np.argpartition(values.ravel(), min(most, values.size) - 1)[:most]
        found = []
        for i in best:
            move, seat = divmod(int(i), self.seats)
            if np.isfinite(values[move, seat]):
                more = State.of([*state.pairs, (seat, k)], _plus(state.loops, self.moves[move]))
                found.append((float(values[move, seat]), more))
        return sorted(found, key=lambda one: (one[0], one[1].seat, one[1].loops))

    @property
    def least(self) -> float:
        """The least gain that is none of rounding."""
        return GAIN * max(self.constant, EQUAL)

    def settled(self, state: State) -> tuple[float, State]:
        """Each singularity relocated with the others held, loops changed by one, until nothing gains."""
        draft = _Draft(self, state)
        for _ in range(SWEEPS):
            before = draft.total
            for i in range(len(draft.pairs)):
                draft.relocate(i, self.least)
            draft.turn_loops(self.least)
            if draft.total >= before - self.least:
                break
        return self.value(draft.state), draft.state

    def with_loops(self, state: State) -> State:
        """The same singularities with the loops' curvatures that make the value least."""
        draft = _Draft(self, state)
        draft.turn_loops(self.least)
        return draft.state

    def refined(self, state: State, near: int = NEAR, rounds: int = ROUNDS) -> tuple[float, State]:
        """Moved from seat to one of the ``near`` next, and loops by one, for the least uncovered area."""
        least = np.inf
        for _ in range(rounds):
            around, u = self._neighbours(state, near)
            values = self.misfit(u)
            if self.rules.sizes is not None:
                values += uncovered_of_many(u, self.model.weight, self.rules.sizes)
            values += np.array([self._misdirected(one) for one in around]) / max(self.constant, EQUAL)
            best = int(values.argmin())
            least, state = float(values[best]), around[best]
            if values[0] - least < SMALL:
                break
        return least, state

    def misfit(self, u: Floats) -> Floats:
        """Share of the area that panels of their own sizes leave open; u: (p, …)."""
        return np.asarray(FIT * self.rules.cell * (self.model.weight @ self.model.steepness.of(u)))

    def _neighbours(self, state: State, near: int) -> tuple[list[State], Floats]:
        """The state itself and others next to it, and u of all of them, (p, m)."""
        here, by_seat = self.scale(state), self._by_seat
        found, changes = [state], [np.zeros((1, len(here)))]
        for i, move in enumerate(self.moves):
            if any(move):
                found.append(State(state.seat, state.index, _plus(state.loops, move)))
                changes.append((self.model.loop_response @ self._moves[0][i])[None])
        for i, (seat, k) in enumerate(state.pairs):
            rest = State.of([p for j, p in enumerate(state.pairs) if j != i], state.loops)
            clear = self.open_seats(rest, k)
            next_to = np.atleast_1d(self._near.query(self.model.place[seat], min(near + 1, self.seats))[1])[
                1:
            ]
            next_to = next_to[clear[next_to]]
            found += [State.of([*rest.pairs, (int(other), k)], state.loops) for other in next_to]
            changes.append(k * (by_seat[next_to] - by_seat[seat]))
        return found, np.ascontiguousarray((here + np.concatenate(changes)).T)

    def proposal(self, state: State) -> Proposal:
        u = self.scale(state)
        ends = list(self.model.loops)
        for loop, more in zip(self.model.free[1:], state.loops, strict=True):
            ends[loop] += more
        if self.model.free:
            ends[self.model.free[0]] -= self.sum_of(state) + sum(state.loops)
        vertex, index = self.members(state)
        order = np.argsort(vertex, kind="stable")
        return Proposal(
            vertex[order],
            index[order],
            tuple(ends),
            uncovered(u, self.model.weight, self.rules.sizes) + float(self.misfit(u)),
            float(np.sqrt(max(self._seen(state)[0], 0.0))),
            float(np.exp(np.ptp(u))),
        )

    def complete(self, state: State) -> bool:
        """Whether the curvatures add up."""
        return self.model.total is None or self.sum_of(state) == self.model.total


class _Draft:
    """A state that is being changed: what its value and derivative are, and which seats are taken, is kept
    up."""

    def __init__(self, search: Search, state: State) -> None:
        self.search, self.pairs, self.loops = search, state.pairs, state.loops
        self.value, self.gradient = search._seen(state)
        self.turn = 0.0
        if search.model.turn is not None:
            self.turn = float(search.model.turn[list(state.seat)] @ np.array(state.index, dtype=float))
        self.crowd = [np.zeros(search.seats, dtype=np.int8) for _ in range(2)]  # for k < 0, for k > 0
        for seat, k in self.pairs:
            self._crowd(seat, k, 1)

    @property
    def total(self) -> float:
        cost = self.search._cost_of_turn(self.turn) if self.search.model.turn is not None else 0.0
        return float(self.value + cost)

    @property
    def state(self) -> State:
        return State.of(self.pairs, self.loops)

    def _crowd(self, seat: int, k: int, by: int) -> None:
        for positive in (0, 1):
            self.crowd[positive] += by * self.search._close[int((k > 0) == bool(positive))][seat]

    def with_one_more(self, k: int, crowd: Counts) -> Floats:
        """(moves, q) value with one more of index k on each seat, loops changed by each move; ∞ where
        crowded."""
        search, q = self.search, self.search.seats
        change, more = search._moves
        base = self.value + 2 * change @ self.gradient[q:] + search._quadratic
        values = 2 * k * (self.gradient[:q] + more) + base[:, None] + k * k * search.alone[:q]
        if search.model.turn is not None:
            values += search._cost_of_turn(self.turn + k * search.model.turn)
        values[:, crowd > 0] = np.inf
        return np.asarray(values)

    def _change(self, seat: int, k: int, sign: int) -> None:
        """Adds (1) or takes away (−1) a singularity; for those taken away the gradient is changed first."""
        search = self.search
        if sign < 0:
            self.gradient = self.gradient - k * search.square[seat]
        self.value += sign * (2 * k * float(self.gradient[seat]) + k * k * float(search.alone[seat]))
        if sign > 0:
            self.gradient = self.gradient + k * search.square[seat]
        if search.model.turn is not None:
            self.turn += sign * k * float(search.model.turn[seat])
        self._crowd(seat, k, sign)

    def _turn(self, move: int, steps: int = 1) -> None:
        """Makes a move, ``steps`` times."""
        search, q = self.search, self.search.seats
        change = steps * search._moves[0][move]
        self.value += float(2 * change @ self.gradient[q:] + steps**2 * search._quadratic[move])
        self.gradient = self.gradient + change @ search.square[q:]
        self.loops = _plus(self.loops, tuple(steps * k for k in search.moves[move]))

    def relocate(self, i: int, least: float) -> None:
        """The singularity to the best seat, if that gains at least so much."""
        seat, k = self.pairs[i]
        before = self.total
        self._change(seat, k, -1)
        values = self.with_one_more(k, self.crowd[int(k > 0)])
        move, best = divmod(int(values.argmin()), self.search.seats)
        if values[move, best] < before - least:
            seat = best
            if any(self.search.moves[move]):
                self._turn(move)
        self._change(seat, k, 1)
        self.pairs[i] = (seat, k)

    def turn_loops(self, least: float) -> None:
        """Loops changed as long as that gains, by each move to its minimum at once: where coordinates are
        wild, it can be 100,000 quanta away."""
        change, q = self.search._moves[0], self.search.seats
        bend = self.search._quadratic
        while True:
            slope = 2 * change @ self.gradient[q:]
            best = int((slope + bend).argmin())
            if slope[best] + bend[best] >= -least or bend[best] <= 0:
                return
            self._turn(best, max(1, round(-float(slope[best]) / (2 * float(bend[best])))))


def _plus(loops: tuple[int, ...], move: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(a + b for a, b in zip(loops, move, strict=True))


def _loop_moves(loops: int) -> list[tuple[int, ...]]:
    """No change, one loop by one quantum, or two loops by opposite ones."""
    moves = [(0,) * max(loops, 0)]
    unit = np.eye(max(loops, 0), dtype=int)
    for i in range(loops):
        moves += [tuple(unit[i].tolist()), tuple((-unit[i]).tolist())]
        for j in range(loops):
            if i != j:
                moves.append(tuple((unit[i] - unit[j]).tolist()))
    return moves


def curve(
    search: Search, starts: int = STARTS, refine: bool = True, patience: int | None = None
) -> list[Proposal]:
    """The best there is with 0, 1, 2, … singularities, as far as the rules allow and numbers are possible.
    starts, refine: see ``ranked``. patience: numbers beyond the best at which it ends; None: only at
    ``rules.most``."""
    found: dict[int, Proposal] = {}
    for states in ranked(search, starts, refine):
        for state in states:
            count = search.count_of(state)  # with symmetry a seat may be several singularities
            if count not in found or search.model.orbits is not None:
                one = search.proposal(state)
                if count <= search.rules.most and (
                    count not in found or one.uncovered < found[count].uncovered
                ):
                    found[count] = one
        least = min(found.values(), key=lambda one: one.uncovered, default=None)
        if patience is not None and least is not None and max(found) >= least.count + patience:
            break
    return [found[number] for number in sorted(found)]


def ranked(search: Search, starts: int = STARTS, refine: bool = True) -> Iterator[list[State]]:
    """For 0, 1, 2, … seats taken the best states, the best first. starts: random ones for each number.
    refine: for the uncovered area, beyond the variance; without, they do not depend on the sizes."""
    rng = np.random.default_rng(17)
    kinds = [k for size in range(1, search.rules.largest + 1) for k in (-size, size)]
    beam = [search.settled(State((), (), (0,) * max(len(search.model.free) - 1, 0)))]
    for number in range(search.rules.most + 1):
        if number:
            added = [
                one for one in _additions(search, beam, kinds) if search.count_of(one[1]) <= search.rules.most
            ]
            beam = [
                one for group in _grouped(search, added, number) for one in _best(search, group, rng, starts)
            ]
        whole = [one for one in beam if search.complete(one[1])][:REFINED]
        if refine:
            whole = sorted(
                (search.refined(state) for _, state in whole), key=lambda one: (one[0], one[1].seat)
            )
        yield [state for _, state in whole]
        grouped = {state for _, state in beam[:BEAM]} | {state for _, state in whole[:1]}
        beam = [(search.value(state), state) for state in sorted(grouped, key=lambda state: state.seat)]


def _additions(
    search: Search, beam: list[tuple[float, State]], kinds: list[int]
) -> list[tuple[float, State]]:
    return [one for _, state in beam for k in kinds for one in search.additions(state, k, TRIED)]


def _grouped(
    search: Search, states: list[tuple[float, State]], number: int
) -> list[list[tuple[float, State]]]:
    """By Σ k, where it has to become a certain number: those that are as near to it as they can be."""
    total = search.model.total
    if total is None:
        return [states]
    far = max(1, abs(total) - number)
    sums = sorted({search.sum_of(state) for _, state in states})
    return [[one for one in states if search.sum_of(one[1]) == k] for k in sums if abs(total - k) <= far]


def _best(
    search: Search, added: list[tuple[float, State]], rng: np.random.Generator, starts: int
) -> list[tuple[float, State]]:
    """The best states of a number, from these and from random ones with the same indices."""
    tried = {}
    for _, state in sorted(added, key=lambda one: one[0])[: 2 * BEAM * TRIED]:
        value, settled = search.settled(state)
        tried[settled] = value
    if not tried:
        return []
    if not search.complete(next(iter(tried))):  # on the way to a number only
        starts //= 4
    leading = min(tried, key=lambda state: (tried[state], state.seat))
    for _ in range(starts):
        state = State((), (), leading.loops)
        for k in leading.index:
            clear = np.flatnonzero(search.open_seats(state, k))
            if len(clear):
                state = State.of([*state.pairs, (int(rng.choice(clear)), k)], state.loops)
        if len(state.seat) == len(leading.seat):
            if search.model.turn is not None:
                search.direction = DIRECTION / 100
                _, state = search.settled(state)
                search.direction = DIRECTION / 10
                _, state = search.settled(state)
                search.direction = DIRECTION
            value, settled = search.settled(state)
            tried[settled] = value
    ranked = sorted(((value, state) for state, value in tried.items()), key=lambda one: (one[0], one[1].seat))
    return ranked[:REFINED]
