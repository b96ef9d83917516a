"""Open edges of a Brep joined where they meet within a tolerance: one of two drives, replacing the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.geometry import dot
from hexwrap_solver.surface.brep.curves import evaluate_curve, places
from hexwrap_solver.surface.brep.types import Brep, Edge, Face, Trim
from hexwrap_solver.surface.weld import merged
from hexwrap_solver.tolerances import TINY

#: Each step between two places of a curve is sampled at this many points.
FINER = 4
#: Newton's steps to the nearest point of a curve.
STEPS = 6


@dataclass(frozen=True)
class Joints:
    """What was joined: the number of edges that found a partner, the greatest distance between two such, and
    where it is (3,); open: edges that are left with one face."""

    count: int
    gap: float
    place: Floats
    open: Ints


def joined(brep: Brep, tolerance: float | None = None) -> tuple[Brep, Joints]:
    """The Brep with open edges united that lie within the tolerance (its own, if None) of each other.

    Corners within it become one; an edge that a corner of another lies on is divided there; then edges with
    the same ends and the same course are one.
    """
    tolerance = brep.tolerance if tolerance is None else tolerance
    brep = _one_vertex(brep, tolerance)
    brep = _divided(brep, tolerance)
    return _matched(brep, tolerance)


def open_edges(brep: Brep) -> Ints:
    """Edges with exactly one face, ascending."""
    used = [t.edge for face in brep.faces for loop in face.loops for t in loop if t.edge >= 0]
    return np.flatnonzero(np.bincount(np.array(used, dtype=np.int64), minlength=len(brep.edges)) == 1)


def nearest_on(edge: Edge, points: Floats) -> tuple[Floats, Floats]:
    """Parameters (k,) of the nearest points of an edge, and their distances (k,)."""
    t = places(edge)
    t = np.append((t[:-1, None] + np.diff(t)[:, None] * np.arange(FINER) / FINER).ravel(), t[-1])
    _, nearest = cKDTree(evaluate_curve(edge.curve, t)[0]).query(points)
    best = t[nearest]
    low, high = t[np.maximum(nearest - 1, 0)], t[np.minimum(nearest + 1, len(t) - 1)]
    for _ in range(STEPS):
        at, tangent, bend = evaluate_curve(edge.curve, best)
        off = at - points
        slope = dot(off, tangent)
        speed = dot(tangent, tangent)
        second = speed + dot(off, bend)
        second = np.where(second > 0.1 * speed, second, speed)
        best = np.clip(best - slope / np.maximum(second, TINY), low, high)
    return best, np.linalg.norm(evaluate_curve(edge.curve, best)[0] - points, axis=1)


def _one_vertex(brep: Brep, tolerance: float) -> Brep:
    """Ends of open edges that stand together become one vertex; not both ends of a very short edge."""
    edges = [brep.edges[e] for e in open_edges(brep)]
    ends = np.unique([v for e in edges for v in (e.start, e.end)]).astype(np.int64)
    if len(ends) == 0:
        return brep
    pairs = cKDTree(brep.vertices[ends]).query_pairs(tolerance, output_type="ndarray")
    short = {frozenset((e.start, e.end)) for e in edges if _length(e) <= 2 * tolerance}
    pairs = ends[pairs.reshape(-1, 2)]
    keep = [frozenset(pair) not in short for pair in pairs.tolist()]
    pairs = pairs[np.array(keep, dtype=bool)]
    return _renamed(brep, merged(np.arange(len(brep.vertices)), *pairs.T))


def _length(edge: Edge) -> float:
    points = evaluate_curve(edge.curve, places(edge))[0]
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def _renamed(brep: Brep, label: Ints) -> Brep:
    edges = tuple(replace(e, start=int(label[e.start]), end=int(label[e.end])) for e in brep.edges)

    def trim(t: Trim) -> Trim:
        return Trim(t.edge, t.reversed, int(label[t.start]), int(label[t.end]))

    faces = tuple(replace(f, loops=tuple(tuple(map(trim, loop)) for loop in f.loops)) for f in brep.faces)
    return replace(brep, edges=edges, faces=faces)


def _divided(brep: Brep, tolerance: float) -> Brep:
    """Open edges cut where ends of other open edges lie on them."""
    naked = open_edges(brep)
    ends = np.unique([v for e in naked for v in (brep.edges[e].start, brep.edges[e].end)]).astype(np.int64)
    if len(ends) == 0:
        return brep
    tree = cKDTree(brep.vertices[ends])
    edges = list(brep.edges)
    parts: dict[int, list[int]] = {}
    for e in naked.tolist():
        edge = brep.edges[e]
        points = evaluate_curve(edge.curve, places(edge))[0]
        reach = float(np.linalg.norm(np.diff(points, axis=0), axis=1).max()) + tolerance
        near = np.unique(
            np.concatenate(
                [np.asarray(x, dtype=np.int64) for x in list(tree.query_ball_point(points, reach))]
            )
        )
        other = np.setdiff1d(ends[near], [edge.start, edge.end])
        if len(other) == 0:
            continue
        t, distance = nearest_on(edge, brep.vertices[other])
        # A corner near an end of the edge, but not one with it, is not a place to cut.
        margin = np.linalg.norm(
            brep.vertices[other][:, None] - brep.vertices[[edge.start, edge.end]], axis=2
        ).min(axis=1)
        hit = (distance <= tolerance) & (margin > 2 * tolerance)
        order = np.argsort(t[hit])
        stops, corners = t[hit][order], other[hit][order]
        if len(stops) == 0:
            continue
        bounds = [edge.interval[0], *stops.tolist(), edge.interval[1]]
        names = [edge.start, *corners.tolist(), edge.end]
        first = len(edges)
        edges += [
            Edge(edge.curve, (bounds[k], bounds[k + 1]), names[k], names[k + 1])
            for k in range(len(bounds) - 1)
        ]
        parts[e] = list(range(first, len(edges)))

    def pieces(trim: Trim) -> list[Trim]:
        if trim.edge not in parts:
            return [trim]
        own = [Trim(p, trim.reversed, edges[p].start, edges[p].end) for p in parts[trim.edge]]
        if trim.reversed:
            own = [replace(t, start=t.end, end=t.start) for t in reversed(own)]
        return own

    faces = tuple(
        replace(f, loops=tuple(tuple(p for t in loop for p in pieces(t)) for loop in f.loops))
        for f in brep.faces
    )
    return replace(brep, edges=tuple(edges), faces=faces)


def _matched(brep: Brep, tolerance: float) -> tuple[Brep, Joints]:
    groups: dict[frozenset[int], list[int]] = {}
    for e in open_edges(brep).tolist():
        groups.setdefault(frozenset((brep.edges[e].start, brep.edges[e].end)), []).append(e)
    driver: dict[int, tuple[int, bool]] = {}
    worst, place = 0.0, np.zeros(3)
    for group in groups.values():
        found = []
        for a, b in combinations(group, 2):
            gap, where, turned = _apart(brep.edges[a], brep.edges[b])
            if gap <= tolerance:
                found.append((gap, a, b, turned, where))
        taken: set[int] = set()
        for gap, a, b, turned, where in sorted(found, key=lambda x: x[:3]):
            if a in taken or b in taken:
                continue
            taken |= {a, b}
            driver[b] = (a, turned)
            if gap >= worst:
                worst, place = gap, where
    faces = tuple(_driven(face, driver) for face in brep.faces)
    brep = replace(brep, faces=faces)
    return brep, Joints(len(driver), worst, place, open_edges(brep))


def _apart(one: Edge, two: Edge) -> tuple[float, Floats, bool]:
    """The greatest distance of places of two edges from each other, where it is, and whether they run in
    opposite directions."""
    points = evaluate_curve(one.curve, places(one))[0]
    t, distance = nearest_on(two, points)
    _, other = nearest_on(one, evaluate_curve(two.curve, places(two))[0])
    turned = one.start != two.start
    if one.start == one.end:  # closed: the direction decides
        tangent = evaluate_curve(one.curve, places(one))[1]
        turned = bool(dot(tangent, evaluate_curve(two.curve, t)[1]).sum() < 0)
    return float(max(distance.max(), other.max())), points[int(distance.argmax())], turned


def _driven(face: Face, driver: dict[int, tuple[int, bool]]) -> Face:
    def trim(t: Trim) -> Trim:
        if t.edge not in driver:
            return t
        edge, turned = driver[t.edge]
        return replace(t, edge=edge, reversed=t.reversed != turned)

    return replace(face, loops=tuple(tuple(map(trim, loop)) for loop in face.loops))
