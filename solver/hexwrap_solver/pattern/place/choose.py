"""Choosing the way in which the lattice is placed on a domain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.place.align import Straightening, place_by_sides, turn_between_loops
from hexwrap_solver.pattern.place.cone import place_on_cone, place_on_flat_ring
from hexwrap_solver.pattern.place.cylinder import place_on_cylinder
from hexwrap_solver.pattern.place.net import as_sheet, place_on_net
from hexwrap_solver.pattern.place.placement import (
    BEARABLE,
    Placement,
    check_phase,
    edge_angle,
    is_disk,
    is_straight,
    quantized,
    quantum_turns,
)
from hexwrap_solver.pattern.place.sides import has_corners, is_polygon
from hexwrap_solver.pattern.types import PatternSettings


def place_lattice(cmap: ConformalMap, lattice: Lattice, settings: PatternSettings) -> Placement:
    """The way of placing that suits the domain and what is to be aligned."""
    return Placing.of(cmap, lattice, settings).at(settings)


@dataclass(frozen=True)
class Placing:
    """Ways of placing that differ in the size of the cells alone: what they share is computed once.

    loops: those to align. shape: settings whose sizes do not matter.
    """

    cmap: ConformalMap
    lattice: Lattice
    shape: PatternSettings
    turns: int
    loops: list[int]
    notes: list[str]

    @classmethod
    def of(cls, cmap: ConformalMap, lattice: Lattice, settings: PatternSettings) -> Placing:
        check_phase(settings)
        cmap = as_sheet(cmap) if cmap.kind == "net" else quantized(cmap, lattice)
        loops, notes = loops_to_align(cmap, lattice, settings)
        turns = 0 if cmap.kind == "net" else quantum_turns(cmap, lattice)
        return cls(cmap, lattice, settings, turns, loops, notes)

    def at(self, settings: PatternSettings) -> Placement:
        """settings: those it was made for, but for the size."""
        cmap, lattice, loops = self.cmap, self.lattice, self.loops
        if cmap.kind == "net":
            placement = place_on_net(cmap, lattice, settings, loops)
        elif self.is_cylinder and not any(has_corners(cmap, lattice, loop) for loop in loops):
            placement = place_on_cylinder(cmap, lattice, settings, loops)
        elif loops:
            placement = self._by_sides(settings)
        else:
            placement = self._freely(settings)
        return replace(placement, notes=(*self.notes, *placement.notes))

    @property
    def is_cylinder(self) -> bool:
        """And no disk."""
        return self.turns == 0 and not is_disk(self.cmap)

    @cached_property
    def _straightening(self) -> Straightening:
        return Straightening.of(self.cmap, self.lattice, self.shape, self.turns, self.loops)

    @cached_property
    def _single_straightenings(self) -> list[Straightening]:
        """Of each of two loops alone."""
        loops = self.loops if len(self.loops) == 2 else []
        return [Straightening.of(self.cmap, self.lattice, self.shape, self.turns, [loop]) for loop in loops]

    def _freely(self, settings: PatternSettings) -> Placement:
        """Aligned nowhere."""
        if self.is_cylinder:
            return place_on_cylinder(self.cmap, self.lattice, settings, [])
        if is_disk(self.cmap):
            return place_on_net(self.cmap, self.lattice, settings)
        if self.cmap.deck.is_translation:
            return place_on_flat_ring(self.cmap, self.lattice, settings, self.turns)
        return place_on_cone(self.cmap, self.lattice, settings, self.turns)

    def _by_sides(self, settings: PatternSettings) -> Placement:
        """Aligned on as many of the loops as bearable deformations allow."""
        cmap, lattice, loops = self.cmap, self.lattice, self.loops
        tried = place_by_sides(self._straightening, settings)
        if tried.distortion <= BEARABLE:
            return tried
        cost = f"distort cells by {tried.distortion:.2f}, more than {BEARABLE:g}"
        if not np.isfinite(tried.distortion):
            cost = "fold the layout over"
        told = (
            f"To align loop {' and loop '.join(map(str, loops))} at this size would {cost}: smaller cells, "
            "or corners elsewhere, fit better."
        )
        turned = abs(np.rad2deg(turn_between_loops(cmap, lattice, loops)))
        if turned > 1:
            told += f" The sides of the two loops stand at {turned:.1f}° to each other about the apex."
        fewer = [place_by_sides(single, settings) for single in self._single_straightenings]
        best = min(fewer, key=lambda placement: placement.distortion, default=tried)
        if best.distortion > BEARABLE:
            best = self._freely(settings)
        return replace(best, notes=(told, *best.notes))


def loops_to_align(
    cmap: ConformalMap, lattice: Lattice, settings: PatternSettings
) -> tuple[list[int], list[str]]:
    """Loops on which lattice lines can lie, of those on which they should."""
    wanted: list[int] = {"none": [], "first": [0], "both": [0, 1]}[settings.align]
    if wanted and not is_straight(lattice, edge_angle(lattice, settings)):
        angle = np.rad2deg(edge_angle(lattice, settings))
        return [], [
            f"With edges at {angle:.4g}° to the boundary no lattice line can lie on it: the pattern is not "
            "aligned."
        ]
    wanted = wanted[: len(cmap.surface.loops)]
    if cmap.kind == "net":
        if cmap.fitted is not None:
            return [], []
        if settings.align == "both":  # all that can be
            wanted = list(range(len(cmap.surface.loops)))
    loops = [loop for loop in wanted if is_polygon(cmap, lattice, loop)]
    if len(loops) == len(wanted):
        return loops, []
    if cmap.kind == "net" and not loops:
        return [], []
    curved = " and on ".join(f"loop {loop}" for loop in wanted if loop not in loops)
    return loops, [
        f"The pattern is not aligned on {curved}: only a boundary of straight sides with corners of "
        "quantized angles can be a lattice line."
    ]
