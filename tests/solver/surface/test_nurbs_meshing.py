"""Meshing of NURBS surfaces: what was asked for, no seam, well-shaped triangles; and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexwrap_solver.arrays import Floats, Ragged
from hexwrap_solver.errors import SurfaceError
from hexwrap_solver.surface import (
    MeshSettings,
    NurbsSurface,
    SentMesh,
    Surface,
    surface_from_mesh,
    surface_from_nurbs,
)
from hexwrap_solver.surface.errors import (
    FlatSurfaceError,
    HandlesError,
    NonFiniteError,
    NotClosedError,
    NurbsDataError,
    PoleError,
    TooFineError,
)
from hexwrap_solver.surface.nurbs import domain, evaluate
from hexwrap_solver.surface.projection import project
from hexwrap_solver.surface.topology import edge_lengths, edges, face_normals
from tests.solver.surface.nurbs_shapes import CORNERS, cylinder, revolution, sample, swapped, torus_part


def smallest_angles(surface: Surface) -> Floats:
    """(m,) degrees."""
    points = surface.vertices[surface.faces]
    forth, back = np.roll(points, -1, axis=1) - points, np.roll(points, 1, axis=1) - points
    sine = np.linalg.norm(np.cross(forth, back), axis=2)
    return np.degrees(np.arctan2(sine, (forth * back).sum(axis=2)).min(axis=1))


def greatest_chord(surface: Surface) -> float:
    """By full projection of the middles of the edges, from the parameters of their ends."""
    assert surface.nurbs is not None
    assert surface.parameters is not None
    ends, _ = edges(surface.faces, len(surface.vertices))
    middle = surface.vertices[ends].mean(axis=1)
    starts = [project(surface.nurbs, middle, surface.parameters[ends[:, k]])[0] for k in (0, 1)]
    return float(np.min([np.linalg.norm(p - middle, axis=1) for p in starts], axis=0).max())


SURFACES = {
    "cylinder": cylinder(),
    "uneven": cylinder(power=3),
    "sheared": cylinder(shear=2.0),
    "torus": torus_part(),
    "tower": sample("tower"),
    "turned tower": swapped(sample("tower")),
}


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize(
    "settings", [MeshSettings(), MeshSettings(max_edge=1.1), MeshSettings(tolerance=0.03)]
)
def test_edges_and_chords_are_as_asked(name: str, settings: MeshSettings) -> None:
    surface = surface_from_nurbs(SURFACES[name], settings)
    if settings.max_edge:
        assert edge_lengths(surface.vertices, surface.faces).max() <= settings.max_edge
    if settings.tolerance:
        assert greatest_chord(surface) <= settings.tolerance
    if not settings.max_edge and not settings.tolerance:
        assert 5000 <= len(surface.vertices) <= 10_000
    assert smallest_angles(surface).min() > 20
    assert np.median(smallest_angles(surface)) > 38


@pytest.mark.parametrize("name", SURFACES)
def test_the_mesh_closes_without_a_seam(name: str) -> None:
    surface = surface_from_nurbs(SURFACES[name])
    n = len(surface.vertices)
    assert len(np.unique(surface.vertices.round(7), axis=0)) == n
    again = surface_from_mesh(SentMesh(surface.vertices, Ragged.from_table(surface.faces)))
    assert again.repairs == ()
    for a, b in zip(again.loops, surface.loops, strict=True):
        np.testing.assert_array_equal(a, b)
    assert np.einsum("ij,ij->i", again.normals, surface.normals).min() > 0.95


def test_uneven_parameters_leave_no_trace() -> None:
    """The same cylinder, its parameter running 1 : 75 times as fast at one end."""
    even, uneven = (surface_from_nurbs(cylinder(power=p), MeshSettings(max_edge=0.4)) for p in (1.0, 3.0))
    assert len(even.vertices) == len(uneven.vertices)
    assert smallest_angles(uneven).min() > 55


def test_normals_and_parameters_belong_to_the_surface() -> None:
    for nurbs in (sample("tower"), swapped(torus_part())):
        surface = surface_from_nurbs(nurbs)
        assert surface.nurbs is not None
        assert surface.parameters is not None
        jet = evaluate(surface.nurbs, surface.parameters)
        np.testing.assert_array_equal(jet.point, surface.vertices)
        np.testing.assert_array_equal(jet.normal, surface.normals)
        faces = face_normals(surface.vertices, surface.faces)
        assert np.einsum("ij,ij->i", faces, surface.normals[surface.faces[:, 0]]).min() > 0
        around = surface.nurbs.closed.index(True)
        low, high = domain(surface.nurbs, around)
        assert surface.parameters[:, around].min() >= low
        assert surface.parameters[:, around].max() < high
        ends = [surface.parameters[loop, 1 - around] for loop in surface.loops]
        assert [np.ptp(x) for x in ends] == [0, 0]


def test_finer_settings_come_nearer_with_order_two() -> None:
    heights = [greatest_chord(surface_from_nurbs(torus_part(), MeshSettings(max_edge=h))) for h in (1.0, 0.5)]
    assert np.log2(heights[0] / heights[1]) > 1.8


def test_the_closed_direction_is_found_where_it_was_not_named() -> None:
    surface = surface_from_nurbs(replace(cylinder(), closed=(False, False)))
    assert surface.repairs == ("The surface was found to close up in u.",)
    assert surface.nurbs is not None
    assert surface.nurbs.closed == (True, False)


def refused(
    nurbs: NurbsSurface, kind: type[SurfaceError], settings: MeshSettings | None = None
) -> SurfaceError:
    with pytest.raises(kind) as caught:
        surface_from_nurbs(nurbs, settings)
    assert type(caught.value) is kind
    return caught.value


def test_open_surfaces_are_refused() -> None:
    whole = cylinder()
    half = replace(
        whole, knots=(whole.knots[0][:8] * 1.0, whole.knots[1]), control_points=whole.control_points[:5]
    )
    assert "in u" in refused(half, NotClosedError).detail
    error = refused(replace(half, closed=(False, False)), NotClosedError)
    assert "no direction" in error.detail
    wrong = refused(replace(whole, closed=(True, True)), NotClosedError)
    assert wrong.field == ("closed", 1)


def test_a_torus_is_refused() -> None:
    profile = 5 * np.array([1, 0]) + 2 * CORNERS
    weights = np.array([1, np.sqrt(0.5)] * 4 + [1])
    knots = np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], dtype=float)
    error = refused(revolution(profile, weights, knots, 2), HandlesError)
    assert error.data["genus"] == 1


@pytest.mark.parametrize("end", [0, -1])
def test_a_tip_is_refused(end: int) -> None:
    profile = np.array([[2.0, 0.0], [2.0, 3.0]])
    profile[end, 0] = 0.0
    cone = revolution(profile, np.ones(2), np.array([0.0, 0, 1, 1]), 1)
    assert refused(cone, PoleError).slug == "nurbs-pole"


def knots_changed(direction: int, change: object) -> NurbsSurface:
    surface = cylinder()
    knots = [k.copy() for k in surface.knots]
    knots[direction] = change(knots[direction])  # type: ignore[operator]
    return replace(surface, knots=(knots[0], knots[1]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda k: k[1:-1], "full knot vector"),
        (lambda k: k[::-1], "never decrease"),
        (lambda k: np.where(np.arange(len(k)) == 5, np.nan, k), "finite"),
        (lambda k: k * 0, "empty"),
        (lambda k: np.array([0, 0, 0, 0, 2, 2, 2, 2, 5, 5, 5, 5.0]), "tears"),
    ],
)
def test_bad_knots_are_refused(change: object, words: str) -> None:
    error = refused(knots_changed(1, change), NurbsDataError)
    assert words in error.detail
    assert error.field == ("knots", 1)


@pytest.mark.parametrize(
    ("degree", "words"), [((2, 0), "between"), ((2, 9), "at least 10"), ((2, 99), "between")]
)
def test_bad_degrees_are_refused(degree: tuple[int, int], words: str) -> None:
    assert words in refused(replace(cylinder(), degree=degree), NurbsDataError).detail


def test_bad_control_points_are_refused() -> None:
    surface = cylinder()
    net = surface.control_points
    assert (
        refused(replace(surface, control_points=net[..., :3]), NurbsDataError).field[-1] == "control_points"
    )
    for weight in (0.0, -1.0):
        changed = net.copy()
        changed[2, 3, 3] = weight
        error = refused(replace(surface, control_points=changed), NurbsDataError)
        assert error.field == ("control_points", 2, 3, 3)
    changed = net.copy()
    changed[1, 1, 0] = np.inf
    refused(replace(surface, control_points=changed), NonFiniteError)
    refused(replace(surface, control_points=net * [0, 0, 0, 1]), FlatSurfaceError)


@pytest.mark.parametrize("name", ["max_edge", "tolerance"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_bad_sizes_are_refused(name: str, value: float) -> None:
    error = refused(cylinder(), NurbsDataError, MeshSettings(**{name: value}))
    assert error.field == (name,)


@pytest.mark.parametrize("settings", [MeshSettings(max_edge=1e-6), MeshSettings(tolerance=1e-12)])
def test_too_fine_meshes_are_refused_before_they_are_made(settings: MeshSettings) -> None:
    assert "vertices" in refused(cylinder(), TooFineError, settings).detail


@pytest.mark.parametrize("name", ["cylinder", "tower"])
def test_longer_edges_never_make_more_vertices(name: str) -> None:
    numbers = [
        len(surface_from_nurbs(SURFACES[name], MeshSettings(max_edge=edge)).vertices)
        for edge in (1.0, 4.0, 16.0, 64.0, 1e3, 1e4, 1e6, 1e300)
    ]
    assert (np.diff(numbers) <= 0).all()
    assert numbers[-1] == numbers[-2] == 9  # three rows of three


def test_no_mesh_has_more_vertices_than_allowed() -> None:
    for edge in (0.5, 1.0, 2.0, 1e3):
        number = len(surface_from_nurbs(cylinder(), MeshSettings(max_edge=edge)).vertices)
        surface_from_nurbs(cylinder(), MeshSettings(max_edge=edge, max_vertices=number))
        refused(cylinder(), TooFineError, MeshSettings(max_edge=edge, max_vertices=number - 1))


@pytest.mark.parametrize("size", [5e-324, 1e-200, 1e-30])
@pytest.mark.parametrize("name", ["max_edge", "tolerance"])
def test_sizes_at_the_ends_of_doubles_are_refused_or_kept(name: str, size: float) -> None:
    """None of them makes a warning, which would be an error here."""
    refused(cylinder(), TooFineError, MeshSettings(**{name: size}))
    coarse = surface_from_nurbs(cylinder(), MeshSettings(**{name: 1 / max(size, 1e-308)}))
    assert len(coarse.vertices) < 1000
