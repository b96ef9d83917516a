"""Placement on a cylinder: which translations g may become, and rows of cells along straight boundaries.

The size counts cells around: g becomes a translation exactly, by scale and rotation alone, however far that
is from what is asked. Which one is open, though: numbers of rows' cells around, where rows run along the
boundary, of which one may suit the height between the loops better; or directions, where they do not. Along
straight loops the lattice can still be moved up and stretched, so that they lie on lattice lines.
"""

from __future__ import annotations

import math

import numpy as np

from hexwrap_solver.arrays import Complexes
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Isometry, Lattice
from hexwrap_solver.pattern.place.deform import distortion_of
from hexwrap_solver.pattern.place.glued import Glued
from hexwrap_solver.pattern.place.placement import BEARABLE, Placement, anchor_vertex, is_straight
from hexwrap_solver.pattern.place.rows import rows_along
from hexwrap_solver.pattern.place.sheet import laid, translations
from hexwrap_solver.pattern.place.sides import is_line
from hexwrap_solver.pattern.place.size import edges_around, fitting_number, size_spread
from hexwrap_solver.pattern.place.target import Target
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.tolerances import ANGLE, TINY


def place_on_cylinder(
    cmap: ConformalMap, lattice: Lattice, settings: PatternSettings, loops: list[int]
) -> Placement:
    """Scale and rotation follow from the translation; height and turn from the loops to align and ``phase``.

    loops: straight ones, or nearly, on each of which a lattice line shall lie.
    """
    t, anchor = cmap.deck.translation, anchor_vertex(cmap)
    target = Target.of(cmap, lattice, settings)
    place, height = _unrolled(cmap, anchor, loops)
    rows, straight = rows_along(lattice, target.angle, settings.boundary), is_straight(lattice, target.angle)
    edges = edges_around(cmap, settings, target.edge)
    wanted = edges * lattice.edge * complex(np.exp(-1j * target.angle) * lattice.forward)
    spread = 0.0 if settings.around is not None else size_spread(settings)
    options = translations(lattice, wanted, rows=straight, around=settings.around, spread=spread)
    if not options.any():  # of cells larger than the cylinder one goes around
        options = lattice.ring_near(1, wanted)[None]
    step = 1 if settings.around is None else lattice.counted
    if straight:
        step = int(lattice.cells_around(lattice.primitive(options[0])))
    T, stretch, notes = options[0], 1.0, []
    if len(loops) == 2:
        # By which factors heights must change for a whole number of rows to fit between the loops.
        between = (abs(height[1] - height[0]) * abs(lattice.position(options)) / abs(t)).tolist()
        stretches = np.array([max(rows.nearest_height(one) / one, TINY) for one in between])
        pick = int(np.argmin(abs(np.log(stretches)).round(9)))  # of equal ones that nearest in size
        if max(stretches[pick], 1 / stretches[pick]) - 1 > BEARABLE:
            loops, notes = loops[:1], [_unbearable(cmap, lattice, target.angle, float(stretches[pick]))]
        else:
            T, stretch = options[pick], float(stretches[pick])
    along = complex(lattice.position(T))
    factor, unit = along / t, along / abs(along)
    taken = target.rotation(factor)
    if abs(taken - target.angle) > ANGLE:
        notes.append(
            f"Edges stand at {np.rad2deg(taken):.4f}° to the boundary instead of "
            f"{np.rad2deg(target.angle):.4f}°: the nearest angle at which the pattern closes up."
        )
    if not loops:
        level, line, phase = 0.0, 0.0, target.phase(settings, rows.period, unit) / unit
    else:
        if settings.phase[1]:
            notes.append("phase moves the pattern only around: its rows are bound to the boundary.")
        anchored = int(anchor in cmap.surface.loops[1])
        loop = anchored if anchored in loops else loops[0]
        level, line = height[loop], -rows.first if height[loop] > height[1 - loop] else rows.first
        shortest = abs(complex(lattice.position(lattice.primitive(T))))
        phase = complex(math.remainder(settings.phase[0] * target.width, shortest))
    scale = abs(along) / abs(t)
    place = place.real * scale + 1j * (line + (place.imag - level) * (scale * stretch))
    place = (place + phase) * unit
    distortion, motion = max(stretch, 1 / stretch) - 1, Isometry(lattice, 0, (int(T[0]), int(T[1])))
    if not all(is_line(cmap, loop) for loop in loops):
        distortion = distortion_of(cmap, Glued.by_sheets(cmap, motion), place)
    return laid(cmap, target, motion, factor, place, distortion, tuple(notes), step)


def _unrolled(cmap: ConformalMap, anchor: int, loops: list[int]) -> tuple[Complexes, tuple[float, float]]:
    """The domain turned so that g is a shift along x, the anchor at 0; and the mean height of each loop."""
    t = cmap.deck.translation
    place = (cmap.uv - cmap.uv[anchor]) * np.conj(t) / abs(t)
    low, high = (float(place[loop].imag.mean()) for loop in cmap.surface.loops[:2])
    for which in loops:  # nearly straight, made exactly so; what that takes fades towards the other loop
        loop, height = cmap.surface.loops[which], (low, high)[which]
        here = place[loop]
        fade = np.clip(1 - abs(place.imag - height) / abs(high - low), 0.0, 1.0)
        place -= 1j * fade * np.interp(place.real, here.real, here.imag - height, period=abs(t))
        place[loop] = here.real + 1j * height
    return place, (low, high)


def _unbearable(cmap: ConformalMap, lattice: Lattice, angle: float, stretch: float) -> str:
    enough, _ = fitting_number(cmap, lattice, angle)
    if stretch <= TINY:
        why = "No row of this size fits between both loops"
    else:
        change = f"{'stretch' if stretch > 1 else 'flatten'} the rows by {max(stretch, 1 / stretch) - 1:.0%}"
        why = f"To align both loops at this size would {change}, more than {BEARABLE:.0%}"
    return f"{why}, so that only one is aligned; with {enough} cells around both would be."
