"""Repairs, and the conventions of what comes out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.surface import Surface, surface_from_mesh
from hexwrap_solver.surface.errors import NonManifoldEdgeError
from hexwrap_solver.surface.orient import INWARD, inward_note
from hexwrap_solver.surface.pieces import pieces
from hexwrap_solver.surface.topology import edge_lengths, face_normals
from hexwrap_solver.surface.types import SentMesh, SurfaceSettings, Triangles
from tests.solver.surface.shapes import mesh, triangles, tube, twisted


def area_vector(surface: Surface) -> np.ndarray:
    """Total signed volume of the cones over the faces: positive where the tube looks outward."""
    points = surface.vertices - surface.vertices.mean(axis=0)
    return np.einsum("ij,ij->", points[surface.faces[:, 0]], face_normals(points, surface.faces))


def same_shape(a: Surface, b: Surface) -> None:
    """Equal sets of corner coordinates of oriented triangles."""

    def rows(s: Surface) -> np.ndarray:
        points = s.vertices[s.faces].round(9) + 0.0
        first = [np.lexsort(p.T)[0] for p in points]
        turned = np.stack([np.roll(p, -k, axis=0) for p, k in zip(points, first, strict=True)])
        return np.unique(turned.reshape(len(points), 9), axis=0)

    np.testing.assert_allclose(rows(a), rows(b), atol=1e-9)


def test_a_clean_tube_is_taken_as_it_is() -> None:
    vertices, quads = tube()
    surface = surface_from_mesh(mesh(vertices, triangles(quads)))
    np.testing.assert_array_equal(surface.vertices, vertices)
    np.testing.assert_array_equal(surface.faces, triangles(quads))
    np.testing.assert_array_equal(surface.input_vertex, np.arange(len(vertices)))
    np.testing.assert_array_equal(surface.vertex_of_input, np.arange(len(vertices)))
    assert surface.repairs == ()
    assert surface.loops[0].tolist() == [0, 1, 2, 3, 4, 5, 6]  # surface on the left: counter-clockwise below
    assert surface.loops[1].tolist() == [28, 34, 33, 32, 31, 30, 29]


@given(st.integers(3, 9), st.integers(2, 6), st.randoms(use_true_random=False))
@settings(max_examples=40, deadline=None)
def test_numbering_changes_only_names(around: int, rings: int, random) -> None:
    vertices, quads = tube(rings, around)
    vertices = twisted(vertices)  # so that no two diagonals do equally well
    order = list(range(len(vertices)))
    random.shuffle(order)
    place = np.argsort(order)
    faces = np.array([np.roll(f, random.randrange(4)) for f in place[quads]])
    random.shuffle(rows := faces.tolist())
    plain, other = surface_from_mesh(mesh(vertices, quads)), surface_from_mesh(mesh(vertices[order], rows))
    assert sorted(map(len, other.loops)) == sorted(map(len, plain.loops))
    same_shape(other, plain)
    np.testing.assert_allclose(other.normals[place], plain.normals, atol=1e-12)
    lowest = [int(other.input_vertex[loop].min()) for loop in other.loops]
    assert lowest[0] < lowest[1]
    assert all(loop[0] == loop.min() for loop in other.loops)


def test_loops_have_the_surface_on_their_left() -> None:
    vertices, quads = tube()
    surface = surface_from_mesh(mesh(vertices, quads))
    directed = {(a, b) for f in surface.faces.tolist() for a, b in zip(f, [*f[1:], f[0]], strict=True)}
    for loop in surface.loops:
        for a, b in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True):
            assert (a, b) in directed
            assert (b, a) not in directed


@given(st.sets(st.integers(0, 27), max_size=13))
@settings(max_examples=30, deadline=None)
def test_the_majority_of_faces_decides_the_outside(turned: set[int]) -> None:
    vertices, quads = tube()
    mixed = np.array([q[::-1] if i in turned else q for i, q in enumerate(quads)])
    surface = surface_from_mesh(mesh(vertices, mixed))
    same_shape(surface, surface_from_mesh(mesh(vertices, quads)))
    assert bool(surface.repairs) == bool(turned)
    if turned:
        assert surface.repairs[0].startswith(f"{len(turned)} face")


def test_soup_is_welded_to_the_lowest_vertex() -> None:
    vertices, quads = tube()
    faces = triangles(quads)
    soup = mesh(vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))
    surface = surface_from_mesh(soup)
    same_shape(surface, surface_from_mesh(mesh(vertices, faces)))
    np.testing.assert_array_equal(surface.vertices, soup.vertices[surface.input_vertex])
    np.testing.assert_array_equal(surface.vertices[surface.vertex_of_input], soup.vertices)
    assert (surface.input_vertex <= np.arange(faces.size)[surface.input_vertex]).all()
    assert surface.repairs == ("133 vertices were welded to one within 1e-06 of the model's size.",)


@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_a_noisy_seam_is_welded_within_the_tolerance(offset: float) -> None:
    vertices, quads = tube(5, 8)
    seam = np.arange(5) * 8
    noise = np.random.default_rng(1).uniform(-3e-7, 3e-7, (5, 3)) * 2
    copies = np.concatenate([vertices, vertices[seam] + noise]) * 1000 + offset
    opened = quads.copy()
    last = np.arange(4) * 8 + 7
    opened[last, 1], opened[last, 2] = 40 + np.arange(4), 41 + np.arange(4)
    surface = surface_from_mesh(mesh(copies, opened))
    assert len(surface.vertices) == 40
    assert surface.vertex_of_input[40:].tolist() == seam.tolist()
    assert surface.repairs == ("5 vertices were welded to one within 1e-06 of the model's size.",)


def test_a_crack_that_leaves_an_annulus_is_closed_too() -> None:
    vertices, quads = tube(5, 8)
    opened = quads.copy()
    opened[7, 1] = 40  # vertex 0 once more, on one side only
    surface = surface_from_mesh(mesh(np.concatenate([vertices, vertices[:1]]), opened))
    assert [len(loop) for loop in surface.loops] == [8, 8]


def test_a_strongly_graded_mesh_keeps_its_smallest_triangles() -> None:
    """Edges of 1e-7 of the diagonal, inside and on the boundary, below the welding tolerance."""
    vertices, quads = tube(30, 12)
    ring = np.repeat(np.arange(30), 12)
    vertices[:, 2] = 1.0
    graded = vertices * 0.6 ** ring[:, None]
    surface = surface_from_mesh(mesh(graded, quads))
    assert edge_lengths(surface.vertices, surface.faces).min() < 5e-7
    assert len(surface.vertices) == 360


def test_slivers_are_kept() -> None:
    vertices, quads = tube(3, 6)
    faces = triangles(quads)
    a, b = vertices[0], vertices[1]
    ends = (a + b) / 2 + np.array([0, 0, 1]) * np.linalg.norm(b - a) / 2 * np.tan(np.radians(1e-4))
    sliver = np.concatenate([[[0, 1, 18], [1, faces[0, 2], 18], [faces[0, 2], 0, 18]], faces[1:]])
    surface = surface_from_mesh(mesh(np.concatenate([vertices, [ends]]), sliver))
    np.testing.assert_array_equal(surface.faces, sliver)


def test_a_cap_on_another_faces_edge_is_merged_without_tearing() -> None:
    """A vertex in the middle of an inner edge, joined to one side only; the other side closed by a
    triangle without area."""
    vertices, quads = tube(4, 6)
    faces = triangles(quads).tolist()
    a, b, c = faces.pop(14)  # in the second row
    middle = len(vertices)
    points = np.concatenate([vertices, [(vertices[a] + vertices[c]) / 2]])
    faces += [[a, b, middle], [b, c, middle], [a, middle, c]]
    surface = surface_from_mesh(mesh(points, faces))
    assert len(surface.faces) == len(faces)
    assert len(surface.vertices) == len(points)
    assert surface.repairs == ("1 triangle without area was merged into the neighbours.",)
    areas = np.linalg.norm(face_normals(surface.vertices, surface.faces), axis=1)
    assert areas.min() > 0.01


def test_a_cap_at_the_boundary_is_dropped_and_the_boundary_runs_through_its_vertex() -> None:
    vertices, quads = tube(3, 6)
    faces = triangles(quads)
    middle = (vertices[0] + vertices[1]) / 2
    top = faces[0, 2]
    capped = np.concatenate([[[0, 1, 18], [1, top, 18], [top, 0, 18]], faces[1:]])
    surface = surface_from_mesh(mesh(np.concatenate([vertices, [middle]]), capped))
    assert len(surface.faces) == len(capped) - 1
    assert surface.loops[0].tolist() == [0, 18, 1, 2, 3, 4, 5]


def test_edges_without_length_are_welded() -> None:
    vertices, quads = tube(4, 6)
    points = np.concatenate(
        [vertices, vertices[8:9]]
    )  # vertex 24 stands where 8 does, joined to it by an edge
    faces = triangles(quads)
    fan = np.flatnonzero((faces == 8).any(axis=1))
    split = faces.copy()
    above = [f for f in fan if (faces[f] >= 12).any()]
    split[above] = np.where(faces[above] == 8, 24, faces[above])
    sides = {tuple(e) for f in split.tolist() for e in zip(f, [*f[1:], f[0]], strict=True)}
    gaps = [(b, a) for a, b in sides if (b, a) not in sides and (a in (8, 24) or b in (8, 24))]
    start = dict(gaps)
    loop, at = [], gaps[0][0]
    while not loop or at != loop[0]:
        loop.append(at)
        at = start[at]
    fill = [[loop[0], loop[k], loop[k + 1]] for k in range(1, len(loop) - 1)]
    surface = surface_from_mesh(mesh(points, [*split.tolist(), *fill]))
    assert len(surface.vertices) == 24
    assert surface.vertex_of_input[24] == surface.vertex_of_input[8] == 8
    same_shape(surface, surface_from_mesh(mesh(vertices, faces)))


@pytest.mark.parametrize("apart", [False, True], ids=["shared vertices", "own vertices"])
def test_a_mesh_with_two_sides_is_one_sheet(apart: bool) -> None:
    """Every face again, seen from behind; of a box, so that no diagonal of a quad is the better one."""
    ring = np.array([[0, 0], [4, 0], [4, 4], [0, 4]], dtype=float)
    vertices = np.array([[x, y, z] for z in (0, 4, 8) for x, y in ring], dtype=float)
    quads = tube(3, 4)[1]
    behind = quads[:, ::-1] + len(vertices) * apart
    both = mesh(np.tile(vertices, (1 + apart, 1)), np.concatenate([quads, behind]))
    (piece,) = pieces(both)
    assert len(piece.faces) == 2 * len(quads)
    assert piece.loops == 2
    surface = surface_from_mesh(both)
    np.testing.assert_array_equal(surface.faces, surface_from_mesh(mesh(vertices, quads)).faces)
    assert "8 faces with the same corners as another one were left out." in surface.repairs


def test_duplicates_and_strays_are_left_out() -> None:
    vertices, quads = tube()
    points = np.concatenate([[[9.0, 9.0, 9.0]], vertices])
    faces = [
        *(quads + 1).tolist(),
        (quads[3] + 1)[::-1].tolist(),
        (quads[5] + 1)[[2, 3, 0, 1]].tolist(),
        [1, 2, 2],
    ]
    surface = surface_from_mesh(mesh(points, faces))
    assert len(surface.faces) == 2 * len(quads)
    assert surface.vertex_of_input[0] == -1
    assert surface.input_vertex[0] == 1
    assert surface.repairs == (
        "1 vertex that no face uses was left out.",
        "2 faces with the same corners as another one were left out.",
        "1 triangle without three different corners was left out.",
    )


def test_quads_are_split_along_the_delaunay_diagonal() -> None:
    vertices, quads = tube()
    vertices = twisted(vertices)
    surface = surface_from_mesh(mesh(vertices, quads))
    other = quads[:, [0, 2]], quads[:, [1, 3]]
    length = [np.linalg.norm(vertices[d[:, 0]] - vertices[d[:, 1]], axis=1) for d in other]
    sides = {tuple(sorted(e)) for f in surface.faces.tolist() for e in zip(f, [*f[1:], f[0]], strict=True)}
    for k, quad in enumerate(quads.tolist()):
        shorter = [quad[0], quad[2]] if length[0][k] < length[1][k] else [quad[1], quad[3]]
        assert tuple(sorted(shorter)) in sides


def test_a_quad_with_a_repeated_corner_is_a_triangle() -> None:
    vertices, quads = tube()
    faces = [[a, b, b, c] if k % 2 else [a, b, c, c] for k, (a, b, c) in enumerate(triangles(quads).tolist())]
    surface = surface_from_mesh(mesh(vertices, faces))
    same_shape(surface, surface_from_mesh(mesh(vertices, triangles(quads))))
    assert surface.repairs == ()


def test_sent_normals_are_unit_outward_and_completed() -> None:
    vertices, quads = tube()
    own = surface_from_mesh(mesh(vertices, quads)).normals
    sent = -3.0 * own
    sent[4], sent[5] = 0.0, np.nan
    surface = surface_from_mesh(mesh(vertices, quads, sent))
    np.testing.assert_allclose(surface.normals, own, atol=1e-12)
    assert len(surface.repairs) == 2


def test_touching_boundaries_are_left_apart() -> None:
    """Loops that stand on one another in one point: welding them would spoil the annulus."""
    vertices, quads = tube(3, 8)
    vertices[16] = vertices[0]
    surface = surface_from_mesh(mesh(vertices, quads))
    assert [len(loop) for loop in surface.loops] == [8, 8]
    assert len(surface.vertices) == 24


@given(st.floats(1e-9, 1e9), st.integers(0, 2**31))
@settings(max_examples=25, deadline=None)
def test_scale_and_rigid_motion_change_nothing(scale: float, seed: int) -> None:
    vertices, quads = tube(6, 9)
    vertices = vertices + np.random.default_rng(3).normal(0, 0.02, vertices.shape)
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    moved = surface_from_mesh(mesh(scale * (vertices @ turn.T + rng.normal(size=3)), quads))
    plain = surface_from_mesh(mesh(vertices, quads))
    np.testing.assert_array_equal(moved.faces, plain.faces)
    np.testing.assert_allclose(moved.normals, plain.normals @ turn.T, atol=1e-9)


@pytest.mark.parametrize("height", [0.1, 1.0, 60.0])
def test_a_tube_that_looks_inwards_is_left_so_and_told(height: float) -> None:
    vertices, quads = tube(rings=9, around=24)
    vertices = twisted(vertices) * [1.0, 1.0, height] + 1e3
    outward, inward = (surface_from_mesh(mesh(vertices, faces)) for faces in (quads, quads[:, ::-1]))
    assert inward_note(outward) == ()
    assert inward_note(inward) == (INWARD,)
    assert inward.repairs == ()


def test_a_ring_or_a_shell_has_no_inside() -> None:
    vertices, quads = tube(rings=5, around=24)
    z = vertices[:, 2]
    flat = vertices * [1.0, 1.0, 0.0] * (1 + z)[:, None] + np.outer(0.05 * z, [0.0, 0.0, 1.0])
    for faces in (quads, quads[:, ::-1]):
        assert inward_note(surface_from_mesh(mesh(flat, faces))) == ()


@pytest.mark.parametrize("missing", [0, 1, 3])
def test_closed_surfaces_and_domes_that_look_inwards_are_told(missing: int) -> None:
    """A house, with its floor, without, and without its floor and a slope."""
    points = np.array([(x, y, z) for z in (0, 5) for y in (0, 8) for x in (0, 12)] + [(0, 4, 8), (12, 4, 8)])
    floor = [[0, 2, 3], [0, 3, 1]]
    walls = [[0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6], [6, 4, 8], [5, 7, 9]]
    faces = [*floor, *walls, [4, 5, 9, 8], [7, 6, 8, 9]][2 * (missing > 0) :][: None if missing < 3 else -1]
    keep = SurfaceSettings(caps="keep")
    outward, inward = (
        surface_from_mesh(mesh(points.astype(float), some), keep)
        for some in (faces, [face[::-1] for face in faces])
    )
    assert inward_note(outward) == ()
    assert inward_note(inward) == (INWARD,)


@pytest.mark.parametrize("windows", [0, 1, 2])
def test_a_curved_facade_has_no_inside_with_windows_or_without(windows: int) -> None:
    vertices, quads = tube(rings=13, around=48)
    half = quads[(quads % 48).max(axis=1) <= 24]
    front = vertices * [1.0, 1.0, 2.0]
    faces = np.delete(half, [24 * 5 + 6, 24 * 5 + 15][:windows], axis=0)
    for some in (faces, faces[:, ::-1]):
        assert inward_note(surface_from_mesh(mesh(front, some))) == ()


def test_the_outside_of_the_tube_is_outside() -> None:
    vertices, quads = tube()
    assert area_vector(surface_from_mesh(mesh(vertices, quads))) > 0
    assert area_vector(surface_from_mesh(mesh(vertices, quads[:, ::-1]))) < 0


def _sent(kind: str) -> SentMesh:
    """A tube that the intake has to mend in one way."""
    vertices, quads = tube(9, 5)
    faces = triangles(quads)
    if kind == "unused":
        return mesh(np.insert(vertices, 7, 99.0, axis=0), faces + (faces >= 7))
    if kind == "turned":
        return mesh(vertices, np.concatenate([faces[:3, ::-1], faces[3:]]))
    if kind == "doubled":
        return mesh(vertices, np.concatenate([faces[:4], faces]))
    if kind == "soup":
        noise = np.random.default_rng(0).normal(scale=1e-9, size=(faces.size, 3))
        return mesh(vertices[faces].reshape(-1, 3) + noise, np.arange(faces.size).reshape(-1, 3))
    if kind == "capped":  # a triangle without area in the middle of an edge
        middle = vertices[faces[20, :2]].mean(axis=0)
        a, b, c = faces[20]
        n = len(vertices)
        return mesh(
            np.concatenate([vertices, [middle]]), [*np.delete(faces, 20, 0), [a, b, n], [a, n, c], [n, b, c]]
        )
    return mesh(vertices, faces)


@pytest.mark.parametrize("kind", ["clean", "unused", "turned", "doubled", "soup", "capped"])
def test_what_the_intake_hands_on_is_what_follows_from_the_surface(kind: str) -> None:
    surface = surface_from_mesh(_sent(kind))
    assert (len(surface.repairs) > 0) == (kind != "clean")
    afresh = Triangles(surface.vertices, surface.faces)
    for found, expected in zip(surface.edge_groups, afresh.edge_groups, strict=True):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(surface.twin, afresh.twin)
    np.testing.assert_array_equal(surface.lengths, afresh.lengths)
    low, high = surface.edge_ends
    assert {tuple(sorted(e)) for e in surface.faces[:, [0, 1]].tolist()} <= set(
        zip(low.tolist(), high.tolist(), strict=True)
    )


@pytest.mark.parametrize("scale", [1.0, 1e4])
def test_t_junctions_are_closed(scale: float) -> None:
    """Every edge that a vertex stands on without being its end is divided there: the tube is whole again."""
    vertices, quads = tube(6, 12)
    vertices, faces = vertices * scale, triangles(quads).tolist()
    for k in range(0, len(faces), 5):  # a third vertex on the first edge of every fifth triangle alone
        a, b, c = faces[k]
        vertices = np.append(vertices, [(vertices[a] + vertices[b]) / 2], axis=0)
        faces[k] = [a, len(vertices) - 1, c]
        faces.append([len(vertices) - 1, b, c])
    surface = surface_from_mesh(mesh(vertices, faces))
    assert sorted(map(len, surface.loops)) == [12, 15]  # 3 of the 24 vertices stand on the boundary
    assert "21 open edges were divided at vertices of others." in surface.repairs


def test_one_edge_is_divided_at_any_number_of_vertices() -> None:
    """Of a square tower the lower half has a quad to each side, the upper one forty."""
    corners = np.array([[0, 0], [9, 0], [9, 9], [0, 9]], dtype=float)
    fine = np.concatenate(
        [np.linspace(a, b, 40, endpoint=False) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)]
    )
    levels = [(corners, 0.0), (corners, 9.0), (fine, 9.0), (fine, 18.0)]
    vertices = np.concatenate([np.column_stack([plan, np.full(len(plan), z)]) for plan, z in levels])
    faces = []
    for first, n in ((0, 4), (8, 160)):
        k, j = first + np.arange(n), first + (np.arange(n) + 1) % n
        faces += np.stack([k, j, j + n, k + n], axis=1).tolist()
    surface = surface_from_mesh(mesh(vertices, faces))
    assert sorted(map(len, surface.loops)) == [4, 160]


def test_tiny_triangles_are_no_copies_of_each_other() -> None:
    """A cone in rings down to less than the tolerance; its skirt has a vertex on each of its edges."""
    n = 24
    angle = 2 * np.pi * np.arange(n) / n
    way = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    radius = np.geomspace(3e-7, 10, 40)
    rim = 10 * np.stack([way, (way + np.roll(way, -1, axis=0)) / 2], axis=1).reshape(-1, 3)
    skirt = np.concatenate([rim, rim - [0, 0, 5]])
    vertices = np.concatenate([[[0, 0, 10]], *(r * way + [0, 0, 10 - r] for r in radius), skirt])
    k, j = np.arange(n), (np.arange(n) + 1) % n
    faces = np.column_stack([0 * k, 1 + k, 1 + j]).tolist()
    for row in range(len(radius) - 1):
        a = 1 + row * n
        faces += np.column_stack([a + k, a + n + k, a + n + j, a + j]).tolist()
    a, k, j = 1 + len(radius) * n, np.arange(2 * n), (np.arange(2 * n) + 1) % (2 * n)
    faces += np.column_stack([a + k, a + 2 * n + k, a + 2 * n + j, a + j]).tolist()
    surface = surface_from_mesh(mesh(vertices, faces))
    assert len(surface.loops) == 1
    assert not any("left out" in note and "within" in note for note in surface.repairs)


def test_faces_nearly_on_top_of_others_count_once() -> None:
    """A part copied with rounding errors, quads cut along the other diagonal: vertices are within the
    tolerance of those of the closed surface, where there is no open edge to weld them to."""
    vertices, quads = tube()
    copy = vertices + 1e-12
    faces = [*quads.tolist(), *np.roll(quads[7:16] + len(vertices), 1, axis=1).tolist()]
    surface = surface_from_mesh(mesh(np.concatenate([vertices, copy]), faces))
    same_shape(surface, surface_from_mesh(mesh(vertices, quads)))
    assert any("within 1e-06 of the model's size of others were left out" in note for note in surface.repairs)


def floored(levels: list[int], inverted: bool = False) -> SentMesh:
    """A tube of nine rows with floors welded to some of them."""
    vertices, quads = tube(9, 24)
    faces = quads.tolist()
    for k in levels:
        at = (24 * k + np.arange(24)).tolist()
        middle = len(vertices)
        vertices = np.append(vertices, [vertices[at].mean(axis=0)], axis=0)
        floor = [[middle, a, b] for a, b in zip(at, [*at[1:], at[0]], strict=True)]
        faces = [*floor, *faces] if inverted else [*faces, *floor]
    return mesh(vertices, faces)


@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("levels", [[4], [2, 4, 6], [0, 3, 8]])
def test_floors_welded_to_a_tower_are_left_out(levels: list[int], inverted: bool) -> None:
    vertices, quads = tube(9, 24)
    surface = surface_from_mesh(floored(levels, inverted))
    inner = len(set(levels) - {0, 8})
    what = "1 floor or inner wall" if inner == 1 else f"{inner} floors or inner walls"
    assert surface.repairs[0].startswith(f"{what} of {24 * inner} faces in all left out, around (")
    same_shape(surface, surface_from_mesh(mesh(vertices, quads)))


def test_what_is_left_out_does_not_change_the_indices_of_other_faults() -> None:
    """A fin beside the floor is refused, with its faces as they were sent."""
    sent = floored([4], inverted=True)
    points = np.append(sent.vertices, [[5.0, 0.0, 1.0]], axis=0)
    faces = [*sent.faces.to_lists(), [24, 48, len(points) - 1]]
    with pytest.raises(NonManifoldEdgeError) as refused:
        surface_from_mesh(mesh(points, faces))
    assert len(faces) - 1 in refused.value.faces
