"""Several loops and cones at once: the pattern depends on the surface alone."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import KDTree

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, Cones, ConformalMap
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.place.choose import place_lattice
from hexwrap_solver.pattern.place.joint import Joint
from hexwrap_solver.pattern.place.motions import fixed_point, holonomy_of, word_around
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from hexwrap_solver.surface.topology import next_half_edge
from hexwrap_solver.surface.types import Surface
from tests.solver.conformal.nets import CENTRES, SPHERE, sent, spread_points
from tests.solver.pattern.nets import QUANTUM
from tests.solver.pattern.test_nets import check_theorems, places_of_cells

#: loops, indices of the singularities, kind of pattern
CASES = [
    (1, (1, -1, 1), "hex"),
    (2, (1, 2, -1), "hex"),
    (3, (), "hex"),
    (4, (1, -2), "hex"),
    (5, (-1,), "hex"),
    (3, (1, -1), "quad"),
    (0, (1,) * 9 + (3,), "hex"),
]


@cache
def lump(loops: int) -> Surface:
    """An egg without symmetry, with holes of different sizes."""
    x, y, z = SPHERE.vertices.T
    points = SPHERE.vertices * (1 + 0.12 * np.sin(1 + 2 * x + 0.7 * y) + 0.1 * np.cos(z - 1.3 * y))[:, None]
    keep = np.ones(len(points), dtype=bool)
    for i in range(loops):
        keep &= np.linalg.norm(SPHERE.vertices - CENTRES[i], axis=1) > 0.5 - 0.06 * i
    return sent(points, SPHERE.faces[keep[SPHERE.faces].all(axis=1)])


def renumbered(surface: Surface, seed: int) -> tuple[Surface, Ints]:
    """The same with vertices and faces in another order; and the new vertex of each old one."""
    rng = np.random.default_rng(seed)
    order, m = rng.permutation(len(surface.vertices)), len(surface.faces)
    place = np.argsort(order)
    turn = (rng.integers(0, 3, m)[:, None] + np.arange(3)) % 3
    faces = np.take_along_axis(place[surface.faces], turn, axis=1)[rng.permutation(m)]
    found = sent(surface.vertices[order], faces)
    return found, found.vertex_of_input[place]


def mapped(surface: Surface, at: Ints, index: tuple[int, ...], kind: str) -> ConformalMap:
    cones = Cones.at(at, np.array(index, dtype=np.int64), QUANTUM[kind])
    return conformal_map(surface, BoundaryCondition("isometric", quantum=kind), cones=cones)  # type: ignore[arg-type]


def both(loops: int, index: tuple[int, ...], kind: str) -> tuple[ConformalMap, ConformalMap]:
    surface = lump(loops)
    at = spread_points(surface, len(index)) if index else np.zeros(0, dtype=np.int64)
    other, new = renumbered(surface, loops)
    return mapped(surface, at, index, kind), mapped(other, new[at], index, kind)


def distance(one: Pattern, two: Pattern) -> float:
    """Greatest distance from a cell's middle to the nearest one of the other pattern, in edges."""
    return float(KDTree(places_of_cells(two)).query(places_of_cells(one))[0].max() / one.edge_length)


@pytest.mark.parametrize(("loops", "index", "kind"), CASES)
def test_nothing_depends_on_cut_and_numbering(loops: int, index: tuple[int, ...], kind: str) -> None:
    one, two = both(loops, index, kind)
    asked = PatternSettings(kind=kind, align="none")  # type: ignore[arg-type]
    first, second = (lay_pattern(cmap, asked) for cmap in (one, two))
    check_theorems(one, first)
    assert first.n_cells == second.n_cells
    assert first.distortion == pytest.approx(second.distortion, abs=1e-4)
    assert distance(first, second) < 1e-3


@pytest.mark.parametrize(("loops", "index", "kind"), CASES)
def test_motions_compose_to_the_rotation_around_every_loop_and_singularity(
    loops: int, index: tuple[int, ...], kind: str
) -> None:
    """In exact integers: around a singularity by −k quanta about a centre, around every other vertex not at
    all, around a loop by its curvature."""
    cmap, lattice = both(loops, index, kind)[0], LATTICES[kind]
    rows = place_lattice(cmap, lattice, PatternSettings(kind=kind, align="none")).isometries  # type: ignore[arg-type]
    net, twin = cmap.net, cmap.surface.twin
    corner = np.zeros(len(cmap.surface.vertices), dtype=np.int64)
    corner[cmap.surface.faces.ravel()] = np.arange(cmap.surface.faces.size)
    on_cut = np.unique(cmap.surface.faces[np.nonzero(net.crossing)])
    rest = dict(zip(cmap.cones.vertex.tolist(), cmap.cones.index.tolist(), strict=True))
    for v in np.setdiff1d(on_cut, cmap.surface.boundary).tolist():
        around = lattice.partial_products(rows[word_around(net, twin, int(corner[v]))])[-1]
        k = rest.pop(v, 0)
        assert around[0] == -k % lattice.order
        if k:
            assert lattice.is_centre(fixed_point(lattice, around[None]))[0]
        else:
            assert not around.any()
    assert not rest
    leaving = {int(cmap.surface.faces.ravel()[h]): int(h) for h in np.flatnonzero(twin < 0)}
    for loop, angles in zip(cmap.surface.loops, cmap.boundary_angles, strict=True):
        total = 0
        for start, _ in pairwise([*loop.tolist(), int(loop[0])]):
            at = int(next_half_edge(np.array([leaving[start]]))[0])
            while twin[at] >= 0:
                total += int(rows[net.crossing.ravel()[at], 0])
                at = int(next_half_edge(twin[at : at + 1])[0])
        curvature = float((np.pi - angles).sum()) / lattice.step_angle
        assert total % lattice.order in (round(curvature) % lattice.order, -round(curvature) % lattice.order)


@pytest.mark.parametrize(("loops", "index"), [(3, ()), (3, (1, -1))])
def test_no_other_rounding_changes_the_domain_less(loops: int, index: tuple[int, ...]) -> None:
    """Against neighbours in all directions."""
    cmap, lattice = both(loops, index, "hex")[0], LATTICES["hex"]
    joint = Joint.of(cmap, lattice, holonomy_of(cmap, lattice, cmap.net))
    rng = np.random.default_rng(0)
    for A in rng.uniform(3, 6, 5) * np.exp(1j * rng.uniform(0, 1, 5)):
        for family, (_, steps, _) in enumerate(joint.families):
            x, least = joint.nearest(family, complex(A))
            others = x + rng.integers(-2, 3, (2000, steps.shape[1])) @ steps.T
            off: Floats = others - joint.target(np.array([A]))
            assert np.einsum("ki,ij,kj->k", off, joint.form, off).min() >= least - 1e-9
