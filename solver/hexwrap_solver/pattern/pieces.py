"""Cells that features cut: their shapes in the lattice, and which two of them make a whole cell.

Every piece is seen from the fold: its side along it runs on the real axis, the piece above. Two pieces that
face each other there, and are as large as one cell together, are mates: halves of a panel that may be bent.
"""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Ints, Ragged, runs
from hexwrap_solver.geometry import outline_area
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.lay.cells import Cells
from hexwrap_solver.pattern.types import FoldPieces, PatternFeature
from hexwrap_solver.tolerances import TINY

#: Places in the lattice, edge 1, that differ by less are the same; areas, too.
SAME = 1e-6


def fold_pieces(
    lattice: Lattice,
    features: tuple[PatternFeature, ...],
    cells: Cells,
    corner: Ints,
    place: Complexes,
    whole: Bools,
) -> FoldPieces:
    """corner: vertex of the pattern at each corner of the cells; place: where it stands in the lattice, in
    the coordinates of its cell's first corner. whole: (c,) of the cells."""
    shape = cells.corner
    on_fold = _along(features, corner, corner[shape.next()]) & ~whole[shape.row]
    side = np.flatnonzero(on_fold)
    other = cells.twin[side]
    other = np.where((other >= 0) & on_fold[other], other, -1)
    place = place / lattice.edge
    step = place[shape.next()] - place
    pair = np.where(other >= 0, shape.row[side] * cells.n + shape.row[np.maximum(other, 0)], -1)
    once = np.unique(pair, return_inverse=True, return_counts=True)
    straight = once[2][once[1].ravel()] == 1  # a fold that turns inside a cell is not a hinge
    mated = (other >= 0) & straight & _makes_one(lattice, shape, place, side, np.maximum(other, 0))
    # Of several sides along folds the one across which its mate lies, then the longest, then the first.
    order = np.lexsort((side, -np.round(abs(step[side]), 6), ~mated, shape.row[side]))
    first = order[np.unique(shape.row[side][order], return_index=True)[1]]
    cell, chosen = shape.row[side][first], side[first]
    number = np.full(len(shape.values), -1, dtype=np.int64)
    number[chosen] = np.arange(len(chosen))
    mate = np.where(mated[first], number[np.maximum(other[first], 0)], -1)
    mate[(mate >= 0) & (mate[mate] != np.arange(len(mate)))] = -1
    return FoldPieces(cell, chosen - shape.offsets[cell], mate, _from_the_fold(shape, place, step, chosen))


def _along(features: tuple[PatternFeature, ...], start: Ints, end: Ints) -> Bools:
    """(k,) whether sides from one vertex of the pattern to another run along a feature."""
    none = np.zeros(0, dtype=np.int64)
    a = np.concatenate([none, *(f.vertices[:-1] for f in features), *(f.vertices[-1:] for f in features)])
    b = np.concatenate([none, *(f.vertices[1:] for f in features), *(f.vertices[:1] for f in features)])
    size = int(max(start.max(initial=0), a.max(initial=0))) + 1
    one, two = (np.minimum(x, y) * size + np.maximum(x, y) for x, y in ((start, end), (a, b)))
    return np.isin(one, two)


def _makes_one(lattice: Lattice, shape: Ragged, place: Complexes, side: Ints, other: Ints) -> Bools:
    """(k,) whether the pieces on both sides of a fold are as large as a cell together."""
    area = np.add.reduceat((place.conj() * place[shape.next()]).imag / 2, shape.offsets[:-1])
    both = area[shape.row[side]] + area[shape.row[other]]
    fits = np.zeros(len(side), dtype=bool)
    for outline in lattice.outlines.values():
        fits |= abs(both - outline_area(outline)) < SAME
    return fits


def _from_the_fold(shape: Ragged, place: Complexes, step: Complexes, side: Ints) -> Ragged:
    """The cells of the given sides, from these on, with them along the real axis about 0."""
    cell = shape.row[side]
    count = shape.lengths[cell]
    row, within = runs(count)
    at = shape.offsets[cell][row] + (side[row] - shape.offsets[cell][row] + within) % count[row]
    middle = place[side] + step[side] / 2
    along = step[side] / np.maximum(abs(step[side]), TINY)
    seen = (place[at] - middle[row]) / along[row]
    return Ragged.of(np.stack([seen.real, seen.imag], axis=-1), count)
