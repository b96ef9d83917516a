"""Closing is exact: whatever stands around singularities and loops is a symmetry of one lattice."""

from functools import partial

import numpy as np
import pytest

from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.fixed import minimise
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.singularities.close import Chart, Closing, Line, as_complex, near_lattice
from hexwrap_solver.singularities.cut import branches
from hexwrap_solver.singularities.drag import dragged, grips, refined
from hexwrap_solver.singularities.linear import targets, vertex_areas
from hexwrap_solver.singularities.place import place
from hexwrap_solver.singularities.solvable import solvable
from hexwrap_solver.singularities.types import Rules
from tests.solver.singularities import shapes

SIXTH = np.pi / 3
EDGE = Line(1 + np.exp(1j * SIXTH), 0.0, 0.5)
VERTEX = Line(1.0 + 0j, 0.5 / np.sqrt(3), np.sqrt(3) / 2)


def closing(surface, ends, cells, count, quantum=SIXTH, line=None, slope=None):
    width = float(np.sqrt(2 / np.sqrt(3) * vertex_areas(surface).sum() / cells))
    rules = Rules(quantum, width, 11, ends, most=max(count, 1))
    proposal = place(surface, rules, count).proposals[-1]
    assert proposal.count == count
    finer = refined(surface, surface.vertices[proposal.vertex], width)
    chart = Chart(finer, proposal.vertex, proposal.index, proposal.loops, ends, quantum, width)
    return chart, Closing(chart, width, line)


CASES = {
    "tube": (shapes.waist, ("free", "free"), 500, 4, SIXTH),
    "two": (shapes.waist, ("free", "free"), 300, 2, SIXTH),
    "quads": (shapes.waist, ("free", "free"), 400, 2, np.pi / 2),
    "dome": (shapes.dome, ("free",), 300, 2, SIXTH),
    "closed": (shapes.ellipsoid, (), 250, 12, SIXTH),
}


@pytest.fixture(scope="module", params=CASES)
def case(request):
    make, ends, cells, count, quantum = CASES[request.param]
    chart, newton = closing(make(), ends, cells, count, quantum)
    return chart, newton, newton.solve()


def lattice_corners(chart, closed):
    return closed.factor * closed.seen.place.T + closed.shift


def test_closes_to_rounding(case):
    _, _, closed = case
    assert closed.residual <= 1e-9


def test_singularities_move_by_less_than_a_cell(case):
    chart, _, closed = case
    assert closed.moves.max() < 0.9
    before = chart.surface.vertices[chart.cones]
    after = closed.seen.surface.vertices[chart.cones]
    assert np.linalg.norm(after - before, axis=1).max() < 0.9 * chart.cell


def test_every_edge_is_crossed_by_a_symmetry_of_the_lattice(case):
    chart, newton, closed = case
    place, twin = lattice_corners(chart, closed).ravel(), chart.surface.twin
    inner = np.flatnonzero(twin >= 0)
    following = np.where(inner % 3 == 2, inner - 2, inner + 1)
    across = twin[inner]
    across_next = np.where(across % 3 == 2, across - 2, across + 1)
    here, there = place[following] - place[inner], place[across] - place[across_next]
    turn = np.angle(here / there) / chart.quantum
    assert np.abs(turn - np.rint(turn)).max() < 1e-9
    rho = np.exp(1j * chart.quantum * np.rint(turn))
    shift = place[inner] - rho * place[across_next]
    assert np.abs(shift - as_complex(near_lattice(shift, newton.order), newton.order)).max() < 1e-8


def test_angles_at_singularities(case):
    chart, _, closed = case
    place, faces = closed.seen.place.T, chart.surface.faces
    one, two = np.roll(place, -1, axis=1) - place, np.roll(place, -2, axis=1) - place
    sums = np.bincount(faces.ravel(), np.angle(two / one).ravel())
    wanted = np.full(len(sums), 2 * np.pi)
    wanted[chart.cones] -= chart.quantum * chart.index
    rim = np.zeros(len(sums), dtype=bool)
    for loop in chart.surface.loops:
        rim[loop] = True
    assert np.abs(sums - wanted)[~rim].max() < 1e-9


def test_triangles_stay_upright(case):
    _, _, closed = case
    a, b, c = closed.seen.place
    assert (((b - a).conj() * (c - a)).imag > 0).all()


def test_singularities_stand_on_cells(case):
    chart, newton, closed = case
    corner = chart.surface.faces.ravel()
    place = lattice_corners(chart, closed).ravel()
    for cone in chart.cones:
        at = place[corner == cone]
        assert np.abs(at - as_complex(near_lattice(at, newton.order), newton.order)).max() < 1e-8


@pytest.mark.parametrize("line", [EDGE, VERTEX])
def test_a_straight_loop_becomes_a_lattice_line(line):
    _, newton = closing(shapes.waist(), ("straight", "free"), 300, 2, line=line)
    closed = newton.solve()
    assert closed.residual <= 1e-9
    depth = newton.depth(closed.seen.holonomy, closed.factor)
    rows = (depth - line.first) / line.period
    assert np.abs(rows - np.rint(rows)).max() < 1e-8
    number = as_complex(closed.motion[-2], 6) / line.step
    sixth = number / np.exp(1j * SIXTH * np.rint(np.angle(number) / SIXTH))
    assert sixth == pytest.approx(round(sixth.real), abs=1e-9)


def test_cuts_leave_a_disk():
    surface = shapes.waist()
    cut = branches(surface, 600, np.array([340, 700]), tuple(surface.loops))
    joined = (cut.twin >= 0).sum() // 2
    edges = (surface.twin >= 0).sum() // 2
    assert edges - joined == len(cut.edges)
    assert {len(way) > 0 for way in cut.ways} == {True}
    ends = np.concatenate([np.array([340, 700]), *surface.loops])
    tails = surface.faces.ravel()[cut.edges]
    assert np.isin(tails, ends).sum() == 4  # every leaf ends one way, and none runs through one


def test_dragging_leaves_the_rest_alone():
    surface = shapes.waist()
    hold = grips(surface, np.array([600]), 0.5)
    moved = dragged(surface, hold, np.array([[0.2, 0.1]]))
    far = np.setdiff1d(np.arange(len(surface.vertices)), hold[0].vertex)
    assert (moved.vertices[far] == surface.vertices[far]).all()
    assert np.linalg.norm(moved.vertices[600] - surface.vertices[600]) == pytest.approx(
        np.hypot(0.2, 0.1), rel=0.2
    )
    assert moved.input_vertex[600] == -1
    assert (moved.input_vertex[far] == surface.input_vertex[far]).all()
    assert np.abs(surface.tree.nearest(moved.vertices[[600]]).distance).max() < 1e-12


def test_finer_near_places_and_the_same_surface():
    surface = shapes.waist()
    finer = refined(surface, surface.vertices[[600]], 0.5)
    assert len(finer.vertices) > len(surface.vertices)
    assert (finer.vertices[: len(surface.vertices)] == surface.vertices).all()
    assert vertex_areas(finer).sum() == pytest.approx(vertex_areas(surface).sum())
    assert all((one == two).all() for one, two in zip(finer.loops, surface.loops, strict=True))


def test_says_when_there_is_no_map():
    surface = shapes.straight()
    with pytest.raises(ConvergenceError, match="no map"):
        Chart(surface, np.array([300]), np.array([6]), (-6, 0), ("free", "free"), SIXTH, 0.5)


def test_a_mesh_whose_triangles_break_is_split():
    """Its long thin triangles cannot follow the map; the surface stays the same set of points."""
    surface = shapes.slivers()
    wanted = partial(
        targets,
        ends=("free", "free"),
        loops=(2, 0),
        quantum=SIXTH,
        vertex=np.array([300]),
        index=np.array([-2]),
    )
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        assert minimise(Energy(surface, wanted(surface))).violating
    energy, finer, found = solvable(surface, wanted)
    assert found.converged
    assert not found.violating
    assert len(finer.vertices) < 3 * len(surface.vertices)
    assert (finer.vertices[: len(surface.vertices)] == surface.vertices).all()
    assert vertex_areas(finer).sum() == pytest.approx(vertex_areas(surface).sum())
    sums = energy.angle_sums(found.corners)
    assert sums[300] == pytest.approx(2 * np.pi + 2 * SIXTH, abs=1e-8)


def test_singularities_that_shut_each_other_off_are_told():
    """As on an icosahedron whose vertices are all singular."""
    surface = shapes.waist()
    ring = np.unique(surface.faces[(surface.faces == 600).any(axis=1)])
    leaves = ring[ring != 600]
    with pytest.raises(ConvergenceError, match="too coarse"):
        branches(surface, 600, np.append(leaves, 340), tuple(surface.loops))
