"""Edges split: the surface stays the same set of points, with its creases, and u has vertices to vary at."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.robust.refine import fine_enough, split
from hexwrap_solver.conformal.solve import ENOUGH
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.pipeline import SolveSettings, solve
from hexwrap_solver.singularities.types import SingularitySettings
from hexwrap_solver.surface import surface_from_mesh
from hexwrap_solver.surface.features import FeatureEdges, folds
from hexwrap_solver.surface.types import SentMesh, Surface

CORNERS = [(0, 0), (10, 0), (10, 8), (0, 8)]
#: A gable house, open below.
HOUSE = (
    np.array([*((x, y, z) for z in (0, 5) for x, y in CORNERS), (0, 4, 8), (10, 4, 8)], dtype=float),
    [
        *((0, 1, 5, 4), (2, 3, 7, 6), (4, 5, 9, 8), (6, 7, 8, 9)),
        *((1, 2, 6, 5), (5, 6, 9), (3, 0, 4, 7), (4, 8, 7)),
    ],
)
#: Walls alone: they unroll without any change of size.
BOX = (HOUSE[0][:8], [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)])


def surface(vertices: np.ndarray, faces: list[tuple[int, ...]]) -> Surface:
    lengths = np.array([len(face) for face in faces])
    return surface_from_mesh(SentMesh(vertices, Ragged.of(np.concatenate(faces), lengths)))


@settings(max_examples=20, deadline=None)
@given(st.data())
def test_creases_keep_their_edges_where_these_are_split(data: st.DataObject) -> None:
    """Every piece is an edge of the finer mesh, they are as long together, and no other edge is folded."""
    before = surface(*HOUSE)
    edges = data.draw(st.lists(st.integers(0, 3 * len(before.faces) - 1), min_size=1, unique=True))
    after = split(before, np.array(edges))
    assert len(after.vertices) > len(before.vertices)
    assert len(after.features) == len(before.features) > 0
    assert len(FeatureEdges.of(after, after.features)) == sum(len(f.vertices) - 1 for f in after.features)
    length = [
        sum(np.linalg.norm(np.diff(one.vertices[f.vertices], axis=0), axis=1).sum() for f in one.features)
        for one in (before, after)
    ]
    assert length[1] == pytest.approx(length[0], rel=1e-12)
    chains = [f.vertices for f in after.features]
    along = {frozenset(pair) for chain in chains for pair in pairwise(chain.tolist())}
    assert {frozenset(pair) for pair in folds(after, np.deg2rad(30))[0].tolist()} == along


def test_it_has_so_many_vertices_on_the_same_surface() -> None:
    before = surface(*HOUSE)
    after = fine_enough(before, 300)
    assert len(after.vertices) >= 300
    assert before.tree.nearest(after.vertices).distance.max() < 1e-12
    assert after.areas.sum() == pytest.approx(before.areas.sum(), rel=1e-12)
    assert fine_enough(after, 300) is after


def test_few_vertices_are_enough_where_u_is_the_same_everywhere() -> None:
    found = conformal_map(surface(*BOX), BoundaryCondition("straight"))
    assert found.inserted == 0
    assert np.ptp(found.log_scale) < 1e-12


def test_a_folded_surface_gets_vertices_where_u_changes_much() -> None:
    found = conformal_map(surface(*HOUSE), BoundaryCondition("isometric"))
    assert len(found.surface.vertices) >= ENOUGH
    assert found.inserted == len(found.surface.vertices) - 10
    assert (found.surface.input_vertex[:10] == np.arange(10)).all()
    assert sum(f"{found.inserted} vertices were inserted" in note for note in found.notes) == 1


def test_a_house_of_ten_vertices_is_covered_and_what_would_be_better_is_told_and_true() -> None:
    plain = solve(lambda: surface(*HOUSE), SolveSettings())
    assert plain.quality.coverage > 0.85
    told = next(note for note in plain.quality.notes if "ask for singularities 6" in note)
    bound = float(told.partition("less than ")[2].partition("%")[0]) / 100
    asked = SolveSettings(BoundaryCondition("isometric"), singularities=SingularitySettings(6))
    assert 1 - solve(lambda: surface(*HOUSE), asked).quality.coverage < bound < 1 - plain.quality.coverage
