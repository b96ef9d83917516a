"""Rounding all motions of a net jointly to motions of a lattice, with the least change of the domain.

What rounding changes is measured by the energy of the deformation that it asks for (see ``deform``), in
square lattice units: a quadratic form in the translations of the generators that depends neither on how the
surface was cut nor on numbering, nor on where the origin is. Its least value over all translations that
fulfil the equations between the motions, which are linear over the integers, is a closest vector problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.linalg.integers import NearestIntegers, integer_solutions
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.place.deform import SIZE, System
from hexwrap_solver.pattern.place.glued import Glued, around_vertices
from hexwrap_solver.pattern.place.motions import Holonomy, pin_cones


@dataclass(frozen=True)
class Joint:
    """x: translations of the generators, (2p,) coordinates in the basis of the tiling, each of the
    ``families`` being x = start + steps·z for integers z (their directions reduced). form: (2p, 2p) energy of
    a change of x."""

    lattice: Lattice
    motions: Holonomy
    form: Floats
    families: list[tuple[Ints, Ints, NearestIntegers]]

    @classmethod
    def of(
        cls,
        cmap: ConformalMap,
        lattice: Lattice,
        motions: Holonomy,
        along: Sequence[tuple[Ints, Ints]] = (),
    ) -> Joint:
        """along: motions whose product must be a translation by a multiple of a lattice vector (2,). There is
        no family where not all singularities can stand at centres."""
        form = _form(cmap, lattice, motions)
        families = []
        for start, steps in _families(lattice, motions, along):
            gram = steps.T @ form @ steps
            families.append((start, steps, NearestIntegers(gram)))
        return cls(lattice, motions, form, families)

    def target(self, A: Complexes) -> Floats:
        """(k, 2p) the translations under z ↦ Az, for factors (k,)."""
        e1 = complex(self.lattice.position(self.lattice.basis[0]))
        wanted = A[:, None] * self.motions.translation[self.motions.lead] / e1
        return np.asarray(self.lattice.coordinates(wanted).reshape(len(A), -1))

    def near(self, A: Complexes) -> list[tuple[Ints, Floats]]:
        """Per family, translations (k, 2p) near to those under z ↦ Az, and their energies (k,)."""
        target, found = self.target(A), []
        for start, steps, search in self.families:
            x = start + search.near(self._centres(search, start, steps, target)) @ steps.T
            found.append((x, self._energy(x, target)))
        return found

    def nearest(self, family: int, A: complex) -> tuple[Ints, float]:
        """Those of least energy, (2p,)."""
        target = self.target(np.array([A]))
        start, steps, search = self.families[family]
        z, _ = search.nearest(self._centres(search, start, steps, target)[0])
        x = start + steps @ z
        return x, float(self._energy(x[None], target)[0])

    def _centres(self, search: NearestIntegers, start: Ints, steps: Ints, target: Floats) -> Floats:
        return np.asarray(search.solve(steps.T @ self.form @ (target - start).T).T)

    def _energy(self, x: Ints, target: Floats) -> Floats:
        off = x - target
        return np.asarray(np.maximum(np.einsum("ki,ij,kj->k", off, self.form, off), 0.0))

    def rows(self, x: Ints) -> Ints:
        """(t, 4) isometries of all motions."""
        return _rows(self.lattice, self.motions, x)


def _rows(lattice: Lattice, motions: Holonomy, x: Ints) -> Ints:
    lead = motions.lead
    rows = np.zeros((len(motions.turn), 4), dtype=np.int64)
    rows[:, 0] = motions.turn
    rows[lead, 1:3] = x.reshape(-1, 2) @ lattice.basis
    rows[motions.mate[lead]] = lattice.invert(rows[lead])
    return rows


def _form(cmap: ConformalMap, lattice: Lattice, motions: Holonomy) -> Floats:
    """The least energy of deformations, from the answers to one unit of each generator's translation."""
    lead, n = motions.lead, len(cmap.surface.vertices)
    shifts, fixed, system = [], [], None
    for i in range(len(lead)):
        unit = np.zeros(2 * len(lead), dtype=np.int64)
        unit[2 * i] = 1
        rows = _rows(lattice, motions, unit)
        own, corner = around_vertices(lattice, cmap.net, cmap.surface.twin, rows, cmap.surface.faces)
        glued = Glued(lattice, own)
        normal, depth = np.zeros((n, 2), dtype=complex), np.zeros((n, 2))
        pin_cones(cmap, lattice, rows, corner, normal, depth)
        system = system or System(cmap, glued, normal)  # rotations and pins are the same for all
        shifts.append(system.change.of_shift(glued.shift))
        fixed.append(system.freedom.place_on_lines(depth))
    assert system is not None
    change, place = system.change, np.stack(fixed, axis=1)
    shift = tuple(np.stack(parts, axis=1) for parts in zip(*shifts, strict=True))
    angles, sizes = change.of(place, (shift[0], shift[1]))
    place = place + system.solve(change.area, -angles, -sizes, np.zeros((system.freedom.basis.shape[1], 1)))
    angles, sizes = change.of(place, (shift[0], shift[1]))
    energy = (angles.conj().T * change.area) @ angles + SIZE * (sizes.conj().T * change.area) @ sizes
    parts = np.kron(np.eye(len(lead)), np.array([[1.0, lattice.unit]]))
    form = (parts.conj().T @ energy @ parts).real
    return np.asarray((form + form.T) / 2)


def _families(
    lattice: Lattice, motions: Holonomy, along: Sequence[tuple[Ints, Ints]]
) -> list[tuple[Ints, Ints]]:
    """The translations that fulfil all equations. Moving the origin by a translation v of the tiling changes
    those of motions that turn by (1 − ζ^r)v and nothing else: one of these is kept to a family each of the
    residues modulo 1 − ζ^r, so that what differs by this only counts once."""
    lead = motions.lead
    e1 = complex(lattice.position(lattice.basis[0]))
    offset = lattice.coordinates(np.array([complex(lattice.position(np.array(lattice.centre))) / e1]))[0]
    blocks: list[tuple[Any, Any, Any]] = []  # of x, of further unknowns, right side
    for w, word in enumerate(motions.words):
        part = _of_word(lattice, motions, word)
        if w >= len(motions.index):
            blocks.append((part, np.zeros((2, 0), dtype=np.int64), np.zeros(2)))
            continue
        turning = np.eye(2, dtype=np.int64) - lattice.rotations[-int(motions.index[w]) % lattice.order]
        blocks.append((part, -turning, turning @ offset))
    for word, vector in along:
        step = lattice.coordinates(lattice.position(vector[None]) / e1)[0]
        further = -np.rint(step).astype(np.int64)[:, None]
        blocks.append((_of_word(lattice, motions, word), further, np.zeros(2)))
    turning = np.eye(2, dtype=np.int64) - lattice.rotations[motions.turn[lead]]
    size = np.abs(np.rint(np.linalg.det(turning))).astype(np.int64)
    residues = [np.zeros(2)]
    if size.any():
        least = int(np.argmin(np.where(size > 0, size, 99)))
        part = np.zeros((2, 2 * len(lead)), dtype=np.int64)
        part[:, 2 * least : 2 * least + 2] = np.eye(2)
        blocks.append((part, np.zeros((2, 0), dtype=np.int64), residues[0]))
        residues = _residues(turning[least], int(size[least]))
    if not blocks:
        return [(np.zeros(2 * len(lead), dtype=np.int64), np.eye(2 * len(lead), dtype=np.int64))]
    further = np.cumsum([0, *(more.shape[1] for _, more, _ in blocks)])
    matrix = np.zeros((2 * len(blocks), 2 * len(lead) + further[-1]), dtype=np.int64)
    for i, (part, more, _) in enumerate(blocks):
        matrix[2 * i : 2 * i + 2, : 2 * len(lead)] = part
        matrix[2 * i : 2 * i + 2, 2 * len(lead) + further[i] : 2 * len(lead) + further[i + 1]] = more
    right = np.rint(np.concatenate([r for _, _, r in blocks])).astype(np.int64)
    found = []
    for residue in residues:
        if size.any():
            right[-2:] = residue
        solved = integer_solutions(matrix, right)
        if solved is not None:
            start, steps = (part[: 2 * len(lead)] for part in solved)
            found.append((start, steps[:, steps.any(axis=0)]))
    return found


def _of_word(lattice: Lattice, motions: Holonomy, word: Ints) -> Ints:
    """(2, 2p) the translation of a product of motions, from those of the generators."""
    lead, mate = motions.lead, motions.mate
    total, turned = np.zeros((2, 2 * len(lead)), dtype=np.int64), 0
    for motion in word.tolist():
        forward = motion < mate[motion]
        i = int(np.searchsorted(lead, motion if forward else mate[motion]))
        own = np.eye(2, dtype=np.int64) if forward else -lattice.rotations[motions.turn[motion]]
        total[:, 2 * i : 2 * i + 2] += lattice.rotations[turned % lattice.order] @ own
        turned += int(motions.turn[motion])
    return total


def _residues(matrix: Ints, count: int) -> list[Floats]:
    """One integer vector of each class modulo the columns of the matrix (2, 2), whose determinant is
    ±count."""
    inverse = np.linalg.inv(matrix)
    found: list[Floats] = []
    for a in range(count):
        for b in range(count):
            v = np.array([a, b], dtype=float)
            off = [inverse @ (v - other) for other in found]
            if all(np.abs(x - np.rint(x)).max() > 1e-6 for x in off):
                found.append(v)
    return found
