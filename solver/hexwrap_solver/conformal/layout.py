"""Laying a flat metric out in the plane (paper, Figure 4): places, and the motions that close it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, positions
from hexwrap_solver.conformal.cut import Cut, cut_open
from hexwrap_solver.conformal.energy import Corners
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import Deck, Unrolled
from hexwrap_solver.geometry import sums_to_root
from hexwrap_solver.surface.topology import next_half_edge
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.tolerances import is_zero

Numbers = TypeVar("Numbers", Floats, Complexes)

#: An apex further away than this many times the size of the domain is not made the origin: coordinates would
#: lose the digits in which they agree (a scan of 50,000 vertices that shrinks in places to 1e-11).
FAR = 3.0
#: Shorter edges, relative to the longest one, count as so long where squares of lengths are weights.
FINEST = 1e-100
#: A translation shorter than this, relative to the shortest edge of the loops, is none (flat rings that close
#: up by themselves): leaving it out turns these edges by as much, a tenth of what angles are promised to.
NO_TRANSLATION = 1e-10


@dataclass(frozen=True)
class Layout:
    """closing_error: greatest disagreement across the cut, relative to the circumference of an annulus, to
    the diameter of any other domain."""

    domain: Unrolled | Net
    closing_error: float


def lay_out(
    surface: Surface,
    lengths: Floats,
    metric: Corners,
    curvature: Floats,
    cones: Ints | None = None,
    rounding: Floats | None = None,
) -> Layout:
    """Develops the triangles over a breadth-first tree of the faces and closes the result along the cut.

    lengths, metric: (3, m) of the flat metric (row k: corner k, and the edge opposite to it).
    curvature: (b + c,) Σκ of every loop, and of the vertices ``cones`` (c,). rounding: see ``FaceTree.of``.

    Annuli: g is one turn around the surface in the direction of loop 0 (surface on its left). On a
    cylinder it moves along +x, and loop 0 lies around y = 0 with the surface above. Cone: the apex is the
    origin, and the sheet is symmetric to the positive y axis; where the apex is FAR away, the cut starts
    at 0 and g moves it along +x. K = 2πm, m ≠ 0: loop 0 is centred at 0. All others: the middle of the
    corners is 0, and they spread most along the x axis.
    """
    nothing = np.zeros(0, dtype=np.int64)
    cut = cut_open(surface, nothing if cones is None else cones)
    place = develop(FaceTree.of(cut.twin, rounding), lengths, metric)
    # The holonomy of what lies beyond a piece, seen from its right, is a rotation by minus its curvature.
    angle = -(cut.beyond @ curvature)
    glued = _glue(surface, place, lengths / lengths.max(), cut, angle)
    if len(surface.loops) != 2 or len(curvature) != 2:
        net = _upright_net(_net(surface, cut, glued, angle))
        size = abs(net.corners).max()
        return Layout(net, glued.disagreement / (2 * size))
    deck = Deck(float(curvature[0]), complex(glued.translation[0]))
    sheet = np.where(cut.fan > 0, 1, 0).reshape(-1, 3)
    foot = int(surface.faces.ravel()[cut.left[0]])
    uv, deck, circumference = normalise(surface, glued.place, sheet, deck, foot)
    return Layout(Unrolled(uv, sheet, deck, circumference), glued.disagreement / circumference)


@dataclass(frozen=True)
class FaceTree:
    """order: (m,) the faces, breadth first, which puts parents side by side in memory. up: (m,) the place of
    each one's parent in that order. Per face, parent: (m,); corner: (m,) where the edge towards it starts;
    there: (m,) where the same edge starts in the parent. The root is its own parent."""

    order: Ints
    up: Ints
    parent: Ints
    corner: Ints
    there: Ints

    @classmethod
    def of(cls, twin: Ints, rounding: Floats | None = None) -> FaceTree:
        """twin: (3m,) half-edges across, −1 where there is none; face 0 is the root. rounding: (3m,) of the
        direction of each half-edge in its face, in any unit; the tree avoids the largest."""
        m = len(twin) // 3
        neighbour = np.where(twin >= 0, twin, np.arange(3 * m)) // 3  # itself, where there is none
        starts = np.arange(0, 3 * m + 1, 3)
        weight = np.ones(3 * m, dtype=np.int8) if rounding is None else np.maximum(rounding, rounding[twin])
        graph = sparse.csr_matrix((weight, neighbour, starts), shape=(m, m))
        if rounding is not None:
            graph = sparse.csr_matrix(minimum_spanning_tree(graph))
        found, before = breadth_first_order(graph, 0, directed=rounding is None)
        order, parent = found.astype(np.int64), before.astype(np.int64)
        parent[0] = 0
        place = positions(order, m)
        across = neighbour.reshape(-1, 3).T
        corner = np.where(across[0] == parent, 0, np.where(across[1] == parent, 1, 2))
        there = twin[3 * np.arange(m) + corner] - 3 * parent
        there[order[0]] = 0
        return cls(order, place[parent[order]], parent, corner, there)


def develop(tree: FaceTree, lengths: Floats, metric: Corners) -> Complexes:
    """(3, m) where the corners of every triangle stand, consistent across all edges of the tree.

    First come the directions, one angle per face, then the places: both are sums along the tree.
    """
    m, angles = len(tree.parent), metric.angle
    parent, corner, there = tree.parent, tree.corner, tree.there
    face = np.arange(m)
    # A face's edges head for 0, π − α₁ and α₀ − π where its first edge heads for 0.
    heading = np.stack([np.zeros(m), np.pi - angles[1], angles[0] - np.pi])
    # the shared edge, seen from the parent, runs backwards
    turn = heading[there, parent] + np.pi - heading[corner, face]
    first_edge = np.exp(1j * _summed_along(tree, turn))
    place = np.zeros((3, m), dtype=complex)
    place[1] = lengths[2] * first_edge
    place[2] = lengths[1] * first_edge * metric.directions()
    ends = place + place[[1, 2, 0]]  # twice the middles of the edges
    place += _summed_along(tree, (ends[there, parent] - ends[corner, face]) / 2)
    return place


def _summed_along(tree: FaceTree, steps: Numbers) -> Numbers:
    """(m,) sums of the steps on the way from the root to each face. steps: (m,) per face, from its parent to
    it; the root's is ignored."""
    ordered = steps[tree.order]
    ordered[0] = 0
    result = np.empty_like(ordered)
    result[tree.order] = sums_to_root(ordered, tree.up, 0)
    return result


@dataclass(frozen=True)
class _Glued:
    """place: (n,) every vertex at home (see ``Cut.fan``). rotation, shift: (fans,) the motion from home to
    each fan. translation: (p,) of the motion of each piece of the cut. disagreement: what is left of
    closing."""

    place: Complexes
    rotation: Complexes
    shift: Complexes
    translation: Complexes
    disagreement: float


def _glue(surface: Surface, corners: Complexes, lengths: Floats, cut: Cut, angle: Floats) -> _Glued:
    """Motions across the cut, and one place for every vertex.

    The left side of each piece is M(right side), M rotates by a known ``angle`` (p,); its translation is
    found in least squares.
    """
    n, fans = len(surface.vertices), int(cut.fan.max(initial=0)) + 1
    flat = surface.faces.T.ravel()
    fan = cut.fan.reshape(-1, 3).T.ravel()
    away = fan > 0
    # Ends of a short edge are taken from the same triangles, so that it keeps its direction.
    finest = np.maximum(lengths.min(axis=0), FINEST)
    weight = np.tile((finest.min() / finest) ** 2, 3)
    home = _mean_position(flat[~away], corners.ravel()[~away], n, weight[~away])
    copies = _mean_position(fan, corners.ravel(), fans, weight)
    if not len(cut.left):
        return _Glued(home, np.ones(1, complex), np.zeros(1, complex), np.zeros(0, complex), 0.0)
    right = surface.twin[cut.left]
    # At both ends of every edge of the cut, the corners to its left and to its right, each pair of fans once.
    corner = np.stack([cut.left, next_half_edge(cut.left)], axis=1).ravel()
    opposite = np.stack([next_half_edge(right), right], axis=1).ravel()
    vertex = surface.faces.ravel()[corner]
    pair = (vertex * fans + cut.fan[corner]) * fans + cut.fan[opposite]
    once = np.sort(np.unique(pair, return_index=True)[1])
    vertex = vertex[once]
    one, other = cut.fan[corner[once]], cut.fan[opposite[once]]
    piece = np.repeat(cut.piece, 2)[once]
    turn = np.exp(1j * angle)
    at_left = np.where(one > 0, copies[one], home[vertex])
    at_right = np.where(other > 0, copies[other], home[vertex])
    offset = at_left - turn[piece] * at_right
    finest = np.zeros(n)
    np.maximum.at(finest, flat, weight)
    translation = _mean_position(piece, offset, len(angle), finest[vertex])
    disagreement = float(np.abs(offset - translation[piece]).max())
    rotation, shift = _from_home(one, other, turn[piece], translation[piece], fans)
    return _Glued(home, rotation, shift, translation, disagreement)


def _from_home(
    left: Ints, right: Ints, turn: Complexes, step: Complexes, fans: int
) -> tuple[Complexes, Complexes]:
    """(fans,) rotation and (fans,) shift of the motion from home, fan 0, to every fan. left, right: (k,) fans
    at both sides of the cut; the motion z ↦ turn z + step leads from right to left."""
    rotation, shift = np.ones(fans, dtype=complex), np.zeros(fans, dtype=complex)
    known = np.zeros(fans, dtype=bool)
    known[0] = True
    while not known.all():
        on = known[right] & ~known[left]
        rotation[left[on]] = turn[on] * rotation[right[on]]
        shift[left[on]] = turn[on] * shift[right[on]] + step[on]
        back = known[left] & ~known[right]
        rotation[right[back]] = np.conj(turn[back]) * rotation[left[back]]
        shift[right[back]] = np.conj(turn[back]) * (shift[left[back]] - step[back])
        known[left[on]] = known[right[back]] = True
    return rotation, shift


def _net(surface: Surface, cut: Cut, glued: _Glued, angle: Floats) -> Net:
    twin, fan = surface.twin, cut.fan
    corners = glued.rotation[fan] * glued.place[surface.faces.ravel()] + glued.shift[fan]
    pieces = len(angle)
    crossing = np.zeros(len(twin), dtype=np.int64)
    crossing[cut.left] = 1 + 2 * cut.piece
    crossing[twin[cut.left]] = 2 + 2 * cut.piece
    turn = np.exp(1j * angle)
    both = np.stack([glued.translation, -np.conj(turn) * glued.translation], axis=1)
    inverse = np.arange(2 * pieces + 1)
    inverse[1::2], inverse[2::2] = inverse[2::2].copy(), inverse[1::2].copy()
    return Net(
        corners.reshape(-1, 3),
        np.where(twin >= 0, twin // 3, -1).reshape(-1, 3),
        crossing.reshape(-1, 3),
        np.concatenate([[0.0], np.stack([angle, -angle], axis=1).ravel()]),
        np.concatenate([[0.0], both.ravel()]),
        inverse,
    )


def _upright_net(net: Net) -> Net:
    """Its middle at 0, its longest direction along the x axis."""
    middle = complex(net.corners.mean())
    spread = complex(((net.corners - middle) ** 2).mean())
    turn = np.exp(-0.5j * np.angle(spread)) if abs(spread) > 0 else 1.0
    return net.moved(turn, -turn * middle)


def _mean_position(vertex: Ints, position: Complexes, n: int, weight: Floats | None = None) -> Complexes:
    weight = np.ones(len(vertex)) if weight is None else weight
    total = np.bincount(vertex, weights=weight, minlength=n)
    real = np.bincount(vertex, weights=weight * position.real, minlength=n)
    imaginary = np.bincount(vertex, weights=weight * position.imag, minlength=n)
    return np.asarray((real + 1j * imaginary) / np.where(total > 0, total, 1.0))


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
    if is_zero(deck.angle):
        moved, deck = _upright(uv, deck, foot)
        moved -= 1j * moved[loops[0]].imag.mean()
        return moved, Deck(deck.angle, complex(deck.translation.real)), abs(deck.translation)
    length = _loop_length(surface, uv, sheet, deck)
    start, end, _ = _boundary_edges(surface, uv, sheet, deck)
    short = abs(deck.translation) <= NO_TRANSLATION * abs(end - start).min()
    return uv - uv[loops[0]].mean(), Deck(deck.angle, 0j if short else deck.translation), length


def _loop_length(surface: Surface, uv: Complexes, sheet: Ints, deck: Deck) -> float:
    """Geometric mean of the two loops' lengths in the domain; it does not depend on the cut."""
    start, end, first = _boundary_edges(surface, uv, sheet, deck)
    edge = np.abs(end - start)
    return float(np.sqrt(edge[first].sum()) * np.sqrt(edge[~first].sum()))


def _runs_around(apex: complex, surface: Surface, uv: Complexes, sheet: Ints, deck: Deck) -> bool:
    """Whether both loops turn about the apex by K. Where K is near 2πm, m ≠ 0, they may lie beside it, and
    turn by K − 2πm only."""
    start, end, first = _boundary_edges(surface, uv, sheet, deck)
    turn = np.angle((end - apex) / (start - apex))
    swept = turn[first].sum(), -turn[~first].sum()
    return bool(max(abs(angle - deck.angle) for angle in swept) < np.pi)


def _boundary_edges(
    surface: Surface, uv: Complexes, sheet: Ints, deck: Deck
) -> tuple[Complexes, Complexes, Bools]:
    """(k,) where the boundary edges start and end in some sheet, and which of them belong to loop 0."""
    boundary = np.flatnonzero(surface.twin < 0)
    flat, sheets = surface.faces.ravel(), sheet.ravel()
    start, end = (deck.apply(uv[flat[h]], sheets[h]) for h in (boundary, next_half_edge(boundary)))
    first = np.zeros(len(uv), dtype=bool)
    first[surface.loops[0]] = True
    return start, end, first[flat[boundary]]


def _upright(uv: Complexes, deck: Deck, foot: complex) -> tuple[Complexes, Deck]:
    """The foot of the cut at 0, its image under g on the positive real axis."""
    chord = complex(deck.apply(np.array([foot]))[0]) - foot
    turn = abs(chord) / chord
    return (uv - foot) * turn, Deck(deck.angle, chord * turn)


def _about(apex: complex, uv: Complexes, deck: Deck, foot: complex) -> tuple[Complexes, Deck]:
    """The apex at 0, the sheet symmetric to the positive imaginary axis."""
    turn = np.exp(1j * (np.pi - deck.angle) / 2) * abs(foot - apex) / (foot - apex)
    return (uv - apex) * turn, Deck(deck.angle, 0j)
