"""Nodes are told apart by integers, or refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexwrap_solver.errors import PatternError
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.lay import nodes
from hexwrap_solver.pattern.lay_pattern import layout_of
from hexwrap_solver.pattern.place.choose import PlacementFamily
from hexwrap_solver.pattern.types import PatternSettings
from tests.solver.pattern import annuli

CMAP = annuli.revolution(np.cosh, np.linspace(-1, 1.5, 5), 12)
LAYOUT = layout_of(
    CMAP,
    LATTICES["hex"],
    PlacementFamily.of(CMAP, LATTICES["hex"], PatternSettings(around=12)).at(PatternSettings(around=12)),
)


def test_links_that_lead_one_way_only_are_refused():
    """Instead of being followed for ever: 0 is known, 1 knows 0, and nobody leads from 0 to 1."""
    one = np.array([1])
    with pytest.raises(PatternError, match="Rounding"):
        nodes._seen_from(np.array([0]), one, 0 * one, np.zeros((1, 4), dtype=int), LATTICES["hex"], 2)


def test_nodes_beyond_all_integers_are_refused():
    """Two triangles with so many rows and columns between them that their numbers would overflow."""
    corners = LAYOUT.corners.copy()
    corners[0] += 2e9 * (1 + 1j)
    with pytest.raises(PatternError, match="Rounding"):
        nodes.find_nodes(replace(LAYOUT, corners=corners))
