"""What holds for every pattern: independence of cut and numbering, regular cells, angles that converge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from hexwrap_solver.conformal.types import ConformalMap, Deck
from hexwrap_solver.domain import lift
from hexwrap_solver.errors import PatternError
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from tests.solver.pattern import annuli
from tests.solver.pattern.test_lay import QUANTUM, SIDES, check_closed
from tests.solver.pattern.test_trim import cell_areas, domain_area

HEIGHTS = np.linspace(-1, 1.5, 19)


def wavy(z):  # type: ignore[no-untyped-def]
    return 1 + 0.3 * np.sin(2 * z)


def centres(pattern: Pattern) -> np.ndarray:
    """(c, 3) means of the cells' corners, in an order that depends on nothing but their places."""
    table = pattern.vertices[pattern.faces.values]
    mean = np.add.reduceat(table, pattern.faces.offsets[:-1]) / pattern.faces.lengths[:, None]
    return mean


def same_cells(one: Pattern, two: Pattern) -> bool:
    """Whether two patterns consist of the same cells, to 1e-9."""
    a, b = centres(one), centres(two)
    if len(a) != len(b):
        return False
    distance, partner = cKDTree(a).query(b)
    return bool(distance.max() < 1e-9 and len(np.unique(partner)) == len(a))


def renumbered(cmap: ConformalMap, seed: int) -> ConformalMap:
    """The same map with its vertices, faces and corners in another order, and its loops exchanged."""
    rng = np.random.default_rng(seed)
    n, m = len(cmap.uv), len(cmap.surface.faces)
    old = rng.permutation(n)  # old[new]
    new = np.argsort(old)
    order, first = rng.permutation(m), rng.integers(3, size=m)
    corner = (first[:, None] + np.arange(3)) % 3
    faces = np.take_along_axis(new[cmap.surface.faces], corner, axis=1)[order]
    sheet = np.take_along_axis(cmap.sheet, corner, axis=1)[order]
    loops = tuple(np.roll(new[loop], int(rng.integers(len(loop)))) for loop in cmap.surface.loops[::-1])
    made = annuli.make_map(
        cmap.surface.vertices[old], faces, sheet, cmap.uv[old], cmap.deck, len(loops[0]), cmap.log_scale[old]
    )
    ones = tuple(np.full(len(loop), np.pi) for loop in loops)
    angles = ones if cmap.kind == "cylinder" else tuple(np.full(len(x), np.pi + 0.1) for x in loops)
    moved = replace(made, surface=replace(made.surface, loops=loops), boundary_angles=angles)
    return moved.with_domain(circumference=cmap.circumference, deck=cmap.deck)


@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
@pytest.mark.parametrize("align", ["none", "both"])
@pytest.mark.parametrize("boundary", ["whole", "trim"])
def test_pattern_does_not_depend_on_the_cut_nor_on_how_the_domain_lies(kind, align, boundary):
    request = PatternSettings(kind=kind, align=align, boundary=boundary)
    one = lay_pattern(annuli.revolution(wavy, HEIGHTS, 37), request)
    for cut, turn in ((5, 1), (30, 3 * np.exp(2j))):
        assert same_cells(one, lay_pattern(annuli.revolution(wavy, HEIGHTS, 37, cut, turn), request))


@pytest.mark.parametrize("boundary", ["whole", "trim"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_pattern_does_not_depend_on_the_numbering(boundary, seed):
    for cmap in (annuli.revolution(wavy, HEIGHTS, 37), annuli.flat_cone(-np.pi, 1.0, 2.0, 50, 9)):
        request = PatternSettings(around=40, boundary=boundary, phase=(0.3, 0.1))  # without symmetry: no ties
        assert same_cells(lay_pattern(cmap, request), lay_pattern(renumbered(cmap, seed), request))


@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
@pytest.mark.parametrize("k", [0, 1, -2, 3, 4, -5, 7])
def test_cells_of_flat_cylinders_and_cones_are_regular(kind, k):
    angle = k * QUANTUM[kind]
    if k == 0:
        cmap = annuli.revolution(np.ones_like, HEIGHTS, 31)
    elif abs(angle / (2 * np.pi) % 1) < 1e-9:
        pytest.skip("a translation")
    else:
        cmap = annuli.flat_cone(angle, 1.0, 2.0, 50, 9, cut=4)
    pattern = lay_pattern(cmap, PatternSettings(kind=kind, align="none", around=60))
    sides = SIDES[kind]
    z = cmap.deck.apply(pattern.uv[pattern.faces.values], pattern.sheet).reshape(-1, sides)
    edge = np.roll(z, -1, axis=1) - z
    np.testing.assert_allclose(abs(edge), abs(edge).mean(), rtol=1e-9)
    np.testing.assert_allclose(np.roll(edge, -1, axis=1) / edge, np.exp(2j * np.pi / sides), rtol=1e-9)
    if abs(angle) < 2 * np.pi:  # beyond, a place of the plane stands for several of the surface
        np.testing.assert_allclose(lift(cmap, pattern.uv).points, pattern.vertices, atol=1e-9)


def test_hexagon_angles_tend_to_120_degrees():
    errors = []
    for n in (32, 64, 128):
        cmap = annuli.revolution(np.cosh, np.linspace(-1, 1.5, n // 2 + 1), n)
        pattern = lay_pattern(cmap, PatternSettings(around=n, align="none"))
        p = pattern.vertices[pattern.faces.values].reshape(-1, 6, 3)
        a, b = np.roll(p, 1, axis=1) - p, np.roll(p, -1, axis=1) - p
        cosine = (a * b).sum(axis=2) / np.linalg.norm(a, axis=2) / np.linalg.norm(b, axis=2)
        errors.append(np.sqrt(np.mean((np.arccos(cosine) - 2 * np.pi / 3) ** 2)))
    orders = -np.diff(np.log(errors)) / np.log(2)
    assert orders[-1] > 0.98  # one, approached from below: the second derivative of the map
    assert orders[-1] > orders[0]


@given(
    k=st.integers(-12, 12),
    kind=st.sampled_from(["hex", "triangle", "quad"]),
    around=st.integers(12, 70),
    rotation=st.one_of(st.sampled_from(["edge", "vertex"]), st.floats(-90, 90)),
    grid=st.tuples(st.integers(7, 60), st.integers(2, 14)),
    phase=st.tuples(st.floats(-2, 2), st.floats(-2, 2)),
    boundary=st.sampled_from(["whole", "trim"]),
    align=st.sampled_from(["none", "first", "both"]),
)
@settings(max_examples=120, deadline=None)
def test_every_pattern_closes_or_is_refused(k, kind, around, rotation, grid, phase, boundary, align):
    angle = k * QUANTUM[kind]
    columns, rows = max(grid[0], 3 * abs(k) + 5), grid[1]
    if k == 0:
        cmap = annuli.revolution(wavy, np.linspace(-1, 1.5, rows + 1), columns)
    else:
        cmap = annuli.flat_cone(angle, 1.0, 2.0, columns, rows, cut=columns // 3)
    request = PatternSettings(
        kind=kind, around=around, rotation=rotation, align=align, phase=phase, boundary=boundary
    )
    try:
        pattern = lay_pattern(cmap, request)
    except PatternError:
        assert around < 12 * (abs(k) + 2)  # cells as large as the ring is wide
        return
    if boundary == "whole" and not cmap.deck.is_flat_ring:  # there no ring of cells need go around
        check_closed(pattern)
    assert len(set(pattern.labels())) == pattern.n_cells
    area = cell_areas(cmap, pattern)
    assert area.min() > 0
    if boundary == "trim" and not any("left out" in note for note in pattern.notes):
        assert area.sum() == pytest.approx(domain_area(cmap), rel=1e-9)


@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
def test_a_pattern_hardly_off_the_boundary_is_cut_like_one_on_it(kind):
    """At any distance, that at which points are taken for one included."""
    cmap = annuli.revolution(wavy, np.linspace(-1, 1.5, 3), 7)

    def covered(shift: float) -> float:
        asked = PatternSettings(kind=kind, around=24, align="none", phase=(0.0, shift), boundary="trim")
        return float(cell_areas(cmap, lay_pattern(cmap, asked)).sum())

    on_it = covered(0.0)
    assert on_it == pytest.approx(domain_area(cmap), rel=0.01)
    for shift in np.geomspace(1e-11, 1e-6, 26):
        assert covered(shift) == pytest.approx(on_it, rel=1e-6)


@pytest.mark.parametrize("shift", [0.0, 0.31, 0.02])
@pytest.mark.parametrize("turns", [1, 2])
def test_flat_rings_close_with_the_translation_as_a_lattice_vector(shift, turns):
    """K = ±2πm: a ring that does not quite close is a map like any other; here it spirals by a shift."""
    n, rows = 60 * turns, 10
    phi = np.arange(n) / n
    radius = np.linspace(1.0, 0.4, rows + 1)
    z = radius[:, None] * np.exp(2j * np.pi * turns * phi)[None, :] + shift * phi[None, :]
    faces, sheet = annuli.grid_annulus(n, rows)
    points = np.stack([z.real, z.imag, np.tile(phi, (rows + 1, 1))], axis=-1).reshape(-1, 3)
    deck = Deck(2 * np.pi * turns, complex(shift))
    cmap = annuli.make_map(points, faces, sheet, z.ravel(), deck, n)
    cmap = cmap.with_domain(circumference=2 * np.pi * turns * 0.63)
    for kind in ("hex", "triangle", "quad"):
        pattern = lay_pattern(cmap, PatternSettings(kind=kind, around=64 * turns, boundary="whole"))
        check_closed(pattern)
        assert len(set(pattern.labels())) == pattern.n_cells
        assert pattern.distortion < 0.2
        trimmed = lay_pattern(cmap, PatternSettings(kind=kind, around=64 * turns, boundary="trim"))
        if not any("left out" in note for note in trimmed.notes):
            assert cell_areas(cmap, trimmed).sum() == pytest.approx(domain_area(cmap), rel=1e-9)


@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
@pytest.mark.parametrize("wanted", [0.11, 0.17])
@pytest.mark.parametrize("k", [0, 2, -3])
def test_mean_edge_length_is_met_or_told(kind, wanted, k):
    if k == 0:
        cmap = annuli.revolution(np.cosh, HEIGHTS, 60)
    else:
        cmap = annuli.flat_cone(k * QUANTUM[kind], 2.0, 4.0, 60, 12)
    pattern = lay_pattern(cmap, PatternSettings(kind=kind, edge_length=wanted))
    told = any("instead of" in note for note in pattern.notes)
    assert abs(pattern.edge_length / wanted - 1) < 0.02 or (k == 0 and told)
    p = pattern.vertices[pattern.faces.values].reshape(-1, SIDES[kind], 3)
    edge = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2).mean(axis=1)
    area = np.linalg.norm(np.cross(p, np.roll(p, -1, axis=1)).sum(axis=1), axis=1)
    assert pattern.edge_length == pytest.approx(float(edge @ area / area.sum()), rel=1e-6)


def test_places_run_the_same_way_round_in_every_ring():
    cmap = annuli.revolution(wavy, HEIGHTS, 37, cut=11)
    pattern = lay_pattern(cmap, PatternSettings(around=40))
    mean = centres(pattern)
    for ring in range(pattern.rings):
        members = np.flatnonzero(pattern.ring == ring)
        members = members[np.argsort(pattern.place[members])]
        angle = np.arctan2(mean[members, 1], mean[members, 0])
        step = np.angle(np.exp(1j * np.diff(angle, append=angle[0])))
        assert (step > 0).all()
        assert step.sum() == pytest.approx(2 * np.pi)


def test_directions_of_a_nurbs_surface_are_refused_for_meshes():
    with pytest.raises(PatternError, match="NURBS"):
        lay_pattern(annuli.revolution(wavy, HEIGHTS, 37), PatternSettings(rotation="u"))


def test_phase_moves_the_pattern_and_a_whole_cell_changes_nothing():
    cmap = annuli.revolution(wavy, HEIGHTS, 37)
    base = PatternSettings(around=40, align="both")
    one = lay_pattern(cmap, base)
    assert same_cells(one, lay_pattern(cmap, replace(base, phase=(2.0, 0.0))))
    assert not same_cells(one, lay_pattern(cmap, replace(base, phase=(0.5, 0.0))))
