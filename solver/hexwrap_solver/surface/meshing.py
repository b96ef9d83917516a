"""Triangle mesh of a closed NURBS surface (paper, Figure 2).

Rows of vertices run around the surface. They divide every line along it evenly, measured across the rows and
in units of the edge length wanted there, so that an uneven parameterization does not bunch them; each row has
as many vertices as its own length needs. Rows of different numbers are joined by the nearest vertices, and
edges are flipped to Delaunay. There is no seam: the first vertex of a row follows the last.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.surface.errors import NurbsDataError, TooFineError
from hexwrap_solver.surface.flips import flip_to_delaunay
from hexwrap_solver.surface.nurbs import Jet, evaluate, evaluate_points
from hexwrap_solver.surface.nurbs_checks import checked, spans
from hexwrap_solver.surface.projection import chord_heights
from hexwrap_solver.surface.topology import boundary_loops, edge_lengths, twins
from hexwrap_solver.surface.types import MeshSettings, NurbsSurface, Surface

#: Vertices where neither edge length nor tolerance is given.
DEFAULT_VERTICES = 6000
#: Samples in each direction, at least, from which lengths and curvatures are measured.
SAMPLES = 200
#: Height of a row of equilateral triangles.
ROW = np.sqrt(3) / 2
#: Rows with up to this ratio of needed vertices get the same number, which keeps most vertices regular.
STEP = 1.08
#: A row may be so much flatter than equilateral where lines along the surface are shorter than elsewhere.
FLATTEST = 3.0
#: Edge lengths may change by this much per length, so that neighbouring triangles are of one size.
GRADE = 0.12
#: Places around a row are told apart to this part of it: sums with row numbers stay exact.
PLACES = 2.0**32
#: Sizes are planned a little below what was asked, and reduced again while the finished mesh exceeds it.
MARGIN, TRIES = 0.97, 6
#: Sizes beyond these, relative to the control net, ask for no more than these do: below rounding, or a mesh
#: of the fewest vertices. Squares of such as reach the ends of doubles would not be numbers.
LEAST_SIZE, GREATEST_SIZE = 1e-15, 1e3


def surface_from_nurbs(nurbs: NurbsSurface, settings: MeshSettings | None = None) -> Surface:
    """Mesh a NURBS surface that is closed in one direction and open in the other.

    No edge is longer than settings.max_edge, and no edge's middle is further than settings.tolerance from
    the surface. Faces look to the side of ∂u × ∂v. input_vertex numbers the vertices themselves.
    Raises SurfaceError (its children for NURBS surfaces, ``surface/errors.py``).
    """
    settings = settings or MeshSettings()
    _check_settings(settings)
    nurbs, repairs = checked(nurbs)
    settings = _bounded(settings, nurbs)
    sample = _sample(nurbs)
    shrink = MARGIN if settings.max_edge or settings.tolerance else _default_size(nurbs, sample)
    for _ in range(TRIES):
        parameters, jet, faces = _mesh(nurbs, sample, settings, shrink)
        excess = _excess(nurbs, settings, parameters, jet, faces)
        if excess <= 1:
            break
        shrink *= MARGIN / excess
    else:
        raise NurbsDataError(
            "The NURBS surface cannot be meshed to the size that was asked for: it has a crease or a tip in "
            f"which edges stay {excess:.3g} times too long or too far off. Ask for larger edges."
        )
    if not nurbs.closed[0]:
        faces = np.ascontiguousarray(faces[:, ::-1])
    index = np.arange(len(parameters), dtype=np.int64)
    first, second = boundary_loops(faces, twins(faces, len(index)))
    return Surface(
        jet.point, faces, (first, second), index, index, jet.normal, tuple(repairs), nurbs, parameters
    )


def _check_settings(settings: MeshSettings) -> None:
    for name in ("max_edge", "tolerance"):
        value = getattr(settings, name)
        if value is not None and not (np.isfinite(value) and value > 0):
            raise NurbsDataError(
                f"mesh.{name} is {value}: it must be positive.", field=("surface", "mesh", name)
            )


def _bounded(settings: MeshSettings, nurbs: NurbsSurface) -> MeshSettings:
    """The same sizes where they mean something (see LEAST_SIZE)."""
    diagonal = float(np.linalg.norm(np.ptp(nurbs.control_points[..., :3].reshape(-1, 3), axis=0)))
    low, high = LEAST_SIZE * diagonal, GREATEST_SIZE * diagonal
    asked = settings.max_edge, settings.tolerance
    edge, height = (None if size is None else min(max(size, low), high) for size in asked)
    return replace(settings, max_edge=edge, tolerance=height)


@dataclass(frozen=True)
class _Sample:
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


def _pairs(nurbs: NurbsSurface, s: Floats, t: Floats) -> Floats:
    """(k, 2) parameters (u, v) from those around and along."""
    return np.stack((s, t) if nurbs.closed[0] else (t, s), axis=1)


def _sample(nurbs: NurbsSurface) -> _Sample:
    around = 0 if nurbs.closed[0] else 1
    s, t = (_dense(nurbs, direction) for direction in (around, 1 - around))
    grid_s, grid_t = np.meshgrid(s, t)
    inside = grid_s.ravel()
    inside[inside == s[-1]] = s[0]
    jet = evaluate(nurbs, _pairs(nurbs, inside, grid_t.ravel()))
    ds, dt = (jet.du, jet.dv) if around == 0 else (jet.dv, jet.du)
    speed = np.linalg.norm(ds, axis=1)
    density = np.linalg.norm(np.cross(ds, dt), axis=1)
    rise = density / np.maximum(speed, speed.max() * 1e-9)
    shape = grid_s.shape
    mean = density.reshape(shape)
    cells = (mean[1:, 1:] + mean[:-1, 1:] + mean[1:, :-1] + mean[:-1, :-1]) / 4
    area = float((cells * np.diff(t)[:, None] * np.diff(s)).sum())
    return _Sample(s, t, speed.reshape(shape), rise.reshape(shape), _curvature(jet).reshape(shape), area)


def _dense(nurbs: NurbsSurface, direction: int) -> Floats:
    least = len(spans(nurbs, direction, 1)) - 1
    return spans(nurbs, direction, max(4, -(-SAMPLES // least)))


def _curvature(jet: Jet) -> Floats:
    """(k,) greatest absolute principal curvature, from the first and second fundamental forms."""
    e, f, g = (np.einsum("ij,ij->i", a, b) for a, b in ((jet.du, jet.du), (jet.du, jet.dv), (jet.dv, jet.dv)))
    l, m, n = (np.einsum("ij,ij->i", a, jet.normal) for a in (jet.duu, jet.duv, jet.dvv))  # noqa: E741
    determinant = np.maximum(e * g - f * f, np.finfo(float).tiny)
    mean = (e * n - 2 * f * m + g * l) / (2 * determinant)
    gauss = (l * n - m * m) / determinant
    return np.asarray(np.abs(mean) + np.sqrt(np.maximum(mean * mean - gauss, 0)))


def _edge_length(sample: _Sample, settings: MeshSettings, shrink: float) -> Floats:
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


def _graded(sample: _Sample, h: Floats) -> Floats:
    """(b, a) sizes lowered where they would change faster than GRADE per length, around and along."""
    a = h.shape[1] - 1
    around = _cumulated(np.tile(sample.speed[:, :-1], 2), np.tile(np.diff(sample.s), 2)[:-1])
    along = _cumulated(sample.rise.T, np.diff(sample.t))
    for _ in range(2):
        turn = _limited(np.tile(h[:, :-1], 2), around)
        h = np.minimum(turn[:, :a], turn[:, a:])[:, np.r_[:a, 0]]
        h = _limited(h.T, along).T
    return h


def _cumulated(speed: Floats, steps: Floats) -> Floats:
    """(k, n) lengths from the beginning of each row, by the trapezoidal rule."""
    length = (speed[:, 1:] + speed[:, :-1]) / 2 * steps
    return np.concatenate([np.zeros((len(speed), 1)), np.cumsum(length, axis=1)], axis=1)


def _limited(h: Floats, x: Floats) -> Floats:
    """The greatest function below h along each row, at places x, that changes nowhere faster than GRADE."""
    rising = np.minimum.accumulate(h - GRADE * x, axis=1) + GRADE * x
    falling = np.minimum.accumulate((h + GRADE * x)[:, ::-1], axis=1)[:, ::-1] - GRADE * x
    return np.minimum(rising, falling)


def _default_size(nurbs: NurbsSurface, sample: _Sample) -> float:
    """The factor by which edge lengths are to be changed so that there are DEFAULT_VERTICES."""
    planned = sum(map(len, _around(nurbs, sample, *_rows(sample, _edge_length(sample, MeshSettings(), 1.0)))))
    return float(np.sqrt(planned / DEFAULT_VERTICES))


def _mesh(
    nurbs: NurbsSurface, sample: _Sample, settings: MeshSettings, shrink: float
) -> tuple[Floats, Jet, Ints]:
    """Parameters (n, 2), the surface there, and faces counter-clockwise in (around, along)."""
    h = _edge_length(sample, settings, shrink)
    _check_number(sample, h, settings.max_vertices)
    heights, spacing = _rows(sample, h)
    fractions = _around(nurbs, sample, heights, spacing)
    counts = np.array([len(row) for row in fractions])
    _allow(int(counts.sum()), settings.max_vertices)
    faces = _join(counts, np.concatenate(fractions))
    low, high = sample.s[0], sample.s[-1]
    s = low + (high - low) * np.concatenate(fractions)
    fraction = (sample.s - low) / (high - low)
    t = np.concatenate([np.interp(f, fraction, x) for f, x in zip(fractions, heights, strict=True)])
    parameters = _pairs(nurbs, s, t)
    jet = evaluate(nurbs, parameters)
    return parameters, jet, flip_to_delaunay(jet.point, faces)


def _check_number(sample: _Sample, h: Floats, most: int) -> None:
    density = sample.speed * sample.rise / (ROW * h**2)
    _allow(float(np.trapezoid(np.trapezoid(density, sample.s, axis=1), sample.t)), most)


def _allow(number: float, most: int) -> None:
    if number > most:
        raise TooFineError(
            f"The mesh would have about {number:.3g} vertices, more than the {most} allowed: ask for longer "
            "edges or a larger tolerance.",
            data={"vertices": int(min(number, 1e18))},
        )


def _rows(sample: _Sample, h: Floats) -> tuple[Floats, Floats]:
    """Where rows run: heights t and distances between vertices, (rows, a) over the samples around.

    Line by line along the surface, the rise in units of the wanted row height is divided evenly; the line
    that needs the most rows decides their number.
    """
    rate = sample.rise / (ROW * h)
    steps = (rate[1:] + rate[:-1]) / 2 * np.diff(sample.t)[:, None]
    total = np.concatenate([np.zeros((1, rate.shape[1])), np.cumsum(steps, axis=0)])
    needed = total[-1]
    m = 2 * max(1, int(np.ceil(needed.max() / 2)))  # even, so that no boundary is half a step ahead
    heights = np.stack(
        [np.interp(np.arange(m + 1) / m * needed[i], total[:, i], sample.t) for i in range(rate.shape[1])],
        axis=1,
    )
    heights[0], heights[-1] = sample.t[0], sample.t[-1]
    wanted = np.stack([np.interp(heights[:, i], sample.t, h[:, i]) for i in range(rate.shape[1])], axis=1)
    return heights, wanted * np.maximum(needed / m, 1 / FLATTEST)


def _around(nurbs: NurbsSurface, sample: _Sample, heights: Floats, spacing: Floats) -> list[Floats]:
    """For each row, where its vertices stand: ascending fractions of the period."""
    rows, a = heights.shape
    s = np.tile(np.append(sample.s[:-1], sample.s[0]), rows)
    points = evaluate_points(nurbs, _pairs(nurbs, s, heights.ravel())).reshape(rows, a, 3)
    length = np.linalg.norm(np.diff(points, axis=1), axis=2)
    steps = length * 2 / (spacing[:, 1:] + spacing[:, :-1])
    total = np.concatenate([np.zeros((rows, 1)), np.cumsum(steps, axis=1)], axis=1)
    counts = _numbers(total[:, -1])
    fraction = (sample.s - sample.s[0]) / (sample.s[-1] - sample.s[0])
    places = [
        np.interp((np.arange(n) + 0.5 * (k % 2)) / n * row[-1], row, fraction)
        for k, (n, row) in enumerate(zip(counts, total, strict=True))
    ]
    return places


def _numbers(needed: Floats) -> list[int]:
    """Whole numbers of vertices, at least 3, in few different steps; divisible by 12 or 6 where that costs
    little, so that symmetric surfaces have symmetric boundaries."""
    most = max(float(needed.max()), 3.0)
    level = np.ceil(np.log(np.maximum(needed, 3) / most) / np.log(STEP) - 1e-9)
    numbers = np.ceil(most * STEP**level - 1e-9)
    unit = np.select([numbers >= 72, numbers >= 36], [12, 6], 1)
    numbers = unit * np.ceil(numbers / unit)
    return [int(x) for x in np.maximum(numbers, 3)]


def _join(counts: Ints, fractions: Floats) -> Ints:
    """Triangles between neighbouring closed rows; each edge of a row gets the nearest vertex of the other."""
    first = np.concatenate([[0], np.cumsum(counts)])
    row = np.repeat(np.arange(len(counts)), counts)
    k = np.arange(first[-1])
    following = np.where(k + 1 == first[row + 1], first[row], k + 1)
    wrapped = fractions[following] + (following <= k)
    middle = np.round((fractions + wrapped) / 2 * PLACES) / PLACES % 1.0
    upper, lower = k[row > 0], k[row < len(counts) - 1]
    above = _nearest(middle, row, first, lower, +1)
    below = _nearest(middle, row, first, upper, -1)
    return np.concatenate(
        [
            np.stack([lower, following[lower], above], axis=1),
            np.stack([following[upper], upper, below], axis=1),
        ]
    )


def _nearest(middle: Floats, row: Ints, first: Ints, edges: Ints, step: int) -> Ints:
    """The vertex of the row before or after that edges of a row are joined to.

    It is the one at which that row has arrived when both are passed in the order of the middles of their
    edges; of equal middles the lower row's comes first.
    """
    other = row[edges] + step
    turned = row + middle  # sorted inside a row but for the last edge, which may have passed the period
    order = np.argsort(turned, kind="stable")
    place = np.searchsorted(turned[order], other + middle[edges], side="left" if step > 0 else "right")
    place = np.where(place == first[other + 1], first[other], place)
    return order[place]


def _excess(nurbs: NurbsSurface, settings: MeshSettings, parameters: Floats, jet: Jet, faces: Ints) -> float:
    """How many times edges are longer than allowed; chord heights count with their square root."""
    worst = 0.0
    if settings.max_edge is not None:
        worst = float(edge_lengths(jet.point, faces).max()) / settings.max_edge
    if settings.tolerance is not None:
        height = chord_heights(nurbs, parameters, jet.point, faces)
        worst = max(worst, float(np.sqrt(height.max() / settings.tolerance)))
    return worst
