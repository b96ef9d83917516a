"""Theorems about meshes of boundary representations: whole, near, oriented, and the same in any order."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hexwrap_solver.arrays import Floats, Ragged
from hexwrap_solver.surface import MeshSettings, NurbsSurface, SentMesh
from hexwrap_solver.surface.brep import (
    Brep,
    BrepMesh,
    Edge,
    Face,
    NurbsCurve,
    Trim,
    brep_of_surface,
    joined,
    mesh_brep,
    together,
)
from hexwrap_solver.surface.brep.pull import follow, patch_of
from hexwrap_solver.surface.brep.surface import INSIDE_OUT, surface_from_brep
from hexwrap_solver.surface.errors import NurbsDataError, TooFineError, TrimError
from hexwrap_solver.surface.nurbs import evaluate_points
from hexwrap_solver.surface.projection import project
from hexwrap_solver.surface.topology import boundary_loops, edge_groups, edge_lengths, twins
from tests.solver.surface.brep_shapes import bilinear, box, fitted_curve, fitted_surface, line, trimmed_tower
from tests.solver.surface.nurbs_shapes import CORNERS, WEIGHTS, cylinder, revolution


def sphere(radius: float = 5.0) -> NurbsSurface:
    """Half a circle turned around the z axis: two poles."""
    profile = radius * CORNERS[[6, 7, 8, 1, 2]]
    knots = np.array([0, 0, 0, 1, 1, 2, 2, 2], dtype=float)
    return revolution(profile, WEIGHTS[[6, 7, 8, 1, 2]], knots, 2)


def dome(radius: float = 5.0) -> NurbsSurface:
    return revolution(radius * CORNERS[[0, 1, 2]], WEIGHTS[:3], np.array([0, 0, 0, 1, 1, 1.0]), 2)


def folded(rows: int = 9) -> NurbsSurface:
    """A square tube of degree 1 around, cubic along, twisted: its corners are knots."""
    z = np.linspace(0, 1, rows)
    corner = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]]) @ [1, 1j]
    net = np.zeros((5, rows, 4))
    turned = 8 * corner[:, None] * np.exp(0.5j * z)
    net[..., 0], net[..., 1], net[..., 2], net[..., 3] = turned.real, turned.imag, 40 * z, 1
    cubic = np.concatenate([[0] * 3, np.linspace(0, 1, rows - 2), [1] * 3])
    return NurbsSurface((1, 3), (np.array([0, 0, 1, 2, 3, 4, 4.0]), cubic), net, (True, False))


def capped(nurbs: NurbsSurface) -> Brep:
    """The surface, and planes trimmed by its two boundary circles."""
    tube = brep_of_surface(nurbs, 1e-3)
    made = [tube]
    for e, z in ((0, 0.0), (len(tube.edges) - 1, float(nurbs.control_points[..., 2].max()))):
        edge = tube.edges[e]
        reach = 2 * float(np.abs(nurbs.control_points[..., :2]).max())
        plane = bilinear([[[-reach, -reach, z], [-reach, reach, z]], [[reach, -reach, z], [reach, reach, z]]])
        loop = tube.faces[0].loops[0]
        trim = next(t for t in loop if t.edge == e)
        own = replace(trim, edge=0, start=0, end=0, reversed=False)
        made.append(
            Brep(
                tube.vertices[[edge.start]],
                (replace(edge, start=0, end=0),),
                (Face(plane, ((own,),), z == 0.0),),
                1e-3,
            )
        )
    return joined(together(made))[0]


SHAPES = {
    "box": (box(), 2, 0),
    "open box": (box(caps=False), 0, 2),
    "cylinder": (brep_of_surface(cylinder(), 1e-3), 0, 2),
    "capped cylinder": (capped(cylinder()), 2, 0),
    "sphere": (brep_of_surface(sphere(), 1e-3), 2, 0),
    "dome": (brep_of_surface(dome(), 1e-3), 1, 1),
    "folded tube": (brep_of_surface(folded(), 1e-3), 0, 2),
    "trimmed tower": (trimmed_tower(), -8, 10),
    "tower": (trimmed_tower(windows=False), 0, 2),
}
SETTINGS = {
    "as it comes": MeshSettings(),
    "edges": MeshSettings(max_edge=1.6),
    "tolerance": MeshSettings(tolerance=0.1),
    "both": MeshSettings(max_edge=3.0, tolerance=0.2),
}


@cache
def meshed(name: str, how: str = "as it comes") -> BrepMesh:
    return mesh_brep(SHAPES[name][0], SETTINGS[how])


def euler(mesh: BrepMesh) -> int:
    _, first = edge_groups(mesh.faces, len(mesh.vertices))
    return len(mesh.vertices) - (len(first) - 1) + len(mesh.faces)


def distances(brep: Brep, mesh: BrepMesh, weights: Floats) -> Floats:
    """(m,) how far a point of each triangle, given by its weights (3,), is from the triangle's surface."""
    out = np.zeros(len(mesh.faces))
    for k, face in enumerate(brep.faces):
        own = mesh.face == k
        points = np.einsum("c,fcd->fd", weights, mesh.vertices[mesh.faces[own]])
        uv = np.einsum("c,fcd->fd", weights, mesh.uv[own])
        foot, _, _ = project(replace(face.surface, closed=(False, False)), points, uv)
        out[own] = np.linalg.norm(points - foot, axis=1)
    return out


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("how", SETTINGS)
def test_sewn_without_cracks_oriented_and_within_sizes(name: str, how: str) -> None:
    brep, characteristic, loops = SHAPES[name]
    settings = SETTINGS[how]
    mesh = meshed(name, how)
    _, first = edge_groups(mesh.faces, len(mesh.vertices))
    assert np.diff(first).max() <= 2
    twin = twins(mesh.faces, len(mesh.vertices))
    inner = np.flatnonzero(twin >= 0)
    tail = mesh.faces.ravel()
    assert np.all(tail[inner] != tail[twin[inner]])  # neighbours pass their edge in opposite directions
    assert euler(mesh) == characteristic
    rims = boundary_loops(mesh.faces, twin) if (twin < 0).any() else []
    assert len(rims) == loops
    length = edge_lengths(mesh.vertices, mesh.faces)
    if settings.max_edge is not None:
        assert length.max() <= settings.max_edge
    if settings.tolerance is not None:
        for corner in range(3):
            middle = distances(brep, mesh, np.roll([0.5, 0.5, 0.0], corner))
            assert middle.max() <= settings.tolerance + brep.tolerance
    assert distances(brep, mesh, np.array([1.0, 0, 0])).max() <= brep.tolerance


@pytest.mark.parametrize("name", SHAPES)
def test_triangles_are_well_shaped_and_look_outwards(name: str) -> None:
    mesh = meshed(name)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    long = np.sort(edge_lengths(mesh.vertices, mesh.faces), axis=1)
    least = np.degrees(np.arcsin(np.linalg.norm(normal, axis=1) / (long[:, 1] * long[:, 2])))
    assert np.percentile(least, 1) > 25
    assert least.min() > 12
    assert 5_000 < len(mesh.vertices) < 14_000
    mean = mesh.normals[mesh.faces].sum(axis=1)
    assert np.all(np.einsum("ij,ij->i", normal, mean) > 0)


@pytest.mark.parametrize("name", ["box", "trimmed tower"])
def test_the_order_of_faces_and_edges_changes_only_names(name: str) -> None:
    brep, _, _ = SHAPES[name]
    rng = np.random.default_rng(3)
    order = rng.permutation(len(brep.edges))
    where = np.argsort(order)
    faces = [
        replace(
            face,
            loops=tuple(tuple(replace(t, edge=int(where[t.edge])) for t in loop) for loop in face.loops),
        )
        for face in brep.faces
    ]
    shuffled = replace(
        brep,
        edges=tuple(brep.edges[i] for i in order),
        faces=tuple(faces[i] for i in rng.permutation(len(faces))),
    )
    one, two = meshed(name), mesh_brep(shuffled)
    key = [
        np.sort(np.round(m.vertices[m.faces].mean(axis=1), 6).view("f8,f8,f8").ravel()) for m in (one, two)
    ]
    assert np.array_equal(key[0], key[1])


def test_creases_are_the_edges_at_which_faces_meet_at_an_angle() -> None:
    size = (12.0, 9.0, 30.0)
    mesh = mesh_brep(box(size))
    assert np.allclose(mesh.fold, np.pi / 2)
    middle = mesh.vertices[mesh.creases].mean(axis=1)
    on = (np.abs(middle / size - 0.5) > 0.5 - 1e-12).sum(axis=1)
    assert np.all(on == 2)
    length = np.linalg.norm(np.diff(mesh.vertices[mesh.creases], axis=1), axis=2).sum()
    assert length == pytest.approx(4 * sum(size))
    assert len(meshed("tower").creases) == 0


def test_kinks_of_degree_one_are_creases_and_keep_their_corners() -> None:
    nurbs = folded()
    mesh = mesh_brep(brep_of_surface(nurbs, 1e-3), MeshSettings(max_edge=2.5))
    inner = mesh.vertices[np.unique(mesh.creases)]
    assert len(mesh.creases) > 4 * 15
    assert np.allclose(np.hypot(inner[:, 0], inner[:, 1]), 8 * np.sqrt(2), atol=0.06)
    for corner in nurbs.control_points[:4, 0, :3]:
        assert np.linalg.norm(mesh.vertices - corner, axis=1).min() < 1e-9
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    twin = twins(mesh.faces, len(mesh.vertices))
    h = np.flatnonzero(twin > np.arange(len(twin)))
    fold = np.arccos(np.clip(np.einsum("ij,ij->i", flat[h // 3], flat[twin[h] // 3]), -1, 1))
    assert (fold > 0.6).sum() == len(mesh.creases)


def test_faces_that_meet_within_the_tolerance_are_joined() -> None:
    walls = box(caps=False)
    apart = [replace(walls, faces=(face,)) for face in walls.faces]
    moved = [
        brep.transformed(np.array([[1, 0, 0, 2e-4 * k], [0, 1, 0, 0], [0, 0, 1, 1e-4 * k], [0, 0, 0, 1.0]]))
        for k, brep in enumerate(apart)
    ]
    whole, joints = joined(together(moved))
    assert joints.count == 4
    assert 1e-4 < joints.gap < 1e-3
    assert len(joints.open) == 8
    assert euler(mesh_brep(whole)) == 0
    loose, none = joined(together(moved), 1e-6)
    assert none.count == 0
    assert euler(mesh_brep(loose)) == 4


def test_an_edge_is_divided_where_corners_of_others_lie_on_it() -> None:
    corner = np.array([[0, 0, 0], [10, 0, 0], [0, 8, 0], [10, 8, 0]], dtype=float)
    low = brep_of_surface(bilinear([[corner[0], corner[2]], [corner[1], corner[3]]]), 1e-3)
    up = [
        brep_of_surface(bilinear([[[a, 8, 0], [a, 8, 5]], [[b, 8, 0], [b, 8, 5]]]), 1e-3)
        for a, b in ((0, 4), (4, 7), (7, 10))
    ]
    whole, joints = joined(together([low, *up]))
    assert joints.count == 5
    assert euler(mesh_brep(whole)) == 1


def test_mirrored_and_moved_breps_have_mirrored_meshes() -> None:
    brep = trimmed_tower(windows=False)
    matrix = np.diag([-1.0, 1, 1, 1])
    matrix[:3, 3] = 100, -50, 7
    one, two = (
        mesh_brep(brep, MeshSettings(max_edge=3)),
        mesh_brep(brep.transformed(matrix), MeshSettings(max_edge=3)),
    )

    def volume(mesh: BrepMesh) -> float:
        at = mesh.vertices - mesh.vertices.mean(axis=0)
        return float(
            np.einsum("fi,fi->", at[mesh.faces[:, 0]], np.cross(at[mesh.faces[:, 1]], at[mesh.faces[:, 2]]))
        )

    assert volume(one) > 0
    assert volume(two) == pytest.approx(volume(one), rel=1e-3)


def test_refusals() -> None:
    brep = trimmed_tower(windows=False)
    with pytest.raises(TooFineError, match="vertices"):
        mesh_brep(brep, MeshSettings(max_edge=1e-4))
    with pytest.raises(NurbsDataError, match="positive"):
        mesh_brep(brep, MeshSettings(max_edge=-1.0))
    lifted = replace(
        brep.faces[2], surface=fitted_surface(lambda u, v: np.stack([u, v, 0 * u], -1), (0, 1), (0, 1))
    )
    with pytest.raises(TrimError, match=r"Face 2|face 2"):
        mesh_brep(replace(brep, faces=(*brep.faces[:2], lifted, *brep.faces[3:])))


def test_a_periodic_surface_whose_seam_is_a_hair_off_its_knot() -> None:
    nurbs = cylinder()
    u, v = nurbs.knots
    moved = replace(nurbs, knots=(u * 13.147153588307066 / 4 - 7e-15, v))
    assert euler(mesh_brep(brep_of_surface(moved, 1e-3))) == 0


def test_a_face_one_row_high() -> None:
    corner = np.array([[[0, 0, 0], [0, 0, 0.05]], [[40, 0, 0], [40, 0, 0.05]]])
    mesh = mesh_brep(brep_of_surface(bilinear(corner), 1e-3), MeshSettings(max_edge=2.0))
    assert euler(mesh) == 1


def test_a_face_a_few_triangles_wide_around_a_pole_or_a_seam_has_every_edge_once() -> None:
    for name in ("sphere", "dome", "cylinder"):
        brep = SHAPES[name][0]
        for longest in (30.0, 100.0):
            mesh = mesh_brep(brep, MeshSettings(max_edge=longest))
            _, first = edge_groups(mesh.faces, len(mesh.vertices))
            assert np.diff(first).max() <= 2


def spiral() -> Brep:
    """A wall that closes only within 0.01, three times the tolerance, between exact circles."""

    def shape(u: Floats, v: Floats) -> Floats:
        radius = 1 + 0.01 * u
        return np.stack([radius * np.cos(2 * np.pi * u), radius * np.sin(2 * np.pi * u), v], -1)

    def circle(z: float) -> NurbsCurve:
        return fitted_curve(
            lambda t: shape(t, 0 * t + z) / np.stack([1 + 0.01 * t, 1 + 0.01 * t, 1 + 0 * t], -1)
        )

    points = np.array([[1.0, 0, 0], [1.0, 0, 2]])
    seams = [line(shape(np.array(u), np.array(0.0)), shape(np.array(u), np.array(2.0))) for u in (0.0, 1.0)]
    edges = (
        Edge(circle(0.0), (0.0, 1.0), 0, 0),
        Edge(circle(2.0), (0.0, 1.0), 1, 1),
        *(Edge(seam, (0.0, 1.0), 0, 1) for seam in seams),
    )
    loop = (Trim(0, False, 0, 0), Trim(3, False, 0, 1), Trim(1, True, 1, 1), Trim(2, True, 1, 0))
    return Brep(points, edges, (Face(fitted_surface(shape, (0, 1), (0, 2), (40, 6)), (loop,), False),), 3e-3)


def test_trims_of_a_surface_that_nearly_closes_end_on_the_side_they_come_from() -> None:
    mesh = mesh_brep(spiral(), MeshSettings(max_edge=0.3))
    assert euler(mesh) == -1  # both ends of the slit are one vertex each
    assert mesh.uv[..., 0].min() < 0.01
    assert mesh.uv[..., 0].max() > 0.99


def test_points_far_off_are_pulled_again_from_their_neighbours() -> None:
    surface = fitted_surface(lambda u, v: np.stack([u, np.sin(6 * u), v], -1), (0, 1), (0, 1))
    along = np.linspace(0.02, 0.98, 40)
    right = np.stack([along, along**2], axis=1)
    points = evaluate_points(surface, right)
    uv, distance = right.copy(), np.zeros(40)
    uv[10:14], distance[10:14] = [1.0, 0.0], 1.0
    follow(patch_of(surface, 1e-6), points, uv, distance, 1e-6)
    assert distance.max() < 1e-6
    assert np.abs(uv - right).max() < 1e-4


def crossing(render: bool) -> Brep:
    """An open box one of whose walls has a boundary that crosses itself."""
    brep = box(caps=False)
    mesh = mesh_brep(brep, MeshSettings(max_edge=4.0))
    faces = []
    for k, face in enumerate(brep.faces):
        own = SentMesh(mesh.vertices, Ragged.from_table(mesh.faces[mesh.face == k])) if render else None
        loops = face.loops if k else ((*face.loops[0][:1], *face.loops[0][2:], face.loops[0][1]),)
        faces.append(replace(face, loops=loops, render=own))
    return replace(brep, faces=tuple(faces))


def test_meshes_that_came_with_a_polysurface_are_taken_where_a_face_cannot_be_meshed() -> None:
    with pytest.raises(TrimError):
        surface_from_brep(crossing(render=False))
    matrix = np.diag([-1.0, 2.0, 1.0, 1.0])
    for brep in (crossing(render=True), crossing(render=True).transformed(matrix)):
        surface = surface_from_brep(brep)
        assert len(surface.loops) == 2
        assert "own render meshes of 4 faces" in surface.repairs[0]
    assert np.ptp(surface.vertices[:, 1]) == pytest.approx(18)


def test_a_closed_polysurface_that_is_inside_out_is_turned_and_loses_its_caps() -> None:
    outward = box()
    faces = tuple(replace(face, reversed=not face.reversed) for face in outward.faces)
    one, other = surface_from_brep(outward), surface_from_brep(replace(outward, faces=faces))
    assert other.repairs == (INSIDE_OUT, *one.repairs)
    assert len(one.loops) == len(other.loops) == 2
    np.testing.assert_allclose(one.normals, other.normals, atol=1e-12)
