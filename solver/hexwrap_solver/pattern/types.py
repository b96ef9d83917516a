"""Patterns: what is asked for and what comes out (paper, definition 2 and Figures 5–7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, Ragged

Kind = Literal["hex", "triangle", "quad"]


@dataclass(frozen=True)
class PatternSettings:
    """What a pattern should be like.

    around: cells around the cylinder (on a cone, around its middle ring); edge_length: mean edge length
    on the surface, model units; at most one of the two, neither means a sensible default.
    rotation: ``edge``, ``vertex``, degrees, or ``u`` / ``v`` (follow a NURBS direction).
    align: loops on which a lattice line must lie exactly. phase: shift in cells where freedom is left.
    max_cells: refuse larger patterns (PatternError) before any large array is made.
    """

    kind: Kind = "hex"
    around: int | None = None
    edge_length: float | None = None
    rotation: float | Literal["edge", "vertex", "u", "v"] = "edge"
    align: Literal["none", "first", "both"] = "both"
    boundary: Literal["whole", "trim"] = "whole"
    phase: tuple[float, float] = (0.0, 0.0)
    max_cells: int = 1_000_000


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
    edge_length: mean edge length on the surface. distortion: worst singular-value ratio − 1 of the
    stretch that ``align`` needed, 0 where none.
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

    @property
    def n_cells(self) -> int:
        return self.faces.n_rows

    @property
    def cells(self) -> Ragged:
        """The corners of the cells on the surface."""
        return Ragged(self.vertices[self.faces.values.astype(np.int64)], self.faces.offsets)

    def labels(self) -> list[str]:
        """Ring and place, as ``R03-P017``; at least two and three digits."""
        return [f"R{r:02d}-P{p:03d}" for r, p in zip(self.ring.tolist(), self.place.tolist(), strict=True)]
