"""Awkward annuli under awkward boundary conditions: all of them have a map, and it is the right one."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.surface.types import Surface
from tests.solver.conformal.annuli import annulus, bump, corners_at, grid, irregular, revolution, ring, uneven
from tests.solver.conformal.checks import asked_angles, faults
from tests.solver.conformal.torture import MODES, band, extreme, random_flips, taken_in

CONE = revolution(lambda s: 1 + 2 * s, lambda s: s)


def with_ears(around: int) -> Surface:
    """Two rows of a cone with a further triangle, an ear, on every second edge of loop 0; around is even."""
    body = grid(around, 2, CONE)
    loop, n = body.loops[0], len(body.vertices)
    tail, head = loop[::2], np.roll(loop, -1)[::2]
    tip = n + np.arange(len(tail))
    place = 0.8 * (body.vertices[tail] + body.vertices[head]) / 2 - [0, 0, 0.3]
    ears = np.stack([tail, tip, head], axis=1)
    outline = ears.ravel()
    return annulus(
        np.concatenate([body.vertices, place]), np.concatenate([body.faces, ears]), (outline, body.loops[1])
    )


SURFACES = {
    "loops of three vertices": grid(3, 4, CONE),
    "loops of three vertices, one triangle wide": grid(3, 1, CONE),
    "one triangle wide": grid(12, 1, CONE, False),
    "one triangle wide, uneven": grid(60, 1, uneven),
    "ears": with_ears(16),
    "scattered ring": irregular(30, 6, ring()),
    "very wide": grid(40, 3, revolution(lambda s: 1 + 50 * s, lambda s: 0.1 * s)),
    "1:160 tube": grid(8, 200, revolution(lambda s: 0.02 + 0 * s, lambda s: 20 * s)),
}


def corners(surface: Surface, kind: str) -> BoundaryCondition:
    first, second = surface.loops
    k, pi = len(first), np.pi
    vertices, angles = {
        "adjacent corners": (first[:2], [2 * pi / 3, 4 * pi / 3]),
        "adjacent entrance": (first[:3], [4 * pi / 3, pi / 3, 4 * pi / 3]),
        "corners on both loops": ([first[0], second[0]], [pi - 0.01, pi + 0.01]),
        "sharp corners": (first[:3], [pi / 6, 2 * pi - pi / 3, pi + pi / 6]),
        "full turn": (
            np.concatenate([first, second]),
            [pi - 2 * pi / k] * k + [pi + 2 * pi / len(second)] * len(second),
        ),
    }[kind]
    return corners_at(np.asarray(vertices), np.array(angles))


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize(
    "condition",
    [
        BoundaryCondition(),
        BoundaryCondition("isometric"),
        BoundaryCondition("isometric", quantum="hex"),
        BoundaryCondition("isometric", quantum="hex", spread="optimal"),
    ],
    ids=["straight", "isometric", "even", "optimal"],
)
def test_every_mode(name: str, condition: BoundaryCondition) -> None:
    assert faults(conformal_map(SURFACES[name], condition)) == []


@pytest.mark.parametrize("name", [name for name in SURFACES if name != "1:160 tube"])
@pytest.mark.parametrize(
    "kind", ["adjacent corners", "adjacent entrance", "corners on both loops", "sharp corners", "full turn"]
)
def test_corners_wherever_they_are(name: str, kind: str) -> None:
    surface = SURFACES[name]
    condition = corners(surface, kind)
    found = conformal_map(surface, condition)
    assert faults(found) == []
    wanted = np.full(len(surface.vertices), np.pi)
    wanted[[corner.vertex for corner in condition.angles]] = [corner.angle for corner in condition.angles]
    for loop, angles in zip(found.surface.loops, found.boundary_angles, strict=True):
        sent = loop < len(wanted)  # the rest was inserted on straight sides
        np.testing.assert_allclose(angles[sent], wanted[loop[sent]], atol=1e-9)
        np.testing.assert_allclose(angles[~sent], np.pi, atol=1e-9)


def wheel(around: int, first: int, second: int) -> Surface:
    """A cone frustum one triangle wide, from a polygon to a triangle: two of its corners stand opposite to
    the polygon's vertices ``first`` and ``second``, the third one to vertex 0."""
    outer, inner = (np.exp(2j * np.pi * np.arange(n) / n) for n in (around, 3))
    z = np.concatenate([2 * outer, 1.0 * inner])
    height = np.repeat([0.0, 1.0], [around, 3])
    k = np.arange(around)
    hub = around + (k >= first) + (k >= second)
    fans = np.stack([k, (k + 1) % around, hub], axis=1)
    change = np.flatnonzero(np.roll(hub, -1) != hub)
    between = np.stack([(change + 1) % around, np.roll(hub, -1)[change], hub[change]], axis=1)
    loops = (k, around + np.array([2, 1, 0]))
    return annulus(np.column_stack([z.real, z.imag, height]), np.concatenate([fans, between]), loops)


def test_corners_wider_than_a_turn_are_gone_around_once_and_a_bit() -> None:
    surface = wheel(155, 98, 109)
    loops = surface.loops
    angles = [np.pi - sign * 4 * np.pi / len(loop) for loop, sign in zip(loops, (1, -1), strict=True)]
    condition = corners_at(np.concatenate(loops), np.repeat(angles, [len(loop) for loop in loops]))
    found = conformal_map(surface, condition)
    assert faults(found, asked_angles(found, surface, condition)) == []


def test_splits_do_not_go_around_a_vertex_for_ever() -> None:
    random = np.random.default_rng(101)
    tower = irregular(24, 14, uneven, seed=int(random.integers(1e6)))
    faces = random_flips(tower.faces, len(tower.vertices), random, 6000)
    found = conformal_map(annulus(tower.vertices, faces, tower.loops), BoundaryCondition())
    assert faults(found) == []


def test_cascades_of_splits_around_several_vertices_end() -> None:
    """Some hundred needles in a few fans, under small angles and wide ones."""
    random = np.random.default_rng(9)
    few, many = (random.uniform(0, 2 * np.pi, int(random.integers(*span))) for span in ((3, 8), (20, 200)))
    surface = band(np.sort(few), np.sort(many), random)
    condition = extreme(surface, np.random.default_rng(1009))
    found = conformal_map(surface, condition)
    assert faults(found, asked_angles(found, surface, condition)) == []


def test_splits_that_only_call_for_further_splits_are_not_made() -> None:
    """A tower stretched to many times its height, its edges flipped at random: needles all over."""
    random = np.random.default_rng(13)
    tower = bump(int(random.integers(8, 24)), int(random.integers(4, 12)))
    vertices = tower.vertices * [1, 1, 10 ** random.uniform(-2, 2)]
    vertices = vertices + random.normal(scale=0.02, size=vertices.shape)
    faces = random_flips(tower.faces, len(vertices), random, int(random.integers(0, 600)))
    surface = taken_in(vertices, faces)
    found = conformal_map(surface, BoundaryCondition("isometric", quantum="hex"))
    assert faults(found) == []


@pytest.mark.long
def test_splits_that_call_for_many_more_are_made_where_nothing_else_helps() -> None:
    """A hundred needles in a few fans, with three corners."""
    random = np.random.default_rng(14)
    few, many = (random.uniform(0, 2 * np.pi, int(random.integers(*span))) for span in ((5, 9), (20, 200)))
    surface = band(np.sort(few), np.sort(many), random)
    condition = MODES["entrance"](surface, np.random.default_rng(1014))
    found = conformal_map(surface, condition)
    assert faults(found, asked_angles(found, surface, condition)) == []


def test_angles_that_are_not_exact_are_refused() -> None:
    """On a band 250 times as long as wide, corners of 30° and 330° want scale factors beyond all doubles."""
    surface = grid(4, 7, revolution(lambda s: 1 + 0 * s, lambda s: 0.0027 * s))
    condition = MODES["densified"](surface, np.random.default_rng(1003))
    with pytest.raises(ConvergenceError, match=r"10\^\d+ times as much as others, .* double precision"):
        conformal_map(surface, condition)
