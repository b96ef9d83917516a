"""An independent judge of maps: it reads a result as the contract says and trusts none of its own figures."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints
from hexwrap_solver.conformal.corners import boundary_angles
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.surface.types import Surface

#: Angle sums, measured on the triangles as drawn, besides the rounding of their corners.
ANGLES = 1e-9
ROUNDINGS = 16 * np.finfo(float).eps


def faults(found: ConformalMap, prescribed: tuple[Floats | None, Floats | None] = (None, None)) -> list[str]:
    """What is wrong with a map, in words; nothing if it is right.

    prescribed: per loop the angle sums that were asked for; where None, those that the result names.
    """
    surface = found.surface
    faces, n = surface.faces, len(surface.vertices)
    wrong = _broken_mesh(faces, surface.loops, n)
    numbers = np.concatenate([found.log_scale, found.uv.view(float), found.sheet.ravel().astype(float)])
    if wrong or not np.isfinite(numbers).all():
        return [*wrong, "not finite"]
    corners = _place(found)
    if (turned := ~_positive(corners)).any():
        wrong.append(f"{turned.sum()} triangles are not positively oriented")
    wrong += _disagreements(faces, found.sheet, surface.loops, n)
    sums = angle_sums(corners, faces, n)
    allowed = ANGLES + _rounding(corners, faces, n)
    inner = np.ones(n, dtype=bool)
    inner[np.concatenate(surface.loops)] = False
    if (error := np.abs(sums[inner] - 2 * np.pi) - allowed[inner]).max(initial=-1) > 0:
        wrong.append(f"an interior angle sum is {error.max():.1e} too far off 2π")
    for k, loop in enumerate(surface.loops):
        told = found.boundary_angles[k]
        if (error := np.abs(sums[loop] - told) - allowed[loop]).max() > 0:
            wrong.append(f"a boundary angle of loop {k} is {error.max():.1e} too far off the told one")
        asked = prescribed[k]
        if asked is not None and (error := np.abs(sums[loop] - asked) - allowed[loop]).max() > 0:
            wrong.append(f"a boundary angle of loop {k} is {error.max():.1e} too far off the prescribed one")
    curvature = float((np.pi - sums[surface.loops[0]]).sum())
    if abs(curvature - found.deck.angle) > ANGLES * max(1, np.sqrt(len(surface.loops[0]))):
        wrong.append(f"the cone angle is {found.deck.angle:.6g}, the boundary turns by {curvature:.6g}")
    return wrong


def _broken_mesh(faces: Ints, loops: tuple[Ints, Ints], n: int) -> list[str]:
    """The refined mesh must be the annulus that its loops say."""
    edges = {(a, b): True for f in faces.tolist() for a, b in zip(f, f[1:] + f[:1], strict=True)}
    wrong = [] if len(edges) == faces.size else ["a half-edge occurs twice"]
    open_edges = {(a, b) for a, b in edges if (b, a) not in edges}
    told = {(int(a), int(b)) for loop in loops for a, b in zip(loop, np.roll(loop, -1), strict=True)}
    if open_edges != told:
        wrong.append("loops are not the boundary")
    n_edges = (len(edges) + len(open_edges)) // 2
    if n - n_edges + len(faces) != 0 or len(np.unique(faces)) != n:
        wrong.append("not an annulus")
    return wrong


def _place(found: ConformalMap) -> Complexes:
    """(m, 3) corners, by applying g and its inverse one by one."""
    rotation, shift = np.exp(1j * found.deck.angle), found.deck.translation
    corners = found.uv[found.surface.faces].copy()
    sheet = found.sheet.copy()
    while sheet.any():
        corners = np.where(sheet > 0, rotation * corners + shift, corners)
        corners = np.where(sheet < 0, (corners - shift) / rotation, corners)
        sheet -= np.sign(sheet)
    return corners


def _positive(corners: Complexes) -> Bools:
    """Orientation, by floats where they are sure of it and by fractions elsewhere."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    left, right = a.real * b.imag, a.imag * b.real
    area = left - right
    doubtful = np.abs(area) <= 1e-14 * (np.abs(left) + np.abs(right))
    result = area > 0
    for f in np.flatnonzero(doubtful):
        (ax, ay), (bx, by), (cx, cy) = ((Fraction(z.real), Fraction(z.imag)) for z in corners[f].tolist())
        result[f] = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 0
    return np.asarray(result)


def _disagreements(faces: Ints, sheet: Ints, loops: tuple[Ints, Ints], n: int) -> list[str]:
    """Neighbours must see their common edge the same way up to one power of g, and the loops must go around
    once, in opposite directions."""
    tail, head = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    turn = (np.roll(sheet, -1, axis=1) - sheet).ravel()
    forward, backward = tail * n + head, head * n + tail
    order = np.argsort(forward)
    at = np.searchsorted(forward[order], backward)
    twin = order[np.minimum(at, len(order) - 1)]
    paired = forward[twin] == backward
    wrong = []
    if (turn[paired] + turn[twin[paired]]).any():
        wrong.append("faces disagree on an edge by more than one power of g")
    for loop, expected in zip(loops, (1, -1), strict=True):
        on_loop = ~paired & np.isin(tail, loop)
        if turn[on_loop].sum() != expected:
            wrong.append("a loop does not go around once")
    return wrong


def _rounding(corners: Complexes, faces: Ints, n: int) -> Floats:
    """(n,) what the rounding of the corners does to the angles around each vertex."""
    sides = np.abs(np.roll(corners, -1, axis=1) - corners)
    shortest = np.minimum(sides, np.roll(sides, 1, axis=1))  # of the two sides at each corner
    error = np.zeros(n)
    np.maximum.at(error, faces.ravel(), (np.abs(corners) / shortest).ravel())
    return ROUNDINGS * error


def angle_sums(corners: Complexes, faces: Ints, n: int) -> Floats:
    """(n,) sums of the angles of the drawn triangles."""
    total = np.zeros(n)
    for c in range(3):
        here, one, two = corners[:, c], corners[:, (c + 1) % 3], corners[:, (c + 2) % 3]
        a, b = one - here, two - here
        total += np.bincount(faces[:, c], np.arctan2((np.conj(a) * b).imag, (np.conj(a) * b).real), n)
    return total


def asked_angles(
    found: ConformalMap, surface: Surface, condition: BoundaryCondition
) -> tuple[Floats | None, Floats | None]:
    """Per loop of the result what the condition prescribes there, vertex by vertex: the listed angles, π at
    all other vertices and at inserted ones. None for isometric boundaries, whose angles come out."""
    if condition.mode == "isometric":
        return None, None
    asked = np.full(len(found.surface.vertices), np.pi)
    if condition.mode == "angles":
        asked[np.concatenate(surface.loops)] = np.concatenate(boundary_angles(surface, condition))
    return asked[found.surface.loops[0]], asked[found.surface.loops[1]]
