"""Lines inside a face across which its surface bends sharply: knots where it is only continuous.

A surface of degree 1 has them at every knot. Meshes must have edges there, to keep its corners.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from hexwrap_solver.arrays import Floats
from hexwrap_solver.geometry import angles_between
from hexwrap_solver.surface.brep.face import Outline, polygon_of
from hexwrap_solver.surface.brep.pull import Patch, patch_of, pull
from hexwrap_solver.surface.brep.sizes import Field, bilinear
from hexwrap_solver.surface.mesh_sizes import cumulated
from hexwrap_solver.surface.nurbs import evaluate, evaluate_points
from hexwrap_solver.surface.types import NurbsSurface
from hexwrap_solver.tolerances import RELATIVE, TINY

#: Normals that turn by more than this across a knot make a kink, radians.
KINK = np.deg2rad(1.0)
#: Sides of a line are distinguished beyond this part of the parameter's range.
ON_LINE = 1e-7
#: Places along a line at which normals are compared.
PLACES = 33
#: Steps by which the crossing of an edge and a line is found.
STEPS = 8


def kinks_of(patch: Patch, outline: shapely.Geometry) -> list[tuple[int, float]]:
    """(direction, parameter) of the kinks that the outline's box reaches into."""
    box = np.array(outline.bounds).reshape(2, 2)
    found = []
    for d in (0, 1):
        knots, p = patch.surface.knots[d], patch.surface.degree[d]
        margin = ON_LINE * patch.width[d]
        inner, count = np.unique(knots, return_counts=True)
        for x in inner[(count >= p) & (inner > box[0, d] + margin) & (inner < box[1, d] - margin)]:
            across = np.linspace(box[0, 1 - d], box[1, 1 - d], PLACES)[1:-1]
            sides = x + np.array([-RELATIVE, RELATIVE]) * patch.width[d]
            if _turn(patch, d, sides, across) > KINK:
                found.append((d, float(x)))
    return found


def is_smooth(nurbs: NurbsSurface) -> bool:
    """Whether the surface has no kinks inside, nor where it closes up."""
    patch = patch_of(nurbs, 0.0)
    box = shapely.box(*patch.low, *(patch.low + patch.width))
    if kinks_of(patch, box):
        return False
    ends = np.array([patch.low, patch.low + patch.width])
    return not any(
        _turn(patch, d, ends[:, d], np.linspace(ends[0, 1 - d], ends[1, 1 - d], PLACES)[1:-1]) > KINK
        for d in (0, 1)
        if patch.surface.closed[d]
    )


def _turn(patch: Patch, direction: int, at: Floats, across: Floats) -> float:
    """The greatest angle between normals on two lines of constant parameters at (2,), radians."""
    one, two = (np.stack([np.full_like(across, x), across], axis=1) for x in at)
    if direction == 1:
        one, two = one[:, ::-1], two[:, ::-1]
    normals = (evaluate(patch.opened, uv).normal for uv in (one, two))
    return float(angles_between(*normals).max())


def crossings(
    patch: Patch,
    kinks: list[tuple[int, float]],
    t: Floats,
    uv: Floats,
    at: Callable[[Floats], Floats],
) -> list[float]:
    """Parameters at which an edge, known by samples t (k,) and uv (k, 2), crosses kinks.

    at: points (k, 3) of the edge at parameters (k,).
    """
    out: list[float] = []
    for d, x in kinks:
        side = uv[:, d] - x
        near = np.abs(side) <= ON_LINE * patch.width[d]
        # Samples that stand on the line alone are crossings themselves; a run of them goes along it.
        alone = near[1:-1] & ~near[:-2] & ~near[2:]
        out += t[1:-1][alone].tolist()
        for i in np.flatnonzero(~near[:-1] & ~near[1:] & (side[:-1] * side[1:] < 0)):
            out.append(_crossing(patch, d, x, t[i : i + 2], uv[i : i + 2], at))
    return out


def _crossing(patch: Patch, d: int, x: float, t: Floats, uv: Floats, at: Callable[[Floats], Floats]) -> float:
    """Illinois' variant of the secant method, on the edge between two samples."""
    (a, b), (fa, fb) = t.tolist(), (uv[:, d] - x).tolist()
    middle = a
    for _ in range(STEPS):
        middle = (a * fb - b * fa) / (fb - fa)
        share = (middle - t[0]) / (t[1] - t[0])
        near = uv[:1] + share * (uv[1:] - uv[:1])
        value = float(pull(patch, at(np.array([middle])), near)[0][0, d] - x)
        if abs(value) <= 1e-12 * patch.width[d]:
            break
        if value * fb < 0:
            a, fa = b, fb
        else:
            fa /= 2
        b, fb = middle, value
    return float(middle)


def kink_lines(
    patch: Patch, kinks: list[tuple[int, float]], field: Field, outline: Outline, tolerance: float
) -> Outline:
    """The outline with the kinks inside it as lines, divided at each other's crossings and as wanted."""
    if not kinks:
        return outline
    uv = outline.uv.copy()
    speeds = [max(float(s.mean()), TINY) for s in (field.speed_u, field.speed_v)]
    for d, x in kinks:
        near = np.abs(uv[:, d] - x) <= np.maximum(2 * tolerance / speeds[d], ON_LINE * patch.width[d])
        uv[near, d] = x
    segments = {frozenset(pair) for pair in outline.segments.tolist()}
    polygon = polygon_of(uv, outline.loops)
    shapely.prepare(polygon)
    places, lines = [*uv], []
    nodes: dict[tuple[float, float], int] = {}
    for d, x in kinks:
        on = np.flatnonzero(uv[:, d] == x)
        on = on[np.argsort(uv[on, 1 - d], kind="stable")]
        others = sorted(y for e, y in kinks if e != d)
        for a, b in pairwise(on.tolist()):
            middle = (uv[a] + uv[b]) / 2
            if frozenset((a, b)) in segments or not shapely.contains_xy(polygon, *middle):
                continue
            stops = [y for y in others if uv[a, 1 - d] < y < uv[b, 1 - d]]
            chain = [a]
            for y in stops:
                key = (x, y) if d == 0 else (y, x)
                if key not in nodes:
                    nodes[key] = len(places)
                    places.append(np.array(key))
                chain.append(nodes[key])
            chain.append(b)
            for one, two in pairwise(chain):
                inner = _divided_line(field, d, places[one], places[two])
                ids = [one, *range(len(places), len(places) + len(inner)), two]
                places += list(inner)
                lines += list(pairwise(ids))
    new = np.array(places[len(uv) :]).reshape(-1, 2)
    return replace(
        outline,
        id=np.concatenate([outline.id, np.full(len(new), -1)]),
        uv=np.array(places),
        points=np.concatenate([outline.points, evaluate_points(patch.opened, new)]),
        lines=np.array(lines, dtype=np.int64).reshape(-1, 2),
    )


def _divided_line(field: Field, d: int, one: Floats, two: Floats) -> Floats:
    """(k, 2) places inside a line of constant parameter d, evenly in units of the wanted length."""
    share = np.linspace(0, 1, PLACES)[:, None]
    at = one + share * (two - one)
    speed = bilinear(field.u, field.v, field.speed_v if d == 0 else field.speed_u, at)
    rate = speed * abs(two[1 - d] - one[1 - d]) / field.wanted(at)
    total = cumulated(rate[None], np.diff(share[:, 0]))[0]
    n = max(1, int(np.ceil(total[-1] - 1e-6)))
    where = np.interp(np.arange(1, n) / n * total[-1], total, share[:, 0])
    return np.asarray(one + where[:, None] * (two - one))
