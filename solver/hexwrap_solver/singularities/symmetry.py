"""Symmetries of a surface, and the seats that they carry into each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.singularities.linear import distance_to, vertex_areas
from hexwrap_solver.singularities.types import Rules
from hexwrap_solver.surface.types import Surface

#: A symmetry carries no point further from the surface than this many cells.
OFF = 0.15
#: Points that are tried; rotations by a full turn over up to this many; planes through an axis of which none
#: is known.
TRIED, FOLDS, PLANES = 150, 8, 48
#: Principal moments that differ by less than this part are equal.
ALIKE = 0.02


@dataclass(frozen=True)
class Group:
    """name: for people. maps: (g, 3, 3) orthogonal matrices about ``center``, the identity first."""

    name: str
    maps: Floats
    center: Floats

    def images(self, places: Floats) -> Floats:
        """(g, k, 3) of places (k, 3)."""
        return np.asarray(np.einsum("gij,kj->gki", self.maps, places - self.center) + self.center)


def symmetries(surface: Surface, cell: float) -> list[Group]:
    """Groups of symmetries that keep every loop: of each mirror plane, of each axis, and of two planes at
    right angles; the largest first."""
    area = vertex_areas(surface)
    center = area @ surface.vertices / area.sum()
    probe = _Probe(surface, center, cell)
    off = surface.vertices - center
    moments, axes = np.linalg.eigh(np.einsum("n,ni,nj->ij", area, off, off) / area.sum())
    alike = np.diff(moments) < ALIKE * moments[1:]
    turns, planes = [], [Group("a mirror plane", np.stack([np.eye(3), _mirror(n)]), center) for n in axes.T]
    for i, axis in enumerate(axes.T):
        for n in range(FOLDS, 1, -1):
            angles = np.arange(n) * 2 * np.pi / n
            turns.append(
                Group(f"turns by 1/{n}", np.stack([_rotation(axis, angle) for angle in angles]), center)
            )
        if alike[max(i - 1, 0)] if i != 1 else alike.all():  # the other two axes are arbitrary
            planes += [
                Group("a mirror plane", np.stack([np.eye(3), _mirror(n)]), center) for n in probe.planes(axis)
            ]
    found = [group for group in planes if probe.holds(group.maps[1])]
    for one in range(len(found)):
        for other in range(one + 1, len(found)):
            product = found[one].maps[1] @ found[other].maps[1]
            if np.allclose(product, product.T, atol=1e-3) and not np.allclose(product, np.eye(3), atol=0.1):
                maps = np.stack([np.eye(3), found[one].maps[1], found[other].maps[1], product])
                found.append(Group("two mirror planes", maps, center))
                break
    found += [group for group in turns if probe.holds(group.maps[1])]
    return sorted(found, key=lambda group: -len(group.maps))


def _mirror(normal: Floats) -> Floats:
    return np.asarray(np.eye(3) - 2 * np.outer(normal, normal))


def _rotation(axis: Floats, angle: float) -> Floats:
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


class _Probe:
    """Tries whether a map carries a surface and each of its loops to themselves."""

    def __init__(self, surface: Surface, center: Floats, cell: float) -> None:
        self.surface, self.center, self.most = surface, center, OFF * cell
        step = max(1, len(surface.vertices) // TRIED)
        self.points = surface.vertices[np.lexsort(surface.vertices.T)[::step]]
        self.loops = []
        for loop in surface.loops:
            line = surface.vertices[np.append(loop, loop[0])]
            self.loops.append((line[:: max(1, len(loop) // 24)], line))

    def off(self, matrix: Floats, points: Floats) -> Floats:
        """(k,) how far from the surface the points come."""
        moved = (points - self.center) @ matrix.T + self.center
        return np.asarray(self.surface.tree.nearest(moved).distance)

    def holds(self, matrix: Floats) -> bool:
        for few, line in self.loops:
            if distance_to((few - self.center) @ matrix.T + self.center, line).max() > self.most:
                return False
        return bool(self.off(matrix, self.points).max() <= self.most)

    def planes(self, axis: Floats) -> Iterator[Floats]:
        """Normals of planes through an axis that mirror the surface best."""
        one = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
        one /= np.linalg.norm(one)
        two = np.cross(axis, one)

        def normal(angle: float) -> Floats:
            return np.asarray(np.cos(angle) * one + np.sin(angle) * two)

        def cost(angle: float) -> float:
            return float(self.off(_mirror(normal(angle)), self.points[::3]).mean())

        angles = np.arange(PLANES) * np.pi / PLANES
        best = angles[int(np.argmin([cost(angle) for angle in angles]))]
        step = np.pi / PLANES
        near = scipy.optimize.minimize_scalar(cost, bounds=(best - step, best + step), method="bounded")
        yield normal(float(near.x) if near.fun < cost(best) else best)


def orbits(surface: Surface, seats: Ints, group: Group, rules: Rules) -> list[Ints]:
    """Vertices that the group carries into each other (as near as there are vertices), one list per orbit, no
    two nearer than singularities may be. A seat near a mirror plane or an axis goes onto it."""
    tree, least = cKDTree(surface.vertices), rules.apart * rules.cell
    places = surface.vertices[seats]
    images = group.images(places)
    near = np.linalg.norm(images - places, axis=2) < least
    middle = (images * near[:, :, None]).sum(axis=0) / near.sum(axis=0)[:, None]
    vertex = np.asarray(tree.query(group.images(middle))[1], dtype=np.int64)
    inner = np.ones(len(surface.vertices), dtype=bool)
    inner[surface.boundary] = False
    found: dict[tuple[int, ...], Ints] = {}
    for members in vertex.T:
        at = np.unique(members)
        if not inner[at].all() or tuple(at.tolist()) in found:
            continue
        apart = cdist(surface.vertices[at], surface.vertices[at])
        # Images on a plane or an axis may come to neighbouring vertices: one of them stands for all.
        at = at[[i for i in range(len(at)) if not (apart[i, :i] < 0.5 * rules.cell).any()]]
        apart = cdist(surface.vertices[at], surface.vertices[at]) + np.diag(np.full(len(at), np.inf))
        if (apart >= least).all():
            found[tuple(at.tolist())] = at
    # Neighbouring seats in different copies of the group's domain give nearly the same orbit twice.
    kept: list[Ints] = []
    taken = np.zeros((0, 3))
    gap = 0.4 * np.sqrt(vertex_areas(surface).sum() / max(len(seats), 1))
    for at in found.values():
        if not len(taken) or cdist(surface.vertices[at], taken).min() > gap:
            kept.append(at)
            taken = np.concatenate([taken, surface.vertices[at]])
    return kept
