"""Inset outlines, planes and closed solids (paper, Figure 9)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.errors import PanelsError
from hexwrap_solver.panels import make_components, rationalize
from hexwrap_solver.panels.polygons import area_vectors, interior_angles, row_maxima
from hexwrap_solver.panels.types import ComponentSettings, PanelSettings
from tests.solver.panels.cells import catenoid, grid_map, hex_pattern, inverted, torus


@pytest.fixture(scope="module")
def panels():
    chart = inverted(torus, (0.5, 0.1, 3.0))
    pattern = hex_pattern(chart, 24, 6, -0.6)
    whole = pattern.whole.copy()
    whole[:24] = False
    pattern = replace(pattern, whole=whole)
    return rationalize(grid_map(chart, 60, 40, -0.7, 1.8), pattern, PanelSettings(sizes=4))


def test_outlines_keep_the_inset_on_every_edge(panels):
    inset = 0.1 * panels.class_length[0]
    made = make_components(panels, ComponentSettings(inset=inset))
    points, row = panels.polygons.values, panels.polygons.row
    along = points[panels.polygons.next()] - points
    inward = np.cross(panels.normal[row], along)
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    width = np.einsum("hd,hd->h", made.outline.values - points, inward)
    assert np.allclose(width, inset, rtol=1e-9)
    assert made.solid_vertices is None


def test_planes_have_right_handed_axes_with_x_along_the_first_edge(panels):
    made = make_components(panels, ComponentSettings())
    axes = np.stack([made.x_axis, made.y_axis, made.z_axis], axis=1)
    assert np.allclose(np.linalg.det(axes), 1)
    assert np.allclose(axes @ axes.transpose(0, 2, 1), np.eye(3), atol=1e-12)
    first = panels.polygons.offsets[:-1]
    edge = panels.polygons.values[first + 1] - panels.polygons.values[first]
    assert np.allclose(np.cross(edge, made.x_axis), 0, atol=1e-12)
    assert np.allclose(made.outline.values, panels.polygons.values, atol=1e-12)


def test_solids_are_closed_and_have_the_prism_volume(panels):
    thickness = 0.01
    made = make_components(panels, ComponentSettings(thickness=thickness))
    area = np.linalg.norm(area_vectors(made.outline), axis=1)
    for i in range(panels.n_panels):
        vertices, faces = made.solid_vertices[i], made.solid_faces[i].reshape(-1, 3)
        directed = {(int(a), int(b)) for f in faces for a, b in zip(f, np.roll(f, -1), strict=True)}
        assert len(directed) == 3 * len(faces)
        assert all((b, a) in directed for a, b in directed)
        corner = vertices[faces] - vertices.mean(axis=0)
        volume = np.einsum("fd,fd->", np.cross(corner[:, 0], corner[:, 1]), corner[:, 2]) / 6
        assert volume == pytest.approx(area[i] * thickness, rel=1e-9)


def test_an_inset_that_leaves_nothing_is_refused(panels):
    with pytest.raises(PanelsError, match="inset") as caught:
        make_components(panels, ComponentSettings(inset=1.0))
    assert caught.value.field == ("components", "inset")


def test_without_an_inset_any_panel_is_its_own_outline():
    """Watertight panels on a saddle are concave, some with their centre behind an edge."""
    watertight = concave_panels()
    made = make_components(watertight, ComponentSettings(thickness=0.01))
    assert np.array_equal(made.outline.values, watertight.polygons.values)


def test_concave_outlines_keep_the_inset_too():
    watertight = concave_panels()
    angle = interior_angles(watertight.polygons, watertight.normal)
    concave = row_maxima(angle, watertight.polygons.offsets) > np.pi + 0.1
    assert concave.sum() > 10
    inset = 1e-3 * watertight.edge_length.min()
    made = make_components(watertight, ComponentSettings(inset=inset))
    for i in np.flatnonzero(concave):
        before, after = watertight.polygons[i], made.outline[i]
        z = watertight.normal[i]
        along = np.roll(before, -1, axis=0) - before
        length = np.linalg.norm(along, axis=1)
        spoke = after[:, None] - before
        t = np.clip(np.einsum("akd,kd->ak", spoke, along) / length**2, 0, 1)
        away = spoke - t[..., None] * along
        away -= np.einsum("akd,d->ak", away, z)[..., None] * z
        assert np.linalg.norm(away, axis=2).min() > inset * (1 - 1e-6)
        assert np.cross(after, np.roll(after, -1, axis=0)).sum(axis=0) @ z > 0


def test_insets_too_wide_for_concave_panels_name_the_room():
    watertight = concave_panels()
    with pytest.raises(PanelsError, match="the smallest has room for 0"):
        make_components(watertight, ComponentSettings(inset=float(watertight.edge_length.max())))


def test_covers_of_solids_fill_the_outline_once_however_many_corners_are_reflex(panels):
    """A comb, of which no fan of triangles covers all."""
    comb = [(0, 0), (7, 0), (7, 4), (6, 1), (5, 4), (4, 1), (3, 4), (2, 1), (1, 4)]
    points = np.array([[x, y, 0.0] for x, y in comb])
    one = replace(
        panels,
        polygons=Ragged.from_table(points[None]),
        center=points.mean(axis=0)[None],
        normal=np.array([[0.0, 0, 1]]),
    )
    made = make_components(one, ComponentSettings(thickness=0.5))
    faces = made.solid_faces[0].reshape(-1, 3)
    cover = points[:, :2][faces[(faces < len(comb)).all(axis=1)]]
    size = [shapely.Polygon(triangle).area for triangle in cover]
    whole = shapely.Polygon(comb)
    assert len(cover) == len(comb) - 2
    assert sum(size) == pytest.approx(whole.area)
    assert shapely.union_all([shapely.Polygon(triangle) for triangle in cover]).area == pytest.approx(
        whole.area
    )


def concave_panels():
    pattern = hex_pattern(catenoid, 20, 5, -0.6)
    return rationalize(
        grid_map(catenoid, 60, 40, -0.7, 1.8), pattern, PanelSettings(mode="watertight", method="energy")
    )
