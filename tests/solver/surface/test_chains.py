"""Folds of a mesh, joined to chains."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.surface.features import chained


def test_every_edge_is_in_one_chain_however_many_there_are() -> None:
    """A wrinkled sheet folds at nearly every edge: thousands of chains, of which each edge is in one."""
    rng = np.random.default_rng(0)
    n = 40
    vertices = np.column_stack([*(x.ravel() for x in np.mgrid[:n, :n]), rng.normal(size=n * n)])
    i, j = (x.ravel() for x in np.mgrid[: n - 1, : n - 1])
    a = n * i + j
    edges = np.concatenate([np.column_stack([a, a + n]), np.column_stack([a, a + n + 1])])
    edges = edges[rng.random(len(edges)) < 0.6]
    found = chained(vertices, edges, np.ones(len(edges)), np.zeros(n * n, dtype=bool))
    walked = np.concatenate([np.column_stack([f.vertices[:-1], f.vertices[1:]]) for f in found])
    assert sorted(map(tuple, np.sort(walked, axis=1).tolist())) == sorted(map(tuple, edges.tolist()))


def test_a_closed_chain_comes_back_to_its_lowest_vertex() -> None:
    turn = 2 * np.pi * np.arange(12) / 12
    vertices = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    edges = np.column_stack([np.arange(12), (np.arange(12) + 1) % 12])
    (ring,) = chained(vertices, edges, np.ones(12), np.zeros(12, dtype=bool))
    assert ring.closed
    assert ring.vertices[0] == ring.vertices[-1] == 0
    assert sorted(ring.vertices[:-1].tolist()) == list(range(12))
