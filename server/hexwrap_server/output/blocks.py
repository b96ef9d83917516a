"""Panels as instances of few blocks, one per size, for files that can say it that way.

A block is drawn in its own plane: the origin in the middle, x along the first edge, z outward. A panel
whose outline is not that of its size's block (cut cells, quads of one edge length) keeps a shape of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_server.output.colours import UNSIZED, class_colours
from hexwrap_server.output.layers import size_name
from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.geometry import normalize
from hexwrap_solver.panels.components import triangulated
from hexwrap_solver.panels.folds import halves_of_ring, hinges_of
from hexwrap_solver.panels.polygons import area_vectors
from hexwrap_solver.panels.types import Components, Panels

#: How far corners of panels of one block may differ, in parts of the edge length.
SAME = 1e-6


@dataclass(frozen=True)
class Shape:
    """points: (k, 3) in the panel's own plane. faces: rows of corners, outward; with a thickness a closed
    body, else one polygon. triangles: (t, 3) of the same."""

    points: Floats
    faces: list[list[int]]
    triangles: Ints
    closed: bool


@dataclass(frozen=True)
class Blocks:
    """block: (q,) the block of each panel, −1 for a shape of its own. size: (b,) of each block.
    origin: (q, 3); axes: (q, 3, 3) rows x, y, z of each panel's plane. made_from: (b,) the panel drawn as
    block. hinge: (q,) the corner to which each panel is bent from its first one, −1: flat. solid: corners of
    the bodies, those of the outline and then as many above.
    """

    block: Ints
    size: Ints
    made_from: Ints
    origin: Floats
    axes: Floats
    outline: Ragged
    hinge: Ints
    solid: Ragged | None

    @classmethod
    def of(cls, panels: Panels, components: Components | None = None) -> Blocks:
        """Of the panels' outlines, or of the bodies built on them where components were asked for."""
        if components is None:
            outline, origin, axes = panels.polygons, panels.center, frames(panels)
        else:
            outline, origin = components.outline, components.origin
            axes = np.stack([components.x_axis, components.y_axis, components.z_axis], axis=1)
        local = _seen(outline, origin, axes)
        solid = None
        if components is not None and components.solid_vertices is not None:
            solid = _seen(components.solid_vertices, origin, axes)
        block, size, made_from = _alike(local, panels)
        return cls(block, size, made_from, origin, axes, local, hinges_of(panels), solid)

    @property
    def alone(self) -> Ints:
        """Panels with a shape of their own."""
        return np.flatnonzero(self.block < 0)

    def shape(self, panel: int) -> Shape:
        """The panel in its own plane."""
        base: Floats = np.asarray(self.outline[panel], dtype=np.float64)
        n = len(base)
        parts = halves_of_ring(list(range(n)), int(self.hinge[panel]))
        triangles = np.concatenate([np.array(part)[_triangles(base[part])] for part in parts])
        if self.solid is None:
            return Shape(base, parts, triangles, False)
        points: Floats = np.asarray(self.solid[panel], dtype=np.float64)
        sides = [[k, (k + 1) % n, (k + 1) % n + n, k + n] for k in range(n)]
        faces = [*(part[::-1] for part in parts), *([k + n for k in part] for part in parts), *sides]
        halves = np.array([[[a, b, c], [a, c, d]] for a, b, c, d in sides]).reshape(-1, 3)
        return Shape(points, faces, np.concatenate([triangles[:, ::-1], triangles + n, halves]), True)

    def name(self, block: int) -> str:
        return size_name(int(self.size[block]))


def _seen(points: Ragged, origin: Floats, axes: Floats) -> Ragged:
    """Rows of points from each panel's own plane."""
    row = points.row
    arms = np.asarray(points.values, dtype=np.float64) - origin[row]
    return Ragged(np.einsum("pij,pj->pi", axes[row], arms), points.offsets)


def _triangles(part: Floats) -> Ints:
    """(n − 2, 3) of a flat outline (n, 3)."""
    outline = Ragged(part, np.array([0, len(part)]))
    return triangulated(outline, normalize(area_vectors(outline)))


def frames(panels: Panels) -> Floats:
    """(q, 3, 3) rows x along the first edge, y, z outward."""
    points, first = np.asarray(panels.polygons.values, dtype=np.float64), panels.polygons.offsets[:-1]
    x = points[first + 1] - points[first]
    x -= np.sum(x * panels.normal, axis=1, keepdims=True) * panels.normal
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(panels.normal, x), panels.normal], axis=1)


def colours_of(panels: Panels) -> list[str]:
    """``#rrggbb`` of every size, and last that of panels without one, so that size −1 finds it."""
    return [*(class_colours(panels) if len(panels.class_length) else []), UNSIZED]


def _alike(local: Ragged, panels: Panels) -> tuple[Ints, Ints, Ints]:
    """Block of each panel, size of each block, and the panel that each is made from."""
    block = np.full(panels.n_panels, -1)
    count, values, start = local.lengths, np.asarray(local.values), local.offsets[:-1]
    sizes: list[int] = []
    made_from: list[int] = []
    for size in range(len(panels.class_length)):
        rows = np.flatnonzero(panels.size == size)
        if not len(rows):
            continue
        first = rows[0]
        rows = rows[count[rows] == count[first]]
        corner = np.arange(count[first])
        apart = values[start[rows][:, None] + corner] - values[start[first] + corner]
        same = np.abs(apart).max(axis=(1, 2)) <= SAME * panels.edge_length[first]
        block[rows[same]] = len(sizes)
        sizes.append(size)
        made_from.append(int(first))
    return block, np.array(sizes, dtype=np.int64), np.array(made_from, dtype=np.int64)
