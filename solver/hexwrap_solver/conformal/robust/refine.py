"""Splitting edges of a surface where straight triangles cannot follow the map.

New vertices lie on edges of the old mesh, so the surface stays the same point set.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, positions
from hexwrap_solver.conformal.energy import corner_angles, opposite_lengths
from hexwrap_solver.conformal.robust.retriangulate import flatten_out
from hexwrap_solver.conformal.types import Targets
from hexwrap_solver.geometry import dot, normalize
from hexwrap_solver.surface.flips import angle_sums_opposite
from hexwrap_solver.surface.nurbs import evaluate_points
from hexwrap_solver.surface.topology import half_edges
from hexwrap_solver.surface.types import Feature, Surface
from hexwrap_solver.tolerances import ANGLE

#: A boundary vertex with target angle Θ gets at least Θ / FULLEST triangles.
FULLEST = 0.95 * np.pi
#: Where triangles are flipped, boundary vertices get enough triangles for a mean angle below this.
WIDE = 0.45 * np.pi
#: After this many attempts, half of it.
HASTE = 3
#: Edges are split between these places of their length.
WITHIN = (0.02, 0.98)
MIDDLE = (0.3, 0.7)
#: From this ratio of target and angle on, and with this share of the target, a corner counts as opened wide.
OPENED, BROAD = 1.5, 0.25 * np.pi
#: Opposite angles that add up to more than this call for a split, radians.
FLAT = np.deg2rad(210.0)
#: Rounds of it between two solutions.
SPREAD = 12
#: Edges of coarse meshes are halved so many times at most.
HALVINGS = 10


@dataclass(frozen=True)
class Problem:
    """A surface with targets for its vertices. u: (n,) logarithmic factors to start from.
    parent: (m,) the face of the unrefined mesh that each face is a part of."""

    surface: Surface
    targets: Targets
    u: Floats
    parent: Ints


def split_edges(problem: Problem, marked: Ints, place: Floats) -> Problem:
    """Splits edges at given places; values at vertices are interpolated.

    marked: (k,) half-edges, any number per face; of two sides of one edge the first counts. place: (k,) in
    (0, 1) from the start of the half-edge to its end. On the boundary new vertices get target angle π, and
    share the unknown that both ends share.
    """
    surface, targets = problem.surface, problem.targets
    faces, twin, n = surface.faces, surface.twin, len(surface.vertices)
    tail, head = half_edges(faces)
    h, s = once_per_edge(surface, marked, place)
    i, j = tail[h], head[h]
    new = n + np.arange(len(h))
    point = np.full(faces.size, -1, dtype=np.int64)
    point[h] = new
    inner = twin[h] >= 0
    point[twin[h][inner]] = new[inner]

    def blend(values: Floats) -> Floats:
        w = s.reshape(-1, *[1] * (values.ndim - 1))
        return np.concatenate([values, (1 - w) * values[i] + w * values[j]])

    normals = blend(surface.normals)
    normals[n:] = normalize(normals[n:])
    vertices = blend(surface.vertices)
    parts, source = _subdivide(faces, point.reshape(-1, 3), vertices)
    parent = problem.parent[source]
    refined = replace(
        surface,
        vertices=vertices,
        faces=flatten_out(vertices, parts, parent),
        loops=tuple(_extend(loop, h, new, tail, inner) for loop in surface.loops),
        input_vertex=np.concatenate([surface.input_vertex, np.full(len(h), -1, dtype=np.int64)]),
        normals=normals,
        patch=None if surface.patch is None else surface.patch[source],
        parameters=_blend_parameters(surface, i, j, s),
        features=_along_splits(surface.features, i, j, new),
    )
    shared = np.where(inner | (targets.shared[i] != targets.shared[j]), -1, targets.shared[i])
    counts = np.bincount(shared[shared >= 0], minlength=len(targets.shared_angle))
    grown = Targets(
        np.concatenate([targets.angle, np.where(inner, 2 * np.pi, np.pi)]),
        np.concatenate([targets.shared, shared]),
        targets.shared_angle + np.pi * counts,
        None if targets.offset is None else blend(targets.offset),
    )
    return Problem(refined, grown, blend(problem.u), parent)


def fine_enough(surface: Surface, vertices: int) -> Surface:
    """The same surface with so many vertices at least, for singularities to stand at and u to vary."""
    longest = float(np.sqrt(surface.areas.sum() / vertices))
    for _ in range(HALVINGS):
        long = np.flatnonzero(surface.lengths.ravel() > longest)
        if len(surface.vertices) >= vertices or not len(long):
            break
        surface = split(surface, long)
    return surface


def split(surface: Surface, marked: Ints) -> Surface:
    """Edges halved, with new vertices on the NURBS surface where there is one."""
    n, m = len(surface.vertices), len(surface.faces)
    unused = Targets(np.zeros(n), np.full(n, -1, dtype=np.int64), np.zeros(0))
    problem = Problem(surface, unused, np.zeros(n), np.arange(m))
    finer = split_edges(problem, marked, np.full(len(marked), 0.5)).surface
    if surface.nurbs is None or finer.parameters is None:
        return finer
    vertices = finer.vertices.copy()
    vertices[n:] = evaluate_points(surface.nurbs, finer.parameters[n:])
    return replace(finer, vertices=vertices)


def once_per_edge(surface: Surface, marked: Ints, place: Floats) -> tuple[Ints, Floats]:
    """The half-edges (and places) that ``split_edges`` gives a new vertex each, in the order of these."""
    twin = surface.twin[marked]
    _, first = np.unique(np.where(twin >= 0, np.minimum(marked, twin), marked), return_index=True)
    return marked[first], place[first]


def _subdivide(faces: Ints, point: Ints, vertices: Floats) -> tuple[Ints, Ints]:
    """Faces with 0 to 3 split edges become 1 to 4 faces. point: (m, 3) new vertex on the edge from corner
    c."""
    count = (point >= 0).sum(axis=1)
    lead = np.where(
        count == 1, (point >= 0).argmax(axis=1), np.where(count == 2, ((point < 0).argmax(axis=1) + 1) % 3, 0)
    )
    turned = (lead[:, None] + np.arange(3)) % 3
    (a, b, c), (p, q, r) = np.take_along_axis(faces, turned, 1).T, np.take_along_axis(point, turned, 1).T
    parts, source = [faces[count == 0]], [np.flatnonzero(count == 0)]

    def add(which: Bools, *triangles: tuple[Ints, Ints, Ints]) -> None:
        parts.extend(np.stack([x[which] for x in triangle], axis=1) for triangle in triangles)
        source.extend([np.flatnonzero(which)] * len(triangles))

    add(count == 1, (a, p, c), (p, b, c))
    two = count == 2  # p on ab, q on bc: the quad a p q c by its shorter diagonal
    reach = np.zeros(len(faces), dtype=bool)
    reach[two] = np.linalg.norm(vertices[a[two]] - vertices[q[two]], axis=1) <= np.linalg.norm(
        vertices[p[two]] - vertices[c[two]], axis=1
    )
    add(two, (p, b, q))
    add(two & reach, (a, p, q), (a, q, c))
    add(two & ~reach, (a, p, c), (p, q, c))
    add(count == 3, (a, p, r), (p, b, q), (q, c, r), (p, q, r))
    return np.concatenate(parts), np.concatenate(source)


def _extend(loop: Ints, h: Ints, new: Ints, tail: Ints, inner: Bools) -> Ints:
    """A loop with its new vertices, each after the start of the boundary edge that it splits."""
    place = positions(loop, max(int(loop.max()), int(tail.max())) + 1)
    here = ~inner & (place[tail[h]] >= 0)
    return np.insert(loop, place[tail[h[here]]] + 1, new[here])


def _along_splits(features: tuple[Feature, ...], i: Ints, j: Ints, new: Ints) -> tuple[Feature, ...]:
    """Features with the new vertices on their edges, those between i and j."""
    if not len(new):
        return features
    n = int(new.max(initial=0)) + 1
    key = np.minimum(i, j) * n + np.maximum(i, j)
    order = np.argsort(key)
    found = []
    for feature in features:
        a, b = feature.vertices[:-1], feature.vertices[1:]
        wanted = np.minimum(a, b) * n + np.maximum(a, b)
        at = np.minimum(np.searchsorted(key[order], wanted), len(key) - 1)
        split = np.flatnonzero(key[order[at]] == wanted)
        along = np.insert(feature.vertices, split + 1, new[order[at[split]]])
        found.append(replace(feature, vertices=along))
    return tuple(found)


def _blend_parameters(surface: Surface, i: Ints, j: Ints, s: Floats) -> Floats | None:
    """Parameters on the NURBS surface; in a closed direction the shorter way around."""
    if surface.parameters is None or surface.nurbs is None:
        return surface.parameters
    one, two = surface.parameters[i], surface.parameters[j]
    blended = np.zeros_like(one)
    for k in range(2):
        degree, knots = surface.nurbs.degree[k], surface.nurbs.knots[k]
        low, high = knots[degree], knots[len(knots) - degree - 1]
        step = two[:, k] - one[:, k]
        if surface.nurbs.closed[k]:
            period = high - low
            step -= period * np.round(step / period)
            blended[:, k] = low + (one[:, k] + s * step - low) % period
        else:
            blended[:, k] = one[:, k] + s * step
    return np.concatenate([surface.parameters, blended])


def spread(problem: Problem, first_new: int) -> Problem:
    """Splits edges between parents near vertices from ``first_new`` on, where these have made them far from
    Delaunay: an inserted vertex pulls on the triangles behind it, round after round through a fan."""
    for _ in range(SPREAD):
        surface = problem.surface
        faces, twin, n = surface.faces, surface.twin, len(surface.vertices)
        near = np.flatnonzero((faces >= first_new).any(axis=1))
        h = (3 * near[:, None] + np.arange(3)).ravel()
        h = h[(twin[h] >= 0)]
        h = h[problem.parent[h // 3] != problem.parent[twin[h] // 3]]
        h = np.unique(np.minimum(h, twin[h]))
        bad = h[angle_sums_opposite(surface.vertices, faces, h, twin[h]) > FLAT]
        if not len(bad):
            break
        first_new = n
        problem = split_edges(problem, bad, _feet(surface, faces, bad, twin[bad]))
    return problem


def _feet(surface: Surface, faces: Ints, h: Ints, t: Ints) -> Floats:
    """(k,) where to split edges: at the foot of the nearer of the two apexes."""
    tail, head = half_edges(faces)
    start, edge = surface.vertices[tail[h]], surface.vertices[head[h]] - surface.vertices[tail[h]]
    length = dot(edge, edge)
    best, nearest = np.full(len(h), 0.5), np.full(len(h), np.inf)
    for side in (h, t):
        apex = surface.vertices[faces[side // 3, (side % 3 + 2) % 3]] - start
        s = np.clip(dot(apex, edge) / length, *WITHIN)
        away = np.linalg.norm(apex - s[:, None] * edge, axis=1)
        best, nearest = np.where(away < nearest, s, best), np.minimum(away, nearest)
    return best


def collapsing(surface: Surface, targets: Targets, winding: Ints) -> Ints:
    """(k,) half-edges that must be split before any map can exist on these triangles.

    An interior edge between two vertices of one straight side would fall onto the boundary, and so would all
    that it cuts off; and around a boundary vertex with few triangles their angles, below π each, cannot add
    up to a large target. winding: (3m,) as in ``MirrorMesh``.
    """
    crowded = _crowded(surface, targets, FULLEST, surface.boundary)
    return np.union1d(_chords(surface, targets, winding), crowded)


def _chords(surface: Surface, targets: Targets, winding: Ints) -> Ints:
    faces, twin, n = surface.faces, surface.twin, len(surface.vertices)
    tail, head = half_edges(faces)
    found = [np.zeros(0, dtype=np.int64)]
    for loop in surface.loops:
        place = positions(loop, n)
        at = np.full(n, -1, dtype=np.int64)
        boundary = np.flatnonzero((twin < 0) & (place[tail] >= 0))
        at[tail[boundary]] = boundary
        # turns and convex corners up to each vertex, twice around so that no way along the loop wraps
        around = np.concatenate([[0], np.cumsum(np.tile(winding[at[loop]], 2))])
        convex = (targets.angle[loop] < np.pi - ANGLE) & (targets.shared[loop] < 0)
        corners = np.concatenate([[0], np.cumsum(np.tile(convex, 2))])
        h = np.flatnonzero((twin >= 0) & (place[tail] >= 0) & (place[head] >= 0))
        start, end = place[tail[h]], place[head[h]]
        end = np.where(end < start, end + len(loop), end)
        along = around[end] - around[start] == winding[h]  # the way along the loop that the edge cuts off
        found.append(h[along & (corners[end] == corners[start + 1])])
    return np.concatenate(found)


def _crowded(surface: Surface, targets: Targets, most: float, among: Ints) -> Ints:
    """The edges opposite to those boundary vertices ``among`` whose triangles would need a mean angle above
    ``most``."""
    faces = surface.faces
    count = np.bincount(faces.ravel(), minlength=len(surface.vertices))
    boundary = np.zeros(len(count), dtype=bool)
    boundary[surface.boundary] = True
    among = among[boundary[among] & (targets.shared[among] < 0)]
    crowded = np.zeros(len(count), dtype=bool)
    crowded[among] = targets.angle[among] > count[among] * most
    corner = np.flatnonzero(crowded[faces.ravel()])
    return 3 * (corner // 3) + (corner % 3 + 1) % 3


def split_places(
    surface: Surface, targets: Targets, wrong: Ints, attempt: int, drawn: Complexes | None = None
) -> tuple[Ints, Floats]:
    """(half-edges, places) to split where the faces ``wrong`` have turned over.

    One edge of each, at the foot of its altitude: the longest; but the one opposite to a corner that the map
    opens wide, since splits at the edges of such a corner would repeat themselves on ever smaller scales. And
    around boundary vertices of theirs with few triangles for their target all opposite edges: a wide angle
    wants a fan, and the finer a fan the more attempts have failed.
    drawn: (k, 3) corners of these faces in the domain, where the longest edge there is to be split. A corner
    that the map opens beyond π, turned over on every scale, faces that one.
    """
    corner = surface.vertices[surface.faces[wrong]]
    along = np.roll(corner, -1, axis=1) - corner
    length = np.linalg.norm(along, axis=2)
    opened = _opened(surface, targets)[wrong]
    side = np.where(opened.sum(axis=1) == 1, (opened.argmax(axis=1) + 1) % 3, length.argmax(axis=1))
    middle = opened.any(axis=1) | (drawn is not None)
    if drawn is not None:
        side = np.abs(np.roll(drawn, -1, axis=1) - drawn).argmax(axis=1)
    rows = np.arange(len(wrong))
    edge = along[rows, side]
    apex = corner[rows, (side + 2) % 3] - corner[rows, side]
    foot = dot(apex, edge) / length[rows, side] ** 2
    foot = np.where(middle, np.clip(foot, *MIDDLE), np.clip(foot, *WITHIN))
    wide = WIDE / (1 + attempt / HASTE)
    fan = _crowded(surface, targets, wide, np.unique(surface.faces[wrong]))
    return np.concatenate([fan, 3 * wrong + side]), np.concatenate([np.full(len(fan), 0.5), foot])


def shells(surface: Surface, wrong: Ints, sent: int) -> tuple[Ints, Floats]:
    """(half-edges, places) that cut all edges at one distance from each vertex below ``sent`` of the faces
    ``wrong``: half its shortest edge.

    Where triangles of different parents meet at such a vertex, splitting one of them at its altitude may call
    for a split of the next, and so on around the vertex on ever smaller scales. Edges of equal length from it
    end that, since their triangles are isosceles (the concentric shells of Ruppert's refinement).
    """
    corner = surface.faces[wrong]
    centre = np.zeros(len(surface.vertices), dtype=bool)
    centre[corner[corner < sent]] = True
    tail, head = half_edges(surface.faces)
    length = np.linalg.norm(surface.vertices[head] - surface.vertices[tail], axis=1)
    radius = np.full(len(centre), np.inf)
    np.minimum.at(radius, np.concatenate([tail, head]), np.tile(length / 2, 2))
    out, into = np.flatnonzero(centre[tail]), np.flatnonzero(centre[head] & ~centre[tail])
    place = np.concatenate([radius[tail[out]] / length[out], 1 - radius[head[into]] / length[into]])
    return np.concatenate([out, into]), place


def _opened(surface: Surface, targets: Targets) -> Bools:
    """(m, 3) corners that the map opens wide: at vertices whose target is well above their angle on the
    surface, and where what the corner gets of it is wide. Narrow corners of a fan need no finer fan."""
    angle = corner_angles(opposite_lengths(surface.vertices, surface.faces)).angle.T
    sums = np.bincount(surface.faces.ravel(), weights=angle.ravel(), minlength=len(surface.vertices))
    ratio = np.where(targets.shared < 0, targets.angle / sums, 0.0)[surface.faces]
    return np.asarray((ratio > OPENED) & (ratio * angle > BROAD))
