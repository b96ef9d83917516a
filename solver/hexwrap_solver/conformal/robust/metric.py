"""Angles and Hessian of a Delaunay metric on the mirrored annulus."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.conformal.energy import corner_angles
from hexwrap_solver.conformal.robust.delaunay import make_delaunay
from hexwrap_solver.conformal.robust.mirror import MirrorMesh

#: Edges whose cotangents add up to more than this, relative to their size and to 1, are Delaunay for sure.
CERTAIN = 1e-6


@dataclass(frozen=True)
class Metric:
    """Everything is indexed by half-edge and zero for the sides of crossing edges.

    start, end: (2e,) interior angle at the origin and at the end of the half-edge, in its triangle or
    trapezoid.
    cotangent: (2e,) of the angle that the half-edge is seen under.
    length: (e,) scaled log-lengths.
    """

    start: Floats
    end: Floats
    cotangent: Floats
    length: Floats


def measure_delaunay(mesh: MirrorMesh, u: Floats) -> tuple[Metric, int]:
    """The Delaunay metric with logarithmic factors u, and the number of flips that it took.

    Near a solution there are hardly any, and the cotangents that are needed anyway tell so.
    """
    metric = measure(mesh, u)
    one, other = metric.cotangent[::2], metric.cotangent[1::2]
    certain = (one + other > CERTAIN * (1 + np.abs(one) + np.abs(other))) & (one != 0) & (other != 0)
    certain &= ~(mesh.outer[::2] | mesh.outer[1::2] | mesh.crossing)
    flips = make_delaunay(mesh, u, doubtful=np.flatnonzero(~certain))
    return (measure(mesh, u), flips) if flips else (metric, 0)


def measure(mesh: MirrorMesh, u: Floats) -> Metric:
    """The metric with logarithmic factors u. Right where the mesh is Delaunay in it; triangles that break the
    triangle inequality have cotangents 0.

    Angles come from ratios of lengths, and these from differences of u: sums of large u would lose digits.
    """
    start, end, cotangent = (np.zeros(len(mesh.origin)) for _ in range(3))

    sides = mesh.triangles()
    opposite = u[mesh.origin[sides[[2, 0, 1]]]]
    side = mesh.log_length[sides >> 1] - (opposite - opposite[0]) / 2
    corners = corner_angles(np.exp(side - side.max(axis=0)))  # row k is opposite to side k
    start[sides] = corners.angle[[1, 2, 0]]
    end[sides] = corners.angle[[2, 0, 1]]
    cotangent[sides] = corners.cotangent()

    trapezoids = mesh.chain()
    following = mesh.next[trapezoids]
    side = mesh.log_length[trapezoids >> 1]
    slope = (u[mesh.origin[trapezoids]] - u[mesh.origin[following]]) / 2
    m = 0.5 * np.exp(mesh.cross_length(trapezoids, mesh.log_length) - side + slope)
    n = 0.5 * np.exp(mesh.cross_length(following, mesh.log_length) - side - slope)
    along = np.sqrt(np.maximum((1 - (n - m)) * (1 + (n - m)), 0.0))  # its share of the mirror line / side
    start[trapezoids] = np.arctan2(along, m - n)
    end[trapezoids] = np.arctan2(along, n - m)
    with np.errstate(divide="ignore"):
        cotangent[trapezoids] = np.where(along > 0, (m + n) / along, 0.0)
    return Metric(start, end, cotangent, mesh.scaled(u))


def angle_sums(mesh: MirrorMesh, metric: Metric) -> Floats:
    """(n,) angle sum at each vertex of the annulus (half of what the double has on the mirror line)."""
    total: Floats = np.bincount(mesh.origin, weights=metric.start, minlength=mesh.n).astype(np.float64)
    trapezoids = mesh.chain()
    following = mesh.next[trapezoids]
    total += np.bincount(mesh.origin[following], weights=metric.end[trapezoids], minlength=mesh.n)
    # both trapezoids at a boundary vertex reckon to its right angle with the mirror
    corner = trapezoids[mesh.cross[trapezoids] < 0]
    total[mesh.origin[corner]] -= np.pi
    return total


def edge_weights(metric: Metric, edges: Ints) -> Floats:
    """(k,) of edges that do not cross the mirror line: the Hessian is their graph Laplacian."""
    return np.asarray(0.5 * (metric.cotangent[2 * edges] + metric.cotangent[2 * edges + 1]))
