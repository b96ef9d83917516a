"""Every way to fail is fed its failing input: slug, elements by sent indices, and advice."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.errors import SurfaceError
from hexwrap_solver.surface import SentMesh, surface_from_mesh
from hexwrap_solver.surface.errors import (
    DegeneratePolygonError,
    EmptySurfaceError,
    FlatSurfaceError,
    HandlesError,
    IndexRangeError,
    NonFiniteError,
    NonManifoldEdgeError,
    NotOrientableError,
    PolygonSizeError,
    SeveralComponentsError,
    ShapeError,
)
from hexwrap_solver.surface.types import SurfaceSettings
from tests.solver.surface.shapes import mesh, triangles, tube


def refused(sent: SentMesh, kind: type[SurfaceError]) -> SurfaceError:
    with pytest.raises(kind) as caught:
        surface_from_mesh(sent)
    error = caught.value
    assert type(error) is kind
    assert error.detail.endswith(".")
    again = pickle.loads(pickle.dumps(error))
    assert (again.detail, again.vertices, again.faces, again.edges) == (
        error.detail,
        error.vertices,
        error.faces,
        error.edges,
    )
    return error


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e200])
def test_not_finite(bad: float) -> None:
    vertices, quads = tube()
    vertices[17, 1] = bad
    error = refused(mesh(vertices, quads), NonFiniteError)
    assert error.vertices == [17]
    assert error.field == ("vertices",)


@pytest.mark.parametrize("bad", [-1, 35, 2**40])
def test_index_out_of_range(bad: int) -> None:
    vertices, quads = tube()
    quads[6, 2] = bad
    error = refused(mesh(vertices, quads), IndexRangeError)
    assert error.faces == [6]
    assert str(bad) in error.detail


def test_empty() -> None:
    vertices, quads = tube()
    refused(mesh(np.zeros((0, 3)), quads[:0]), EmptySurfaceError)
    refused(mesh(vertices, quads[:0]), EmptySurfaceError)


def test_wrong_shapes() -> None:
    vertices, quads = tube()
    refused(mesh(vertices[:, :2], quads), ShapeError)
    refused(mesh(vertices, quads, np.ones((4, 3))), ShapeError)
    refused(SentMesh(vertices, Ragged.from_table(quads + 0.5)), ShapeError)


@pytest.mark.parametrize("corners", [[], [0], [0, 1], [0, 1, 2, 3, 4]])
def test_polygons_of_other_sizes(corners: list[int]) -> None:
    vertices, quads = tube()
    error = refused(mesh(vertices, [*quads.tolist(), corners]), PolygonSizeError)
    assert error.faces == [28]
    assert f"{len(corners)} corners" in error.detail


def test_no_extent() -> None:
    vertices, quads = tube()
    refused(mesh(vertices * 0 + 5, quads), FlatSurfaceError)


def test_all_on_one_line() -> None:
    vertices, quads = tube()
    vertices[:, :2] = 0
    refused(mesh(vertices, quads), DegeneratePolygonError)


def test_only_degenerate_faces() -> None:
    refused(mesh(tube()[0], [[0, 1, 1], [2, 3, 2]]), DegeneratePolygonError)


def test_a_face_without_area_that_cannot_be_merged() -> None:
    """Its longest edge is on the boundary and its middle corner, too: dropping it would pinch the surface."""
    vertices, quads = tube(2, 6)
    faces = triangles(quads)
    a, b, c = faces[0]
    vertices[c] = (vertices[a] + vertices[b]) / 2
    error = refused(mesh(vertices, faces), DegeneratePolygonError)
    assert error.faces == [0]


def test_an_edge_with_three_faces() -> None:
    vertices, quads = tube()
    fin = np.concatenate([vertices, [[5.0, 0.0, 1.0]]])
    error = refused(mesh(fin, [*quads.tolist(), [7, 14, 35]]), NonManifoldEdgeError)
    assert error.edges in ([[7, 14]], [[14, 7]])
    assert 28 in error.faces
    assert len(error.faces) == 3


@pytest.mark.parametrize(("missing", "touching", "loops"), [([10, 18], 18, 3), ([0, 8], 8, 2)])
def test_a_boundary_that_touches_itself_is_taken_apart(missing: list[int], touching: int, loops: int) -> None:
    """Two holes with a corner in common become one, and so a notch with one in the end."""
    vertices, quads = tube(6, 7)
    found = surface_from_mesh(mesh(vertices, np.delete(quads, missing, axis=0)))
    assert len(found.loops) == loops
    assert (found.input_vertex == touching).sum() == 2
    assert any("touches itself was taken apart, at [" in sentence for sentence in found.repairs)


def test_an_inner_vertex_shared_by_two_sheets_is_taken_apart() -> None:
    """Two inner vertices of a tube, far from each other, made one: the tube is what it was."""
    vertices, quads = tube(9, 8)
    pinched = quads.copy()
    pinched[pinched == 20] = 52
    found = surface_from_mesh(mesh(vertices, pinched))
    assert len(found.loops) == 2
    assert len(found.vertices) == len(vertices)
    assert (found.input_vertex == 52).sum() == 2


def test_several_pieces() -> None:
    vertices, quads = tube()
    both = np.concatenate([quads, quads[:-7] + len(vertices)])
    error = refused(mesh(np.concatenate([vertices, vertices + 9]), both), SeveralComponentsError)
    assert error.faces == list(range(28, 49))
    assert error.data["sizes"] == [56, 42]


@pytest.mark.parametrize("welded", [True, False])
def test_a_moebius_band(welded: bool) -> None:
    k = 24
    angle = np.linspace(0, 2 * np.pi, k + 1)
    across = np.array([-0.4, 0.0, 0.4])[:, None]
    r = 2 + across * np.cos(angle / 2)
    vertices = np.stack([r * np.cos(angle), r * np.sin(angle), across * np.sin(angle / 2)], axis=2).reshape(
        -1, 3
    )
    i, j = np.divmod(np.arange(2 * k), k)
    a = i * (k + 1) + j
    quads = np.stack([a, a + 1, a + k + 2, a + k + 1], axis=1)
    if welded:
        ends = {k: 2 * (k + 1), 2 * k + 1: k + 1, 3 * k + 2: 0}
        for old, new in ends.items():
            quads[quads == old] = new
    error = refused(mesh(vertices, quads), NotOrientableError)
    assert len(error.edges) >= 1
    assert len({frozenset(edge) for edge in error.edges}) == len(error.edges)


def separates(faces: np.ndarray, loop: list[list[int]]) -> bool:
    """Whether cutting along the edges leaves more than one piece."""
    rows = np.asarray(faces)
    sides = rows.shape[1]
    tail, head = rows.ravel(), np.roll(rows, -1, axis=1).ravel()
    key = np.minimum(tail, head) * 1000 + np.maximum(tail, head)
    cut = {min(a, b) * 1000 + max(a, b) for a, b in loop}
    groups: dict[int, list[int]] = {}
    for h, k in enumerate(key.tolist()):
        groups.setdefault(k, []).append(h // sides)
    joined = [pair for k, pair in groups.items() if len(pair) == 2 and k not in cut]
    graph = coo_array((np.ones(len(joined)), np.array(joined).T), shape=(len(rows), len(rows)))
    return bool(connected_components(graph, directed=False)[0] > 1)


@pytest.mark.parametrize("holes", [[], [0], [3, 21]])
def test_handles_are_refused_with_a_loop_to_cut_along(holes: list[int]) -> None:
    """The loop is closed, and cutting along it leaves the surface in one piece."""
    i, j = np.divmod(np.arange(48), 8)
    u, v = 2 * np.pi * i / 6, 2 * np.pi * j / 8
    ring = 3 + np.cos(u)
    torus = np.stack([ring * np.cos(v), ring * np.sin(v), np.sin(u)], axis=1)
    quads = np.stack(
        [i * 8 + j, i * 8 + (j + 1) % 8, (i + 1) % 6 * 8 + (j + 1) % 8, (i + 1) % 6 * 8 + j], axis=1
    )
    quads = np.delete(quads, holes, axis=0)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    error = refused(mesh(torus, triangles), HandlesError)
    assert (error.slug, error.data["genus"], error.data["loops"]) == ("handles", 1, len(holes))
    assert error.data["euler_characteristic"] == -len(holes)
    ends = np.array(error.edges)
    assert (np.bincount(ends.ravel())[np.unique(ends)] == 2).all()
    assert not separates(triangles, error.edges)
    assert 6 <= len(ends) <= 8


def test_any_number_of_loops_the_longest_first() -> None:
    vertices, quads = tube(6, 7)
    disk = surface_from_mesh(mesh(vertices, np.delete(quads, np.arange(0, 35, 7), axis=0)))
    assert len(disk.loops) == 1
    hole = surface_from_mesh(mesh(vertices, np.delete(quads, 16, axis=0)))
    assert [len(loop) for loop in hole.loops] == [7, 7, 4]
    assert sorted(hole.loops[2]) == [16, 17, 23, 24]
    ends = [np.arange(7), 35 + np.arange(7)]
    caps = [[end[0], end[k], end[k + 1]] for end in ends for k in range(1, 6)]
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], caps])
    assert surface_from_mesh(mesh(vertices, triangles), SurfaceSettings(caps="keep")).loops == ()


def test_the_reported_indices_are_the_sent_ones() -> None:
    """With strays, duplicates and flipped faces in front, whose repair renumbers everything."""
    vertices, quads = tube()
    points = np.concatenate([np.full((5, 3), 7.0), vertices, [[5.0, 0.0, 1.0]]])
    faces = [[5, 6, 6], *(quads[:, ::-1] + 5).tolist(), (quads[0] + 5).tolist(), [12, 19, 40]]
    error = refused(mesh(points, faces), NonManifoldEdgeError)
    assert sorted(error.edges[0]) == [12, 19]
    assert 30 in error.faces


def test_slugs_are_unique_and_stable() -> None:
    kinds = SurfaceError.__subclasses__()
    assert len({kind.slug for kind in kinds}) == len(kinds)
    assert "handles" in {kind.slug for kind in kinds}
    assert all(kind.__doc__ is not None or kind.title != SurfaceError.title for kind in kinds)
