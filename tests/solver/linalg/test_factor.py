"""The sparse factorisation against dense algebra, on meshes, random graphs and with tied unknowns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.conformal.boundary import straight, targets
from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.linalg import factor
from hexwrap_solver.linalg.dissection import LEAF, dissect
from hexwrap_solver.linalg.factor import Factorisation
from tests.solver.conformal.annuli import bump


def dense(diagonal: Floats, off_diagonal: Floats, rows: Ints, columns: Ints) -> Floats:
    matrix = np.diag(diagonal)
    matrix[rows, columns] = matrix[columns, rows] = off_diagonal
    return matrix


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 400), st.integers(0, 2**32 - 1), st.booleans())
def test_random_graphs(n: int, seed: int, tied: bool) -> None:
    """Any pattern, not only meshes: points merely steer the order of elimination."""
    random = np.random.default_rng(seed)
    points = random.standard_normal((n, 3))
    if tied:
        points[random.integers(n)] = np.nan
    pairs = np.unique(np.sort(random.integers(n, size=(3 * n, 2)), axis=1), axis=0)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    rows, columns = pairs[:, 1], pairs[:, 0]
    values = random.standard_normal(len(rows))
    diagonal = np.bincount(rows, np.abs(values), n) + np.bincount(columns, np.abs(values), n) + 0.1
    factorisation = Factorisation(points, rows, columns)
    right = random.standard_normal(n)
    for scale in (1.0, 3.0):  # the second time with the analysis of the first
        factorisation.factorise(scale * diagonal, values)
        expected = np.linalg.solve(dense(scale * diagonal, values, rows, columns), right)
        np.testing.assert_allclose(factorisation.solve(right), expected, rtol=1e-9, atol=1e-9)
        several = np.stack([right, -2 * right, np.roll(right, 1)], axis=1)
        for one, column in zip(factorisation.solve(several).T, several.T, strict=True):
            np.testing.assert_allclose(one, factorisation.solve(column), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("tied", [False, True])
def test_hessians(tied: bool) -> None:
    surface = bump(60, 30)
    energy = Energy(surface, targets(surface, (-np.pi / 3, np.pi / 3)) if tied else straight(surface))
    diagonal, off_diagonal = energy.hessian(energy.corners(np.zeros(energy.n)))
    factorisation = Factorisation(energy.points, energy.rows, energy.columns)
    factorisation.factorise(diagonal, off_diagonal)
    right = np.random.default_rng(0).standard_normal(energy.n_dof)
    matrix = dense(diagonal, off_diagonal, energy.rows, energy.columns)
    assert np.abs(matrix @ factorisation.solve(right) - right).max() < 1e-10


def test_an_indefinite_matrix_is_refused() -> None:
    energy = Energy(bump(20, 10), straight(bump(20, 10)))
    factorisation = Factorisation(energy.points, energy.rows, energy.columns)
    with pytest.raises(np.linalg.LinAlgError):
        factorisation.factorise(np.full(energy.n_dof, 0.1), np.full(len(energy.rows), -1.0))


def test_separators_separate() -> None:
    """No matrix entry joins two parts neither of which lies above the other in the tree."""
    energy = Energy(bump(80, 40), straight(bump(80, 40)))
    tree = dissect(energy.points, energy.rows, energy.columns)
    nodes = len(tree.start) - 1
    node = np.empty(energy.n_dof, dtype=np.int64)
    node[tree.order] = nodes - 1 - np.repeat(np.arange(nodes), np.diff(tree.start))
    deep = np.maximum(node[energy.rows], node[energy.columns])
    high = np.minimum(node[energy.rows], node[energy.columns])
    for _ in range(tree.depth):
        deep = np.where(deep > high, (deep - 1) // 2, deep)
    np.testing.assert_array_equal(deep, high)
    assert np.diff(tree.start).max() <= 1.5 * LEAF


def test_what_stood_in_the_memory_before_does_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    """The memory of factorisations is used again, and is as it was left."""
    surface = bump(60, 30)
    energy = Energy(surface, straight(surface))
    values = energy.hessian(energy.corners(np.zeros(energy.n)))
    right = np.random.default_rng(0).standard_normal(energy.n_dof)
    solutions = []
    random = np.random.default_rng(1)
    for garbage in ([0.0], [np.inf, -np.inf], [np.nan, 1e308]):
        monkeypatch.setattr(factor, "borrow", lambda size, owner, of=garbage: random.choice(of, size))
        factorisation = Factorisation(energy.points, energy.rows, energy.columns)
        factorisation.factorise(*values)
        solutions.append(factorisation.solve(right))
    for solution in solutions[1:]:
        np.testing.assert_array_equal(solution, solutions[0])


def test_clusters_of_unknowns_are_halved_as_well() -> None:
    """Inserted vertices come in clusters of ever smaller size; planes through a mean would leave them
    whole."""
    random = np.random.default_rng(4)
    spread = random.uniform(-1, 1, (2_000, 2))
    centre = np.repeat(random.uniform(-1, 1, (5, 2)), 2_000, axis=0)
    size = 10.0 ** random.uniform(-9, -1, len(centre))
    flat = np.concatenate([spread, centre + size[:, None] * random.standard_normal(centre.shape)])
    triangles = Delaunay(flat).simplices
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    pairs = np.unique(np.sort(sides), axis=0)
    points = np.column_stack([flat, np.zeros(len(flat))])
    tree = dissect(points, pairs[:, 1], pairs[:, 0])
    assert np.diff(tree.start).max() < 4 * LEAF
    Factorisation(points, pairs[:, 1], pairs[:, 0])


def test_what_would_take_all_memory_is_refused() -> None:
    """Every unknown joined to every other one: a dense matrix of 1.6 GB."""
    n = 20_000
    random = np.random.default_rng(0)
    rows = np.repeat(np.arange(n), 12)
    columns = random.integers(0, n, len(rows))
    apart = rows != columns
    with pytest.raises(ConvergenceError, match="GB to solve"):
        Factorisation(random.standard_normal((n, 3)), rows[apart], columns[apart])
