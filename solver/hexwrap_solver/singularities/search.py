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
#: States of each number that are kept, and how many of these, those that leave least open, are refined.
REFINED, PROMISING = 8, 3
#: Values that are held at a time: of this many states as that makes.
TOGETHER = 4_000_000
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
#: Share left open that is much: more singularities than enough are tried then, from so many random starts.
MUCH, FEW = 0.15, 4
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
    _close: Counts = field(init=False)

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
        # too near for opposite signs, and for equal ones
        self._close = np.stack([apart < least for least in (self.rules.opposite, self.rules.apart)]).astype(
            np.int8
        )

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

    def additions(self, states: list[State], kinds: list[int], most: int) -> list[tuple[float, State]]:
        """The best ways to add a singularity of each of these indices to each, loops changed along."""
        found: list[list[tuple[float, State]]] = [[] for _ in states]
        for begin in range(0, len(states), self._together):
            some = states[begin : begin + self._together]
            drafts = _Drafts(self, some)
            for k in kinds:
                values = drafts.with_one_more(np.full(len(some), float(k)))
                for i, state in enumerate(some):
                    found[begin + i] += self._least_of(values[i], state, k, most)
        return [one for ways in found for one in ways]

    def _least_of(self, values: Floats, state: State, k: int, most: int) -> list[tuple[float, State]]:
        """values: (moves, q) with one more of index k."""
        if not values.size:
            return []
        ways = []
        for i in np.argpartition(values.ravel(), min(most, values.size) - 1)[:most].tolist():
            move, seat = divmod(i, self.seats)
            if np.isfinite(values[move, seat]):
                more = State.of([*state.pairs, (seat, k)], _plus(state.loops, self.moves[move]))
                ways.append((float(values[move, seat]), more))
        return sorted(ways, key=lambda one: (one[0], one[1].seat, one[1].loops))

    @property
    def _together(self) -> int:
        """States whose values are held at a time."""
        return max(1, TOGETHER // max(len(self.moves) * self.seats, 1))

    @property
    def least(self) -> float:
        """The least gain that is none of rounding."""
        return GAIN * max(self.constant, EQUAL)

    def settled(self, states: list[State]) -> list[tuple[float, State]]:
        """States with equally many singularities: each of these relocated with the others held, loops changed
        by one, until nothing gains."""
        found: list[tuple[float, State]] = []
        for begin in range(0, len(states), self._together):
            drafts = _Drafts(self, states[begin : begin + self._together])
            drafts.settle(self.least)
            found += [(self.value(state), state) for state in drafts.states]
        return found

    def with_loops(self, state: State) -> State:
        """The same singularities with the loops' curvatures that make the value least."""
        draft = _Drafts(self, [state])
        draft.turn_loops(np.array([0]), self.least)
        return draft.states[0]

    def refined(self, state: State, near: int = NEAR, rounds: int = ROUNDS) -> tuple[float, State]:
        """Moved from seat to one of the ``near`` next, and loops by one, for the least uncovered area."""
        least = np.inf
        for _ in range(rounds):
            around, u = self._neighbours(state, near)
            values = self._left_open(around, u)
            best = int(values.argmin())
            least, state = float(values[best]), around[best]
            if values[0] - least < SMALL:
                break
        return least, state

    def most_promising(self, states: list[tuple[float, State]], most: int) -> list[tuple[float, State]]:
        """Those that leave least uncovered, in their order."""
        if len(states) <= most:
            return states
        only = [state for _, state in states]
        values = self._left_open(only, np.stack([self.scale(state) for state in only], axis=1))
        return [states[i] for i in sorted(np.argsort(values, kind="stable")[:most])]

    def _left_open(self, states: list[State], u: Floats) -> Floats:
        """(m,) uncovered share, and the cost of wrong directions; u: (p, m) of the states."""
        values = self.misfit(u)
        if self.rules.sizes is not None:
            values += uncovered_of_many(u, self.model.weight, self.rules.sizes)
        return values + np.array([self._misdirected(one) for one in states]) / max(self.constant, EQUAL)

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


class _Drafts:
    """Several states of equally many singularities that are being changed, all at once: the value of each and
    its derivative, and which seats are taken, is kept up.

    seat: (s, n) and index: (s, n) of the singularities. loops: (s, f). value: (s,), gradient: (s, q + f) half
    its derivative. turn: (s,) see ``Model``. crowd: (s, 2, q) singularities too near for one of negative and
    of positive index.
    """

    def __init__(self, search: Search, states: list[State]) -> None:
        self.search, q = search, search.seats
        number = len(states)
        self.seat = np.array([state.seat for state in states], dtype=np.int64).reshape(number, -1)
        self.index = np.array([state.index for state in states], dtype=float).reshape(number, -1)
        self.loops = np.array([state.loops for state in states], dtype=np.int64).reshape(number, -1)
        seen = [search._seen(state) for state in states]
        self.value = np.array([value for value, _ in seen])
        self.gradient = np.stack([gradient for _, gradient in seen])
        self.turn = (self._turn_of(self.seat) * self.index).sum(axis=1)
        self.crowd = np.zeros((number, 2, q), dtype=np.int8)
        every = np.arange(number)
        for i in range(self.seat.shape[1]):
            self._crowd(every, self.seat[:, i], self.index[:, i], 1)

    def _turn_of(self, seat: Ints) -> Floats:
        turn = self.search.model.turn
        return np.zeros(seat.shape) if turn is None else turn[seat]

    @property
    def states(self) -> list[State]:
        found = []
        for seat, index, loops in zip(self.seat, self.index, self.loops, strict=True):
            pairs = [(int(i), round(float(k))) for i, k in zip(seat, index, strict=True)]
            found.append(State.of(pairs, tuple(loops.tolist())))
        return found

    @property
    def _totals(self) -> Floats:
        search = self.search
        return self.value if search.model.turn is None else self.value + search._cost_of_turn(self.turn)

    def _crowd(self, which: Ints, seat: Ints, k: Floats, by: int) -> None:
        for positive in (0, 1):
            same = ((k > 0) == bool(positive)).astype(np.int64)
            self.crowd[which, positive] += by * self.search._close[same, seat]

    def with_one_more(self, k: Floats) -> Floats:
        """(s, moves, q) values with one more of index k (s,) on each seat, loops changed by each move; ∞
        where that is too near to others."""
        crowd = self.crowd[np.arange(len(k)), (k > 0).astype(np.int64)]
        return self._with_one_more(k, crowd, self.value, self.gradient, self.turn)

    def _with_one_more(
        self, k: Floats, crowd: Counts, value: Floats, gradient: Floats, turn: Floats
    ) -> Floats:
        """To states of these values."""
        search, q = self.search, self.search.seats
        change, more = search._moves
        base = value[:, None] + 2 * gradient[:, q:] @ change.T + search._quadratic
        alone = gradient[:, :q] * (2 * k)[:, None]
        alone += (k * k)[:, None] * search.alone[:q]
        if search.model.turn is not None:
            alone += search._cost_of_turn(turn[:, None] + k[:, None] * search.model.turn)
        np.copyto(alone, np.inf, where=crowd > 0)
        values = alone[:, None, :] + base[:, :, None]
        if len(search.moves) > 1:
            values += (2 * k)[:, None, None] * more
        return np.asarray(values)

    def _move(self, which: Ints, move: Ints, steps: Ints) -> None:
        """Makes a move of each, this many times."""
        search, q = self.search, self.search.seats
        change = steps[:, None] * search._moves[0][move]
        slope = np.einsum("sf,sf->s", change, self.gradient[which][:, q:])
        self.value[which] += 2 * slope + steps.astype(float) ** 2 * search._quadratic[move]
        self.gradient[which] += change @ search.square[q:]
        self.loops[which] += np.rint(change).astype(np.int64)

    def settle(self, least: float) -> None:
        """See ``Search.settled``."""
        n = self.seat.shape[1]
        #: How many singularities have stayed since anything changed; n − 1, and the next one stays as well.
        stayed = np.full(len(self.value), -1)
        active = np.arange(len(self.value))
        for _ in range(SWEEPS):
            for i in range(n):
                which = active[stayed[active] < n - 1]
                if not len(which):
                    break
                stayed[which] = np.where(self.relocate(which, i, least), 0, stayed[which] + 1)
            stayed[active[self.turn_loops(active, least)]] = -1
            active = active[stayed[active] < n - 1]
            if not len(active):
                break

    def relocate(self, which: Ints, i: int, least: float) -> Bools:
        """The i-th singularity of each to the best seat, where that gains at least so much: (w,) which do."""
        search, every = self.search, np.arange(len(which))
        seat, k = self.seat[which, i], self.index[which, i]
        # the states without it
        gradient = k[:, None] * search.square[seat]
        np.subtract(self.gradient[which], gradient, out=gradient)
        value = self.value[which] - (2 * k * gradient[every, seat] + k * k * search.alone[seat])
        turn = self.turn[which] - k * self._turn_of(seat)
        crowd = self.crowd[which, (k > 0).astype(np.int64)] - search._close[1][seat]
        values = self._with_one_more(k, crowd, value, gradient, turn).reshape(len(which), -1)
        best = values.argmin(axis=1)
        gains = values[every, best] < self._totals[which] - least
        at, to = which[gains], best[gains] % search.seats
        self._crowd(at, seat[gains], k[gains], -1)
        k, gradient = k[gains], gradient[gains]
        self.value[at] = value[gains] + 2 * k * gradient[np.arange(len(at)), to] + k * k * search.alone[to]
        self.gradient[at] = gradient + k[:, None] * search.square[to]
        self.turn[at] = turn[gains] + k * self._turn_of(to)
        self._crowd(at, to, k, 1)
        self.seat[at, i] = to
        move = best[gains] // search.seats
        turned = np.flatnonzero(move)
        if len(turned):
            self._move(at[turned], move[turned], np.ones(len(turned), dtype=np.int64))
        return np.asarray(gains)

    def turn_loops(self, which: Ints, least: float) -> Bools:
        """Loops changed as long as that gains, by each move to its minimum at once: where coordinates are
        wild, it can be 100,000 quanta away. (w,) which do."""
        change, q = self.search._moves[0], self.search.seats
        bend, turned = self.search._quadratic, np.zeros(len(which), dtype=bool)
        left = np.arange(len(which))
        while len(left):
            slope = 2 * self.gradient[which[left]][:, q:] @ change.T
            best = (slope + bend).argmin(axis=1)
            at = slope[np.arange(len(left)), best]
            gains = (at + bend[best] < -least) & (bend[best] > 0)
            left, best, at = left[gains], best[gains], at[gains]
            turned[left] = True
            self._move(which[left], best, np.maximum(1, np.rint(-at / (2 * bend[best]))).astype(np.int64))
        return np.asarray(turned)


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
    starts, refine: see ``ranked``. patience: numbers beyond the best at which it ends; None: only where there
    are enough, or ``rules.most``."""
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
        if least is not None and patience is not None and max(found) >= least.count + patience:
            break
        if least is not None and max(found) >= search.rules.enough and least.uncovered <= MUCH:
            break
    cones = state_of_cones(search)
    if cones is not None:
        one = search.proposal(cones)
        if one.count not in found or one.uncovered < found[one.count].uncovered:
            found[one.count] = one
    return [found[number] for number in sorted(found)]


def state_of_cones(search: Search) -> State | None:
    """Singularities at all cones that the surface has already, around which it may be flat: no search that
    adds one after the other comes to all of them. None where it has none, or the rules forbid them."""
    cone = search.model.cone
    if cone is None or not cone.any() or abs(cone).max() > search.rules.largest:
        return None
    seat = np.flatnonzero(cone)
    pairs = list(zip(seat.tolist(), cone[seat].tolist(), strict=True))
    state = State.of(pairs, (0,) * max(len(search.model.free) - 1, 0))
    return search.with_loops(state) if search.complete(state) else None


def ranked(search: Search, starts: int = STARTS, refine: bool = True) -> Iterator[list[State]]:
    """For 0, 1, 2, … seats taken the best states, the best first. starts: random ones for each number.
    refine: for the uncovered area, beyond the variance; without, they do not depend on the sizes."""
    rng = np.random.default_rng(17)
    kinds = [k for size in range(1, search.rules.largest + 1) for k in (-size, size)]
    beam = search.settled([State((), (), (0,) * max(len(search.model.free) - 1, 0))])
    for number in range(search.rules.most + 1):
        promising = PROMISING
        if number > search.rules.enough:
            starts, promising = min(starts, FEW), 1
        if number:
            added = search.additions([state for _, state in beam], kinds, TRIED)
            added = [one for one in added if search.count_of(one[1]) <= search.rules.most]
            beam = [
                one for group in _grouped(search, added, number) for one in _best(search, group, rng, starts)
            ]
        whole = [one for one in beam if search.complete(one[1])][:REFINED]
        if refine:
            whole = search.most_promising(whole, promising)
            whole = sorted(
                (search.refined(state) for _, state in whole), key=lambda one: (one[0], one[1].seat)
            )
        yield [state for _, state in whole]
        grouped = {state for _, state in beam[:BEAM]} | {state for _, state in whole[:1]}
        beam = [(search.value(state), state) for state in sorted(grouped, key=lambda state: state.seat)]


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
    likely = [state for _, state in sorted(added, key=lambda one: one[0])[: 2 * BEAM * TRIED]]
    tried = {state: value for value, state in search.settled(list(dict.fromkeys(likely)))}
    if not tried:
        return []
    if not search.complete(next(iter(tried))):  # on the way to a number only
        starts //= 4
    leading = min(tried, key=lambda state: (tried[state], state.seat))
    random = []
    for _ in range(starts):
        state = State((), (), leading.loops)
        for k in leading.index:
            clear = np.flatnonzero(search.open_seats(state, k))
            if len(clear):
                state = State.of([*state.pairs, (int(rng.choice(clear)), k)], state.loops)
        if len(state.seat) == len(leading.seat):
            random.append(state)
    if search.model.turn is not None:
        for part in (0.01, 0.1):
            search.direction = part * DIRECTION
            random = [state for _, state in search.settled(random)]
        search.direction = DIRECTION
    tried |= {state: value for value, state in search.settled(random)}
    ranked = sorted(((value, state) for state, value in tried.items()), key=lambda one: (one[0], one[1].seat))
    return ranked[:REFINED]
