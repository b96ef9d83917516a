"""Corners in the boundary: every straight side lies on a lattice line, and the pattern still closes."""

from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest

from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.errors import PatternError
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.place import choose, size
from hexwrap_solver.pattern.place.align import Straightening
from hexwrap_solver.pattern.place.choose import PlacementFamily, loops_to_align, place_lattice
from hexwrap_solver.pattern.place.deform import distortion_of
from hexwrap_solver.pattern.place.glued import Glued
from hexwrap_solver.pattern.place.rows import rows_along
from hexwrap_solver.pattern.place.sides import sides_of
from hexwrap_solver.pattern.types import PatternSettings
from tests.solver.conformal.annuli import corners_at
from tests.solver.pattern import annuli
from tests.solver.pattern.test_lay import check_closed
from tests.solver.pattern.test_trim import cell_areas, domain_area, euler

lay_module = importlib.import_module("hexwrap_solver.pattern.lay_pattern")

#: Boundary vertices of a grid with 48 columns and 16 rows, and their angles in units of π.
CASES = {
    "quads": ([0, 24], [0, 24], [3 / 2] * 2, [1 / 2] * 2, -np.pi),
    "cone": ([0, 16, 32], [0, 16, 32], [4 / 3] * 3, [2 / 3] * 3, -np.pi),
    "entrance": ([10, 14, 18], [], [4 / 3, 1 / 3, 4 / 3], [], 0.0),
    "two entrances": ([2, 5, 8, 25, 29, 33], [], [4 / 3, 1 / 3, 4 / 3] * 2, [], 0.0),
}


def bell(low: list[int], high: list[int], low_angles, high_angles, _: float) -> ConformalMap:
    """A bell, not of revolution, with corners in its boundary."""
    n, rows = 48, 16
    base = annuli.revolution(lambda z: 1 + 0.5 * z + 0.1 * z**2, np.linspace(0, 1.6, rows + 1), n)
    points = base.surface.vertices.copy()
    points[:, 0] *= 1.2 + 0.1 * np.sin(points[:, 2])
    points[:, 1] += 0.2 * points[:, 2]
    cmap = annuli.make_map(points, base.surface.faces, base.sheet, base.uv, base.deck, n)
    vertices = np.array(low + [n * rows + i for i in high])
    angles = np.pi * np.array(low_angles + high_angles)
    return conformal_map(cmap.surface, corners_at(vertices, angles))


class Maps(dict[str, ConformalMap]):
    """Made when first asked for: not by who merely collects the tests."""

    def __missing__(self, case: str) -> ConformalMap:
        return self.setdefault(case, bell(*CASES[case]))


MAPS = Maps()


HEX_CASES = [case for case in CASES if case != "quads"]


@pytest.mark.parametrize(
    ("case", "kind"),
    [("quads", "quad"), *((case, kind) for case in HEX_CASES for kind in ("hex", "triangle"))],
)
@pytest.mark.parametrize("align", ["first", "both"])
@pytest.mark.parametrize("rotation", ["edge", "vertex"])
def test_every_side_lies_on_a_lattice_line(case, align, rotation, kind):
    cmap = MAPS[case]
    assert cmap.deck.angle == pytest.approx(CASES[case][4], abs=1e-9)
    lattice = LATTICES[kind]
    request = PatternSettings(kind=kind, rotation=rotation, align=align, around=96)
    placed = place_lattice(cmap, lattice, request)
    assert not placed.notes
    loops, _ = loops_to_align(cmap, lattice, request)
    assert loops == {"first": [0], "both": [0, 1]}[align]
    sides = sides_of(cmap, lattice, loops)
    rows = rows_along(lattice, 0.0 if rotation == "edge" else lattice.quantum / 2, "whole")
    place = placed.motion.carry(placed.place[sides.vertex], sides.sheet)
    for side in range(sides.n):
        z = place[sides.side == side]
        along = (z[-1] - z[0]) / abs(z[-1] - z[0])
        depth = (z * np.conj(1j * along)).real
        assert np.ptp(depth) < 1e-9
        steps = (depth.mean() - rows.first) / rows.period
        assert steps == pytest.approx(round(steps), abs=1e-9)
    glued = Glued.by_sheets(cmap, placed.motion)
    assert placed.distortion == pytest.approx(distortion_of(cmap, glued, placed.place), rel=1e-6)
    assert placed.distortion < 0.3


@pytest.mark.parametrize("case", HEX_CASES)
def test_patterns_with_corners_close_and_fill_the_deformed_domain(case):
    cmap = MAPS[case]
    check_closed(lay_pattern(cmap, PatternSettings(around=60)))
    pattern = lay_pattern(cmap, PatternSettings(around=60, boundary="trim"))
    assert euler(pattern) == 0
    assert 0 < pattern.distortion < 0.3
    # Every cell away from the corners is whole, or an exact half: a trapezoid of four corners.
    lengths = pattern.faces.lengths[~pattern.whole]
    assert np.count_nonzero(lengths != 4) <= 2 * sum(len(x) for x in CASES[case][:2])
    assert (pattern.faces.lengths[pattern.whole] == 6).all()
    assert (cell_areas(cmap, pattern) > 0).all()


def test_distortion_falls_with_the_size_of_the_cells():
    def worst(counts: list[int]) -> float:
        requests = [PatternSettings(around=n, align="first") for n in counts]
        return max(place_lattice(MAPS["entrance"], LATTICES["hex"], r).distortion for r in requests)

    assert worst([320, 352, 384]) < worst([40, 44, 48]) / 2


def test_quads_fill_a_domain_of_right_angles_without_a_remainder():
    pattern = lay_pattern(MAPS["quads"], PatternSettings(kind="quad", around=60, boundary="trim"))
    assert pattern.whole.all()
    check_closed(pattern)
    area = cell_areas(MAPS["quads"], pattern)
    assert area.sum() == pytest.approx(domain_area(MAPS["quads"]), rel=1e-9)


def test_phase_without_freedom_is_told():
    shifted = PatternSettings(around=60, phase=(0.5, 0.5))
    assert any("phase" in note for note in lay_pattern(MAPS["entrance"], shifted).notes)
    tube = annuli.revolution(np.cosh, np.linspace(-1, 1, 15), 40)
    assert any("phase" in note for note in lay_pattern(tube, shifted).notes)
    free = lay_pattern(tube, PatternSettings(around=60, phase=(0.5, 0.5), align="none"))
    assert not any("phase" in note for note in free.notes)


def test_alignment_that_cannot_be_is_told():
    cone = annuli.flat_cone(np.pi, 1.0, 2.0, 60, 12)
    assert any("not aligned" in note for note in lay_pattern(cone, PatternSettings()).notes)
    tube = annuli.revolution(np.cosh, np.linspace(-1, 1, 15), 40)
    assert any("not aligned" in note for note in lay_pattern(tube, PatternSettings(rotation=10.0)).notes)


def test_loops_turned_against_each_other_are_not_both_aligned():
    """Sides of one loop stand at multiples of the quantum, those of two loops at any angle to each other."""
    low, _, angles, other, K = CASES["cone"]
    turned = bell(low, [8, 24, 40], angles, other, K)
    pattern = lay_pattern(turned, PatternSettings(around=60))
    assert any("about the apex" in note for note in pattern.notes)
    assert pattern.distortion < 0.2
    check_closed(pattern)


def test_cells_larger_than_the_narrowest_place_are_refused():
    with pytest.raises(PatternError, match="close up"):
        lay_pattern(MAPS["cone"], PatternSettings(around=3))


def test_a_default_size_that_does_not_close_up_is_made_smaller(monkeypatch):
    """Nobody asked for it; sizes that are asked for are refused as before."""
    monkeypatch.setattr(size, "default_edge", lambda cmap, *_: cmap.circumference / 3)
    with monkeypatch.context() as only_that:
        only_that.setattr(lay_module, "FINER", ())
        with pytest.raises(PatternError, match="close up"):
            lay_pattern(MAPS["cone"], PatternSettings(align="none"))
    pattern = lay_pattern(MAPS["cone"], PatternSettings(align="none"))
    check_closed(pattern)
    assert any(f"these are {pattern.edge_length:.3g} long" in note for note in pattern.notes)


def test_another_number_around_than_asked_for_is_told() -> None:
    others = 0
    for name, around in (("cone", 41), ("quads", 37)):
        cmap = MAPS[name]
        for align in ("both", "none"):
            kind = "quad" if name == "quads" else "hex"
            request = PatternSettings(kind=kind, around=around, align=align, phase=(0.0, 0.45))
            pattern = lay_pattern(cmap, request)
            told = any(f"{pattern.around} cells around instead of {around}" in note for note in pattern.notes)
            assert told == (pattern.around != around)
            others += told
    assert others


@pytest.mark.parametrize("size", [{"around": 10**9}, {"edge_length": 1e-30}])
def test_far_too_many_cells_around_are_refused_at_once(size):
    """Nothing is made first that has as many entries as cells stand around."""
    with pytest.raises(PatternError, match="over the limit of 1,000,000"):
        lay_pattern(MAPS["entrance"], PatternSettings(**size))


def test_what_sizes_share_serves_every_number_around():
    first = PatternSettings(around=60)
    placing = PlacementFamily.of(MAPS["entrance"], LATTICES["hex"], first)
    for around in (60, 96):
        wanted = replace(first, around=around)
        once, fresh = placing.at(wanted), place_lattice(MAPS["entrance"], LATTICES["hex"], wanted)
        assert once.around == fresh.around == around
        np.testing.assert_array_equal(once.place, fresh.place)


def test_a_mesh_of_corners_alone_has_nothing_to_deform():
    """A frustum of six vertices: each stands where two lines meet."""
    base = annuli.revolution(lambda z: 2 - z, np.linspace(0, 1, 2), 3)
    angles = np.pi * np.repeat([4 / 3, 2 / 3], 3)
    cmap = conformal_map(base.surface, corners_at(np.arange(6), angles))
    pattern = lay_pattern(cmap, PatternSettings(around=24))
    check_closed(pattern)
    assert np.isfinite(pattern.distortion)


def test_of_one_pattern_every_loop_is_straightened_once(monkeypatch):
    """However many sizes are tried, and though no alignment is bearable here."""
    made = []
    of = Straightening.of.__func__
    monkeypatch.setattr(Straightening, "of", lambda *a: (made.append(a[-1]), of(Straightening, *a))[1])
    monkeypatch.setattr(choose, "BEARABLE", 0.0)
    placing = PlacementFamily.of(MAPS["entrance"], LATTICES["hex"], PatternSettings(around=60))
    for around in (60, 96):
        placing.at(PatternSettings(around=around))
    assert made == [[0, 1], [0], [1]]


def test_an_end_that_is_nearly_straight_is_made_so_gently_and_what_that_takes_is_told():
    """A wavy end of a cylinder, whose map is its unrolling: so high is the wave in the domain."""
    n, rows = 96, 24
    base = annuli.revolution(lambda z: 1 + 0 * z, np.linspace(0, 2, rows + 1), n)
    points = base.surface.vertices.copy()
    wave = 0.015 * np.cos(np.arctan2(points[:, 1], points[:, 0]))
    points[:, 2] += wave * points[:, 2] / 2
    surface = annuli.make_map(points, base.surface.faces, base.sheet, base.uv, base.deck, n).surface
    cmap = conformal_map(surface, BoundaryCondition("isometric"))
    heights = np.imag(cmap.uv[surface.loops[1]] * np.conj(cmap.deck.translation)) / abs(cmap.deck.translation)
    assert np.ptp(heights) > 0.025
    placing = PlacementFamily.of(cmap, LATTICES["hex"], PatternSettings(around=96))
    placement = placing.at(PatternSettings(around=96))
    assert placing.loops == [0, 1]
    assert np.ptp(placement.place[surface.loops[1]].imag) < 1e-9
    ratio = distortion_of(placing.cmap, placement.glued, placement.place)
    assert placement.distortion == pytest.approx(ratio)
    assert ratio < 0.05
