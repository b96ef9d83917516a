"""Periodic boundary conditions (paper, section 3.1): from what is asked to targets of the energy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.conformal.types import Cones, Targets
from hexwrap_solver.errors import BoundaryError
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.tolerances import ANGLE

#: What a loop may be asked for: prescribed angle sums (k,), u = 0 (the angles come out), or a prescribed
#: curvature Σκ with u constant on the loop.
LoopTarget = Floats | Literal["isometric"] | float


def gauss_bonnet(surface: Surface) -> float:
    """2πχ, what the curvatures of all loops and cones add up to: equation (1) of the paper, χ = 0, and its
    like on all other surfaces of genus 0."""
    return 2 * np.pi * (2 - len(surface.loops))


def targets(surface: Surface, loops: Sequence[LoopTarget], cones: Cones | None = None) -> Targets:
    """Targets from what each loop is asked for, aligned with surface.loops, and cones.

    Isometric loops are pinned at u = 0. Where there are none, the first loop of prescribed curvature is, and
    its curvature is what Gauss–Bonnet leaves.
    """
    n = len(surface.vertices)
    angle = np.full(n, 2 * np.pi)
    shared = np.full(n, -1, dtype=np.int64)
    pinned = any(isinstance(wanted, str) for wanted in loops)
    sums = [0.0]
    for loop, wanted in zip(surface.loops, loops, strict=True):
        angle[loop] = np.pi
        if isinstance(wanted, str):
            shared[loop] = 0
        elif isinstance(wanted, np.ndarray):
            angle[loop] = wanted
        elif pinned:
            shared[loop] = len(sums)
            sums.append(len(loop) * np.pi - wanted)
        else:
            shared[loop], pinned = 0, True
    if cones is not None:
        angle[cones.vertex] -= cones.curvature
    return Targets(angle, shared, np.array(sums if pinned else []))


def straight(surface: Surface) -> Targets:
    """Every boundary angle π: a straight cylinder."""
    return targets(surface, [np.full(len(loop), np.pi) for loop in surface.loops])


def cone_angle(boundary_angles: Floats) -> float:
    """Σκ = Σ(π − Θ) over a loop."""
    return float((np.pi - boundary_angles).sum())


def curvatures(targets: Targets, sums: Floats, surface: Surface, cones: Cones | None = None) -> Floats:
    """(b + c,) Σκ of every loop and cone of a solution, exactly as prescribed where they are.

    sums: (n,) angle sums found. What is prescribed for no loop is found; where it is for all but one, that
    one takes what Gauss–Bonnet leaves.
    """
    cones = Cones.none() if cones is None else cones
    found = np.zeros(len(surface.loops))
    open_ = np.zeros(len(surface.loops), dtype=bool)
    for i, loop in enumerate(surface.loops):
        shared = int(targets.shared[loop[0]])
        if shared > 0:
            found[i] = len(loop) * np.pi - float(targets.shared_angle[shared])
        else:
            open_[i] = shared == 0
            found[i] = cone_angle((sums if shared == 0 else targets.angle)[loop])
        found[i] = snapped(found[i])
    rest = gauss_bonnet(surface) - float(cones.curvature.sum())
    last = np.flatnonzero(open_)[-1:] if open_.any() else np.arange(len(found))[-1:]
    if len(last):
        found[last] = snapped(rest - float(np.delete(found, last).sum()))
    return np.concatenate([found, cones.curvature])


def snapped(angle: float) -> float:
    """The cone angle without rounding: a multiple of π/6, which holds all quanta, that is as good as it.

    g must be an exact symmetry of the pattern."""
    nearest = nearest_multiple(angle, np.pi / 6)
    return nearest if abs(angle - nearest) < ANGLE else angle


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


def rounded_jointly(found: Floats, quantum: float, total: float) -> Floats:
    """(k,) multiples of the quantum that add up to ``total``, as near to ``found`` (k,) as possible.

    Where the total is not a multiple, because prescribed loops are not, the last one takes the rest.
    """
    steps = np.round(found / quantum)
    missing = round(total / quantum - float(steps.sum()))
    order = np.argsort(np.sign(missing) * (steps - found / quantum), kind="stable")
    steps += np.bincount(order[np.arange(abs(missing)) % len(found)], minlength=len(found)) * np.sign(missing)
    rounded = steps * quantum
    rest = total - float(rounded.sum())
    if abs(rest) > ANGLE:
        rounded[-1] += rest
    return np.asarray(rounded)
