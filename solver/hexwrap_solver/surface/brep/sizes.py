"""How long edges are to be on a face: lengths and curvatures measured on a grid over its parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy
import shapely

from hexwrap_solver.arrays import Bools, Floats
from hexwrap_solver.surface.brep.pull import Patch
from hexwrap_solver.surface.mesh_sizes import (
    DEFAULT_VERTICES,
    GRADE,
    ROW,
    cumulated,
    greatest_curvature,
    limited,
)
from hexwrap_solver.surface.nurbs import evaluate
from hexwrap_solver.surface.types import MeshSettings
from hexwrap_solver.tolerances import RELATIVE

#: Grid lines per face in each direction, and at least PER_SPAN between two knots.
LINES, PER_SPAN, MOST_LINES = 24, 3, 240
#: Grid lines keep this part of the width away from its ends, where poles may be.
NUDGE = 1e-4
#: Neighbouring normals differ by at most this, radians, so that rounding does not look like a crease …
TURN = 0.35
#: … but for that alone edges become no shorter than this part of the longest.
LEAST = 1 / 4
#: Sizes are planned a little below what was asked, where something was, and exceeded a little elsewhere.
MARGIN, LOOSE = 0.88, 1.7
#: This many vertices are enough for a shape where only a tolerance is asked for.
FEWEST = 64


@dataclass(frozen=True)
class Field:
    """The part of a face's surface inside its boundary's box, on a grid of u (a,) and v (b,).

    (b, a) each: the lengths of ∂u and ∂v, the area per parameter, the greatest curvature, and whether the
    place is inside the face. points: (b, a, 3). h: wanted edge length, once it is known.
    """

    u: Floats
    v: Floats
    speed_u: Floats
    speed_v: Floats
    density: Floats
    curvature: Floats
    inside: Bools
    points: Floats
    h: Floats

    @property
    def area(self) -> float:
        return self.total(1.0)

    def total(self, unit: Floats | float) -> float:
        """Area in squares of a length."""
        weight = np.gradient(self.v)[:, None] * np.gradient(self.u)
        return float((self.density / unit**2 * self.inside * weight).sum())

    def wanted(self, uv: Floats) -> Floats:
        """(k,) edge length wanted at parameters (k, 2)."""
        return bilinear(self.u, self.v, self.h, uv)


def bilinear(u: Floats, v: Floats, values: Floats, uv: Floats) -> Floats:
    """(k,) values (b, a) interpolated, constant beyond the grid."""
    x, i = _cell(u, uv[:, 0])
    y, j = _cell(v, uv[:, 1])
    low = values[j, i] * (1 - x) + values[j, i + 1] * x
    high = values[j + 1, i] * (1 - x) + values[j + 1, i + 1] * x
    return np.asarray(low * (1 - y) + high * y)


def _cell(line: Floats, x: Floats) -> tuple[Floats, np.ndarray]:
    i = np.clip(np.searchsorted(line, x, side="right") - 1, 0, len(line) - 2)
    return np.clip((x - line[i]) / (line[i + 1] - line[i]), 0.0, 1.0), i


def field_of(patch: Patch, outline: shapely.Polygon) -> Field:
    """outline: the face's boundary in the parameters' plane."""
    box = np.array(outline.bounds).reshape(2, 2)
    u, v = (_lines(patch, d, *box[:, d]) for d in (0, 1))
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    inset = np.clip(grid, patch.low + NUDGE * patch.width, patch.low + (1 - NUDGE) * patch.width)
    jet = evaluate(patch.opened, inset)
    shape = len(v), len(u)
    inside = shapely.contains_xy(outline, grid).reshape(shape)
    near = (
        scipy.ndimage.binary_dilation(inside, iterations=2, structure=np.ones((3, 3), dtype=bool))
        if inside.any()
        else ~inside
    )
    return Field(
        u,
        v,
        np.linalg.norm(jet.du, axis=1).reshape(shape),
        np.linalg.norm(jet.dv, axis=1).reshape(shape),
        np.linalg.norm(np.cross(jet.du, jet.dv), axis=1).reshape(shape),
        np.where(near, greatest_curvature(jet).reshape(shape), 0.0),
        inside,
        jet.point.reshape(*shape, 3),
        np.full(shape, np.inf),
    )


def _lines(patch: Patch, direction: int, low: float, high: float) -> Floats:
    knots, margin = patch.surface.knots[direction], RELATIVE * (high - low)
    inner = np.unique(knots[(knots > low + margin) & (knots < high - margin)])
    marks = np.concatenate([[low], inner, [high]])
    per_span = max(-(-LINES // (len(marks) - 1)), PER_SPAN)
    steps = marks[:-1, None] + np.diff(marks)[:, None] * np.arange(per_span) / per_span
    lines = steps.ravel()[:: max(1, steps.size // MOST_LINES)]
    return np.append(lines, high)


@dataclass(frozen=True)
class Sizes:
    """longest: of all edges, and height: greatest chord height, or infinite; wanted: what is planned with."""

    longest: float
    height: float
    wanted: float

    @classmethod
    def of(cls, settings: MeshSettings, area: float) -> Sizes:
        height = np.inf if settings.tolerance is None else settings.tolerance
        if settings.max_edge is not None:
            return cls(settings.max_edge, height, MARGIN * settings.max_edge)
        count = DEFAULT_VERTICES if settings.tolerance is None else FEWEST
        wanted = float(np.sqrt(area / count / ROW))
        return cls(LOOSE * wanted, height, wanted)

    def at(self, curvature: Floats) -> Floats:
        """(…,) edge lengths for curvatures: an arc of curvature κ and chord h is h²κ/8 high."""
        k = np.maximum(curvature, 1e-12 / self.wanted)
        h = np.minimum(self.wanted, np.maximum(TURN / k, LEAST * self.wanted))
        return np.minimum(h, MARGIN * np.sqrt(8 * self.height / k)) if np.isfinite(self.height) else h


def sized(field: Field, sizes: Sizes) -> Field:
    """The field with its edge lengths, which change slowly from place to place."""
    return replace(field, h=graded(field, sizes.at(field.curvature)))


def graded(field: Field, h: Floats) -> Floats:
    if float(np.ptp(h)) <= RELATIVE * float(h.max()):
        return h
    along_u, along_v = (
        cumulated(field.speed_u, np.diff(field.u)),
        cumulated(field.speed_v.T, np.diff(field.v)),
    )
    for _ in range(2):
        h = limited(limited(h, along_u).T, along_v).T
    return h


def meeting(field: Field, points: Floats, uv: Floats, wanted: Floats) -> Field:
    """The field lowered where its boundary (k, 3), at parameters (k, 2), has shorter edges (k,)."""
    lower = wanted < 0.8 * field.wanted(uv)
    if not lower.any():
        return field
    h = field.h.copy()
    flat, places = h.ravel(), field.points.reshape(-1, 3)
    for part in np.array_split(np.flatnonzero(lower), 1 + lower.sum() * len(flat) // 2_000_000):
        distance = np.linalg.norm(places[:, None] - points[part], axis=2)
        np.minimum(flat, (wanted[part] + GRADE * distance).min(axis=1), out=flat)
    return replace(field, h=flat.reshape(h.shape))
