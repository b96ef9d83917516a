"""The smallest smooth deformation of the layout that brings sides of the domain onto lattice lines.

Unknown are the vertices W in lattice units, the motions of the domain being exact isometries of the lattice.
Least squares over the triangles of √area · (|∂W/∂z̄|² + SIZE·|∂W/∂z − a|²): the first for angles
(least-squares conformal maps, Lévy et al. 2002), the second, lightly, for sizes. Vertices on a side slide
along their line; corners stand where two lines meet. Lines are met exactly, whatever the least squares leave.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.linalg.factor import Factorisation
from hexwrap_solver.linalg.normal_matrix import RIDGE
from hexwrap_solver.pattern.place.glued import Glued
from hexwrap_solver.pattern.place.meeting import meeting
from hexwrap_solver.tolerances import TINY

#: Weight of sizes against angles.
SIZE = 0.1

#: Rounds of reweighting, by which the sum of squares nears one of fourth powers, and its least weight: what
#: the triangles at corners bear is spread over more of them (worst ratios of 0.04 for 0.18, 0.21 for 0.6).
#: Gathered, it nears one of powers of 3/2 over the surface: what the cells beside a fold bear is not spread,
#: so that others stay regular (a tower with setbacks is covered to 92 % instead of 86 %).
ROUNDS, FLOOR = 4, 1e-2
#: Below this worst ratio of singular values − 1, a round that gains nothing is the last one.
FINE = 0.03
#: Where no triangle bears more than this many times the root mean square, there is nothing to spread.
EVEN = 1.1

#: Pull towards the undeformed place, relative: it only settles what nothing else does.
REST = 1e-9


def deform(
    system: System,
    glued: Glued,
    scale: complex,
    rest: Complexes,
    depth: Floats,
    *,
    gathered: bool = False,
) -> tuple[Complexes, float]:
    """(n,) vertices in lattice units, on the lines of the system, and what ``distortion_of`` says of them.

    glued: with the rotations of the system's. rest: (n,) where the vertices would stand undeformed, with
    scale = ∂W/∂z. depth: (n, 2) of the lines. gathered: where little of the surface bears it, instead of
    spread until no triangle bears much.
    """
    change, freedom = system.change, system.freedom
    shift = change.of_shift(glued.shift)
    fixed = freedom.place_on_lines(depth)
    start = freedom.basis.T @ _parts(rest - fixed)  # the basis is orthonormal
    angles, sizes = change.of(fixed, shift)
    if gathered:
        part = weight = system.cmap.surface.areas / system.cmap.surface.areas.sum()
        for _ in range(ROUNDS):
            place = fixed + system.solve(weight, -angles, scale - sizes, start)
            bent, kept = change.strains(place, shift)
            weight = part / np.sqrt(bent / abs(scale) + FLOOR)
            weight /= weight.mean()
        return place, _worst(bent, kept)
    even = np.sqrt(change.area / change.area.sum())
    weight, best, least = even, rest, np.inf
    for _ in range(ROUNDS):
        place = fixed + system.solve(weight, -angles, scale - sizes, start)
        bent, kept = change.strains(place, shift)
        worst = _worst(bent, kept)
        if worst < least or best is rest:
            best, least = place, worst
        elif least <= FINE:
            break
        if bent.max() <= EVEN * np.sqrt((bent**2).mean()):
            break
        # Half-way in the logarithm: full steps of reweighting oscillate for powers above three.
        weight = np.sqrt(weight * even * (bent**2 / max((bent**2).mean(), TINY) + FLOOR))
        weight /= weight.mean()
    return best, least


def distortion_of(cmap: ConformalMap, glued: Glued, place: Complexes) -> float:
    """Worst ratio of singular values − 1 over the triangles; infinite where one is turned over."""
    change = derivatives(cmap, glued)
    return _worst(*change.strains(place, change.of_shift(glued.shift)))


def _worst(bent: Floats, kept: Floats) -> float:
    if (bent >= kept).any():
        return float("inf")
    return float(((kept + bent) / (kept - bent)).max() - 1)


@dataclass(frozen=True)
class Derivatives:
    """angles, sizes: (m, n) complex matrices, ∂W/∂z̄ and ∂W/∂z of the triangles from W at the vertices, the
    translations of the deck transformation left out. gradient: (m, 3). area: (m,) in the domain."""

    angles: sparse.csr_array
    sizes: sparse.csr_array
    gradient: Complexes
    area: Floats

    def of(self, place: Complexes, shift: tuple[Complexes, Complexes]) -> tuple[Complexes, Complexes]:
        """(m,) ∂W/∂z̄ and ∂W/∂z for W (n,); or (m, k) for (n, k)."""
        return np.asarray(self.angles @ place) + shift[0], np.asarray(self.sizes @ place) + shift[1]

    def strains(self, place: Complexes, shift: tuple[Complexes, Complexes]) -> tuple[Floats, Floats]:
        """(m,) absolute values of both."""
        angles, sizes = self.of(place, shift)
        return np.asarray(np.abs(angles)), np.asarray(np.abs(sizes))

    def of_shift(self, shift: Complexes) -> tuple[Complexes, Complexes]:
        """(m,) what translations (m, 3) of the triangles' corners add to ∂W/∂z̄ and ∂W/∂z."""
        return (self.gradient * shift).sum(axis=1), (self.gradient.conj() * shift).sum(axis=1)


def derivatives(cmap: ConformalMap, glued: Glued) -> Derivatives:
    """They depend on the rotations alone."""
    z = cmap.corners()
    faces = cmap.surface.faces
    m, n = len(faces), len(cmap.surface.vertices)
    opposite = np.roll(z, -2, axis=1) - np.roll(z, -1, axis=1)
    area = ((z[:, 1] - z[:, 0]).conj() * (z[:, 2] - z[:, 0])).imag / 2
    gradient = 1j * opposite / (4 * area)[:, None]
    where = (np.repeat(np.arange(m), 3), faces.ravel())
    angles, sizes = (
        sparse.csr_array(((g * glued.turn).ravel(), where), shape=(m, n)) for g in (gradient, gradient.conj())
    )
    return Derivatives(angles, sizes, gradient, np.asarray(area))


@dataclass(frozen=True)
class Freedom:
    """basis: (2n, unknowns), orthonormal, of the movements that lines leave to the vertices (real parts, then
    imaginary parts); vertex: (unknowns,) that each belongs to. unknown, way: (n, 2) the unknowns of each
    vertex, −1 where there is none, and in which direction it moves with them. normal: (n, 2) of the lines."""

    basis: sparse.csr_array
    vertex: Ints
    unknown: Ints
    way: Complexes
    normal: Complexes

    @classmethod
    def of(cls, normal: Complexes) -> Freedom:
        n = len(normal)
        lines = (normal != 0).sum(axis=1)
        free, one = np.flatnonzero(lines == 0), np.flatnonzero(lines == 1)
        along = 1j * normal[one].sum(axis=1)  # the other one is 0
        f, k = len(free), len(one)
        unknown, way = np.full((n, 2), -1), np.zeros((n, 2), dtype=complex)
        unknown[free], way[free] = np.stack([np.arange(f), f + np.arange(f)], axis=1), (1, 1j)
        unknown[one, 0], way[one, 0] = 2 * f + np.arange(k), along
        vertex, which = np.nonzero(unknown >= 0)
        column, step = unknown[vertex, which], way[vertex, which]
        rows = np.concatenate([vertex, vertex + n])
        values = np.concatenate([step.real, step.imag])
        basis = sparse.csr_array((values, (rows, np.tile(column, 2))), shape=(2 * n, 2 * f + k))
        return cls(basis, np.concatenate([free, free, one]), unknown, way, normal)

    def place_on_lines(self, depth: Floats) -> Complexes:
        """(n,) a place on each vertex's lines, linear in their depths (n, 2); 0 where there is none."""
        p, q = self.normal.T
        d, e = np.where(self.normal != 0, depth, 0.0).T
        both = (p != 0) & (q != 0)
        place = p * d + q * e
        place[both] = meeting(p[both], d[both], q[both], e[both])
        return np.asarray(place)


class System:
    """The least-squares problem for all choices of depths, and its factorised normal matrix."""

    def __init__(self, cmap: ConformalMap, glued: Glued, normal: Complexes) -> None:
        """glued: of which the rotations alone matter. normal: (n, 2) up to two lines
        Re(conj(normal)·W) = depth that each vertex must lie on; normal 0 where there is none."""
        self.cmap = cmap
        self.change = derivatives(cmap, glued)
        self.freedom = freedom = Freedom.of(normal)
        self._adjoints = [
            sparse.csr_array(part.conj().T.tocsr()) for part in (self.change.angles, self.change.sizes)
        ]
        # What each triangle adds to the normal matrix if its weight is 1, for its six unknowns (6, m).
        faces, n = cmap.surface.faces, len(freedom.vertex)
        unknown = freedom.unknown[faces].reshape(-1, 6).T
        way = freedom.way[faces] * glued.turn[:, :, None]
        gradient = self.change.gradient[:, :, None]
        angles, sizes = ((part * way).reshape(-1, 6).T for part in (gradient, gradient.conj()))
        self._unknown = np.where(unknown < 0, n, unknown)
        self._square = abs(angles) ** 2 + SIZE * abs(sizes) ** 2
        i, j = np.nonzero(
            np.arange(6)[:, None] // 2 > np.arange(6) // 2
        )  # those of one corner are orthogonal
        both, self._face = np.nonzero((unknown[i] >= 0) & (unknown[j] >= 0))
        one, other = (i[both], self._face), (j[both], self._face)
        self._product = (angles[one].conj() * angles[other] + SIZE * sizes[one].conj() * sizes[other]).real
        low, high = np.minimum(unknown[one], unknown[other]), np.maximum(unknown[one], unknown[other])
        pairs, self._pair = np.unique(low * n + high, return_inverse=True)
        self._factor = Factorisation(cmap.surface.vertices[freedom.vertex], pairs // n, pairs % n)
        self._last: Floats | None = None
        self._pull = 0.0

    def solve(self, weight: Floats, angles: Complexes, sizes: Complexes, start: Floats) -> Complexes:
        """(n,) movements within the freedom whose ∂/∂z̄ and ∂/∂z come nearest to the given ones, (m,), the
        triangles weighted with (m,). Or (n, k) for k of all, (m, k). Equal weights one after the other are
        factorised once."""
        if not len(start):  # every vertex is a corner
            return np.zeros((len(self.freedom.normal), *angles.shape[1:]), dtype=complex)
        if self._last is None or not np.array_equal(weight, self._last):
            n = len(start)
            diagonal = np.bincount(self._unknown.ravel(), (weight * self._square).ravel(), n + 1)[:n]
            self._pull = REST * float(diagonal.mean())
            products = np.bincount(self._pair, weights=weight[self._face] * self._product)
            self._factor.factorise(np.asarray(diagonal * (1 + RIDGE) + self._pull), np.asarray(products))
            self._last = weight
        aims = ((weight * angles.T).T, SIZE * (weight * sizes.T).T)
        right = self._adjoints[0] @ aims[0] + self._adjoints[1] @ aims[1]
        found = self._factor.solve(self.freedom.basis.T @ _parts(np.asarray(right)) + self._pull * start)
        moved = self.freedom.basis @ found
        n = len(moved) // 2
        return np.asarray(moved[:n] + 1j * moved[n:])


def _parts(z: Complexes) -> Floats:
    return np.concatenate([z.real, z.imag])
