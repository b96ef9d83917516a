"""Placement on nets in general: scale, rotation and offset are free as far as the motions leave them so.

A similarity W = A·z + B turns a motion z ↦ ρz + t into W ↦ ρW + (A t + (1 − ρ) B). On the lattice ρ must be a
power of ζ and the translation one of the tiling. They are rounded jointly (``joint``), so that the motions
still fulfil what ties them together (``motions``), and so that the domain changes least. That change is made
up for by the least deformation (``deform``), which is reported as distortion; nothing is left over where the
singularities were moved beforehand until all motions are exact. Where a uniform stretch was needed for that,
the lattice lies on the chart of the stretched surface, whose faces are the domain's, and the stretch is the
distortion.

Loops that are polygons of quantized corners, as the frames of doors and windows, or closed straight lines,
may be asked to lie on lattice lines (``polygons``). The place of the lattice is chosen so that they are near
to some, and the same deformation brings them there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Complexes, Ints
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.errors import PatternError
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.place.deform import System, deform, distortion_of
from hexwrap_solver.pattern.place.glued import Glued, around_vertices
from hexwrap_solver.pattern.place.joint import Joint
from hexwrap_solver.pattern.place.motions import Holonomy, holonomy_of, pin_cones
from hexwrap_solver.pattern.place.placement import (
    BEARABLE,
    NEARLY,
    Placement,
    anchor_vertex,
    cost_of,
    edge_angle,
)
from hexwrap_solver.pattern.place.polygons import Alignment, Polygons
from hexwrap_solver.pattern.place.size import cells_around, size_spread
from hexwrap_solver.pattern.place.target import Target
from hexwrap_solver.pattern.types import PatternSettings

#: Sizes and directions tried, from one end of what is admissible to the other.
SCALES, DIRECTIONS = 41, 24
#: Where the lattice is free to move, this many offsets along either basis vector.
OFFSETS = 12
#: Cost of a size off the wanted one by its whole spread, beside the misfit in lattice units: the root of the
#: energy of the deformation.
COST_OF_SIZE = 0.1
#: Sizes and directions for which the motions are rounded not only nearly best.
SHORTLIST = 12
#: Misfit of all motions together, in lattice units, below which nothing needs to be deformed.
EXACT = 1e-7
#: Places of the lattice, the best first, whose deformation is computed, until one distorts by less than FINE;
#: fewer around singularities on a mesh of more than LARGE vertices.
DEFORMED, FINE, AROUND, LARGE = 4, 0.05, 2, 12_000


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
    cost = cost_of(aligned.distortion, BEARABLE)
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
    motions = holonomy_of(cmap, lattice, net)
    target = Target.of(cmap, lattice, settings)
    factor, phase = target.factor, target.phase(settings, lattice.edge)
    if alignment is not None:
        factor = abs(factor) * alignment.unit / abs(alignment.unit)
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
        pin_cones(cmap, lattice, rows, corner, normal, depth)
        if misfit > EXACT:
            system = system or System(cmap, glued, normal)  # rotations and lines are the same for all
            place, distortion = deform(system, glued, A, place, depth)
        else:
            pinned = normal.any(axis=1)
            place[pinned] = depth[pinned, 0] + 1j * depth[pinned, 1]
            distortion = 0.0 if net is cmap.net else distortion_of(cmap, glued, place)
        tried.append((distortion, glued, rows, place, A))
        if distortion < FINE:
            break
    distortion, glued, rows, place, A = min(tried, key=lambda one: one[0])
    around = cells_around(cmap, None, abs(A), target.width)
    return Placement(place, glued, rows, target.angle, around, distortion, notes=())


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
    motions = holonomy_of(cmap, lattice, net)
    rows = np.zeros((len(motions.turn), 4), dtype=np.int64)
    rows[:, 0] = motions.turn
    wanted = A * motions.translation + B * (1 - lattice.roots_of_unity[motions.turn])
    rows[:, 1:3] = lattice.translations_near(wanted)
    off = abs(lattice.position(rows[:, 1:3]) - wanted)
    return (net, (0.0, A, B, rows)) if off.max() < NEARLY else None


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
    joint = Joint.of(cmap, lattice, motions, [] if alignment is None else alignment.along())
    found = []
    for family, (x, energy) in enumerate(joint.near(A)):
        best = np.argsort(np.sqrt(energy) + COST_OF_SIZE * off, kind="stable")[:SHORTLIST]
        for i in best.tolist():
            x, least = joint.nearest(family, complex(A[i]))
            rows, misfit = joint.rows(x), float(np.sqrt(least))
            shifts = _shifts(cmap, lattice, motions, rows, complex(A[i]), phase, alignment is not None)
            odd = (
                np.zeros(len(shifts))
                if alignment is None
                else alignment.misfit(np.full(len(shifts), A[i]), shifts)
            )
            at = int(np.argmin(odd))
            cost = misfit + float(odd[at]) + COST_OF_SIZE * off[i]
            found.append((cost, misfit + float(odd[at]), complex(A[i]), complex(shifts[at]), rows))
    if not found:
        raise PatternError(
            "No place of the lattice suits all singularities: one of them would not stand at the centre of a "
            "cell; move it, or take indices of 1 and -1."
        )
    found.sort(key=lambda one: one[0])
    few = len(cmap.cones) > 0 and len(cmap.surface.vertices) > LARGE
    return [one[1:] for one in found[: AROUND if few else DEFORMED]]


def _shifts(
    cmap: ConformalMap,
    lattice: Lattice,
    motions: Holonomy,
    rows: Ints,
    A: complex,
    phase: complex,
    aligned: bool,
) -> Complexes:
    """(k,) where the origin may stand: where motions that turn want it, else anywhere for polygons to be
    aligned, else where the anchor gets its phase."""
    turning = np.flatnonzero(motions.turn)
    if len(turning):
        off = lattice.position(rows[turning, 1:3]) - A * motions.translation[turning]
        turn = 1 - lattice.roots_of_unity[motions.turn[turning]]
        return np.array([(turn.conj() * off).sum() / (abs(turn) ** 2).sum()])
    anchor = int(np.flatnonzero(cmap.surface.faces.ravel() == anchor_vertex(cmap))[0])
    at = A * complex(cmap.corners().ravel()[anchor])
    return (_cell(lattice) if aligned else np.array([phase])) - at


def _cell(lattice: Lattice) -> Complexes:
    """(k,) places of the origin spread over all that differ."""
    share = np.arange(OFFSETS) / OFFSETS
    e1, e2 = lattice.position(lattice.basis)
    return np.asarray((e1 * share[:, None] + e2 * share).ravel())
