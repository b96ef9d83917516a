"""The regular polygon nearest to a cell, in closed form.

With the corner angles θ_i = 2πi/p, a = (2/p) Σ cos θ_i p_i and b = (2/p) Σ sin θ_i p_i, the sum of squared
distances between the cell's corners p_i and those of a regular polygon of given size is least when its
centre is the centroid and its axes are the polar factor of the 3×2 matrix [a b] for every size; the best
circumradius is then (σ₁ + σ₂)/2. (An orthogonal Procrustes problem with scale; Schönemann and Carroll 1970.)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ragged
from hexwrap_solver.geometry import cross, dot, lengths, normalize


@dataclass(frozen=True)
class Poses:
    """Where regular polygons lie. center, x_axis, y_axis: (q, 3); the axes are orthonormal.

    Corner i of a polygon with edge ℓ stands at center + ℓ·(corners(p)[i] · [x_axis, y_axis]).
    free_length: (q,) edge length of the nearest regular polygon of any size. outline: (q, p, 2) corners at
    edge length 1 where the polygons are not regular.
    """

    center: Floats
    x_axis: Floats
    y_axis: Floats
    free_length: Floats
    outline: Floats | None = None

    @property
    def normal(self) -> Floats:
        return cross(self.x_axis, self.y_axis)

    def spokes(self, p: int) -> Floats:
        """(q, p, 3) from the centre to the corners of polygons of edge length 1."""
        if self.outline is not None:
            return np.asarray(np.einsum("qpe,eqd->qpd", self.outline, np.stack([self.x_axis, self.y_axis])))
        return np.asarray(np.einsum("pe,eqd->qpd", corners(p), np.stack([self.x_axis, self.y_axis])))


def outline_areas(spokes: Ragged) -> Floats:
    """(q,) areas of polygons from the centre to the corners."""
    if not spokes.n_rows:
        return np.zeros(0)
    spoke = np.asarray(spokes.values, dtype=np.float64)
    vector = cross(spoke, spoke.take(spokes.next(), axis=0)) / 2
    return lengths(np.add.reduceat(vector, spokes.offsets[:-1]))


def bending(outline: Complexes) -> int:
    """Corners of an outline (p,) that are not straight."""
    ahead = np.roll(outline, -1) - outline
    return int((abs((np.roll(ahead, 1).conj() * ahead).imag) > 1e-6).sum())


def corners(p: int) -> Floats:
    """(p, 2) corners of the regular p-gon of edge length 1 around the origin, the first on the x axis."""
    angle = 2 * np.pi * np.arange(p) / p
    corner: Floats = np.stack([np.cos(angle), np.sin(angle)], axis=1) / (2 * np.sin(np.pi / p))
    return corner


def nearest_regular(points: Floats) -> Poses:
    """points: (q, p, 3) corners of the cells, in order. Their nearest regular polygons."""
    a, b = _moments(points)
    g11, g12, g22 = dot(a, a), dot(a, b), dot(b, b)
    # Square root of the 2×2 Gram matrix G by Cayley–Hamilton: √G = (G + √det G) / √(tr G + 2 √det G).
    root_det = lengths(cross(a, b))
    trace_root = np.sqrt(g11 + g22 + 2 * root_det)
    scale = 1 / (root_det * trace_root)
    s11, s12, s22 = g11 + root_det, g12, g22 + root_det
    x_axis = (s22[:, None] * a - s12[:, None] * b) * scale[:, None]
    y_axis = (s11[:, None] * b - s12[:, None] * a) * scale[:, None]
    return _orthonormal(points, x_axis, y_axis, trace_root)


def nearest_regular_in_plane(points: Floats, normal: Floats) -> Poses:
    """The same with the planes' unit normals (q, 3) given."""
    a, b = _moments(points)
    a = a - dot(a, normal)[:, None] * normal
    b = b - dot(b, normal)[:, None] * normal
    # In the plane the best rotation turns every direction θ_i to Σ z_i e^{−iθ_i}, that is to a − n×b.
    x_axis = a - cross(normal, b)
    length = lengths(x_axis)
    x_axis /= length[:, None]
    return _orthonormal(points, x_axis, cross(normal, x_axis), length)


def nearest_copy(points: Floats, outline: Floats, normal: Floats | None = None) -> Poses:
    """The same for copies of any polygon, outline (p, 2) with mean 0, that begin at whichever corner fits
    best; in planes of unit normals (q, 3) where these are given."""
    p = len(outline)
    starts = [np.roll(outline, -k, axis=0) for k in range(p)]
    tried = [_copy(points, start, normal) for start in starts]
    best = np.argmax([one.free_length for one in tried], axis=0)
    pick = best, np.arange(len(points))
    x_axis = np.stack([one.x_axis for one in tried])[pick]
    y_axis = np.stack([one.y_axis for one in tried])[pick]
    length = np.stack([one.free_length for one in tried])[pick]
    return Poses(points.mean(axis=1), x_axis, y_axis, length, np.stack(starts)[best])


def copies(points: Floats, outline: Floats, normal: Floats | None = None) -> Poses:
    """The same for a polygon each, outline (q, p, 2) with mean 0, corners in order."""
    return replace(_copy(points, outline, normal), center=points.mean(axis=1), outline=outline)


def _copy(points: Floats, outline: Floats, normal: Floats | None) -> Poses:
    """With the corners in order: the axes are the polar factor of Σ p_i q_iᵀ. outline: (p, 2) or (q, p, 2).
    The centres are 0."""
    centred = points - points.mean(axis=1, keepdims=True)
    moment = np.einsum("qid,qie->qde", centred, np.broadcast_to(outline, (*points.shape[:2], 2)))
    squares = (outline**2).sum(axis=(-2, -1))
    if normal is not None:
        moment -= normal[:, :, None] * np.einsum("qd,qde->qe", normal, moment)[:, None]
        a, b = moment[..., 0], moment[..., 1]
        x_axis = a - np.cross(normal, b)
        length = np.linalg.norm(x_axis, axis=1)
        x_axis = x_axis / np.where(length > 0, length, 1.0)[:, None]
        return Poses(centred[:, 0], x_axis, np.cross(normal, x_axis), length / squares)
    u, sigma, vt = np.linalg.svd(moment, full_matrices=False)
    axes = u @ vt
    return Poses(centred[:, 0], axes[..., 0], axes[..., 1], sigma.sum(axis=1) / squares)


def _orthonormal(points: Floats, x_axis: Floats, y_axis: Floats, trace: Floats) -> Poses:
    """Makes the axes orthonormal to the last bit that matters; trace: σ₁ + σ₂."""
    x_axis = normalize(x_axis)
    y_axis = normalize(y_axis - dot(x_axis, y_axis)[:, None] * x_axis)
    return Poses(_means(points), x_axis, y_axis, trace * np.sin(np.pi / points.shape[1]))


def _means(points: Floats) -> Floats:
    """(q, 3) of the corners (q, p, 3)."""
    return np.ascontiguousarray(np.ascontiguousarray(points.T).mean(axis=1).T)


def _moments(points: Floats) -> tuple[Floats, Floats]:
    p = points.shape[1]
    angle = 2 * np.pi * np.arange(p) / p
    # Centred first: far from the origin the cosines alone would cancel digits away.
    corner = np.ascontiguousarray(points.T)
    a, b = (
        np.array([np.cos(angle), np.sin(angle)]) @ (corner - corner.mean(axis=1, keepdims=True))
    ).swapaxes(0, 1)
    return a.T * (2 / p), b.T * (2 / p)
