"""Motions of the lattice: exact in integers, the same on floats, a group."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.pattern.lattice import LATTICES, Isometry
from hexwrap_solver.pattern.place.align import symmetry_centres

KINDS = st.sampled_from(list(LATTICES))
INTEGERS = st.integers(-50, 50)
POWERS = st.integers(-9, 9)


def a_motion(kind: str, turns: int, x: int, y: int) -> Isometry:
    lattice = LATTICES[kind]
    shift = x * lattice.basis[0] + y * lattice.basis[1]
    return Isometry(lattice, turns * (lattice.order // lattice.fold), (int(shift[0]), int(shift[1])))


@given(
    kind=KINDS, turns=st.integers(-12, 12), x=INTEGERS, y=INTEGERS, s=st.integers(-9, 9), r=st.integers(-9, 9)
)
@settings(max_examples=200, deadline=None)
def test_powers_are_a_group_and_agree_with_floats(kind, turns, x, y, s, r):
    motion = a_motion(kind, turns, x, y)
    lattice = motion.lattice
    points = np.random.default_rng(abs(x + 1000 * y)).integers(-99, 99, (20, 2))
    forth = motion.apply(points, np.full(20, s))
    assert (motion.apply(forth, np.full(20, r)) == motion.apply(points, np.full(20, s + r))).all()
    assert (motion.apply(forth, np.full(20, -s)) == points).all()
    np.testing.assert_allclose(
        motion.carry(lattice.position(points), np.full(20, s)), lattice.position(forth), atol=1e-9
    )
    once = np.exp(1j * lattice.quantum * turns) * lattice.position(points)
    once = once + lattice.position(np.array(motion.shift))
    np.testing.assert_allclose(lattice.position(motion.apply(points, np.full(20, 1))), once, atol=1e-9)


@given(kind=KINDS, turns=st.integers(-12, 12), x=INTEGERS, y=INTEGERS)
@settings(max_examples=100, deadline=None)
def test_motions_carry_nodes_to_nodes_and_links_to_links(kind, turns, x, y):
    motion = a_motion(kind, turns, x, y)
    lattice = motion.lattice
    grid = np.stack(np.meshgrid(np.arange(-6, 7), np.arange(-6, 7)), axis=-1).reshape(-1, 2)
    one = np.ones(len(grid), dtype=int)
    moved = motion.apply(grid, one)
    assert (lattice.is_node(moved) == lattice.is_node(grid)).all()
    nodes = grid[lattice.is_node(grid)]
    images = motion.apply(nodes, np.ones(len(nodes), dtype=int))
    np.testing.assert_allclose(
        motion.carry(lattice.stand(nodes), np.ones(len(nodes), dtype=int)), lattice.stand(images), atol=1e-9
    )
    for j in range(lattice.directions):
        has = lattice.has_edge(nodes, np.array(j))
        end = nodes + lattice.steps[j]
        assert lattice.is_node(end[has]).all()
        edge = lattice.stand(end[has]) - lattice.stand(nodes[has])
        np.testing.assert_allclose(edge, lattice.edge * lattice.headings[j], atol=1e-12)
        turned = (j + motion.rotation(np.array(1)) * lattice.steps_per_turn) % lattice.directions
        assert (lattice.has_edge(images, np.full(len(nodes), turned)) == has).all()


#: Corners of the cells around every node, and which cells there are per translation (Grünbaum and
#: Shephard 1987).
TILINGS = {
    "hex": ({(6, 6, 6)}, {6: 1}),
    "triangle": ({(3,) * 6}, {3: 2}),
    "quad": ({(4,) * 4}, {4: 1}),
    "diamond": ({(4,) * 4}, {4: 1}),
    "brick": ({(6, 6, 6)}, {6: 1}),
    "trihexagonal": ({(3, 6, 3, 6)}, {3: 2, 6: 1}),
    "truncated-hexagonal": ({(3, 12, 12)}, {3: 2, 12: 1}),
    "truncated-square": ({(4, 8, 8)}, {4: 1, 8: 1}),
    "rhombitrihexagonal": ({(3, 4, 6, 4)}, {3: 2, 4: 3, 6: 1}),
}


@pytest.mark.parametrize("kind", list(LATTICES))
def test_every_node_has_the_cells_of_the_tiling_around_it(kind):
    lattice = LATTICES[kind]
    configurations, cells = TILINGS[kind]
    grid = np.stack(np.meshgrid(np.arange(-6, 7), np.arange(-6, 7)), axis=-1).reshape(-1, 2)
    for node in grid[lattice.is_node(grid)]:
        steps = lattice.steps[lattice.has_edge(node, np.arange(lattice.directions))]
        around = [len(lattice.cell(node, step)) for step in steps]
        turns = [tuple(around[i:] + around[:i]) for i in range(len(around))]
        assert min(turns) in configurations
    area = sum(
        number * abs((o.conj() * np.roll(o, -1)).imag.sum()) / 2 * lattice.edge**2
        for o, number in ((lattice.outlines[p], number) for p, number in cells.items())
    )
    e1, e2 = lattice.position(lattice.basis)
    assert area == pytest.approx((np.conj(e1) * e2).imag)
    assert lattice.cell_area == pytest.approx(area / sum(cells.values()))


@pytest.mark.parametrize("kind", [kind for kind in LATTICES if kind != "brick"])
def test_cells_are_regular_polygons(kind):
    for p, outline in LATTICES[kind].outlines.items():
        edge = np.roll(outline, -1) - outline
        np.testing.assert_allclose(abs(edge), 1, atol=1e-12)
        np.testing.assert_allclose(np.roll(edge, -1) / edge, np.exp(2j * np.pi / p), atol=1e-12)


@pytest.mark.parametrize("kind", list(LATTICES))
@pytest.mark.parametrize("turns", [1, 2, 3, -1, -2, -5])
def test_symmetry_centres_are_fixed_and_as_many_as_the_motion_has(kind, turns):
    lattice = LATTICES[kind]
    zeta = np.exp(1j * lattice.step_angle * turns)
    if abs(zeta - 1) < 1e-9:
        pytest.skip("a translation")
    centres = symmetry_centres(lattice, turns)
    assert len(centres) == round(abs(1 - zeta) ** 2)
    for motion, centre in centres:
        assert motion.carry(np.array(centre), np.array(1)) == pytest.approx(centre)
        assert lattice.residue(np.array(motion.shift)) == 0


@pytest.mark.parametrize("kind", list(LATTICES))
@given(x=st.floats(-80, 80), y=st.floats(-80, 80))
@settings(max_examples=50, deadline=None)
def test_nearest_translation_is_nearest(kind, x, y):
    lattice = LATTICES[kind]
    found = complex(lattice.position(lattice.translation_near(complex(x, y))))
    for j in range(lattice.order):
        other = found + complex(lattice.position(lattice.rotate(lattice.basis[0], j)))
        assert abs(found - complex(x, y)) <= abs(other - complex(x, y)) + 1e-9


@pytest.mark.parametrize("kind", list(LATTICES))
@pytest.mark.parametrize("around", [8, 12, 48])
def test_ring_near_has_the_number_of_cells_asked_for(kind, around):
    lattice = LATTICES[kind]
    for angle in np.linspace(0, 2 * np.pi, 17):
        assert lattice.cells_around(lattice.ring_near(around, complex(np.exp(1j * angle)))) == around


@given(
    kind=KINDS, around=st.integers(1, 300), angle=st.floats(-4.0, 4.0), size=st.sampled_from([1e-9, 1.0, 1e9])
)
@settings(max_examples=200, deadline=None)
def test_ring_near_is_the_nearest_of_the_whole_ring(kind, around, angle, size):
    lattice = LATTICES[kind]
    direction = complex(size * np.exp(1j * angle))
    found = lattice.ring_near(around, direction)
    steps = np.arange(-around - 1, around + 2)
    near = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) @ lattice.basis
    ring = near[lattice.cells_around(near) == lattice.cells_around(found)]
    best = abs(np.angle(lattice.position(ring) / direction)).min()
    assert abs(np.angle(complex(lattice.position(found)) / direction)) <= best + 1e-12
