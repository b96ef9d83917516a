"""The whole way on real stages: from a mesh to panels, components and support."""

from __future__ import annotations

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.panels.types import ComponentSettings, PanelSettings, Weights
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.pipeline import PlainRunner, SolveSettings, solve
from hexwrap_solver.surface import surface_from_mesh
from hexwrap_solver.surface.types import SentMesh
from tests.solver.panels.cells import catenoid, cylinder, grid_map, inverted


def take_in():
    surface = grid_map(inverted(catenoid, (0.4, 0.3, 4.0)), 60, 24, -0.8, 0.9).surface
    return surface_from_mesh(SentMesh(10 * surface.vertices, Ragged.from_table(surface.faces)))


def run(pattern=None, panels=None, **options):
    runner = PlainRunner()
    pattern = PatternSettings(around=24) if pattern is None else pattern
    boundary = options.pop("boundary", BoundaryCondition("straight"))
    return solve(take_in, SolveSettings(boundary, pattern, panels, **options), runner), runner


def test_hexagons_close_up_and_panels_keep_the_contract():
    solution, runner = run(panels=PanelSettings())
    pattern, panels, quality = solution.pattern, solution.panels, solution.quality
    neighbours = pattern.neighbours.values.reshape(-1, 6)
    inner = (pattern.ring > 0) & (pattern.ring < pattern.rings - 1)
    assert (neighbours[inner] >= 0).all()
    assert quality.planarity.max() < 1e-9
    assert quality.edge_deviation.max() < 1e-9
    assert quality.angle_deviation.max() < 1e-9
    assert quality.overlaps == 0
    assert len(panels.class_length) == 11
    stages = [
        "surface",
        "map",
        "pattern",
        "fit",
        "trade-off",
        "panels",
        "quality",
        "trimmed",
        "seats",
        "outlook",
    ]
    assert list(runner.timings)[: len(stages)] == stages  # and what else could have been asked for


@pytest.mark.parametrize("edge", [1e-12, 1e30])
def test_of_senseless_edges_the_usual_is_proposed(edge):
    size = float(np.linalg.norm(np.ptp(take_in().vertices, axis=0)))
    with pytest.raises(HexwrapError, match=f"did you mean {size / 50:.4g}"):
        run(PatternSettings(edge_length=edge))


def test_panels_that_a_tip_holds_off_the_surface_are_told():
    """A cell at the tip of a steep cone goes all around it; on a flat roof of the same plan none does."""
    angle, radius = 2 * np.pi * np.arange(24) / 24, np.linspace(9, 0.5, 18)
    ring = radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    i, j = np.divmod(np.arange(17 * 24), 24)
    quads = np.stack([24 * i + j, 24 * i + (j + 1) % 24, 24 * i + 24 + (j + 1) % 24, 24 * i + 24 + j], axis=1)
    fan = np.stack(
        [24 * 17 + np.arange(24), 24 * 17 + (np.arange(24) + 1) % 24, np.full(24, 24 * 18)], axis=1
    )
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], fan])
    for height, told in ((30, True), (1, False)):
        z = np.repeat(height * (1 - radius / 9), 24)
        points = np.vstack([np.column_stack([ring.reshape(-1, 2), z]), [0, 0, height]])
        sent = SentMesh(points, Ragged.from_table(faces))
        wanted = SolveSettings(BoundaryCondition("auto"), PatternSettings(), PanelSettings())
        quality = solve(lambda sent=sent: surface_from_mesh(sent), wanted, PlainRunner()).quality
        assert any("off the surface by more than half an edge" in note for note in quality.notes) == told


@pytest.mark.parametrize("kind", list(LATTICES))
@pytest.mark.parametrize("boundary", ["whole", "trim"])
@pytest.mark.parametrize("align", ["none", "both"])
def test_no_kind_of_pattern_overlaps(kind, boundary, align):
    pattern = PatternSettings(kind=kind, around=24, boundary=boundary, align=align)
    solution, _ = run(pattern, PanelSettings(joint=0.002))
    assert solution.quality.overlaps == 0
    assert solution.quality.planarity.max() < 1e-9
    assert (solution.panels.whole | (solution.panels.size == -1)).all()
    assert np.nanmin(solution.quality.gap_tangential) >= 0.002 - 1e-9


def test_components_and_support_come_where_asked_for():
    with_parts, _ = run(
        panels=PanelSettings(components=ComponentSettings(inset=0.01, thickness=0.02, depth=0.1))
    )
    assert with_parts.components.solid_vertices is not None
    assert np.degrees(with_parts.support.torsion.max()) < 1e-9
    alone, runner = run(panels=None, support=True)
    assert alone.components is None
    assert len(alone.support.axes) == len(alone.pattern.vertices)
    assert "fit" not in runner.timings
    assert run(panels=PanelSettings())[0].support is None


def test_stages_run_with_one_blas_thread_and_leave_the_callers_setting_alone():
    def threads():
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    seen = []

    class Runner(PlainRunner):
        def __call__(self, stage, settings, compute, after=None):
            seen.append(threads())
            return super().__call__(stage, settings, compute, after)

    with threadpool_limits(2, user_api="blas"):
        before = threads()
        solve(take_in, SolveSettings(pattern=None, panels=None), Runner())
        assert threads() == before
    assert seen == [{1} if before else set()] * 3  # Accelerate on macOS has no threads to set


def drawn_surface(random: np.random.Generator) -> SentMesh:
    """A coarse tube, ring or funnel with noise, at a drawn scale and distance from the origin."""
    around, rows = int(random.choice([3, 5, 8, 12])), int(random.choice([1, 2, 4]))
    phi, s = (
        x.ravel() for x in np.meshgrid(2 * np.pi * np.arange(around) / around, np.arange(rows + 1) / rows)
    )
    wide, tall = random.choice([[0, 2], [1, 0], [2, 3]])
    points = np.stack([(1 + wide * s) * np.cos(phi), (1 + wide * s) * np.sin(phi), tall * s], axis=1)
    points += random.choice([0, 0.05, 0.3]) * random.standard_normal(points.shape)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(around), np.arange(rows)))
    a, b = j * around + i, j * around + (i + 1) % around
    quads = np.stack([a, b, b + around, a + around], axis=1)
    return SentMesh(
        10.0 ** random.choice([-3, 0, 9]) * (points + random.choice([0.0, 1e3])), Ragged.from_table(quads)
    )


@pytest.mark.parametrize("group", range(4))
def test_whatever_is_asked_of_whatever_surface_is_done_or_refused(group):
    """No warning (an error here), no other exception, no overlap, no irregular whole panel; and not all are
    refused."""
    assert sum(done(seed) for seed in range(6 * group, 6 * group + 6)) >= 1


def done(seed):
    """Whether what was drawn was not refused."""
    random = np.random.default_rng(seed)

    def one_of(*options):
        return options[random.integers(len(options))]

    sent = drawn_surface(random)
    quantum = one_of("none", "hex", "quad")
    condition = BoundaryCondition(
        one_of("straight", "isometric"), quantum=quantum, spread=one_of("even", "optimal")
    )
    pattern = PatternSettings(
        kind=one_of("hex", "triangle", "quad"),
        around=one_of(1, 3, 8, 17, 24),
        rotation=one_of("edge", "vertex", 7.3),
        align=one_of("none", "first", "both"),
        boundary=one_of("whole", "trim"),
        phase=(one_of(0.0, 0.3), one_of(0.0, -2.7)),
    )
    panels = PanelSettings(
        mode=one_of("split", "split", "watertight"),
        sizes=one_of(None, 1, 3),
        target=one_of("shortest", "inscribed", "best"),
        orientation=one_of("fit", "tangent"),
        method=one_of("exact", "energy"),
        weights=Weights(surface=one_of(0.0, 1.0)),
    )
    try:
        found = solve(lambda: surface_from_mesh(sent), SolveSettings(condition, pattern, panels))
    except HexwrapError:
        return False
    if panels.mode == "split":
        whole = found.panels.whole
        assert found.quality.overlaps == 0
        assert found.quality.planarity[whole].max(initial=0.0) < 1e-9
        assert found.quality.edge_deviation[whole].max(initial=0.0) < 1e-9
    return True


@pytest.mark.parametrize(("chart", "kind"), [(catenoid, "trihexagonal"), (cylinder, "hex")])
def test_the_kind_of_watertight_panels_follows_the_curvature(chart, kind):
    surface = grid_map(chart, 40, 12, -0.6, 0.6).surface

    def solved(pattern: PatternSettings, mode: str = "watertight"):
        return solve(lambda: surface, SolveSettings(pattern=pattern, panels=PanelSettings(mode=mode)))

    chosen = solved(PatternSettings(around=12))
    assert chosen.pattern.kind == kind
    assert chosen.quality.convex.all()
    assert chosen.quality.planarity.max() < 1e-9
    asked = solved(PatternSettings(kind, around=12))
    said = set(chosen.quality.notes) - set(asked.quality.notes)
    assert [note.split(",")[0] for note in said] == ["Pattern: trihexagonal"] * (kind != "hex")
    assert solved(PatternSettings(around=12), "split").pattern.kind == "hex"
