"""Every kind of pattern closes on every kind of domain.

The theorems: the Euler characteristic is the surface's; around every interior node stand the cells of the
tiling, in their order; every interior cell has as many neighbours as corners; trimmed cells cover the domain;
cells are as regular in the domain as its distortion allows.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.errors import NotAdaptedError
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from tests.solver.pattern import annuli, nets
from tests.solver.pattern.test_lattice import TILINGS
from tests.solver.pattern.test_nets import euler, on_boundary

KINDS = list(LATTICES)
MAPS = {
    "cylinder": cache(lambda: annuli.revolution(np.cosh, np.linspace(-0.8, 1.0, 13), 36)),
    "cone": cache(lambda: annuli.flat_cone(-np.pi, 1.0, 2.0, 50, 9)),
    "ring": cache(lambda: annuli.flat_cone(2 * np.pi, 1.0, 2.0, 60, 9)),
    "roof": cache(nets.roof),
    "dome": cache(nets.dome),
    "opening": cache(lambda: nets.tower(1)),  # its map turns by multiples of π/3
}
CLOSING = [(case, kind) for case in MAPS for kind in KINDS if case != "opening" or LATTICES[kind].fold == 6]


def laid(case: str, kind: str, **settings: object) -> tuple[ConformalMap, Pattern]:
    cmap = MAPS[case]()
    around = None if cmap.kind == "net" else 48
    return cmap, lay_pattern(cmap, PatternSettings(kind=kind, around=around, **settings))


def configurations(pattern: Pattern) -> set[tuple[int, ...]]:
    """Corners of the cells around each interior node, from the least cyclic turn of them."""
    faces, following = pattern.faces, pattern.faces.next()
    tail, head = faces.values.tolist(), faces.values[following].tolist()
    before = np.empty_like(following)
    before[following] = np.arange(len(following))
    edge = {(a, b): i for i, (a, b) in enumerate(zip(tail, head, strict=True))}
    sides = faces.lengths[faces.row].tolist()
    found = set()
    first = np.unique(faces.values, return_index=True)[1]
    inner = ~on_boundary(pattern)
    for start in first[inner[faces.values[first]]].tolist():
        around, at = [], start
        while True:
            around.append(sides[at])
            came = before[at]
            at = edge[tail[at], tail[came]]
            if at == start:
                break
        around = around[::-1]
        found.add(min(tuple(around[i:] + around[:i]) for i in range(len(around))))
    return found


@pytest.mark.parametrize(("case", "kind"), CLOSING)
def test_closes_with_the_cells_of_the_tiling_around_every_node(case, kind):
    cmap, pattern = laid(case, kind)
    assert euler(pattern) == 2 - len(cmap.surface.loops)
    assert (pattern.index == 0).all()
    assert set(pattern.faces.lengths) <= set(LATTICES[kind].outlines)
    assert configurations(pattern) == TILINGS[kind][0]
    closed = (
        np.add.reduceat(pattern.neighbours.values >= 0, pattern.faces.offsets[:-1]) == pattern.faces.lengths
    )
    assert closed.any()
    for cell in np.flatnonzero(closed)[::7].tolist():
        assert len(set(pattern.neighbours[cell].tolist())) == pattern.faces.lengths[cell]
    assert len(set(pattern.labels())) == pattern.n_cells


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", ["cylinder", "cone", "dome"])
def test_trimmed_cells_cover_the_domain(case, kind):
    cmap, pattern = laid(case, kind, boundary="trim", rotation="vertex")
    z, following = pattern.corners, pattern.faces.next()
    area = np.add.reduceat((z.conj() * z[following]).imag / 2, pattern.faces.offsets[:-1])
    p, q, r = cmap.corners().T
    domain = float((((q - p).conj() * (r - p)).imag / 2).sum())
    assert (area > 0).all()
    rel = 1e-9 if cmap.kind != "net" else 2e-3
    assert area.sum() == pytest.approx(domain, rel=rel)
    assert euler(pattern) == 2 - len(cmap.surface.loops)


@pytest.mark.parametrize("kind", KINDS)
def test_edges_of_a_flat_cylinder_are_equal_and_angles_those_of_the_cells(kind):
    cmap = annuli.revolution(np.ones_like, np.linspace(0, 3, 8), 31)
    pattern = lay_pattern(cmap, PatternSettings(kind=kind, around=14, align="none"))
    z, following = pattern.corners, pattern.faces.next()
    edge = z[following] - z
    np.testing.assert_allclose(abs(edge), abs(edge).mean(), rtol=1e-9)
    turn = np.angle(edge[following] / edge)
    for sides, outline in LATTICES[kind].outlines.items():
        ahead = np.roll(outline, -1) - outline
        own = np.unique(np.round(np.angle(np.roll(ahead, -1) / ahead), 9))
        met = turn[pattern.faces.lengths[pattern.faces.row] == sides]
        assert abs(met[:, None] - own).min(axis=1).max() < 1e-8


@pytest.mark.parametrize("kind", [kind for kind in KINDS if LATTICES[kind].fold == LATTICES[kind].order])
def test_closed_surfaces_have_singular_cells(kind):
    cmap = nets.ellipsoid("hex" if LATTICES[kind].order == 6 else "quad")
    pattern = lay_pattern(cmap, PatternSettings(kind=kind))
    assert (pattern.neighbours.values >= 0).all()
    assert euler(pattern) == 2
    if LATTICES[kind].sides_at_centre:
        assert pattern.index.sum() == cmap.cones.index.sum()
    else:
        valence = np.bincount(pattern.faces.values)
        assert (LATTICES[kind].ways.shape[1] - valence).sum() == cmap.cones.index.sum()


def test_bricks_need_half_turns():
    with pytest.raises(NotAdaptedError, match="a multiple of π"):
        lay_pattern(annuli.flat_cone(-np.pi / 2, 1.0, 2.0, 50, 9), PatternSettings(kind="brick"))
    with pytest.raises(NotAdaptedError, match="quantum brick"):
        lay_pattern(nets.ellipsoid("quad"), PatternSettings(kind="brick"))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("rotation", ["edge", "vertex"])
@pytest.mark.parametrize("boundary", ["whole", "trim"])
def test_both_ends_of_a_cylinder_are_lattice_lines(kind, rotation, boundary):
    """Nodes, and with trimmed cells the straight cut, lie on the ends all around; the two ends look alike."""
    _, pattern = laid("cylinder", kind, rotation=rotation, boundary=boundary)
    heights = pattern.uv.imag if abs(MAPS["cylinder"]().deck.translation.imag) < 1e-9 else pattern.uv.real
    counts = [int((abs(heights - end) < 1e-9).sum()) for end in (heights.min(), heights.max())]
    assert counts[0] == counts[1] >= 8
    per_ring = np.bincount(pattern.faces.lengths)
    assert (per_ring % (pattern.around // 4) == 0).all()
