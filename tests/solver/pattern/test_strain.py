"""Moving the sides of a domain: one linear response per side foretells every deformation."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from hexwrap_solver.pattern.lattice import LATTICES, Isometry
from hexwrap_solver.pattern.place import align
from hexwrap_solver.pattern.place.choose import place_lattice
from hexwrap_solver.pattern.place.deform import System
from hexwrap_solver.pattern.place.glued import Glued
from hexwrap_solver.pattern.place.sides import lines_of
from hexwrap_solver.pattern.place.strain import Strain
from hexwrap_solver.pattern.types import PatternSettings
from tests.solver.pattern.test_align import CASES, HEX_CASES, MAPS

LATTICE = LATTICES["hex"]


def prepared(case):
    cmap = MAPS[case]
    turns = round(CASES[case][4] / LATTICE.quantum)
    motion = Isometry(LATTICE, turns, (0, 0))
    frame, _ = align.frame_of(cmap, LATTICE, PatternSettings(around=60), motion, [0, 1], [])
    lines = lines_of(len(cmap.uv), frame.sides, frame.normal, motion)
    system = System(cmap, Glued.by_sheets(cmap, motion), lines.normal)
    strain = Strain.of(system, frame.sides, lines, frame.turned)
    scale = 60 * 1.5 / cmap.circumference * frame.unit
    return frame, lines, system, strain, align.trials_at(frame, strain, scale, 0.0)


@pytest.mark.parametrize("case", HEX_CASES)
def test_the_response_is_the_error_of_the_least_squares_deformation(case):
    _, lines, system, strain, trials = prepared(case)
    for trial in trials:
        cmap, change = system.cmap, system.change
        zero = np.zeros((*cmap.sheet.shape, 2), dtype=np.int64)
        shift = change.of_shift(LATTICE.position(trial.motion.apply(zero, cmap.sheet)))
        fixed = system.freedom.place_on_lines(lines.depths(trial.depth, trial.motion))
        angles, sizes = change.of(fixed, shift)
        still = np.zeros(system.freedom.basis.shape[1])
        weight = np.sqrt(strain.area)
        place = fixed + system.solve(weight, -angles, trial.scale - sizes, still)
        bent = change.of(place, shift)[0]
        np.testing.assert_allclose(strain.response @ trial.moved, bent, atol=1e-5 * abs(trial.scale))
        assert strain.mean(trial.moved) == pytest.approx(
            np.sqrt(strain.area @ abs(strain.response @ trial.moved) ** 2), rel=1e-9
        )
        assert strain.sharp(trial.moved) >= strain.mean(trial.moved) * (1 - 1e-12)


@pytest.mark.parametrize("case", HEX_CASES)
def test_no_single_side_moved_by_a_row_would_lessen_the_strain(case):
    frame, _, _, strain, trials = prepared(case)
    for trial, side, step in product(trials, range(frame.sides.n), (-1, 1)):
        other = trial.moved.copy()
        other[side] += step * frame.period[side]
        assert strain.mean(other) >= strain.mean(trial.moved) * (1 - 1e-9)


def test_moving_all_sides_together_on_a_cylinder_costs_nothing():
    frame, _, _, strain, _ = prepared("entrance")
    together = np.append((frame.normal.conj() * (0.3 - 0.7j)).real, [0.0, 0.0, 0.0])
    assert strain.mean(together) < 1e-5 * strain.mean(np.eye(len(together))[0])


@pytest.mark.parametrize("kind", ["hex", "triangle"])
@pytest.mark.parametrize("rotation", ["edge", "vertex"])
@pytest.mark.parametrize("case", ["entrance", "two entrances"])
def test_entrances_keep_the_number_around_at_a_bearable_distortion(case, rotation, kind):
    for around in (60, 96, 120, 150):
        asked = PatternSettings(kind=kind, rotation=rotation, around=around)
        placed = place_lattice(MAPS[case], LATTICES[kind], asked)
        # A closed row along the edges of hexagons or across the corners of triangles takes an even number.
        assert abs(placed.around - around) <= 2
        assert placed.distortion < 0.11
        assert placed.notes == ()


def test_the_tip_of_an_entrance_stands_where_the_lattice_mirrors_it():
    frame, _, _, _, trials = prepared("entrance")
    assert MAPS["entrance"].surface.loops[0][0] in frame.sides.vertex
    extras = sorted(trial.extra for trial in trials)
    assert extras[0] < extras[-1]
    costs = {}
    for trial in trials:
        p, q = frame.normal[0], frame.normal[1]
        d, e = trial.depth[:2]
        corner = np.array(1j * (e * p - d * q) / (np.conj(p) * q).imag)
        costs[bool(LATTICE.is_node(np.rint(LATTICE.coordinates(corner)).astype(np.int64)))] = trial.extra
    assert costs[False] < costs[True]


def test_corners_count_whichever_side_the_boundary_begins_with():
    """Of the sides k, k + 1, … the last is followed by the first, a turn further."""
    frame, _, _, _, trials = prepared("cone")
    sides = frame.sides
    n = int((sides.loop == 0).sum())
    for trial in trials:
        motion, turn = trial.motion, complex(np.exp(1j * LATTICE.quantum * trial.motion.cone_index))
        sheet = int(frame.following[1][n - 1])
        shift = complex(LATTICE.position(motion.apply(np.zeros(2, dtype=np.int64), np.array(sheet))))
        normal, depth = frame.normal.copy(), trial.depth.copy()
        normal[:n] = np.append(normal[1:n], normal[0] * turn**sheet)
        depth[:n] = np.append(depth[1:n], depth[0] + (np.conj(normal[n - 1]) * shift).real)
        begun_later = replace(frame, normal=normal)
        assert align.misplaced_corners(begun_later, motion, depth) == pytest.approx(
            align.misplaced_corners(frame, motion, trial.depth)
        )
