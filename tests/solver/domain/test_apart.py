"""Domains that overlap themselves are taken apart for drawings; all others stay in one piece."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.domain import lift
from hexwrap_solver.domain.apart import apart
from tests.solver.conformal.annuli import bump, corners_at


@pytest.fixture(scope="module")
def twice_around() -> ConformalMap:
    """A tower unrolled to a ring of 4π."""
    surface = bump(32, 16)
    ends = np.concatenate([loop[::4][:6] for loop in surface.loops])
    angles = np.repeat([1 / 3, 5 / 3], 6) * np.pi
    return conformal_map(surface, corners_at(surface.input_vertex[ends], angles))


def triangles(cmap: ConformalMap) -> np.ndarray:
    return shapely.polygons(np.stack([cmap.corners().real, cmap.corners().imag], axis=-1))


def test_no_piece_overlaps_itself_or_another(twice_around: ConformalMap) -> None:
    assert twice_around.deck.angle == pytest.approx(4 * np.pi)
    pieces = apart(twice_around)
    assert pieces is not None
    assert 1 < len(pieces.shift) < 8
    drawn = triangles(pieces.moved(twice_around))
    together, single = shapely.union_all(drawn).area, shapely.area(drawn).sum()
    assert together == pytest.approx(single, rel=1e-2)
    assert shapely.union_all(triangles(twice_around)).area < 0.95 * single


def test_pieces_are_only_moved(twice_around: ConformalMap) -> None:
    pieces = apart(twice_around)
    assert pieces is not None
    shift = pieces.moved(twice_around).corners() - twice_around.corners()
    for piece in range(len(pieces.shift)):
        assert np.ptp(shift[pieces.piece == piece].real) < 1e-9
        assert np.ptp(shift[pieces.piece == piece].imag) < 1e-9


def test_on_the_pieces_every_place_is_lifted_to_its_own_point(twice_around: ConformalMap) -> None:
    pieces = apart(twice_around)
    assert pieces is not None
    drawn = pieces.moved(twice_around)
    found = lift(drawn, drawn.corners().mean(axis=1))
    assert np.count_nonzero(found.face != np.arange(len(found.face))) < 0.01 * len(found.face)


def test_what_does_not_overlap_stays_in_one_piece() -> None:
    surface = bump(24, 12)
    for mode in ("straight", "isometric"):
        assert apart(conformal_map(surface, BoundaryCondition(mode, quantum="hex"))) is None
