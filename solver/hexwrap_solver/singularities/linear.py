"""Log scale factors as a linear function of singularities and loop curvatures (Soliman, Slepčev, Crane 2018;
Springborn, Schröder, Pinkall 2008, section 5).

On a surface with a flat metric, Δu = −curvature is linear. The discrete map is so up to a few per cent, so
its Hessian at the solution without singularities tells what any of them would do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, Ragged
from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.fixed import minimise
from hexwrap_solver.conformal.types import Targets
from hexwrap_solver.linalg.factor import Factorisation
from hexwrap_solver.singularities.types import Rules
from hexwrap_solver.surface.curvature import cone_points
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.tolerances import TINY

#: The surface is seen in about this many patches: u is smooth, and a patch is as large as a cell or so.
PATCHES = 1200
#: Seats times vertices, which the time of the solves is proportional to: large meshes get fewer seats,
#: but this number at least.
SOLVED, FEWEST = 1.5e7, 400
#: Right-hand sides solved at a time.
BLOCK = 128
#: More vertices than these at which the surface is a cone are roughness, and no seats of their own.
MOST_CONES = 100
#: What the area of filled openings counts.
NOTHING = 1e-6


@dataclass(frozen=True)
class Steepness:
    """patches: their number p. pairs: (k, 2) neighbouring ones. inverse: (k,) inverse distances between their
    middles. The mean squared slope of a linear function towards neighbours is half its squared gradient."""

    patches: int
    pairs: Ints
    inverse: Floats

    @cached_property
    def share(self) -> csr_array:
        """How pairs add up to patches, (p, k)."""
        degree = np.maximum(np.bincount(self.pairs.ravel(), minlength=self.patches), 1)
        row, pair = self.pairs.T.ravel(), np.tile(np.arange(len(self.pairs)), 2)
        return csr_array((1.0 / degree[row], (row, pair)), shape=(self.patches, len(self.pairs)))

    def of(self, u: Floats) -> Floats:
        """(p, …) norm of the gradient of functions u (p, …)."""
        one, other = self.pairs.T
        slope = ((u[one] - u[other]).T * self.inverse).T
        return np.asarray(np.sqrt(2 * (self.share @ slope**2)))

    @classmethod
    def between(cls, surface: Surface, patch: Ints, middle: Floats) -> Steepness:
        """middle: (p, 3) centres of the patches."""
        one, other = patch[surface.faces].T, patch[np.roll(surface.faces, -1, axis=1)].T
        edge = np.sort(np.stack([one.ravel(), other.ravel()], axis=1), axis=1)
        pairs = np.unique(edge[edge[:, 0] != edge[:, 1]], axis=0).reshape(-1, 2)
        far = np.linalg.norm(middle[pairs[:, 0]] - middle[pairs[:, 1]], axis=1)
        return cls(len(middle), pairs, 1 / np.maximum(far, TINY))


@dataclass(frozen=True)
class Tube:
    """The map with both ends straight and no singularities. place: (n,) in turns. scale: (n,) u."""

    place: Complexes
    scale: Floats


@dataclass(frozen=True)
class Model:
    """Mean u of every patch: reference + response @ k + loop_response @ dK.

    seat: (q,) mesh vertices on which a singularity may stand. place: (q, 3). weight: (p,) the patches'
    shares of the area. reference: (p,). response: (p, q), per k = 1. loop_response: (p, f), per quantum
    more on each free loop but the first, which takes what is left. free: indices of the free loops. loops:
    per loop, its curvature in quanta at the reference. steepness: gives |∇u| on the patches. total:
    Σ k wanted where no loop can take a rest,
    None elsewhere. turn: (q,) for two straight loops on a tube: where seats stand around it, in turns; Σ
    k·turn quanta is how far the second loop is turned against the first. orbits: per seat all vertices that
    get a singularity along with it, where places must be symmetric, and member_place: where these are; None:
    the seat alone. cone: (q,) k of the cone that the surface is there already, 0 elsewhere; None where not
    all of its cones are seats.
    """

    seat: Ints
    place: Floats
    weight: Floats
    reference: Floats
    response: Floats
    loop_response: Floats
    free: tuple[int, ...]
    loops: tuple[int, ...]
    total: int | None
    steepness: Steepness
    turn: Floats | None = None
    orbits: Ragged | None = None
    member_place: Floats | None = None
    cone: Ints | None = None

    @cached_property
    def size(self) -> Ints:
        """(q,) singularities per seat."""
        return np.ones(len(self.seat), dtype=np.int64) if self.orbits is None else self.orbits.lengths

    def on(self, kept: Bools) -> Model:
        """With fewer seats. kept: (q,) of a model without orbits and turns."""
        cone = None if self.cone is None or self.cone[~kept].any() else self.cone[kept]
        seat, place, response = self.seat[kept], self.place[kept], self.response[:, kept]
        return replace(self, seat=seat, place=place, response=response, cone=cone)


def vertex_areas(surface: Surface) -> Floats:
    """(n,) a third of the triangles around each."""
    third = np.repeat(surface.areas / 3, 3)
    return np.asarray(np.bincount(surface.faces.ravel(), third, len(surface.vertices)))


def _wall_areas(surface: Surface) -> Floats:
    """The same, but next to nothing where openings were filled, which are cut out again."""
    if surface.patch is None:
        return vertex_areas(surface)
    third = np.repeat(np.where(surface.patch, NOTHING, 1.0) * surface.areas / 3, 3)
    return np.asarray(np.bincount(surface.faces.ravel(), third, len(surface.vertices)))


def targets(
    surface: Surface,
    ends: tuple[str, ...],
    loops: tuple[int, ...],
    quantum: float,
    vertex: Ints,
    index: Ints,
    background: float = 0.0,
    angles: Floats | None = None,
) -> Targets:
    """Cone angles at vertices, curvatures in quanta on loops; background: further curvature, spread evenly
    over the area. angles: (n,) or more, of loops whose ends are "angles"."""
    n = len(surface.vertices)
    angle, shared = np.full(n, 2 * np.pi), np.full(n, -1, dtype=np.int64)
    shared_angle: list[float] = []
    if background:
        share = vertex_areas(surface)
        angle -= background * share / share.sum()
    angle[vertex] -= quantum * index
    for loop, end, curvature in zip(surface.loops, ends, loops, strict=True):
        angle[loop] -= np.pi if end != "angles" or angles is None else 2 * np.pi - angles[loop]
        if end == "free":
            shared[loop] = len(shared_angle)
            shared_angle.append(len(loop) * np.pi - curvature * quantum)
    return Targets(angle, shared, np.array(shared_angle))


def reference_loops(surface: Surface, rules: Rules) -> tuple[int, ...]:
    """Curvatures in quanta without singularities: a disk has 2π, an annulus none, and each further opening
    turns back by 2π; those of loops that are not free are what they are."""
    ends, turns = rules.ends, round(2 * np.pi / rules.quantum)
    fixed = [
        0 if rules.angles is None else round(float((np.pi - rules.angles[loop]).sum()) / rules.quantum)
        for loop in surface.loops
    ]
    free = [end == "free" for end in ends]
    if len(ends) == 1:
        return (turns if free[0] else fixed[0],)
    length = [
        float(np.linalg.norm(np.diff(surface.vertices[loop], axis=0), axis=1).sum()) for loop in surface.loops
    ]
    longest = np.argsort(-np.array(length), kind="stable")[:2]
    return tuple((0 if i in longest else -turns) if free[i] else fixed[i] for i in range(len(ends)))


class Responses:
    """One nonlinear solution without singularities and one factorisation, from which models for any seats
    follow by a solve for each."""

    def __init__(
        self,
        surface: Surface,
        rules: Rules,
        tube: Tube | None = None,
        patches: int = PATCHES,
        steps: bool = True,
    ) -> None:
        """tube: for two straight ends that must stand in lattice directions to each other. patches: about how
        many. steps: with the nonlinear solution; else the metric of the surface itself stands in."""
        self.surface, self.rules = surface, rules
        self.turn = None if tube is None else tube.place.real
        turns = round(2 * np.pi / rules.quantum)
        self.free = tuple(i for i, end in enumerate(rules.ends) if end == "free")
        self.loops = reference_loops(surface, rules)
        self.rest = turns * (2 - len(rules.ends)) - sum(self.loops)
        none = np.zeros(0, dtype=np.int64)
        area = _wall_areas(surface)
        background = self.rest * rules.quantum if not self.free else 0.0
        wanted = targets(surface, rules.ends, self.loops, rules.quantum, none, none, background, rules.angles)
        self.energy = energy = Energy(surface, wanted)
        u, self.factor = _reference(energy, steps, None if tube is None else tube.scale)
        patch, self.middle = _patches(surface, area, patches)
        weight = np.bincount(patch, area)
        shape = (len(self.middle), len(patch))
        self.share = csr_array((area / weight[patch], (patch, np.arange(len(patch)))), shape=shape)
        self._share_of = self.share @ _of_unknowns(energy)
        self.weight, self.reference = weight / weight.sum(), self._mean(u)
        self.steepness = Steepness.between(surface, patch, _means(surface.vertices, patch, area))
        self.shift = np.zeros(len(self.middle))
        if not self.free:  # a singularity takes its curvature from everywhere
            self.shift = self._mean(energy.scale_of(self.factor.solve(energy.reduce(area / area.sum()))))
        shared = np.arange(energy.n_dof - max(len(self.free) - 1, 0), energy.n_dof)
        self.loop_response = rules.quantum * self._responses(shared)

    def _mean(self, values: Floats) -> Floats:
        """Over each patch."""
        return np.asarray(self.share @ values)

    def _responses(self, dof: Ints) -> Floats:
        """(p, k) mean u when a unit of curvature goes to each of the unknowns (−1: the pinned one)."""
        right = np.zeros((self.energy.n_dof, len(dof)))
        inside = np.flatnonzero(dof >= 0)
        right[dof[inside], inside] = 1.0
        return np.asarray(self._share_of @ self.factor.solve(right))

    def seats(self, solved: float = SOLVED, fewest: int = FEWEST) -> Ints:
        """Vertices on which the rules allow a singularity, one in every patch. solved: seats times vertices,
        at most, but for this number of ``fewest``."""
        few = max(int(solved / len(self.surface.vertices)), fewest)
        middle = self.middle
        if few < len(middle):
            _, middle = _patches(self.surface, _wall_areas(self.surface), few)
        return _seats(self.surface, middle, self.rules)

    def near(self, vertices: Ints, radius: float, spacing: float) -> Ints:
        """The vertices themselves and others around them that the rules allow, about one per cube of a
        spacing."""
        places = self.surface.vertices
        found = cKDTree(places).query_ball_point(places[vertices], radius)
        around = np.unique(np.concatenate([np.array(one, dtype=np.int64) for one in found]))
        around = around[np.lexsort(places[around].T)]
        box = np.floor((places[around] - places.min(axis=0)) / spacing).astype(np.int64)
        around = around[np.unique(box, axis=0, return_index=True)[1]]
        return np.union1d(around[_allowed(self.surface, around, self.rules)], vertices)

    def model(self, seats: Ints, orbits: Callable[[Ints], list[Ints]] | None = None) -> Model:
        """orbits: from seats to lists of vertices that get singularities together."""
        together = None if orbits is None else _ragged(orbits(seats))
        seats = seats if together is None else np.asarray(together.values, dtype=np.int64)
        response = np.empty((len(self.middle), len(seats)))
        for begin in range(0, response.shape[1], BLOCK):
            dof = self.energy.dof[seats[begin : begin + BLOCK]]
            response[:, begin : begin + BLOCK] = self._responses(dof)
        response -= self.shift[:, None]
        around = None if self.turn is None else self.turn[seats]
        places = self.surface.vertices[seats]
        if together is not None:
            first = together.offsets[:-1]
            response = _summed(response, first)
            around = None if around is None else _summed(around, first)
        return Model(
            seats if together is None else seats[together.offsets[:-1]],
            places if together is None else places[together.offsets[:-1]],
            self.weight,
            self.reference,
            self.rules.quantum * response,
            self.loop_response,
            self.free,
            self.loops,
            None if self.free else self.rest,
            self.steepness,
            around,
            together,
            None if together is None else places,
            self._cone(seats) if together is None else None,
        )

    def _cone(self, seats: Ints) -> Ints | None:
        """(q,) see ``Model``."""
        points, index = cone_points(self.surface, self.rules.quantum)
        if len(points) > MOST_CONES or not np.isin(points, seats).all():
            return None
        at = np.zeros(len(self.surface.vertices), dtype=np.int64)
        at[points] = index
        return at[seats]


def linear_model(
    surface: Surface,
    rules: Rules,
    tube: Tube | None = None,
    seats: Ints | None = None,
    patches: int = PATCHES,
    steps: bool = True,
) -> Model:
    """For seats (q,), or None: as the rules allow; see ``Responses``."""
    found = Responses(surface, rules, tube, patches, steps)
    return found.model(found.seats() if seats is None else seats)


def _summed(values: Floats, first: Ints) -> Floats:
    """Sums over groups of the last axis, which begin at ``first``."""
    if not len(first):
        return values[..., :0]
    return np.asarray(np.add.reduceat(values, first, axis=-1))


def _ragged(rows: list[Ints]) -> Ragged:
    lengths = np.array([len(row) for row in rows], dtype=np.int64)
    return Ragged.of(np.concatenate([np.zeros(0, dtype=np.int64), *rows]), lengths)


def _reference(energy: Energy, steps: bool, start: Floats | None) -> tuple[Floats, Factorisation]:
    """u without singularities and the factorised Hessian there; where triangles would have to be flipped, one
    Newton step on the surface's own metric: with smooth surfaces, u is linear anyway."""
    if steps:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = minimise(energy, start)
        if found.converged and not found.violating:
            found.factorisation.factorise(*energy.hessian(found.corners))
            return found.u, found.factorisation
    corners, factor = (
        energy.corners(np.zeros(energy.n)),
        Factorisation(energy.points, energy.rows, energy.columns),
    )
    diagonal, off = energy.hessian(corners)
    factor.factorise(diagonal + 1e-12 * np.abs(diagonal).max(), off)
    return energy.scale_of(factor.solve(-energy.gradient(corners))), factor


def _of_unknowns(energy: Energy) -> csr_array:
    """(n, n_dof) u of the vertices by the unknowns, but for what is fixed."""
    vertex = np.flatnonzero(energy.dof >= 0)
    ones = np.ones(len(vertex))
    return csr_array((ones, (vertex, energy.dof[vertex])), shape=(energy.n, energy.n_dof))


def _patches(surface: Surface, area: Floats, wanted: int) -> tuple[Ints, Ints]:
    """(n,) patch of each vertex, and (p,) the vertex in its middle; the same whatever the numbering."""
    vertices = surface.vertices
    if len(vertices) <= wanted:
        middle = np.lexsort(vertices.T)
        return np.argsort(middle), middle
    size = float(np.sqrt(area.sum() / wanted))
    low = vertices.min(axis=0)
    for _ in range(4):  # a surface meets more cubes than squares of its size
        box = np.floor((vertices - low) / size).astype(np.int64)
        most = box.max(axis=0) + 1
        key = (box[:, 0] * most[1] + box[:, 1]) * most[2] + box[:, 2]
        _, cube, count = np.unique(key, return_inverse=True, return_counts=True)
        size *= float(np.sqrt(len(count) / wanted))
    cube = cube.ravel()
    off = np.linalg.norm(vertices - _means(vertices, cube, area)[cube], axis=1)
    order = np.lexsort((*vertices.T, off, cube))
    first = np.flatnonzero(np.diff(cube[order], prepend=-1))
    middle = order[first]
    middle = middle[np.lexsort(vertices[middle].T)]
    return np.asarray(cKDTree(vertices[middle]).query(vertices)[1], dtype=np.int64), middle


def _means(points: Floats, group: Ints, weight: Floats) -> Floats:
    total = np.maximum(np.bincount(group, weight), TINY)
    return np.stack([np.bincount(group, weight * x) / total for x in points.T], axis=1)


def _seats(surface: Surface, seat: Ints, rules: Rules) -> Ints:
    """Of the patches' middles, the vertices next to the middles of balls, and those at which the surface is a
    cone already, those that the rules leave."""
    cones, _ = cone_points(surface, rules.quantum)
    if len(cones) <= MOST_CONES:
        seat = np.concatenate([seat, np.setdiff1d(cones, seat)])
    if rules.only is not None:  # a ball may be smaller than a patch
        near = np.asarray(cKDTree(surface.vertices).query(rules.only[:, :3])[1], dtype=np.int64)
        seat = np.concatenate([seat, np.setdiff1d(near, seat)])
    return np.asarray(seat[_allowed(surface, seat, rules)])


def _allowed(surface: Surface, seat: Ints, rules: Rules) -> Bools:
    """Which seats the rules leave."""
    place = surface.vertices[seat]
    allowed = np.ones(len(seat), dtype=bool)
    for loop in surface.loops:
        allowed &= cKDTree(surface.vertices[loop]).query(place)[0] >= rules.from_loops * rules.cell
        allowed &= ~np.isin(seat, loop)
    if surface.patch is not None:  # what is cut out again
        allowed &= np.isin(seat, surface.faces[~surface.patch])
    on_cone = np.isin(seat, cone_points(surface, rules.quantum)[0])
    for line, cells in rules.creases:  # which end or meet at cones
        allowed &= on_cone | (distance_to(place, line) >= cells * rules.cell)
    for line, cells in rules.away:
        allowed &= distance_to(place, line) >= cells * rules.cell
    if rules.only is not None:
        allowed &= (cdist(place, rules.only[:, :3]) <= rules.only[:, 3]).any(axis=1)
    return allowed


def distance_to(place: Floats, line: Floats) -> Floats:
    """(q,) of points (q, 3) from a polyline (k, 3), or from its one point."""
    start, end = (line[:-1], line[1:]) if len(line) > 1 else (line, line)
    along = end - start
    square = np.maximum((along**2).sum(axis=1), TINY)
    least = np.full(len(place), np.inf)
    for a, step, length in zip(
        *(np.array_split(part, range(256, len(start), 256)) for part in (start, along, square)), strict=True
    ):
        off = place[:, None] - a
        t = np.clip((off * step).sum(axis=2) / length, 0, 1)
        least = np.minimum(least, np.linalg.norm(off - t[:, :, None] * step, axis=2).min(axis=1))
    return least
