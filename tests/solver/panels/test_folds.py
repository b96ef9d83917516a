"""Panels along folds: halves are copies of few shapes; bent panels unfold to the pattern's own cell."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.panels import fit_panels, make_components, measure, quantize
from hexwrap_solver.panels.congruence import congruence_classes
from hexwrap_solver.panels.folds import bend_angles, blanks, parts_of
from hexwrap_solver.panels.polygons import best_plane_distances, edge_lengths, fan_areas, outlines
from hexwrap_solver.panels.types import ComponentSettings, Panels, PanelSettings, Quality
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import Kind, Pattern, PatternSettings
from tests.solver.pattern.folded import ELL, prism


@cache
def box(twist: float = 0.0) -> ConformalMap:
    return conformal_map(prism(edge=2.5, twist=twist), BoundaryCondition("straight"))


@cache
def ell() -> ConformalMap:
    return conformal_map(prism(ELL, edge=2.5), BoundaryCondition("straight"))


def made(
    cmap: ConformalMap, settings: PatternSettings, fold: str, joint: float = 0.0
) -> tuple[Pattern, Panels, Quality]:
    pattern = lay_pattern(cmap, settings)
    panels_settings = PanelSettings(fold=fold, sizes=4, joint=joint)
    panels = quantize(fit_panels(cmap, pattern, panels_settings), panels_settings)
    return pattern, panels, measure(cmap, pattern, panels)


@pytest.mark.parametrize("rotation", ["edge", "vertex"])
@pytest.mark.parametrize("kind", ["hex", "quad", "triangle"])
def test_halves_are_flat_and_of_few_types(kind: Kind, rotation: str) -> None:
    pattern, panels, quality = made(box(), PatternSettings(kind, around=40, rotation=rotation), "halves")
    pieces = pattern.pieces.cell
    assert not pattern.whole[pieces].any()
    assert (panels.size >= 0).all()
    assert quality.planarity.max() < 1e-12
    assert quality.overlaps == 0
    assert panels.n_special == panels.divided.sum() <= 4
    assert np.isin(panels.face[panels.divided[panels.size]], pieces).all()
    shape = congruence_classes(outlines(panels.polygons, panels.normal))
    for size in range(len(panels.class_length)):  # one class, one shape
        assert len(np.unique(shape[panels.size == size])) == 1


@pytest.mark.parametrize(
    ("kind", "rotation", "angle"), [("hex", "edge", 0.0), ("hex", "vertex", 0.35), ("quad", "vertex", 0.35)]
)
def test_bent_panels_unfold_to_regular_cells(kind: Kind, rotation: str, angle: float) -> None:
    """Both halves flat and joined along the hinge, of one edge length; laid flat a regular polygon."""
    settings = PatternSettings(kind, around=24, rotation=rotation)
    _, panels, quality = made(box(angle), settings, "folded", joint=0.05)
    bends = panels.bends
    assert len(bends.panel) > 20
    assert len(np.unique(np.concatenate([panels.face, bends.other]))) == panels.n_panels + len(bends.panel)
    parts, _, _ = parts_of(panels)
    assert abs(best_plane_distances(parts)).max() < 1e-12 * 60
    assert quality.overlaps == 0
    flat, _ = blanks(panels)
    assert abs(best_plane_distances(flat)).max() < 1e-12 * 60
    assert edge_lengths(flat) == pytest.approx(edge_lengths(panels.polygons), rel=1e-12)
    # A type is one blank, and that is regular: corners on a circle, sides of the class's length.
    sides = {"hex": 6, "quad": 4}[kind]
    for row in bends.panel.tolist():
        if panels.class_count[panels.size[row]] == 1:
            continue  # as large as its cells allow
        corner = np.asarray(flat[row])
        ahead = np.roll(corner, -1, axis=0) - corner
        bend = np.linalg.norm(np.cross(np.roll(ahead, 1, axis=0), ahead), axis=1) > 1e-9
        ends = corner[bend]
        assert len(ends) == sides
        edge = np.linalg.norm(np.roll(ends, -1, axis=0) - ends, axis=1)
        assert edge == pytest.approx(panels.edge_length[row], rel=1e-9)
        assert np.linalg.norm(ends - ends.mean(axis=0), axis=1).std() < 1e-9
    bent = bend_angles(panels)[bends.panel]
    assert (bent > 1.2).all()  # corners of a box point outwards
    assert np.nanmin(quality.gap_tangential) > -1e-9


def test_hinges_of_reflex_corners_bend_inwards() -> None:
    _, panels, _ = made(ell(), PatternSettings("hex", around=40), "folded")
    bent = bend_angles(panels)[panels.bends.panel]
    assert abs(abs(bent) - np.pi / 2).max() < 1e-9
    assert 0 < (bent < 0).sum() < (bent > 0).sum()


def test_cells_cut_where_a_fold_falls_are_bent_too() -> None:
    """Each a shape of its own; nothing of the surface is lost against the halves."""
    settings = PatternSettings("quad", around=40, rotation=10.0)
    _, halves, _ = made(ell(), settings, "halves")
    _, folded, quality = made(ell(), settings, "folded")
    assert len(folded.bends.panel) > 30
    assert folded.n_panels == halves.n_panels - len(folded.bends.panel)
    assert quality.overlaps == 0
    area = fan_areas(parts_of(folded)[0]).sum()
    assert area == pytest.approx(fan_areas(halves.polygons).sum(), rel=1e-6)


def test_components_of_bent_panels_are_closed_and_inset() -> None:
    _, panels, _ = made(box(0.35), PatternSettings("hex", around=24), "folded")
    built = make_components(panels, ComponentSettings(inset=0.1, thickness=0.2))
    trimesh = pytest.importorskip("trimesh")
    smaller = fan_areas(parts_of(panels)[0]).sum()
    for row in panels.bends.panel.tolist():
        body = trimesh.Trimesh(
            np.asarray(built.solid_vertices[row]),
            np.asarray(built.solid_faces[row]).reshape(-1, 3),
            process=False,
        )
        assert body.is_watertight
        assert body.volume > 0
    assert fan_areas(built.outline).sum() < smaller
