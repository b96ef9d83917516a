"""Flips to the Delaunay triangulation of the mirrored annulus, whole independent sets at a time.

An edge is Delaunay where the cosines of the two angles opposite to it add up to at least zero. With lengths
that break triangle inequalities the same expression still decides (Penner coordinates): once all edges pass,
all triangle inequalities hold (Gu, Luo, Sun, Wu 2018; Springborn 2020).

Lengths of flipped edges come in two kinds. ``euclidean``: those of the piecewise flat surface itself, which
it keeps. ``ptolemy``: l_e' = (l_a l_c + l_b l_d) / l_e, those of the hyperbolic structure that all discretely
conformal metrics share (Gillespie, Springborn, Crane 2021). The latter are sums of positive terms, taken in
logarithms: no cancellation and no overflow, however strong the grading.

Mirror symmetry leaves three kinds of flips, each one or several symmetric flips of the double:

``across``: two front triangles (i, j, k) and (j, i, l) get the diagonal kl. Ptolemy: l_kl l_ij = l_jk l_il +
l_ki l_jl.

``down``: a triangle (i, j, x) is flipped away over its edge ij, below which the mirror lies. The trapezoid
there is the isosceles trapezoid (j, i, i', j') with sides e = ij = i'j', crossing edges m_i = ii' and m_j
= jj', and diagonals d = ij' = ji', so d² = e² + m_i m_j (Ptolemy in the trapezoid, which has a
circumcircle). Three flips in the double bring the edge xx': ij becomes xj' or xi' in the hexagon (x, i,
i', x', j', j), the mirror image likewise, and last the middle one. Written out, with a = xi and b = xj,

    m_x = (a² m_j + b² m_i + 2 a b d) / e².

In Euclidean lengths the height of x is that of i, plus what the
edge from i to x rises: the triangle's apex in the frame of ij, turned by the slope of ij against the mirror.

``up``: the reverse. The crossing edge xx' goes; the trapezoids below jx and xi become the triangle (i, j, x)
and the trapezoid below ij. Of the same hexagon, with d_b² = b² + m m_j and d_a² = a² + m m_i the diagonals of
the two trapezoids,

    l_ij = (a d_b + b d_a) / m,

Ptolemy's relation for the quad (j, x, i, x') with diagonals ij and xx', whose sides are b, a, and d_a = ix',
d_b = jx'. In Euclidean lengths ij is the sum of two vectors: their parts along the mirror, and their slopes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.robust.mirror import MirrorMesh, link, lower, raise_
from hexwrap_solver.errors import ConvergenceError

#: An edge passes whose cosines add up to more than −TOLERANCE times the terms that they are made of: rounding
#: must not flip it to and fro.
TOLERANCE = 2e-14
#: Logarithms above this size have rounding that exceeds it, in proportion to their size.
LARGE = 10.0
#: Height over base of a triangle whose lengths are those of a flat one to rounding.
FLATTEST = 1e-14
#: Rounds of independent flips before something must be wrong; meshes seen so far need some dozens.
MAX_ROUNDS = 4_000

#: Flips independent edges of a mesh, and sets their scaled log-lengths: euclidean ones, or Ptolemy's.
Flip = Callable[[MirrorMesh, Ints, Floats, bool], None]


def cosine_sums(mesh: MirrorMesh, edges: Ints, length: Floats) -> tuple[Floats, Floats]:
    """(k,) sum of the cosines of the two angles opposite to each edge, in log-lengths ``length`` (e,), and
    (k,) the sum of the absolute values of all terms that it was computed from."""
    crossing = mesh.crossing[edges]
    plus, minus = np.zeros(len(edges)), np.zeros(len(edges))
    plain = edges[~crossing]
    sides = _opposite_cosine(mesh, np.concatenate([2 * plain, 2 * plain + 1]), length)
    plus[~crossing], minus[~crossing] = (x.reshape(2, -1).sum(axis=0) for x in sides)
    if len(plain) == len(edges):
        return plus - minus, plus + minus
    right = mesh.next[2 * edges[crossing]]
    left = mesh.prev[right]
    middle = length[edges[crossing]]
    one = _trapezoid_cosine(length[left >> 1], middle, mesh.cross_length(left, length))
    other = _trapezoid_cosine(length[right >> 1], middle, mesh.cross_length(mesh.next[right], length))
    plus[crossing], minus[crossing] = one[0] + other[0], one[1] + other[1]
    return plus - minus, plus + minus


def _opposite_cosine(mesh: MirrorMesh, h: Ints, length: Floats) -> tuple[Floats, Floats]:
    """Cosine of the angle that half-edges are seen under in their triangle or trapezoid, as minuend and
    subtrahend."""
    plus, minus = np.zeros(len(h)), np.zeros(len(h))
    outer = mesh.outer[h]
    inner = h[~outer]
    e, a, b = length[inner >> 1], length[mesh.next[inner] >> 1], length[mesh.prev[inner] >> 1]
    plus[~outer], minus[~outer] = np.cosh(a - b), 0.5 * np.exp(2 * e - a - b)
    if len(inner) == len(h):
        return plus, minus
    trapezoids = h[outer]
    m, n = mesh.cross_length(trapezoids, length), mesh.cross_length(mesh.next[trapezoids], length)
    diagonal = 0.5 * np.logaddexp(2 * length[trapezoids >> 1], m + n)
    plus[outer] = 0.5 * (np.exp(m - diagonal) + np.exp(n - diagonal))
    return plus, minus


def _trapezoid_cosine(side: Floats, middle: Floats, far: Floats) -> tuple[Floats, Floats]:
    """Cosine of the angle that a crossing edge is seen under from across a trapezoid, as minuend and
    subtrahend.

    side: the trapezoid's front edge. far: its other crossing edge.
    """
    diagonal = 0.5 * np.logaddexp(2 * side, middle + far)
    both = side + diagonal
    return np.exp(side - diagonal) + 0.5 * np.exp(middle + far - both), 0.5 * np.exp(2 * middle - both)


def make_delaunay(
    mesh: MirrorMesh,
    u: Floats,
    *,
    euclidean: bool = False,
    doubtful: Ints | None = None,
    do: Flip | None = None,
) -> int:
    """Flips until every edge is Delaunay in the metric with logarithmic factors u. Returns the number of
    flips.

    euclidean: keep the piecewise flat metric of u = 0 (then u must vanish). doubtful: the edges that may not
    be Delaunay at first, where known. do: ``flip``, or what does the same. Raises ConvergenceError if
    rounding keeps it from ending.
    """
    length = mesh.scaled(u)
    edges = np.arange(len(length)) if doubtful is None else doubtful
    total = 0
    tolerance = TOLERANCE * max(1.0, float(np.abs(length).max()) / LARGE)
    for _ in range(MAX_ROUNDS):
        cosines, terms = cosine_sums(mesh, edges, length)
        bad = edges[cosines < -tolerance * (1 + terms)]
        if not len(bad):
            return total
        now, claims = _independent(mesh, bad)
        (do or flip)(mesh, now, length, euclidean)
        total += len(now)
        mesh.log_length[now] = length[now] - (u[mesh.origin[2 * now]] + u[mesh.origin[2 * now + 1]]) / 2
        edges = _around(mesh, claims, bad)
    raise ConvergenceError(
        f"{total} edge flips did not reach a Delaunay triangulation: the surface has edges or angles that "
        "double precision cannot tell apart; remesh it more evenly."
    )


def _claims(mesh: MirrorMesh, edges: Ints) -> Ints:
    """(k, 6) the half-edges whose links or lengths a flip of each edge reads or changes."""
    h, t = 2 * edges, 2 * edges + 1
    flipped = ~mesh.outer[t]
    h, t = np.where(flipped, h, t), np.where(flipped, t, h)  # an outer side becomes h
    q = mesh.next[2 * edges]
    crossing = mesh.crossing[edges]
    h = np.where(crossing, q, h)
    second = np.where(crossing, mesh.prev[q], t)
    return np.stack(
        [h, mesh.next[h], mesh.prev[h], second, mesh.next[second], mesh.prev[second]],
        axis=1,
    )


def _independent(mesh: MirrorMesh, edges: Ints) -> tuple[Ints, Ints]:
    """A set of edges no two of which touch the same triangle or trapezoid, greedy by a scrambled order."""
    claims = _claims(mesh, edges)
    rank = (edges * 2654435761) % 4294967291  # neighbours in the numbering must not wait for each other
    best = np.full(len(mesh.origin), np.iinfo(np.int64).max)
    np.minimum.at(best, claims.ravel(), np.repeat(rank, 6))
    chosen = (best[claims] == rank[:, None]).all(axis=1)
    return edges[chosen], claims[chosen]


def _around(mesh: MirrorMesh, claims: Ints, bad: Ints) -> Ints:
    """The bad edges, of which some have been flipped, and all whose angles these flips may have changed."""
    h = claims.ravel()
    outer = h[mesh.outer[h]]
    cross = np.concatenate([mesh.cross[outer], mesh.cross[mesh.next[outer]]])
    return np.unique(np.concatenate([bad, h >> 1, cross[cross >= 0]]))


def flip(mesh: MirrorMesh, edges: Ints, length: Floats, euclidean: bool) -> None:
    """Flips independent edges; ``length`` (e,) gets the new scaled log-lengths."""
    across, up, below = kinds(mesh, edges)
    for kind, which in ((_flip_up, up), (_flip_down, below), (_flip_across, across)):
        if len(which):
            kind(mesh, which, length, euclidean)
    mesh.flipped()


def kinds(mesh: MirrorMesh, edges: Ints) -> tuple[Ints, Ints, Ints]:
    """Edges to be flipped across and up, and the outer half-edges of those that go down."""
    crossing = mesh.crossing[edges]
    lowest = ~crossing & (mesh.outer[2 * edges] | mesh.outer[2 * edges + 1])
    low = edges[lowest]
    return edges[~(crossing | lowest)], edges[crossing], np.where(mesh.outer[2 * low], 2 * low, 2 * low + 1)


def _flip_across(mesh: MirrorMesh, edges: Ints, length: Floats, euclidean: bool) -> None:
    h, t = 2 * edges, 2 * edges + 1
    h1, h2, t1, t2 = mesh.next[h], mesh.prev[h], mesh.next[t], mesh.prev[t]
    e, jk, ki, il, lj = (length[x >> 1] for x in (h, h1, h2, t1, t2))
    if euclidean:
        one, two = apex_over(e, ki, jk), apex_over(e, il, lj)
        length[edges] = e + np.log(np.abs(one - np.conj(two)))
    else:
        length[edges] = np.logaddexp(jk + il, ki + lj) - e
    mesh.origin[h], mesh.origin[t] = mesh.origin[t2], mesh.origin[h2]
    mesh.winding[h] = mesh.winding[t2] + mesh.winding[h1]
    mesh.winding[t] = -mesh.winding[h]
    link(mesh, h, h2, t1)
    link(mesh, t, t2, h1)


def _flip_down(mesh: MirrorMesh, below: Ints, length: Floats, euclidean: bool) -> None:
    edges, h = below >> 1, below ^ 1
    h1, h2 = mesh.next[h], mesh.prev[h]  # i → j is h, the apex x stands at the origin of h2
    m_j, m_i = mesh.cross_length(below, length), mesh.cross_length(mesh.next[below], length)
    e, b, a = length[edges], length[h1 >> 1], length[h2 >> 1]
    if euclidean:
        slope = (np.exp(m_j - e) - np.exp(m_i - e)) / 2
        along = along_mirror(slope)
        apex = apex_over(e, a, b)
        length[edges] = e + np.log(np.exp(m_i - e) + 2 * (apex.real * slope + apex.imag * along))
    else:
        diagonal = 0.5 * np.logaddexp(2 * e, m_i + m_j)
        length[edges] = (
            np.logaddexp(np.logaddexp(2 * a + m_j, 2 * b + m_i), np.log(2.0) + a + b + diagonal) - 2 * e
        )
    lower(mesh, below)


def _flip_up(mesh: MirrorMesh, edges: Ints, length: Floats, euclidean: bool) -> None:
    right = mesh.next[2 * edges]
    left = mesh.prev[right]
    m_i, m_j = mesh.cross_length(left, length), mesh.cross_length(mesh.next[right], length)
    m = length[edges]
    a, b = length[left >> 1], length[right >> 1]
    if euclidean:
        first, second = (np.exp(m - a) - np.exp(m_i - a)) / 2, (np.exp(m_j - b) - np.exp(m - b)) / 2
        along = along_mirror(first) + np.exp(b - a) * along_mirror(second)
        length[edges] = a + np.log(np.hypot(along, first + np.exp(b - a) * second))
    else:
        length[edges] = (
            np.logaddexp(a + 0.5 * np.logaddexp(2 * b, m + m_j), b + 0.5 * np.logaddexp(2 * a, m + m_i)) - m
        )
    raise_(mesh, 2 * edges + 1)


def apex_over(base: Floats, left: Floats, right: Floats) -> Complexes:
    """Apex of triangles over the unit segment 0–1 from log-lengths; ``left`` is the side at 0."""
    a, b = np.exp(left - base), np.exp(right - base)
    x = (1 + (a - b) * (a + b)) / 2
    one = np.ones_like(a)
    small, mid, big = np.sort(np.stack([one, a, b]), axis=0)  # Kahan: subtract close lengths first
    square = (big + (mid + small)) * (small - (big - mid)) * (small + (big - mid)) * (big + (mid - small))
    return np.asarray(x + 1j * np.maximum(0.5 * np.sqrt(np.maximum(square, 0.0)), FLATTEST))


def along_mirror(slope: Floats) -> Floats:
    """The part of a unit edge that runs along the mirror line, from the part that runs away from it."""
    return np.asarray(np.sqrt(np.maximum((1 - slope) * (1 + slope), 0.0)))
