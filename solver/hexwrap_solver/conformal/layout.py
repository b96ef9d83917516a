"""Unrolling a flat metric on an annulus (paper, Figure 4): positions, sheets, deck transformation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.cut import Cut, cut_open
from hexwrap_solver.conformal.types import Deck
from hexwrap_solver.surface.topology import next_half_edge
from hexwrap_solver.surface.types import Surface

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


def lay_out(surface: Surface, lengths: Floats, angles: Floats, cone_angle: float) -> Layout:
    """Develops the triangles over a breadth-first tree of the faces and closes the result with g.

    lengths, angles: (3, m) of the flat metric (row k: corner k, and the edge opposite to it).
    cone_angle: K. g is one turn around the surface in the direction of loop 0 (surface on its left).

    Cylinder: g moves along +x, loop 0 lies around y = 0 with the surface above. Cone: the apex is the
    origin, and the sheet is symmetric to the positive y axis; where the apex is FAR away, the cut starts at 0
    and g moves it along +x. K = 2πm, m ≠ 0: loop 0 is centred at 0.
    """
    cut = cut_open(surface)
    return _close(surface, _develop(cut.twin, lengths, angles), cut, cone_angle)


def _local_frames(lengths: Floats, angles: Floats, order: Ints) -> Complexes:
    """(m, 3) every triangle by itself, in the given order: corner 0 at 0, corner 1 on the positive real
    axis."""
    local = np.zeros((len(order), 3), dtype=complex)
    length, angle = lengths[1][order], angles[0][order]
    local[:, 1] = lengths[2][order]
    local.real[:, 2], local.imag[:, 2] = length * np.cos(angle), length * np.sin(angle)
    return local


def _develop(twin: Ints, lengths: Floats, angles: Floats) -> Complexes:
    """(m, 3) all triangles side by side in the plane, consistent across all edges of the tree.

    Motions z → r z + t from each face into its parent are composed by pointer jumping: after k rounds
    every face knows the way 2^k steps up the tree, so rounds and rounding errors grow with log(depth).
    """
    m = len(twin) // 3
    order, up = _face_tree(twin)
    # faces in breadth-first order: parents then lie side by side in memory, too
    local = _local_frames(lengths, angles, order)
    turn = np.ones(m, dtype=complex)
    shift = np.zeros(m, dtype=complex)
    turn[1:], shift[1:] = _motions(twin, local, order, up)
    first = 1  # the faces before it know their way to the root: parents stand before their children
    while first < m:
        rest = slice(first, m)
        above = up[rest]
        shift[rest] = turn[above] * shift[rest] + shift[above]
        turn[rest] *= turn[above]
        up[rest] = up[above]
        first = int(np.searchsorted(up, 1))
    turn /= np.abs(turn)
    corners = np.empty((m, 3), dtype=complex)
    corners[order] = turn[:, None] * local + shift[:, None]
    return corners


def _motions(twin: Ints, local: Complexes, order: Ints, up: Ints) -> tuple[Complexes, Complexes]:
    """Rotation and translation that lay faces 1, 2, … (in the given order) against their parents' frames."""
    face, parent = order[1:], order[up[1:]]
    across = twin.reshape(-1, 3)[face] // 3
    corner = np.where(across[:, 0] == parent, 0, np.where(across[:, 1] == parent, 1, 2))
    back = twin[3 * face + corner]  # the shared edge, seen from the parent: it runs backwards there
    place = local.ravel()
    base, above = 3 * np.arange(1, len(order)), 3 * (up[1:] - parent)
    tail, head = place[base + corner], place[base + (corner + 1) % 3]
    tail_there, head_there = place[above + next_half_edge(back)], place[above + back]
    turn = (head_there - tail_there) / (head - tail)
    turn /= np.abs(turn)
    return turn, (tail_there + head_there - turn * (tail + head)) / 2


def _face_tree(twin: Ints) -> tuple[Ints, Ints]:
    """The faces in breadth-first order, and the place of each one's parent in that order (0 for the root)."""
    m = len(twin) // 3
    neighbour = np.where(twin >= 0, twin, np.arange(3 * m)) // 3  # itself, where there is none
    starts = np.arange(0, 3 * m + 1, 3)
    graph = sparse.csr_matrix((np.ones(3 * m, dtype=np.int8), neighbour, starts), shape=(m, m))
    order, parent = breadth_first_order(graph, 0)
    place = np.zeros(m, dtype=np.int64)
    place[order] = np.arange(m)
    up = np.zeros(m, dtype=np.int64)
    up[1:] = place[parent[order[1:]]]
    return order.astype(np.int64), up


def _close(surface: Surface, corners: Complexes, cut: Cut, cone_angle: float) -> Layout:
    flat, n = surface.faces.ravel(), len(surface.vertices)
    rotation = np.exp(1j * cone_angle)
    on_left = cut.sheet.ravel() > 0
    right = _mean_position(flat[~on_left], corners.ravel()[~on_left], n)
    left = _mean_position(flat[on_left], corners.ravel()[on_left], n)[cut.path]
    # left = e^{iK} right + t along the cut: t in least squares, then the positions share the rest
    offsets = left - rotation * right[cut.path]
    translation = complex(offsets.mean())
    disagreement = float(np.abs(offsets - translation).max())
    uv = right
    deck = Deck(cone_angle, translation)
    uv, deck, circumference = normalise(surface, uv, cut.sheet, deck, int(cut.path[0]))
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
        moved, deck = _upright(uv, deck, foot) if far else _about(apex, uv, deck, foot)
        return moved, deck, abs(deck.angle) * radius
    if abs(deck.angle) < FULL_TURN:
        moved, deck = _upright(uv, deck, foot)
        moved -= 1j * moved[loops[0]].imag.mean()
        return moved, Deck(deck.angle, complex(deck.translation.real)), abs(deck.translation)
    length = _loop_length(surface, uv, sheet, deck)
    short = abs(deck.translation) <= NO_TRANSLATION * length
    return uv - uv[loops[0]].mean(), Deck(deck.angle, 0j if short else deck.translation), length


def _loop_length(surface: Surface, uv: Complexes, sheet: Ints, deck: Deck) -> float:
    """Geometric mean of the two loops' lengths in the domain, whatever copies the cut has picked."""
    corner = deck.apply(uv[surface.faces], sheet).ravel()
    rim = np.flatnonzero(surface.twin < 0)
    edge = np.abs(corner[next_half_edge(rim)] - corner[rim])
    first = np.isin(surface.faces.ravel()[rim], surface.loops[0])
    return float(np.sqrt(edge[first].sum()) * np.sqrt(edge[~first].sum()))


def _upright(uv: Complexes, deck: Deck, foot: complex) -> tuple[Complexes, Deck]:
    """The foot of the cut at 0, its image under g on the positive real axis."""
    chord = complex(deck.apply(np.array([foot]))[0]) - foot
    turn = abs(chord) / chord
    return (uv - foot) * turn, Deck(deck.angle, chord * turn)


def _about(apex: complex, uv: Complexes, deck: Deck, foot: complex) -> tuple[Complexes, Deck]:
    """The apex at 0, the sheet symmetric to the positive imaginary axis."""
    turn = np.exp(1j * (np.pi - deck.angle) / 2) * abs(foot - apex) / (foot - apex)
    return (uv - apex) * turn, Deck(deck.angle, 0j)
