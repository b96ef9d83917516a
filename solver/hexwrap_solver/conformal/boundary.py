"""Periodic boundary conditions (paper, section 3.1): from what is asked to targets of the energy."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.conformal.types import Targets
from hexwrap_solver.errors import BoundaryError
from hexwrap_solver.surface.types import Surface

#: A cone angle this near to a multiple of π/6 (that holds all quanta) is that multiple: sums of many angles
#: carry rounding, and g must be an exact symmetry of the pattern. Near 0 the domain is a cylinder.
SNAP = 1e-9


def straight(surface: Surface) -> Targets:
    """Every boundary angle π: a straight cylinder."""
    n = len(surface.vertices)
    angle = np.full(n, 2 * np.pi)
    angle[np.concatenate(surface.loops)] = np.pi
    return Targets(angle, np.full(n, -1, dtype=np.int64), np.zeros(0))


def prescribed(surface: Surface, boundary_angles: tuple[Floats, Floats]) -> Targets:
    """Angle sums given for each loop, aligned with surface.loops."""
    targets = straight(surface)
    angle = targets.angle.copy()
    for loop, angles in zip(surface.loops, boundary_angles, strict=True):
        angle[loop] = angles
    return Targets(angle, targets.tie, targets.tie_angle)


def isometric(surface: Surface) -> Targets:
    """u = 0 on both loops; the cone angle is what comes out."""
    targets = straight(surface)
    tie = targets.tie.copy()
    tie[np.concatenate(surface.loops)] = 0
    return Targets(targets.angle, tie, np.zeros(1))


def constant_on_loops(surface: Surface, cone_angle: float) -> Targets:
    """u = 0 on loop 0, one unknown constant on loop 1, whose total angle makes the cone angle K."""
    targets = straight(surface)
    tie = targets.tie.copy()
    tie[surface.loops[0]], tie[surface.loops[1]] = 0, 1
    total = len(surface.loops[1]) * np.pi + cone_angle  # Σκ over loop 1 is −K
    return Targets(targets.angle, tie, np.array([0.0, total]))


def cone_angle(boundary_angles: Floats) -> float:
    """Σκ = Σ(π − Θ) over a loop."""
    return float((np.pi - boundary_angles).sum())


def cone_angle_of(targets: Targets, sums: Floats, surface: Surface) -> float:
    """K of a solution, exactly as prescribed where it is: Σκ over loop 0, or −Σκ over a tied loop 1.

    sums: (n,) angle sums, prescribed or found.
    """
    if len(targets.tie_angle) > 1:
        angle = float(targets.tie_angle[1]) - len(surface.loops[1]) * np.pi
    else:
        angle = cone_angle(sums[surface.loops[0]])
    return snapped(angle)


def snapped(angle: float) -> float:
    """The cone angle without rounding, see SNAP."""
    nearest = nearest_multiple(angle, np.pi / 6)
    return nearest if abs(angle - nearest) < SNAP else angle


def nearest_multiple(angle: float, quantum: float) -> float:
    """The multiple of quantum nearest to the angle."""
    return float(np.round(angle / quantum)) * quantum


def spread_evenly(angles: Floats, curvature: float) -> Floats:
    """(k,) the loop's angles with the same amount added to each, so that Σκ is ``curvature`` (the paper).

    Where that would take more than half of a vertex's angle, it gives half, and the others share the rest;
    where every vertex would have to give more than half, all give the same part of their angle.
    Raises BoundaryError where nothing would be left of them.
    """
    missing = cone_angle(angles) - curvature
    total = float(angles.sum())
    if missing <= -total / 2:
        if missing <= -total:
            raise BoundaryError(
                f"The angles of a boundary loop of {len(angles)} vertices sum to {total:.4g} rad, too "
                f"little to turn by {-missing:.4g} rad to a quantized cone angle; send a finer mesh.",
                field=("quantum",),
            )
        return np.asarray(angles * (1 + missing / total))
    change = np.zeros_like(angles)
    open_ = np.ones(len(angles), dtype=bool)
    while open_.any():
        change[open_] = (missing - change[~open_].sum()) / open_.sum()
        capped = open_ & (change < -angles / 2)
        if not capped.any():
            break
        change[capped] = -angles[capped] / 2
        open_ &= ~capped
    return np.asarray(angles + change)
