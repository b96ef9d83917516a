"""The bundled samples are what their script makes, and what the issue and the paper ask of them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import make_samples
from hexwrap_server import samples
from hexwrap_server.input.surface_files import read_surface
from hexwrap_solver.surface import NurbsSurface, surface_from_mesh, surface_from_nurbs
from hexwrap_solver.surface.brep.surface import surface_from_brep
from hexwrap_solver.surface.brep.types import Brep
from hexwrap_solver.surface.nurbs import domain, evaluate, evaluate_points
from hexwrap_solver.surface.types import SentMesh

#: NURBS surfaces, and meshes.
FIGURES = ["cone", "diagrid", "entrance", "facade", "isometric", "ring", "singular", "tower", "waist"]
MESHES = ["box", "dome", "openings", "patches", "roof"]


def surface_of(name: str) -> NurbsSurface:
    sent = samples.load(name)["surface"]["nurbs"]
    return NurbsSurface(
        tuple(sent["degree"]),
        tuple(np.array(k, dtype=float) for k in sent["knots"]),
        np.array(sent["control_points"], dtype=float),
        tuple(sent["closed"]),
    )


def rings(surface: NurbsSurface, rows: int = 60, around: int = 400) -> np.ndarray:
    """(rows, around, 3) points, first direction closed."""
    u, v = (np.linspace(*domain(surface, d), k) for d, k in ((0, around), (1, rows)))
    grid = np.stack(np.meshgrid(u, v), axis=2).reshape(-1, 2)
    return evaluate_points(surface, grid).reshape(rows, around, 3)


def girths(surface: NurbsSurface) -> np.ndarray:
    return np.linalg.norm(np.diff(rings(surface), axis=1), axis=2).sum(axis=1)


def test_the_names() -> None:
    assert samples.names() == sorted(FIGURES + MESHES)
    for name in ("", "nothing", "../make", "tower.json"):
        with pytest.raises(KeyError):
            samples.load(name)
        with pytest.raises(KeyError):
            samples.path_3dm(name)


@pytest.fixture(scope="module")
def made_anew(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the script has made them all."""
    folder = tmp_path_factory.mktemp("samples")
    make_samples.make(folder)
    return folder


def test_the_script_makes_what_is_bundled(made_anew: Path) -> None:
    assert sorted(file.stem for file in made_anew.glob("*.3dm")) == sorted(FIGURES + MESHES)
    for name in FIGURES:
        made = json.loads((made_anew / f"{name}.json").read_text(encoding="utf-8"))
        kept = samples.load(name)
        np.testing.assert_allclose(
            made["surface"]["nurbs"].pop("control_points"),
            kept["surface"]["nurbs"].pop("control_points"),
            atol=1.1e-4,  # other machines' cosines may round the last digit differently
        )
        for one, other in zip(
            made.get("boundary", {}).get("angles", []),
            kept.get("boundary", {}).get("angles", []),
            strict=True,
        ):
            np.testing.assert_allclose(one.pop("point"), other.pop("point"), atol=3e-4)
        assert made == kept


@pytest.mark.parametrize("name", MESHES)
def test_the_script_makes_the_meshes_that_are_bundled(made_anew: Path, name: str) -> None:
    made = json.loads((made_anew / f"{name}.json").read_text(encoding="utf-8"))
    kept = samples.load(name)
    np.testing.assert_allclose(made["surface"].pop("vertices"), kept["surface"].pop("vertices"), atol=1.1e-4)
    assert made == kept


@pytest.mark.parametrize(("name", "loops"), [("dome", 1), ("openings", 15), ("roof", 1)])
def test_the_rhino_file_holds_the_same_mesh(name: str, loops: int) -> None:
    path = samples.path_3dm(name)
    read, sent = read_surface(path.read_bytes(), path.name).geometry, samples.load(name)["surface"]
    assert isinstance(read, SentMesh)
    np.testing.assert_allclose(read.vertices, sent["vertices"], atol=1e-5)
    assert read.faces.to_lists() == sent["faces"]
    surface = surface_from_mesh(read)
    assert (len(surface.loops), surface.repairs) == (loops, ())


@pytest.mark.parametrize(("name", "creases"), [("box", 4), ("patches", 2)])
def test_folded_samples_are_several_surfaces_that_join_to_one_with_creases(name: str, creases: int) -> None:
    path = samples.path_3dm(name)
    brep = read_surface(path.read_bytes(), path.name).geometry
    assert isinstance(brep, Brep)
    surface = surface_from_brep(brep)
    assert len(surface.loops) == 2
    assert [feature.closed for feature in surface.features] == creases * [name == "patches"]
    sent = samples.load(name)["surface"]
    low, high = np.min(sent["vertices"], axis=0), np.max(sent["vertices"], axis=0)
    np.testing.assert_allclose(surface.vertices.min(axis=0), low, atol=0.05)
    np.testing.assert_allclose(surface.vertices.max(axis=0), high, atol=0.05)


@pytest.mark.parametrize("name", FIGURES)
def test_the_rhino_file_holds_the_same_surface(name: str) -> None:
    path = samples.path_3dm(name)
    read, sent = read_surface(path.read_bytes(), path.name).geometry, surface_of(name)
    assert isinstance(read, NurbsSurface)
    assert read.closed == sent.closed
    np.testing.assert_allclose(rings(read, 20, 50), rings(sent, 20, 50), atol=1e-9)


@pytest.mark.parametrize("name", FIGURES)
def test_each_can_be_meshed(name: str) -> None:
    surface = surface_from_nurbs(surface_of(name))
    assert 5000 < len(surface.vertices) < 8000
    assert surface.repairs == ()


def test_tower_is_doubly_curved_and_no_surface_of_revolution() -> None:
    surface = surface_of("tower")
    assert girths(surface).max() / girths(surface).min() > 2
    ring = rings(surface)[20, :-1]
    radius = np.linalg.norm(ring - ring.mean(axis=0), axis=1)
    assert radius.max() / radius.min() > 1.1
    assert np.ptp(rings(surface)[..., 2]) == pytest.approx(62, abs=2)


def test_facade_has_the_size_of_the_case_study() -> None:
    points = rings(surface_of("facade"))
    np.testing.assert_allclose(np.ptp(points[0], axis=0)[:2], [60, 40], rtol=0.03)
    assert np.ptp(points[..., 2]) == pytest.approx(20, abs=1.5)
    assert girths(surface_of("facade")).max() / girths(surface_of("facade")).min() < 1.1


def test_waist_is_negatively_curved_everywhere() -> None:
    surface = surface_of("waist")
    u, v = (np.linspace(*domain(surface, d), 40) for d in (0, 1))
    jet = evaluate(surface, np.stack(np.meshgrid(u, v), axis=2).reshape(-1, 2))
    e, f, g = ((a * b).sum(axis=1) for a, b in ((jet.du, jet.du), (jet.du, jet.dv), (jet.dv, jet.dv)))
    second = [(d * jet.normal).sum(axis=1) for d in (jet.duu, jet.duv, jet.dvv)]
    assert ((second[0] * second[2] - second[1] ** 2) / (e * g - f * f)).max() < 0


def test_waist_is_an_exact_hyperboloid() -> None:
    x, y, z = (rings(surface_of("waist")).reshape(-1, 3) - [0, 0, 22]).T
    scale = np.sinh(np.arccosh(2.0)) / 22
    np.testing.assert_allclose((x / 9) ** 2 + (y / 7.5) ** 2 - (z * scale) ** 2, 1, atol=1e-3)


@pytest.mark.parametrize("name", ["cone", "entrance", "diagrid"])
def test_corners_stand_on_the_boundary_and_satisfy_gauss_bonnet(name: str) -> None:
    """Equation (1): the sums of π − θ over the two loops cancel."""
    request, points = samples.load(name), rings(surface_of(name), 2, 4000)
    angles = request["boundary"]["angles"]
    assert request["boundary"]["angle_unit"] == "pi"
    assert sum(1 - corner["angle"] for corner in angles) == pytest.approx(0, abs=1e-12)
    for corner in angles:
        assert np.linalg.norm(points - corner["point"], axis=2).min() < 0.05


def test_ring_is_flat_enough_to_be_a_full_turn() -> None:
    points = rings(surface_of("ring"))
    assert np.ptp(points[..., 2]) < 0.1 * np.ptp(points[..., 0])
    assert girths(surface_of("ring"))[0] > 2 * girths(surface_of("ring"))[-1]
