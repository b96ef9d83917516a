"""Unrolling a flat metric on an annulus (paper, Figure 4): positions, sheets, deck transformation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints
from hexwrap_solver.conformal.cut import Cut, cut_open
from hexwrap_solver.conformal.energy import Corners
from hexwrap_solver.conformal.types import Deck
from hexwrap_solver.surface.topology import next_half_edge
from hexwrap_solver.surface.types import Surface

Numbers = TypeVar("Numbers", Floats, Complexes)

#: Cone angles nearer than this to a multiple of 2π count as one: g is a translation (see Deck).
FULL_TURN = 1e-9
#: An apex further away than this many times the size of the domain is not made the origin: coordinates would
#: lose the digits in which they agree.
FAR = 100.0
#: A translation shorter than this, relative to the domain, is none (flat rings that close up by themselves).
NO_TRANSLATION = 1e-10


@dataclass(frozen=True)
class Layout:
    """uv: (n,) complex. sheet: (m, 3). closing_error: greatest disagreement around the annulus, relative
    to the circumference. The other fields as in ConformalMap."""

    uv: Complexes
    sheet: Ints
    deck: Deck
    circumference: float
    closing_error: float


def lay_out(surface: Surface, lengths: Floats, metric: Corners, cone_angle: float) -> Layout:
    """Develops the triangles over a breadth-first tree of the faces and closes the result with g.

    lengths, metric: (3, m) of the flat metric (row k: corner k, and the edge opposite to it).
    cone_angle: K. g is one turn around the surface in the direction of loop 0 (surface on its left).

    Cylinder: g moves along +x, loop 0 lies around y = 0 with the surface above. Cone: the apex is the
    origin, and the sheet is symmetric to the positive y axis; where the apex is FAR away, the cut starts at 0
    and g moves it along +x. K = 2πm, m ≠ 0: loop 0 is centred at 0.
    """
    cut = cut_open(surface)
    return _close(surface, _develop(cut.twin, lengths, metric), cut, cone_angle)


def _develop(twin: Ints, lengths: Floats, metric: Corners) -> Complexes:
    """(3, m) where the corners of every triangle stand, consistent across all edges of a tree of faces.

    First come the directions, one angle per face, then the places: both are sums along the tree.
    """
    m, angles = len(twin) // 3, metric.angle
    order, up, parent, corner = _face_tree(twin)
    face = np.arange(m)
    # A face's edges head for 0, π − α₁ and α₀ − π where its first edge heads for 0.
    heading = np.stack([np.zeros(m), np.pi - angles[1], angles[0] - np.pi])
    there = twin[3 * face + corner] - 3 * parent  # the shared edge, seen from the parent: it runs backwards
    there[order[0]] = 0
    turn = heading[there, parent] + np.pi - heading[corner, face]
    first_edge = np.exp(1j * _summed_along(up, order, turn))
    place = np.zeros((3, m), dtype=complex)
    place[1] = lengths[2] * first_edge
    place[2] = lengths[1] * first_edge * metric.directions()
    ends = place + place[[1, 2, 0]]  # twice the middles of the edges
    place += _summed_along(up, order, (ends[there, parent] - ends[corner, face]) / 2)
    return place


def _summed_along(up: Ints, order: Ints, steps: Numbers) -> Numbers:
    """(m,) sums of the steps on the way from the root to each face, by pointer jumping: after k rounds every
    face knows the sum of 2^k steps, so rounds and rounding errors grow with log(depth).

    up, order: see ``_face_tree``. steps: (m,) per face, from its parent to it; the root's is ignored.
    """
    up = up.copy()
    total = steps[order]
    total[0] = 0
    first = 1  # the faces before it know their way to the root: parents stand before their children
    while first < len(up):
        rest = slice(first, None)
        above = up[rest]
        total[rest] += total[above]
        up[rest] = up[above]
        first = int(np.searchsorted(up, 1))
    result = np.empty_like(total)
    result[order] = total
    return result


def _face_tree(twin: Ints) -> tuple[Ints, Ints, Ints, Ints]:
    """order: (m,) the faces, breadth first, which puts parents side by side in memory. up: (m,) the place of
    each one's parent in that order. Per face, parent: (m,) and corner: (m,) where the edge towards it starts.
    The root is its own parent."""
    m = len(twin) // 3
    neighbour = np.where(twin >= 0, twin, np.arange(3 * m)) // 3  # itself, where there is none
    starts = np.arange(0, 3 * m + 1, 3)
    graph = sparse.csr_matrix((np.ones(3 * m, dtype=np.int8), neighbour, starts), shape=(m, m))
    found, before = breadth_first_order(graph, 0)
    order, parent = found.astype(np.int64), before.astype(np.int64)
    parent[0] = 0
    place = np.empty(m, dtype=np.int64)
    place[order] = np.arange(m)
    across = neighbour.reshape(-1, 3).T
    corner = np.where(across[0] == parent, 0, np.where(across[1] == parent, 1, 2))
    return order, place[parent[order]], parent, corner


def _close(surface: Surface, corners: Complexes, cut: Cut, cone_angle: float) -> Layout:
    flat, n = surface.faces.T.ravel(), len(surface.vertices)
    rotation = np.exp(1j * cone_angle)
    on_left = cut.sheet.T.ravel() > 0
    right = _mean_position(flat[~on_left], corners.ravel()[~on_left], n)
    left = _mean_position(flat[on_left], corners.ravel()[on_left], n)[cut.path]
    # left = e^{iK} right + t along the cut: t in least squares; what is left over is the closing error.
    offsets = left - rotation * right[cut.path]
    translation = complex(offsets.mean())
    disagreement = float(np.abs(offsets - translation).max())
    deck = Deck(cone_angle, translation)
    uv, deck, circumference = normalise(surface, right, cut.sheet, deck, int(cut.path[0]))
    return Layout(uv, cut.sheet, deck, circumference, disagreement / circumference)


def _mean_position(vertex: Ints, position: Complexes, n: int) -> Complexes:
    count = np.maximum(np.bincount(vertex, minlength=n), 1)
    real = np.bincount(vertex, weights=position.real, minlength=n)
    imaginary = np.bincount(vertex, weights=position.imag, minlength=n)
    return np.asarray((real + 1j * imaginary) / count)


def normalise(
    surface: Surface, uv: Complexes, sheet: Ints, deck: Deck, foot_vertex: int
) -> tuple[Complexes, Deck, float]:
    """Moves the sheet, whose cut starts at ``foot_vertex`` on loop 0, into its standard place (see lay_out).
    Also gives the circumference."""
    loops, foot = surface.loops, complex(uv[foot_vertex])
    apex = deck.apex
    if apex is not None:
        distance = np.abs(uv - apex)
        radius = float(np.sqrt(distance[loops[0]].mean()) * np.sqrt(distance[loops[1]].mean()))
        far = distance.min() > FAR * np.abs(uv - foot).max()
        around = _runs_around(apex, surface, uv, sheet, deck)
        length = abs(deck.angle) * radius if around else _loop_length(surface, uv, sheet, deck)
        moved, deck = _upright(uv, deck, foot) if far else _about(apex, uv, deck, foot)
        return moved, deck, length
    if abs(deck.angle) < FULL_TURN:
        moved, deck = _upright(uv, deck, foot)
        moved -= 1j * moved[loops[0]].imag.mean()
        return moved, Deck(deck.angle, complex(deck.translation.real)), abs(deck.translation)
    length = _loop_length(surface, uv, sheet, deck)
    short = abs(deck.translation) <= NO_TRANSLATION * length
    return uv - uv[loops[0]].mean(), Deck(deck.angle, 0j if short else deck.translation), length


def _loop_length(surface: Surface, uv: Complexes, sheet: Ints, deck: Deck) -> float:
    """Geometric mean of the two loops' lengths in the domain, whatever copies the cut has picked."""
    start, end, first = _rim(surface, uv, sheet, deck)
    edge = np.abs(end - start)
    return float(np.sqrt(edge[first].sum()) * np.sqrt(edge[~first].sum()))


def _runs_around(apex: complex, surface: Surface, uv: Complexes, sheet: Ints, deck: Deck) -> bool:
    """Whether both loops turn about the apex by K. Where K is near 2πm, m ≠ 0, they may lie beside it, and
    turn by K − 2πm only."""
    start, end, first = _rim(surface, uv, sheet, deck)
    turn = np.angle((end - apex) / (start - apex))
    swept = turn[first].sum(), -turn[~first].sum()
    return bool(max(abs(angle - deck.angle) for angle in swept) < np.pi)


def _rim(surface: Surface, uv: Complexes, sheet: Ints, deck: Deck) -> tuple[Complexes, Complexes, Bools]:
    """(k,) where the boundary edges start and end in some sheet, and which of them belong to loop 0."""
    rim = np.flatnonzero(surface.twin < 0)
    flat, sheets = surface.faces.ravel(), sheet.ravel()
    start, end = (deck.apply(uv[flat[h]], sheets[h]) for h in (rim, next_half_edge(rim)))
    first = np.zeros(len(uv), dtype=bool)
    first[surface.loops[0]] = True
    return start, end, first[flat[rim]]


def _upright(uv: Complexes, deck: Deck, foot: complex) -> tuple[Complexes, Deck]:
    """The foot of the cut at 0, its image under g on the positive real axis."""
    chord = complex(deck.apply(np.array([foot]))[0]) - foot
    turn = abs(chord) / chord
    return (uv - foot) * turn, Deck(deck.angle, chord * turn)


def _about(apex: complex, uv: Complexes, deck: Deck, foot: complex) -> tuple[Complexes, Deck]:
    """The apex at 0, the sheet symmetric to the positive imaginary axis."""
    turn = np.exp(1j * (np.pi - deck.angle) / 2) * abs(foot - apex) / (foot - apex)
    return (uv - apex) * turn, Deck(deck.angle, 0j)
