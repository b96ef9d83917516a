"""The smallest smooth deformation of the layout that brings sides of the domain onto lattice lines.

Unknown are the vertices W in lattice units, with the deck transformation an exact motion of the lattice.
Least squares over the triangles of √area · (|∂W/∂z̄|² + SIZE·|∂W/∂z − a|²): the first for angles
(least-squares conformal maps, Lévy et al. 2002), the second, lightly, for sizes. Vertices on a side slide
along their line; corners stand where two lines meet. Lines are met exactly, whatever the least squares leave.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg, splu

from hexwrap_solver.arrays import Complexes, Floats
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Motion

#: Weight of sizes against angles.
SIZE = 0.1

#: Rounds of reweighting, by which the sum of squares nears one of fourth powers, and its least weight: what
#: the triangles at corners bear is spread over more of them (worst ratios of 0.04 for 0.18, 0.21 for 0.6).
ROUNDS, FLOOR = 4, 1e-2

#: Pull towards the undeformed place, relative: it only settles what nothing else does.
REST = 1e-9

#: Unknowns up to which the system is factorised; beyond, a number of conjugate-gradient steps must do.
DIRECT, STEPS = 60_000, 150


def deform(
    cmap: ConformalMap, motion: Motion, scale: complex, rest: Complexes, normal: Complexes, depth: Floats
) -> Complexes:
    """(n,) vertices in lattice units.

    rest: (n,) where they would stand undeformed. normal, depth: (n, 2) up to two lines Re(conj(normal)·W) =
    depth that each vertex must lie on; normal 0 where there is none.
    """
    basis, fixed = _freedom(normal, depth, rest)
    angles, sizes, area, shift_a, shift_s = _derivatives(cmap, motion)
    conformal, similar = _real(angles) @ basis, _real(sizes) @ basis
    aim_a = _parts(-shift_a) - _real(angles) @ _parts(fixed)
    aim_s = _parts(scale - shift_s) - _real(sizes) @ _parts(fixed)
    start = basis.T @ _parts(rest - fixed)  # the basis is orthonormal
    weight = np.sqrt(area / area.sum())
    n, best, least = len(rest), rest, np.inf
    free = start
    for _ in range(ROUNDS):
        both = np.tile(weight, 2)
        matrix = conformal.T @ (both[:, None] * conformal) + SIZE * (similar.T @ (both[:, None] * similar))
        right = conformal.T @ (both * aim_a) + SIZE * (similar.T @ (both * aim_s))
        pull = REST * float(matrix.diagonal().mean())
        matrix = (matrix + pull * sparse.eye_array(matrix.shape[0])).tocsc()
        free = _solve(matrix, right + pull * start, free)
        moved = basis @ free
        place = np.asarray(fixed + moved[:n] + 1j * moved[n:])
        worst = distortion_of(cmap, motion, place)
        if worst < least or best is rest:
            best, least = place, worst
        bent = abs(angles @ place + shift_a) ** 2
        # Half-way in the logarithm: full steps of reweighting oscillate for powers above three.
        aim = np.sqrt(area / area.sum()) * (bent / max(bent.mean(), 1e-300) + FLOOR)
        weight = np.sqrt(weight * aim)
        weight /= weight.mean()
    return best


def distortion_of(cmap: ConformalMap, motion: Motion, place: Complexes) -> float:
    """Worst ratio of singular values − 1 over the triangles; infinite where one is turned over."""
    angles, sizes, _, shift_a, shift_s = _derivatives(cmap, motion)
    bent = np.abs(np.asarray(angles @ place) + shift_a)
    kept = np.abs(np.asarray(sizes @ place) + shift_s)
    if (bent >= kept).any():
        return float("inf")
    return float(((kept + bent) / (kept - bent)).max() - 1)


def _solve(matrix: sparse.csc_array, right: Floats, start: Floats) -> Floats:
    if matrix.shape[0] <= DIRECT:
        factors = splu(
            matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        return np.asarray(factors.solve(right))
    inverse = 1 / matrix.diagonal()
    jacobi = LinearOperator(matrix.shape, matvec=lambda x: inverse * x, dtype=float)
    return np.asarray(cg(matrix, right, x0=start, rtol=1e-8, maxiter=STEPS, M=jacobi)[0])


def _parts(z: Complexes) -> Floats:
    return np.concatenate([z.real, z.imag])


def _real(matrix: sparse.csr_array) -> sparse.csr_array:
    """A complex linear map on (real parts, imaginary parts)."""
    return sparse.csr_array(sparse.block_array([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]]))


def _derivatives(
    cmap: ConformalMap, motion: Motion
) -> tuple[sparse.csr_array, sparse.csr_array, Floats, Complexes, Complexes]:
    """∂/∂z̄ and ∂/∂z per triangle as matrices on W with what the motion's translations add, and areas."""
    z = cmap.corners()
    faces, sheet = cmap.surface.faces, cmap.sheet
    m, n = len(faces), len(cmap.uv)
    opposite = np.roll(z, -2, axis=1) - np.roll(z, -1, axis=1)
    area = ((z[:, 1] - z[:, 0]).conj() * (z[:, 2] - z[:, 0])).imag / 2
    gradient = 1j * opposite / (4 * area)[:, None]
    shift = motion.lattice.position(motion.apply(np.zeros((m, 3, 2), dtype=np.int64), sheet))
    turn = np.exp(1j * motion.lattice.quantum * motion.rotation(sheet))
    where = (np.repeat(np.arange(m), 3), faces.ravel())
    conformal, size = ((g * turn).ravel() for g in (gradient, gradient.conj()))
    return (
        sparse.csr_array((conformal, where), shape=(m, n)),
        sparse.csr_array((size, where), shape=(m, n)),
        np.asarray(area),
        np.asarray((gradient * shift).sum(axis=1)),
        np.asarray((gradient.conj() * shift).sum(axis=1)),
    )


def _freedom(normal: Complexes, depth: Floats, rest: Complexes) -> tuple[sparse.csr_array, Complexes]:
    """Orthonormal basis (2n, unknowns) of the movements left to the vertices, and a place on the lines."""
    n = len(rest)
    lines = (normal != 0).sum(axis=1)
    fixed = np.zeros(n, dtype=complex)
    one, two = np.flatnonzero(lines == 1), np.flatnonzero(lines == 2)
    first = normal[one][np.arange(len(one)), np.argmax(normal[one] != 0, axis=1)]
    at = depth[one][np.arange(len(one)), np.argmax(normal[one] != 0, axis=1)]
    fixed[one] = first * at
    p, q = normal[two].T
    d, e = depth[two].T
    fixed[two] = 1j * (e * p - d * q) / (p.conj() * q).imag
    free = np.flatnonzero(lines == 0)
    f, k = len(free), len(one)
    along = 1j * first
    rows = np.concatenate([free, free + n, one, one + n])
    columns = np.concatenate([np.arange(2 * f), 2 * f + np.arange(k), 2 * f + np.arange(k)])
    values = np.concatenate([np.ones(2 * f), along.real, along.imag])
    return sparse.csr_array((values, (rows, columns)), shape=(2 * n, 2 * f + k)), fixed
