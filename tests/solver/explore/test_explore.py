"""Foreseeing, choosing and pricing variants."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.errors import PanelsError, SettingError
from hexwrap_solver.explore.foresee import foresee, seated
from hexwrap_solver.explore.front import by_cost, excess, front_of, non_dominated, to_solve
from hexwrap_solver.explore.predict import outlook, shortened
from hexwrap_solver.explore.types import Costs, ExploreSettings, Figures, Limits, Vary
from hexwrap_solver.explore.variants import SPARE, variants
from hexwrap_solver.panels import fit_panels, measure, quantize
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.pipeline import PlainRunner, mapped
from hexwrap_solver.surface import with_openings
from tests.solver.conformal.annuli import bump, catenoid
from tests.solver.conformal.nets import holed
from tests.solver.pattern.folded import ELL, RECTANGLE, prism
from tests.solver.singularities.shapes import dome

NEW = ("brick", "truncated-hexagonal", "truncated-square")


@pytest.mark.parametrize("sides", [3, 4, 6, 8, 12])
def test_cells_are_shortened_as_the_linear_programme_itself_says(sides: int) -> None:
    """The largest regular polygon in a cell whose scale grows, and which is stretched, both slightly."""
    corner = np.exp(2j * np.pi * np.arange(sides) / sides) / (2 * np.sin(np.pi / sides))
    random, small = np.random.default_rng(sides), 1e-4
    gradient, skew = (random.normal(size=(2, 60)) + 1j * random.normal(size=(2, 60))) * [[1], [0.4]]
    skew[:20], gradient[20:40] = 0, 0
    lost = []
    for g, mu in zip(small * gradient, small * skew, strict=True):
        image = corner - g.conjugate() * corner**2 / 2 + mu * corner.conj()
        edge = np.roll(image, -1) - image
        normal = -1j * edge / abs(edge)
        reach = (normal.conj()[:, None] * corner).real.max(axis=1)
        rows = np.stack([normal.real, normal.imag, reach], axis=1)
        room = (normal.conj() * image).real
        found = linprog([0, 0, -1], A_ub=rows, b_ub=room, bounds=[(None, None)] * 3)
        lost.append((1 - found.x[2]) / small)
    assert shortened(corner, gradient, skew) == pytest.approx(np.array(lost), rel=2e-2, abs=2e-3)


@pytest.mark.parametrize("surface", [bump(64, 40), catenoid(64, 40)], ids=["bump", "catenoid"])
@pytest.mark.parametrize(
    ("mode", "kind", "boundary"),
    [
        ("straight", "hex", "whole"),
        ("isometric", "hex", "trim"),
        ("isometric", "quad", "whole"),
        *((("straight", kind, "whole")) for kind in NEW),
    ],
)
def test_foreseen_is_near_measured(surface, mode: str, kind: str, boundary: str) -> None:
    cmap = conformal_map(surface, BoundaryCondition(mode).adapted(kind))
    pattern = PatternSettings(kind=kind, around=32, boundary=boundary)
    laid = lay_pattern(cmap, pattern)
    seen = outlook(cmap, pattern)
    for sizes, joint in ((None, 0.0), (11, 0.0), (4, 0.0), (11, 0.01)):
        settings = PanelSettings(sizes=sizes, joint=joint)
        made = quantize(fit_panels(cmap, laid, settings), settings)
        found = seen.foresee(sizes, joint)
        # of so few rows two have sides with no joint
        near = 0.035 if kind in NEW else 0.02 if joint else 0.008
        assert found.uncovered == pytest.approx(1 - measure(cmap, laid, made).coverage, abs=near)
        assert found.bare == pytest.approx(measure(cmap, laid, made).bare, abs=0.01)
        assert found.panels == pytest.approx(made.n_panels, rel=0.06)
        if sizes and boundary == "whole":
            assert found.types <= sizes * len(LATTICES[kind].outlines)


@pytest.mark.parametrize("corners", [RECTANGLE, ELL], ids=["rectangle", "L"])
def test_folds_of_coarse_meshes_are_foreseen(corners) -> None:
    """Edges much longer than the cells cut as many as short ones do."""
    cmap = conformal_map(prism(corners, 60.0, 60.0), BoundaryCondition("straight").adapted("hex"))
    pattern = PatternSettings(around=32)
    laid, seen = lay_pattern(cmap, pattern), outlook(cmap, pattern)
    made = quantize(fit_panels(cmap, laid, PanelSettings()), PanelSettings())
    assert seen.foresee(11).panels == pytest.approx(made.n_panels, rel=0.01)


@pytest.mark.parametrize(
    ("allowed", "increment", "sizes"),
    [((0.0, 0.09), 0.0, 11), ((0.0, 1.0), 0.02, 11), ((0.0, 0.09), 0.02, 11), ((0.12, 1.0), 0.0, 2)],
)
def test_allowed_lengths_are_foreseen(allowed: tuple[float, float], increment: float, sizes: int) -> None:
    """Cells larger than the longest edge stay partly open, which no number of sizes mends; those too small
    for the range take sizes of their own."""
    cmap = conformal_map(bump(64, 40), BoundaryCondition("straight").adapted("hex"))
    pattern = PatternSettings(around=32)
    laid, seen = lay_pattern(cmap, pattern), outlook(cmap, pattern)
    settings = PanelSettings(sizes=sizes, edge_range=allowed, increment=increment)
    made = quantize(fit_panels(cmap, laid, settings), settings)
    found = seen.foresee(sizes, edge_range=allowed, increment=increment)
    assert found.uncovered == pytest.approx(1 - measure(cmap, laid, made).coverage, abs=0.01)
    assert found.uncovered > seen.foresee(sizes).uncovered + 0.03


def test_more_sizes_never_leave_more_open_and_joints_never_less() -> None:
    seen = outlook(conformal_map(bump(48, 24), BoundaryCondition("straight")), PatternSettings(around=24))
    by_sizes = [seen.foresee(k).uncovered for k in (1, 2, 3, 5, 8, 13, None)]
    assert by_sizes == sorted(by_sizes, reverse=True)
    by_joint = [seen.foresee(5, joint).uncovered for joint in (0.0, 0.01, 0.03, 0.1)]
    assert by_joint == sorted(by_joint)
    assert seen.foresee(5, 1e6).panels == 0


def test_nothing_on_a_front_is_beaten_and_all_else_is() -> None:
    values = np.random.default_rng(5).random((300, 3)).round(2)
    kept = non_dominated(values, (0.0, 0.0, 0.0))
    for i, row in enumerate(values):
        beaten = ((values <= row).all(axis=1) & (values < row).any(axis=1)).any()
        equal_before = (values[kept] == row).all(axis=1).sum()
        assert kept[i] == (not beaten) or equal_before == 1
    fewer = non_dominated(values, (0.05, 0.05, 0.05))
    assert fewer.sum() < kept.sum()
    for row in values:  # within ε of something that is kept
        assert (values[fewer] <= row + 0.05).all(axis=1).any()


def figures(n: int = 400) -> list[Figures]:
    rng = np.random.default_rng(2)
    t = rng.random(n)
    return [
        Figures(float(x), 100, int(12 * (1 - x)) + 1, float(1000 * (2 - x) + 50 * y))
        for x, y in zip(t, rng.random(n), strict=True)
    ]


def test_no_more_are_solved_than_are_allowed_and_the_ends_are_among_them() -> None:
    found = figures()
    picked = to_solve(found, [0.0] * len(found), 30)
    assert len(picked) == len(set(picked.tolist())) == 30
    assert min(one.cost for one in found) == pytest.approx(min(found[i].cost for i in picked), rel=0.01)
    assert min(one.uncovered for one in found) == pytest.approx(
        min(found[i].uncovered for i in picked), abs=2e-3
    )
    assert front_of([found[i] for i in picked]).all()


def test_what_is_proposed_is_cheap_and_closed() -> None:
    open_and_cheap, closed, dear = (
        Figures(0.5, 9, 1, 80.0),
        Figures(0.03, 9, 9, 100.0),
        Figures(0.02, 9, 9, 300.0),
    )
    assert by_cost([open_and_cheap, closed, dear])[0] == 1


def test_large_cells_that_leave_the_ends_bare_do_not_look_cheap() -> None:
    large, small = Figures(0.05, 50, 5, 70.0, bare=0.3), Figures(0.05, 200, 5, 100.0, bare=0.05)
    assert by_cost([large, small]) == [1, 0]
    assert front_of([large, small]).tolist() == [True, True]
    assert to_solve([large, small], [0.0, 0.0]).tolist() == [0, 1]
    assert front_of([large, replace(small, bare=0.29)]).tolist() == [True, False]


def test_limits() -> None:
    one = Figures(0.1, 100, 5, 1.0, 0.03)
    assert not excess(one, Limits(), 5)
    assert not excess(one, Limits(sizes=5, max_gap=0.03, panels=100), 5)
    assert excess(one, Limits(sizes=4), 5) == pytest.approx(0.25)
    assert excess(one, Limits(sizes=4, panels=50), 5) == pytest.approx(1.25)
    assert excess(one, Limits(max_gap=0.0), 5) > 1e6
    assert not excess(replace(one, gap_max=None), Limits(max_gap=0.02), 5)
    assert not excess(replace(one, gap_max=0.0), Limits(max_gap=0.0), 5)


def test_what_comes_nearest_to_limits_is_solved_where_none_keeps_them() -> None:
    found = [Figures(0.1 + n / 1000, n, 2, 1.0 + n) for n in (300, 102, 100, 200)]
    near = [excess(one, Limits(panels=10), 2) for one in found]
    assert to_solve(found, near).tolist() == [2]
    assert to_solve(found[:0], []).tolist() == []


def test_cost_is_the_same_in_every_unit() -> None:
    cost = Costs(per_type=10, per_panel=1, per_area=2, per_joint_length=3, sheet_waste=0.5)
    assert cost.of(4, 5, 6.0, 7.0) == 4 * 10 + 5 * 1 + 6 * 1.5 * 2 + 7 * 3
    assert cost.of(4, 5, 6e6, 7e3, 1e-3) == pytest.approx(cost.of(4, 5, 6.0, 7.0))


def test_variants_are_different_within_the_ranges_and_the_same_for_a_seed() -> None:
    vary = Vary(around=(20, 40), sizes=(2, 6), joint=(0.0, 0.02), kind=("hex", "quad"), singularities=(0, 3))
    settings = ExploreSettings(vary=vary, variants=150, seed=4)
    listed = variants(settings, 1.0)
    assert len(listed) == len(set(listed)) == 150 * SPARE
    assert variants(settings, 1.0) == listed
    assert variants(replace(settings, seed=5), 1.0) != listed
    assert listed[0].frame.boundary.mode == "auto"  # what would be taken without exploring
    for one in listed[1:]:
        assert 20 <= one.frame.pattern.around <= 40
        assert 2 <= one.sizes <= 6
        assert 0 <= one.joint <= 0.02
        assert one.singularities in (0, 3)
    every = {(one.frame.boundary.mode, one.frame.pattern.kind, one.singularities) for one in listed[1:]}
    assert len(every) == 2 * 2 * 2
    few = variants(ExploreSettings(vary=Vary(("straight",), (0,), sizes=(3, 4)), variants=500), 1.0)
    assert len(few) == 1 + 3 * 2  # there are no more


@pytest.mark.parametrize(
    "wrong",
    [
        {"sizes": (3, 2)},
        {"around": (8, 7)},
        {"edge_length": (2.0, 1.0)},
        {"joint": (1.0, 0.0)},
        {"around": (8, 9), "edge_length": (1.0, 2.0)},
        {"boundary": ()},
        {"singularities": ()},
        {"kind": ()},
    ],
)
def test_ranges_out_of_order_are_refused(wrong: dict) -> None:
    with pytest.raises(SettingError):
        Vary(**wrong)


def test_numbers_of_sizes_beyond_their_limit_are_not_tried() -> None:
    settings = ExploreSettings(limits=Limits(sizes=3), variants=20)
    assert {one.sizes for one in variants(settings, 1.0)} == {1, 2, 3}
    assert {one.sizes for one in variants(replace(settings, vary=Vary(sizes=(5, 9))), 1.0)} == {3, 5}


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        (PanelSettings(increment=50.0), "increment"),
        (PanelSettings(joint=50.0), "joint"),
        (PanelSettings(increment=0.01, joint=50.0), "joint"),
    ],
)
def test_what_leaves_no_panel_is_named(settings: PanelSettings, field: str) -> None:
    asked = ExploreSettings(panels=settings, variants=1)
    listed = variants(asked, 0.2)[:1]
    (one,) = foresee(lambda: bump(16, 8), asked, (), listed, PlainRunner())
    assert isinstance(one.foreseen, PanelsError)
    assert one.foreseen.field == (field,)


def test_singularities_of_a_wall_with_windows_add_up_with_these_filled() -> None:
    whole = bump(32, 24)
    wall = with_openings(holed(whole, whole.vertices[[32 * 12]], 0.35), "cut")
    settings = ExploreSettings(vary=Vary(boundary=("straight",), singularities=(2, 3)), variants=4)
    listed = [one for one in variants(settings, 0.15) if one.singularities]
    parts = seated(lambda: wall, settings, listed[:1], PlainRunner())
    for at, some in parts:
        assert sum(one.index for one in at) == 0
        assert foresee(lambda: wall, settings, at, some, PlainRunner())[0].foreseen is not None


@pytest.mark.parametrize(
    ("surface", "numbers"), [(bump(48, 30), {2, 4}), (dome(1200), {6, 8})], ids=["straight ends", "dome"]
)
def test_foreseen_with_singularities_and_straight_ends(surface, numbers: set[int]) -> None:
    """The ends are lines of the pattern, all variants of a frame share the singularities that are searched
    once, and where there must be some, none is without."""
    vary = Vary(boundary=("straight",), singularities=tuple(numbers), edge_length=(0.12, 0.12), sizes=(6, 9))
    settings = ExploreSettings(vary=vary, variants=12)
    listed = [one for one in variants(settings, None) if one.frame.boundary.mode == "straight"]
    parts = seated(lambda: surface, settings, listed, PlainRunner())
    assert numbers <= {len(at) for at, _ in parts}
    assert {len(at) == 0 for at, _ in parts} == {False}
    for at, some in parts:
        one = foresee(lambda: surface, settings, at, some, PlainRunner())[0]
        assert isinstance(one.foreseen, Figures)
        if len(at) == 6:  # as when none are wanted, so that none are searched
            assert foresee(lambda: surface, settings, (), some, PlainRunner())[0] == one
        cmap, _ = mapped(lambda: surface, one.settings, PlainRunner())
        assert len(cmap.cones) == len(at)
        laid = lay_pattern(cmap, one.settings.pattern)
        made = quantize(fit_panels(cmap, laid, one.settings.panels), one.settings.panels)
        assert one.foreseen.panels == pytest.approx(made.n_panels, rel=0.01)
        assert one.foreseen.uncovered == pytest.approx(1 - measure(cmap, laid, made).coverage, abs=0.006)
