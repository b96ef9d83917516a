"""Patterns: what is asked for and what comes out (paper, definition 2 and Figures 5–7)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, Ragged
from hexwrap_solver.errors import SettingError
from hexwrap_solver.geometry import cross_first, dot_first
from hexwrap_solver.pattern.halfedges import HalfEdges
from hexwrap_solver.setting import Setting

Kind = Literal[
    "hex",
    "triangle",
    "quad",
    "diamond",
    "brick",
    "trihexagonal",
    "truncated-hexagonal",
    "truncated-square",
    "rhombitrihexagonal",
]

#: ``auto``: hexagons, or what ``decided`` in the pipeline takes for them.
KindChoice = Literal["auto", Kind]


@dataclass(frozen=True)
class PatternSettings:
    """What a pattern should be like.

    around: on a cone, around its middle ring. With neither ``around`` nor ``edge_length`` the size is chosen.
    align: loops on which a lattice line must lie exactly. phase: used where freedom is left.
    Raises SettingError where both sizes are given.
    """

    kind: Annotated[
        KindChoice,
        Setting(
            "kind of cells; auto: hex, or trihexagonal where watertight panels cover a surface curved like a "
            "saddle"
        ),
    ] = "auto"
    around: Annotated[int | None, Setting("cells around the surface", ge=1, le=1_000_000, unit="cells")] = (
        None
    )
    edge_length: Annotated[
        float | None, Setting("instead: mean edge length of the cells on the surface", gt=0, unit="length")
    ] = None
    rotation: Annotated[
        float | Literal["edge", "vertex", "u", "v"],
        Setting(
            "'edge' or 'vertex' along the boundary, 'u' or 'v' of a NURBS surface, or degrees", unit="degrees"
        ),
    ] = "edge"
    align: Annotated[
        Literal["none", "first", "both"],
        Setting("on which loops a line of the pattern lies exactly; both: all that can be"),
    ] = "both"
    boundary: Annotated[
        Literal["whole", "trim"], Setting("keep whole cells only, or trim cells at the boundary")
    ] = "whole"
    phase: Annotated[
        tuple[float, float],
        Setting("shift of the pattern, where it is free", ge=-1e6, le=1e6, unit="cells", rare=True),
    ] = (0.0, 0.0)
    max_cells: Annotated[
        int, Setting("larger patterns are refused before any large array is made", limit=True)
    ] = 1_000_000

    def __post_init__(self) -> None:
        if self.around is not None and self.edge_length is not None:
            raise SettingError("give either 'around' or 'edge_length', the other one null")

    @property
    def cell_kind(self) -> Kind:
        """Hexagons where nothing else was decided."""
        return "hex" if self.kind == "auto" else self.kind


@dataclass(frozen=True)
class PatternFeature:
    """A feature of the surface on the pattern.

    vertices: (k,) of the pattern on it, in order; none where no cell was cut along it. straight: whether it
    lies on a line of the pattern; else cells are cut where it falls. cut: number of cells cut along it.
    width: how far it strays from a straight line of the domain, in cells. distortion: of the triangles beside
    it, the ratio of singular values − 1 that one in a hundred exceeds; None where it is not straight. fold:
    radians.
    """

    vertices: Ints
    straight: bool
    cut: int
    width: float
    distortion: float | None
    fold: float


@dataclass(frozen=True)
class FoldPieces:
    """Cells that features cut.

    cell: (k,) ascending. side: (k,) the corner of the cell at which its side along the fold begins. mate:
    (k,) which of the pieces, across that side, makes a whole cell with it, −1 where there is none. outline:
    rows (k,) of corners (·, 2) in the lattice, edge 1, from that one on, with the side along the fold on the
    first axis about 0.
    """

    cell: Ints
    side: Ints
    mate: Ints
    outline: Ragged


@dataclass(frozen=True)
class Pattern:
    """A mesh of cells with shared vertices that closes around the surface.

    vertices, normals: (p, 3) on the surface. uv: (p,) complex positions in the map's domain, one sheet.
    faces: vertex indices per cell, counter-clockwise from outside. corners: complex, aligned with
    faces.values: every cell as one connected polygon of the plane, beside its first corner. sheet: aligned,
    on cylinders and cones: corner k stands at g^sheet(uv[vertex]); None on nets. index: (c,) 0, or k where a
    cell has k corners fewer, around a singularity.
    neighbours: aligned with faces.values; the cell across edge k → k+1, or −1.
    triangle: (p,) face of map.surface that holds the vertex; barycentric: (p, 3) there.
    whole: (c,) False for cells cut at the boundary. ring, place: (c,) label numbers, from 0: rows from
    loop 0 and place in the row; on nets around is the greatest number of cells in one.
    rotation: angle actually taken, radians, from the boundary direction (or the horizontal axis on cones).
    edge_length: mean edge length on the surface. distortion: worst singular-value ratio − 1 of the stretch
    that ``align`` and features needed, 0 where none, 10⁶ where a triangle turns over. features: what
    became of those of the surface. pieces: cells cut along them, None where there are none. proposes: whether
    one of the notes says what would fit folds better.
    """

    kind: Kind
    vertices: Floats
    normals: Floats
    uv: Complexes
    faces: Ragged
    corners: Complexes
    index: Ints
    sheet: Ints | None
    neighbours: Ragged
    triangle: Ints
    barycentric: Floats
    whole: Bools
    ring: Ints
    place: Ints
    rings: int
    around: int
    rotation: float
    edge_length: float
    distortion: float
    notes: tuple[str, ...] = ()
    features: tuple[PatternFeature, ...] = ()
    pieces: FoldPieces | None = None
    proposes: bool = False

    @property
    def n_cells(self) -> int:
        return self.faces.n_rows

    @cached_property
    def half_edges(self) -> HalfEdges:
        """The sides of the cells. Not to be written to."""
        return HalfEdges.of(self.faces, len(self.vertices))

    @cached_property
    def cells(self) -> Ragged:
        """The corners of the cells on the surface. Not to be written to."""
        return Ragged(self.vertices.take(self.faces.values.astype(np.int64), axis=0), self.faces.offsets)

    @cached_property
    def area(self) -> float:
        """Of the cells, each the fan of triangles around the mean of its corners."""
        cells, corner = self.cells, np.asarray(self.cells.values, dtype=np.float64)
        middle = np.add.reduceat(corner, cells.offsets[:-1]) / cells.lengths[:, None]
        spoke = np.ascontiguousarray((corner - middle.take(cells.row, axis=0)).T)
        triangle = cross_first(spoke, spoke.take(cells.next(), axis=1))
        return float(np.sqrt(dot_first(triangle, triangle)).sum()) / 2

    def labels(self) -> list[str]:
        """Ring and place, as ``R03-P017``; at least two and three digits."""
        return [f"R{r:02d}-P{p:03d}" for r, p in zip(self.ring.tolist(), self.place.tolist(), strict=True)]
