"""Panels of cells cut at the boundary: they fill their cells as far as neighbours leave room."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import shapely

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.panels import measure, rationalize
from hexwrap_solver.panels.polygons import edge_lengths, fan_areas, mean_edges
from hexwrap_solver.panels.trimmed import flatten_and_clear
from hexwrap_solver.panels.types import Panels, PanelSettings
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from hexwrap_solver.surface import surface_from_mesh
from tests.solver.surface.shapes import mesh


def ring(t, angle):
    """Flat, the hole off the middle."""
    r = 15 - 11 * t
    return r * np.cos(angle) + 2 * t, r * np.sin(angle), 0 * t


def slanted(t, angle):
    """A round tower cut off aslant at both ends."""
    x, y = 6 * np.cos(angle), 6 * np.sin(angle)
    return x, y, 0.6 * x * (1 - t) + (20 - 0.9 * x + 0.3 * y) * t


def elbow(t, angle):
    """A quarter of a torus: curved both ways."""
    r = 20 + 5 * np.cos(angle)
    return r * np.cos(t * np.pi / 2), r * np.sin(t * np.pi / 2), 5 * np.sin(angle)


@cache
def mapped(shape, mode: str) -> ConformalMap:
    along, around = 24, 60
    t, angle = np.meshgrid(
        np.linspace(0, 1, along + 1), np.arange(around) * 2 * np.pi / around, indexing="ij"
    )
    vertices = np.stack(shape(t, angle), axis=-1).reshape(-1, 3)
    i, j = np.divmod(np.arange(along * around), around)
    a, b = i * around + j, i * around + (j + 1) % around
    faces = np.stack([a, b, b + around, a + around], axis=1)
    return conformal_map(surface_from_mesh(mesh(vertices, faces)), BoundaryCondition(mode=mode))


def panelize(shape, mode, joint=0.0, **wanted) -> tuple[Pattern, Panels, np.ndarray]:
    """With the share of each cell's area that its panel covers."""
    cmap = mapped(shape, mode)
    pattern = lay_pattern(cmap, PatternSettings(boundary="trim", **wanted))
    panels = rationalize(cmap, pattern, PanelSettings(joint=joint * pattern.edge_length))
    quality = measure(cmap, pattern, panels)
    assert quality.overlaps == 0
    assert quality.planarity.max() < 1e-10
    assert np.nanmin(quality.gap_tangential) > (joint - 1e-9) * pattern.edge_length
    share = np.zeros(pattern.n_cells)
    share[panels.face] = fan_areas(panels.polygons) / cell_areas(pattern)[panels.face]
    return pattern, panels, share


def cell_areas(pattern: Pattern) -> np.ndarray:
    return fan_areas(Ragged(pattern.vertices[pattern.faces.values.astype(np.int64)], pattern.faces.offsets))


def outlines(panels: Panels) -> list[shapely.Polygon]:
    """Each panel in its own plane."""
    shapes = []
    for i, n in enumerate(panels.normal):
        points = panels.polygons[i] - panels.polygons[i][0]
        x = np.cross(n, [1.0, 0, 0] if abs(n[0]) < 0.9 else [0, 1.0, 0])
        shapes.append(shapely.Polygon(points @ np.stack([x, np.cross(n, x)]).T))
    return shapes


@pytest.mark.parametrize("around", [18, 24, 37])
@pytest.mark.parametrize("rotation", ["edge", 10.0])
def test_panels_cover_a_flat_ring_to_its_boundary(around, rotation):
    """Whole cells of an isometric map are regular already, cut ones flat: nothing needs to stay open."""
    pattern, panels, share = panelize(ring, "isometric", around=around, rotation=rotation)
    assert panels.n_panels == pattern.n_cells
    assert np.allclose(share, 1.0, atol=1e-6)
    assert not any("trimmed cells" in note for note in panels.notes)
    assert (~pattern.whole & (pattern.faces.lengths > 6)).any()  # slivers were joined


@pytest.mark.parametrize("shape", [ring, slanted, elbow])
@pytest.mark.parametrize("mode", ["straight", "isometric"])
@pytest.mark.parametrize(("around", "rotation"), [(18, 10.0), (24, "edge"), (37, 20.0)])
@pytest.mark.parametrize("joint", [0.0, 0.02])
def test_no_large_cell_at_the_boundary_stays_open(shape, mode, around, rotation, joint):
    pattern, panels, share = panelize(shape, mode, joint, around=around, rotation=rotation)
    area = cell_areas(pattern)
    large = ~pattern.whole & (area > np.median(area[pattern.whole]) / 2)
    assert large.any()
    assert share[large].min() > 0.75
    assert share[~pattern.whole].mean() > 0.85
    assert all(outline.is_valid for outline in outlines(panels))
    edge = edge_lengths(panels.polygons) / mean_edges(panels.polygons)[panels.polygons.row]
    assert edge.min() > 1e-6


def lay(corners, reach, across):
    """A flat polygon with lines parallel to its edges, at ``reach`` from them."""
    corner = np.array([[*c, 0.0] for c in corners])
    along = np.roll(corner, -1, axis=0) - corner
    direction = np.stack([along[:, 1], -along[:, 0], np.zeros(len(corner))], axis=1)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    offset = np.einsum("kd,kd->k", direction, corner) + np.asarray(reach)
    flat, _, kept = flatten_and_clear(
        Ragged.from_table(corner[None]), np.array([[0.0, 0, 1]]), direction, offset, np.asarray(across)
    )
    return flat.values, kept[0], direction, offset


#: An L: the reflex corner is the fourth.
ELL = [(0, 0), (4, 0), (4, 1), (2, 1), (2, 4), (0, 4)]


def test_a_wedge_between_two_lines_to_one_neighbour_is_kept_out_of_and_no_more():
    found, kept, *_ = lay(ELL, np.full(6, -0.1), [0, 1, 2, 2, 3, 4])
    expected = [(0.1, 0.1), (3.9, 0.1), (3.9, 0.9), (1.9, 0.9), (1.9, 3.9), (0.1, 3.9)]
    assert np.allclose(found[:, :2], expected, atol=1e-12)
    area = shapely.Polygon(expected).area / shapely.Polygon(ELL).area
    assert kept == pytest.approx(np.sqrt(area), rel=1e-12)


def test_lines_to_two_neighbours_bind_all_of_the_panel():
    found, kept, direction, offset = lay(ELL, np.zeros(6), [0, 1, 2, 3, 4, 5])
    assert (found @ direction.T <= offset + 1e-12).all()
    assert kept == pytest.approx(np.sqrt(2 / 10), rel=1e-9)


def test_where_the_boundary_bends_nothing_binds():
    found, kept, *_ = lay(ELL, np.full(6, -0.1), np.full(6, -1))
    assert kept == pytest.approx(1.0)
    assert np.allclose(found[:, :2], ELL)


@pytest.mark.parametrize("seed", range(30))
def test_clipped_panels_are_the_part_that_is_left(seed):
    """A convex panel cut by a line is the intersection, but for a triangle where corners are too few."""
    chance = np.random.default_rng(seed)
    count = int(chance.integers(4, 9))
    angle = np.sort(chance.uniform(0, 2 * np.pi, count))
    corners = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    reach = -chance.uniform(0, 0.3, count) * (chance.random(count) < 0.5)
    found, kept, direction, offset = lay(corners, reach, np.arange(count))
    left = shapely.Polygon(corners)
    for k in range(count):
        n, t = direction[k, :2], np.array([-direction[k, 1], direction[k, 0]])
        foot = offset[k] * n
        left = left.intersection(
            shapely.Polygon([foot + 9 * t, foot - 9 * t, foot - 9 * t - 9 * n, foot + 9 * t - 9 * n])
        )
    if left.area == 0:
        assert kept == 0
        return
    assert (found @ direction.T <= offset + 1e-10).all()
    outline = shapely.Polygon(found[:, :2])
    assert outline.area <= left.area + 1e-12
    assert shapely.make_valid(outline).difference(left.buffer(1e-9)).area < 1e-12
    assert outline.area > 0.5 * left.area
    assert kept == pytest.approx(np.sqrt(outline.area / shapely.Polygon(corners).area))
