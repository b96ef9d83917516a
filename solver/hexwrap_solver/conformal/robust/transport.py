"""Points carried through flips.

A point of a triangle (i, j, k) has homogeneous coordinates: weights of three vectors v_i, v_j, v_k in R³. On
the flat surface these are (x, y, 1) of the corners. In the hyperbolic structure that all discretely conformal
metrics share, they are light-like with ⟨v_i, v_j⟩ = −l_ij² / 2, where l is the length in the metric: inside
the circumcircle of a triangle, (corner − centre, radius). So in a metric in which edges are Delaunay, both
kinds of coordinates are the same, and from one metric to the next v_i grows by e^{u_i} (Springborn 2020;
Gillespie, Springborn, Crane 2021: maps that are projective between circumcircles).

Why the two agree: four points of a circle, written as light-like vectors, satisfy one linear relation, the
same that their places (x, y, 1) satisfy. With the vectors scaled as above, ⟨v_i, v_j⟩ = −l_ij²/2 says how
to read it off lengths. A flip of the diagonal ij of the quad (i, l, j, k) to kl expresses the old corner
that the point loses by the other three: v_l = β_i v_i + β_j v_j + β_k v_k. Products with v_j, v_i and v_k
give, since ⟨v, v⟩ = 0 and by Ptolemy's relation,

    β_i = l_lj l_kl / (l_ij l_ki),   β_j = l_il l_kl / (l_ij l_jk),   β_k = −l_lj l_il / (l_jk l_ki).

Of a point w_i v_i + w_j v_j + w_k v_k in the old triangle (i, j, k) one of the first two weights is taken
off: on the side of i, w_j = (w_j/β_j) β_j, so that (w_j/β_j) v_l replaces w_j v_j, and w_i and w_k change
by −(w_j/β_j) times β_i and β_k. The point lies on that side of kl where what is left of w_i is not
negative, and then all three new weights are positive: no subtraction of nearly equal numbers is left that
matters.

A trapezoid counts as a triangle (i, j, K): K is the unit vector at right angles to the mirror line, towards
the mirror; ⟨v_i, K⟩ = −m_i / 2 and ⟨K, K⟩ = 1, with m_i the length of the crossing edge at i. All kinds of
flips then put the other diagonal into a quad (i, l, j, k), any of which may be K, with the same relation,
where β_k < 0 < β_i, β_j. Down, the diagonal ij becomes the one from x to K (k = x, l = K). Up, the diagonal
from x to K becomes ij.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.conformal.robust import delaunay
from hexwrap_solver.conformal.robust.mirror import MirrorMesh


@dataclass(frozen=True)
class Places:
    """Points in pieces (triangles or trapezoids) of a mirrored mesh.

    half_edge: (k,) a side of each point's triangle, or the outer half-edge of its trapezoid.
    weight: (k, 3) of the vectors of its origin, its end, and its apex or K.
    power: (k,) which copy of the origin belongs to it, counted as ``MirrorMesh.winding`` is.
    """

    half_edge: Ints
    weight: Floats
    power: Ints


@dataclass(frozen=True)
class Flips:
    """Independent flips from the diagonal (I, J) between pieces (I, J, k) and (J, I, l) to (k, l).

    Of the old pieces, for any half-edge of theirs: old: (r,) half-edge. flip: (r,) the flip that replaces it.
    over: (r,) whether it is the piece at l. order: (r, 3) where the weights of I, J and k or l stand.
    shift: (r,) power of I minus power of the origin.
    Of the new pieces at I and at J: new: (2, f) half-edge. sort: (2, 3) which of (I or J, l, k) stand where.
    lead: (2, f) power of the origin minus power of I.
    relation: (f, 3) β of I, J and k.
    """

    old: Ints
    flip: Ints
    over: Bools
    order: Ints
    shift: Ints
    new: Ints
    sort: Ints
    lead: Ints
    relation: Floats


def transport(places: Places, rounds: Iterable[Flips], size: int) -> Places:
    """Where points of the first triangulation are in the last one. size: number of half-edges."""
    at, weight, power = places.half_edge.copy(), places.weight.copy(), places.power.copy()
    row = np.full(size, -1)
    for flips in rounds:
        row[flips.old] = np.arange(len(flips.old))
        hit = np.flatnonzero(row[at] >= 0)
        if len(hit):
            at[hit], weight[hit], power[hit] = _carried(flips, row[at[hit]], weight[hit], power[hit])
        row[flips.old] = -1
    return Places(at, weight, power)


def _carried(flips: Flips, row: Ints, weight: Floats, power: Ints) -> tuple[Ints, Floats, Ints]:
    """Points in old pieces ``row`` in the new pieces: half-edges, weights and powers."""
    f, over = flips.flip[row], flips.over[row]
    weight = np.take_along_axis(weight, flips.order[row], axis=1)
    beta = flips.relation[f]
    side = (weight[:, 0] * beta[:, 1] < weight[:, 1] * beta[:, 0]).astype(np.int64)  # 0 at I, 1 at J
    k = np.arange(len(row))
    ratio = weight[k, 1 - side] / beta[k, 1 - side]
    carried = np.stack(
        [
            np.maximum(weight[k, side] - ratio * beta[k, side], 0.0),
            ratio + np.where(over, weight[:, 2], 0.0),
            np.where(over, 0.0, weight[:, 2]) - ratio * beta[:, 2],
        ],
        axis=1,
    )
    carried = np.take_along_axis(carried, flips.sort[side], axis=1)
    return flips.new[side, f], carried, power + flips.shift[row] + flips.lead[side, f]


#: Finishes the record of flips after they are done: it gets the new lengths.
Finish = Callable[[Floats, bool], Flips]
#: Half-edges, whether they are sides of the piece at l, ``order``, ``shift``.
_Old = tuple[Ints, bool, tuple[int, int, int], Ints]
#: Half-edges, ``sort``, ``lead``.
_New = tuple[Ints, tuple[int, int, int], Ints]


def _record(old: Sequence[_Old], at_i: _New, at_j: _New, relation: Floats) -> Flips:
    count = len(at_i[0])
    return Flips(
        old=np.concatenate([half_edges for half_edges, _, _, _ in old]),
        flip=np.tile(np.arange(count), len(old)),
        over=np.repeat([over for _, over, _, _ in old], count),
        order=np.repeat([order for _, _, order, _ in old], count, axis=0),
        shift=np.concatenate([shift for _, _, _, shift in old]),
        new=np.stack([at_i[0], at_j[0]]),
        sort=np.array([at_i[1], at_j[1]]),
        lead=np.stack([at_i[2], at_j[2]]),
        relation=relation,
    )


def across(mesh: MirrorMesh, edges: Ints, length: Floats) -> Finish:
    """Triangles (i, j, k) and (j, i, l) become (i, l, k) and (j, k, l)."""
    h, t = 2 * edges, 2 * edges + 1
    h1, h2, t1, t2 = mesh.next[h], mesh.prev[h], mesh.next[t], mesh.prev[t]
    e, winding, none = length[edges], mesh.winding, np.zeros(len(edges), dtype=np.int64)
    old = (
        *_triangle(mesh, h),
        (t, True, (1, 0, 2), winding[t]),
        (t1, True, (0, 2, 1), none),
        (t2, True, (2, 1, 0), -winding[t1]),
    )
    at_i, at_j = (t1, (0, 1, 2), none), (h1, (0, 2, 1), winding[h])

    def finish(length: Floats, euclidean: bool) -> Flips:
        jk, ki, il, lj, kl = (length[x >> 1] for x in (h1, h2, t1, t2, h))
        if euclidean:
            apex, other = delaunay.apex_over(e, ki, jk), np.conj(delaunay.apex_over(e, il, lj))
            beta_k = other.imag / apex.imag
            beta_j = other.real - beta_k * apex.real
            return _record(old, at_i, at_j, np.stack([1 - beta_j - beta_k, beta_j, beta_k], axis=1))
        log_beta = np.stack([lj + kl - e - ki, il + kl - e - jk, lj + il - jk - ki], axis=1)
        return _record(old, at_i, at_j, np.exp(log_beta) * (1, 1, -1))

    return finish


def down(mesh: MirrorMesh, below: Ints, length: Floats) -> Finish:
    """Triangle (i, j, x) and trapezoid (j, i, K) become the trapezoids (x, i, K) and (j, x, K)."""
    edges, h = below >> 1, below ^ 1
    h1, h2 = mesh.next[h], mesh.prev[h]
    winding = mesh.winding
    old = (*_triangle(mesh, h), (below, True, (1, 0, 2), winding[below]))
    at_i, at_j = (h2, (2, 0, 1), -winding[h2]), (h1, (0, 2, 1), winding[h])
    e, m_j, m_i = length[edges], mesh.cross_length(below, length), mesh.cross_length(mesh.next[below], length)

    def finish(length: Floats, euclidean: bool) -> Flips:
        relation = _trapezoid_relation(e, length[h2 >> 1], length[h1 >> 1], m_i, m_j, euclidean)
        i, j, pole = relation.T  # of x; those of K are
        return _record(old, at_i, at_j, np.stack([-i, -j, np.ones_like(i)], axis=1) / pole[:, None])

    return finish


def up(mesh: MirrorMesh, edges: Ints, length: Floats) -> Finish:
    """Trapezoids (x, i, K) and (j, x, K) become triangle (x, i, j) and trapezoid (j, i, K)."""
    below, right = 2 * edges + 1, mesh.next[2 * edges]
    left = mesh.prev[right]
    winding, none = mesh.winding, np.zeros(len(edges), dtype=np.int64)
    old = (right, False, (0, 2, 1), none), (left, True, (1, 2, 0), winding[left])
    at_x, at_pole = (right, (0, 2, 1), none), (below, (1, 2, 0), -winding[left])
    m_j, m_i = mesh.cross_length(left, length), mesh.cross_length(mesh.next[right], length)

    def finish(length: Floats, euclidean: bool) -> Flips:
        relation = _trapezoid_relation(
            length[edges], length[right >> 1], length[left >> 1], m_i, m_j, euclidean
        )
        i, j, pole = relation.T  # of x; those of j are
        return _record(old, at_x, at_pole, np.stack([np.ones_like(i), -pole, -i], axis=1) / j[:, None])

    return finish


def _triangle(mesh: MirrorMesh, h: Ints) -> tuple[_Old, _Old, _Old]:
    """The triangle (I, J, k) to the left of half-edges from I to J."""
    second, third = mesh.next[h], mesh.prev[h]
    return (
        (h, False, (0, 1, 2), np.zeros(len(h), dtype=np.int64)),
        (second, False, (2, 0, 1), -mesh.winding[h]),
        (third, False, (1, 2, 0), mesh.winding[third]),
    )


def _trapezoid_relation(
    ij: Floats, xi: Floats, xj: Floats, m_i: Floats, m_j: Floats, euclidean: bool
) -> Floats:
    """(f, 3) β with v_x = β_i v_i + β_j v_j + β_K K, from log-lengths."""
    if euclidean:
        slope = (np.exp(m_j - ij) - np.exp(m_i - ij)) / 2  # K is (−slope, −along) where i = 0, j = 1
        x = delaunay.apex_over(ij, xi, xj)
        drop = x.imag / delaunay.along_mirror(slope)
        beta_j = x.real - drop * slope
        return np.stack([1 - beta_j, beta_j, -np.exp(ij) * drop], axis=1)
    diagonal = 0.5 * np.logaddexp(2 * ij, m_i + m_j)
    both = xi + xj - diagonal
    beta_i, beta_j = np.logaddexp(2 * xj, both + m_j) - 2 * ij, np.logaddexp(2 * xi, both + m_i) - 2 * ij
    return np.stack([np.exp(beta_i), np.exp(beta_j), -np.exp(both)], axis=1)
