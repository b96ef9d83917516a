"""How long the edges of a NURBS surface's mesh are to be: lengths and curvatures measured on a grid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.geometry import dot
from hexwrap_solver.surface.errors import NurbsDataError, TooFineError
from hexwrap_solver.surface.nurbs import Jet, evaluate
from hexwrap_solver.surface.nurbs_checks import spans
from hexwrap_solver.surface.types import MeshSettings, NurbsSurface
from hexwrap_solver.tolerances import RELATIVE

#: Vertices where neither edge length nor tolerance is given.
DEFAULT_VERTICES = 6000
#: Samples in each direction, at least, from which lengths and curvatures are measured.
SAMPLES = 200
#: Height of a row of equilateral triangles.
ROW = np.sqrt(3) / 2
#: Edge lengths may change by this much per length, so that neighbouring triangles are of one size.
GRADE = 0.12
#: Sizes beyond these, relative to the control net, ask for no more than these do: below rounding, or a mesh
#: of the fewest vertices. Squares of such as reach the ends of doubles would not be numbers.
LEAST_SIZE, GREATEST_SIZE = 1e-15, 1e3


def check_settings(settings: MeshSettings) -> None:
    for name in ("max_edge", "tolerance"):
        value = getattr(settings, name)
        if value is not None and not (np.isfinite(value) and value > 0):
            raise NurbsDataError(f"mesh.{name} is {value}: it must be positive.", field=(name,))


def bounded(settings: MeshSettings, nurbs: NurbsSurface) -> MeshSettings:
    """The same sizes where they mean something (see LEAST_SIZE)."""
    low, high = LEAST_SIZE * nurbs.size, GREATEST_SIZE * nurbs.size
    asked = settings.max_edge, settings.tolerance
    edge, height = (None if size is None else min(max(size, low), high) for size in asked)
    return replace(settings, max_edge=edge, tolerance=height)


def check_number(number: float, most: int) -> None:
    """Of the vertices that a mesh would have. Raises TooFineError."""
    if number > most:
        raise TooFineError(
            f"The mesh would have about {number:.3g} vertices, more than the {most} allowed: ask for longer "
            "edges or a larger tolerance.",
            data={"vertices": int(min(number, 1e18))},
        )


@dataclass(frozen=True)
class Sample:
    """The surface on a grid: s (a,) around, t (b,) along; the fields are (b, a).

    speed: |∂s|, length around per parameter; rise: length across the lines of constant t per parameter;
    curvature: greatest absolute normal curvature; area: of the whole surface.
    """

    s: Floats
    t: Floats
    speed: Floats
    rise: Floats
    curvature: Floats
    area: float


def pairs(nurbs: NurbsSurface, s: Floats, t: Floats) -> Floats:
    """(k, 2) parameters (u, v) from those around and along."""
    return np.stack((s, t) if nurbs.closed[0] else (t, s), axis=1)


def sample_of(nurbs: NurbsSurface) -> Sample:
    around = 0 if nurbs.closed[0] else 1
    s, t = (_dense(nurbs, direction) for direction in (around, 1 - around))
    grid_s, grid_t = np.meshgrid(s, t)
    inside = grid_s.ravel()
    inside[inside == s[-1]] = s[0]
    jet = evaluate(nurbs, pairs(nurbs, inside, grid_t.ravel()))
    ds, dt = (jet.du, jet.dv) if around == 0 else (jet.dv, jet.du)
    speed = np.linalg.norm(ds, axis=1)
    density = np.linalg.norm(np.cross(ds, dt), axis=1)
    rise = density / np.maximum(speed, speed.max() * RELATIVE)
    shape = grid_s.shape
    mean = density.reshape(shape)
    cells = (mean[1:, 1:] + mean[:-1, 1:] + mean[1:, :-1] + mean[:-1, :-1]) / 4
    area = float((cells * np.diff(t)[:, None] * np.diff(s)).sum())
    return Sample(
        s, t, speed.reshape(shape), rise.reshape(shape), greatest_curvature(jet).reshape(shape), area
    )


def _dense(nurbs: NurbsSurface, direction: int) -> Floats:
    least = len(spans(nurbs, direction, 1)) - 1
    return spans(nurbs, direction, max(4, -(-SAMPLES // least)))


def greatest_curvature(jet: Jet) -> Floats:
    """(k,) greatest absolute principal curvature, from the first and second fundamental forms."""
    e, f, g = (dot(a, b) for a, b in ((jet.du, jet.du), (jet.du, jet.dv), (jet.dv, jet.dv)))
    l, m, n = (dot(a, jet.normal) for a in (jet.duu, jet.duv, jet.dvv))  # noqa: E741
    determinant = np.maximum(e * g - f * f, np.finfo(float).tiny)
    mean = (e * n - 2 * f * m + g * l) / (2 * determinant)
    gauss = (l * n - m * m) / determinant
    return np.asarray(np.abs(mean) + np.sqrt(np.maximum(mean * mean - gauss, 0)))


def edge_length(sample: Sample, settings: MeshSettings, shrink: float) -> Floats:
    """(b, a) wanted edge length: an arc of curvature κ and chord h is h²κ/8 high."""
    if settings.max_edge is not None:
        longest = shrink * settings.max_edge
    elif settings.tolerance is None:
        longest = shrink * np.sqrt(sample.area / DEFAULT_VERTICES / ROW)
    else:
        longest = np.sqrt(sample.area / 64 / ROW)  # flat parts still show the shape
    if settings.tolerance is None:
        return np.full_like(sample.speed, longest)
    height = shrink**2 * settings.tolerance
    return _graded(
        sample,
        np.minimum(longest, np.sqrt(8 * height / np.maximum(sample.curvature, 8 * height / longest**2))),
    )


def _graded(sample: Sample, h: Floats) -> Floats:
    """(b, a) sizes lowered where they would change faster than GRADE per length, around and along."""
    a = h.shape[1] - 1
    around = cumulated(np.tile(sample.speed[:, :-1], 2), np.tile(np.diff(sample.s), 2)[:-1])
    along = cumulated(sample.rise.T, np.diff(sample.t))
    for _ in range(2):
        turn = limited(np.tile(h[:, :-1], 2), around)
        h = np.minimum(turn[:, :a], turn[:, a:])[:, np.r_[:a, 0]]
        h = limited(h.T, along).T
    return h


def cumulated(speed: Floats, steps: Floats) -> Floats:
    """(k, n) lengths from the beginning of each row, by the trapezoidal rule."""
    length = (speed[:, 1:] + speed[:, :-1]) / 2 * steps
    return np.concatenate([np.zeros((len(speed), 1)), np.cumsum(length, axis=1)], axis=1)


def limited(h: Floats, x: Floats) -> Floats:
    """The greatest function below h along each row, at places x, that changes nowhere faster than GRADE."""
    rising = np.minimum.accumulate(h - GRADE * x, axis=1) + GRADE * x
    falling = np.minimum.accumulate((h + GRADE * x)[:, ::-1], axis=1)[:, ::-1] - GRADE * x
    return np.minimum(rising, falling)
