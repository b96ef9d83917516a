"""Features as lines in the domain: which of them a lattice line can follow, and which are one together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Isometry, Lattice
from hexwrap_solver.pattern.place.sides import Sides
from hexwrap_solver.surface.features import FeatureEdges
from hexwrap_solver.surface.types import Feature, Surface
from hexwrap_solver.tolerances import RELATIVE

#: A feature that strays more from its own straight line than this part of the circumference is not made
#: straight.
WIDE = 0.05

#: Creases that were only seen on the mesh count where they are longer than this many cells, and where all of
#: them together leave as many between them: others are roughness, or a coarse mesh of a round surface.
LEAST_CELLS = 3.0

#: Directions at a vertex that differ by less (radians, relative to unit normals) are one.
PARALLEL = 1e-6


@dataclass(frozen=True)
class Chain:
    """A feature in the domain.

    feature: its number. vertex, sheet, place: (k,) its vertices, unrolled from the first one's own sheet on.
    axis: unit complex, the direction of its length on the whole; width: in the domain, between the parallels
    to that which hold it. length: in the domain.
    """

    feature: int
    vertex: Ints
    sheet: Ints
    place: Complexes
    axis: complex
    width: float
    length: float
    closed: bool

    @classmethod
    def of(cls, cmap: ConformalMap, number: int, feature: Feature, half_edge: Ints) -> Chain | None:
        """half_edge: its edges. None where the mesh of the map lacks one of them."""
        if len(half_edge) < len(feature.vertices) - 1:
            return None
        face, c = half_edge // 3, half_edge % 3
        gained = cmap.sheet[face, (c + 1) % 3] - cmap.sheet[face, c]
        sheet = np.concatenate([[0], np.cumsum(gained)])
        place = cmap.deck.apply(cmap.uv[feature.vertices], sheet)
        step = np.diff(place)
        length = float(abs(step).sum())
        axis = complex(np.exp(0.5j * np.angle((step**2 / abs(step)).sum())))
        if feature.closed and abs(place[-1] - place[0]) > 0.5 * cmap.circumference:
            axis = complex((place[-1] - place[0]) / abs(place[-1] - place[0]))
        width = float(np.ptp((place * np.conj(axis)).imag))
        return cls(number, feature.vertices, sheet, place, axis, width, length, feature.closed)


def worth_following(
    surface: Surface, features: tuple[Feature, ...], cell: float
) -> tuple[frozenset[int], tuple[str, ...]]:
    """Numbers of the features that cells of a size (the root of their area) can follow, and notes."""
    points = surface.vertices
    length = np.array([np.linalg.norm(np.diff(points[f.vertices], axis=0), axis=1).sum() for f in features])
    ends = np.array([(f.vertices[0], f.vertices[-1]) for f in features]).reshape(-1, 2)
    sure = np.array([f.given for f in features], dtype=bool)
    kept = np.ones(len(features), dtype=bool)
    inner = np.ones(len(points), dtype=bool)
    inner[surface.boundary] = False
    for _ in range(len(features)):  # what ends freely and is short goes, and then what that has left so
        degree = np.bincount(ends[kept].ravel(), minlength=len(points))
        free = ((degree[ends] == 1) & inner[ends]).any(axis=1)
        short = kept & ~sure & free & (length < LEAST_CELLS * cell)
        if not short.any():
            break
        kept &= ~short
    kept &= sure | (length >= 0.5 * cell) | ~np.isin(np.arange(len(features)), _alone(ends))
    seen = kept & ~sure
    a, b, c = np.moveaxis(points[surface.faces], 1, 0)
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    notes = []
    if seen.any() and area < LEAST_CELLS * cell * length[seen].sum():
        notes.append(
            f"The mesh folds along {length[seen].sum():.4g} of edges altogether, too close together for "
            "cells of this size to follow, so that none is: smaller cells, or features.angle above "
            f"{np.rad2deg(min(f.fold for f, s in zip(features, seen, strict=True) if s)):.0f}° would help."
        )
        kept &= sure
    left = len(features) - int(kept.sum())
    if left and not notes:
        what = "1 short fold of the mesh is" if left == 1 else f"{left} short folds of the mesh are"
        notes.append(f"{what} not followed: cells are longer.")
    return frozenset(np.flatnonzero(kept).tolist()), tuple(notes)


def _alone(ends: Ints) -> Ints:
    """Features that no other one meets."""
    degree = np.bincount(ends.ravel())
    met = degree[ends] - (ends[:, :1] == ends[:, 1:])
    return np.flatnonzero((met <= 1).all(axis=1))


def chains_of(cmap: ConformalMap, features: tuple[Feature, ...], wanted: frozenset[int]) -> list[Chain]:
    """Features of which the numbers are wanted, and that the mesh of an annulus or a disk still has."""
    numbers = sorted(wanted)
    edges = FeatureEdges.of(cmap.surface, [features[i] for i in numbers])
    own = np.split(edges.half_edge, np.searchsorted(edges.feature, np.arange(1, len(numbers))))
    found = (Chain.of(cmap, i, features[i], half_edge) for i, half_edge in zip(numbers, own, strict=False))
    return [chain for chain in found if chain is not None]


def narrow(chains: list[Chain], cmap: ConformalMap) -> list[Chain]:
    """Those straight enough to be made a line, and that go somewhere."""
    size = abs(cmap.circumference) or float(np.ptp(cmap.uv.real) + np.ptp(cmap.uv.imag))
    return [chain for chain in chains if chain.width <= min(WIDE * size, 0.5 * chain.length)]


def lasting(chains: list[Chain], surface: Surface, cell: float) -> Bools:
    """(c,) those that a line may follow: given, from loop to loop, or in one network with a piece, between
    two places where it branches, of at least LEAST_CELLS cells. Roughness of a mesh makes networks of short
    ones."""
    if not chains:
        return np.zeros(0, dtype=bool)
    ends = np.array([chain.vertex[[0, -1]] for chain in chains], dtype=np.int64)
    on_loop = np.zeros(len(surface.vertices), dtype=bool)
    on_loop[surface.boundary] = True
    passing = (np.bincount(ends.ravel(), minlength=len(on_loop)) == 2) & ~on_loop
    length = np.array([chain.length for chain in chains])
    piece = _together(ends, passing)
    lasts = np.bincount(piece, length)[piece] >= LEAST_CELLS * cell
    lasts |= np.array([surface.features[chain.feature].given for chain in chains], dtype=bool)
    lasts |= (ends[:, 0] != ends[:, 1]) & on_loop[ends].all(axis=1)
    network = _together(ends, ~on_loop)
    return np.asarray(np.bincount(network, lasts)[network] > 0)


def _together(ends: Ints, joined: Bools) -> Ints:
    """(c,) which of the chains with these ends (c, 2) hang together at vertices where they are joined."""
    chain, end = np.nonzero(joined[ends])
    at = csr_array((np.ones(len(chain)), (chain, ends[chain, end])), shape=(len(ends), len(joined)))
    return np.asarray(connected_components(at @ at.T, directed=False)[1])


@dataclass(frozen=True)
class FeatureLines:
    """Lines made of chains: sides, with their normals (s,). feature: (c,) of each chain; lean: (c,) by how
    much its axis is turned against them, radians; line: (c,) its side, −1 where it was left out because a
    third line would meet at one of its vertices."""

    sides: Sides
    normal: Complexes
    feature: Ints
    lean: Floats
    line: Ints

    @property
    def straight(self) -> frozenset[int]:
        return frozenset(self.feature[self.line >= 0].tolist())

    def lean_of(self, feature: int) -> float:
        return float(self.lean[self.feature == feature][0])


def lines_from(
    cmap: ConformalMap,
    chains: list[Chain],
    rotation: Isometry,
    zero: complex,
    turn: complex,
    sides: Sides,
    normal: Complexes,
) -> FeatureLines:
    """zero: direction of the lattice along the boundary. turn: of the domain onto the lattice. sides, normal:
    of the boundary."""
    lattice = rotation.lattice
    half = lattice.quantum / 2
    angle = np.array([np.angle(chain.axis * turn / zero) for chain in chains])
    steps = np.rint(angle / half)
    lean = angle - steps * half
    own = 1j * zero * np.exp(1j * half * steps)
    taken = _meet(chains, rotation, own, sides, normal)
    line, sheet = _united(chains, rotation, own, taken)
    kept = np.flatnonzero(line >= 0)
    first = np.array([kept[line[kept] == k][0] for k in range(int(line.max(initial=-1)) + 1)], dtype=np.int64)
    # All chains of a line in the frame of its first one.
    moved = [chains[i].sheet + sheet[i] for i in kept]
    count = np.array([len(chains[i].vertex) for i in kept], dtype=np.int64)
    vertex = np.concatenate([np.zeros(0, dtype=np.int64), *(chains[i].vertex for i in kept)])
    every = np.concatenate([np.zeros(0, dtype=np.int64), *moved])
    return FeatureLines(
        Sides(
            own[first] / (1j * turn),
            np.bincount(line[kept], [chains[i].length for i in kept], len(first)).astype(np.float64),
            np.full(len(first), -1),
            np.array(
                [any(chains[i].closed for i in kept if line[i] == k) for k in range(len(first))], dtype=bool
            ),
            vertex,
            np.repeat(line[kept], count),
            every,
            cmap.deck.apply(cmap.uv[vertex], every),
        ),
        own[first],
        np.array([chain.feature for chain in chains], dtype=np.int64),
        lean,
        line,
    )


def _entries(chains: list[Chain], rotation: Isometry, own: Complexes) -> tuple[Ints, Ints, Complexes, Ints]:
    """Vertices of all chains: (vertex, chain, normal in the vertex's own sheet, sheet)."""
    count = np.array([len(chain.vertex) for chain in chains], dtype=np.int64)
    which = np.repeat(np.arange(len(chains)), count)
    none = np.zeros(0, dtype=np.int64)
    vertex = np.concatenate([none, *(chain.vertex for chain in chains)])
    sheet = np.concatenate([none, *(chain.sheet for chain in chains)])
    turned = own[which] / np.exp(1j * rotation.lattice.step_angle * rotation.rotation(sheet))
    return vertex, which, turned, sheet


def _meet(chains: list[Chain], rotation: Isometry, own: Complexes, sides: Sides, normal: Complexes) -> Bools:
    """(c,) chains that can be lines together with the sides: at most two lines meet at a vertex, and none
    runs along a side. The shortest give way."""
    taken = np.ones(len(chains), dtype=bool)
    vertex, which, turned, _ = _entries(chains, rotation, own)
    at_side = normal[sides.side] / np.exp(1j * rotation.lattice.step_angle * rotation.rotation(sides.sheet))
    length = np.array([chain.length for chain in chains])
    for _ in range(len(chains)):
        on = taken[which]
        v = np.concatenate([sides.vertex, vertex[on]])
        owner = np.concatenate([np.full(len(sides.vertex), -1), which[on]])
        # Opposite normals are one line.
        square = np.concatenate([at_side, turned[on]]) ** 2
        key = np.rint(np.stack([square.real, square.imag]) / PARALLEL).astype(np.int64)
        _, line = np.unique(np.concatenate([v[None], key]), axis=1, return_inverse=True)
        line = line.ravel()
        mixed = np.zeros(int(line.max(initial=-1)) + 1, dtype=bool)
        of_side = np.unique(line[owner < 0])
        mixed[of_side] = True
        wrong = mixed[line] & (owner >= 0)
        lines_at = np.bincount(v[np.unique(line, return_index=True)[1]], minlength=int(v.max(initial=0)) + 1)
        wrong |= (lines_at[v] > 2) & (owner >= 0)
        if not wrong.any():
            break
        bad = np.unique(owner[wrong])
        taken[bad[np.argmin(length[bad])]] = False
    return taken


def _united(chains: list[Chain], rotation: Isometry, own: Complexes, taken: Bools) -> tuple[Ints, Ints]:
    """Parallel chains that share a vertex are one line: (c,) its number, and by how many sheets its frame is
    off the chain's."""
    line = np.full(len(chains), -1)
    sheet = np.zeros(len(chains), dtype=np.int64)
    vertex, which, turned, at = _entries(chains, rotation, own)
    order = np.argsort(vertex, kind="stable")
    v = vertex[order]
    shared = np.flatnonzero(np.bincount(vertex)[v] > 1) if len(v) else np.zeros(0, dtype=np.int64)
    links: dict[int, list[tuple[int, int]]] = {i: [] for i in range(len(chains))}
    for k in np.split(order[shared], np.flatnonzero(np.diff(v[shared])) + 1) if len(shared) else []:
        for i in k:
            for j in k:
                a, b = int(which[i]), int(which[j])
                along = (turned[i].conjugate() * turned[j]).real
                if a != b and taken[a] and taken[b] and abs(abs(along) - 1) < PARALLEL:
                    links[a].append((b, int(at[i] - at[j])))
    number = 0
    for start in np.flatnonzero(taken).tolist():
        if line[start] >= 0:
            continue
        line[start], stack = number, [start]
        while stack:
            a = stack.pop()
            for b, off in links[a]:
                if line[b] < 0:
                    line[b], sheet[b] = number, sheet[a] + off
                    stack.append(b)
        number += 1
    return line, sheet


def least_where_they_meet(cmap: ConformalMap, lattice: Lattice, chains: list[Chain]) -> tuple[Ints, Floats]:
    """Vertices inside at which three or more pieces of chains meet, and the least distortion, σ₁/σ₂ − 1,
    there once each chain lies along a line of the lattice, whatever the deformation: with r = target / actual
    angle of each sector between them, σ₁/σ₂ ≥ √(max r / min r); infinite where two would be one. Of
    cylinders; none elsewhere."""
    none = np.zeros(0, dtype=np.int64), np.zeros(0)
    along = cmap.deck.translation if cmap.kind == "cylinder" else 0j  # of disks it is 0
    if not along or not chains:
        return none
    fold = 4 * np.pi / lattice.quantum
    vertex, actual, target = [], [], []
    for chain in chains:
        step = np.diff(chain.place)
        lean = np.angle((chain.axis / along * abs(along)) ** fold) / fold
        for heading, end in ((step, slice(None, -1)), (-step, slice(1, None))):
            line = chain.axis * np.exp(-1j * lean)
            line = np.where((heading * np.conj(line)).real < 0, -line, line)
            vertex.append(chain.vertex[end])
            actual.append(heading)
            target.append(np.angle(line / heading))
    at, heading, off = np.concatenate(vertex), np.concatenate(actual), np.concatenate(target)
    inner = np.bincount(at, minlength=len(cmap.uv))[at] > 2
    inner &= ~np.isin(at, cmap.surface.boundary)
    order = np.lexsort((np.angle(heading), at))
    order = order[inner[order]]
    at, heading, off = at[order], heading[order], off[order]
    found, first, count = np.unique(at, return_index=True, return_counts=True)
    if not len(found):
        return none
    following = np.arange(1, len(at) + 1)
    following[first + count - 1] = first
    sector = np.angle(heading[following] / heading) % (2 * np.pi)
    ratio = np.maximum(sector + off[following] - off, 0.0) / np.maximum(sector, RELATIVE)
    high, low = np.maximum.reduceat(ratio, first), np.minimum.reduceat(ratio, first)
    return found, np.where(low > 1e-6, np.sqrt(high / np.maximum(low, 1e-12)) - 1, np.inf)
