"""Openings: filled smoothly, mapped as wall, and cut out again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.arrays import Bools, Ragged
from hexwrap_solver.conformal import boundary, conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.surface import surface_from_mesh, with_openings
from hexwrap_solver.surface.holes import fill_openings
from hexwrap_solver.surface.types import SentMesh, Surface
from tests.solver.conformal.annuli import bump
from tests.solver.conformal.nets import CENTRES, SPHERE, check, holed, sent

TOWER = bump(48, 20)


def windows(count: int, width: int = 4, height: int = 4) -> Surface:
    """The tower with so many windows, evenly around it."""
    column, row = TOWER.faces % 48, TOWER.faces // 48
    left = np.where(np.ptp(column, axis=1) > 24, 47, column.min(axis=1))
    low = row.min(axis=1)
    away: Bools = np.zeros(len(TOWER.faces), dtype=bool)
    for k in range(count):
        first = k * 48 // count + 1
        away |= (left >= first) & (left < first + width) & (low >= 8) & (low < 8 + height)
    return sent(TOWER.vertices, TOWER.faces[~away])


@settings(max_examples=8, deadline=None)
@given(st.integers(1, 8), st.integers(1, 5), st.integers(1, 8))
def test_the_fill_is_smooth_and_manifold(count: int, width: int, height: int) -> None:
    """A window is filled to within a tenth of an edge of the wall that was there."""
    surface = with_openings(windows(count, width, height), "cut")
    assert surface.openings == count
    filled = fill_openings(surface)
    again = sent(filled.vertices, filled.faces)  # the intake's checks
    assert len(again.loops) == 2 == len(filled.loops)
    assert np.array_equal(filled.faces[: len(surface.faces)], surface.faces)
    new = filled.vertices[len(surface.vertices) :]
    if len(new):
        assert TOWER.tree.nearest(new).distance.max() < 0.1 * TOWER.lengths.mean()


@pytest.mark.parametrize("mode", ["straight", "isometric"])
def test_the_map_beside_a_window_is_what_it_would_be_without(mode: str) -> None:
    asked = BoundaryCondition(mode, quantum="hex")  # type: ignore[arg-type]
    surface = with_openings(windows(6), "cut")
    found, whole = conformal_map(surface, asked), conformal_map(TOWER, asked)
    check(found)
    assert found.surface is surface
    assert found.kind == whole.kind
    assert (found.cones.vertex == whole.cones.vertex).all()
    there = whole.log_scale[surface.input_vertex]
    assert np.abs(found.log_scale - there).max() < 0.02
    for angles in found.boundary_angles[2:]:
        assert float((np.pi - angles).sum()) == pytest.approx(-2 * np.pi, abs=1e-9)
    assert "6 openings" in found.notes[0]


def test_a_window_that_does_not_lie_flat() -> None:
    """A ring-like hole around most of the tower: no plane shows it without overlap."""
    surface = with_openings(windows(1, 40, 2), "cut")
    found = conformal_map(surface, BoundaryCondition("straight"))
    check(found)
    assert len(found.surface.loops) == 3


def test_with_loops_the_openings_are_boundaries() -> None:
    surface = with_openings(windows(3), "loop")
    found = conformal_map(surface, BoundaryCondition("straight", quantum="hex"))
    check(found)
    assert found.kind == "net"
    sums = [boundary.cone_angle(angles) for angles in found.boundary_angles]
    assert sums == pytest.approx([0, 0, *[-2 * np.pi] * 3], abs=1e-8)


def test_a_dome_keeps_its_longest_two_loops() -> None:
    surface = with_openings(holed(SPHERE, CENTRES[:4], 0.35), "cut")
    found = conformal_map(surface, BoundaryCondition("isometric", quantum="hex"))
    check(found)
    assert found.kind in ("cylinder", "cone")
    assert len(found.surface.loops) == 4


def test_no_edge_of_a_fill_is_one_of_the_surface_already():
    """The loop a, b, c, d is that of a quad of two triangles, whose diagonal must not be a second time in
    the fill; the inner loop is that of a hole in one of them."""
    outer = [[0.5, 0, 0], [1, -1.5, 0.2], [1.5, 0, 0], [1, 1.5, 0.2]]
    vertices = [*outer, [0.85, -0.3, 0], [1.15, -0.3, 0], [1, -0.6, 0]]
    a, b, c, d, x, y, z = range(7)
    faces = [[a, c, d], [a, x, y], [a, y, c], [c, y, z], [c, z, b], [b, z, x], [b, x, a]]
    faces = [face[::-1] for face in faces]
    surface = surface_from_mesh(SentMesh(np.array(vertices, float), Ragged.from_table(np.array(faces))))
    inner, outer = sorted(surface.loops, key=len)
    filled = fill_openings(replace(surface, loops=(inner, outer), openings=1))
    sides = np.sort(
        np.stack([filled.faces, np.roll(filled.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1
    )
    counts = np.unique(sides, axis=0, return_counts=True)[1]
    assert sorted(counts)[:3] == [1, 1, 1]
    assert (np.sort(counts)[3:] == 2).all()


def test_an_opening_that_is_longer_than_an_end_is_told() -> None:
    """Openings are the loops beyond the two longest, whatever they look like."""
    mast = bump(24, 60)
    column, row = mast.faces % 24, mast.faces // 24
    low, high = column.min(axis=1), column.max(axis=1)
    slot = (low >= 3) & (high <= 9) & (row.min(axis=1) >= 5) & (row.max(axis=1) <= 55)
    tall = sent(mast.vertices * [1, 1, 12], mast.faces[~slot])
    told = with_openings(tall, "cut").repairs
    assert sum("was filled in its stead" in note for note in told) == 1
    for fine in (windows(6), holed(SPHERE, CENTRES[:4], 0.35)):
        assert with_openings(fine, "cut").repairs == fine.repairs
    assert with_openings(tall, "loop").repairs == tall.repairs
