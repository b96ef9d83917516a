"""Nets: what must hold of every one, whatever the surface, its loops and its cones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.conformal import boundary, conformal_map
from hexwrap_solver.conformal.cut import cut_open
from hexwrap_solver.conformal.robust import solve_with_flips
from hexwrap_solver.conformal.types import BoundaryAngle, BoundaryCondition, Cones, LoopCondition
from hexwrap_solver.errors import BoundaryError, GaussBonnetError, SettingError, SingularitiesError
from hexwrap_solver.surface.types import Surface
from tests.solver.conformal.annuli import bump
from tests.solver.conformal.nets import CENTRES, HEX, SPHERE, check, disk, flat, holed, sent, spread_points


@pytest.mark.parametrize("count", [12, 14])
def test_a_closed_surface_with_prescribed_singularities(count: int) -> None:
    vertex = spread_points(SPHERE, count)
    index = np.where(np.arange(count) < (12 + count) // 2, 1, -1)
    check(conformal_map(SPHERE, BoundaryCondition(), cones=Cones.at(vertex, index, HEX)))


def test_a_closed_surface_needs_singularities() -> None:
    with pytest.raises(SingularitiesError, match="indices add up to 12"):
        conformal_map(SPHERE, BoundaryCondition())
    with pytest.raises(SingularitiesError, match="add up to 11"):
        conformal_map(
            SPHERE,
            BoundaryCondition(),
            cones=Cones.at(spread_points(SPHERE, 11), np.ones(11, dtype=int), HEX),
        )
    with pytest.raises(SingularitiesError, match="add up to 7, but a closed surface needs 8"):
        conformal_map(
            SPHERE,
            BoundaryCondition(),
            cones=Cones.at(spread_points(SPHERE, 7), np.ones(7, dtype=int), np.pi / 2),
        )


@settings(max_examples=12, deadline=None)
@given(st.integers(1, 5), st.integers(0, 3), st.sampled_from(["even", "optimal"]))
def test_any_number_of_loops_and_cones(loops: int, cones: int, spread: str) -> None:
    """Isometric loops, with cones of either sign: nets close, their curvatures are multiples of the
    quantum."""
    surface = holed(SPHERE, CENTRES[:loops], 0.35)
    assert len(surface.loops) == loops
    at = Cones.at(spread_points(surface, cones), np.array([1, -1, 2])[:cones], HEX)
    found = conformal_map(surface, BoundaryCondition("isometric", quantum="hex", spread=spread), cones=at)  # type: ignore[arg-type]
    assert found.kind == ("net" if loops != 2 or cones else found.kind)
    check(found)
    turns = [float((np.pi - angles).sum()) / HEX for angles in found.boundary_angles]
    assert np.abs(np.array(turns) - np.round(turns)).max() < 1e-8


def test_the_net_of_an_annulus_is_its_sheet() -> None:
    surface = bump(24, 8)
    for mode in ("straight", "isometric"):
        check(conformal_map(surface, BoundaryCondition(mode, quantum="hex")))  # type: ignore[arg-type]


@pytest.mark.parametrize("k", [1, -1, 2])
def test_a_disk_with_a_cone_converges_to_a_power(k: int) -> None:
    """z ↦ z^α, α = 1 − k/6, with a straight loop's like: u constant on the boundary."""
    errors = []
    for rings in (6, 12, 24):
        z, faces = disk(rings)
        surface = sent(flat(z), faces)
        cones = Cones.at(np.array([0]), np.array([k]), HEX)
        found = conformal_map(surface, BoundaryCondition("isometric", quantum="hex"), cones=cones)
        check(found)
        radius = np.abs(surface.vertices @ [1, 1j, 0])
        inside = (radius > 0.3) & (radius < 0.9)
        expected = -k / 6 * np.log(radius[inside])
        errors.append(
            float(
                np.abs(found.log_scale[inside] - expected - (found.log_scale[inside] - expected).mean()).max()
            )
        )
    assert errors[2] < errors[1] / 2 < errors[0] / 4
    assert errors[2] < 0.01


def test_a_disk_converges_to_the_square() -> None:
    """Schwarz–Christoffel: f′ = (1 − z⁴)^(−1/2), whose corners are those of a square."""
    errors = []
    for rings in (8, 16, 32):
        z, faces = disk(rings)
        surface = sent(flat(z), faces)
        at = surface.vertices @ [1, 1j, 0]
        corner = [int(abs(at - 1j**k).argmin()) for k in range(4)]
        corners = tuple(BoundaryAngle(np.pi / 2, int(surface.input_vertex[v])) for v in corner)
        found = conformal_map(surface, BoundaryCondition("angles", corners, quantum="quad"))
        check(found)
        inside = np.abs(at) < 0.8
        off = found.log_scale[inside] + np.log(abs(1 - at[inside] ** 4)) / 2
        errors.append(float(np.abs(off - off.mean()).max()))
        side = abs(np.diff(found.corners().ravel()[_corner(surface, corner)]))
        np.testing.assert_allclose(side, np.mean(side), rtol=1e-6)
    assert errors[2] < errors[1] / 2 < errors[0] / 4
    assert errors[2] < 2e-3
    assert side[0] == pytest.approx(1.8540746773, abs=2e-3)  # Γ(1/4)² / 4√π


def _corner(surface: Surface, vertices: list[int]) -> list[int]:
    """A corner 3·face + c at each vertex."""
    return [int(np.flatnonzero(surface.faces.ravel() == v)[0]) for v in vertices]


def test_a_flat_rectangle_maps_to_itself() -> None:
    """Four corners of 90°: the domain is the rectangle, whatever its triangles."""
    random = np.random.default_rng(1)
    x, y = (a.ravel() for a in np.meshgrid(np.arange(9), np.arange(6)))
    inner = (x > 0) & (x < 8) & (y > 0) & (y < 5)
    z = x + 1j * y + inner * (random.uniform(-0.2, 0.2, 54) + 1j * random.uniform(-0.2, 0.2, 54))
    i, j = (a.ravel() for a in np.meshgrid(np.arange(8), np.arange(5)))
    a = 9 * j + i
    surface = sent(
        flat(z), np.concatenate([np.stack([a, a + 1, a + 10], 1), np.stack([a, a + 10, a + 9], 1)])
    )
    corners = tuple(BoundaryAngle(np.pi / 2, v) for v in (0, 8, 45, 53))
    asked = BoundaryCondition("angles", corners, quantum="quad")
    found = conformal_map(surface, asked)
    check(found)
    assert np.ptp(found.log_scale) < 1e-12
    with pytest.raises(GaussBonnetError, match="must turn by 360°"):
        conformal_map(surface, BoundaryCondition("straight"))


def test_single_loops_have_their_own_conditions() -> None:
    """A tower with a door: its foot straight, the door a rectangle, the top takes what is left."""
    tower = bump(24, 8)
    surface = sent(
        tower.vertices,
        np.delete(tower.faces, np.flatnonzero(np.isin(tower.faces, [60, 61, 84, 85]).any(1)), 0),
    )
    door = surface.loops[2]
    ends = door[[0, len(door) // 4, len(door) // 2, 3 * len(door) // 4]]
    corners = tuple(BoundaryAngle(1.5 * np.pi, int(v)) for v in surface.input_vertex[ends])
    conditions = (LoopCondition("straight", loop=0), LoopCondition("angles", loop=2, angles=corners))
    found = conformal_map(surface, BoundaryCondition("isometric", quantum="quad", loops=conditions))
    check(found)
    turns = [float((np.pi - angles).sum()) for angles in found.boundary_angles]
    assert turns == pytest.approx([0, 0, -2 * np.pi], abs=1e-8)
    assert found.boundary_angles[0] == pytest.approx(np.pi)


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 5), st.integers(0, 6))
def test_the_cut_leaves_a_disk(loops: int, cones: int) -> None:
    """Euler characteristic 1 after cutting; with hubs to spare each path has a single motion."""
    surface = holed(SPHERE, CENTRES[:loops], 0.35)
    at = spread_points(surface, cones) if cones else np.zeros(0, dtype=np.int64)
    cut = cut_open(surface, at)
    m = len(surface.faces)
    edges = int((cut.twin < 0).sum()) + int((cut.twin >= 0).sum()) // 2
    corner = np.arange(3 * m)
    joined = np.flatnonzero(cut.twin >= 0)
    label = corner.copy()  # corners of one vertex of the opened surface
    following = np.where(cut.twin[joined] % 3 == 2, cut.twin[joined] - 2, cut.twin[joined] + 1)
    while True:
        low = label.copy()
        np.minimum.at(low, joined, label[following])
        np.minimum.at(low, following, label[joined])
        if (low == label).all():
            break
        label = low
    assert len(np.unique(label)) - edges + m == 1
    assert len(cut.beyond) == max(loops + cones - 1, 0)


@pytest.mark.parametrize(("loops", "cones"), [(1, 0), (3, 0), (0, 12), (2, 3)])
def test_the_route_with_flips_finds_the_same_net(loops: int, cones: int) -> None:
    """To rounding where the mesh is Delaunay as it is, but for what the few flips change."""
    surface = holed(SPHERE, CENTRES[:loops], 0.35) if loops else SPHERE
    index = np.ones(cones, dtype=int) if loops == 0 else np.array([1, -1, 2])[:cones]
    at = Cones.at(spread_points(surface, cones), index, HEX)
    plain = conformal_map(surface, BoundaryCondition("isometric", quantum="hex"), cones=at)
    targets = boundary.targets(surface, list(plain.boundary_angles), at)
    found = solve_with_flips(surface, targets, cones=at)
    check(found)
    assert found.inserted == 0
    assert np.ptp(found.log_scale - plain.log_scale) < (0.01 if found.flips else 1e-12)


def test_noisy_surfaces_need_flips_and_get_them() -> None:
    """Half of all edges flipped, and still no triangle turned over and no vertex new."""
    surface = holed(SPHERE, CENTRES[:3], 0.35)
    noise = 0.06 * np.random.default_rng(3).standard_normal(surface.vertices.shape)
    noisy = sent(surface.vertices * [1, 1, 0.15] + noise, surface.faces)
    for count in (0, 2):
        cones = Cones.at(spread_points(noisy, count), np.array([1, -1])[:count], HEX)
        found = conformal_map(noisy, BoundaryCondition("isometric", quantum="hex"), cones=cones)
        check(found)
        assert found.flips > 100


def test_cones_side_by_side() -> None:
    """Paths of a single edge, whose both ends are cones of one fan each."""
    z, faces = disk(8)
    surface = sent(flat(z), faces)
    for index in ([1, -1], [-1, 1], [1, 1, -1]):
        ring = np.array([0, 1, 8][: len(index)])
        found = conformal_map(
            surface, BoundaryCondition("isometric", quantum="hex"), cones=Cones.at(ring, np.array(index), HEX)
        )
        check(found)


def test_singularities_that_cannot_be() -> None:
    surface = holed(SPHERE, CENTRES[:3], 0.35)
    asked = BoundaryCondition("isometric", quantum="hex")
    rim, inner = int(surface.loops[1][0]), int(spread_points(surface, 1)[0])
    for vertices, index, words in (
        ([rim], [1], "of the boundary"),
        ([inner, inner], [1, -1], "at one vertex"),
        ([inner], [6], "must be less than 6"),
    ):
        with pytest.raises(SingularitiesError, match=words):
            conformal_map(surface, asked, cones=Cones.at(np.array(vertices), np.array(index), HEX))


def test_loops_that_are_not_there() -> None:
    surface = bump(12, 4)
    with pytest.raises(BoundaryError, match="Loop 2 is asked for, but the surface has 2 boundary loops"):
        conformal_map(surface, BoundaryCondition("straight", loops=(LoopCondition("isometric", loop=2),)))
    with pytest.raises(SettingError, match="either 'loop' or 'point'"):
        LoopCondition("isometric")
    by_point = LoopCondition("isometric", point=(0.0, 0.0, 9.0))
    found = conformal_map(surface, BoundaryCondition("straight", quantum="hex", loops=(by_point,)))
    assert found.boundary_angles[0] == pytest.approx(np.pi)
    assert np.ptp(found.log_scale[surface.loops[1]]) == 0


def test_rims_that_flips_have_touched_are_told() -> None:
    """u = 0 holds on the intrinsic triangulation; the sent edges keep their lengths only nearly."""
    random = np.random.default_rng(0)
    tower = bump(24, 8)
    noisy = sent(tower.vertices + 0.08 * random.standard_normal(tower.vertices.shape), tower.faces)
    found = conformal_map(noisy, BoundaryCondition("isometric", quantum="none"))
    assert found.flips > 0
    assert any("keep their lengths only to within" in note for note in found.notes)
    smooth = conformal_map(tower, BoundaryCondition("isometric", quantum="none"))
    assert not smooth.notes
