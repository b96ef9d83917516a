"""Boundary conditions, singularities and the map they lead to (paper, section 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.errors import SettingError
from hexwrap_solver.geometry import dot
from hexwrap_solver.setting import Setting
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.tolerances import TINY, is_whole_turn, is_zero

AngleUnit = Literal["rad", "deg", "pi"]
#: Radians of one unit.
ANGLE_UNITS: dict[AngleUnit, float] = {"rad": 1.0, "deg": np.pi / 180, "pi": np.pi}
Quantum = Literal["auto", "hex", "triangle", "quad", "brick", "none"]
#: Names of the quanta (π/3, π/2, π) that the cone angle of a pattern must be a multiple of.
QUANTUM_OF: dict[str, Quantum] = {
    "hex": "hex",
    "triangle": "hex",
    "quad": "quad",
    "diamond": "quad",
    "brick": "brick",
    "trihexagonal": "hex",
    "truncated-hexagonal": "hex",
    "truncated-square": "quad",
    "rhombitrihexagonal": "hex",
}
QUANTA: dict[Quantum, float] = {"hex": np.pi / 3, "triangle": np.pi / 3, "quad": np.pi / 2, "brick": np.pi}


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


BoundaryMode = Literal["straight", "angles", "isometric"]


@dataclass(frozen=True)
class LoopCondition:
    """What one loop is asked for: the one of this number, or the one nearest to a point. Raises SettingError
    unless exactly one of the two is given."""

    mode: Annotated[BoundaryMode, Setting("what this loop becomes in the domain")]
    loop: Annotated[int | None, Setting("number of the loop", ge=0, lt=2**31)] = None
    point: Annotated[
        tuple[float, float, float] | None, Setting("instead: the loop nearest to this point")
    ] = None
    angles: Annotated[
        tuple[BoundaryAngle, ...],
        Setting("target angles at vertices of this loop, for mode angles", most=10_000),
    ] = ()

    def __post_init__(self) -> None:
        if (self.loop is None) == (self.point is None):
            raise SettingError("give either 'loop' or 'point'")


@dataclass(frozen=True)
class BoundaryCondition:
    """Paper, section 3.1.

    mode ``auto``: straight or isometric, whichever suits the sizes of the cells better, or the listed angles
    where there are any (``explore.best_boundary_map``; alone, ``conformal_map`` takes straight, and isometric
    for a disk). ``straight``: every boundary angle is π. ``angles``: the listed ones, π elsewhere.
    ``isometric``: boundary lengths kept up to scale, each loop's curvature rounded to a multiple of quantum.
    Openings (loops from the third on) on which no angle is listed are isometric in every mode: they cannot
    be straight, for they turn by −2π.
    quantum: π/3, π/2, π or none, by the pattern that is meant; ``auto``: that of the pattern that is laid.
    spread: how ``isometric`` distributes the rounding: ``even`` (the paper) or ``optimal`` (u constant on
    each loop). angle_unit: in which error messages give angles; it does not change the condition.
    """

    mode: Annotated[
        Literal["auto"] | BoundaryMode,
        Setting("what the boundary becomes in the domain; auto: straight or isometric"),
    ] = "auto"
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
    loops: Annotated[
        tuple[LoopCondition, ...], Setting("conditions of single loops, instead of the mode", rare=True)
    ] = ()

    def adapted(self, kind: str | None) -> BoundaryCondition:
        """The condition for a pattern of this kind (None: no pattern), without what has no effect on the map:
        equal for equal maps."""
        name = self.quantum if self.quantum != "auto" else (kind or "none")
        mode = "angles" if self.mode == "auto" and self.angles else self.mode
        return replace(
            self,
            mode=mode,
            quantum=QUANTUM_OF.get(name, "none"),
            angles=self.angles if mode == "angles" else (),
        )


@dataclass(frozen=True)
class Cones:
    """Singularities of the metric: vertices inside whose angle sum is not 2π.

    vertex: (c,). index: (c,) k; the angle sum is 2π − k · quantum: one side fewer for k = 1 (a pentagon in a
    pattern of hexagons), one more for k = −1. quantum: radians. moved: (c,) how far each one was moved on the
    surface from where it was wanted, model units.
    """

    vertex: Ints
    index: Ints
    quantum: float
    moved: Floats

    @classmethod
    def none(cls) -> Cones:
        nothing = np.zeros(0, dtype=np.int64)
        return cls(nothing, nothing, np.pi / 3, np.zeros(0))

    @classmethod
    def at(cls, vertex: Ints, index: Ints, quantum: float) -> Cones:
        """Where they were wanted."""
        return cls(vertex, index, quantum, np.zeros(len(vertex)))

    @property
    def curvature(self) -> Floats:
        """(c,) 2π minus the angle sum, radians."""
        return np.asarray(self.index * self.quantum)

    def __len__(self) -> int:
        return len(self.vertex)


@dataclass(frozen=True)
class Targets:
    """What the variational problem prescribes at each vertex; both routes (plain, flips) take it.

    angle: (n,) target angle sums Θ: 2π inside but at cones, as wanted on the boundary (ignored where
    shared ≥ 0).
    shared: (n,) −1 where u is free; vertices with an equal number ≥ 0 share one unknown c, and u = c +
    offset; that of number 0 is pinned at c = 0.
    shared_angle: (t,) prescribed *sum* of the angle sums over the vertices of each shared unknown (entry 0 is
    ignored).
    offset: (n,) fixed part of u, 0 by default; it matters for shared unknowns only.

    Prescribed angles everywhere: nothing is shared (u is then determined up to a constant). Isometric
    boundary: all loops share unknown 0. Least stretch at given curvatures: loop b shares unknown b.
    """

    angle: Floats
    shared: Ints
    shared_angle: Floats
    offset: Floats | None = None


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
        return is_whole_turn(self.angle)

    @property
    def is_flat_ring(self) -> bool:
        """K a multiple of 2π, but not 0: around a hole in a flat surface, say."""
        return self.is_translation and not is_zero(self.angle)

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
class Unrolled:
    """The domain of an annulus without cones: one sheet, and the deck transformation that repeats it.

    uv: (n,) complex; each vertex once, in one unrolled sheet.
    sheet: (m, 3); corner c of face f stands at g^{sheet[f,c]}(uv[faces[f,c]]); every face is then a
    positively oriented triangle.
    circumference: length of one turn: |translation| on a cylinder; on a cone |K| × apex distance of its
    middle ring (the geometric mean of the loops' mean distances); on a ring without an apex (K = 2πm), or
    one that does not run around it (K near 2πm), the geometric mean of the loops' lengths.
    """

    uv: Complexes
    sheet: Ints
    deck: Deck
    circumference: float

    def corners(self, faces: Ints) -> Complexes:
        """(m, 3) where the corners of every face stand."""
        corners = self.uv[faces]
        moved = self.sheet != 0
        corners[moved] = self.deck.apply(corners[moved], self.sheet[moved])
        return corners

    def net(self, surface: Surface) -> Net:
        """The same as a net; its motions are powers of the deck transformation."""
        twin = surface.twin
        inner = twin >= 0
        # The tail of a half-edge is the head of its twin: both must name the same copy of the vertex.
        head = np.roll(self.sheet, -1, axis=1).ravel()
        shift = np.where(inner, self.sheet.ravel() - head[twin], 0)
        most = int(np.abs(shift).max(initial=0))
        powers, inverses = np.arange(1, most + 1), np.arange(most + 1, 2 * most + 1)
        winding = np.concatenate([[0], powers, -powers])
        return Net(
            self.corners(surface.faces),
            np.where(inner, twin // 3, -1).reshape(-1, 3),
            np.where(shift >= 0, shift, most - shift).reshape(-1, 3),
            self.deck.angle * winding,
            self.deck.power(winding)[1],
            np.concatenate([[0], inverses, powers]),
            winding,
        )


@dataclass(frozen=True)
class Fitted:
    """z ↦ factor·z + shift carries every motion of the chart to a symmetry of the lattice of cell centres
    ℤ[ζ], ζ = e^{2πi/order}, one cell being 1 wide.

    chart: the net, cut alike, of the surface slightly stretched, where both ends are lattice lines for that;
    None: it is the map's own net.
    """

    order: int
    factor: complex
    shift: complex
    chart: Net | None = None


@dataclass(frozen=True)
class ConformalMap:
    """A discrete conformal map onto a plane domain whose edges are glued by motions (paper, definition 1).

    surface: the mesh that was solved (with inserted vertices where that was needed).
    log_scale: (n,) u; new edge lengths are e^{(u_i+u_j)/2}·l_ij where flips = 0. At inserted vertices the
    factor of the map there.
    domain: the sheet of a cylinder or cone; of all other surfaces a net.
    boundary_angles: per loop, angle sums in the domain, aligned with surface.loops.
    residual: max |angle sum − target|. flips: number of edges flipped; inserted: number of vertices inserted.
    closing_error: largest disagreement of the layout where it closes, relative to its size.
    cones: singularities. fitted: where they were moved until a lattice closes up exactly, that lattice.
    notes: sentences for the user.
    """

    surface: Surface
    log_scale: Floats
    domain: Unrolled | Net
    boundary_angles: tuple[Floats, ...]
    iterations: int
    residual: float
    flips: int = 0
    inserted: int = 0
    closing_error: float = 0.0
    cones: Cones = field(default_factory=Cones.none)
    fitted: Fitted | None = None
    notes: tuple[str, ...] = ()

    @property
    def kind(self) -> Literal["cylinder", "cone", "net"]:
        if isinstance(self.domain, Net):
            return "net"
        return "cylinder" if is_zero(self.domain.deck.angle) else "cone"

    @property
    def unrolled(self) -> Unrolled:
        """The sheet of a cylinder or cone. Raises TypeError for other nets: ask for ``kind`` before."""
        if isinstance(self.domain, Net):
            raise TypeError("This domain is a net; it is not unrolled into sheets.")
        return self.domain

    @property
    def uv(self) -> Complexes:
        return self.unrolled.uv

    @property
    def sheet(self) -> Ints:
        return self.unrolled.sheet

    @property
    def deck(self) -> Deck:
        return self.unrolled.deck

    @property
    def circumference(self) -> float:
        return self.unrolled.circumference

    def with_domain(self, **changes: Any) -> ConformalMap:
        """The same map with some fields of its sheet replaced."""
        return replace(self, domain=replace(self.unrolled, **changes))

    @cached_property
    def net(self) -> Net:
        """The domain of every kind of surface."""
        return self.domain if isinstance(self.domain, Net) else self.domain.net(self.surface)

    def corners(self) -> Complexes:
        """(m, 3) where the corners of every face stand in the domain. Not to be written to."""
        return self._corners

    @cached_property
    def _corners(self) -> Complexes:
        domain = self.domain
        corners = domain.corners.view() if isinstance(domain, Net) else domain.corners(self.surface.faces)
        corners.flags.writeable = False
        return corners

    @cached_property
    def stretch(self) -> Floats:
        """(m,) ratio of the singular values of the map on each face. Not to be written to."""
        corners = self.surface.vertices[self.surface.faces]
        e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        x = np.sqrt(dot(e1, e1))
        # In the face's own plane e1 = (x, 0) and e2 = (a, h); the map's derivative is [w1 w2]·[e1 e2]⁻¹.
        a, h = dot(e1, e2) / x, 2 * self.surface.areas / x
        places = self.corners()
        w1, w2 = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
        dx = w1 / x
        dy = (w2 - a * dx) / h
        conformal, anti = np.abs(dx - 1j * dy) / 2, np.abs(dx + 1j * dy) / 2
        return np.asarray((conformal + anti) / np.maximum(np.abs(conformal - anti), TINY))
