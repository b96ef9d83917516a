"""Listed boundary angles (paper, section 3.1 and Figure 7): checked, placed, and closed by equation (1)."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.conformal.boundary import nearest_multiple
from hexwrap_solver.conformal.types import ANGLE_UNITS, QUANTA, AngleUnit, BoundaryAngle, BoundaryCondition
from hexwrap_solver.errors import BoundaryError, GaussBonnetError
from hexwrap_solver.surface.types import Surface

#: Equation (1) may miss by this much in total, radians: angles are often typed with four digits.
GAUSS_BONNET_TOLERANCE = 1e-3


def boundary_angles(surface: Surface, condition: BoundaryCondition) -> tuple[Floats, Floats]:
    """Target angle sums for each loop, aligned with surface.loops: the listed ones, elsewhere π.

    What equation (1) misses, at most GAUSS_BONNET_TOLERANCE, is spread over the vertices left at π; where
    each loop's sum is that near to a multiple of the quantum, loop by loop, so that K is a multiple.
    Raises BoundaryError (vertices or angles that cannot be used), GaussBonnetError (equation (1) fails).
    """
    unit, angles = condition.angle_unit, np.array([entry.angle for entry in condition.angles], dtype=float)
    _check_angles(angles, unit)
    vertices = _place(surface, condition.angles)
    target = np.full(len(surface.vertices), np.pi)
    target[vertices] = angles
    listed = np.zeros(len(surface.vertices), dtype=bool)
    listed[vertices] = True
    sums = [float((np.pi - target[loop]).sum()) for loop in surface.loops]
    if abs(sum(sums)) > GAUSS_BONNET_TOLERANCE:
        raise _gauss_bonnet_error(surface, vertices, angles, sums, unit)
    return _close(surface, target, listed, sums, QUANTA.get(condition.quantum))


def _field(i: int, name: str) -> tuple[str | int, ...]:
    return ("angles", int(i), name)


def _told(angle: float, unit: AngleUnit, digits: int = 6) -> str:
    """As the request would have it."""
    return f"{angle / ANGLE_UNITS[unit]:.{digits}g}" + {"rad": " rad", "deg": "°", "pi": " π"}[unit]


def _check_angles(angles: Floats, unit: AngleUnit) -> None:
    bad = np.flatnonzero(~(np.isfinite(angles) & (angles > 0)))
    if len(bad):
        i = bad[0]
        raise BoundaryError(
            f"Boundary angle {i} is {_told(angles[i], unit)}, but the angle sum at a vertex is a sum of "
            f"triangle angles and must be a positive number; {len(bad)} of the {len(angles)} listed angles "
            "are not.",
            field=_field(i, "angle"),
        )


def _place(surface: Surface, entries: tuple[BoundaryAngle, ...]) -> Ints:
    """(k,) mesh vertices the listed angles belong to."""
    placed = np.zeros(len(entries), dtype=np.int64)
    sent = np.array([entry.vertex or 0 for entry in entries], dtype=np.int64)
    points = np.array([entry.point or (np.nan,) * 3 for entry in entries], dtype=float).reshape(-1, 3)
    is_named = np.array([entry.vertex is not None for entry in entries], dtype=bool)
    named, by_point = np.flatnonzero(is_named), np.flatnonzero(~is_named)
    placed[named] = _of_sent(surface, sent, named)
    if len(by_point):
        placed[by_point] = _nearest(surface, points, by_point)
    _check_distinct(surface, placed)
    return placed


def _of_sent(surface: Surface, sent: Ints, entries: Ints) -> Ints:
    """Vertices of entries that name a sent vertex."""
    wanted = sent[entries]
    unknown = entries[(wanted < 0) | (wanted >= len(surface.vertex_of_input))]
    if len(unknown):
        raise BoundaryError(
            f"Boundary angle {unknown[0]} names vertex {sent[unknown[0]]}, but only vertices 0 to "
            f"{len(surface.vertex_of_input) - 1} were sent.",
            field=_field(unknown[0], "vertex"),
        )
    vertex = surface.vertex_of_input[wanted]
    on_boundary = np.zeros(len(surface.vertices) + 1, dtype=bool)  # the last one stands for −1
    on_boundary[np.concatenate(surface.loops)] = True
    inside = entries[~on_boundary[vertex]]
    if len(inside):
        raise BoundaryError(
            f"Angles can be prescribed on the boundary only, but {_name(sent[inside])} not on it; "
            f"{_suggest(surface, int(sent[inside[0]]))}",
            vertices=sent[inside],
            field=_field(inside[0], "vertex"),
        )
    return vertex


def _suggest(surface: Surface, sent: int) -> str:
    vertex = surface.vertex_of_input[sent]
    if vertex < 0:
        return f"vertex {sent} belongs to no triangle of the surface."
    boundary = np.concatenate(surface.loops)
    distance = np.linalg.norm(surface.vertices[boundary] - surface.vertices[vertex], axis=1)
    near = surface.input_vertex[boundary[distance.argmin()]]
    return f"the boundary vertex nearest to {sent} is {near}, at a distance of {distance.min():.4g}."


def _nearest(surface: Surface, points: Floats, entries: Ints) -> Ints:
    """Boundary vertices nearest to the points of these entries."""
    bad = entries[~np.isfinite(points[entries]).all(axis=1)]
    if len(bad):
        raise BoundaryError(
            f"The point of boundary angle {bad[0]} has coordinates that are not finite numbers.",
            field=_field(bad[0], "point"),
        )
    boundary = np.concatenate(surface.loops)
    return np.asarray(boundary[cKDTree(surface.vertices[boundary]).query(points[entries])[1]])


def _check_distinct(surface: Surface, placed: Ints) -> None:
    _, first, inverse = np.unique(placed, return_index=True, return_inverse=True)
    again = np.flatnonzero(first[inverse] != np.arange(len(placed)))
    if len(again):
        i, j = int(first[inverse][again[0]]), int(again[0])
        raise BoundaryError(
            f"Boundary angles {i} and {j} mean the same vertex of the surface "
            f"(sent vertex {surface.input_vertex[placed[i]]}); list each vertex once.",
            vertices=np.unique(surface.input_vertex[placed[again]]),
            field=_field(j, "vertex"),
        )


def _name(vertices: Ints) -> str:
    if len(vertices) == 1:
        return f"vertex {vertices[0]} is"
    shown = ", ".join(str(v) for v in vertices[:6]) + (", …" if len(vertices) > 6 else "")
    return f"vertices {shown} are"


def _close(
    surface: Surface, target: Floats, listed: Bools, sums: list[float], quantum: float | None
) -> tuple[Floats, Floats]:
    """Spreads the small rest of equation (1)."""
    free = [loop[~listed[loop]] for loop in surface.loops]
    rest = _rest_per_loop(sums, quantum)
    if rest is not None:  # where every vertex of a loop is listed, all of them give way
        free = [f if len(f) else loop for f, loop in zip(free, surface.loops, strict=True)]
    else:
        if not any(len(f) for f in free):
            free = list(surface.loops)  # every vertex is listed: all of them give way
        count = np.array([len(f) for f in free])
        rest = sum(sums) * count / count.sum()
    angle = target.copy()
    for vertices, too_much in zip(free, rest, strict=True):
        angle[vertices] += too_much / max(len(vertices), 1)
    return angle[surface.loops[0]], angle[surface.loops[1]]


def _rest_per_loop(sums: list[float], quantum: float | None) -> Floats | None:
    """What each loop's sum has above the nearest cone angle of the quantum; None where none is near."""
    if quantum is None:
        return None
    wanted = nearest_multiple((sums[0] - sums[1]) / 2, quantum)
    rest = np.array([sums[0] - wanted, sums[1] + wanted])
    return rest if np.abs(rest).max() <= GAUSS_BONNET_TOLERANCE else None


def _gauss_bonnet_error(
    surface: Surface, vertices: Ints, angles: Floats, sums: list[float], unit: AngleUnit
) -> BoundaryError | GaussBonnetError:
    """What is missing, and an example that would close it."""
    missing = sum(sums)  # angles must grow by this much in total
    unlisted = sum(len(loop) for loop in surface.loops) - len(vertices)
    least = float((np.pi - angles).sum()) + unlisted * np.pi
    if least <= 0:
        i = int(angles.argmax())
        raise BoundaryError(
            f"The listed boundary angles are too large for any surface: their curvatures π − θ add up to "
            f"{_told((np.pi - angles).sum(), unit)}, and even with angles of 0 at all the other {unlisted} "
            f"boundary vertices the sum over both loops, equation (1), would be {_told(least, unit)}, not 0; "
            f"the largest is {_told(angles[i], unit)} at vertex {surface.input_vertex[vertices[i]]}.",
            vertices=[surface.input_vertex[vertices[i]]],
            field=_field(i, "angle"),
        )
    example, sentence = _repair(surface, vertices, angles, missing, unlisted, unit)
    degrees = "" if unit == "deg" else f" ({np.degrees(missing):.6g}°)"
    return GaussBonnetError(
        f"The boundary curvatures π − θ add up to {_told(sums[0], unit)} on loop 0 and "
        f"{_told(sums[1], unit)} on loop 1; equation (1) wants the two sums to cancel, but together they "
        f"make {_told(missing, unit)}{degrees}, so the angles must add up to "
        f"{_told(abs(missing), unit)} {'more' if missing > 0 else 'less'}: {sentence}.",
        vertices=surface.input_vertex[vertices],
        field=("angles",),
        data={"loop_sums": sums, "missing": missing, "example": example, "example_unit": unit},
    )


def _repair(
    surface: Surface, vertices: Ints, angles: Floats, missing: float, unlisted: int, unit: AngleUnit
) -> tuple[list[dict[str, float | int]], str]:
    """A list of angles, in the unit, that satisfies equation (1), as near to the given one as one change
    allows."""
    repaired, changed = angles.copy(), surface.input_vertex[vertices]
    possible = np.flatnonzero((angles + missing > 0.1 * np.pi) & (angles + missing < 3 * np.pi))
    if len(possible):
        i = int(possible[np.abs(angles[possible] + missing - np.pi).argmin()])
        repaired[i] += missing
        sentence = (
            f"for example {_told(repaired[i], unit, 8)} instead of {_told(angles[i], unit)} at vertex "
            f"{changed[i]} would close it"
        )
    else:
        repaired, changed, sentence = _repair_by_others(surface, vertices, angles, missing, unlisted, unit)
    repaired = repaired / ANGLE_UNITS[unit]
    example = [{"vertex": int(v), "angle": float(a)} for v, a in zip(changed, repaired, strict=True)]
    return example, sentence


def _repair_by_others(
    surface: Surface, vertices: Ints, angles: Floats, missing: float, unlisted: int, unit: AngleUnit
) -> tuple[Floats, Ints, str]:
    """Further vertices share what is missing, as few as keep their angles between π/2 and 3π/2."""
    boundary = np.concatenate(surface.loops)
    others = boundary[~np.isin(boundary, vertices)]
    if unlisted == 0:
        scaled = angles * (1 + missing / angles.sum())
        return scaled, surface.input_vertex[vertices], "for example all of them scaled alike would close it"
    count = min(unlisted, int(np.ceil(abs(missing) / (np.pi / 2))))
    chosen = others[np.linspace(0, len(others), count, endpoint=False).astype(int)]
    angle = np.pi + missing / count
    named = ", ".join(str(v) for v in surface.input_vertex[chosen][:6])
    sentence = (
        f"for example angles of {_told(angle, unit, 8)} at {count} more boundary "
        f"{'vertex' if count == 1 else 'vertices'} ({named}{', …' if count > 6 else ''}) would close it"
    )
    return (
        np.concatenate([angles, np.full(count, angle)]),
        surface.input_vertex[np.concatenate([vertices, chosen])],
        sentence,
    )
