"""Placement on a sheet: a domain whose holonomy has one generator g: z ↦ ρz + t, or none (a disk).

It is the placement on a net (``net``) with nothing to search for. Of the energy that rounding asks for

- nothing is left where g turns: each translation τ leads to a place of the origin under which g is ρW + τ
  exactly. The one is taken that brings the apex to 0, a centre of the full symmetry;
- where g is a translation, c·|τ − At|² is left: the answer to τ − At is linear over ℂ, since a deformation
  that is turned as a whole is as large as before. The nearest translation of the tiling is the best one.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Complexes, Ints
from hexwrap_solver.conformal.types import ConformalMap, Deck, Unrolled
from hexwrap_solver.pattern.lattice import Isometry, Lattice
from hexwrap_solver.pattern.place.deform import System, deform
from hexwrap_solver.pattern.place.glued import Glued
from hexwrap_solver.pattern.place.placement import Placement, anchor_vertex, is_disk
from hexwrap_solver.pattern.place.size import ASKED, cells_around, counts_near, edges_around, girth
from hexwrap_solver.pattern.place.target import Target, middle
from hexwrap_solver.pattern.types import PatternSettings

#: A translation g shorter than this part of the circumference is none.
NO_SHIFT = 1e-9
#: Of the numbers of cells around that come near what is asked, this many are compared.
MOST_COUNTS = 200
#: Half an edge towards the apex must not turn cells as large as the cone inside out.
LEAST_GROWTH = 0.1


def place_on_sheet(
    cmap: ConformalMap, lattice: Lattice, settings: PatternSettings, cone_index: int
) -> Placement:
    """On cones, flat rings and disks, aligned nowhere. Scale and rotation are as asked, or as follows from a
    translation of the tiling that is near to g; where none is, because g is short against the cells, the
    layout is deformed a little.

    phase: moves the anchor; about an apex around by cells at the middle ring, and up or down by edges there.
    """
    target, deck = Target.of(cmap, lattice, settings), cmap.deck
    if deck.apex is not None:
        turn, factor = _about_apex(cmap, target, settings)
        place = (cmap.uv - deck.apex) * (factor * turn)
        return laid(cmap, target, Isometry(lattice, cone_index, (0, 0)), factor, place)
    if not is_disk(cmap):
        edges_around(cmap, settings, target.edge)
    wanted = target.factor * deck.translation
    shift = translations(lattice, wanted)[0]
    nearest = complex(lattice.position(shift))
    near = nearest != 0 and abs(nearest / wanted - 1) < ASKED
    factor = nearest / deck.translation if near else target.factor
    closes = abs(deck.translation) < NO_SHIFT * cmap.circumference
    origin = middle(cmap) if closes and not is_disk(cmap) else cmap.uv[anchor_vertex(cmap)]
    place = (cmap.uv - origin) * factor + target.phase(settings, lattice.edge)
    return laid(cmap, target, Isometry(lattice, cone_index, (int(shift[0]), int(shift[1]))), factor, place)


def translations(
    lattice: Lattice, wanted: complex, *, rows: bool = False, around: int | None = None, spread: float = 0.0
) -> Ints:
    """(k, 2) translations of the tiling that g may become, the nearest to the wanted one first.

    rows: g shall run along an edge or across a corner; numbers of such steps within the spread. around: else
    with that number of cells around, where not None.
    """
    if rows:
        row = lattice.shortest_towards(wanted)
        counts = counts_near(abs(wanted) / abs(complex(lattice.position(row))), spread, MOST_COUNTS)
        return np.asarray(counts.astype(np.int64)[:, None] * row)
    return (lattice.translation_near(wanted) if around is None else lattice.ring_near(around, wanted))[None]


def _about_apex(cmap: ConformalMap, target: Target, settings: PatternSettings) -> tuple[complex, complex]:
    """By what the phase turns the lattice about the apex, and the factor by then. Whole edges up are left
    out, since they would change the size, and so are turns by which the lattice is symmetric."""
    lattice, (around, up) = target.lattice, settings.phase
    radius = cmap.circumference / abs(cmap.deck.angle) * abs(target.factor)
    turn = math.remainder(around * target.width / radius, lattice.quantum)
    up -= math.ceil(up - 0.5)
    return complex(np.exp(1j * turn)), target.factor * max(1 + up * lattice.edge / radius, LEAST_GROWTH)


def laid(
    cmap: ConformalMap,
    target: Target,
    motion: Isometry,
    factor: complex,
    place: Complexes,
    distortion: float = 0.0,
    notes: tuple[str, ...] = (),
    step: int = 1,
) -> Placement:
    """The placement where vertices stand at place (n,), ∂W/∂z being factor; deformed where g does not become
    the motion by that. distortion: of what was done to the domain before."""
    if cmap.deck.apex is None:
        off = factor * cmap.deck.translation - complex(motion.lattice.position(np.array(motion.shift)))
        if abs(off) > NO_SHIFT * abs(factor) * cmap.circumference:
            nowhere, glued = np.zeros((len(place), 2)), Glued.by_sheets(cmap, motion)
            system = System(cmap, glued, nowhere.astype(complex))
            place, distortion = deform(system, glued, factor, place, nowhere)
    around = cells_around(cmap, motion, abs(factor), target.width)
    return Placement.on_sheet(cmap, place, motion, target.rotation(factor), around, distortion, notes, step)


def as_sheet(cmap: ConformalMap) -> ConformalMap:
    """A net that is glued nowhere (a disk) as the sheet that it is: g is the identity. Others as they are."""
    if cmap.kind != "net" or np.any(cmap.net.crossing):
        return cmap
    place = np.zeros(len(cmap.surface.vertices), dtype=complex)
    place[cmap.surface.faces.ravel()] = cmap.corners().ravel()
    sheet = np.zeros(cmap.surface.faces.shape, dtype=np.int64)
    return replace(cmap, domain=Unrolled(place, sheet, Deck(0.0, 0j), girth(cmap)))
