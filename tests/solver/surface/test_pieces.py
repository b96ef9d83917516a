"""Meshes in parts: what hangs together, and what joins within a tolerance."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.surface import SentMesh, surface_from_mesh
from hexwrap_solver.surface.pieces import joined, only, pieces, together
from tests.solver.surface.shapes import mesh, tube


def halves(shift: float = 0.0, finer: bool = False) -> list[SentMesh]:
    """A tube in two halves, one moved outwards by shift; finer: with twice the rows in it."""
    vertices, quads = tube(rings=7, around=16)
    at = vertices[quads].mean(axis=1)
    lower = at[:, 1] > 0
    moved = vertices + np.array([0.0, -shift, 0.0])
    other, faces = (moved, quads[~lower]) if not finer else _finer(moved, quads[~lower])
    return [mesh(vertices, quads[lower]), mesh(other, faces)]


def _finer(vertices: np.ndarray, quads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each quad in two, one above the other."""
    a, b, c, d = quads.T
    n = len(vertices)
    k = len(quads)
    left, right = (vertices[a] + vertices[d]) / 2, (vertices[b] + vertices[c]) / 2
    e, f = n + np.arange(k), n + k + np.arange(k)
    whole = np.concatenate([vertices, left, right])
    return whole, np.concatenate([np.stack([a, b, f, e], 1), np.stack([e, f, c, d], 1)])


def test_a_tube_is_one_piece_with_two_loops() -> None:
    vertices, quads = tube()
    (piece,) = pieces(mesh(vertices, quads))
    assert piece.loops == 2
    np.testing.assert_array_equal(piece.faces, np.arange(len(quads)))


def test_pieces_are_found_by_their_edges_and_sorted_by_area() -> None:
    vertices, quads = tube()
    far = vertices[:3] + 100
    faces = [*quads.tolist(), [len(vertices), len(vertices) + 1, len(vertices) + 2]]
    sent = mesh(np.vstack([vertices, far]), faces)
    large, small = pieces(sent)
    assert (large.loops, small.loops) == (2, 1)
    assert len(small.faces) == 1
    left = only(sent, large.faces)
    assert left.vertices is sent.vertices  # so that indices mean what they meant
    assert len(surface_from_mesh(left).loops) == 2


def test_vertices_of_parts_left_out_are_no_repair() -> None:
    vertices, quads = tube()
    n = len(vertices)
    points = np.concatenate([vertices, vertices + 100, [[5.0, 5.0, 5.0]], vertices + 200])
    sent = mesh(points, np.concatenate([quads, quads + n, quads + 2 * n + 1]))
    two = only(sent, np.arange(2 * len(quads)))
    one = only(joined(two, 1e-3)[0], np.arange(len(quads)))
    assert surface_from_mesh(one).repairs == ("1 vertex that no face uses was left out.",)


@pytest.mark.parametrize("shift", [0.0, 1e-4, 9e-4])
@pytest.mark.parametrize("finer", [False, True])
def test_halves_become_a_tube_within_the_tolerance(shift: float, finer: bool) -> None:
    both = halves(shift, finer)
    unused = sum(len(half.vertices) - len(np.unique(half.faces.values)) for half in both)
    sent, owner = together(both)
    assert len(pieces(sent)) == (2 if shift or finer else 1)
    whole, source, joint = joined(sent, 1e-3)
    (piece,) = pieces(whole)
    assert piece.loops == 2
    assert joint.gap == pytest.approx(shift, abs=1e-12)
    assert len(source) == whole.faces.n_rows
    assert set(owner[source].tolist()) == {0, 1}
    surface = surface_from_mesh(whole)
    assert len(surface.loops) == 2
    assert surface.repairs[0] == f"{unused} vertices that no face uses were left out."


@pytest.mark.parametrize("finer", [False, True])
def test_gaps_beyond_the_tolerance_stay(finer: bool) -> None:
    sent, _ = together(halves(2e-3, finer))
    whole, _, joint = joined(sent, 1e-3)
    assert joint.count == 0
    assert whole is sent


def test_a_seam_closes_within_the_tolerance() -> None:
    vertices, quads = tube()
    n = len(vertices)
    seam = np.flatnonzero(np.isin(quads, quads[0]).any(axis=1))
    cut = quads.copy()
    first = np.unique(quads[seam])
    moved = vertices[first] + 5e-4
    new = np.arange(n, n + len(first))
    cut[seam[0]] = new[np.searchsorted(first, quads[seam[0]])]
    torn = SentMesh(np.vstack([vertices, moved]), Ragged.from_table(cut))
    whole, _, joint = joined(torn, 1e-3)
    assert joint.gap == pytest.approx(5e-4 * np.sqrt(3))
    assert [piece.loops for piece in pieces(whole)] == [2]


@pytest.mark.parametrize("sheet", ["floor", "fin"])
def test_a_sheet_welded_to_a_tube_does_not_cut_it(sheet: str) -> None:
    """Three faces meet all around: the walls run straight on, the floor or fin is left out."""
    vertices, quads = tube(9, 24)
    at = 3 * 24 + np.arange(24)
    if sheet == "floor":
        vertices = np.append(vertices, [vertices[at].mean(axis=0)], axis=0)
        more = [[a, b, 9 * 24] for a, b in zip(at, np.roll(at, -1), strict=True)]
    else:
        vertices = np.concatenate([vertices, vertices[at] * [1.2, 1.2, 1]])
        out = 9 * 24 + np.arange(24)
        more = np.stack([at, np.roll(at, -1), np.roll(out, -1), out], axis=1).tolist()
    sent = mesh(vertices, [*quads.tolist(), *more])
    whole, left = pieces(sent)
    np.testing.assert_array_equal(whole.faces, np.arange(len(quads)))
    assert (whole.loops, len(left.faces)) == (2, 24)
    assert len(surface_from_mesh(only(sent, whole.faces)).loops) == 2


def test_cones_that_meet_at_their_tips_are_alike() -> None:
    """Quads of the pinched ring have an edge without length: they tell nothing about what is straight."""
    i, j = np.divmod(np.arange(40 * 31), 31)
    angle, v = np.pi * i / 20, j / 30
    vertices = np.stack([(3 - 6 * v) * np.cos(angle), (3 - 6 * v) * np.sin(angle), 20 * v], axis=1)
    a = np.flatnonzero(j < 30)
    b = (a + 31) % len(vertices)
    upper, lower = pieces(mesh(vertices, np.stack([a, b, b + 1, a + 1], axis=1)))[:2]
    assert upper.loops == lower.loops == 1
    assert upper.area == pytest.approx(lower.area)


@pytest.mark.parametrize("off", [0.0, 1e-15])
def test_quads_that_narrow_to_a_point_stay_with_the_dome(off: float) -> None:
    """As grids of spheres have them: at the pole two corners of each, whichever way it is cut, are one."""
    turn, up = np.meshgrid(2 * np.pi * np.arange(12) / 12, np.linspace(0, np.pi / 2, 7), indexing="ij")
    radius = np.where(np.arange(7) == 6, off, np.cos(up))
    dome = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sin(up)], axis=-1).reshape(-1, 3)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(12), np.arange(6), indexing="ij"))
    right = (i + 1) % 12
    quads = np.stack([7 * i + j, 7 * right + j, 7 * right + j + 1, 7 * i + j + 1], axis=1)
    (piece,) = pieces(mesh(dome, quads))
    assert piece.loops == 1
    assert len(piece.faces) == len(quads)


def test_in_a_heap_of_triangles_nothing_is_looked_for() -> None:
    """Each ball around an edge holds a sixth of all vertices: 80 million pairs, of which none is a seam."""
    rng = np.random.default_rng(0)
    corners = rng.integers(0, 40_000, (20_000, 3))
    heap = mesh(rng.random((40_000, 3)), corners[np.ptp(corners, axis=1) > 0])
    whole, _, joint = joined(heap, 1e-9)
    assert whole is heap
    assert joint.count == 0


def test_the_search_for_what_lies_on_open_edges_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    sent, _ = together(halves(finer=True))
    assert joined(sent, 1e-3)[2].count > 0
    monkeypatch.setattr("hexwrap_solver.surface.pieces.MOST_NEAR", 10)
    assert joined(sent, 1e-3)[0] is sent
