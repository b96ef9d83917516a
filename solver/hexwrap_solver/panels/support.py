"""Support structure with torsion-free nodes (paper, conclusion).

At every corner of the pattern stands a node axis; a beam between two nodes is the ruled strip between their
axes, and it is flat when det(e_ij, a_i, a_j) = 0. (Node axes from intersected panel planes run to infinity
where the surface is flat; here the axes are the nearest possible to the surface normals instead.)
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from hexwrap_solver.arrays import Floats, Ints, Progress, no_progress
from hexwrap_solver.geometry import angles_between, dot, normalize, plane_axes
from hexwrap_solver.linalg.normal_matrix import NormalMatrix
from hexwrap_solver.panels.types import Support
from hexwrap_solver.pattern.types import Pattern

#: Greatest |det| of unit vectors that counts as no torsion.
TORSION_TOLERANCE = 1e-13

#: Steps of the iteration; it converges quadratically where a torsion-free structure exists.
MOST_STEPS = 30

#: Axes tilted from the normal by more than this tangent are of no use; the search ends before.
MOST_TILT = 1.0

#: Added to the constraints' Gram matrix (entries of order 1), for patterns with more edges than freedom.
REGULARIZATION = 1e-12


def support(pattern: Pattern, depth: float, progress: Progress = no_progress) -> Support:
    """Node axes nearest to the surface normals with no torsion on any edge; beams go inwards by ``depth``.

    With a_i = n_i + x_i t_i + y_i b_i (t, b tangential), Σ x² + y² is minimised under the determinants by
    successive linearisation. Hexagons have four unknowns for every three edges and reach zero; quads have as
    many unknowns as edges and triangles fewer: what torsion remains is in the result.
    """
    edges = _edges(pattern)
    along = normalize(pattern.vertices[edges[:, 1]] - pattern.vertices[edges[:, 0]])
    frame = plane_axes(pattern.normals)
    shift = np.zeros((len(pattern.vertices), 2))
    best, least = shift, np.inf
    gram = NormalMatrix(pattern.vertices[edges].mean(axis=1))
    weight = np.ones(2 * len(shift))
    for step in range(MOST_STEPS):
        axes = pattern.normals + np.einsum("pe,ped->pd", shift, frame)
        twist = _twist(along, axes, edges)
        if np.abs(shift).max(initial=0.0) > MOST_TILT:
            break
        if np.abs(twist).max(initial=0.0) < least:
            best, least = shift, float(np.abs(twist).max(initial=0.0))
        if least < TORSION_TOLERANCE or np.abs(twist).max() > 10 * least:
            break
        progress(step / MOST_STEPS, f"turning node axes, torsion {least:.1e}")
        jacobian = _jacobian(along, axes, frame, edges)
        gram.factorise(csr_array(jacobian.T), weight, REGULARIZATION)
        shift = (jacobian.T @ gram.solve(jacobian @ shift.ravel() - twist)).reshape(-1, 2)
    axes = normalize(pattern.normals + np.einsum("pe,ped->pd", best, frame))
    return _finish(pattern, edges, along, axes, depth)


def _edges(pattern: Pattern) -> Ints:
    """(e, 2) each edge of the pattern once."""
    halves = pattern.half_edges
    once = np.flatnonzero((halves.twin < 0) | (np.arange(len(halves.twin)) < halves.twin))
    return np.stack([halves.start[once], halves.end[once]], axis=1)


def _twist(along: Floats, axes: Floats, edges: Ints) -> Floats:
    """(e,) det(e_ij, a_i, a_j)."""
    return dot(along, np.cross(axes[edges[:, 0]], axes[edges[:, 1]]))


def _jacobian(along: Floats, axes: Floats, frame: Floats, edges: Ints) -> csr_array:
    """Derivatives of the determinants by x_i, y_i."""
    i, j = edges.T
    by_first = np.einsum("ped,pd->pe", frame[i], np.cross(axes[j], along))
    by_second = np.einsum("ped,pd->pe", frame[j], np.cross(along, axes[i]))
    row = np.repeat(np.arange(len(edges)), 4)
    column = np.stack([2 * i, 2 * i + 1, 2 * j, 2 * j + 1], axis=1).ravel()
    value = np.concatenate([by_first, by_second], axis=1).ravel()
    return csr_array((value, (row, column)), shape=(len(edges), 2 * len(axes)))


def _finish(pattern: Pattern, edges: Ints, along: Floats, axes: Floats, depth: float) -> Support:
    i, j = edges.T
    p, q = pattern.vertices[i], pattern.vertices[j]
    a, b = np.cross(along, axes[i]), np.cross(along, axes[j])
    torsion = angles_between(a, b)
    tilt = angles_between(axes, pattern.normals)
    strips = np.stack([p, q, q - depth * axes[j], p - depth * axes[i]], axis=1)
    return Support(pattern.vertices, axes, edges, strips, torsion, tilt)
