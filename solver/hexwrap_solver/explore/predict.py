"""What panels will come to, foreseen from the map and the place of the lattice on it, without a pattern.

The cell that would stand at a point has an edge in proportion to e^−u, so that over the surface the sizes of
the cells are known, and how many there are of each. Their largest regular panels are smaller for two reasons.
Where u has a gradient g, and where the domain was stretched for the lattice to fit its boundary or features,
the cell is no regular polygon: to first order the polygon P around 0 is carried by z − ḡ z²/2 + μ z̄. Its
edges turn, and the largest regular polygon between them is shorter by a part of its edge (``shortened``).
With these lengths the exact programme over the size classes (``partition_by_area``), of each kind of cell by
itself, says how much is left uncovered.
"""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, Progress, no_progress, runs
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.domain.locate import barycentric
from hexwrap_solver.geometry import dot, lengths, outline_area, plane_areas
from hexwrap_solver.panels.sizes import divide, floor_to, lengths_of, partition_by_area
from hexwrap_solver.pattern.lattice import LATTICES, Lattice
from hexwrap_solver.pattern.lay.nodes import lattice_points_in_triangles
from hexwrap_solver.pattern.lay_pattern import CLOSE, check_count, off_by
from hexwrap_solver.pattern.place.choose import PlacementFamily
from hexwrap_solver.pattern.place.placement import is_straight
from hexwrap_solver.pattern.place.rotation import with_rotation
from hexwrap_solver.pattern.place.rows import rows_along
from hexwrap_solver.pattern.place.sense import check_edge
from hexwrap_solver.pattern.place.size import HALF_ROW
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.surface.topology import next_half_edge
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.tolerances import RELATIVE, TINY

#: Cells stand on either side of a line of other patterns; those nearer to it are cut by it in two.
HALVED = 0.25
#: Mean edge of either half of a cell, cut from the middle of an edge, in edges, for its number of sides.
HALF_EDGE = {3: (3 + 3**0.5) / 6, 4: 0.75, 6: (3 + 3**0.5) / 5}
#: Cells that a boundary cuts, per cell of area that is left of them: those whose middle is nearer to it than
#: they reach, on either side, of which half the area is inside.
TRIMMED = 2.0
#: Loops lie on lines of the pattern where so much of them does, to within so much of the distance of lines.
MOSTLY, ASTRAY = 0.9, 0.05
#: Edges of the boundary, and of features, are looked for by points on them: so many pieces each at least,
#: none longer than the smallest cell's edge, but no more than this many in all.
FINE, MOST_FINE = 3, 3000
#: Middles are taken this far beside where they stand, in periods of the lattice, so that hardly one lies on
#: an edge between triangles; they lie in a triangle to within rounding.
ASIDE, ROUNDING = 1e-4 * (1 + 0.6j), 1e-9
#: Cells whose sizes differ by less than this (relatively) count as one.
ALIKE = 1e-3


@dataclass(frozen=True)
class Foreseen:
    """Cells of one pattern. uncovered: share of their area that is left open. panels: their number. types:
    different lengths, and panels with another number of sides. area, perimeter: of all panels, model units.
    bare: share of the surface without cells.
    """

    uncovered: float
    panels: int
    types: int
    area: float
    perimeter: float
    bare: float


@dataclass(frozen=True)
class Outlook:
    """The cells that a map and a placed lattice lead to.

    sides: (c,) of each whole cell; size: (c,) edge of a polygon of its kind as large as it, model units;
    limit: (c,) edge of its largest panel without a joint. Whole cells are those whose middle is as far from
    the boundary as they reach, on the average over all directions (perimeter/2π); along a loop that is a line
    of the pattern, half a row. special: cells with another number of sides; trimmed: those cut at the
    boundary; folded: pieces of those that features cut, of that many kinds; rest: area of all these, which
    their panels are taken to cover. edge: the mean over the area of the cells, as that of a pattern; infinite
    where there are none. surface: its area, 0 where cells are trimmed to reach its edges. distortion: of the
    placement.
    """

    lattice: Lattice
    sides: Ints
    size: Floats
    limit: Floats
    edge: float
    special: int = 0
    trimmed: int = 0
    folded: int = 0
    kinds: int = 0
    rest: float = 0.0
    surface: float = 0.0
    distortion: float = 0.0

    def foresee(
        self,
        sizes: int | None,
        joint: float = 0.0,
        edge_range: tuple[float, float] | None = None,
        increment: float = 0.0,
    ) -> Foreseen:
        """With this many size classes (None: a length for each panel), joints at least so wide, and the
        allowed edge lengths, multiples of the increment; panels that cannot reach the range share no class
        with those that can."""
        shortest, longest = edge_range or (0.0, np.inf)
        others = self.special + self.trimmed + self.folded
        types = panels = 0
        area = perimeter = cells = 0.0
        for sides, outline in self.lattice.centred.items():
            of_kind, unit = self.sides == sides, outline_area(outline)
            limit = np.minimum(self.limit[of_kind] - joint / (2 * _inradius(outline)), longest)
            limit = floor_to(limit, increment)
            cells += unit * float((self.size[of_kind] ** 2).sum())
            limit = limit[limit > 0]
            if not len(limit):
                continue
            length, count = _levels(limit)
            if sizes is not None:
                below = int(np.searchsorted(length, shortest)) if sizes > 1 else 0
                groups = [own for own in (slice(below), slice(below, None)) if len(length[own])]
                parts = [(partition_by_area(length[own], sizes, count[own]), length[own]) for own in groups]
                divided = zip(parts, divide(parts, sizes, "area"), strict=True)
                starts = [(made.start[k - 1], own) for (made, own), k in divided]
                types -= len(length) - sum(len(start) for start, _ in starts)
                length = np.concatenate([lengths_of(start, own) for start, own in starts])
            types, panels = types + len(length), panels + len(limit)
            area += unit * float(count @ length**2)
            perimeter += sides * float(count @ length)
        if not panels:
            return Foreseen(1.0, 0, 0, 0.0, 0.0, 1.0)
        # a piece of a cell is as compact as the cell, more or less
        largest = self.lattice.sides
        around = float(np.sqrt(others * self.rest / outline_area(self.lattice.centred[largest]))) * largest
        return Foreseen(
            max(1 - (area + self.rest) / (cells + self.rest), 0.0),
            panels + others,
            types + self.special + self.trimmed + self.kinds,
            area + self.rest,
            perimeter + around,
            max(self.surface - cells - self.rest, 0.0) / max(self.surface, TINY),
        )


def outlook(cmap: ConformalMap, settings: PatternSettings, progress: Progress = no_progress) -> Outlook:
    """The lattice is placed as for the pattern itself, but no cell is made.

    Raises NotAdaptedError, PatternError as ``lay_pattern`` does where no lattice fits, or cells are too many.
    """
    check_edge(cmap.surface, settings)
    lattice = LATTICES[settings.cell_kind]
    settings, _ = with_rotation(cmap, lattice, settings)
    placing = PlacementFamily.of(cmap, lattice, settings)
    progress(0.5, "placing the lattice")
    seen = _outlook(cmap, placing, settings)
    wanted, edge = settings.edge_length, seen.edge
    if wanted is None or not len(seen.size) or abs(edge / wanted - 1) <= CLOSE:
        return seen
    # As ``lay_pattern`` does, which may come to other numbers of cells and rows.
    again = _outlook(cmap, placing, replace(settings, edge_length=wanted**2 / edge))
    return min(seen, again, key=lambda one: off_by(one.edge, wanted, one.distortion))


@dataclass(frozen=True)
class _Cells:
    """Cells of the lattice whose middles (c, 3) lie on the surface. sides, size, limit: see ``Outlook``.
    area: (c,)."""

    middle: Floats
    sides: Ints
    size: Floats
    limit: Floats
    area: Floats

    def __len__(self) -> int:
        return len(self.sides)

    def part(self, keep: Bools) -> _Cells:
        middle, sides, size = self.middle[keep], self.sides[keep], self.size[keep]
        return _Cells(middle, sides, size, self.limit[keep], self.area[keep])

    @property
    def reach(self) -> Floats:
        """(c,) from their middles, on the average over all directions."""
        return np.asarray(self.sides / (2 * np.pi) * self.size)

    def distance(self, line: Floats) -> Floats:
        """(c,) of their middles from a polyline (k, 3): from the edge that has the nearest of its points."""
        along = np.diff(line, axis=0)
        wanted = np.ceil(lengths(along) / self.size.min(initial=np.inf))
        pieces = np.clip(wanted, FINE, max(MOST_FINE // len(along), FINE)).astype(np.int64)
        edge, number = runs(pieces + 1)
        points = line[edge] + (number / pieces[edge])[:, None] * along[edge]
        edge = edge[cKDTree(points).query(self.middle)[1]]
        offset, along = self.middle - line[edge], along[edge]
        share = np.clip(dot(offset, along) / np.maximum(dot(along, along), TINY), 0.0, 1.0)
        return lengths(offset - share[:, None] * along)


def _outlook(cmap: ConformalMap, placing: PlacementFamily, settings: PatternSettings) -> Outlook:
    lattice, placement, surface = placing.lattice, placing.at(settings), cmap.surface
    placed = placement.glued.corners(surface.faces, placement.place)
    check_count(cmap, placed, lattice, settings)
    every = _every_cell(cmap, lattice, placed, _stretched(placing.cmap.corners(), placed))
    whole = _off_cones(cmap, every)
    every, trims = every.part(whole), settings.boundary == "trim"
    whole = _off_loops(
        surface, every, lattice, _on_lines(surface, lattice, placed, placement.rotation, trims)
    )
    bent = whole & _on_features(surface, every, placing.features, placement.straight)
    cells, cut, folded = (every.part(which) for which in (whole & ~bent, ~whole, bent))
    alone = _at_cones(cmap, lattice, plane_areas(placed) / lattice.cell_area)
    length = [cells.size, np.sqrt(alone / _unit_area(lattice.sides - cmap.cones.index))]
    length.append(folded.size * [HALF_EDGE.get(p, 1.0) for p in folded.sides])
    weight = np.concatenate([cells.area, alone, folded.area])
    return Outlook(
        lattice,
        cells.sides,
        cells.size,
        cells.limit,
        edge=float(np.concatenate(length) @ weight / weight.sum()) if len(cells) else np.inf,
        special=len(alone),
        trimmed=round(TRIMMED * len(cut)) if trims else 0,
        folded=2 * len(folded),
        kinds=2 * len(_levels(folded.size)[0]) if len(folded) else 0,
        rest=float(alone.sum() + folded.area.sum() + (cut.area.sum() if trims else 0.0)),
        surface=0.0 if trims else float(surface.areas.sum()),
        distortion=placement.distortion,
    )


def _every_cell(cmap: ConformalMap, lattice: Lattice, placed: Complexes, skew: Complexes) -> _Cells:
    """placed: (m, 3) corners of the triangles in the plane of the lattice; skew: see ``_stretched``."""
    surface = cmap.surface
    faces, area = surface.faces, surface.areas
    scale: Floats = np.exp(-(cmap.log_scale - cmap.log_scale.mean()))
    square = plane_areas(placed) / lattice.edge**2 * (scale**2)[faces].mean(axis=1)
    # of each triangle, which is as large as the cells on it
    wide = np.sqrt(area / np.maximum(abs(square), TINY))
    flat_slope = _slope(cmap, area)
    slope: Floats = np.bincount(faces.ravel(), np.repeat(area * flat_slope, 3)).astype(float)
    slope = slope / np.maximum(np.bincount(faces.ravel(), np.repeat(area, 3)), TINY)
    face, weight, sides = _middles(lattice, placed)
    here, slope, middle = (
        np.einsum("kc,kc...->k...", weight, values[faces[face]])
        for values in (np.log(scale), slope, surface.vertices)
    )
    # Beside a singularity the slope falls as 1/r, and means over vertices are too steep.
    slope = np.minimum(slope, flat_slope[face])
    size = np.exp(here) * wide[face]
    gradient = slope * size * _uphill(placed, cmap.log_scale[faces])[face]
    unit_area, shorter = np.zeros(lattice.sides + 1), np.zeros(len(face))
    for kind, outline in lattice.centred.items():
        unit_area[kind], own = outline_area(outline), sides == kind
        shorter[own] = shortened(outline, gradient[own], skew[face[own]])
    return _Cells(middle, sides, size, size * (1 - np.minimum(shorter, 1.0)), unit_area[sides] * size**2)


def _off_cones(cmap: ConformalMap, cells: _Cells) -> Bools:
    if not len(cmap.cones):
        return np.ones(len(cells), dtype=bool)
    at = cmap.surface.vertices[cmap.cones.vertex]
    return np.asarray(cKDTree(at).query(cells.middle)[0] > cells.reach)


def _off_loops(surface: Surface, cells: _Cells, lattice: Lattice, on_line: Bools) -> Bools:
    """on_line: (n,) see ``_on_lines``."""
    whole = np.ones(len(cells), dtype=bool)
    for loop in surface.loops:
        row = HALF_ROW.get(lattice.kind, HALVED) * cells.size
        least = row if on_line[loop].mean() > MOSTLY else cells.reach
        whole &= cells.distance(surface.vertices[np.append(loop, loop[0])]) > least
    return whole


def _on_features(surface: Surface, cells: _Cells, numbers: Iterable[int], straight: Container[int]) -> Bools:
    """straight: those features that are lines of the pattern."""
    bent = np.zeros(len(cells), dtype=bool)
    for i in numbers:
        least = HALVED * cells.size if i in straight else cells.reach
        bent |= cells.distance(surface.vertices[surface.features[i].vertices]) <= least
    return bent


def _unit_area(sides: Ints) -> Floats:
    """Of regular polygons of edge 1."""
    n = np.maximum(sides, 3)
    return np.asarray(n / (4 * np.tan(np.pi / n)))


def _at_cones(cmap: ConformalMap, lattice: Lattice, cells: Floats) -> Floats:
    """(k,) areas of the cells at the singularities: of what is nearest to each, as much as they need. cells:
    (m,) how many lie on each triangle."""
    surface, cones = cmap.surface, cmap.cones
    middle = surface.vertices[surface.faces].mean(axis=1)
    found = np.zeros(len(cones))
    for k, (v, index) in enumerate(zip(cones.vertex.tolist(), cones.index.tolist(), strict=True)):
        nearest = np.argsort(np.linalg.norm(middle - surface.vertices[v], axis=1), kind="stable")
        total, area = (np.append(0, np.cumsum(part[nearest])) for part in (cells, surface.areas))
        found[k] = np.interp(1 - index / lattice.sides, total, area)
    return found


def _on_lines(surface: Surface, lattice: Lattice, placed: Complexes, angle: float, trims: bool) -> Bools:
    """(n,) vertices from which a boundary edge starts that lies on a line of the pattern, all but. placed:
    (m, 3) corners in the plane of the lattice; angle: of edges to the boundary."""
    found = np.zeros(len(surface.vertices), dtype=bool)
    if not is_straight(lattice, angle):
        return found
    rows = rows_along(lattice, angle, "trim" if trims else "whole")
    rim = np.flatnonzero(surface.twin < 0)
    start, end = placed.ravel()[rim], placed.ravel()[next_half_edge(rim)]
    zero = lattice.forward * np.exp(-1j * angle)
    steps = np.rint(np.angle((end - start) / zero) / lattice.quantum)
    depth = (np.conj(1j * zero * np.exp(1j * lattice.quantum * steps)) * np.stack([start, end])).real
    off = (depth - rows.first) / rows.period
    found[surface.faces.ravel()[rim]] = (abs(off - np.rint(off)) < ASTRAY).all(axis=0)
    return found


def shortened(outline: Complexes, gradient: Complexes, skew: Complexes) -> Floats:
    """(k,) by which part the largest polygon of the same shape in the image of a cell, (p,) corners around 0,
    under z − ḡ z²/2 + μ z̄ is shorter, to first order, for each g and μ (k,).

    An edge that comes nearer to 0 at one of its ends costs a part of its distance from 0. A shift of the
    polygon makes up for what opposite edges lose unequally, so that the worst pair counts; three, of which
    none are opposite, give way to each other.
    """
    moved = skew[:, None] * outline.conj() - gradient.conj()[:, None] * outline**2 / 2
    edge = np.roll(outline, -1) - outline
    normal = -1j * edge / abs(edge)
    first, second = ((normal.conj() * m).real for m in (moved, np.roll(moved, -1, axis=1)))
    lost = -np.minimum(first, second) / (normal.conj() * outline).real
    one, other = np.nonzero(abs(normal[:, None] + normal) < RELATIVE)
    if not len(one):
        return np.asarray(lost.mean(axis=1))
    return np.asarray((lost[:, one] + lost[:, other]).max(axis=1) / 2)


def _stretched(conformal: Complexes, placed: Complexes) -> Complexes:
    """(m,) μ of triangles, (m, 3) each: a circle of the lattice is drawn as z + μ z̄ on the map."""
    (e, f), (g, h) = ((t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (conformal, placed))
    area = e * f.conj() - e.conj() * f
    turn, skew = (g * f.conj() - h * e.conj()) / area, (e * h - f * g) / area  # g = turn·e + skew·ē
    return -skew / turn.conj()


def _uphill(placed: Complexes, values: Floats) -> Complexes:
    """(m,) unit vectors, or 0, along the gradients of values at the corners (m, 3) of triangles."""
    e, f = placed[:, 1] - placed[:, 0], placed[:, 2] - placed[:, 0]
    turned = (values[:, 1] - values[:, 0]) * f - (values[:, 2] - values[:, 0]) * e
    length = abs(turned)
    return np.asarray(-1j * turned / np.where(length > 0, length, 1.0))


def _inradius(outline: Complexes) -> float:
    """Least distance of its edges from 0."""
    edge = np.roll(outline, -1) - outline
    return float(((-1j * edge / abs(edge)).conj() * outline).real.min())


def _middles(lattice: Lattice, corners: Complexes) -> tuple[Ints, Floats, Ints]:
    """Where the middles of cells lie: (k,) triangles, (k, 3) barycentric coordinates, and (k,) corners of
    the cells. corners: (m, 3) in the plane of the lattice."""
    period = complex(lattice.position(lattice.basis[0]))
    found = []
    for middle, sides in zip(lattice.middles + ASIDE * period, lattice.sides_around_middles, strict=True):
        face, point = lattice_points_in_triangles(lattice.coordinates((corners - middle) / period), ROUNDING)
        place = middle + period * np.asarray(lattice.position(point))
        found.append((face, barycentric(corners[face], place), np.full(len(face), sides)))
    face, weight, corner = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return face, weight, corner


def _slope(cmap: ConformalMap, area: Floats) -> Floats:
    """(m,) |∇u| on each triangle, per length of the model."""
    surface = cmap.surface
    corner = surface.vertices[surface.faces]
    opposite = np.roll(corner, -2, axis=1) - np.roll(corner, -1, axis=1)  # of corner k: from k+1 to k+2
    turned = (cmap.log_scale[surface.faces][..., None] * opposite).sum(axis=1)  # the gradient, turned by 90°
    return np.asarray(np.linalg.norm(turned, axis=1) / np.maximum(2 * area, TINY))


def _levels(length: Floats) -> tuple[Floats, Floats]:
    """Lengths ascending that differ by ``ALIKE`` at least, and how many cells have each."""
    level = np.floor(np.log(length / length.min()) / ALIKE).astype(np.int64)
    total: Floats = np.bincount(level).astype(np.float64)
    whole = np.bincount(level, length**2)
    there = total > 0
    return np.sqrt(whole[there] / total[there]), total[there]
