"""The map with singularities: where they stand, and the exact map with them (beyond the paper)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Progress, no_progress
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.corners import asked_angles
from hexwrap_solver.conformal.layout import lay_out
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.openings import cut_openings
from hexwrap_solver.conformal.solve import map_of_curvatures, map_to, on_area
from hexwrap_solver.conformal.types import QUANTA, BoundaryCondition, Cones, ConformalMap, Fitted
from hexwrap_solver.errors import ConvergenceError, NotAdaptedError, SingularitiesError
from hexwrap_solver.pattern.lattice import LATTICES, Lattice
from hexwrap_solver.pattern.place.placement import edge_angle, is_straight
from hexwrap_solver.pattern.place.rows import rows_along
from hexwrap_solver.pattern.place.sense import too_many
from hexwrap_solver.pattern.place.size import (
    DEFAULT_ON_NETS,
    face_areas,
    wanted_edge,
    width_per_cell,
)
from hexwrap_solver.pattern.types import Kind, PatternSettings
from hexwrap_solver.singularities.close import Chart, Closed, Closing, Line, extended
from hexwrap_solver.singularities.drag import refined, rims
from hexwrap_solver.singularities.linear import Tube, targets, vertex_areas
from hexwrap_solver.singularities.place import Proposals, given, place
from hexwrap_solver.singularities.types import End, Proposal, Rules, SingularitySettings
from hexwrap_solver.surface.curvature import cone_points
from hexwrap_solver.surface.holes import fill_openings
from hexwrap_solver.surface.types import Surface

#: Size classes for which singularities are placed where every panel may have its own size.
SIZES = 11
#: Numbers of singularities tried where as many as pay are asked for; how many more than the topology asks
#: for, and where that leaves much open.
MOST, MORE, MANY = 8, 2, 18
#: The size of the cells may change by this share, and by this one where a length is asked for.
FREE, ASKED = 0.05, 0.015
#: And by this one, a logarithm, where singularities stay at the corners of a building: the sizes that divide
#: what lies between them are few.
AT_CONES = 0.7
#: There they stay if the pattern closes after moves of so many cells; else it is bent.
STAYS = 1e-3
#: Where the least moves that close are longer than this, in cells, singularities are seated anew, this many
#: times.
FAR, AGAIN = 0.6, 2
#: Where those chosen do not close, this many other numbers of singularities are tried.
OTHERS = 1
#: Closing is not tried anew once it was tried on meshes of so many vertices together; those on which it fails
#: count this many times more, and those with more singularities than these in proportion.
WORK, HARD, USUAL = 100_000, 2, 12
#: Creases whose surroundings are more than this part of the surface are not lines to keep away from.
FACETED = 0.5
#: Sums of listed angles this near to a multiple of the quantum are one, radians.
NEARLY = 1e-3


@dataclass(frozen=True)
class Frame:
    """What the singularities of one surface are chosen and closed for.

    width: of a cell, which is that of the surface as of the domain. line: for straight loops that are to be
    lattice lines; aligned: which ones. tube: where both are. free_scale: share by which the width may change.
    any_size: whether none is asked for.
    """

    lattice: Lattice
    rules: Rules
    width: float
    line: Line | None
    aligned: tuple[bool, ...]
    tube: Tube | None
    free_scale: float
    any_size: bool = False


def needs_singularities(surface: Surface, boundary: BoundaryCondition) -> bool:
    """Whether no map without any can have what is asked for at the boundary: of a closed surface, and where
    straight and listed angles add up to no surface without."""
    angles = [angle for angle in asked_angles(surface, boundary) if angle is not None]
    if len(angles) < len(surface.loops):
        return False
    missing = 2 * np.pi * (2 - len(surface.loops)) - sum(float((np.pi - angle).sum()) for angle in angles)
    quantum = QUANTA.get(boundary.quantum, np.pi / 3)
    listed = boundary.mode == "angles" or any(one.mode == "angles" for one in boundary.loops)
    return not listed and abs(missing) > quantum / 2


def frame_of(
    surface: Surface,
    boundary: BoundaryCondition,
    settings: SingularitySettings,
    pattern: PatternSettings | None,
    sizes: int | None,
) -> Frame:
    """Raises RequestError; SingularitiesError where the pattern cannot have what is asked for; PatternError
    where its cells would be too many."""
    pattern = pattern or PatternSettings()
    if pattern.rotation in ("u", "v"):
        pattern = replace(pattern, rotation="edge")
    lattice = LATTICES[pattern.cell_kind]
    _check_kind(lattice, settings)
    ends, angles = _ends(surface, boundary, lattice)
    angle = edge_angle(lattice, pattern)
    straight = [end == "straight" for end in ends]
    wanted = {"none": 0, "first": 1, "both": 2}[pattern.align]
    aligned = tuple(on and i < wanted and is_straight(lattice, angle) for i, on in enumerate(straight))
    tube = conformal_map(surface, BoundaryCondition("straight")) if len(surface.loops) == 2 else None
    width = _width(surface, lattice, pattern, angle, tube)
    enough = most = max(settings.count if isinstance(settings.count, int) else MOST, 1)
    if "free" not in ends:
        missing = 6 * (2 - len(ends)) if lattice.order == 6 else 4 * (2 - len(ends))
        missing -= sum(round(float((np.pi - angles[loop]).sum()) / lattice.quantum) for loop in surface.loops)
        if settings.count in (None, "auto"):
            enough, most = max(most, abs(missing) + MORE), max(most, abs(missing) + MANY)
    rules = Rules(
        lattice.quantum,
        width,
        sizes or SIZES,
        ends,
        most=most,
        enough=enough,
        from_loops=settings.from_boundary,
        angles=angles if "angles" in ends else None,
        away=_lines(surface, settings),
        creases=_creases(surface, settings.from_features, width),
        only=np.array([[*one.point, one.radius or width] for one in settings.only])
        if settings.only
        else None,
        symmetric=settings.symmetric,
    )
    straight_tube = None
    if tube is not None and all(aligned):
        n = len(surface.vertices)
        straight_tube = Tube(tube.uv[:n] / tube.circumference, tube.log_scale[:n])
    free_scale = ASKED if pattern.edge_length is not None else FREE
    line = _line(lattice, angle, pattern.boundary) if any(aligned) else None
    any_size = pattern.edge_length is None and pattern.around is None
    return Frame(lattice, rules, width, line, aligned, straight_tube, free_scale, any_size)


def _check_kind(lattice: Lattice, settings: SingularitySettings) -> None:
    """Raises SingularitiesError for patterns that no rotation by the quantum of singularities carries to
    themselves, and for indices that leave no polygon."""
    if lattice.fold < lattice.order:
        raise SingularitiesError(
            f"A {lattice.kind} pattern has no rotations but half turns, so that it closes around no "
            "singularity: ask for quads or hexagons, or leave singularities out."
        )
    most = max((one.index for one in settings.at), default=1)
    sides = _parts_left(lattice, most)
    if sides < 3:
        raise SingularitiesError(
            f"A singularity of index {most} would leave {sides} "
            f"{'sides' if lattice.sides_at_centre else 'cells'} around it in a {lattice.kind} pattern: "
            f"ask for an index of at most {most - 3 + sides}."
        )


def _parts_left(lattice: Lattice, k: int) -> int:
    """Sides of a cell around a singularity, or cells around a node that is one."""
    around = lattice.sides_at_centre or lattice.ways.shape[1]
    return around - k * around // lattice.order


def _lines(surface: Surface, settings: SingularitySettings) -> tuple[tuple[Floats, float], ...]:
    """Polylines to keep away from, with how many cells: the rims of filled openings, and those asked for."""
    asked = ((np.array(one.line, dtype=float), one.distance) for one in settings.keep_off)
    return (*((surface.vertices[edge], settings.from_features) for edge in rims(surface)), *asked)


def _creases(surface: Surface, distance: float, width: float) -> tuple[tuple[Floats, float], ...]:
    """Likewise creases, unless these are everywhere, as on a faceted surface, or all vertices lie on them, as
    on a coarse box."""
    creases = [surface.vertices[feature.vertices] for feature in surface.features]
    length = sum(float(np.linalg.norm(np.diff(crease, axis=0), axis=1).sum()) for crease in creases)
    creased = {v for feature in surface.features for v in feature.vertices.tolist()}
    is_faceted = 2 * length * distance * width > FACETED * vertex_areas(surface).sum()
    if is_faceted or len(creased) == len(surface.vertices):
        return ()
    return tuple((crease, distance) for crease in creases)


@dataclass(frozen=True)
class Seated:
    """What was chosen, and what for."""

    frame: Frame
    placing: Proposals


def seated(
    surface: Surface,
    boundary: BoundaryCondition,
    settings: SingularitySettings,
    pattern: PatternSettings | None,
    sizes: int | None,
    progress: Progress = no_progress,
) -> Seated:
    """Where singularities are to stand, on the surface with its openings filled. pattern, sizes: None for the
    default. Raises RequestError."""
    surface = fill_openings(surface)
    frame = frame_of(surface, boundary, settings, pattern, sizes)
    progress(0.3, "placing singularities")
    return Seated(frame, chosen(surface, frame, settings))


def _ends(surface: Surface, boundary: BoundaryCondition, lattice: Lattice) -> tuple[tuple[End, ...], Floats]:
    """What each loop is, and (n,) the angles of those that are not free."""
    target = np.full(len(surface.vertices), np.pi)
    ends: list[End] = []
    for i, (loop, angles) in enumerate(zip(surface.loops, asked_angles(surface, boundary), strict=True)):
        if angles is None:
            ends.append("free")
        elif (angles == np.pi).all():
            ends.append("straight")
        else:
            curvature = float((np.pi - angles).sum())
            nearest = round(curvature / lattice.quantum) * lattice.quantum
            if abs(curvature - nearest) > NEARLY:
                raise NotAdaptedError(
                    f"The angles listed on loop {i} make it turn by {curvature:.6f} rad; with singularities "
                    f"that must be a multiple of the quantum, {lattice.quantum:.6f} rad; the nearest is "
                    f"{nearest:.6f}."
                )
            target[loop] = angles + (curvature - nearest) / len(loop)
            ends.append("angles")
    return tuple(ends), target


def _width(
    surface: Surface, lattice: Lattice, pattern: PatternSettings, angle: float, tube: ConformalMap | None
) -> float:
    """Of a cell: the shortest translation of the lattice, model units."""
    if pattern.edge_length is not None:
        edge = pattern.edge_length
        cells = float(vertex_areas(surface).sum()) / (lattice.cell_area * (edge / lattice.edge) ** 2)
        if cells > pattern.max_cells:  # before singularities are moved over so many
            raise too_many(surface, pattern, cells)
    elif tube is not None:
        on_surface, in_domain = face_areas(tube)  # as many cells as without singularities
        edge = wanted_edge(tube, lattice, pattern, angle) * float(np.sqrt(on_surface.sum() / in_domain.sum()))
    else:
        area = float(vertex_areas(surface).sum())
        if pattern.around is None:
            edge = float(np.sqrt(area * lattice.edge**2 / (DEFAULT_ON_NETS * lattice.cell_area)))
        else:
            rims = [surface.vertices[np.append(loop, loop[0])] for loop in surface.loops]
            lengths = [float(np.linalg.norm(np.diff(rim, axis=0), axis=1).sum()) for rim in rims]
            girth = max(lengths, default=float(np.sqrt(np.pi * area)))
            edge = girth / (pattern.around * width_per_cell(lattice, angle))
    return edge * abs(complex(lattice.position(lattice.basis[0]))) / lattice.edge


def _line(lattice: Lattice, angle: float, boundary: str) -> Line:
    e1 = complex(lattice.position(lattice.basis[0]))
    along = complex(lattice.position(lattice.steps[0])) * np.exp(-1j * angle)
    step = complex(lattice.position(lattice.shortest_towards(along))) / e1
    rows = rows_along(lattice, angle, boundary)
    return Line(step, rows.first / abs(e1), rows.period / abs(e1))


def chosen(surface: Surface, frame: Frame, settings: SingularitySettings) -> Proposals:
    """Where singularities are to stand. Raises SingularitiesError."""
    if settings.at:
        return Proposals((given(surface, frame.rules, settings.at),), 0)
    count: int | Literal["auto"] = "auto" if settings.count is None else settings.count
    placing = place(surface, frame.rules, count, frame.tube)
    return replace(placing, may_be_none=settings.count == "auto")


def closed_map(
    surface: Surface,
    frame: Frame,
    placing: Proposals,
    boundary: BoundaryCondition,
    progress: Progress = no_progress,
) -> ConformalMap:
    """The map with the singularities that were chosen, moved until the pattern closes up, or, where they
    have to be and that fails, where they are. Without any: the map for the boundary alone; with more loops
    than two, all free, that of the curvatures that were chosen for these. Raises ConvergenceError."""
    proposal = placing.proposal
    if surface.openings:
        return cut_openings(closed_map(fill_openings(surface), frame, placing, boundary, progress), surface)
    if not proposal.count:
        if len(surface.loops) > 2 and set(frame.rules.ends) == {"free"}:
            return map_of_curvatures(surface, frame.rules.quantum * np.array(proposal.loops), progress)
        return conformal_map(surface, boundary, progress)
    if is_cones(surface, proposal, frame.lattice.quantum):
        return _at_cones(surface, frame, placing, progress)
    work = Work(WORK)
    try:
        return first_that_closes(surface, frame, placing, progress, work)
    except ConvergenceError as error:
        if placing.proposals[0].count:  # these are given, or it cannot be without
            return unmoved(frame, work.seats or Seats.of(surface, frame, proposal), progress)
        plain = conformal_map(surface, boundary, progress)
        note = f"{in_words(frame.lattice.kind, proposal.index).capitalize()} would pay, but are left out: "
        return replace(plain, notes=(*plain.notes, note + error.detail))


def first_that_closes(
    surface: Surface, frame: Frame, placing: Proposals, progress: Progress, work: Work
) -> ConformalMap:
    """With other singularities, if those chosen do not close. Raises ConvergenceError, that of the first."""
    failed: ConvergenceError | None = None
    for chosen in (placing.chosen, *placing.others[:OTHERS]):
        taken = replace(placing, chosen=chosen)
        if failed is not None and work.left <= 0:
            raise failed
        try:
            chart, found = closed_at(surface, frame, taken.proposal, progress, work)
        except ConvergenceError as error:
            failed = failed or error
            continue
        cmap = as_map(frame, chart, found, taken, surface)
        return replace(cmap, notes=(*cmap.notes, *_changes(frame, placing, chosen)))
    assert failed is not None
    raise failed


def _at_cones(surface: Surface, frame: Frame, placing: Proposals, progress: Progress) -> ConformalMap:
    """With the singularities that the surface has already: moved, each would be two. Cells are of a size near
    the one wanted that divides what lies between them, or bent where there is none."""
    try:
        chart, found = closed_at(surface, frame, placing.proposal, progress, Work(WORK), stays=True)
    except ConvergenceError:
        why = "no size of the cells near the one wanted divides what lies between them"
        return unmoved(frame, Seats.of(surface, frame, placing.proposal), progress, why)
    return as_map(frame, chart, found, placing, surface)


def unmoved(
    frame: Frame,
    seats: Seats,
    progress: Progress,
    why: str = "they cannot be moved on this mesh until the pattern closes around each",
) -> ConformalMap:
    """The map with the singularities at vertices, for which the pattern is bent until it closes. Triangles
    may be flipped, so that there always is one. Raises ConvergenceError where doubles do not suffice."""
    surface, rules, cones = (
        seats.surface,
        frame.rules,
        Cones.at(seats.vertex, seats.index, frame.lattice.quantum),
    )
    angles = extended(rules.angles, surface)
    wanted = targets(
        surface, rules.ends, seats.loops, cones.quantum, cones.vertex, cones.index, angles=angles
    )
    found = map_to(surface, wanted, cones, None, progress)
    note = (
        f"{in_words(frame.lattice.kind, cones.index).capitalize()}: {why}, so that the pattern is bent "
        "beside them; smaller cells are bent less."
    )
    return replace(on_area(found), notes=(*found.notes, note))


def _changes(frame: Frame, placing: Proposals, chosen: int) -> Iterator[str]:
    best, kind = placing.proposal, frame.lattice.kind
    if chosen != placing.chosen:
        yield (
            f"{in_words(kind, best.index).capitalize()}, which would leave about {best.uncovered:.1%} "
            f"uncovered instead of {placing.proposals[chosen].uncovered:.1%}, cannot be moved so that it "
            "closes."
        )


@dataclass(frozen=True)
class Seats:
    """Singularities on a mesh that is fine beside them. vertex, index: (s,). loops: curvatures in quanta."""

    surface: Surface
    vertex: Ints
    index: Ints
    loops: tuple[int, ...]

    @classmethod
    def of(cls, surface: Surface, frame: Frame, proposal: Proposal) -> Seats:
        vertex, index = _ordered(proposal)
        finer = refined(surface, surface.vertices[vertex], frame.width)
        return cls(finer, vertex, index, proposal.loops)


@dataclass
class Work:
    """left: vertices of the meshes on which closing may still be tried. seats: those so far from which the
    longest move that would close is shortest, and off: that move, cells."""

    left: float
    seats: Seats | None = None
    off: float = np.inf


def closed_at(
    surface: Surface,
    frame: Frame,
    proposal: Proposal,
    progress: Progress,
    work: Work,
    *,
    stays: bool = False,
) -> tuple[Chart, Closed]:
    """Seated anew at the nearest vertices where the first moves would be too long, or the mesh does not allow
    them. stays: they must not move; the size of the cells may change the more, where none is asked for."""
    failed: ConvergenceError | None = None
    seats = Seats.of(surface, frame, proposal)
    finer, vertex, index = seats.surface, seats.vertex, seats.index
    slope = partial(_slope, surface, frame.tube) if frame.tube is not None else None
    quantum, ends, angles = frame.lattice.quantum, frame.rules.ends, frame.rules.angles
    chart: Chart | None = None
    share = max(1.0, len(index) / USUAL)
    scale = AT_CONES if stays and frame.any_size else frame.free_scale
    for again in range(AGAIN + 1):
        try:
            chart = None if chart is None or finer is not chart.surface else chart.reseated(vertex)
            chart = chart or Chart(
                finer, vertex, index, proposal.loops, ends, quantum, frame.width, slope, angles
            )
            closing = Closing(chart, frame.width, frame.line, scale, frame.aligned)
        except ConvergenceError as error:
            work.left -= HARD * share * len(finer.vertices)
            raise failed or error from None
        finer = chart.surface
        work.left -= share * len(finer.vertices)
        off = float(np.linalg.norm(closing.moves, axis=1).max())
        if stays and off > STAYS:
            raise ConvergenceError("Cells of this size do not fit between the corners of the surface.")
        if off < work.off:
            work.off, work.seats = off, Seats(finer, vertex, index, proposal.loops)
        last = again == AGAIN or work.left <= 0
        if last or off <= FAR:
            try:
                return chart, closing.solve(progress)
            except ConvergenceError as error:
                failed = failed or error
                work.left -= HARD * share * len(finer.vertices)
                if last or work.left <= 0:
                    break
                finer = refined(finer, closing.places, frame.width)
        nearest = _nearest_inside(finer, closing.places)
        if len({*nearest.tolist()} - {*finer.boundary.tolist()}) < len(nearest) or (nearest == vertex).all():
            if failed is None:
                return chart, closing.solve(progress)
            break
        vertex = nearest
    assert failed is not None
    raise failed


def is_cones(surface: Surface, proposal: Proposal, quantum: float) -> bool:
    """Whether the singularities are the cones that the surface has already, all of them."""
    points, index = cone_points(surface, quantum)
    order = np.argsort(proposal.vertex)
    return np.array_equal(proposal.vertex[order], points) and np.array_equal(proposal.index[order], index)


def _slope(before: Surface, tube: Tube, surface: Surface) -> Floats:
    """(m, 3) squared sine of the half-edges' angles to the horizontal in the tube that ``before`` is as it
    has more vertices now: they come last."""
    seen = before.tree.nearest(surface.vertices[len(before.vertices) :])
    corner = tube.place[before.faces[seen.face]]
    corner -= np.rint((corner - corner[:, :1]).real)
    place = np.concatenate([tube.place, (seen.barycentric * corner).sum(axis=1)])[surface.faces]
    edge = np.roll(place, -1, axis=1) - place
    edge -= np.rint(edge.real)
    return np.asarray((edge.imag / np.abs(edge)) ** 2)


def _ordered(proposal: Proposal) -> tuple[Ints, Ints]:
    """Vertices and indices; first, where the cut begins, one with |k| = 1 if there is any."""
    order = np.argsort(np.abs(proposal.index), kind="stable")
    return proposal.vertex[order], proposal.index[order]


def _nearest_inside(surface: Surface, places: Floats) -> Ints:
    """(k,) vertices nearest to places on the surface."""
    seen = surface.tree.nearest(places)
    corner = surface.faces[seen.face, np.argmax(seen.barycentric, axis=1)]
    return np.asarray(corner)


def as_map(frame: Frame, chart: Chart, found: Closed, placing: Proposals, before: Surface) -> ConformalMap:
    seen, quantum = found.unstretched, frame.lattice.quantum
    surface = seen.surface
    sums = chart.energy.angle_sums(seen.metric)
    curvature = np.concatenate(
        [np.rint([(np.pi - sums[loop]).sum() / quantum for loop in surface.loops]), chart.index]
    )
    layout = lay_out(surface, seen.lengths, seen.metric, curvature * quantum, chart.cones)
    net = layout.domain
    assert isinstance(net, Net)
    stretched, closing_error = None, layout.closing_error
    if found.stretch:
        other = lay_out(surface, found.seen.lengths, found.seen.metric, curvature * quantum, chart.cones)
        assert isinstance(other.domain, Net)
        stretched, closing_error = other.domain, max(closing_error, other.closing_error)
    here, there = found.factor * found.seen.place[:, 0] + found.shift, (stretched or net).corners[0]
    factor = complex((here[1] - here[0]) / (there[1] - there[0]))
    wanted = before.vertices[_ordered(placing.proposal)[0]]
    moved = np.linalg.norm(surface.vertices[chart.cones] - wanted, axis=1)
    return ConformalMap(
        surface=surface,
        log_scale=seen.u,
        domain=net,
        boundary_angles=tuple(sums[loop] for loop in surface.loops),
        iterations=found.steps,
        residual=seen.residual,
        inserted=0,
        closing_error=closing_error,
        cones=Cones(chart.cones, chart.index, quantum, moved),
        fitted=Fitted(frame.lattice.order, factor, complex(here[0] - factor * there[0]), stretched),
        notes=tuple(_notes(frame, found, placing)),
    )


#: What polygons are called, by their sides.
NAMES = {
    3: "triangle",
    4: "quadrilateral",
    5: "pentagon",
    6: "hexagon",
    7: "heptagon",
    8: "octagon",
    10: "decagon",
}


def in_words(kind: Kind, index: Ints) -> str:
    """Such as "2 pentagons and 1 heptagon"."""
    lattice, parts = LATTICES[kind], []
    for k in (1, -1, 2, -2):
        number, left = int((index == k).sum()), _parts_left(lattice, k)
        if not number:
            continue
        if lattice.sides_at_centre:
            name = NAMES.get(left, f"{left}-gon") + ("s" if number > 1 else "")
        else:
            name = f"{'vertex' if number == 1 else 'vertices'} of {left} {kind}s"
        parts.append(f"{number} {name}")
    if not parts:
        return "no singularities"
    return ", ".join(parts[:-1]) + (" and " if len(parts) > 1 else "") + parts[-1]


def _notes(frame: Frame, found: Closed, placing: Proposals) -> Iterator[str]:
    proposal, kind = placing.proposal, frame.lattice.kind
    yield (
        f"{in_words(kind, proposal.index)}: moved by at most {found.moves.max():.2f} cells, so that the "
        f"pattern closes around each to {found.residual:.0e} cells."
    )
    none = placing.proposals[0]
    if len(placing.proposals) > 1 and none.count == 0:
        yield (
            f"In {frame.rules.sizes} sizes about {proposal.uncovered:.1%} is left uncovered, "
            f"without singularities about {none.uncovered:.1%} (linear model)."
        )
    if placing.symmetry:
        yield f"They stand symmetrically but for these moves; the surface has {placing.symmetry}."
    lines = [f"loop {i}" for i, on in enumerate(frame.aligned) if on]
    if lines:
        yield (
            f"Lattice lines lie on {' and '.join(lines)}; with free ends (boundary.mode isometric) and "
            "trimmed cells less is left open."
        )
    if found.stretch:
        yield f"A uniform stretch by {abs(found.stretch):.2%} along the height makes both ends lattice lines."
