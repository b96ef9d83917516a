"""Lines drawn on a surface become chains of mesh edges, and the surface stays what it was."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hexwrap_solver.arrays import Floats, Ragged
from hexwrap_solver.errors import SettingError
from hexwrap_solver.geometry import face_areas, face_normals, normalize
from hexwrap_solver.surface import surface_from_mesh, surface_from_nurbs
from hexwrap_solver.surface.drawn import with_lines
from hexwrap_solver.surface.errors import DrawnLineError
from hexwrap_solver.surface.topology import boundary_loops, edges, twins
from hexwrap_solver.surface.types import FeatureSettings, MeshSettings, SentMesh, Surface, SurfaceSettings
from tests.solver.pattern.folded import grid, prism
from tests.solver.surface.nurbs_shapes import cylinder

RADIUS, HEIGHT = 5.0, 20.0


@cache
def tube(around: int = 32, rows: int = 21) -> Surface:
    t = np.arange(around) / around * 2 * np.pi
    z = np.linspace(0, HEIGHT, rows)[:, None]
    x, y = RADIUS * np.cos(t), RADIUS * np.sin(t)
    rings = np.stack([x + 0 * z, y + 0 * z, z + 0 * t], axis=2)
    return surface_from_mesh(grid(rings), SurfaceSettings(caps="keep"))


def ring(z: float, count: int = 24, start: float = 0.1) -> Floats:
    t = start + np.arange(count + 1) / count * 2 * np.pi
    t[-1] = t[0]
    return np.stack([RADIUS * np.cos(t), RADIUS * np.sin(t), np.full(count + 1, z)], axis=1)


def upright(angle: float, low: float, high: float) -> Floats:
    x, y = RADIUS * np.cos(angle), RADIUS * np.sin(angle)
    return np.array([[x, y, low], [x, y, high]])


def checked(surface: Surface, before: Surface) -> Surface:
    """An oriented annulus of the same shape, whose features are edges of it."""
    n = len(surface.vertices)
    pairs, _ = edges(surface.faces, n)
    assert n - len(pairs) + len(surface.faces) == 0
    assert (np.bincount(surface.faces.ravel(), minlength=n) > 0).all()
    loops = boundary_loops(surface.faces, twins(surface.faces, n))
    assert sorted(map(sorted, loops)) == sorted(map(sorted, surface.loops))
    area = face_areas(surface.vertices, surface.faces)
    assert area.min() > 0
    assert area.sum() == pytest.approx(face_areas(before.vertices, before.faces).sum(), rel=1e-2)
    middle = surface.vertices[surface.faces].mean(axis=1) * [1, 1, 0]
    assert (normalize(face_normals(surface.vertices, surface.faces)) * middle).sum(axis=1).min() > 0
    keys = pairs.min(axis=1) * n + pairs.max(axis=1)
    for feature in surface.features:
        a, b = feature.vertices[:-1], feature.vertices[1:]
        assert np.isin(np.minimum(a, b) * n + np.maximum(a, b), keys).all()
        assert feature.closed == (feature.vertices[0] == feature.vertices[-1])
    return surface


def test_a_ring_is_a_closed_chain_of_edges_at_its_height() -> None:
    surface = checked(with_lines(tube(), [ring(7.3)]), tube())
    (feature,) = surface.features
    assert feature.closed
    assert feature.given
    assert abs(surface.vertices[feature.vertices, 2] - 7.3).max() < 1e-12
    assert (surface.input_vertex[feature.vertices] == -1).all()


def test_open_lines_begin_and_end_where_they_are_drawn() -> None:
    surface = checked(with_lines(tube(), [upright(1.51, 0, HEIGHT), upright(2.5, 4.1, 15.0)]), tube())
    for feature, (low, high) in zip(surface.features, [(0, HEIGHT), (4.1, 15.0)], strict=True):
        line = surface.vertices[feature.vertices]
        assert not feature.closed
        assert np.ptp(line[:, :2], axis=0).max() < 1e-2 * RADIUS
        assert (np.diff(line[:, 2]) > 0).all()
        assert line[[0, -1], 2] == pytest.approx([low, high], abs=0.05)


def test_lines_may_cross_each_other_turn_corners_and_wind_around() -> None:
    t = np.linspace(0, 9, 60)
    helix = np.stack([RADIUS * np.cos(t), RADIUS * np.sin(t), 2 * t + 0.5], axis=1)
    low, high = ring(6.0, 40)[3:9], ring(11.0, 40)[8:2:-1]
    window = np.concatenate([low, high, low[:1]])
    surface = checked(with_lines(tube(), [ring(7.3), upright(0.7, 2, 18), helix, window]), tube())
    assert [f.closed for f in surface.features] == [True, False, False, True]
    for feature, line in zip(surface.features, [ring(7.3), upright(0.7, 2, 18), helix, window], strict=True):
        drawn = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
        chain = np.linalg.norm(np.diff(surface.vertices[feature.vertices], axis=0), axis=1).sum()
        assert chain == pytest.approx(drawn, rel=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_any_lines_leave_a_surface(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lines = [ring(z, int(rng.integers(5, 90)), rng.uniform(0, 6)) for z in rng.uniform(1, HEIGHT - 1, 3)]
    lines += [upright(a, *np.sort(rng.uniform(0, HEIGHT, 2))) for a in rng.uniform(0, 6, 3)]
    checked(with_lines(tube(20, 12), lines), tube(20, 12))


def test_drawn_lines_come_before_creases_which_keep_their_vertices() -> None:
    box = prism(edge=2.5)
    height = float(np.ptp(box.vertices[:, 2]))
    low = box.vertices.min(axis=0)
    high = box.vertices.max(axis=0)
    z = low[2] + 0.37 * height
    corners = [(low[0], low[1], z), (high[0], low[1], z), (high[0], high[1], z), (low[0], high[1], z)]
    surface = with_lines(box, [[*corners, corners[0]]])
    assert [f.closed for f in surface.features] == [True, False, False, False, False]
    drawn, *creases = (f.vertices for f in surface.features)
    for crease, before in zip(creases, box.features, strict=True):
        assert len(np.intersect1d(crease, drawn)) == 1
        assert np.isin(before.vertices, crease).all()
        assert np.isin(box.vertices[before.vertices], surface.vertices[crease]).all()
    again = with_lines(box, [box.vertices[box.features[0].vertices]])
    assert len(again.features) == 4, "a line along a crease takes its place"


def test_new_vertices_lie_on_the_nurbs_surface() -> None:
    exact = surface_from_nurbs(cylinder(), MeshSettings(max_edge=0.3))
    radius = float(np.linalg.norm(exact.vertices[0, :2]))
    low, high = exact.vertices[:, 2].min(), exact.vertices[:, 2].max()
    line = ring(0.4 * low + 0.6 * high) * [radius / RADIUS, radius / RADIUS, 1]
    surface = with_lines(exact, [line])
    away = np.linalg.norm(surface.vertices[:, :2], axis=1) - radius
    assert abs(away).max() < 1e-9 * radius
    assert surface.parameters is not None
    assert len(surface.parameters) == len(surface.vertices) > len(exact.vertices)


@pytest.mark.parametrize(
    ("line", "word"),
    [
        (ring(5) * [2, 2, 1], "Point 0 of line 1 is 5"),
        (np.array([[RADIUS, 0, 1], [RADIUS, 0, 1 + 1e-10]]), "two different points"),
        (np.array([[RADIUS, 0, 1], [np.nan, 0, 2]]), "finite"),
        (ring(4, 2, np.pi / 32)[:2], "between its points 0 and 1"),
    ],
)
def test_lines_that_cannot_be_followed_are_refused(line: Floats, word: str) -> None:
    with pytest.raises(DrawnLineError, match=word):
        with_lines(tube(), [ring(3), line])


@pytest.mark.parametrize("lines", [(((0.0, 0.0, 0.0),),), ((),), (((0.0, 0.0, 0.0),) * 1000,) * 21])
def test_settings_refuse_short_lines_and_too_many_points(
    lines: tuple[tuple[tuple[float, float, float], ...], ...],
) -> None:
    with pytest.raises(SettingError, match="points"):
        FeatureSettings(lines=lines)


def test_folds_along_given_lines_are_left_out() -> None:
    surface = prism()
    box = SentMesh(surface.vertices, Ragged(surface.faces.ravel(), np.arange(0, surface.faces.size + 1, 3)))
    every = surface_from_mesh(box).features
    gone, kept = every[0], every[1:]
    line = surface.vertices[gone.vertices]
    away = tuple(map(tuple, line[[0, -1]].tolist()))
    left = surface_from_mesh(box, SurfaceSettings(features=FeatureSettings(without=(away,)))).features
    assert [f.vertices.tolist() for f in left] == [f.vertices.tolist() for f in kept]
    half = tuple(map(tuple, [line[0].tolist(), line[[0, -1]].mean(axis=0).tolist()]))
    left = surface_from_mesh(box, SurfaceSettings(features=FeatureSettings(without=(half,)))).features
    assert len(left) == len(every)
    assert sum(len(f.vertices) for f in left) < sum(len(f.vertices) for f in every)
    with pytest.raises(SettingError, match="without"):
        FeatureSettings(without=(((0.0, 0.0, 0.0),),))


@pytest.mark.parametrize("seed", range(8))
def test_lines_along_edges_become_these_edges(seed: int) -> None:
    """Whatever the way, with points between or vertices left out on straight lines, and rounded."""
    rng = np.random.default_rng(seed)
    surface = (tube, lambda: prism(edge=4.0))[seed % 2]()
    pairs, _ = edges(surface.faces, len(surface.vertices))
    both = np.concatenate([pairs, pairs[:, ::-1]])
    inside = ~np.isin(both, surface.boundary).any(axis=1)
    way = [int(both[inside][0, 0])]
    for _ in range(30):
        ahead = [v for v in both[inside][both[inside][:, 0] == way[-1], 1].tolist() if v not in way]
        if not ahead:
            break
        way.append(int(rng.choice(ahead)))
    line = surface.vertices[way]
    if seed % 4 > 1:
        middle = (line[1:] + line[:-1]) / 2
        line = np.insert(line, np.arange(1, len(line)), middle, axis=0)
    line = np.round(line, 5)
    drawn = with_lines(surface, [line])
    assert drawn.features[0].vertices.tolist() == way
    assert (drawn.vertices == surface.vertices).all()
    assert (drawn.faces == surface.faces).all()


@pytest.mark.parametrize("step", [1, 4, 8])
def test_rings_on_a_coarse_waist_keep_their_height(step: int) -> None:
    t, z = np.arange(24) / 24 * 2 * np.pi, np.linspace(0, 6, 11)[:, None]
    radius = 2 + 0.75 * np.cos(2 * np.pi * z / 6)
    rings = np.stack([radius * np.cos(t), radius * np.sin(t), z + 0 * t], axis=2)
    surface = surface_from_mesh(grid(rings), SurfaceSettings(caps="keep"))
    drawn = with_lines(surface, [rings[5][[*range(0, 24, step), 0]]])
    (feature,) = drawn.features
    assert feature.closed
    assert abs(drawn.vertices[feature.vertices, 2] - 3).max() < 1e-9
