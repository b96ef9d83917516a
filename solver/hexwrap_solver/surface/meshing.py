"""Triangle mesh of a closed NURBS surface (paper, Figure 2).

Rows of vertices run around the surface. They divide every line along it evenly, measured across the rows and
in units of the edge length wanted there, so that an uneven parameterization does not bunch them; each row has
as many vertices as its own length needs. Rows of different numbers are joined by the nearest vertices, and
edges are flipped to Delaunay. There is no seam: the first vertex of a row follows the last.
"""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.surface.errors import NurbsDataError
from hexwrap_solver.surface.flips import flip_to_delaunay
from hexwrap_solver.surface.mesh_sizes import (
    DEFAULT_VERTICES,
    ROW,
    Sample,
    bounded,
    check_number,
    check_settings,
    edge_length,
    pairs,
    sample_of,
)
from hexwrap_solver.surface.nurbs import Jet, evaluate, evaluate_points
from hexwrap_solver.surface.nurbs_checks import checked
from hexwrap_solver.surface.projection import chord_heights
from hexwrap_solver.surface.topology import boundary_loops, edge_lengths, twins
from hexwrap_solver.surface.types import MeshSettings, NurbsSurface, Surface
from hexwrap_solver.tolerances import RELATIVE

#: Rows with up to this ratio of needed vertices get the same number, which keeps most vertices regular.
STEP = 1.08
#: A row may be this much flatter than equilateral where lines along the surface are shorter than elsewhere.
FLATTEST = 3.0
#: Places around a row are distinguished to this part of it: sums with row numbers stay exact.
PLACES = 2.0**32
#: Sizes are planned a little below what was asked, and reduced again while the finished mesh exceeds it.
MARGIN, TRIES = 0.97, 6


def surface_from_nurbs(nurbs: NurbsSurface, settings: MeshSettings | None = None) -> Surface:
    """Mesh a NURBS surface that is closed in one direction and open in the other.

    No edge is longer than settings.max_edge, and no edge's middle is further than settings.tolerance from
    the surface. Faces look to the side of ∂u × ∂v. input_vertex numbers the vertices themselves.
    Raises SurfaceError (its children for NURBS surfaces, ``surface/errors.py``).
    """
    settings = settings or MeshSettings()
    check_settings(settings)
    nurbs, repairs = checked(nurbs)
    settings = bounded(settings, nurbs)
    sample = sample_of(nurbs)
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


def _default_size(nurbs: NurbsSurface, sample: Sample) -> float:
    """The factor by which edge lengths are to be changed so that there are DEFAULT_VERTICES."""
    planned = sum(map(len, _around(nurbs, sample, *_rows(sample, edge_length(sample, MeshSettings(), 1.0)))))
    return float(np.sqrt(planned / DEFAULT_VERTICES))


def _mesh(
    nurbs: NurbsSurface, sample: Sample, settings: MeshSettings, shrink: float
) -> tuple[Floats, Jet, Ints]:
    """Parameters (n, 2), the surface there, and faces counter-clockwise in (around, along)."""
    h = edge_length(sample, settings, shrink)
    _check_number(sample, h, settings.max_vertices)
    heights, spacing = _rows(sample, h)
    fractions = _around(nurbs, sample, heights, spacing)
    counts = np.array([len(row) for row in fractions])
    check_number(int(counts.sum()), settings.max_vertices)
    faces = _join(counts, np.concatenate(fractions))
    low, high = sample.s[0], sample.s[-1]
    s = low + (high - low) * np.concatenate(fractions)
    fraction = (sample.s - low) / (high - low)
    t = np.concatenate([np.interp(f, fraction, x) for f, x in zip(fractions, heights, strict=True)])
    parameters = pairs(nurbs, s, t)
    jet = evaluate(nurbs, parameters)
    return parameters, jet, flip_to_delaunay(jet.point, faces)


def _check_number(sample: Sample, h: Floats, most: int) -> None:
    density = sample.speed * sample.rise / (ROW * h**2)
    check_number(float(np.trapezoid(np.trapezoid(density, sample.s, axis=1), sample.t)), most)


def _rows(sample: Sample, h: Floats) -> tuple[Floats, Floats]:
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


def _around(nurbs: NurbsSurface, sample: Sample, heights: Floats, spacing: Floats) -> list[Floats]:
    """For each row, where its vertices stand: ascending fractions of the period."""
    rows, a = heights.shape
    s = np.tile(np.append(sample.s[:-1], sample.s[0]), rows)
    points = evaluate_points(nurbs, pairs(nurbs, s, heights.ravel())).reshape(rows, a, 3)
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
    level = np.ceil(np.log(np.maximum(needed, 3) / most) / np.log(STEP) - RELATIVE)
    numbers = np.ceil(most * STEP**level - RELATIVE)
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
