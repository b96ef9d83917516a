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

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, Progress, no_progress
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.domain.locate import barycentric
from hexwrap_solver.geometry import outline_area, plane_areas
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
#: Points on each edge of the boundary, and of features, from which distances are taken.
FINE = 4
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


def _outlook(cmap: ConformalMap, placing: PlacementFamily, settings: PatternSettings) -> Outlook:
    lattice, placement, surface = placing.lattice, placing.at(settings), cmap.surface
    placed = placement.glued.corners(surface.faces, placement.place)
    check_count(cmap, placed, lattice, settings)
    cells, area = plane_areas(placed) / lattice.cell_area, surface.areas
    skew = _stretched(placing.cmap.corners(), placed)
    size: Floats = np.exp(-(cmap.log_scale - cmap.log_scale.mean()))
    square = lattice.cell_area / lattice.edge**2 * cells * (size**2)[surface.faces].mean(axis=1)
    # of each triangle, which is as large as the cells on it
    wide = np.sqrt(area / np.maximum(abs(square), TINY))
    slope: Floats = np.bincount(surface.faces.ravel(), np.repeat(area * _slope(cmap, area), 3)).astype(float)
    slope = slope / np.maximum(np.bincount(surface.faces.ravel(), np.repeat(area, 3)), TINY)
    face, weight, sides = _middles(lattice, placed)
    here, slope, middle = (
        np.einsum("kc,kc...->k...", weight, values[surface.faces[face]])
        for values in (np.log(size), slope, surface.vertices)
    )
    # Beside a singularity the slope falls as 1/r, and means over vertices are too steep.
    slope = np.minimum(slope, _slope(cmap, area)[face])
    size = np.exp(here) * wide[face]
    uphill = _uphill(placed, cmap.log_scale[surface.faces])[face]
    unit_area, shorter = np.zeros(lattice.sides + 1), np.zeros(len(face))
    for kind, outline in lattice.centred.items():
        unit_area[kind], own = outline_area(outline), sides == kind
        shorter[own] = shortened(outline, (slope * size * uphill)[own], skew[face[own]])
    reach: Floats = np.asarray(sides / (2 * np.pi) * size)
    regular = np.ones(len(face), dtype=bool)
    if len(cmap.cones):
        regular = cKDTree(surface.vertices[cmap.cones.vertex]).query(middle)[0] > reach
    whole = regular.copy()
    on_line = _on_lines(surface, lattice, placed, placement.rotation, settings.boundary)
    for loop in surface.loops:
        least: Floats = HALF_ROW.get(lattice.kind, HALVED) * size if on_line[loop].mean() > MOSTLY else reach
        whole &= _distance(middle, surface.vertices[np.append(loop, loop[0])]) > least
    bent = np.zeros(len(face), dtype=bool)
    for i in placing.features:
        least = HALVED * size if i in placement.straight else reach
        bent |= _distance(middle, surface.vertices[surface.features[i].vertices]) <= least
    bent &= whole
    whole &= ~bent
    beside, cut = bent, 0
    if settings.boundary == "trim":
        beside, cut = regular & ~whole, round(TRIMMED * float((regular & ~whole & ~bent).sum()))
    alone = _at_cones(cmap, lattice, cells)
    rest = float((unit_area[sides] * size**2)[beside].sum()) + float(alone.sum())
    shorter = np.minimum(shorter, 1.0)
    folded, kinds = 2 * int(bent.sum()), 2 * len(_levels(size[bent])[0]) if bent.any() else 0
    halved = (
        unit_area[sides[bent]] * size[bent] ** 2,
        size[bent] * [HALF_EDGE.get(p, 1.0) for p in sides[bent]],
    )
    size, shorter, sides = size[whole], shorter[whole], sides[whole]
    limit = size * (1 - shorter)
    wall = 0.0 if settings.boundary == "trim" else float(area.sum())
    length = np.concatenate([size, np.sqrt(alone / _unit_area(lattice.sides - cmap.cones.index)), halved[1]])
    weight = np.concatenate([unit_area[sides] * size**2, alone, halved[0]])
    edge = float(length @ weight / weight.sum()) if len(size) else np.inf
    return Outlook(
        lattice, sides, size, limit, edge, len(alone), cut, folded, kinds, rest, wall, placement.distortion
    )


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


def _on_lines(surface: Surface, lattice: Lattice, placed: Complexes, angle: float, boundary: str) -> Bools:
    """(n,) vertices from which a boundary edge starts that lies on a line of the pattern, all but. placed:
    (m, 3) corners in the plane of the lattice; angle: of edges to the boundary."""
    found = np.zeros(len(surface.vertices), dtype=bool)
    if is_straight(lattice, angle):
        rim = np.flatnonzero(surface.twin < 0)
        start, end = placed.ravel()[rim], placed.ravel()[next_half_edge(rim)]
        rows, zero = rows_along(lattice, angle, boundary), lattice.forward * np.exp(-1j * angle)
        inward = (
            1j
            * zero
            * np.exp(1j * lattice.quantum * np.rint(np.angle((end - start) / zero) / lattice.quantum))
        )
        off = [(inward.conj() * (end_ - 0)).real - rows.first for end_ in (start, end)]
        off = [abs(depth - rows.period * np.rint(depth / rows.period)) for depth in off]
        found[surface.faces.ravel()[rim]] = np.maximum(*off) < ASTRAY * rows.period
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


def _distance(points: Floats, line: Floats) -> Floats:
    """(n,) to a polyline, all but."""
    fine = line[:-1, None] + np.linspace(0, 1, FINE)[:, None] * np.diff(line, axis=0)[:, None]
    return np.asarray(cKDTree(fine.reshape(-1, 3)).query(points)[0])


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
