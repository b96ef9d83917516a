"""What must not change the map, what it must be exactly, and how fast it converges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal import boundary, conformal_map
from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap, Deck
from hexwrap_solver.surface.types import Surface
from tests.solver.conformal.annuli import (
    bump,
    catenoid,
    corners_at,
    flat_cone,
    grid,
    irregular,
    prism,
    revolution,
    ring,
    uneven,
)
from tests.solver.conformal.test_conformal_map import assert_honest

TOWER = bump(28, 12)
FAR = np.array([1e9, -1e9, 1e9])
seeds = st.integers(0, 2**32 - 1)
conditions = st.sampled_from(
    [
        BoundaryCondition(),
        corners_at(
            np.array([3, int(TOWER.loops[1][5])]),
            np.array([2 * np.pi / 3, 4 * np.pi / 3]),
        ),
    ]
)
isometric_conditions = st.sampled_from(
    [
        BoundaryCondition("isometric"),
        BoundaryCondition("isometric", quantum="hex"),
        BoundaryCondition("isometric", quantum="hex", spread="optimal"),
    ]
)


def rotation(random: np.random.Generator) -> Floats:
    q = np.linalg.qr(random.standard_normal((3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


def assert_same_domain(one: ConformalMap, other: ConformalMap, tolerance: float = 1e-9) -> None:
    """Equal up to scale: deck transformation and every corner of every face."""
    scale = other.circumference / one.circumference
    assert abs(one.deck.angle - other.deck.angle) < tolerance
    distance = np.abs(scale * one.corners() - other.corners()).max()
    assert distance < tolerance * other.circumference


@settings(max_examples=12, deadline=None)
@given(seeds, conditions)
def test_moebius_transformations_of_space_change_only_the_scale(
    seed: int, condition: BoundaryCondition
) -> None:
    """An inversion multiplies lengths by vertex factors, so the metric stays in its conformal class."""
    random = np.random.default_rng(seed)
    centre = random.standard_normal(3)
    centre *= 6.0 / np.linalg.norm(centre)
    offset = TOWER.vertices @ rotation(random).T - centre
    factor = 1 / (offset**2).sum(axis=1)
    inverted = replace(TOWER, vertices=offset * factor[:, None])
    before, after = conformal_map(TOWER, condition), conformal_map(inverted, condition)
    assert_same_domain(before, after)
    shift = after.log_scale + np.log(factor) - before.log_scale
    assert np.ptp(shift) < 1e-9


@settings(max_examples=12, deadline=None)
@given(seeds, st.one_of(conditions, isometric_conditions), st.floats(-3, 3))
def test_rigid_motions_and_uniform_scaling_change_nothing(
    seed: int, condition: BoundaryCondition, exponent: float
) -> None:
    random = np.random.default_rng(seed)
    moved = TOWER.vertices @ rotation(random).T * 10**exponent + random.standard_normal(3) * 10**exponent
    before, after = conformal_map(TOWER, condition), conformal_map(replace(TOWER, vertices=moved), condition)
    assert_same_domain(before, after)
    assert after.circumference == pytest.approx(10**exponent * before.circumference, rel=1e-10)
    np.testing.assert_allclose(after.log_scale, before.log_scale, atol=1e-10)


def test_a_far_origin_costs_only_the_digits_the_data_has_lost() -> None:
    """Millimetres, a million metres from the origin: coordinates are good to 1e-10 of an edge."""
    near = replace(TOWER, vertices=np.round(TOWER.vertices * 1e4, 3))
    far = replace(near, vertices=near.vertices + FAR)
    exact = replace(near, vertices=far.vertices - FAR)
    assert_same_domain(
        conformal_map(exact, BoundaryCondition()), conformal_map(far, BoundaryCondition()), 1e-12
    )


@settings(max_examples=12, deadline=None)
@given(seeds, isometric_conditions | st.just(BoundaryCondition()))
def test_labels_and_the_place_of_the_cut_change_nothing(seed: int, condition: BoundaryCondition) -> None:
    relabelled, name = shuffled(TOWER, seed)
    before, after = conformal_map(TOWER, condition), conformal_map(relabelled, condition)
    np.testing.assert_allclose(after.log_scale[name], before.log_scale, atol=1e-10)
    assert after.deck.angle == pytest.approx(before.deck.angle, abs=1e-10)
    around_before, across_before = polar(before, before.uv)
    around_after, across_after = polar(after, after.uv[name])
    np.testing.assert_allclose(across_after, across_before, atol=1e-9 * before.circumference)
    turns = around_after - around_before
    assert np.abs(np.exp(2j * np.pi * (turns - turns[0])) - 1).max() < 1e-9


@settings(max_examples=8, deadline=None)
@given(seeds)
def test_the_circumference_of_a_ring_without_an_apex_does_not_depend_on_the_cut(seed: int) -> None:
    plane = grid(30, 8, ring())
    condition = BoundaryCondition("isometric", quantum="hex")
    before, after = conformal_map(plane, condition), conformal_map(shuffled(plane, seed)[0], condition)
    assert before.deck.apex is None
    assert before.kind == "cone"
    assert after.circumference == pytest.approx(before.circumference, rel=1e-9)
    inner, outer = 2 * np.pi * 0.3, 2 * np.pi
    assert before.circumference == pytest.approx(np.sqrt(inner * outer), rel=0.02)


def shuffled(surface: Surface, seed: int) -> tuple[Surface, Ints]:
    """The surface with vertices, faces and corners in another order, and the new name of each vertex."""
    random = np.random.default_rng(seed)
    name = random.permutation(len(surface.vertices))
    vertices = np.empty_like(surface.vertices)
    vertices[name] = surface.vertices
    faces = random.permutation(name[surface.faces])
    faces = np.stack(
        [np.roll(face, k) for face, k in zip(faces, random.integers(3, size=len(faces)), strict=True)]
    )
    first, second = (np.roll(name[loop], random.integers(len(loop))) for loop in surface.loops)
    return replace(surface, vertices=vertices, faces=faces, loops=(first, second)), name


def polar(cmap: ConformalMap, z: Complexes) -> tuple[Floats, Floats]:
    """How many turns around, and how far across: coordinates in which g adds one turn."""
    if cmap.kind == "cylinder":
        return z.real / cmap.circumference, z.imag
    return np.angle(z) / cmap.deck.angle, np.abs(z)


def test_a_flat_cylinder_maps_to_itself() -> None:
    cylinder = grid(24, 10, prism(24, 3.0))
    for condition in (BoundaryCondition(), BoundaryCondition("isometric", quantum="hex")):
        cmap = conformal_map(cylinder, condition)
        assert np.abs(cmap.log_scale).max() < 1e-12
        assert cmap.deck == Deck(0.0, pytest.approx(2 * np.pi, rel=1e-12))
        np.testing.assert_allclose(cmap.uv.imag, cylinder.vertices[:, 2], atol=1e-12)


@pytest.mark.parametrize("angle", [np.pi / 3, np.pi, 5 * np.pi / 3])
def test_flat_cones_map_to_themselves(angle: float) -> None:
    cone = flat_cone(48, 12, 1.0, 2.0, angle)
    cmap = conformal_map(cone, BoundaryCondition("isometric"))
    assert np.abs(cmap.log_scale).max() < 1e-12
    np.testing.assert_allclose(np.abs(cmap.uv[cone.loops[1]]), 1.0, rtol=1e-12)


def test_a_flat_ring_maps_to_itself_and_g_is_the_identity() -> None:
    """K = 2π: a rotation by a whole turn, so g has no apex; here it is not even a translation."""
    flat = irregular(40, 8, ring())
    cmap = conformal_map(flat, BoundaryCondition("isometric", quantum="hex"))
    assert cmap.deck == Deck(pytest.approx(2 * np.pi, abs=1e-14), 0j)
    assert cmap.deck.apex is None
    place = flat.vertices[:, 0] + 1j * flat.vertices[:, 1]
    turn = (cmap.uv - cmap.uv[0]) / (place - place[0] + (np.arange(len(place)) == 0))
    np.testing.assert_allclose(turn[1:], turn[1], atol=1e-10)
    assert_honest(cmap)


def test_a_ring_with_a_full_turn_may_have_a_translation() -> None:
    def dented(phi: Floats, s: Floats) -> Floats:
        place = ring()(phi, s)
        place[:, 2] = 0.3 * np.exp(-8 * ((place[:, 0] + 0.3) ** 2 + (place[:, 1] - 0.6) ** 2))
        return place

    cmap = conformal_map(irregular(40, 8, dented), BoundaryCondition("isometric", quantum="hex"))
    assert cmap.deck.angle == pytest.approx(2 * np.pi, abs=1e-14)
    assert cmap.deck.is_translation
    assert abs(cmap.deck.translation) > 1e-4
    assert_honest(cmap)


def slope(make: Callable[[int], Surface], modulus: float, sizes: tuple[int, ...]) -> float:
    """Fitted order of convergence of height/circumference to the modulus."""
    error = []
    for n in sizes:
        cmap = conformal_map(make(n), BoundaryCondition())
        height = cmap.uv[cmap.surface.loops[1]].imag.mean()
        error.append(abs(height / cmap.circumference / modulus - 1))
    return float(-np.polyfit(np.log(sizes), np.log(error), 1)[0])


ECCENTRIC = float(np.arccosh((1 + 0.3**2 - 0.5**2) / 0.6) / (2 * np.pi))
BULGE = revolution(lambda s: np.cosh(1.5 * s - 0.5), lambda s: 1.5 * s - 0.5)


def test_modulus_of_the_eccentric_ring_converges_with_order_two() -> None:
    assert pytest.approx(0.137989679, abs=1e-9) == ECCENTRIC
    assert slope(lambda n: grid(4 * n, n, ring()), ECCENTRIC, (16, 32, 64)) > 1.9


@pytest.mark.parametrize(("place", "modulus"), [(BULGE, 1.5 / (2 * np.pi)), (ring(), ECCENTRIC)])
def test_moduli_converge_with_order_two_on_irregular_meshes(
    place: Callable[[Floats, Floats], Floats], modulus: float
) -> None:
    assert slope(lambda n: irregular(4 * n, n, place, seed=n), modulus, (8, 16, 32, 64)) > 1.8


def test_two_triangulations_of_one_surface_agree_to_discretisation_error() -> None:
    """Same points, other diagonals: the difference falls with the square of the edge length."""
    difference = []
    for n in (12, 24, 48):
        one, other = (
            conformal_map(grid(4 * n, n, uneven, alternate), BoundaryCondition())
            for alternate in (True, False)
        )
        difference.append(np.abs(one.uv.imag / one.circumference - other.uv.imag / other.circumference).max())
    assert difference[0] < 2e-3
    assert np.diff(-np.log2(difference)).min() > 1.8


@settings(max_examples=20, deadline=None)
@given(seeds, st.floats(0.0, 3.0))
def test_the_gradient_is_monotone_and_its_derivative_is_the_hessian(seed: int, size: float) -> None:
    """Also where triangles violate the inequality: the energy is convex throughout."""
    random = np.random.default_rng(seed)
    energy = Energy(TOWER, boundary.straight(TOWER))
    x, y = size * random.standard_normal((2, energy.n_dof))
    at_x, at_y = (energy.corners(energy.scale_of(z)) for z in (x, y))
    assert (energy.gradient(at_x) - energy.gradient(at_y)) @ (x - y) >= -1e-10
    if not at_x.violating.any():
        diagonal, off_diagonal = energy.hessian(at_x)
        direction, h = random.standard_normal(energy.n_dof), 1e-6
        ahead, behind = (energy.corners(energy.scale_of(x + s * h * direction)) for s in (1, -1))
        numerical = (energy.gradient(ahead) - energy.gradient(behind)) / (2 * h)
        product = diagonal * direction
        product += np.bincount(energy.rows, off_diagonal * direction[energy.columns], energy.n_dof)
        product += np.bincount(energy.columns, off_diagonal * direction[energy.rows], energy.n_dof)
        np.testing.assert_allclose(product, numerical, atol=1e-4 * max(1.0, np.abs(product).max()))


@settings(max_examples=20, deadline=None)
@given(seeds, st.floats(0.0, 5.0))
def test_gauss_bonnet_holds_for_every_metric(seed: int, size: float) -> None:
    """Angles of a triangle add up to π, whether or not it violates the inequality, so Σ(2π − Θ) inside + Σκ
    on the boundary = 0."""
    u = size * np.random.default_rng(seed).standard_normal(len(TOWER.vertices))
    energy = Energy(TOWER, boundary.straight(TOWER))
    sums = energy.angle_sums(energy.corners(u))
    assert (boundary.straight(TOWER).angle - sums).sum() == pytest.approx(0, abs=1e-9)


@settings(max_examples=50, deadline=None)
@given(
    st.sampled_from([0.0, np.pi / 3, -np.pi / 3, 2 * np.pi, -4 * np.pi, 1.0, 1e-8, -7.0, 2 * np.pi + 1e-4]),
    st.complex_numbers(max_magnitude=10),
    st.lists(st.complex_numbers(max_magnitude=10), min_size=1, max_size=5),
    st.integers(-5, 5),
    st.integers(-5, 5),
)
def test_powers_of_g_form_a_group(
    angle: float, translation: complex, points: list[complex], a: int, b: int
) -> None:
    g, z = Deck(angle, translation), np.array(points)
    np.testing.assert_allclose(g.apply(z, 1), np.exp(1j * angle) * z + translation, atol=1e-12)
    np.testing.assert_allclose(g.apply(z, 0), z, atol=1e-12)
    np.testing.assert_allclose(g.apply(g.apply(z, b), a), g.apply(z, a + b), atol=1e-11)
    if g.apex is not None:
        np.testing.assert_allclose(g.apply(np.array([g.apex]), a), g.apex, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("angle", [5e-2, 1e-2, 1e-5, 1e-8, -1e-8])
def test_cones_that_are_nearly_cylinders_keep_their_digits(angle: float) -> None:
    """The apex is far away; neither uv nor g may lose digits to it."""
    condition = corners_at(
        np.array([3, int(TOWER.loops[1][5])]),
        np.array([np.pi - angle, np.pi + angle]),
    )
    cmap = conformal_map(TOWER, condition)
    assert_honest(cmap)
    assert cmap.deck.angle == pytest.approx(angle, rel=1e-6)
    assert np.abs(cmap.uv).max() < 5 * (np.ptp(cmap.uv.real) + np.ptp(cmap.uv.imag))
    cylinder = conformal_map(TOWER, BoundaryCondition())
    assert cmap.circumference == pytest.approx(cylinder.circumference, rel=10 * abs(angle))


@pytest.mark.parametrize("slant", [1e-6, 1e-9, 1.3e-10, -1.3e-10, 1e-12])
def test_isometric_cone_angles_that_are_nearly_zero_are_mapped(slant: float) -> None:
    """Symmetric ends but for a slant: the cone angle comes out as about −5 slant, the apex as far away as
    that says, and the drawn angles are right all the same."""
    belly = lambda s: 1 + 0.4 * np.sin(np.pi * s) + slant * (2 * s - 1)  # noqa: E731
    surface = grid(20, 10, revolution(belly, lambda s: 3 * s))
    cmap = conformal_map(surface, BoundaryCondition("isometric", quantum="none"))
    assert np.abs(cmap.log_scale[surface.boundary]).max() < 1e-12
    sums = [float((np.pi - angles).sum()) for angles in cmap.boundary_angles]
    assert abs(sums[0] + sums[1]) < 1e-12
    assert_honest(cmap)


def test_optimal_spreading_has_less_dirichlet_energy_than_the_even_one() -> None:
    """In the smooth limit u constant on each loop is the Dirichlet minimiser for the given cone angle."""
    tower = irregular(48, 16, BULGE)
    energy = {}
    for spread in ("even", "optimal"):
        cmap = conformal_map(tower, BoundaryCondition("isometric", quantum="hex", spread=spread))  # type: ignore[arg-type]
        problem = Energy(tower, boundary.straight(tower))
        diagonal, off_diagonal = problem.hessian(problem.corners(np.zeros(problem.n)))
        x = problem.unknowns_of(cmap.log_scale)
        energy[spread] = float(diagonal @ x**2 + 2 * off_diagonal @ (x[problem.rows] * x[problem.columns]))
    assert energy["optimal"] < energy["even"]


def test_a_catenoid_is_a_cylinder_of_constant_height_lines() -> None:
    cmap = conformal_map(catenoid(64, 24), BoundaryCondition())
    rows = cmap.uv.imag.reshape(25, 64)
    assert np.ptp(rows, axis=1).max() < 2e-3 * cmap.circumference
