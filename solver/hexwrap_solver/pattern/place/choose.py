"""Choosing the way in which the lattice is placed on a domain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hexwrap_solver.arrays import Bools, Floats
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lattice import Isometry, Lattice
from hexwrap_solver.pattern.place.align import (
    Straightening,
    frame_of,
    place_by_sides,
    predicted,
    turn_between_loops,
)
from hexwrap_solver.pattern.place.cylinder import place_on_cylinder
from hexwrap_solver.pattern.place.features import (
    LEAST_CELLS,
    Chain,
    FeatureLines,
    chains_of,
    lasting,
    least_where_they_meet,
    narrow,
    worth_following,
)
from hexwrap_solver.pattern.place.net import place_on_net
from hexwrap_solver.pattern.place.placement import (
    BEARABLE,
    Placement,
    check_phase,
    cone_index_of,
    cost_of,
    edge_angle,
    is_disk,
    is_straight,
    quantized,
)
from hexwrap_solver.pattern.place.seat import seated
from hexwrap_solver.pattern.place.sheet import as_sheet, place_on_sheet
from hexwrap_solver.pattern.place.sides import has_corners, is_polygon
from hexwrap_solver.pattern.place.size import FREE, mean_stretch, size_spread, wanted_edge
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.words import place

#: Features are made straight where that costs no more than MOST_PREDICTED at all but one triangle of a
#: hundred, or MOST_ON_AVERAGE over the surface, as predicted, and than MOST_DISTORTED at the worst; above
#: FINE, a number of cells around at which they cost less than half as much is told.
P99, MOST_PREDICTED, MOST_ON_AVERAGE, MOST_DISTORTED, FINE = 0.99, 0.15, 0.08, 1.5, 0.005
#: Where one leans by more than this (radians), a pattern that winds along with them is compared.
LEANING = np.deg2rad(2.0)
#: Features are given up, the costliest first, in this many rounds.
MOST_GIVEN_UP = 8
#: This many, the longest, are tried: each is an unknown of its own in every round.
MOST_FOLLOWED = 64
#: More folds, and more places where they meet, are not named one by one.
MOST_NAMED, MOST_PLACES = 4, 8


def place_lattice(cmap: ConformalMap, lattice: Lattice, settings: PatternSettings) -> Placement:
    """The way of placing that suits the domain and what is to be aligned."""
    return PlacementFamily.of(cmap, lattice, settings).at(settings)


@dataclass(frozen=True)
class _Way:
    """Of laying lines along features. ratio: (m,) predicted ratios of singular values − 1. around: cells."""

    straightening: Straightening
    ratio: Floats
    around: int

    @property
    def cost(self) -> float:
        return float(np.quantile(self.ratio, P99))

    @cached_property
    def mean(self) -> float:
        """Over the surface."""
        area = self.straightening.frame.cmap.surface.areas
        return float(area @ np.minimum(self.ratio, MOST_DISTORTED) / area.sum())

    @property
    def bearable(self) -> bool:
        """Where little is distorted, or much of a small part: cells of ledges, say."""
        return self.cost <= MOST_PREDICTED or self.mean <= MOST_ON_AVERAGE

    @property
    def features(self) -> FeatureLines:
        assert self.straightening.features is not None
        return self.straightening.features


@dataclass(frozen=True)
class PlacementFamily:
    """Ways of placing that differ in the size of the cells alone: what they share is computed once.

    loops: those to align. features: numbers of those that cells are cut along. shape: settings whose sizes do
    not matter.
    """

    cmap: ConformalMap
    lattice: Lattice
    shape: PatternSettings
    cone_index: int
    loops: list[int]
    features: frozenset[int]
    notes: list[str]

    @classmethod
    def of(cls, cmap: ConformalMap, lattice: Lattice, settings: PatternSettings) -> PlacementFamily:
        check_phase(settings)
        cmap = as_sheet(cmap) if cmap.kind == "net" else quantized(cmap, lattice)
        loops, notes = loops_to_align(cmap, lattice, settings)
        cone_index = 0 if cmap.kind == "net" else cone_index_of(cmap, lattice)
        features: frozenset[int] = frozenset()
        if cmap.surface.features:
            every = cls(cmap, lattice, settings, cone_index, loops, features, notes)
            cell = every.cell * mean_stretch(cmap)
            features, sentences = worth_following(cmap.surface, cmap.surface.features, cell)
            notes = [*notes, *sentences]
        return cls(cmap, lattice, settings, cone_index, loops, features, notes)

    def at(self, settings: PatternSettings) -> Placement:
        """settings: those it was made for, but for the size."""
        cmap, lattice, loops = self.cmap, self.lattice, self.loops
        along, sentences, proposed = self._along_features(settings)
        if cmap.kind == "net":
            placement = place_on_net(cmap, lattice, settings, loops)
        elif along is not None:
            placement = along
        elif loops and not (self.is_cylinder and self._are_lines):
            placement = self._by_sides(settings)
        else:
            placement = self._seated(settings)
        corners = self._corner_notes(placement.straight)
        if len(sentences) > MOST_NAMED:
            more = len(sentences) - MOST_NAMED
            same = f"The same holds of {more} further fold{'s' * (more > 1)}."
            sentences = [*sentences[:MOST_NAMED], same]
        told = (*self.notes, *corners, *sentences, *proposed, *placement.notes)
        return replace(placement, notes=told, proposes=bool(proposed))

    @cached_property
    def chains(self) -> list[Chain]:
        """Features in the domain, those that the pattern is cut along."""
        if self.cmap.kind == "net":
            return []
        return chains_of(self.cmap, self.cmap.surface.features, self.features)

    def _along_features(self, settings: PatternSettings) -> tuple[Placement | None, list[str], list[str]]:
        """With lattice lines on as many features as bearable deformations allow, None if on none; why not on
        others; and what would suit them better."""
        proposed: list[str] = []
        if not self.features:
            return None, [], proposed
        if not is_straight(self.lattice, edge_angle(self.lattice, self.shape)):
            why = "At this rotation no line of the pattern can follow a fold: cells are cut where it falls."
            return None, [why], proposed
        if self.cmap.kind == "net":
            why = "On this domain no line of the pattern follows a fold: cells are cut where it falls."
            return None, [why], proposed
        chains = narrow(self.chains, self.cmap)
        straight = {chain.feature for chain in chains}
        sentences = [self._wide_note(chain) for chain in self.chains if chain.feature not in straight]
        lasts = lasting(chains, self.cmap.surface, self.cell).tolist()
        if not all(lasts):
            sentences.insert(
                0,
                f"{lasts.count(False)} folds in networks of pieces shorter than {LEAST_CELLS:.0f} cells were "
                "not tried for lines of the pattern: cells are cut where they fall.",
            )
            chains = [chain for chain, one in zip(chains, lasts, strict=True) if one]
        if len(chains) > MOST_FOLLOWED:
            sentences.insert(
                0,
                f"Of {len(chains)} folds only the {MOST_FOLLOWED} longest were tried for lines of the "
                "pattern: at the others cells are cut where they fall.",
            )
            chains = sorted(chains, key=lambda chain: -chain.length)[:MOST_FOLLOWED]
            chains.sort(key=lambda chain: chain.feature)
        for _ in range(MOST_GIVEN_UP):
            if not chains:
                return None, sentences, proposed
            aligned = self._way(chains, self.loops, settings)
            winding = self._winding(chains, aligned, settings)
            way = aligned
            if winding is not None and aligned.cost > MOST_PREDICTED and settings.boundary == "trim":
                way = winding
            if way.bearable:
                much = way.cost > MOST_PREDICTED
                placed = place_by_sides(way.straightening, settings, gathered=much)
                if placed.distortion <= MOST_DISTORTED:
                    if way is winding:
                        sentences.append(self._winding_note(aligned, way, taken=True))
                    elif winding is not None:
                        proposed = [self._winding_note(aligned, winding, taken=False)]
                    elif not proposed:
                        proposed = self._number_notes(way, settings, placed.around)
                    followed = way.features.straight
                    sentences += [self._third_note(c) for c in chains if c.feature not in followed]
                    return replace(placed, straight=followed), sentences, proposed
            left = self._without_worst(chains, aligned.ratio)
            if winding is not None and winding.cost <= MOST_PREDICTED:
                proposed = [self._winding_note(aligned, winding, taken=False)]
            sentences += [self._costly_note(chain, aligned) for chain in chains if chain not in left]
            chains = left
        return None, sentences, proposed

    def _way(self, chains: list[Chain], loops: list[int], settings: PatternSettings) -> _Way:
        straightening = self._straightened(chains, loops)
        return _Way(straightening, *predicted(straightening, settings))

    def _winding(self, chains: list[Chain], aligned: _Way, settings: PatternSettings) -> _Way | None:
        """Aligned with the features alone, which lean: where that costs less than half as much."""
        lean = abs(aligned.features.lean)
        if not self.loops or not self.is_cylinder or lean.max() <= LEANING or any(c.closed for c in chains):
            return None
        length = np.array([chain.length for chain in chains])
        rotation = Isometry(self.lattice, self.cone_index, (0, 0))
        _, freely = frame_of(self.cmap, self.lattice, self.shape, rotation, [], chains)
        if freely is None or length @ abs(freely.lean) > 0.5 * (length @ lean):
            return None  # each leans in a way of its own
        winding = self._way(chains, [], settings)
        return winding if winding.cost < 0.5 * aligned.cost else None

    def _winding_note(self, aligned: _Way, winding: _Way, *, taken: bool) -> str:
        lean = np.rad2deg(abs(aligned.features.lean))
        angle = f"{lean.max():.1f}°" if np.ptp(lean) < 0.1 else f"{lean.min():.1f}° to {lean.max():.1f}°"
        cost = cost_of(aligned.cost)
        said = f"The folds lean by {angle}: to follow them from rows along the boundary would {cost}"
        way = f"winds along with them, at {winding.cost:.2g}, and is cut at its ends."
        if taken:
            return f"{said}, so that the pattern {way}"
        return f'{said}. With align "none" and boundary "trim" the pattern {way}'

    def _number_notes(self, way: _Way, settings: PatternSettings, around: int) -> list[str]:
        """Which number of cells around would suit the features better than the size asked for."""
        if way.cost <= FINE or size_spread(settings) >= FREE:
            return []
        free = _Way(way.straightening, *predicted(way.straightening, settings, FREE))
        if free.around == around or free.cost > 0.5 * way.cost:
            return []
        return [
            f"{free.around} cells around, instead of {around}, would fit the folds better: a "
            f"distortion of about {free.cost:.2g} instead of {way.cost:.2g}."
        ]

    def _wide_note(self, chain: Chain) -> str:
        cells = chain.width / self.cell
        return (
            f"The {self._name(chain)} strays from a straight line of the domain by "
            f"{chain.width / self.cmap.circumference:.1%} of the circumference, {cells:.1f} cells: "
            "cells are cut where it falls."
        )

    def _third_note(self, chain: Chain) -> str:
        return (
            f"The {self._name(chain)} comes to where two other lines meet already: cells are cut where "
            "it falls."
        )

    def _costly_note(self, chain: Chain, way: _Way) -> str:
        lean = float(way.features.lean_of(chain.feature))
        worst = float(np.quantile(way.ratio[self._beside(chain)], P99))
        least = 1 / np.tan(np.pi / 4 - abs(lean) / 2) - 1
        law = (
            f"; it leans by {abs(np.rad2deg(lean)):.1f}° against the lattice, which alone costs {least:.2f}"
            if least > 0.5 * MOST_PREDICTED
            else ""
        )
        return (
            f"To lay a line of the pattern along the {self._name(chain)} would {cost_of(worst)} "
            f"there{law}: cells are cut where it falls."
        )

    def _corner_notes(self, straight: frozenset[int]) -> list[str]:
        """Where folds that are not followed meet others at angles that no lines of the pattern have."""
        if not self.chains:
            return []
        vertex, least = least_where_they_meet(self.cmap, self.lattice, self.chains)
        missed = [chain.vertex for chain in self.chains if chain.feature not in straight]
        bad = (least > MOST_PREDICTED) & np.isin(vertex, np.concatenate([vertex[:0], *missed]))
        if not bad.any():
            return []
        worst = float(least[bad].max())
        places = [self._at(v) for v in vertex[bad].tolist()]
        more = f" and at {len(places) - MOST_PLACES} more places" if len(places) > MOST_PLACES else ""
        return [
            f"Folds meet at {', '.join(places[:MOST_PLACES])}{more} at angles that lines of the pattern do "
            f"not have: to follow them all would {cost_of(worst)} there at least, however it is deformed."
        ]

    def _name(self, chain: Chain) -> str:
        what = "line" if self.cmap.surface.features[chain.feature].given else "fold"
        first, last = (self._at(v) for v in chain.vertex[[0, -1]].tolist())
        return f"{what} through {first}" if chain.closed else f"{what} from {first} to {last}"

    def _at(self, vertex: int) -> str:
        return place(self.cmap.surface.vertices[vertex])

    @cached_property
    def cell(self) -> float:
        """Width of a cell in the domain, the root of its area."""
        angle = edge_angle(self.lattice, self.shape)
        edge = wanted_edge(self.cmap, self.lattice, self.shape, angle) / self.lattice.edge
        return edge * float(np.sqrt(self.lattice.cell_area))

    def _beside(self, chain: Chain) -> Bools:
        """(m,) triangles at its vertices."""
        on = np.zeros(len(self.cmap.surface.vertices), dtype=bool)
        on[chain.vertex] = True
        return np.asarray(on[self.cmap.surface.faces].any(axis=1))

    def _straightened(self, chains: list[Chain], loops: list[int]) -> Straightening:
        known = self._straightenings
        key = frozenset(chain.feature for chain in chains), tuple(loops)
        if key not in known:
            known[key] = Straightening.of(self.cmap, self.lattice, self.shape, self.cone_index, loops, chains)
        return known[key]

    @cached_property
    def _straightenings(self) -> dict[tuple[frozenset[int], tuple[int, ...]], Straightening]:
        return {}

    def _without_worst(self, chains: list[Chain], ratio: Floats) -> list[Chain]:
        """All but the ones beside which triangles would be distorted most."""
        cost = [float(np.quantile(ratio[self._beside(chain)], P99)) for chain in chains]
        return [chain for chain, one in zip(chains, cost, strict=True) if one < 0.9 * max(cost)]

    @property
    def is_cylinder(self) -> bool:
        """And no disk."""
        return self.cone_index == 0 and not is_disk(self.cmap)

    @cached_property
    def _straightening(self) -> Straightening:
        return Straightening.of(self.cmap, self.lattice, self.shape, self.cone_index, self.loops)

    @cached_property
    def _single_straightenings(self) -> list[Straightening]:
        """Of each of two loops alone."""
        loops = self.loops if len(self.loops) == 2 else []
        return [
            Straightening.of(self.cmap, self.lattice, self.shape, self.cone_index, [loop]) for loop in loops
        ]

    @cached_property
    def _are_lines(self) -> bool:
        """The loops to align."""
        return not any(has_corners(self.cmap, self.lattice, loop) for loop in self.loops)

    def _seated(self, settings: PatternSettings) -> Placement:
        """Without corners to align: where whole cells cover most."""
        cmap, lattice, loops = self.cmap, self.lattice, self.loops

        def make(one: PatternSettings) -> Placement:
            return place_on_cylinder(cmap, lattice, one, loops) if loops else self._freely(one)

        asked = settings.around is not None or settings.edge_length is not None
        if asked or settings.boundary != "whole" or len(loops) == len(cmap.surface.loops):
            return make(settings)
        edge = wanted_edge(cmap, lattice, settings, edge_angle(lattice, settings)) * mean_stretch(cmap)
        return seated(cmap, lattice, settings, edge, make, loops=loops)

    def _freely(self, settings: PatternSettings) -> Placement:
        """Aligned nowhere."""
        if self.is_cylinder:
            return place_on_cylinder(self.cmap, self.lattice, settings, [])
        return place_on_sheet(self.cmap, self.lattice, settings, self.cone_index)

    def _by_sides(self, settings: PatternSettings) -> Placement:
        """Aligned on as many of the loops as bearable deformations allow."""
        cmap, lattice, loops = self.cmap, self.lattice, self.loops
        tried = place_by_sides(self._straightening, settings)
        if tried.distortion <= BEARABLE:
            return tried
        sentence = (
            f"To align loop {' and loop '.join(map(str, loops))} at this size would "
            f"{cost_of(tried.distortion, BEARABLE)}: smaller cells, or corners elsewhere, fit better."
        )
        turned = abs(np.rad2deg(turn_between_loops(cmap, lattice, loops)))
        if turned > 1:
            sentence += f" The sides of the two loops stand at {turned:.1f}° to each other about the apex."
        fewer = [place_by_sides(single, settings) for single in self._single_straightenings]
        best = min(fewer, key=lambda placement: placement.distortion, default=tried)
        if best.distortion > BEARABLE:
            best = self._freely(settings)
        return replace(best, notes=(sentence, *best.notes))


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
