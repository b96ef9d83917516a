"""Numbers in sentences."""

from __future__ import annotations

import pytest

from hexwrap_solver.words import box, length, place, were


@pytest.mark.parametrize(
    ("value", "word"),
    [(12000.0, "12,000"), (1.6e7, "16,000,000"), (999.94, "999.9"), (0.00025, "0.00025"), (1e20, "1e+20")],
)
def test_lengths_have_no_exponents(value: float, word: str) -> None:
    assert length(value) == word


def test_boxes_and_places() -> None:
    assert box((4000, 30.5, 2)) == "4,000 × 30.5 × 2"
    assert box((16.0, 9.797e-16, 32)) == "16 × 0 × 32"
    assert place((3.0, 2e-16, -1.25)) == "(3, 0, -1.25)"
    assert place((5000012.3456, -5e6, 0.5)) == "(5000012.35, -5000000, 0.5)"


def test_one_thing_is_told_in_the_singular() -> None:
    assert [were(number, "cell") for number in (1, 2)] == ["1 cell was", "2 cells were"]
