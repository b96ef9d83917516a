"""Placement where the boundary has corners: every straight side on a lattice line (Figures 5–7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.deform import deform, distortion_of
from hexwrap_solver.pattern.lattice import Lattice, Motion
from hexwrap_solver.pattern.placement import Placement, edge_angle
from hexwrap_solver.pattern.rows import Rows, rows_along
from hexwrap_solver.pattern.sides import Sides, sides_of
from hexwrap_solver.pattern.size import size_spread, wanted_edge, width_per_cell
from hexwrap_solver.pattern.types import PatternSettings

#: Scales tried, from the smallest to the largest admissible.
SCALES = 241

#: Costs, beside the squares of the sides' offsets in rows: of a size off the wanted one by its whole
#: spread; of all corners standing on cells instead of nodes.
COST_OF_SIZE, COST_OF_CORNERS = 0.002, 0.02


@dataclass(frozen=True)
class _Trial:
    """W = scale·(z − apex) + origin before the deformation, what g becomes, and the line of each side."""

    cost: float
    scale: complex
    origin: complex
    motion: Motion
    depth: Floats


def place_by_sides(
    cmap: ConformalMap, lattice: Lattice, settings: PatternSettings, turns: int, loops: list[int]
) -> Placement:
    """Scale, centre and lines with the smallest offsets, then the deformation that removes them."""
    angle = edge_angle(lattice, settings)
    sides = sides_of(cmap, lattice, loops)
    rows = rows_along(lattice, angle, settings.boundary)
    zero = complex(lattice.position(lattice.steps[0])) / lattice.edge * np.exp(-1j * angle)
    turn = _turns(cmap, lattice, sides, zero)
    # Directions are exact up to rounding of the boundary angles; from here on they are exact.
    steps = np.rint(np.angle(sides.direction * turn / zero) / lattice.quantum)
    normal = 1j * zero * np.exp(1j * lattice.quantum * steps)
    depth = _mean_depth(cmap, sides, normal, turn)
    unit = complex(turn.mean() / abs(turn.mean()))
    size = lattice.edge / wanted_edge(cmap, lattice, settings, angle)
    spread = size_spread(settings)
    trials = [
        _best_at(cmap, lattice, sides, rows, normal, depth, turns, size * (1 + spread * x) * unit, abs(x))
        for x in np.linspace(-1, 1, SCALES)
    ]
    best = min(trials, key=lambda trial: trial.cost)
    rest = best.scale * (cmap.uv - (cmap.deck.apex or 0)) + best.origin
    lines = _lines(cmap, lattice, sides, normal, best)
    place = deform(cmap, best.motion, best.scale, rest, *lines)
    width = width_per_cell(lattice, angle) * lattice.edge
    around = round(cmap.circumference * abs(best.scale) / width)
    if turns == 0:
        around = int(lattice.cells_around(np.array(best.motion.shift)))
    notes = (
        ("phase has no effect: lattice lines on all sides leave no freedom.",) if any(settings.phase) else ()
    )
    return Placement(place, best.motion, angle, around, distortion_of(cmap, best.motion, place), notes)


def _best_at(
    cmap: ConformalMap,
    lattice: Lattice,
    sides: Sides,
    rows: Rows,
    normal: Complexes,
    unit_depth: Floats,
    turns: int,
    scale: complex,
    off: float,
) -> _Trial:
    """The best centre and lines at one scale."""
    mean_depth = unit_depth * abs(scale)
    length = sides.length * abs(scale)
    trials = []
    for motion, origin in _origins(cmap, lattice, sides, rows, normal, turns, scale, mean_depth):
        depth = mean_depth + (normal.conj() * origin).real
        line = rows.first + rows.period * np.rint((depth - rows.first) / rows.period)
        miss = abs(depth - line)
        cost = float(((miss / rows.period) ** 2).mean() + ((miss / length) ** 2).max())
        cost += COST_OF_SIZE * off**2 + COST_OF_CORNERS * _corners_off_nodes(lattice, sides, normal, line)
        if motion.turns % lattice.order == 0:
            apart = abs(scale * cmap.deck.translation - complex(lattice.position(np.array(motion.shift))))
            cost += float(apart / rows.period) ** 2
        trials.append(_Trial(cost, scale, origin, motion, line))
    return min(trials, key=lambda trial: trial.cost)


def _turns(cmap: ConformalMap, lattice: Lattice, sides: Sides, zero: complex) -> Complexes:
    """(s,) rotations after which the sides have lattice directions, one for each loop on a cone.

    The sides of one loop differ by multiples of the quantum. Those of the other may be turned against them
    about the apex by any angle, which the deformation then has to make up for; the least one is taken. For
    a translation, no loop can turn by itself: one rotation for all.
    """
    loops = sides.loop if cmap.deck.apex is not None else np.zeros(sides.n, dtype=np.int64)
    turn = np.ones(sides.n, dtype=complex)
    before: complex | None = None
    for loop in np.unique(loops):
        on = loops == loop
        mean = complex((sides.length[on] * sides.direction[on] ** lattice.order).sum())
        unit = zero / complex(np.exp(1j * np.angle(mean) / lattice.order))
        if before is not None:
            steps = round(float(np.angle(before / unit)) / lattice.quantum)
            unit *= complex(np.exp(1j * lattice.quantum * steps))
        before = unit
        turn[on] = unit
    return turn


def turn_between_loops(cmap: ConformalMap, lattice: Lattice, loops: list[int]) -> float:
    """Angle about the apex between the sides of the two loops, modulo the quantum, 0 for one loop; rad."""
    turn = _turns(cmap, lattice, sides_of(cmap, lattice, loops), 1.0)
    return float(np.angle(turn[-1] / turn[0]))


def _mean_depth(cmap: ConformalMap, sides: Sides, normal: Complexes, turn: Complexes) -> Floats:
    """(s,) depth of each side's line at scale 1, measured from the apex, or from the layout's origin."""
    place = (sides.place - (cmap.deck.apex or 0)) * turn[sides.side]
    value = (normal[sides.side].conj() * place).real
    return np.asarray(np.bincount(sides.side, weights=value) / np.bincount(sides.side))


def _origins(
    cmap: ConformalMap,
    lattice: Lattice,
    sides: Sides,
    rows: Rows,
    normal: Complexes,
    turns: int,
    scale: complex,
    depth: Floats,
) -> list[tuple[Motion, complex]]:
    """Every way in which g can be a motion of the lattice, and where the apex, or the layout's origin, stands
    then: on a cone at the kinds of symmetry centres; for a translation as two sides may lie on lines."""
    apex = cmap.deck.apex
    if apex is not None:
        return symmetry_centres(lattice, turns)
    shift = lattice.translation_near(scale * cmap.deck.translation)
    motion = Motion(lattice, turns, (int(shift[0]), int(shift[1])))
    across = np.flatnonzero(abs((normal.conj() * normal[0]).imag) > 1e-6)
    if not len(across):
        return [(motion, complex(normal[0] * (rows.first - depth[0])))]
    p, q = normal[0], normal[across[0]]
    d = rows.first - depth[0]
    lines = rows.first + rows.period * np.arange(lattice.colours) - depth[across[0]]
    return [(motion, complex(1j * (e * p - d * q) / (np.conj(p) * q).imag)) for e in lines]


def symmetry_centres(lattice: Lattice, turns: int) -> list[tuple[Motion, complex]]:
    """Motions p ↦ ζ^turns·p + τ that differ by more than a translation of the lattice, with their fixed
    points: centres of 6-, 4-, 3- or 2-fold symmetry, the highest first."""
    zeta = np.exp(1j * lattice.quantum * turns)
    e1 = complex(lattice.position(lattice.basis[0]))
    found: list[tuple[Motion, complex]] = []
    reach = range(-2, 3)
    shifts = sorted(((x, y) for x in reach for y in reach), key=lambda v: abs(v[0] + v[1] * lattice.unit))
    for x, y in shifts:
        shift = x * lattice.basis[0] + y * lattice.basis[1]
        centre = complex(lattice.position(shift)) / (1 - zeta)
        apart = [lattice.coordinates(np.array((centre - other) / e1)) for _, other in found]
        if all(abs(a - np.rint(a)).max() > 1e-9 for a in apart):
            found.append((Motion(lattice, turns, (int(shift[0]), int(shift[1]))), centre))
    return found


def _corners_off_nodes(lattice: Lattice, sides: Sides, normal: Complexes, line: Floats) -> float:
    """Part of the corners between successive sides that stand on no node."""
    following = np.arange(1, sides.n + 1)
    for loop in np.unique(sides.loop):
        members = np.flatnonzero(sides.loop == loop)
        following[members[-1]] = -1  # the last corner is the first one again, a turn further
    inner = np.flatnonzero(following >= 0)
    p, q = normal[inner], normal[following[inner]]
    area = (p.conj() * q).imag
    meets = abs(area) > 1e-6
    inner, p, q, area = inner[meets], p[meets], q[meets], area[meets]
    if not len(inner):
        return 0.0
    corner = 1j * (line[following[inner]] * p - line[inner] * q) / area
    point = np.rint(lattice.coordinates(corner)).astype(np.int64)
    on_node = lattice.is_node(point) & (abs(lattice.position(point) - corner) < 1e-6)
    return float(1 - on_node.mean())


def _lines(
    cmap: ConformalMap, lattice: Lattice, sides: Sides, normal: Complexes, trial: _Trial
) -> tuple[Complexes, Floats]:
    """(n, 2) normals and depths of the lines on which each vertex must lie, in its own sheet."""
    n = len(cmap.uv)
    motion = trial.motion
    shift = lattice.position(motion.apply(np.zeros((len(sides.sheet), 2), dtype=np.int64), sides.sheet))
    turn = np.exp(1j * lattice.quantum * motion.rotation(sides.sheet))
    own = normal[sides.side] / turn
    depth = trial.depth[sides.side] - (normal[sides.side].conj() * shift).real
    normals, depths = np.zeros((n, 2), dtype=complex), np.zeros((n, 2))
    order = np.argsort(sides.vertex, kind="stable")
    vertex = sides.vertex[order]
    again = np.concatenate([[0], (vertex[1:] == vertex[:-1]).astype(np.int64)])
    parallel = np.concatenate([[False], abs(own[order][1:] - own[order][:-1]) < 1e-9]) & (again == 1)
    order, vertex, again = order[~parallel], vertex[~parallel], again[~parallel]
    normals[vertex, again] = own[order]
    depths[vertex, again] = depth[order]
    return normals, depths
