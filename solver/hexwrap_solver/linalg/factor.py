"""Sparse Cholesky factorisation by dense fronts (multifrontal method, Duff and Reid 1983; Liu 1992).

Every node of the dissection tree eliminates its unknowns in one dense matrix, the front, with LAPACK, and
hands what is left (the update) to its parent. The symbolic analysis is done once per pattern. It needs
nothing but NumPy and SciPy: the arithmetic is in BLAS, with a few short Python steps per front of some fifty
unknowns. Analysis and first factorisation, which is what a new mesh costs, take 1.6 and 1.05 times as long
as in CHOLMOD and 0.5 times as long as in MKL PARDISO, at 20,000 and 200,000 vertices (``benchmarks/map.py``);
SciPy's own SuperLU takes 2.6 and 5.4 times as long.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg.blas import dgemv, dsyrk, dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf

from hexwrap_solver.arrays import Floats, Ints, positions
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.linalg.dissection import Dissection, dissect
from hexwrap_solver.linalg.workspace import borrow

#: Blocks of at least this many entries are added run by run, where their places come in few runs without
#: holes: the index arrays of that many single entries would not stay in the processor's cache.
LARGE = 8000
#: Adding one slice costs as much as adding this many entries one by one.
ENTRIES_PER_SLICE = 600
#: A factor of more numbers than this, for all and for each unknown, is not begun: meshes of a surface need
#: some 60 for each of a million vertices.
MOST, MOST_EACH = 50_000_000, 300


class _Front(NamedTuple):
    """first, last: own unknowns in elimination order. boundary: unknowns of ancestors that they touch.
    offset: of the own block (k × k, then b × k) in the factor. children: their numbers, none at a leaf.
    into_own, into_rest: where the boundary goes in the parent's own unknowns and in its boundary.
    stack, update: which of the two stacks holds the update, and where in it."""

    first: int
    last: int
    boundary: Ints
    offset: int
    children: tuple[int, ...]
    into_own: Ints
    into_rest: Ints
    stack: int
    update: int


class _Blocks(NamedTuple):
    """Views of a front's own (k, k) and rest (b, k) part of the factor, and of its update (b, b). They are
    stored by columns: row i of each array here is column i."""

    own: Floats
    rest: Floats
    update: Floats


class Factorisation:
    """Solves A x = b for symmetric positive definite A of a fixed pattern."""

    def __init__(self, points: Floats, rows: Ints, columns: Ints) -> None:
        """points: (n, 3) see ``dissect``. rows, columns: (e,) off-diagonal entries, each pair once."""
        self.n = len(points)
        tree = dissect(points, rows, columns)
        self._order = tree.order
        place = positions(tree.order, self.n)
        one, other = place[rows], place[columns]
        low, high = np.minimum(one, other), np.maximum(one, other)
        self._fronts, visits, stacks = _analyse(tree, low, high)
        size, self._diagonal_at, self._off_diagonal_at = self._addresses(low, high)
        needed = size + sum(stacks)
        if needed > MOST + MOST_EACH * self.n:
            raise ConvergenceError(
                f"The equations of {self.n} unknowns would take {8e-9 * needed:.1f} GB to solve: the mesh "
                "joins distant places by single edges or vertices; remesh it more evenly."
            )
        memory = borrow(needed, self)
        self._factor, *self._stacks = np.split(memory, np.cumsum([size, *stacks])[:-1])
        self._visits = visits
        self._blocks = [self._block(front) for front in self._fronts]
        self._steps = [
            (front.first, front.last, front.boundary, own.T, rest.T)
            for front, (own, rest, _) in zip(self._fronts, self._blocks, strict=True)
            if own.size
        ]

    def _addresses(self, low: Ints, high: Ints) -> tuple[int, Ints, Ints]:
        """Length of the factor, and where the matrix entries go in it."""
        fronts = self._fronts
        size = np.array([f.last - f.first for f in fronts])
        below = np.array([len(f.boundary) for f in fronts])
        owner = np.repeat(np.arange(len(fronts)), size)
        k, offset = size[owner], np.array([f.offset for f in fronts])[owner]
        own = np.arange(self.n) - np.array([f.first for f in fronts])[owner]
        column = offset + own * k  # where an unknown's column of the own block begins
        at = column[low] + own[high]
        out = np.flatnonzero(owner[low] != owner[high])
        from_, to = low[out], high[out]
        # boundary entry of (front, unknown): one search over all fronts at once
        keys = np.repeat(np.arange(len(fronts)), below) * self.n
        keys += np.concatenate([f.boundary for f in fronts])
        base = np.cumsum(below) - below
        column_below = offset + k**2 + own * below[owner] - base[owner]
        at[out] = column_below[from_] + np.searchsorted(keys, owner[from_] * self.n + to)
        last = fronts[-1]  # the root has no boundary
        return last.offset + (last.last - last.first) ** 2, column + own, at

    def _block(self, front: _Front) -> _Blocks:
        k, b = front.last - front.first, len(front.boundary)
        middle, stack = front.offset + k * k, self._stacks[front.stack]
        return _Blocks(
            self._factor[front.offset : middle].reshape(k, k),
            self._factor[middle : middle + k * b].reshape(k, b),
            stack[front.update : front.update + b * b].reshape(b, b),
        )

    def factorise(self, diagonal: Floats, off_diagonal: Floats) -> None:
        """Takes new values. Raises np.linalg.LinAlgError where A is not positive definite."""
        factor = self._factor
        factor.fill(0.0)
        factor[self._diagonal_at] = diagonal[self._order]
        factor[self._off_diagonal_at] = off_diagonal
        with np.errstate(over="ignore", invalid="ignore"):  # in upper halves, which hold old values
            self._eliminate()

    def _eliminate(self) -> None:
        for i in self._visits:
            front, (own, rest, update) = self._fronts[i], self._blocks[i]
            for child in front.children:
                self._add_above(self._fronts[child], self._blocks[child].update, own, rest)
            if own.size:
                _, info = dpotrf(own.T, lower=1, clean=0, overwrite_a=1)
                if info:
                    raise np.linalg.LinAlgError("matrix is not positive definite")
            if rest.size:
                dtrsm(1.0, own.T, rest.T, side=1, lower=1, trans_a=1, overwrite_b=1)
                # The upper half of an update is never read.
                dsyrk(-1.0, rest.T, beta=0.0, c=update.T, lower=1, overwrite_c=1)
            else:
                update.fill(0.0)
            for child in front.children:
                below = self._fronts[child]
                s, at = len(below.into_own), below.into_rest
                _add(update, at, at, self._blocks[child].update[s:, s:])

    def _add_above(self, child: _Front, update: Floats, own: Floats, rest: Floats) -> None:
        """What a child's update adds to the factor of the front above."""
        at, s = child.into_own, len(child.into_own)
        _add(own, at, at, update[:s, :s])
        _add(rest, at, child.into_rest, update[:s, s:])

    def solve(self, right: Floats) -> Floats:
        """(n,) right-hand side → solution; or (n, k), k of each, for a fraction of k times the time."""
        x = right[self._order]
        if right.ndim == 2:
            self._solve_all(x)
        else:
            self._solve_one(x)
        result = np.zeros_like(x)
        result[self._order] = x
        return result

    def _solve_one(self, x: Floats) -> None:
        for first, last, boundary, own, rest in self._steps:
            x[first:last] = part = dtrsv(own, x[first:last], lower=1)
            if rest.size:
                x[boundary] -= dgemv(1.0, rest, part)
        for first, last, boundary, own, rest in reversed(self._steps):
            part = x[first:last]
            if rest.size:
                part = part - dgemv(1.0, rest, x[boundary], trans=1)
            x[first:last] = dtrsv(own, part, lower=1, trans=1)

    def _solve_all(self, x: Floats) -> None:
        """The same for the columns of x. BLAS wants them one after the other: Xᵀ Lᵀ = Bᵀ and Xᵀ L = Bᵀ."""
        for first, last, boundary, own, rest in self._steps:
            x[first:last] = part = dtrsm(1.0, own, x[first:last].T, side=1, lower=1, trans_a=1).T
            if rest.size:
                x[boundary] -= rest @ part
        for first, last, boundary, own, rest in reversed(self._steps):
            part = x[first:last]
            if rest.size:
                part = part - rest.T @ x[boundary]
            x[first:last] = dtrsm(1.0, own, part.T, side=1, lower=1).T


def _add(target: Floats, columns: Ints, rows: Ints, source: Floats) -> None:
    """target[columns, rows] += source, blocks whose places ascend; of square blocks the lower half at least.

    ``a[at] = a.take(at) + b`` is three times as fast as ``a[columns, rows] += b``.
    """
    if source.size >= LARGE:
        across, down = _runs(columns), _runs(rows)
        if len(across) * len(down) * ENTRIES_PER_SLICE <= source.size:
            for to, column in across:
                for below, row in down:
                    target[to, below] += source[column, row]
            return
    at = (target.shape[1] * columns)[:, None] + rows
    flat = target.reshape(-1)
    flat[at] = flat.take(at) + source


def _runs(places: Ints) -> list[tuple[slice, slice]]:
    """Ascending places cut into runs without holes: pairs of slices (of the target, of the source)."""
    if not len(places):
        return []
    breaks = np.flatnonzero(places[1:] != places[:-1] + 1) + 1
    bounds = [0, *breaks.tolist(), len(places)]
    first = places[bounds[:-1]].tolist()
    return [
        (slice(to, to + b - a), slice(a, b)) for to, a, b in zip(first, bounds[:-1], bounds[1:], strict=True)
    ]


def _distinct(keys: Ints) -> Ints:
    """Sorted, each once; ``np.unique`` takes ten times as long for many integers, since it hashes them."""
    keys = np.sort(keys)
    first = np.ones(len(keys), dtype=bool)
    first[1:] = keys[1:] != keys[:-1]
    return np.asarray(keys[first])


def _analyse(tree: Dissection, low: Ints, high: Ints) -> tuple[list[_Front], list[int], list[int]]:
    """Fronts in elimination order (deepest level first), with the boundaries that elimination creates; the
    order in which to visit them; and the sizes of the two stacks of updates.

    Node k of the tree has the front nodes − 1 − k, so that children come before parents and front i's own
    unknowns are [start[i], start[i + 1]) in the order of elimination. Eliminating them joins all unknowns
    that they touch and that are not eliminated yet: the front's boundary. By the choice of separators
    these lie in ancestors of the node. So

        boundary(i) = (neighbours of own(i) in the matrix  ∪  boundaries of both children)  −  own(i),

    which is found level by level, for all fronts of a level at once: a set of pairs (front, unknown) is one
    sorted array of keys front · n + unknown; the union sorts two such arrays together and drops what occurs
    twice. What a front hands on to its parent are the keys whose unknown the parent does not own, with the
    parent's number in front. An entry of the matrix between unknowns low < high belongs to the front that
    owns low; it starts a boundary entry where another front owns high. (The entries of one front's own
    block need no key: the block is dense.)

    Of each front's boundary, those owned by the parent come first, as its unknowns are eliminated before
    all of its own boundary: so one number, ``split``, says where the part that goes into the parent's own
    rows (``into_own``) ends and the part that goes into its boundary (``into_rest``) begins.
    """
    n = len(tree.order)
    nodes = len(tree.start) - 1
    size = np.diff(tree.start)
    position = np.repeat(np.arange(nodes), size)  # of the front that owns an unknown
    keys = _distinct((position[low] * n + high)[position[low] != position[high]])
    found = []  # per level: sorted keys front · n + boundary unknown
    carried = np.zeros(0, dtype=np.int64)
    for level in range(tree.depth, -1, -1):
        start, stop = nodes - 2 ** (level + 1) + 1, nodes - 2**level + 1
        from_, to = np.searchsorted(keys, [start * n, stop * n])
        level_keys = _distinct(np.concatenate([keys[from_:to], carried]))
        found.append(level_keys)
        front, unknown = level_keys // n, level_keys % n
        parent = nodes - 1 - (nodes - 2 - front) // 2
        onwards = position[unknown] != parent
        carried = (parent * n + unknown)[onwards]
    every = np.concatenate(found)
    front, unknown = every // n, every % n
    begin = np.searchsorted(front, np.arange(nodes + 1))
    parent = np.append(nodes - 1 - (nodes - 2 - np.arange(nodes - 1)) // 2, -1)
    to_own = position[unknown] == parent[front]
    within = unknown - tree.start[parent[front]]
    in_rest = np.searchsorted(every, parent[front] * n + unknown) - begin[parent[front]]
    split = begin[:-1] + np.bincount(front, weights=to_own, minlength=nodes).astype(np.int64)
    offset = np.concatenate([[0], np.cumsum(size * (size + np.diff(begin)))])
    visits, stack, update, sizes = _stacked(np.diff(begin))
    fronts = [
        _Front(
            int(tree.start[i]),
            int(tree.start[i + 1]),
            unknown[begin[i] : begin[i + 1]],
            int(offset[i]),
            _children(i, nodes),
            within[begin[i] : split[i]],
            in_rest[split[i] : begin[i + 1]],
            stack[i],
            update[i],
        )
        for i in range(nodes)
    ]
    return fronts, visits, sizes


def _children(i: int, nodes: int) -> tuple[int, ...]:
    """Numbers of the two fronts below front i (node nodes − 1 − i of the tree)."""
    left = 2 * (nodes - 1 - i) + 1
    return (nodes - 1 - left, nodes - 2 - left) if left < nodes else ()


def _stacked(b: Ints) -> tuple[list[int], list[int], list[int], list[int]]:
    """Fronts visited children first, left before right, so that only the updates along one way up wait. A
    front's update and those of its children are needed at once, so levels take turns on two stacks: what is
    pushed on one lies above all that still waits there.

    Returns the visits, and per front its stack and its update's place; and the size of both stacks.
    """
    nodes = len(b)
    area = (b * b).tolist()
    visits: list[int] = []
    stack, update = [0] * nodes, [0] * nodes
    top, most = [0, 0], [0, 0]

    def visit(i: int, level: int) -> None:
        children = _children(i, nodes)
        for child in children:
            visit(child, level + 1)
        if children:
            top[(level + 1) % 2] = update[children[0]]
        mine = level % 2
        stack[i], update[i] = mine, top[mine]
        top[mine] += area[i]
        most[mine] = max(most[mine], top[mine])
        visits.append(i)

    visit(nodes - 1, 0)
    return visits, stack, update, most
