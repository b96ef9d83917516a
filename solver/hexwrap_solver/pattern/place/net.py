"""Placement on nets in general: scale, rotation and offset are free as far as the motions leave them so.

A similarity W = A·z + B turns a motion z ↦ ρz + t into W ↦ ρW + (A t + (1 − ρ) B). On the lattice ρ must be a
power of ζ and the translation one of the tiling, so that each is rounded to the nearest one. Two kinds of
equations tie the motions together: around a vertex inside, their product is the identity; around a
singularity of index k it is the rotation by −k quanta about its place, which must be a centre of that
symmetry. What rounding leaves over is made up for by the least deformation (``deform``), which is reported as
distortion; nothing is left over where the singularities were moved beforehand until all motions are exact.
Where a uniform stretch was needed for that, the lattice lies on the chart of the stretched surface, whose
faces are the domain's, and the stretch is the distortion.

Loops that are polygons of quantized corners, as the frames of doors and windows, or closed straight lines,
may be asked to lie on lattice lines (``polygons``). The place of the lattice is chosen so that they are near
to some, and the same deformation brings them there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap, Deck, Unrolled
from hexwrap_solver.errors import NotAdaptedError, PatternError
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.place.cone import boundary_direction
from hexwrap_solver.pattern.place.deform import System, deform, distortion_of
from hexwrap_solver.pattern.place.glued import Glued, around_vertices
from hexwrap_solver.pattern.place.placement import (
    BEARABLE,
    NEARLY,
    PARTS,
    Placement,
    anchor_vertex,
    edge_angle,
    quantum_name,
)
from hexwrap_solver.pattern.place.polygons import Alignment, Polygons
from hexwrap_solver.pattern.place.size import girth, size_spread, wanted_edge, width_per_cell
from hexwrap_solver.pattern.types import PatternSettings

#: Sizes and directions tried, from one end of what is admissible to the other.
SCALES, DIRECTIONS = 41, 24
#: Where the lattice is free to move, so many offsets along either basis vector.
OFFSETS = 12
#: Cost of a size off the wanted one by its whole spread, beside the misfit in lattice units.
COST_OF_SIZE = 0.1
#: Misfit of all motions together, in lattice units, below which nothing needs to be deformed.
EXACT = 1e-7
#: Places of the lattice, the best first, whose deformation is computed, until one distorts by less than FINE.
DEFORMED, FINE = 4, 0.05


@dataclass(frozen=True)
class Holonomy:
    """The motions that generate the holonomy of a net, and what they must fulfil.

    turn: (t,) rotations in quanta. mate: (t,) the inverse of each. words: per singularity, then per vertex
    at which three or more pieces of the cut meet, the motions met on the way around it. centre: (c,) place of
    each singularity in the coordinates where its word starts; index: (c,).
    """

    turn: Ints
    mate: Ints
    translation: Complexes
    words: list[Ints]
    centre: Complexes
    index: Ints


def place_on_net(
    cmap: ConformalMap, lattice: Lattice, settings: PatternSettings, loops: list[int] | None = None
) -> Placement:
    """loops: polygons that are to lie on lattice lines, which they do where that is bearable.

    Raises NotAdaptedError where a motion turns by no multiple of the quantum, PatternError where no place
    of the lattice suits all singularities."""
    polygons = Polygons.of(cmap, lattice, loops or [])
    if not polygons.n:
        return _placed(cmap, lattice, settings, None)
    angle = edge_angle(lattice, settings)
    aligned = _placed(cmap, lattice, settings, Alignment.of(polygons, lattice, angle, settings.boundary))
    if aligned.distortion <= BEARABLE:
        return aligned
    names = " and ".join(f"loop {loop}" for loop in polygons.loops)
    cost = f"distort cells by {aligned.distortion:.2f}, more than {BEARABLE:g}"
    if not np.isfinite(aligned.distortion):
        cost = "fold the layout over"
    sentence = f"To align {names} at this size would {cost}: smaller cells, or corners elsewhere, fit better."
    ends = [loop for loop in polygons.loops if loop < 2]
    if ends and len(ends) < len(polygons.loops):
        fewer = place_on_net(cmap, lattice, settings, ends)
    else:
        fewer = _placed(cmap, lattice, settings, None)
    return replace(fewer, notes=(sentence, *fewer.notes))


def _placed(
    cmap: ConformalMap, lattice: Lattice, settings: PatternSettings, alignment: Alignment | None
) -> Placement:
    net, faces = cmap.net, cmap.surface.faces
    fitted = _on_fitted(cmap, lattice)
    motions = _motions(cmap, lattice, net)
    angle = edge_angle(lattice, settings)
    scale = lattice.edge / wanted_edge(cmap, lattice, settings, angle)
    along = boundary_direction(cmap, lattice, anchor_vertex(cmap))
    factor = complex(scale * np.exp(-1j * angle) * lattice.forward / along)
    factor *= scale / abs(factor)
    if alignment is not None:
        factor = scale * alignment.unit / abs(alignment.unit)
    phase = _phase(lattice, settings, angle)
    rows = np.zeros((len(net.angle), 4), dtype=np.int64)
    if alignment is None and not len(motions.words) and not np.any(net.crossing):
        own = _home(cmap)
        place = factor * (own - own[anchor_vertex(cmap)]) + phase
        return _placement(cmap, lattice, settings, rows, place, factor, angle, 0.0)
    tried, system = [], None
    if fitted is None:
        choices = _choices(cmap, lattice, settings, motions, factor, phase, alignment)
    else:
        net, choices = fitted[0], [fitted[1]]
    for misfit, A, B, rows in choices:
        glued_rows, corner = around_vertices(lattice, net, cmap.surface.twin, rows, faces)
        place = A * net.corners.ravel()[corner] + B
        glued = Glued(lattice, glued_rows)
        normal = np.zeros((len(place), 2), dtype=complex)
        depth = np.zeros((len(place), 2))
        if alignment is not None:
            normal, depth = alignment.lines(rows, glued_rows, place, faces)
        _pin(cmap, lattice, rows, corner, normal, depth)
        if misfit > EXACT:
            system = system or System(cmap, glued, normal)  # rotations and lines are the same for all
            place = deform(system, glued, A, place, depth)
            distortion = distortion_of(cmap, glued, place)
        else:
            pinned = normal.any(axis=1)
            place[pinned] = depth[pinned, 0] + 1j * depth[pinned, 1]
            distortion = 0.0 if net is cmap.net else distortion_of(cmap, glued, place)
        tried.append((distortion, glued, rows, place, A))
        if distortion < FINE:
            break
    distortion, glued, rows, place, A = min(tried, key=lambda one: one[0])
    found = _placement(cmap, lattice, settings, rows, place, A, angle, distortion)
    return replace(found, glued=glued)


def as_sheet(cmap: ConformalMap) -> ConformalMap:
    """A net that is glued nowhere (a disk) as the sheet that it is: g is the identity. Others as they are."""
    if np.any(cmap.net.crossing):
        return cmap
    sheet = np.zeros(cmap.surface.faces.shape, dtype=np.int64)
    return replace(cmap, domain=Unrolled(_home(cmap), sheet, Deck(0.0, 0j), girth(cmap)))


def _home(cmap: ConformalMap) -> Complexes:
    """(n,) places of the vertices, where nothing is glued by more than the identity."""
    place = np.zeros(len(cmap.surface.vertices), dtype=complex)
    place[cmap.surface.faces.ravel()] = cmap.corners().ravel()
    return place


def _placement(
    cmap: ConformalMap,
    lattice: Lattice,
    settings: PatternSettings,
    rows: Ints,
    place: Complexes,
    scale: complex,
    angle: float,
    distortion: float,
) -> Placement:
    around = round(girth(cmap) * abs(scale) / (width_per_cell(lattice, angle) * lattice.edge))
    none = np.zeros((*cmap.surface.faces.shape, 4), dtype=np.int64)
    return Placement(
        place=place,
        glued=Glued(lattice, none),
        isometries=rows,
        rotation=angle,
        around=max(around, 1),
        distortion=distortion,
        notes=(),
    )


def _phase(lattice: Lattice, settings: PatternSettings, angle: float) -> complex:
    width = width_per_cell(lattice, angle) * lattice.edge
    return lattice.without_translations(complex(width * settings.phase[0], lattice.edge * settings.phase[1]))


def _on_fitted(
    cmap: ConformalMap, lattice: Lattice
) -> tuple[Net, tuple[float, complex, complex, Ints]] | None:
    """The chart for which singularities were moved, and (0, A, B, rows) of the lattice there; None where they
    were not, or for another lattice."""
    fitted = cmap.fitted
    if fitted is None or fitted.order != lattice.order:
        return None
    net = cmap.net if fitted.chart is None else fitted.chart
    e1 = complex(lattice.position(lattice.basis[0]))
    A, B = e1 * fitted.factor, e1 * fitted.shift + complex(lattice.position(np.array(lattice.centre)))
    rows, misfit = _rounded(lattice, _motions(cmap, lattice, net), np.array([A]), np.array([B]))
    return (net, (0.0, A, B, rows[0])) if misfit[0] < NEARLY else None


def _motions(cmap: ConformalMap, lattice: Lattice, net: Net) -> Holonomy:
    faces, twin = cmap.surface.faces, cmap.surface.twin
    steps, own = net.angle / lattice.step_angle, lattice.order // lattice.fold
    used = np.unique(net.crossing)
    off = abs(steps - own * np.rint(steps / own)) * lattice.step_angle
    if (off[used] > NEARLY).any():
        worst = int(used[np.argmax(off[used])])
        part = PARTS[lattice.fold]
        raise NotAdaptedError(
            f"A loop or singularity turns the domain by {net.angle[worst]:.8f} rad, but a {lattice.kind} "
            f"pattern closes up only where that is a multiple of {part}: choose boundary angles or "
            f"singularities that add up to one, or boundary.quantum {quantum_name(lattice)}.",
            data={"cone_angle": float(net.angle[worst]), "quantum": lattice.quantum},
        )
    turn = np.rint(steps).astype(np.int64) % lattice.order
    starts = np.full(len(cmap.surface.vertices), len(twin), dtype=np.int64)
    corners = faces.ravel()
    np.minimum.at(starts, corners, np.arange(len(corners)))
    glued = (net.crossing.ravel() > 0) & (twin >= 0)
    meeting = np.bincount(corners[glued], minlength=len(starts))
    on_boundary = np.zeros(len(starts), dtype=bool)
    on_boundary[corners[twin < 0]] = True
    branching = np.flatnonzero((meeting > 2) & ~on_boundary)
    branching = branching[~np.isin(branching, cmap.cones.vertex)]
    words = [_word(net, twin, int(starts[v])) for v in [*cmap.cones.vertex.tolist(), *branching.tolist()]]
    centre = net.corners.ravel()[starts[cmap.cones.vertex]]
    return Holonomy(turn, net.inverse, net.translation, words, centre, cmap.cones.index)


def _word(net: Net, twin: Ints, corner: int) -> Ints:
    """The motions met around a vertex inside, counter-clockwise from one of its corners."""
    found, at = [], corner
    while True:
        at = at - at % 3 + (at + 2) % 3  # the half-edge that comes to the vertex
        if net.crossing.ravel()[at]:
            found.append(int(net.crossing.ravel()[at]))
        at = int(twin[at])
        if at == corner:
            return np.array(found, dtype=np.int64)


def _choices(
    cmap: ConformalMap,
    lattice: Lattice,
    settings: PatternSettings,
    motions: Holonomy,
    factor: complex,
    phase: complex,
    alignment: Alignment | None,
) -> list[tuple[float, complex, complex, Ints]]:
    """(misfit, A, B, rows) of the places of the lattice that fit best, the best first."""
    free = not len(cmap.surface.loops)
    size = np.linspace(-1, 1, SCALES)
    turn = lattice.quantum * np.arange(DIRECTIONS) / DIRECTIONS if free else np.zeros(1)
    A = (factor * (1 + size_spread(settings) * size)[:, None] * np.exp(1j * turn)).ravel()
    off = np.repeat(abs(size), len(turn))
    centres, shift = _centres(cmap, motions, phase)
    if alignment is not None and not len(motions.centre) and not motions.turn.any():
        shift = _cell(lattice)  # free to choose
    A, at, off = (x.ravel() for x in np.broadcast_arrays(A, centres[:, None], off))
    A, B, off = (x.ravel() for x in np.broadcast_arrays(A, shift[:, None] - A * at, off))
    along = None if alignment is None else alignment.rows_of(len(motions.turn))
    rows, misfit = _rounded(lattice, motions, A, B, along)
    if alignment is not None:
        misfit = misfit + alignment.misfit(A, B)
    cost = misfit + COST_OF_SIZE * off
    best = np.argsort(cost, kind="stable")[:DEFORMED]
    best = best[np.isfinite(cost[best])]
    if not len(best):
        raise PatternError(
            "No place of the lattice suits all singularities: one of them would not stand at the centre of a "
            "cell; move it, or take indices of 1 and -1."
        )
    return [(float(misfit[i]), complex(A[i]), complex(B[i]), rows[i]) for i in best]


def _cell(lattice: Lattice) -> Complexes:
    """(k,) places of the origin spread over all that differ."""
    share = np.arange(OFFSETS) / OFFSETS
    e1, e2 = lattice.position(lattice.basis)
    return np.asarray((e1 * share[:, None] + e2 * share).ravel())


def _centres(cmap: ConformalMap, motions: Holonomy, phase: complex) -> tuple[Complexes, Complexes]:
    """Places that may become the origin of the lattice, and where it is shifted to: singularities, else the
    fixed points of motions that turn, which are exact then, else the anchor."""
    if len(motions.centre):
        return motions.centre, np.zeros(1, dtype=complex)
    zeta = np.exp(1j * cmap.net.angle)
    turning = np.flatnonzero(motions.turn)
    if len(turning):
        fixed = motions.translation[turning] / (1 - zeta[turning])
        return np.asarray(fixed), np.zeros(1, dtype=complex)
    anchor = np.flatnonzero(cmap.surface.faces.ravel() == anchor_vertex(cmap))[0]
    return cmap.corners().ravel()[[anchor]], np.array([phase])


def _rounded(
    lattice: Lattice, motions: Holonomy, A: Complexes, B: Complexes, along: Ints | None = None
) -> tuple[Ints, Floats]:
    """For k places of the lattice at once: rows (k, t, 4) of isometries for all motions, and (k,) how far the
    worst is from its own translation, lattice units; infinite where a singularity would stand at no centre.

    along: (t, 2) of which translations must be multiples, 0 where they need not."""
    zeta = np.exp(1j * lattice.step_angle * motions.turn)
    wanted = A[:, None] * motions.translation + B[:, None] * (1 - zeta)
    rows = np.zeros((*wanted.shape, 4), dtype=np.int64)
    rows[..., 0] = motions.turn
    known = np.zeros(len(zeta), dtype=bool)
    known[0] = True
    cones = len(motions.centre)
    goal = np.zeros((len(A), len(motions.words), 4), dtype=np.int64)
    for c, (z, k) in enumerate(zip(motions.centre, motions.index.tolist(), strict=True)):
        goal[:, c] = _about_centre(lattice, k, A * z + B)

    def product(word: Ints) -> Ints:
        total = np.zeros((len(A), 4), dtype=np.int64)
        for i in word.tolist():
            total = lattice.compose(total, rows[:, i])
        return total

    def enter(i: int, row: Ints) -> None:
        rows[:, i], rows[:, motions.mate[i]] = row, lattice.invert(row)
        known[[i, motions.mate[i]]] = True

    while not known.all():
        # What is the last unknown of a word follows from the others; else the next one is rounded.
        last = [(w, word) for w, word in enumerate(motions.words) if np.count_nonzero(~known[word]) == 1]
        if last:
            w, word = last[0]
            at = int(np.flatnonzero(~known[word])[0])
            before, after = product(word[:at]), product(word[at + 1 :])
            inner = lattice.compose(lattice.invert(before), goal[:, w])
            enter(int(word[at]), lattice.compose(inner, lattice.invert(after)))
        else:
            i = int(np.flatnonzero(~known)[0])
            turn = np.full((len(A), 1), motions.turn[i])
            nearest = lattice.translations_near(wanted[:, i])
            if along is not None and along[i].any():
                row = along[i]
                step = complex(lattice.position(row))
                many = np.rint((wanted[:, i] / step).real).astype(np.int64)
                nearest = np.where(many == 0, np.sign((wanted[:, i] / step).real), many)[:, None] * row
                nearest = nearest.astype(np.int64)
            enter(i, np.concatenate([turn, nearest, 0 * turn], axis=1))
    misfit = abs(lattice.position(rows[..., 1:3]) - wanted).max(axis=1)
    for w, word in enumerate(motions.words):
        found = product(word)
        right = (
            lattice.is_centre(fixed_point(lattice, found)) if w < cones else (found == goal[:, w]).all(axis=1)
        )
        misfit[~right] = np.inf
    return rows, np.asarray(misfit)


def _about_centre(lattice: Lattice, k: int, wanted: Complexes) -> Ints:
    """(…, 4) rotations by −k quanta, as going around a cone amounts to, about the centres nearest to the
    wanted places."""
    offset = np.array(lattice.centre)
    centre = lattice.translations_near(wanted - lattice.position(offset)) + offset
    rows = np.zeros((*centre.shape[:-1], 4), dtype=np.int64)
    rows[..., 0] = -k % lattice.order
    rows[..., 1:3] = centre - lattice.rotate(centre, -k)
    return rows


def fixed_point(lattice: Lattice, rotation: Ints) -> Complexes:
    """(…,) of rotations (…, 4)."""
    zeta = np.exp(1j * lattice.step_angle * rotation[..., 0])
    return np.asarray(lattice.position(rotation[..., 1:3]) / (1 - zeta))


def _pin(
    cmap: ConformalMap, lattice: Lattice, rows: Ints, corner: Ints, normal: Complexes, depth: Floats
) -> None:
    """Singularities stand exactly at the fixed points of the motions around them."""
    for v in cmap.cones.vertex.tolist():
        word = _word(cmap.net, cmap.surface.twin, int(corner[v]))
        centre = complex(fixed_point(lattice, lattice.partial_products(rows[word])[-1]))
        normal[v] = 1.0, 1j
        depth[v] = centre.real, centre.imag
