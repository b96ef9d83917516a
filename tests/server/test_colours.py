"""Colours and short texts that all files share."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hexwrap_server.output.colours import (
    ANCHORS,
    UNSIZED,
    encoded,
    from_hex,
    gradient,
    linear,
    panel_colours,
    shapes,
    size_colours,
    to_hex,
)
from hexwrap_server.output.text import angle, length, one_line
from hexwrap_solver.arrays import Ragged


def test_the_gradient_goes_through_its_anchors() -> None:
    assert to_hex(gradient(np.linspace(0, 1, len(ANCHORS)))) == list(ANCHORS)


@pytest.mark.parametrize("n", [1, 2, 11, 40])
def test_sizes_have_as_many_different_colours(n: int) -> None:
    assert len(set(size_colours(n))) == n


def test_panels_without_a_size_are_grey() -> None:
    rgb = panel_colours(np.array([0, -1, 1]), size_colours(2))
    assert to_hex(rgb) == [size_colours(2)[0], UNSIZED, size_colours(2)[1]]


def test_light_and_code_are_inverse() -> None:
    code = np.linspace(0, 1, 101)
    assert encoded(linear(code)) == pytest.approx(code, abs=1e-12)
    assert np.array_equal(from_hex(to_hex(from_hex(["#0180ff"]))), from_hex(["#0180ff"]))


@pytest.mark.parametrize(
    ("radians", "words"),
    [
        (0.0, "0"),
        (np.pi, "π"),
        (4 * np.pi / 3, "4π/3"),
        (-np.pi / 2, "−π/2"),
        (2 * np.pi, "2π"),
        (1.0, "57.3°"),
    ],
)
def test_angles_read_as_people_write_them(radians: float, words: str) -> None:
    assert angle(radians) == words


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (1.75, "1.750"),
        (1750.0, "1750"),
        (0.0123456, "0.01235"),
        (123456.7, "123457"),
        (1e-9, "1e-09"),
        (0.0, "0"),
    ],
)
def test_lengths_have_four_digits(value: float, words: str) -> None:
    assert length(value) == words


def test_a_title_is_one_line() -> None:
    assert one_line("a\nb\x00\tc  ü") == "a b c ü"


def test_watertight_panels_are_told_apart_by_shape() -> None:
    """Convex ones cold, others warm, those cut at the boundary of no shape; most corners first."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    dart = np.array([[0.0, 0, 0], [1, 0, 0], [0.2, 0.2, 0], [0, 1, 0]])
    outlines = [square[:3], square, dart, square, square[:3]]
    polygons = Ragged(np.concatenate(outlines), np.cumsum([0, *map(len, outlines)]))
    panels: Any = SimpleNamespace(
        polygons=polygons,
        normal=np.tile([0.0, 0, 1], (5, 1)),
        whole=np.array([True, True, True, True, False]),
    )
    index, kinds, tints = shapes(panels)
    assert kinds == [(4, True), (3, True), (4, False)]
    assert index.tolist() == [1, 0, 2, 0, -1]
    red, _, blue = from_hex(tints).T
    assert red[0] < blue[0]
    assert red[2] > blue[2]
