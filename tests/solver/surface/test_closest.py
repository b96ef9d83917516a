"""The nearest point of a mesh is the nearest over all triangles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from hexwrap_solver.surface import closest
from hexwrap_solver.surface.closest import TriangleTree, nearest_in_triangles
from hexwrap_solver.surface.types import Triangles


def brute_force(points, vertices, faces):
    corners = np.broadcast_to(vertices[faces], (len(points), len(faces), 3, 3)).reshape(-1, 3, 3)
    repeated = np.repeat(points, len(faces), axis=0)
    return nearest_in_triangles(repeated, corners)[1].reshape(len(points), -1).min(axis=1)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 60), st.sampled_from([1.0, 1e-6, 0.0]))
def test_tree_search_is_exact(seed, faces, flatness):
    """Any soup of triangles: slivers, crossing ones, all in one plane."""
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(30, 3)) * [1, 1, flatness]
    soup = rng.integers(0, 30, (faces, 3))
    points = rng.normal(size=(50, 3)) * rng.choice([0.1, 1, 10])
    found = TriangleTree.build(vertices, soup).nearest(points)
    assert np.allclose(found.distance, brute_force(points, vertices, soup), rtol=1e-9, atol=1e-12)
    place = np.einsum("kc,kcd->kd", found.barycentric, vertices[soup[found.face]])
    assert np.allclose(np.linalg.norm(place - points, axis=1), found.distance, atol=1e-12)
    assert (found.barycentric >= 0).all()
    assert np.allclose(found.barycentric.sum(axis=1), 1)


def test_a_point_beside_a_corner_at_the_origin_is_found():
    """Its distance is rounding of the corners' coordinates, which are large beside its own."""
    corners = np.array([[0.0, 0.25, 0.625], [0.0, 0.0, 0.0], [0.0, 0.0, 0.625]])
    point = np.array([[-4.04720376e-19, -1.13193909e-20, 3.58042662e-19]])
    found = TriangleTree.build(corners, np.array([[0, 1, 2]])).nearest(point)
    assert found.distance == pytest.approx([0.0], abs=1e-15)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
def test_farthest_of_a_row_is_exact_whatever_triangles_are_guessed(seed, good):
    rng = np.random.default_rng(seed)
    vertices, soup = rng.normal(size=(30, 3)), rng.integers(0, 30, (40, 3))
    points, row = rng.normal(size=(60, 3)) * 3, rng.integers(0, 12, 60)
    near = rng.integers(0, 40, 60)
    tree = TriangleTree.build(vertices, soup)
    if good:
        near = tree.nearest(points).face
    found = tree.farthest(points, row, 13, near, Triangles(vertices, soup).twin)
    distance = brute_force(points, vertices, soup)
    wanted = [distance[row == r].max(initial=0.0) for r in range(13)]
    assert np.allclose(found, wanted, rtol=1e-9, atol=1e-12)


def test_farthest_is_the_same_to_the_bit_whatever_the_tree_remembers():
    u, v = (x.ravel() for x in np.meshgrid(np.linspace(0, 1, 30), np.linspace(0, 1, 30)))
    mesh = Triangles(
        np.stack([u, v, 0.1 * np.sin(7 * u + 5 * v)], axis=1), Delaunay(np.stack([u, v], 1)).simplices
    )
    tree, rng = TriangleTree.build(mesh.vertices, mesh.faces), np.random.default_rng(3)
    for _ in range(5):
        row, place = rng.integers(0, 50, 300), rng.random((300, 2))
        points = np.append(
            place, 0.1 * np.sin(place @ [[7], [5]]) + rng.normal(scale=0.002, size=(300, 1)), axis=1
        )
        near = tree.nearest(points).face
        fresh = TriangleTree.build(mesh.vertices, mesh.faces)
        assert np.array_equal(
            tree.farthest(points, row, 50, near, mesh.twin), fresh.farthest(points, row, 50, near, mesh.twin)
        )
    assert len(tree._beside.leaf) > len(fresh._beside.leaf) > 0
    for changed in (0, 1, 2, 20, 50):
        some = np.isin(row, rng.permutation(50)[:changed])
        points, near = points.copy(), near.copy()
        points[some] += rng.normal(scale=0.002, size=(int(some.sum()), 3))
        near[rng.integers(0, 300, changed)] = rng.integers(0, len(mesh.faces), changed)
        fresh = TriangleTree.build(mesh.vertices, mesh.faces)
        wanted = fresh.farthest(points, row, 50, near, mesh.twin)
        assert np.array_equal(tree.farthest(points, row, 50, near, mesh.twin), wanted)


def test_nearest_in_a_triangle_is_no_farther_than_any_sample():
    rng = np.random.default_rng(0)
    corners, points = rng.normal(size=(200, 3, 3)), rng.normal(size=(200, 3))
    _, distance = nearest_in_triangles(points, corners)
    samples = rng.dirichlet([0.5, 0.5, 0.5], 4000)
    cloud = np.einsum("sc,kcd->ksd", samples, corners)
    nearest = np.linalg.norm(cloud - points[:, None], axis=2).min(axis=1)
    assert (distance <= nearest + 1e-12).all()
    assert (nearest - distance).max() < 0.2


def test_points_of_the_mesh_have_distance_zero_whatever_the_scale():
    rng = np.random.default_rng(1)
    vertices = 1e5 + 1e3 * rng.normal(size=(50, 3))
    faces = rng.integers(0, 50, (80, 3))
    found = TriangleTree.build(vertices, faces).nearest(vertices[faces[:, 1]])
    assert found.distance == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e6])
def test_no_point_is_lost_whose_distance_is_rounding(scale):
    """The distance from the triangle comes out smaller than that from its box: both are rounding."""
    vertices = np.array(
        [
            [1.1445547615275071, 17.46253115667556, 4.330127018922194],
            [1.0446894671958542e-15, 17.061073738537637, 4.045084971874737],
            [1.0715659492539341e-15, 17.5, 4.330127018922194],
        ]
    )
    point = np.array([[3.608224830031759e-16, 17.232246072750087, 4.156245585457645]])
    found = TriangleTree.build(scale * vertices, np.array([[0, 1, 2]])).nearest(scale * point)
    assert found.face.tolist() == [0]
    assert found.distance[0] < 1e-14 * scale


def test_the_result_does_not_depend_on_how_many_pairs_are_looked_at_together(monkeypatch):
    """Points on the axis of a tube are as near to whole rings of its triangles."""
    angle = 2 * np.pi * np.arange(40) / 40
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices = np.concatenate([np.insert(ring, 2, z, axis=1) for z in np.linspace(0, 2, 21)])
    a = (np.arange(20)[:, None] * 40 + np.arange(40)).ravel()
    b = (np.arange(20)[:, None] * 40 + (np.arange(40) + 1) % 40).ravel()
    faces = np.concatenate([np.stack([a, b, b + 40], axis=1), np.stack([a, b + 40, a + 40], axis=1)])
    points = np.zeros((300, 3))
    points[:, 2] = np.linspace(-0.1, 2.1, 300)
    tree = closest.TriangleTree.build(vertices, faces)
    whole = tree.nearest(points)
    np.testing.assert_allclose(whole.distance, brute_force(points, vertices, faces), rtol=1e-12)
    for pairs, some in ((1, slice(None, None, 75)), (1000, slice(None))):
        monkeypatch.setattr(closest, "MOST_PAIRS", pairs)
        monkeypatch.setattr(closest, "COMPARED", pairs)
        parts = tree.nearest(points[some])
        np.testing.assert_array_equal(parts.face, whole.face[some])
        np.testing.assert_array_equal(parts.distance, whole.distance[some])


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(6.1, 304.5), st.sampled_from([1.0, 1e-3, 1e3]))
def test_points_however_far_away_find_the_foremost_point_of_the_mesh(seed, exponent, size):
    """Seen from infinity, the nearest point is the one that lies foremost in that direction."""
    rng = np.random.default_rng(seed)
    vertices = size * rng.normal(size=(30, 3))
    faces = rng.integers(0, 30, (40, 3))
    direction = rng.normal(size=(20, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    far = direction * 10.0**exponent * max(size, 1)
    points = np.concatenate([far, vertices[faces[:5, 0]]])  # ordinary points among them
    found = TriangleTree.build(vertices, faces).nearest(points)
    place = np.einsum("kc,kcd->kd", found.barycentric, vertices[faces[found.face]])
    foremost = (direction @ vertices[np.unique(faces)].T).max(axis=1)
    extent = np.linalg.norm(np.ptp(vertices, axis=0))
    assert ((place[:20] * direction).sum(axis=1) > foremost - 2e-6 * extent).all()
    distance = np.hypot(np.hypot(far[:, 0], far[:, 1]), far[:, 2]) - foremost
    np.testing.assert_allclose(found.distance[:20], distance, rtol=1e-9)
    np.testing.assert_allclose(found.distance[20:], 0, atol=1e-9 * size)


def test_distances_beyond_all_numbers_are_the_largest_number():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    tree = TriangleTree.build(vertices, np.array([[0, 1, 2]]))
    largest = np.finfo(float).max
    found = tree.nearest(np.array([[-largest] * 3, [largest, 0, 0], [5e-324] * 3]))
    assert found.distance.tolist() == [largest, largest, pytest.approx(0, abs=1e-300)]
    assert found.barycentric[0].tolist() == [1, 0, 0]
    assert tree.nearest(np.zeros((0, 3))).face.tolist() == []


def test_points_far_from_a_mesh_without_extent_are_measured():
    tree = TriangleTree.build(np.ones((3, 3)), np.array([[0, 1, 2]]))
    found = tree.nearest(np.array([[1.0, 1, 3], [1, 1, 1]]))
    assert found.distance.tolist() == [2, 0]
