"""Patterns along creases: no cell crosses a fold, and lines of the pattern follow it where they can."""

from __future__ import annotations

import importlib
from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
import pytest

from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.panels.polygons import best_plane_distances, fan_areas
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.lay.edges import PatternEdges
from hexwrap_solver.pattern.lay.layout import Layout
from hexwrap_solver.pattern.lay.nodes import Nodes
from hexwrap_solver.pattern.place import choose
from hexwrap_solver.pattern.place.choose import PlacementFamily
from hexwrap_solver.pattern.place.deform import distortion_of
from hexwrap_solver.pattern.place.features import chains_of, lasting, least_where_they_meet
from hexwrap_solver.pattern.place.placement import cost_of
from hexwrap_solver.pattern.trim.boundary import Boundary
from hexwrap_solver.pattern.trim.tips import ending_at_tips
from hexwrap_solver.pattern.types import Kind, Pattern, PatternSettings
from hexwrap_solver.surface import surface_from_mesh
from hexwrap_solver.surface.drawn import with_lines
from hexwrap_solver.surface.types import SurfaceSettings
from tests.solver.pattern.folded import ELL, RECTANGLE, grid, plan, prism

PLANS = {"box": RECTANGLE, "ell": ELL}


@cache
def solved(plan: str, twist: float = 0.0) -> ConformalMap:
    return conformal_map(prism(PLANS[plan], edge=2.0, twist=twist), BoundaryCondition("straight"))


def euler(pattern: Pattern) -> int:
    edges = (len(pattern.faces.values) + int((pattern.neighbours.values < 0).sum())) // 2
    return len(pattern.vertices) - edges + pattern.n_cells


@pytest.mark.parametrize("plan", ["box", "ell"])
@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
@pytest.mark.parametrize("rotation", ["edge", "vertex", 10.0])
def test_no_cell_crosses_a_fold_and_nothing_is_lost(plan: str, kind: Kind, rotation: float) -> None:
    """Aligned or not: cells lie in the planes of the walls, meet across folds and cover the whole."""
    cmap = solved(plan)
    pattern = lay_pattern(cmap, PatternSettings(kind, around=37, rotation=rotation, boundary="trim"))
    assert abs(best_plane_distances(pattern.cells)).max() < 1e-12 * 60
    assert euler(pattern) == 0
    area = fan_areas(pattern.cells)
    assert (area > 0).all()
    sides = np.array(PLANS[plan])
    wall = 60 * np.linalg.norm(np.roll(sides, -1, axis=0) - sides, axis=1).sum()
    assert area.sum() == pytest.approx(wall, rel=2e-3)  # slivers left out, or joined around a corner


@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
@pytest.mark.parametrize("rotation", ["edge", "vertex"])
def test_creases_lie_on_lines_and_cut_cells_into_exact_parts(kind: Kind, rotation: str) -> None:
    cmap = solved("box")
    settings = PatternSettings(kind, around=60, rotation=rotation, boundary="trim")
    lattice = LATTICES[kind]
    placement = PlacementFamily.of(cmap, lattice, settings).at(settings)
    assert placement.straight == {0, 1, 2, 3}
    assert np.isfinite(distortion_of(cmap, placement.glued, placement.place))  # no triangle turned over
    assert placement.distortion < 0.012
    along = complex(lattice.position(np.array(placement.motion.shift)))
    for feature in cmap.surface.features:
        offset = (placement.place[feature.vertices] * np.conj(along)).real / abs(along)
        period = lattice.period_along(along) / lattice.edge
        apart = (offset - offset[0]) / (lattice.edge * period)
        assert abs(apart - np.rint(apart)).max() < 1e-9  # one line, up to turns around
    pattern = lay_pattern(cmap, settings)
    part = fan_areas(pattern.cells)[~pattern.whole] / np.median(fan_areas(pattern.cells)[pattern.whole])
    assert abs(4 * part - np.rint(4 * part)).max(initial=0.0) < 1e-6


@pytest.mark.parametrize("kind", ["hex", "quad"])
def test_leaning_creases_are_followed_at_the_price_of_their_lean(kind: Kind) -> None:
    cmap = solved("box", np.deg2rad(20.0))
    pattern = lay_pattern(cmap, PatternSettings(kind, around=60, boundary="trim"))
    lean = np.deg2rad(4.05)
    assert 0.5 * (1 / np.tan(np.pi / 4 - lean / 2) - 1) < pattern.distortion < 0.15
    assert euler(pattern) == 0


@pytest.mark.parametrize("kind", ["hex", "quad"])
def test_drawn_lines_are_followed_as_creases_are(kind: Kind) -> None:
    """Across the creases of a box, and one that ends within an edge of the pattern, on either side of it."""
    box = prism(RECTANGLE, edge=2.0)
    x, y = box.vertices[:, 0].max(), box.vertices[:, 1].max()
    ring = np.array([(-x, -y, 22.3), (x, -y, 22.3), (x, y, 22.3), (-x, y, 22.3), (-x, -y, 22.3)])
    stub = np.array([(0.3, -y, 31.1), (0.3, -y, 47.2)])
    cmap = conformal_map(with_lines(box, [ring, stub]), BoundaryCondition("straight"))
    pattern = lay_pattern(cmap, PatternSettings(kind, around=37, boundary="trim"))
    assert euler(pattern) == 0
    around, up, *creases = pattern.features
    assert all(feature.straight for feature in pattern.features)
    assert len(creases) == 4
    assert abs(pattern.vertices[around.vertices, 2] - 22.3).max() < 1e-9
    assert abs(pattern.vertices[up.vertices, 0] - 0.3).max() < 0.05
    assert np.ptp(pattern.vertices[up.vertices, 2]) > 10
    area = fan_areas(pattern.cells)
    assert (area > 0).all()
    assert area.sum() == pytest.approx(60 * 100, rel=2e-3)


@cache
def slit() -> ConformalMap:
    """Creases of a box that end inside, at both ends."""
    surface = prism(RECTANGLE, edge=2.0)
    part = tuple(replace(f, vertices=f.vertices[8:20]) for f in surface.features)
    return conformal_map(replace(surface, features=part), BoundaryCondition("straight"))


@pytest.mark.parametrize(
    ("kind", "around", "rotation"),
    [("quad", 37, "edge"), ("quad", 49, "vertex"), ("hex", 37, "vertex"), ("triangle", 30, 11.0)],
)
def test_folds_that_end_inside_lose_no_cell(kind: Kind, around: int, rotation: float | str) -> None:
    settings = PatternSettings(kind, around=around, rotation=rotation, boundary="trim")
    pattern = lay_pattern(slit(), settings)
    assert euler(pattern) == 0
    assert not any("touch themselves" in note or "share no edge" in note for note in pattern.notes)


@pytest.mark.parametrize(("kind", "rotation"), [("quad", "edge"), ("hex", "vertex")])
def test_every_edge_is_that_of_its_other_end_where_folds_end(
    kind: Kind, rotation: Literal["edge", "vertex"], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An edge of the pattern that runs along a fold over its end is found from both sides of it."""
    module = importlib.import_module("hexwrap_solver.pattern.lay_pattern")

    def unmatched(edges: PatternEdges) -> int:
        back, there = edges.back.ravel(), np.flatnonzero(edges.head.ravel() >= 0)
        return int((back[back[there]] != there).sum())

    def ending(layout: Layout, nodes: Nodes, edges: PatternEdges, boundary: Boundary) -> PatternEdges:
        assert unmatched(edges) > 0
        ended = ending_at_tips(layout, nodes, edges, boundary)
        assert unmatched(ended) == 0
        return ended

    monkeypatch.setattr(module, "ending_at_tips", ending)
    lay_pattern(slit(), PatternSettings(kind, around=37, rotation=rotation, boundary="trim"))


def test_edges_through_a_vertex_of_a_fold_are_found_once() -> None:
    pattern = lay_pattern(solved("ell"), PatternSettings("quad", around=37, rotation=11.0, boundary="trim"))
    assert euler(pattern) == 0
    assert fan_areas(pattern.cells).sum() == pytest.approx(120 * 60, rel=1e-9)
    assert not any("touch themselves" in note for note in pattern.notes)


@pytest.mark.parametrize("kind", ["hex", "quad"])
@pytest.mark.parametrize("seed", range(4))
def test_no_cell_crosses_a_fold_of_any_prism(seed: int, kind: Kind) -> None:
    """Of three to seven walls at random angles, at any rotation, with cells of a third of the narrowest wall
    or less: each lies in the plane of one wall, and those on both sides of a fold share their nodes."""
    rng = np.random.default_rng(seed)
    walls = int(rng.integers(3, 8))
    turn = 2 * np.pi / walls * (np.arange(walls) + rng.uniform(-0.3, 0.3, walls))
    corners = tuple((float(x), float(y)) for x, y in 15 * np.stack([np.cos(turn), np.sin(turn)], axis=1))
    cmap = conformal_map(prism(corners, height=40.0, edge=3.0), BoundaryCondition("straight"))
    rotation = ("edge", "vertex", float(rng.uniform(0, 30)))[seed % 3]
    base = np.array(corners) - plan(corners, 3.0).mean(axis=0)
    side = np.roll(base, -1, axis=0) - base
    width = np.linalg.norm(side, axis=1)
    around = int(np.ceil(rng.uniform(3, 4) * width.sum() / width.min()))
    pattern = lay_pattern(cmap, PatternSettings(kind, around=around, rotation=rotation, boundary="trim"))
    normal = np.stack([side[:, 1], -side[:, 0]], axis=1) / width[:, None]
    away = abs(pattern.vertices[:, :2] @ normal.T - (normal * base).sum(axis=1))  # from each wall
    at = away[pattern.faces.values]
    off = np.maximum.reduceat(at, pattern.faces.offsets[:-1], axis=0)
    assert off.min(axis=1).max() < 1e-9
    assert euler(pattern) == 0  # shared nodes: else there would be gaps
    assert fan_areas(pattern.cells).sum() == pytest.approx(40 * float(width.sum()), rel=5e-3)


def test_no_more_folds_than_a_bound_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choose, "MOST_FOLLOWED", 4)
    cmap = conformal_map(prism(ELL), BoundaryCondition(mode="straight"))
    pattern = lay_pattern(cmap, PatternSettings(edge_length=3.0))
    assert len(cmap.surface.features) == 6
    assert sum(feature.straight for feature in pattern.features) <= 4
    assert any("Of 6 folds only the 4 longest" in note for note in pattern.notes)


def test_networks_of_short_folds_ask_for_no_lines() -> None:
    """A niche three vertices wide in a tube: its folds, a network that meets no other, are followed by cells
    a third of it, and only cut by cells of its size; folds from loop to loop are followed at any size."""
    angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    rings = 10 * ring + np.linspace(0, 40, 33)[:, None, None] * np.array([0.0, 0.0, 1.0])
    rings[14:18, 10:14, :2] *= 1.25
    cmap = conformal_map(surface_from_mesh(grid(rings)), BoundaryCondition("straight"))
    chains = chains_of(cmap, cmap.surface.features, frozenset(range(len(cmap.surface.features))))
    assert len(chains) >= 12
    side = max(chain.length for chain in chains)
    assert lasting(chains, cmap.surface, side / 4).all()
    assert not lasting(chains, cmap.surface, side).any()
    box = solved("box")
    folds = chains_of(box, box.surface.features, frozenset(range(4)))
    assert lasting(folds, box.surface, 10 * folds[0].length).all()


def test_no_distortion_is_told_that_is_none() -> None:
    assert cost_of(float("inf"), 0.5) == cost_of(2e9) == "fold the layout over"
    assert cost_of(0.7, 0.5) == "distort cells by 0.70, more than 0.5"
    assert cost_of(1234.5) == "distort cells by more than 100"


def test_a_number_that_suits_the_folds_better_is_told_and_the_one_asked_for_kept() -> None:
    settings = PatternSettings("hex", around=60, rotation="vertex", boundary="trim")
    pattern = lay_pattern(solved("box"), settings)
    assert pattern.around == 60
    (note,) = (note for note in pattern.notes if "would fit the folds better" in note)
    better = lay_pattern(solved("box"), replace(settings, around=int(note.split()[0])))
    assert better.distortion < 0.5 * pattern.distortion
    assert not any("would fit the folds better" in note for note in better.notes)


def worst(notes: tuple[str, ...]) -> float:
    (note,) = (note for note in notes if note.startswith("Folds meet at"))
    return float(note.split("distort cells by ")[1].split()[0])


def test_a_pattern_that_is_aligned_nowhere_winds_along_with_folds_that_lean() -> None:
    settings = PatternSettings("hex", around=60, rotation="vertex", boundary="trim")
    cmap = solved("box", np.deg2rad(20.0))
    aligned = lay_pattern(cmap, settings)
    assert any('With align "none"' in note and "lean by 4.0°" in note for note in aligned.notes)
    wound = lay_pattern(cmap, replace(settings, align="none"))
    assert all(feature.straight for feature in wound.features)
    assert wound.distortion < 0.03 < aligned.distortion
    assert euler(wound) == 0


def test_a_pattern_winds_where_rows_along_the_boundary_cost_too_much() -> None:
    """Folds of a tower that turns by 50°: 10° off, at 0.19 or more with both ends on rows of cells."""
    cmap = solved("box", np.deg2rad(50.0))
    settings = PatternSettings("quad", around=40, boundary="trim")
    wound = lay_pattern(cmap, settings)
    assert all(feature.straight for feature in wound.features)
    assert wound.distortion < 0.05
    assert any("so that the pattern winds along with them" in note for note in wound.notes)
    whole = lay_pattern(cmap, replace(settings, boundary="whole"))  # ends would be ragged
    assert not any(feature.straight for feature in whole.features)
    assert any('With align "none" and boundary "trim"' in note for note in whole.notes)


def test_what_a_ledge_costs_is_borne_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tower of rounded plan with a setback: much at few triangles, little on the average."""
    t = 2 * np.pi * np.arange(64) / 64
    way = np.column_stack([np.cos(t), np.sin(t)])
    corners = np.sign(way) * np.sqrt(abs(way))
    size = np.r_[np.full(11, 12.0), 11, 10, np.full(11, 9.0)]
    height = np.r_[np.linspace(0, 20, 11), 20, 20, np.linspace(20, 40, 11)]
    rings = np.stack([*(np.multiply.outer(size, c) for c in corners.T), np.tile(height, (64, 1)).T], axis=-1)
    cmap = conformal_map(surface_from_mesh(grid(rings)), BoundaryCondition("straight"))
    pattern = lay_pattern(cmap, PatternSettings("hex"))
    assert [feature.straight for feature in pattern.features] == [True, True]
    assert choose.MOST_PREDICTED < pattern.distortion < 0.3
    monkeypatch.setattr(choose, "MOST_ON_AVERAGE", 0.0)
    spread = lay_pattern(cmap, PatternSettings("hex"))
    assert [feature.straight for feature in spread.features] == [False, True]


def test_corners_that_no_lines_of_the_pattern_have_are_named_with_the_least_they_cost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At the outer corners of a ledge three right angles make 270°, at the inner ones two of 90° and one of
    270° make 450°: √2 and √(3/2) at least, with targets of 90° and 180°."""
    outer = plan(RECTANGLE, 2.5) - (15, 10)
    inner = 0.6 * outer
    rows = [(outer, z) for z in range(0, 25, 2)]
    rows += [(outer + t * (inner - outer), 24) for t in (0.25, 0.5, 0.75)]
    rows += [(inner, z) for z in range(24, 49, 2)]
    rings = np.stack([np.column_stack([xy, np.full(len(xy), float(z))]) for xy, z in rows])
    surface = surface_from_mesh(grid(rings), SurfaceSettings(caps="keep"))
    cmap = conformal_map(surface, BoundaryCondition("straight"))
    settings = PatternSettings("quad", around=30, boundary="trim")
    placing = PlacementFamily.of(cmap, LATTICES["quad"], settings)
    vertex, least = least_where_they_meet(cmap, LATTICES["quad"], placing.chains)
    assert len(vertex) == 8
    at = abs(cmap.surface.vertices[vertex, 0])
    assert least[at > 14] == pytest.approx(2**0.5 - 1, abs=0.06)
    assert least[at < 14] == pytest.approx(1.5**0.5 - 1, abs=0.06)
    monkeypatch.setattr(choose, "MOST_GIVEN_UP", 1)
    assert worst(placing.at(settings).notes) == pytest.approx(least.max(), abs=0.005)
