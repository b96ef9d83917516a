"""Listed boundary angles (paper, section 3.1 and Figure 7): checked, placed, and closed by equation (1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.conformal.boundary import gauss_bonnet, rounded_jointly
from hexwrap_solver.conformal.types import (
    ANGLE_UNITS,
    QUANTA,
    AngleUnit,
    BoundaryAngle,
    BoundaryCondition,
    BoundaryMode,
    Cones,
    LoopCondition,
)
from hexwrap_solver.errors import BoundaryError, GaussBonnetError, SingularitiesError
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.words import length, place

#: A point belongs to the boundary up to this part of its size away, or up to its longest edge.
FAR = 0.02
#: Equation (1) may miss by this much in total, radians: angles are often typed with four digits.
GAUSS_BONNET_TOLERANCE = 1e-3
#: No boundary angle is so large, in radians or multiples of π.
DEGREES = 10


#: Field of the request that an entry of a list of angles stands in.
Field = tuple[str | int, ...]


@dataclass(frozen=True)
class _Listed:
    """All listed angles. vertex: (k,) of the mesh. angle: (k,) radians. field: (k) of each entry."""

    vertex: Ints
    angle: Floats
    field: list[Field]


def boundary_angles(
    surface: Surface, condition: BoundaryCondition, cones: Cones | None = None
) -> tuple[Floats | None, ...]:
    """Target angle sums for each loop, aligned with surface.loops: the listed ones, elsewhere π. None for
    loops that are isometric.

    What Gauss–Bonnet misses, at most GAUSS_BONNET_TOLERANCE, is spread over the vertices left at π; where
    each loop's sum is that near to a multiple of the quantum, loop by loop, so that they are multiples. If
    any loop is isometric, its angles make up for the rest.
    Raises BoundaryError (vertices or angles that cannot be used), GaussBonnetError (the sums fail).
    """
    listed, target, given, asked = _asked(surface, condition)
    if any(angles is None for angles in asked):
        return asked
    sums = [float((np.pi - target[loop]).sum()) for loop in surface.loops]
    total = gauss_bonnet(surface) - (0.0 if cones is None else float(cones.curvature.sum()))
    if abs(sum(sums) - total) > GAUSS_BONNET_TOLERANCE:
        raise _gauss_bonnet_error(surface, listed, sums, total, cones, condition)
    return _close(surface, target, given, sums, total, QUANTA.get(condition.quantum))


def asked_angles(surface: Surface, condition: BoundaryCondition) -> tuple[Floats | None, ...]:
    """The same whether they add up or not: singularities may make up for it. Raises BoundaryError."""
    return _asked(surface, condition)[-1]


def _asked(
    surface: Surface, condition: BoundaryCondition
) -> tuple[_Listed, Floats, Bools, tuple[Floats | None, ...]]:
    """The list; (n,) target angles and where they are listed; and per loop its angles, None if isometric."""
    listed = _listed(surface, condition)
    target = np.full(len(surface.vertices), np.pi)
    target[listed.vertex] = listed.angle
    given = np.zeros(len(surface.vertices), dtype=bool)
    given[listed.vertex] = True
    modes = _modes(surface, condition, given)
    pairs = zip(modes, surface.loops, strict=True)
    return listed, target, given, tuple(None if mode == "isometric" else target[loop] for mode, loop in pairs)


def _listed(surface: Surface, condition: BoundaryCondition) -> _Listed:
    """The listed angles of the whole boundary and of single loops."""
    lists: list[tuple[Field, tuple[BoundaryAngle, ...]]] = []
    if condition.mode == "angles":
        lists.append((("angles",), condition.angles))
    lists += [
        (("loops", i, "angles"), single.angles)
        for i, single in enumerate(condition.loops)
        if single.mode == "angles"
    ]
    entries = tuple(entry for _, some in lists for entry in some)
    field = [(*prefix, i) for prefix, some in lists for i in range(len(some))]
    angle = np.array([entry.angle for entry in entries], dtype=float)
    _check_angles(angle, condition.angle_unit, field)
    return _Listed(_place(surface, entries, field), angle, field)


def _modes(surface: Surface, condition: BoundaryCondition, given: Bools) -> list[BoundaryMode]:
    """What each loop is asked for; openings without a listed angle are isometric."""
    common = condition.mode
    if common == "auto":
        common = "isometric" if len(surface.loops) == 1 else "straight"
    modes: list[BoundaryMode] = [
        "isometric" if i >= 2 and not given[loop].any() else common for i, loop in enumerate(surface.loops)
    ]
    for i, one in enumerate(condition.loops):
        modes[_loop_meant(surface, one, i)] = one.mode
    return modes


def _loop_meant(surface: Surface, one: LoopCondition, i: int) -> int:
    count = len(surface.loops)
    if one.point is not None and count:
        loop = np.repeat(np.arange(count), [len(loop) for loop in surface.loops])
        distance = np.linalg.norm(surface.vertices[np.concatenate(surface.loops)] - one.point, axis=1)
        return int(loop[np.argmin(distance)])
    if one.loop is None or one.loop >= count:
        raise BoundaryError(
            f"Loop {one.loop} is asked for, but the surface has {count} boundary "
            f"{'loop' if count == 1 else 'loops'}, numbered from 0.",
            field=("loops", i, "loop"),
        )
    return one.loop


def _angle_text(angle: float, unit: AngleUnit, digits: int = 6) -> str:
    """As the request would have it."""
    return f"{angle / ANGLE_UNITS[unit]:.{digits}g}" + {"rad": " rad", "deg": "°", "pi": " π"}[unit]


def _check_angles(angles: Floats, unit: AngleUnit, field: list[Field]) -> None:
    bad = np.flatnonzero(~(np.isfinite(angles) & (angles > 0)))
    if len(bad):
        i = bad[0]
        raise BoundaryError(
            f"Boundary angle {i} is {_angle_text(angles[i], unit)}, but the angle sum at a vertex is a sum "
            f"of triangle angles and must be a positive number; {len(bad)} of the {len(angles)} listed "
            "angles are not.",
            field=(*field[i], "angle"),
        )


def _place(surface: Surface, entries: tuple[BoundaryAngle, ...], field: list[Field]) -> Ints:
    """(k,) mesh vertices the listed angles belong to."""
    if entries and not surface.loops:
        raise BoundaryError(
            f"{len(entries)} boundary angles are listed, but the surface is closed: it has no boundary.",
            field=field[0],
        )
    placed = np.zeros(len(entries), dtype=np.int64)
    sent = np.array([entry.vertex or 0 for entry in entries], dtype=np.int64)
    points = np.array([entry.point or (np.nan,) * 3 for entry in entries], dtype=float).reshape(-1, 3)
    is_named = np.array([entry.vertex is not None for entry in entries], dtype=bool)
    named, by_point = np.flatnonzero(is_named), np.flatnonzero(~is_named)
    placed[named] = _of_sent(surface, sent, named, field)
    if len(by_point):
        placed[by_point] = _nearest(surface, points, by_point, field)
    _check_distinct(surface, placed, field)
    return placed


def _of_sent(surface: Surface, sent: Ints, entries: Ints, field: list[Field]) -> Ints:
    """Vertices of entries that name a sent vertex."""
    if not len(entries):
        return entries
    wanted = sent[entries]
    unknown = entries[(wanted < 0) | (wanted >= len(surface.vertex_of_input))]
    if len(unknown):
        raise BoundaryError(
            f"Boundary angle {field[unknown[0]][-1]} names vertex {sent[unknown[0]]}, but only vertices 0 to "
            f"{len(surface.vertex_of_input) - 1} were sent.",
            field=(*field[unknown[0]], "vertex"),
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
            field=(*field[inside[0]], "vertex"),
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


def _nearest(surface: Surface, points: Floats, entries: Ints, field: list[Field]) -> Ints:
    """Boundary vertices nearest to the points of these entries."""
    bad = entries[~np.isfinite(points[entries]).all(axis=1)]
    if len(bad):
        raise BoundaryError(
            f"The point of boundary angle {field[bad[0]][-1]} has coordinates that are not finite numbers.",
            field=(*field[bad[0]], "point"),
        )
    boundary = np.concatenate(surface.loops)
    at = surface.vertices[boundary]
    distance, nearest = (np.asarray(x) for x in cKDTree(at).query(points[entries]))
    steps = [np.linalg.norm(np.diff(surface.vertices[loop], axis=0), axis=1).max() for loop in surface.loops]
    allowed = max(*steps, FAR * float(np.linalg.norm(np.ptp(at, axis=0))))
    far = np.flatnonzero(distance > allowed)
    if len(far):
        entry = entries[far[0]]
        raise BoundaryError(
            f"The point {place(points[entry])} is {length(distance[far[0]])} away from the boundary, whose "
            f"nearest vertex stands at {place(at[nearest[far[0]]])}: angles are for points on the boundary.",
            field=(*field[entry], "point"),
        )
    return np.asarray(boundary[nearest])


def _check_distinct(surface: Surface, placed: Ints, field: list[Field]) -> None:
    _, first, inverse = np.unique(placed, return_index=True, return_inverse=True)
    again = np.flatnonzero(first[inverse] != np.arange(len(placed)))
    if len(again):
        i, j = int(first[inverse][again[0]]), int(again[0])
        raise BoundaryError(
            f"Boundary angles {field[i][-1]} and {field[j][-1]} mean the same vertex of the surface "
            f"(sent vertex {surface.input_vertex[placed[i]]}); list each vertex once.",
            vertices=np.unique(surface.input_vertex[placed[again]]),
            field=(*field[j], "vertex"),
        )


def _name(vertices: Ints) -> str:
    if len(vertices) == 1:
        return f"vertex {vertices[0]} is"
    shown = ", ".join(str(v) for v in vertices[:6]) + (", …" if len(vertices) > 6 else "")
    return f"vertices {shown} are"


def _close(
    surface: Surface,
    target: Floats,
    listed: Bools,
    sums: list[float],
    total: float,
    quantum: float | None,
) -> tuple[Floats, ...]:
    """Spreads the small rest of Gauss–Bonnet."""
    free = [loop[~listed[loop]] for loop in surface.loops]
    rest = _rest_per_loop(sums, total, quantum)
    if rest is not None:  # where every vertex of a loop is listed, all of them give way
        free = [f if len(f) else loop for f, loop in zip(free, surface.loops, strict=True)]
    else:
        if not any(len(f) for f in free):
            free = list(surface.loops)  # every vertex is listed: all of them give way
        count = np.array([len(f) for f in free])
        rest = (sum(sums) - total) * count / max(count.sum(), 1)
    angle = target.copy()
    for vertices, too_much in zip(free, rest, strict=True):
        angle[vertices] += too_much / max(len(vertices), 1)
    return tuple(angle[loop] for loop in surface.loops)


def _rest_per_loop(sums: list[float], total: float, quantum: float | None) -> Floats | None:
    """What each loop's sum has above the nearest multiple of the quantum; None where none is near."""
    if quantum is None or not sums:
        return None
    rest = np.array(sums) - rounded_jointly(np.array(sums), quantum, total)
    return rest if np.abs(rest).max() <= GAUSS_BONNET_TOLERANCE else None


def _gauss_bonnet_error(
    surface: Surface,
    listed: _Listed,
    sums: list[float],
    total: float,
    cones: Cones | None,
    condition: BoundaryCondition,
) -> BoundaryError | GaussBonnetError | SingularitiesError:
    """What is missing, and an example that would close it."""
    unit, vertices, angles = condition.angle_unit, listed.vertex, listed.angle
    if not surface.loops or (not len(angles) and (len(surface.loops) == 1 or cones is not None)):
        return _topology_error(surface, total, cones)
    missing = sum(sums) - total  # angles must grow by this much in total
    unlisted = sum(len(loop) for loop in surface.loops) - len(vertices)
    least = float((np.pi - angles).sum()) + unlisted * np.pi - total
    if least <= 0:
        i = int(angles.argmax())
        are_degrees = unit != "deg" and angles[i] > DEGREES * ANGLE_UNITS[unit]
        return BoundaryError(
            f"The listed boundary angles are too large for any surface: their curvatures π − θ add up to "
            f"{_angle_text((np.pi - angles).sum(), unit)}, and even with angles of 0 at all the other "
            f"{unlisted} boundary vertices the sum over all loops, equation (1), would be "
            f"{_angle_text(least, unit)} too small; the largest is {_angle_text(angles[i], unit)} at vertex "
            f"{surface.input_vertex[vertices[i]]}."
            + (' If angles are given in degrees, set angle_unit to "deg".' if are_degrees else ""),
            vertices=[surface.input_vertex[vertices[i]]],
            field=(*listed.field[i], "angle"),
        )
    example, sentence = _repair(surface, vertices, angles, missing, unlisted, unit)
    degrees = "" if unit == "deg" else f" ({np.degrees(missing):.6g}°)"
    each = [f"{_angle_text(one, unit)} on loop {i}" for i, one in enumerate(sums)]
    added = each[0] if len(each) == 1 else ", ".join(each[:-1]) + f" and {each[-1]}"
    if len(sums) == 2 and not cones:
        wanted = (
            "equation (1) wants the two sums to cancel, but together they make "
            f"{_angle_text(missing, unit)}{degrees}"
        )
    else:
        wanted = (
            f"by Gauss–Bonnet they must make {_angle_text(total, unit)} "
            f"{'with these singularities' if cones else 'in all'}, which they exceed by "
            f"{_angle_text(missing, unit)}{degrees}"
        )
    return GaussBonnetError(
        f"The boundary curvatures π − θ add up to {added}; {wanted}, so the angles must add up to "
        f"{_angle_text(abs(missing), unit)} {'more' if missing > 0 else 'less'}: {sentence}.",
        vertices=surface.input_vertex[vertices],
        field=("angles",),
        data={"loop_sums": sums, "missing": missing, "example": example, "example_unit": unit},
    )


def _topology_error(
    surface: Surface, total: float, cones: Cones | None
) -> GaussBonnetError | SingularitiesError:
    """Where no boundary angle was listed: what this kind of surface asks for."""
    loops, quantum = len(surface.loops), np.pi / 3 if cones is None else cones.quantum
    wanted = round(gauss_bonnet(surface) / quantum)
    data: dict[str, object] = {"loops": loops, "index_sum": wanted, "quantum": quantum}
    example = "twelve pentagons" if wanted == 12 else f"indices that add up to {wanted}"
    if cones:
        return SingularitiesError(
            f"The singularities have indices that add up to {int(cones.index.sum())}, but "
            f"{'a closed surface needs' if not loops else 'straight boundaries need'} {wanted}, in multiples "
            f"of {np.degrees(quantum):.4g}° (Gauss–Bonnet): add or change singularities until they do"
            f"{', or ask for an isometric boundary' if loops else ''}.",
            data={**data, "indices": int(cones.index.sum())},
        )
    if not loops:
        return SingularitiesError(
            "The surface is closed, so it has no map without singularities: by Gauss–Bonnet their indices "
            f"add up to {wanted} (with hexagons {example}); place some, or cut two openings into it.",
            data=data,
        )
    return GaussBonnetError(
        "A surface with one boundary loop cannot have a straight boundary: its boundary must turn by 360° in "
        "all. Ask for an isometric boundary, list corners (mode angles; for example four of 90°, or six of "
        f"120°), or place singularities whose indices add up to {wanted}.",
        field=("mode",),
        data={"loop_sums": [0.0], "missing": -total},
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
            f"for example {_angle_text(repaired[i], unit, 8)} instead of {_angle_text(angles[i], unit)} at "
            f"vertex {changed[i]} would close it"
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
        f"for example angles of {_angle_text(angle, unit, 8)} at {count} more boundary "
        f"{'vertex' if count == 1 else 'vertices'} ({named}{', …' if count > 6 else ''}) would close it"
    )
    return (
        np.concatenate([angles, np.full(count, angle)]),
        surface.input_vertex[np.concatenate([vertices, chosen])],
        sentence,
    )
