"""A conformal map for every surface of genus 0: flips where the triangulation needs them, new vertices
where a straight triangle cannot follow the map."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Progress, no_progress
from hexwrap_solver.conformal.boundary import curvatures
from hexwrap_solver.conformal.cut import cut_open
from hexwrap_solver.conformal.energy import Energy, corner_angles, opposite_lengths, total
from hexwrap_solver.conformal.layout import lay_out, normalise
from hexwrap_solver.conformal.orientation import inverted, layout_errors, positively_oriented
from hexwrap_solver.conformal.robust.delaunay import make_delaunay
from hexwrap_solver.conformal.robust.descent import ACCEPTED, Descent, FlipEnergy, descend
from hexwrap_solver.conformal.robust.develop import develop
from hexwrap_solver.conformal.robust.flip_sequence import FlipSequence
from hexwrap_solver.conformal.robust.metric import Metric, angle_sums, measure
from hexwrap_solver.conformal.robust.mirror import MirrorMesh, half_edge_names, mirror_mesh
from hexwrap_solver.conformal.robust.overlay import Overlay, insert
from hexwrap_solver.conformal.robust.refine import (
    Problem,
    collapsing,
    shells,
    split_edges,
    split_places,
    spread,
)
from hexwrap_solver.conformal.robust.straight import straighten
from hexwrap_solver.conformal.span import (
    MAX_SPAN,
    check_reach,
    check_span,
    cone_angle_of,
    failure,
    is_annulus,
    largest_span,
)
from hexwrap_solver.conformal.types import Cones, ConformalMap, Deck, Targets, Unrolled
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.surface.types import Surface
from hexwrap_solver.tolerances import TINY

#: Rounds of refinement; meshes seen so far need up to a handful.
MAX_ROUNDS = 40
#: From round PATIENCE on, while at most FEW triangles still turn over, the mesh gets shells around their
#: vertices every SHELLS rounds: few triangles mean a cascade around single vertices, which would make edges
#: as short as rounding within a dozen rounds.
PATIENCE, FEW, SHELLS = 6, 30, 2
#: Refinement does not end if it makes more than MOST times the vertices and MOST_MORE.
MOST, MOST_MORE = 2, 4000
#: ``spread`` is left out where it makes more than this many times the vertices, since that often makes the
#: mesh worse; it is tried only if no map is found otherwise.
SPREAD_MOST = 1.5
#: How exact prescribed boundary angles are, radians.
PROMISED = 1e-9
REFINED = "The mesh was refined:"


def solve_with_flips(
    surface: Surface,
    targets: Targets,
    progress: Progress = no_progress,
    start: Floats | None = None,
    cones: Cones | None = None,
) -> ConformalMap:
    """The discretely conformal map that every surface of genus 0 has if its triangulation may change.

    Newton's method runs on the intrinsic Delaunay triangulation of the surface glued to its mirror image (see
    ``mirror``, ``delaunay``, ``descent``); a closed surface needs no mirror. The vertices keep the places it
    gives them, and the original triangles are drawn straight between these. Where one would turn over, its
    longest edge is split: on annuli at first without solving again (see ``overlay``); where that does not
    suffice, with the new vertices as unknowns. ``surface`` of the result is then the refined mesh.
    start: (n,) u to start from. cones: whose angles the targets hold.
    Sources: Gu, Luo, Sun, Wu 2018 (existence); Springborn 2020; Gillespie, Springborn, Crane 2021 (flips).
    Raises ConvergenceError where double precision does not suffice.
    """
    cones = Cones.none() if cones is None else cones
    problem = problem_of(surface, targets, start)
    omitted: list[int] = []
    try:
        return _refined(surface, problem, cones, progress, SPREAD_MOST, omitted)
    except ConvergenceError:
        if not omitted:
            raise
        return _refined(surface, problem, cones, progress, np.inf, [])


def _refined(
    surface: Surface, problem: Problem, cones: Cones, progress: Progress, most: float, omitted: list[int]
) -> ConformalMap:
    """The map of a problem on ``surface``, refined as often as need be. Rounds whose ``spread`` would make
    more than ``most`` times the vertices go without, and into ``omitted``."""
    iterations, fewest, span = 0, len(surface.faces), np.inf
    unrolled = is_annulus(surface, cones)
    for attempt in range(MAX_ROUNDS):
        problem, cut = uncollapsed(problem, unrolled)
        flat = flatten(problem, cut, cones, progress, span)
        iterations += flat.descent.iterations
        if unrolled:
            found, lift, first = draw(problem, flat)
            u, wrong = found.log_scale, np.flatnonzero(inverted(found))
            if not len(wrong):
                _check_drawn(found, flat.off)
                return _with_notes(_in_one_piece(found, first), surface, iterations)
            if attempt == 0:
                refined = _inserted(problem, flat, found, lift, first)
                if refined is not None:
                    return _with_notes(refined, surface, iterations)
        else:
            u, _ = _centred(flat.descent, problem.targets)
            net, wrong = _draw_net(problem, flat, cones)
            if net is not None:
                _check_drawn(net, flat.off)
                return _with_notes(net, surface, iterations)
        problem = replace(problem, u=u)
        before = len(problem.surface.vertices)
        if attempt >= PATIENCE and attempt % SHELLS == 0 and len(wrong) <= FEW:
            problem = split_edges(problem, *shells(problem.surface, wrong, len(surface.vertices)))
        if len(problem.surface.vertices) == before:
            problem = split_edges(problem, *split_places(problem.surface, problem.targets, wrong, attempt))
        if len(wrong) >= fewest:
            wide = spread(problem, before)
            if len(wide.surface.vertices) <= most * len(problem.surface.vertices):
                problem = wide
            else:
                omitted.append(attempt)
        fewest = min(fewest, len(wrong))
        span = min(span, float(np.ptp(u)))
        if len(problem.surface.vertices) > MOST * len(surface.vertices) + MOST_MORE:
            break
    inserted = len(problem.surface.vertices) - len(surface.vertices)
    raise failure(
        span,
        flat.cone_angle,
        f"After {attempt + 1} rounds of refinement with {inserted} new vertices {len(wrong)} triangles still "
        "turn over in the domain",
        "around the named vertices the mesh does not suit the boundary angles; remesh it more evenly and "
        "finer there, or ask for angles nearer to 180°",
        _sent(surface, problem.parent[wrong]),
    )


def _inserted(
    problem: Problem, flat: Flat, found: ConformalMap, lift: Ints, first: Ints
) -> ConformalMap | None:
    """The map that was found, with new vertices where it puts them, until no triangle turns over; None where
    that does not succeed."""
    try:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            overlay = Overlay(found, flat.log_length, flat.winding, flat.descent.u, lift)
            refined = insert(overlay, problem.targets)
        if refined is None:
            return None
        drawn, start = refined.map, first[refined.parent] + refined.start
        _check_drawn(drawn, flat.off)
    except ConvergenceError:
        return None
    return _in_one_piece(drawn, start)


def _in_one_piece(found: ConformalMap, first: Ints) -> ConformalMap:
    """The same map with its faces laid out side by side, but for one cut, if corners are near enough to the
    origin there to keep their digits. first: (m,) where the first corner of each face then stands."""
    whole = found.with_domain(sheet=found.sheet + first[:, None])
    if inverted(whole).any():
        return found
    before, after = layout_errors(found), layout_errors(whole)
    least = PROMISED / 100
    exact = after.angle <= max(least, before.angle) and after.turn <= max(least, before.turn)
    return whole if exact else found


@dataclass(frozen=True)
class FlatMetric:
    """A flat metric that has not been drawn. surface: the one it belongs to, with vertices inserted where
    triangles could have had no room. u: (n,) logarithmic factors. sums: (n,) angle sums. targets: of
    that surface."""

    surface: Surface
    u: Floats
    sums: Floats
    targets: Targets


def metric_with_flips(
    surface: Surface,
    targets: Targets,
    progress: Progress = no_progress,
    start: Floats | None = None,
    cones: Cones | None = None,
) -> FlatMetric:
    """The metric of ``solve_with_flips``, whether or not straight triangles can be drawn in it."""
    cones = Cones.none() if cones is None else cones
    problem, cut = uncollapsed(problem_of(surface, targets, start), is_annulus(surface, cones))
    flat = flatten(problem, cut, cones, progress)
    return FlatMetric(problem.surface, flat.descent.u, flat.sums, problem.targets)


def problem_of(surface: Surface, targets: Targets, start: Floats | None) -> Problem:
    u = np.zeros(len(surface.vertices)) if start is None else start
    return Problem(surface, targets, u, np.arange(len(surface.faces)))


def winding_of(sheet: Ints) -> Ints:
    """(m, 3) how often the side from each corner to the next goes around the annulus (see
    ``MirrorMesh.winding``). sheet: (m, 3) see ``Cut``."""
    return np.asarray(np.roll(sheet, -1, axis=1) - sheet)


def annulus_sheets(surface: Surface) -> Ints:
    """(m, 3) sheet of every corner of an annulus: 1 to the left of the cut, 0 elsewhere."""
    fan = cut_open(surface, np.zeros(0, dtype=np.int64)).fan
    return np.where(fan > 0, 1, 0).reshape(-1, 3)


def uncollapsed(problem: Problem, unrolled: bool) -> tuple[Problem, Ints]:
    """Splits what has no room in the domain, until there is nothing of the kind. Also gives the sheets of an
    annulus. In other nets every edge between two vertices of one side counts, so more are split than
    need be."""
    while True:
        surface = problem.surface
        sheet = annulus_sheets(surface) if unrolled else np.zeros(surface.faces.shape, dtype=np.int64)
        marked = collapsing(surface, problem.targets, winding_of(sheet).ravel())
        if not len(marked):
            return problem, sheet
        problem = split_edges(problem, marked, np.full(len(marked), 0.5))


@dataclass(frozen=True)
class Flat:
    """A flat Delaunay metric on the mirrored surface.

    cut: (m, 3) sheets of an annulus. unit: logarithm of the length in which the metric is measured.
    log_length: (3m,) of the surface's half-edges in it.
    curvature: (b + c,) of loops and cones. sums: (n,) angle sums. flips: all of them. off: how far
    prescribed boundary angles are missed."""

    mesh: MirrorMesh
    cut: Ints
    log_length: Floats
    unit: float
    curvature: Floats
    descent: Descent
    sums: Floats
    flips: int
    off: float

    @property
    def winding(self) -> Ints:
        return winding_of(self.cut)

    @property
    def cone_angle(self) -> float | None:
        """K of an annulus without cones."""
        return float(self.curvature[0]) if len(self.curvature) == 2 else None


def flatten(
    problem: Problem, cut: Ints, cones: Cones, progress: Progress, known_span: float = np.inf
) -> Flat:
    """The metric with the problem's angle sums. Raises ConvergenceError.

    cut: (m, 3) sheets of an annulus. known_span: the least span of u that came out of the rounds of
    refinement so far; later ones may have run away.
    """
    surface, targets = problem.surface, problem.targets
    free = bool((targets.shared == 0).any() and len(targets.shared_angle) == 1)  # the cone angle comes out
    log_length = np.log(opposite_lengths(surface.vertices, surface.faces))[[2, 0, 1]].T.ravel()
    unit = float(np.median(log_length))  # logarithms near 0 have the most digits behind the point
    mesh = mirror_mesh(surface, log_length - unit, winding_of(cut).ravel())
    flips = make_delaunay(mesh, np.zeros(mesh.n), euclidean=True)
    known = curvatures(targets, targets.angle, surface, cones)
    span = MAX_SPAN if free else largest_span(cone_angle_of(surface, known))
    descent = descend(FlipEnergy(Energy(surface, targets), mesh, span), problem.u, progress)
    sums = angle_sums(mesh, descent.metric)
    curvature = curvatures(targets, sums, surface, cones)
    angle = cone_angle_of(surface, curvature)
    check_span(descent.u, angle)
    off = _off(targets, sums, surface)
    if not (descent.residual <= ACCEPTED and off <= PROMISED):
        raise failure(
            min(known_span, float(np.ptp(descent.u))),
            angle,
            f"Newton's method with flips ended after {descent.iterations} steps with angle sums still "
            f"{descent.residual:.1e} rad off",
            "double precision cannot hold the map of this surface; remesh it more evenly",
            [],
        )
    return Flat(mesh, cut, log_length - unit, unit, curvature, descent, sums, flips + descent.flips, off)


def _draw_net(problem: Problem, flat: Flat, cones: Cones) -> tuple[ConformalMap | None, Ints]:
    """The map of the vertices with the triangles as they are, and none; or None, and (k,) the triangles that
    turn over in it."""
    surface, descent = problem.surface, flat.descent
    mesh, flips = mirror_mesh(surface, flat.log_length, flat.winding.ravel()), FlipSequence()
    make_delaunay(mesh, np.zeros(mesh.n), euclidean=True, do=flips.flip)
    u, _ = _centred(descent, problem.targets)
    make_delaunay(mesh, u, do=flips.flip)
    side = flips.undo(mesh, measure(mesh, u))[half_edge_names(surface)].reshape(-1, 3)
    turned = ~positively_oriented(np.stack([0 * side[:, 0], side[:, 0], side[:, 0] + side[:, 1]], axis=1))
    if turned.any():
        return None, np.flatnonzero(turned)
    lengths = np.ascontiguousarray(np.abs(side).T[[1, 2, 0]]) * np.exp(flat.unit)
    corners = corner_angles(lengths)
    expected = 2 * np.pi - np.bincount(cones.vertex, cones.curvature, len(u))
    expected[surface.boundary] = flat.sums[surface.boundary]
    drawn = total(surface.faces.T.ravel(), corners.angle.ravel(), len(u))
    wound = (np.abs(drawn - expected) > np.pi)[surface.faces].any(axis=1)
    if wound.any():
        return None, np.flatnonzero(wound)
    # Vectors are good to roundings of their triangle's longest one.
    rounding = (abs(side).max(axis=1)[:, None] / np.maximum(abs(side), TINY)).ravel()
    layout = lay_out(surface, lengths, corners, flat.curvature, cones.vertex, rounding)
    found = ConformalMap(
        surface=surface,
        log_scale=u,
        domain=layout.domain,
        boundary_angles=tuple(flat.sums[loop] for loop in surface.loops),
        iterations=descent.iterations,
        residual=descent.residual,
        flips=flat.flips,
        closing_error=layout.closing_error,
        cones=cones,
    )
    wrong = np.flatnonzero(inverted(found))
    return (None if len(wrong) else found), wrong


def draw(problem: Problem, flat: Flat) -> tuple[ConformalMap, Ints, Ints]:
    """The map of the vertices, with the triangles as they are, whether they turn over or not; the lift of its
    ``Development``; and (m,) where the first corner of each face stands if all are laid out side by side."""
    surface, targets, descent, sums = problem.surface, problem.targets, flat.descent, flat.sums
    u, metric = _centred(descent, targets)
    angle = float(flat.curvature[0])
    check_reach(u, angle)
    foot = int(surface.loops[0][0])
    laid = develop(flat.mesh, metric, angle)
    sheet = flat.cut - laid.lift[surface.faces]
    first = sheet[:, 0].copy()
    sheet -= first[:, None]  # every face beside the copy of its first corner, near which its digits are
    unit = np.exp(flat.unit)
    deck = Deck(angle, laid.translation * unit)
    uv, deck, circumference = normalise(surface, laid.uv * unit, sheet, deck, foot)
    uv = straighten(surface, targets, uv, sheet, deck)
    found = ConformalMap(
        surface=surface,
        log_scale=u,
        domain=Unrolled(uv, sheet, deck, circumference),
        boundary_angles=tuple(sums[loop] for loop in surface.loops),
        iterations=descent.iterations,
        residual=descent.residual,
        flips=flat.flips,
        closing_error=laid.gap,
    )
    return found, laid.lift, first


def _off(targets: Targets, sums: Floats, surface: Surface) -> float:
    """How far prescribed boundary angles are missed, radians."""
    listed = surface.boundary[targets.shared[surface.boundary] < 0]
    return float(np.abs(sums - targets.angle)[listed].max(initial=0.0))


def _centred(descent: Descent, targets: Targets) -> tuple[Floats, Metric]:
    """u and its metric, shifted to the middle of the doubles where u has a free constant."""
    if (targets.shared == 0).any():
        return descent.u, descent.metric
    middle = float(descent.u.min() + descent.u.max()) / 2
    return descent.u - middle, replace(descent.metric, length=descent.metric.length - middle)


def _check_drawn(found: ConformalMap, off: float) -> None:
    """Raises ConvergenceError where boundary angles, as drawn, are not as exact as promised: small residuals
    add up along the way through a domain of very large and very small parts. off: as in ``Flat``."""
    drawn = layout_errors(found)
    error = np.maximum(drawn.angle + off, drawn.turn)
    if not error <= PROMISED:  # nor if it is NaN
        raise failure(
            float(np.ptp(found.log_scale)),
            None if found.kind == "net" else found.deck.angle,
            f"Boundary angles of the map as drawn would be {error:.1e} rad off",
            "double precision cannot hold the map of this surface; remesh it more evenly",
            [],
        )


def _with_notes(found: ConformalMap, surface: Surface, iterations: int) -> ConformalMap:
    """The result with what was done to the triangulation."""
    notes = []
    if found.flips:
        notes.append(
            f"{found.flips} edge flips: the map is discretely conformal on an intrinsic Delaunay "
            "triangulation of the surface instead of the mesh's own."
        )
    noted = replace(found, iterations=iterations, notes=tuple(notes))
    return with_inserted(noted, len(found.surface.vertices) - len(surface.vertices))


def with_inserted(found: ConformalMap, count: int) -> ConformalMap:
    """The same map, noting ``count`` more inserted vertices."""
    if not count:
        return found
    total = found.inserted + count
    notes = tuple(note for note in found.notes if not note.startswith(REFINED))
    sentence = (
        f"{REFINED} {total} vertices were inserted on its edges, where triangles would have turned over or "
        "collapsed in the domain."
    )
    return replace(found, inserted=total, notes=(*notes, sentence))


def _sent(surface: Surface, faces: Ints) -> list[int]:
    """The sent vertices of some faces."""
    sent = surface.input_vertex[np.unique(surface.faces[faces])]
    return [int(v) for v in sent if v >= 0]
