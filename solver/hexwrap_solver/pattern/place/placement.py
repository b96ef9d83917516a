"""Where the lattice lies on the unrolled domain: a similarity under which g is a motion of the lattice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Complexes, Ints
from hexwrap_solver.conformal.types import QUANTA, QUANTUM_OF, ConformalMap, Deck
from hexwrap_solver.errors import NotAdaptedError, PatternError
from hexwrap_solver.pattern.lattice import Isometry, Lattice
from hexwrap_solver.pattern.place.glued import Glued
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.tolerances import RELATIVE

#: Largest |k| of a cone angle k·π/3 or k·π/2.
MAX_TURNS = 12
#: How quanta are written, by the fold of the pattern.
PARTS = {6: "π/3", 4: "π/2", 2: "π"}
#: Largest phase, cells.
MAX_PHASE = 1e6
#: A cone angle this near to such a multiple counts as one (angles typed with seven digits).
NEARLY = 1e-6
#: Nearer than this, a multiple needs no correction (see Deck).
EXACT = 1e-9

#: Worst ratio of singular values − 1 that an alignment may cost.
BEARABLE = 0.5
#: A predicted distortion so large is that of a triangle turned over; of large ones nobody needs the figure.
FOLDED, MOST_TOLD = 1e6, 100.0


@dataclass(frozen=True)
class Placement:
    """place: (n,) the vertices of the (perhaps slightly stretched) domain, each at home, in lattice units;
    glued: how the corners of the faces follow. isometries: (t, 4) what the motions of the net are on the
    lattice. rotation: angle from the boundary direction to an edge. around: cells once around (middle ring on
    cones, longest loop on nets). distortion: worst ratio of singular values − 1 of the stretch. step: around
    is one of its multiples. motion: on sheets, what g is. straight: features that lie on lattice lines.
    proposes: whether a note says what would suit features better.
    """

    place: Complexes
    glued: Glued
    isometries: Ints
    rotation: float
    around: int
    distortion: float
    notes: tuple[str, ...]
    step: int = 1
    motion: Isometry | None = None
    straight: frozenset[int] = frozenset()
    proposes: bool = False

    @classmethod
    def on_sheet(
        cls,
        cmap: ConformalMap,
        place: Complexes,
        motion: Isometry,
        rotation: float,
        around: int,
        distortion: float,
        notes: tuple[str, ...],
        step: int = 1,
    ) -> Placement:
        """All follows from what the deck transformation is."""
        winding = cmap.net.winding
        assert winding is not None
        glued, isometries = Glued.by_sheets(cmap, motion), motion.power(winding)
        return cls(place, glued, isometries, rotation, around, distortion, notes, step, motion)

    @property
    def narrows(self) -> bool:
        """Whether fewer cells go around some places than others."""
        return self.motion is None or self.motion.cone_index != 0 or not any(self.motion.shift)


def cost_of(distortion: float, limit: float | None = None) -> str:
    """What a deformation does, to be said of one that is not made: "would …"."""
    if distortion > FOLDED:
        return "fold the layout over"
    size = f"{distortion:.2f}" if distortion < MOST_TOLD else f"more than {MOST_TOLD:g}"
    return f"distort cells by {size}" + ("" if limit is None else f", more than {limit:g}")


def quantum_name(lattice: Lattice) -> str:
    """What ``boundary.quantum`` is to be for a pattern."""
    return lattice.kind if lattice.kind in QUANTA else QUANTUM_OF[lattice.kind]


def cone_index_of(cmap: ConformalMap, lattice: Lattice) -> int:
    """The cone angle in turns by ζ. Raises NotAdaptedError where it is not a multiple of the quantum (paper,
    definition 2)."""
    quantum, K = lattice.quantum, cmap.deck.angle
    k = round(K / quantum)
    if abs(K - k * quantum) <= NEARLY and abs(k) <= MAX_TURNS:
        return k * (lattice.order // lattice.fold)
    part = PARTS[lattice.fold]
    low = int(np.clip(np.floor(K / quantum), -MAX_TURNS, MAX_TURNS - 1))
    nearest = [low * quantum, (low + 1) * quantum]
    raise NotAdaptedError(
        f"The cone angle is {K:.8f} rad, but a {lattice.kind} pattern closes up only where it is a multiple "
        f"of {part}, up to {MAX_TURNS} of them; the nearest are {low}·{part} = {nearest[0]:.8f} and "
        f"{low + 1}·{part} = {nearest[1]:.8f} rad: choose boundary angles that add up to one of them, or "
        f"boundary.quantum {quantum_name(lattice)} for an isometric boundary.",
        data={"cone_angle": K, "quantum": quantum, "nearest": nearest},
    )


def quantized(cmap: ConformalMap, lattice: Lattice) -> ConformalMap:
    """The map with exactly the multiple as its cone angle. Near a multiple of 2π even the last of seven
    digits would put an apex, far away, where there is only a translation."""
    exact = cone_index_of(cmap, lattice) * lattice.step_angle
    if abs(cmap.deck.angle - exact) <= EXACT:
        return cmap
    return cmap.with_domain(deck=Deck(exact, cmap.deck.translation))


def check_phase(settings: PatternSettings) -> None:
    """Raises PatternError where a phase has no digits left behind the point."""
    if not all(abs(part) <= MAX_PHASE for part in settings.phase):
        raise PatternError(
            f"The phase is {settings.phase[0]:.6g}, {settings.phase[1]:.6g} cells, but at most "
            f"{MAX_PHASE:,.0f} are understood.",
            field=("phase",),
        )


def anchor_vertex(cmap: ConformalMap) -> int:
    """A vertex of the boundary (of its two ends where there are openings besides; of all where there is none)
    that depends neither on numbering nor on the cut: the greatest (x, y, z)."""
    loops = main_loops(cmap)
    rim = np.concatenate(loops) if loops else np.arange(len(cmap.surface.vertices))
    points = cmap.surface.vertices[rim]
    unit = 1e-7 * float(np.ptp(cmap.surface.vertices, axis=0).max())
    x, y, z = np.rint(points / unit).T
    return int(rim[np.lexsort((z, y, x))[-1]])


def main_loops(cmap: ConformalMap) -> tuple[Ints, ...]:
    """The loops that matter to where the lattice lies: not the openings of a cylinder or cone."""
    return cmap.surface.loops if cmap.kind == "net" else cmap.surface.loops[:2]


def is_disk(cmap: ConformalMap) -> bool:
    """A disk taken as a sheet, see ``as_sheet``: its deck transformation is the identity."""
    return cmap.kind != "net" and cmap.deck.angle == 0 and cmap.deck.translation == 0


def edge_angle(lattice: Lattice, settings: PatternSettings) -> float:
    """Angle from the boundary direction to an edge that is asked for, radians."""
    if settings.rotation == "edge":
        return 0.0
    if settings.rotation == "vertex":
        return lattice.quantum / 2
    return float(np.deg2rad(float(settings.rotation)))


def is_straight(lattice: Lattice, angle: float) -> bool:
    """Whether edges or corners run along the boundary: only then it can be a lattice line."""
    steps = 2 * angle / lattice.quantum
    return bool(abs(steps - round(steps)) < RELATIVE)
