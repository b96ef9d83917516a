"""The seat of the lattice: of places and sizes that are left open, those at which whole cells cover most.

A translation of the plane that commutes with g, all of them on disks, flat rings and cylinders that are
aligned nowhere, those around on cylinders with rows along their ends, changes nothing but which cells the
boundary meets. A cell is whole where no point of the boundary is inside it, so that points along the boundary
tell of all places at once which cells are lost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, runs
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.geometry import outline_area, plane_areas
from hexwrap_solver.pattern.lattice import LATTICES, Isometry, Lattice
from hexwrap_solver.pattern.lay.nodes import lattice_points_in_triangles
from hexwrap_solver.pattern.place.placement import Placement
from hexwrap_solver.pattern.place.size import DEFAULT_CELLS, EDGES_PER_CELL, FREE
from hexwrap_solver.pattern.types import Kind, PatternSettings
from hexwrap_solver.surface.topology import next_half_edge
from hexwrap_solver.tolerances import RELATIVE, TINY

#: Of more cells the boundary takes too small a part to be worth a search.
MOST_CELLS = 2 * DEFAULT_CELLS
#: Sizes that are compared, beside the wanted one.
SIZES = 8


@dataclass(frozen=True)
class _Search:
    """places: to compare along both directions, or the only one. per_edge: points along the boundary per edge
    of a cell."""

    places: tuple[int, int]
    per_edge: int


#: For each size, and for the best.
ROUGH, FINE = _Search((6, 24), 5), _Search((12, 72), 12)
#: Points of the boundary stand on a grid of so many to a translation, a multiple of the places.
GRID = 72
#: Larger tables of cells are not made.
MOST_PLACES = 20_000_000
#: Points are taken this far aside, in translations: on edges of triangles or of the grid they would be on
#: either side by chance.
ASIDE = 1.37e-6 * (1 + 0.6j)
#: Other sizes may distort this much, or as much as the wanted one.
LITTLE = 0.01


@dataclass(frozen=True)
class _Seat:
    """A placement moved in the lattice's plane. margin: share of the surface without cells, in units of the
    part that one edge takes of the root of its area."""

    placement: Placement
    settings: PatternSettings
    shift: complex
    margin: float


def seated(
    cmap: ConformalMap,
    lattice: Lattice,
    settings: PatternSettings,
    edge: float,
    make: Callable[[PatternSettings], Placement],
    *,
    loops: list[int],
) -> Placement:
    """The placement of the seat that leaves the narrowest margin, where no size is asked for.

    make: a placement for a size. edge: the wanted length on the surface. loops: those on lattice lines.
    """
    unmoved = replace(settings, phase=(0.0, 0.0))
    plain = make(unmoved)
    cells = _cells(cmap, lattice, plain)
    if not cells <= MOST_CELLS or plain.motion is None:
        return make(settings)

    def seat(asked: PatternSettings, placement: Placement, search: _Search) -> _Seat:
        return _seat(cmap, lattice, asked, placement, search, loops=loops)

    seats = [seat(unmoved, plain, ROUGH)]
    least = np.clip(np.sqrt(cells / DEFAULT_CELLS), 1 - FREE, 1.0)
    for size in np.linspace(least, 1 + FREE, SIZES).tolist():
        asked = replace(unmoved, edge_length=edge * size)
        placement = make(asked) if any(plain.motion.shift) else replace(plain, place=plain.place / size)
        if placement.distortion <= max(LITTLE, plain.distortion):
            seats.append(seat(asked, placement, ROUGH))
    best = min(seats, key=lambda seat: round(seat.margin, 6))
    best = seat(best.settings, best.placement, FINE)
    placed = make(replace(best.settings, phase=settings.phase))
    return replace(placed, place=placed.place + best.shift)


def _seat(
    cmap: ConformalMap,
    lattice: Lattice,
    settings: PatternSettings,
    placement: Placement,
    search: _Search,
    *,
    loops: list[int],
) -> _Seat:
    """The best of so many places along the directions in which the placement is free."""
    motion = placement.motion
    assert motion is not None
    basis, counts = _directions(lattice, motion, search.places, loops=loops)
    covered = _covered(cmap, lattice, placement, basis, counts, loops, search.per_edge)
    best = int(np.argmax(covered.round(9)))
    b1, b2 = lattice.position(basis)
    shift = complex(b1 * (best // counts[1]) / counts[0] + b2 * (best % counts[1]) / counts[1])
    edges = float(np.sqrt(_cells(cmap, lattice, placement)))
    return _Seat(placement, settings, -shift, float(1 - covered[best]) * edges)


def _directions(
    lattice: Lattice, motion: Isometry, places: tuple[int, int], *, loops: list[int]
) -> tuple[Ints, tuple[int, int]]:
    """(2, 2) a basis of the translations, and how many places to try along each vector."""
    if motion.cone_index % lattice.order:
        return lattice.basis, (1, 1)
    if not loops:
        return lattice.basis, (places[0], places[0])
    along = lattice.primitive(np.array(motion.shift))
    every = np.array([x * lattice.basis[0] + y * lattice.basis[1] for x in (-1, 0, 1) for y in (-1, 0, 1)])
    cell = abs(np.linalg.det(lattice.basis))
    turned = every[:, 0] * along[1] - every[:, 1] * along[0]
    across = every[abs(abs(turned) - cell) < RELATIVE]
    return (np.stack([along, across[0]]), (places[1], 1)) if len(across) else (lattice.basis, (1, 1))


def _covered(
    cmap: ConformalMap,
    lattice: Lattice,
    placement: Placement,
    basis: Ints,
    counts: tuple[int, int],
    loops: list[int],
    per_edge: int,
) -> Floats:
    """(counts[0]·counts[1],) share of the surface on whole cells, by the place of the domain, moved back by
    parts of the basis."""
    corners = placement.glued.corners(cmap.surface.faces, placement.place)
    weight = cmap.surface.areas / np.maximum(plane_areas(corners), TINY)
    vectors = lattice.position(basis)
    to_basis = np.linalg.inv(np.stack([vectors.real, vectors.imag]))

    def coordinates(places: Complexes) -> Floats:
        places = places - ASIDE
        return np.asarray(np.stack([places.real, places.imag], axis=-1) @ to_basis.T)

    number, step = counts[0] * counts[1], GRID // np.array(counts)
    offset = np.stack(np.divmod(np.arange(number), counts[1]), axis=1) * step
    rim = np.unique(
        np.floor(coordinates(_rim(cmap, lattice, placement, corners, loops, per_edge)) * GRID), axis=0
    )
    point = rim.astype(np.int32)[:, None] - offset.astype(np.int32)
    block, at = np.divmod(point, np.int32(GRID))
    at = np.moveaxis(at, -1, 0)
    covered = np.zeros(number)
    for corner, (held, cell) in zip(
        lattice.every_cell, _grid(lattice.kind, *map(tuple, basis.tolist())), strict=True
    ):
        face, fine = lattice_points_in_triangles(coordinates(corners - corner.mean()) * counts, RELATIVE)
        if not len(face):
            continue
        part, inside = fine % np.array(counts), fine // np.array(counts)
        place, low = part[:, 0] * counts[1] + part[:, 1], inside.min(axis=0)
        span = inside.max(axis=0) - low + 1
        if number * int(span[0]) * int(span[1]) > MOST_PLACES:
            return np.zeros(number)
        row, where = np.nonzero(held[at[0], at[1]])
        gone = block[row, where] + cell[at[0][row, where], at[1][row, where]] - low
        met = ((gone >= 0) & (gone < span)).all(axis=1)
        whole = np.ones((number, *span), dtype=bool)
        whole[where[met], gone[met, 0], gone[met, 1]] = False
        kept = whole[place, inside[:, 0] - low[0], inside[:, 1] - low[1]]
        covered += outline_area(corner) * np.bincount(place[kept], weight[face[kept]], number)
    return covered / float(cmap.surface.areas.sum())


@cache
def _grid(kind: Kind, first: tuple[int, int], second: tuple[int, int]) -> list[tuple[Bools, Ints]]:
    """Of all cells up to translations, (GRID, GRID) which points of a grid over one translation they hold,
    and (GRID, GRID, 2) by which translation of the basis the cell that does is moved."""
    lattice, basis = LATTICES[kind], np.array([first, second])
    share = (np.arange(GRID) + 0.5) / GRID
    b1, b2 = lattice.position(basis)
    points = (share[:, None] * b1 + share * b2).ravel()
    found = []
    for corner in lattice.every_cell:
        middle = corner.mean()
        near = lattice.translations_near(points - middle)
        held = _depth(points - middle - lattice.position(near), corner - middle) > 0
        cell = np.rint(np.linalg.solve(basis.T.astype(float), near.T.astype(float)).T).astype(np.int64)
        found.append((held.reshape(GRID, GRID), cell.reshape(GRID, GRID, 2)))
    return found


def _rim(
    cmap: ConformalMap,
    lattice: Lattice,
    placement: Placement,
    corners: Complexes,
    loops: list[int],
    per_edge: int,
) -> Complexes:
    """(k,) points along the boundary but for those loops, and their images one turn further and back."""
    surface = cmap.surface
    on_line = np.zeros(len(surface.vertices), dtype=bool)
    for loop in loops:
        on_line[surface.loops[loop]] = True
    side = np.flatnonzero((surface.twin < 0) & ~on_line[surface.faces.ravel()])
    start, end = corners.ravel()[side], corners.ravel()[next_half_edge(side)]
    number = np.maximum(np.ceil(abs(end - start) * per_edge / lattice.edge).astype(np.int64), 1)
    row, step = runs(number)
    points: Complexes = np.asarray(start[row] + (end - start)[row] * (step / number[row]))
    fine = np.floor(np.stack([points.real, points.imag], axis=1) * (2 * per_edge / lattice.edge))
    points = points[np.unique(fine, axis=0, return_index=True)[1]]
    motion = placement.motion
    assert motion is not None
    if not motion.cone_index % lattice.order and not any(motion.shift):
        return np.asarray(points)
    turned: Complexes = lattice.carry(motion.power(np.array([-1, 1]))[:, None], points[None]).ravel()
    reach = EDGES_PER_CELL * lattice.edge
    low, high = corners.ravel().real, corners.ravel().imag
    near = (abs(turned.real - (low.max() + low.min()) / 2) < np.ptp(low) / 2 + reach) & (
        abs(turned.imag - (high.max() + high.min()) / 2) < np.ptp(high) / 2 + reach
    )
    return np.asarray(np.concatenate([points, turned[near]]))


def _depth(points: Complexes, outline: Complexes) -> Floats:
    """(n,) how far inside a convex polygon around 0."""
    edge = np.roll(outline, -1) - outline
    normal = -1j * edge / abs(edge)
    away = (normal.conj() * outline).real
    return np.asarray((away - (normal.conj() * points[:, None]).real).min(axis=1))


def _cells(cmap: ConformalMap, lattice: Lattice, placement: Placement) -> float:
    corners = placement.glued.corners(cmap.surface.faces, placement.place)
    with np.errstate(over="ignore", invalid="ignore"):  # of a map that spans more than numbers do
        return float(plane_areas(corners).sum()) / lattice.cell_area
