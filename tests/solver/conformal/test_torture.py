"""Hard annuli: every one of them has a map, and it is never wrong."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.conformal import conformal_map
from tests.solver.conformal.checks import asked_angles, faults
from tests.solver.conformal.shared import MESHES, load
from tests.solver.conformal.torture import MODES, TORTURE, band, extreme

#: A few seconds each; they run with the others under ``-m long``.
SLOW = ("valence", "long_tube", "slivers")


def judge(name: str, mode: str, seed: int) -> None:
    surface = TORTURE[name](np.random.default_rng(seed)) if name in TORTURE else load(MESHES[name])
    condition = MODES[mode](surface, np.random.default_rng(seed + 1000))
    found = conformal_map(surface, condition)
    assert faults(found, asked_angles(found, surface, condition)) == []
    assert (found.surface.input_vertex >= 0).sum() == len(surface.vertices)
    assert found.inserted == len(found.surface.vertices) - len(surface.vertices)


@pytest.mark.parametrize("mode", ["straight", "corners", "densified", "isometric_optimal"])
@pytest.mark.parametrize("name", [name for name in TORTURE if name not in SLOW])
def test_torture_is_solved(name: str, mode: str) -> None:
    judge(name, mode, seed=0)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ["one_wide_even", "three_vertex_loops", "retriangulated"])
def test_extreme_angles_are_solved(name: str, seed: int) -> None:
    surface = TORTURE[name](np.random.default_rng(seed))
    condition = extreme(surface, np.random.default_rng(seed + 1000))
    found = conformal_map(surface, condition)
    assert faults(found, asked_angles(found, surface, condition)) == []


@pytest.mark.parametrize(("seed", "mode"), [(10, "entrance"), (14, "densified"), (31, "extreme")])
def test_bands_of_few_vertices_on_one_side_need_few_more(seed: int, mode: str) -> None:
    """Fans of up to a hundred triangles, one of which turns over after another. Solving again with the new
    vertices as unknowns made thousands of them."""
    random = np.random.default_rng(seed)
    first, second = int(random.integers(3, 8)), int(random.integers(40, 160))
    first_angles, second_angles = (np.sort(random.uniform(0, 2 * np.pi, n)) for n in (first, second))
    surface = band(first_angles, second_angles, random)
    make = extreme if mode == "extreme" else MODES[mode]
    condition = make(surface, np.random.default_rng(seed + 1))
    found = conformal_map(surface, condition)
    assert faults(found, asked_angles(found, surface, condition)) == []
    assert found.inserted < 5 * len(surface.vertices)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", TORTURE)
def test_torture_is_solved_in_all_modes(name: str, mode: str, seed: int) -> None:
    judge(name, mode, seed)


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", sorted(MESHES))
def test_public_meshes_are_solved_in_all_modes(name: str, mode: str) -> None:
    judge(name, mode, seed=0)
