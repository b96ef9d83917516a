"""Surfaces with any number of loops and cones, and a judge of their maps."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from hexwrap_solver.arrays import Complexes, Floats, Ints, Ragged
from hexwrap_solver.conformal import boundary
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.surface import SentMesh, surface_from_mesh
from hexwrap_solver.surface.types import Surface

HEX = np.pi / 3


def sent(vertices: Floats, faces: Ints) -> Surface:
    return surface_from_mesh(SentMesh(vertices, Ragged.from_table(faces)))


def sphere(level: int, squash: Floats | None = None) -> Surface:
    """An icosahedron's faces split ``level`` times, its vertices on the ellipsoid with these half axes."""
    golden = (1 + np.sqrt(5)) / 2
    points = [[0, a, b * golden] for a, b in itertools.product((-1, 1), repeat=2)]
    vertices = np.array([np.roll(p, k) for p in points for k in range(3)], dtype=float)
    near = np.linalg.norm(vertices[:, None] - vertices, axis=2) < 2.1
    triples = [
        t
        for t in itertools.combinations(range(12), 3)
        if all(near[i, j] for i, j in itertools.combinations(t, 2))
    ]
    faces = np.array([t if np.linalg.det(vertices[list(t)]) > 0 else t[::-1] for t in triples])
    for _ in range(level):
        a, b, c = faces.T
        ends = np.sort(np.stack([np.stack([a, b]), np.stack([b, c]), np.stack([c, a])]), axis=1)
        edges, new = np.unique(ends.transpose(0, 2, 1).reshape(-1, 2), axis=0, return_inverse=True)
        p, q, r = len(vertices) + new.reshape(3, -1)
        vertices = np.concatenate([vertices, vertices[edges].mean(axis=1)])
        faces = np.concatenate([np.stack(t, axis=1) for t in ((a, p, r), (p, b, q), (r, q, c), (p, q, r))])
        vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    return sent(vertices * (squash if squash is not None else 1.0), faces)


def holed(surface: Surface, centres: Floats, radius: float) -> Surface:
    """Without the vertices within ``radius`` of the centres (k, 3)."""
    away = (np.linalg.norm(surface.vertices[:, None] - centres, axis=2) > radius).all(axis=1)
    return sent(surface.vertices, surface.faces[away[surface.faces].all(axis=1)])


def spread_points(surface: Surface, count: int, seed: int = 0) -> Ints:
    """Vertices inside, each as far as possible from those before, and from the boundary."""
    chosen = [int(np.random.default_rng(seed).integers(len(surface.vertices)))]
    distance = np.full(len(surface.vertices), np.inf)
    for loop in surface.loops:
        for v in loop[::3]:
            distance = np.minimum(distance, np.linalg.norm(surface.vertices - surface.vertices[v], axis=1))
    if len(surface.loops):
        chosen = [int(distance.argmax())]
    while len(chosen) < count:
        distance = np.minimum(
            distance, np.linalg.norm(surface.vertices - surface.vertices[chosen[-1]], axis=1)
        )
        chosen.append(int(distance.argmax()))
    return np.array(chosen[:count], dtype=np.int64)


def composed(net: Net, face: int, corner: int, twin: Ints) -> tuple[float, complex]:
    """Rotation and translation of the motions met on the way around a vertex inside, from a corner back to
    it."""
    turn, shift, f, c = 0.0, 0j, face, corner
    while True:
        h = 3 * f + (c + 2) % 3  # the half-edge that ends at the vertex
        motion = int(net.crossing.ravel()[h])
        shift += complex(np.exp(1j * turn) * net.translation[motion])
        turn += float(net.angle[motion])
        f, c = divmod(int(twin[h]), 3)
        if (f, c) == (face, corner):
            return turn, shift


def check(found: ConformalMap) -> None:
    """Everything that the contract says of a net."""
    net, surface = found.net, found.surface
    z, twin = net.corners, surface.twin
    a, b = z[:, 1] - z[:, 0], z[:, 2] - z[:, 0]
    assert ((np.conj(a) * b).imag > 0).all()
    u = found.log_scale[surface.faces]
    length = surface.lengths * np.exp((u + np.roll(u, -1, axis=1)) / 2)
    drawn = np.abs(np.roll(z, -1, axis=1) - z)
    rounding = 32 * np.finfo(float).eps * np.abs(z).max() / drawn  # corners far away have fewer digits
    assert found.flips or (np.abs(drawn / length - 1) < 1e-9 + rounding).all()
    face, c = np.nonzero(net.across >= 0)
    other, k = twin.reshape(-1, 3)[face, c] // 3, twin.reshape(-1, 3)[face, c] % 3
    motion = net.crossing[face, c]
    size = np.abs(z).max()
    for beside, here in ((z[other, (k + 1) % 3], z[face, c]), (z[other, k], z[face, (c + 1) % 3])):
        assert np.abs(net.apply(motion, beside) - here).max() < 1e-9 * size
    assert (net.across.ravel() == np.where(twin < 0, -1, twin // 3)).all()
    assert (net.inverse[net.crossing[other, k]] == motion).all()
    assert (
        np.abs(
            net.apply(net.inverse, net.apply(np.arange(len(net.angle)), np.full(1, 1 + 2j))) - 1 - 2j
        ).max()
        < 1e-9
    )
    sums = np.bincount(
        surface.faces.ravel(), np.angle(np.conj(np.roll(z, -1, 1) - z) * (np.roll(z, 1, 1) - z)).ravel()
    )
    told = np.full(len(sums), 2 * np.pi)
    told[found.cones.vertex] -= found.cones.curvature
    for loop, angles in zip(surface.loops, found.boundary_angles, strict=True):
        told[loop] = angles
    allowed = np.zeros(len(sums))
    np.maximum.at(allowed, surface.faces.ravel(), np.repeat(rounding.max(axis=1), 3))
    assert (np.abs(sums - told) < 1e-9 + allowed).all()
    total = (
        sum(float((np.pi - angles).sum()) for angles in found.boundary_angles) + found.cones.curvature.sum()
    )
    assert total == pytest.approx(boundary.gauss_bonnet(surface), abs=1e-8)
    for vertex, curvature in zip(found.cones.vertex, found.cones.curvature, strict=True):
        first = int(np.flatnonzero(surface.faces.ravel() == vertex)[0])
        turn, shift = composed(net, first // 3, first % 3, twin)
        assert (
            abs(np.exp(1j * turn) - np.exp(-1j * curvature)) < 1e-9
            or abs(np.exp(1j * turn) - np.exp(1j * curvature)) < 1e-9
        )
        place = z.ravel()[first]
        assert abs(np.exp(1j * turn) * place + shift - place) < 1e-9 * size


SPHERE = sphere(3, np.array([1.0, 1.2, 1.5]))
CENTRES = np.array([[0, 0, 1.5], [0, 0, -1.5], [1, 0, 0], [-1, 0, 0], [0, 1.2, 0]])


def flat(points: Complexes) -> Floats:
    return np.stack([points.real, points.imag, 0 * points.real], axis=1)


def disk(rings: int) -> tuple[Complexes, Ints]:
    """Hexagonal mesh of the unit disk: ring k has 6k vertices."""
    points, faces, first = [0j], [], 0
    for k in range(1, rings + 1):
        start = len(points)
        points += list(k / rings * np.exp(2j * np.pi * np.arange(6 * k) / (6 * k)))
        for s in range(6):
            for j in range(k):
                outer = [start + (s * k + j + d) % (6 * k) for d in (0, 1)]
                inner = [first + ((s * (k - 1) + j + d) % (6 * (k - 1)) if k > 1 else 0) for d in (0, 1)]
                faces.append([inner[0], outer[0], outer[1]])
                if j < k - 1:
                    faces.append([inner[0], outer[1], inner[1]])
        first = start
    return np.array(points), np.array(faces)
