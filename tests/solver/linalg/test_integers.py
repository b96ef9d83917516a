"""The nearest integer vector, against trying all."""

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.linalg.integers import nearest_integers


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_no_integer_vector_is_nearer(seed, n):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n + 2, n)) * 10 ** rng.uniform(-1, 0, n)
    gram, centre = root.T @ root, 5 * rng.normal(size=n)
    found, value = nearest_integers(gram, centre)
    near = [range(int(np.floor(x)) - 8, int(np.floor(x)) + 10) for x in centre]
    every = np.array(list(itertools.product(*near))) - centre
    assert np.isclose(value, (found - centre) @ gram @ (found - centre))
    assert value <= np.einsum("ki,ij,kj->k", every, gram, every).min() + 1e-9


def test_finds_a_lattice_point_in_many_dimensions():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(16, 16))
    wanted = rng.integers(-50, 50, 16)
    found, value = nearest_integers(root.T @ root, wanted.astype(float))
    assert (found == wanted).all()
    assert value < 1e-12
