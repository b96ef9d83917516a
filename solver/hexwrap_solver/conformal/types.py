"""Boundary conditions and the map they lead to (paper, section 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.surface.types import Surface

AngleUnit = Literal["rad", "deg", "pi"]
#: Radians of one unit.
ANGLE_UNITS: dict[AngleUnit, float] = {"rad": 1.0, "deg": np.pi / 180, "pi": np.pi}


@dataclass(frozen=True)
class BoundaryCondition:
    """Paper, section 3.1.

    mode ``straight``: every boundary angle is π. ``angles``: the listed ones, π elsewhere.
    ``isometric``: boundary lengths kept up to scale, the cone angle rounded to a multiple of quantum.
    vertices: (k,) *sent* vertex indices, −1 where points gives a place instead. points: (k, 3).
    angles: (k,) radians. unit: in which problems tell of them and give an example.
    quantum: π/3, π/2, or None to leave the cone angle as it comes.
    spread: how ``isometric`` distributes the rounding: ``even`` (the paper) or ``optimal`` (u constant on
    each loop).
    """

    mode: Literal["straight", "angles", "isometric"] = "straight"
    vertices: Ints | None = None
    points: Floats | None = None
    angles: Floats | None = None
    unit: AngleUnit = "rad"
    quantum: float | None = None
    spread: Literal["even", "optimal"] = "even"


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
