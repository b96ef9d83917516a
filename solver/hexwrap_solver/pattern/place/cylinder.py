"""Placement on a straight cylinder: the translation g must be a lattice vector, from which all follows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Isometry, Lattice
from hexwrap_solver.pattern.place.deform import distortion_of
from hexwrap_solver.pattern.place.glued import Glued
from hexwrap_solver.pattern.place.placement import BEARABLE, Placement, anchor_vertex, edge_angle, is_straight
from hexwrap_solver.pattern.place.rows import Rows, rows_along
from hexwrap_solver.pattern.place.sides import is_line
from hexwrap_solver.pattern.place.size import edges_around, fitting_number, size_spread, width_per_cell
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.tolerances import ANGLE, RELATIVE

#: Of the numbers of cells around that come near what is asked, this many are compared.
MOST_COUNTS = 200


@dataclass(frozen=True)
class _Strip:
    """The domain turned so that g is the shift by its length along x, and the anchor vertex stands at 0.

    height: mean height of each loop; anchored: the loop on which the anchor stands.
    """

    place: Complexes
    length: float
    height: tuple[float, float]
    anchored: int


def place_on_cylinder(
    cmap: ConformalMap, lattice: Lattice, settings: PatternSettings, loops: list[int]
) -> Placement:
    """Scale and rotation follow from the translation; height and turn from the loops to align and ``phase``.

    loops: straight ones, or nearly, on each of which a lattice line shall lie.
    """
    angle = edge_angle(lattice, settings)
    strip = _strip(cmap, anchor_vertex(cmap), loops)
    rows = rows_along(lattice, angle, settings.boundary)
    options, step = _translations(cmap, lattice, settings, angle)
    both = len(loops) == 2
    stretches = np.array([_stretch(strip, rows, lattice, T) if both else 1.0 for T in options])
    pick = int(np.argmin(abs(np.log(stretches))))
    T, stretch = options[pick], float(stretches[pick])
    sentences = []
    if max(stretch, 1 / stretch) - 1 > BEARABLE:
        loops, sentences = loops[:1], [_unbearable(cmap, lattice, angle, stretch)]
        T, stretch = options[0], 1.0
    along = complex(lattice.position(T))
    around = int(lattice.cells_around(T))
    notes = sentences + _direction_notes(lattice, angle, along)
    if loops and settings.phase[1]:
        notes.append("phase moves the pattern only around: its rows are bound to the boundary.")
    scale = abs(along) / strip.length
    unit = along / abs(along)
    # A translation of the tiling that keeps the rows, or any, changes nothing: far ones would cost digits.
    around_by = settings.phase[0] * width_per_cell(lattice, angle) * lattice.edge
    if loops:
        shortest = abs(complex(lattice.position(lattice.primitive(T))))
        phase = complex(math.remainder(around_by, shortest))
    else:
        phase = lattice.without_translations((around_by + 1j * settings.phase[1] * rows.period) * unit) / unit
    place = strip.place.real * scale + 1j * _heights(strip, rows, loops, scale * stretch)
    place = (place + phase) * unit
    distortion, motion = max(stretch, 1 / stretch) - 1, Isometry(lattice, 0, (int(T[0]), int(T[1])))
    if not all(is_line(cmap, loop) for loop in loops):
        distortion = distortion_of(cmap, Glued.by_sheets(cmap, motion), place)
    return Placement.on_annulus(
        cmap,
        place,
        motion,
        angle_taken(lattice, along, angle),
        around,
        distortion,
        tuple(notes),
        step,
    )


def angle_taken(lattice: Lattice, along: complex, wanted: float) -> float:
    """Angle from the direction of g to an edge, of all equivalent ones the nearest to the wanted one."""
    taken = float(np.angle(lattice.forward / along))
    return taken + lattice.quantum * round((wanted - taken) / lattice.quantum)


def _strip(cmap: ConformalMap, anchor: int, loops: list[int]) -> _Strip:
    t = cmap.deck.translation
    place = (cmap.uv - cmap.uv[anchor]) * np.conj(t) / abs(t)
    low, high = (float(place[loop].imag.mean()) for loop in cmap.surface.loops[:2])
    for which in loops:  # nearly straight, made exactly so; what that takes fades towards the other loop
        loop, height = cmap.surface.loops[which], (low, high)[which]
        here = place[loop]
        fade = np.clip(1 - abs(place.imag - height) / abs(high - low), 0.0, 1.0)
        place -= 1j * fade * np.interp(place.real, here.real, here.imag - height, period=abs(t))
        place[loop] = here.real + 1j * height
    return _Strip(place, abs(t), (low, high), int(anchor in cmap.surface.loops[1]))


def _translations(
    cmap: ConformalMap, lattice: Lattice, settings: PatternSettings, angle: float
) -> tuple[Ints, int]:
    """(k, 2) translations of the tiling that g may become, the nearest to what is asked first, and by how
    many cells around they differ."""
    toward = complex(np.exp(-1j * angle) * lattice.forward)
    edges = edges_around(cmap, lattice, settings, angle)
    wanted = edges * lattice.edge * toward
    if not is_straight(lattice, angle):
        if settings.around is None:
            return lattice.translation_near(wanted)[None], 1
        return lattice.ring_near(settings.around, wanted)[None], lattice.counted
    row = lattice.shortest_towards(toward)
    count = abs(wanted) / abs(complex(lattice.position(row)))
    spread = 0.0 if settings.around is not None else size_spread(settings)
    counts = np.arange(np.ceil(count * (1 - spread)), count * (1 + spread) + RELATIVE)
    counts = np.unique(np.append(counts, max(1, round(count)))).astype(np.int64)
    nearest = np.argsort(abs(counts - count), kind="stable")[:MOST_COUNTS]
    return np.asarray(counts[nearest][:, None] * row), int(lattice.cells_around(row))


def _stretch(strip: _Strip, rows: Rows, lattice: Lattice, T: Ints) -> float:
    """By which factor heights must change for a whole number of rows to fit between the loops."""
    height = abs(strip.height[1] - strip.height[0]) * abs(complex(lattice.position(T))) / strip.length
    return rows.nearest_height(height) / height


def _unbearable(cmap: ConformalMap, lattice: Lattice, angle: float, stretch: float) -> str:
    enough, _ = fitting_number(cmap, lattice, angle)
    return (
        f"To align both loops at this size would {'stretch' if stretch > 1 else 'flatten'} the rows by "
        f"{max(stretch, 1 / stretch) - 1:.0%}, more than {BEARABLE:.0%}, so that only one is aligned; with "
        f"{enough} cells around both would be."
    )


def _heights(strip: _Strip, rows: Rows, loops: list[int], scale: float) -> Floats:
    """Heights in lattice units; a loop that is aligned lies on a row line, exactly."""
    if not loops:
        return np.asarray(strip.place.imag * scale)
    loop = strip.anchored if strip.anchored in loops else loops[0]
    upper = strip.height[loop] > strip.height[1 - loop]
    line = -rows.first if upper else rows.first
    return line + (strip.place.imag - strip.height[loop]) * scale


def _direction_notes(lattice: Lattice, angle: float, along: complex) -> list[str]:
    notes = []
    taken = angle_taken(lattice, along, angle)
    if abs(taken - angle) > ANGLE:
        notes.append(
            f"Edges stand at {np.rad2deg(taken):.4f}° to the boundary instead of {np.rad2deg(angle):.4f}°: "
            "the nearest angle at which the pattern closes up."
        )
    return notes
