"""Every pattern on every sample: cells close up, watertight panels are flat, and notes say what they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexwrap_server import samples
from hexwrap_server.input.requests import SentSurface
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.work import take_in
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.panels.planar import crossing_themselves
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import Kind, Pattern
from hexwrap_solver.pipeline import PlainRunner, Solution, solve

#: Samples whose own corners, cones or singularities a kind cannot follow are refused in one of these words.
REFUSED = ("multiple of", "close", "singularit", "corner")

QUICK = [("dome", "trihexagonal"), ("cone", "rhombitrihexagonal"), ("ring", "truncated-hexagonal")]


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        pytest.param(name, kind, marks=[] if (name, kind) in QUICK else pytest.mark.long)
        for name in samples.names()
        for kind in LATTICES
    ],
)
def test_every_pattern_closes_and_becomes_flat(name: str, kind: Kind) -> None:
    asked = parse_request(samples.load(name), 10**7, 10**6)
    sent, wanted = asked.surface, asked.wanted
    assert isinstance(sent, SentSurface)
    assert wanted.pattern is not None
    # 20 hexagons around the ring would be too large for its narrowest place.
    pattern = replace(wanted.pattern, kind=kind, around=24 if name == "ring" else 20, edge_length=None)
    settings = replace(wanted, pattern=pattern, panels=PanelSettings(mode="watertight"))
    why = ""
    try:
        made: Solution | None = solve(lambda: take_in(sent, wanted.surface), settings, PlainRunner())
    except HexwrapError as error:
        made, why = None, error.detail
    if made is None:
        assert kind != "hex"
        assert any(word in why for word in REFUSED), why
        return
    assert made.pattern is not None
    assert made.panels is not None
    check_closed(made.pattern, kind)
    quality, polygons = made.quality, made.panels.polygons
    assert quality.planarity is not None
    assert quality.convex is not None
    assert quality.planarity.max() < 1e-9
    crossing = crossing_themselves(polygons, made.panels.center, made.panels.normal)
    told = " ".join(quality.notes)
    assert bool(crossing.any()) == ("crosses itself" in told)
    assert (not quality.convex.all()) == ("not convex" in told)


def check_closed(pattern: Pattern, kind: Kind) -> None:
    """Each edge has a cell on either side or lies at the rim; inside, as many edges meet as in the plane."""
    faces = pattern.faces
    start, end = faces.values.astype(np.int64), faces.values[faces.next()].astype(np.int64)
    n = len(pattern.vertices)
    key, twin = start * n + end, end * n + start
    assert len(np.unique(key)) == len(key)
    order = np.argsort(key)
    at = np.searchsorted(key[order], twin).clip(max=len(key) - 1)
    across = np.where(key[order][at] == twin, faces.row[order][at], -1)
    assert np.array_equal(across, pattern.neighbours.values)
    if not pattern.whole.all():
        return
    rim = np.zeros(n, dtype=bool)
    rim[start[across < 0]] = rim[end[across < 0]] = True
    degree, lattice = np.bincount(start, minlength=n), LATTICES[kind]
    usual = np.unique((lattice.ways >= 0).sum(axis=1))
    if not lattice.sides_at_centre:
        usual = np.arange(usual.max() + 3)  # nodes may stand around singularities
    assert np.isin(degree[~rim], usual).all()
