"""Boundary conditions and the map they lead to (paper, section 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Literal

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.errors import SettingError
from hexwrap_solver.setting import Setting
from hexwrap_solver.surface.types import Surface

AngleUnit = Literal["rad", "deg", "pi"]
#: Radians of one unit.
ANGLE_UNITS: dict[AngleUnit, float] = {"rad": 1.0, "deg": np.pi / 180, "pi": np.pi}
Quantum = Literal["auto", "hex", "triangle", "quad", "none"]
#: Names of the quanta (π/3 and π/2) that the cone angle of a pattern must be a multiple of.
QUANTUM_OF: dict[str, Quantum] = {"hex": "hex", "triangle": "hex", "quad": "quad"}
QUANTA: dict[Quantum, float] = {"hex": np.pi / 3, "triangle": np.pi / 3, "quad": np.pi / 2}


@dataclass(frozen=True)
class BoundaryAngle:
    """A target angle sum, radians, at a boundary vertex: the one of this index in the sent mesh, or the one
    nearest to a point. Raises SettingError unless exactly one of the two is given."""

    angle: Annotated[float, Setting("target angle sum", unit="angle")]
    vertex: Annotated[
        int | None, Setting("boundary vertex, an index of the sent mesh", ge=0, lt=2**53, unit="vertex")
    ] = None
    point: Annotated[
        tuple[float, float, float] | None, Setting("instead: the boundary vertex nearest to this point")
    ] = None

    def __post_init__(self) -> None:
        if (self.vertex is None) == (self.point is None):
            raise SettingError("give either 'vertex' or 'point'")


@dataclass(frozen=True)
class BoundaryCondition:
    """Paper, section 3.1.

    mode ``straight``: every boundary angle is π. ``angles``: the listed ones, π elsewhere.
    ``isometric``: boundary lengths kept up to scale, the cone angle rounded to a multiple of quantum.
    quantum: π/3, π/2 or none, by the pattern that is meant; ``auto``: that of the pattern that is laid.
    spread: how ``isometric`` distributes the rounding: ``even`` (the paper) or ``optimal`` (u constant on
    each loop). angle_unit: in which problems give angles; the same condition whatever it is.
    """

    mode: Annotated[
        Literal["straight", "angles", "isometric"], Setting("what the boundary becomes in the domain")
    ] = "straight"
    angles: Annotated[
        tuple[BoundaryAngle, ...], Setting("target angles at boundary vertices, for mode angles", most=10_000)
    ] = ()
    angle_unit: Annotated[AngleUnit, Setting("unit of the angles", rare=True)] = field(
        default="rad", compare=False
    )
    quantum: Annotated[Quantum, Setting("what the cone angle is a multiple of", rare=True)] = "auto"
    spread: Annotated[
        Literal["even", "optimal"], Setting("how an isometric boundary takes up the rounding", rare=True)
    ] = "even"

    def adapted(self, kind: str | None) -> BoundaryCondition:
        """The condition for a pattern of this kind (None: no pattern), without what has no effect on the map:
        equal for equal maps."""
        name = self.quantum if self.quantum != "auto" else (kind or "none")
        return replace(
            self,
            quantum=QUANTUM_OF.get(name, "none"),
            angles=self.angles if self.mode == "angles" else (),
        )


@dataclass(frozen=True)
class Targets:
    """What the variational problem prescribes at each vertex; both routes (plain, flips) take it.

    angle: (n,) target angle sums Θ: 2π inside, as wanted on the boundary (ignored where tie ≥ 0).
    tie: (n,) −1 where u is free; vertices with equal tie ≥ 0 share one value of u. Tie 0 is pinned at u = 0.
    tie_angle: (t,) prescribed *sum* of the angle sums over the vertices of each tie (entry 0 is ignored).

    Prescribed angles everywhere: all ties −1 (u is then determined up to a constant). Isometric boundary:
    both loops have tie 0. Least stretch at given cone angle: loop 0 has tie 0, loop 1 tie 1.
    """

    angle: Floats
    tie: Ints
    tie_angle: Floats


@dataclass(frozen=True)
class Deck:
    """The deck transformation g(z) = e^{i·angle} z + translation: one turn around the surface.

    angle is K = Σκ over loop 0, *not* reduced modulo 2π. translation: complex.
    """

    angle: float
    translation: complex

    @property
    def is_translation(self) -> bool:
        """K a multiple of 2π (cylinders, and flat rings): g has no fixed point."""
        return abs(self.reduced) < 1e-9

    @property
    def reduced(self) -> float:
        """K modulo 2π, in [−π, π]."""
        return math.remainder(self.angle, 2 * math.pi)

    @property
    def apex(self) -> complex | None:
        """The fixed point t / (1 − e^{iK}) of g, or None where g is a translation."""
        if self.is_translation:
            return None
        half = self.reduced / 2  # 1 − e^{iK} = −2i sin(K/2) e^{iK/2} does not cancel where K is small
        return complex(self.translation * 0.5j / (math.sin(half) * np.exp(1j * half)))

    def power(self, s: Ints) -> tuple[Complexes, Complexes]:
        """(rotation, translation) of g^s for integer arrays s: g^s(z) = rotation·z + translation.

        The translation t (1 − e^{iKs}) / (1 − e^{iK}) is written with sines, so that it keeps all its digits
        on cones that are nearly cylinders.
        """
        s = np.asarray(s)
        if self.is_translation:
            return np.ones(s.shape, dtype=complex), self.translation * s.astype(complex)
        half = self.reduced / 2
        share = np.sin(half * s) / math.sin(half) * np.exp(1j * half * (s - 1))
        return np.exp(2j * half * s), np.asarray(self.translation * share)

    def apply(self, z: Complexes, s: Ints | int = 1) -> Complexes:
        """g^s(z)."""
        rotation, translation = self.power(np.asarray(s))
        return np.asarray(rotation * z + translation)


@dataclass(frozen=True)
class ConformalMap:
    """A discrete periodic parameterization (paper, definition 1), unrolled.

    surface: the mesh that was solved (with inserted vertices where that was needed).
    log_scale: (n,) u; new edge lengths are e^{(u_i+u_j)/2}·l_ij where flips = 0. At inserted vertices the
    factor of the map there.
    uv: (n,) complex; each vertex once, in one unrolled sheet.
    sheet: (m, 3); corner c of face f stands at g^{sheet[f,c]}(uv[faces[f,c]]); every face is then a
    positively oriented triangle.
    boundary_angles: per loop, angle sums in the domain, aligned with surface.loops.
    circumference: length of one turn: |translation| on a cylinder; on a cone |K| × apex distance of its
    middle ring (the geometric mean of the loops' mean distances); on a ring without an apex (K = 2πm), or
    one that does not run around it (K near 2πm), the geometric mean of the loops' lengths.
    residual: max |angle sum − target|. flips: number of edges flipped; inserted: number of vertices inserted.
    closing_error: largest disagreement of the layout around the annulus / length of one turn.
    notes: sentences for the user.
    """

    surface: Surface
    log_scale: Floats
    uv: Complexes
    sheet: Ints
    deck: Deck
    boundary_angles: tuple[Floats, Floats]
    circumference: float
    iterations: int
    residual: float
    flips: int = 0
    inserted: int = 0
    closing_error: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def kind(self) -> Literal["cylinder", "cone"]:
        return "cylinder" if abs(self.deck.angle) < 1e-9 else "cone"

    def corners(self) -> Complexes:
        """(m, 3) where the corners of every face stand in the unrolled domain. Not to be written to."""
        return self._corners

    @cached_property
    def _corners(self) -> Complexes:
        corners = self.uv[self.surface.faces]
        moved = self.sheet != 0
        corners[moved] = self.deck.apply(corners[moved], self.sheet[moved])
        corners.flags.writeable = False
        return corners
