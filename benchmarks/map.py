"""Time and memory of the conformal map against its floor.

    python benchmarks/map.py [--vertices 2000 20000 200000] [--route plain flips nets meshes]

The floor is (Newton steps) × (one sparse Cholesky factorisation + two triangular solves) on the same matrix.
It is measured with the solver's own factorisation and, where installed (``pip install cvxopt pypardiso``),
with CHOLMOD (cvxopt) and MKL PARDISO, analysis not counted. Newton steps are those of Newton's method with
a factorisation in each step. Beside it stands what a solver takes for a new mesh: analysis and first
factorisation. ``flips`` is the robust route on the same towers, ``nets`` a tower slit open
along its height (a disk), and one with 24 windows cut out, beside the whole one, isometric. ``meshes`` the
whole map of those meshes of
the torture table that need it, each beside a tower of equal size. Times are processor seconds of one thread,
the best of a few runs.
"""

from __future__ import annotations

import argparse
import os

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal import boundary, conformal_map
from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.fixed import minimise
from hexwrap_solver.conformal.robust import solve_with_flips
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.linalg.factor import Factorisation
from hexwrap_solver.surface import surface_from_mesh, with_openings
from hexwrap_solver.surface.types import SentMesh, Surface

sys.path.insert(0, str(Path(__file__).parents[1]))  # for tests.*, where this runs as a script

from tests.solver.conformal.shared import MESHES, load
from tests.solver.conformal.torture import TORTURE

ROUTES = ["plain", "flips", "nets", "meshes"]


def tower(n: int) -> SentMesh:
    """About n vertices on a doubly curved tower of no symmetry; rows of unequal height, random diagonals."""
    random = np.random.default_rng(0)
    around, rows = round(np.sqrt(2.0 * n)), round(np.sqrt(n / 2.0))
    i, j = (x.ravel() for x in np.meshgrid(np.arange(around), np.arange(rows + 1)))
    inside = (j > 0) & (j < rows)
    phi = 2 * np.pi * (i + 0.25 * random.uniform(-1, 1, len(i))) / around
    s = (j + 0.25 * inside * random.uniform(-1, 1, len(i))) / rows
    r = 1.0 + 0.6 * s**2 + 0.15 * np.cos(3 * phi + 2 * s) + 0.2 * np.sin(4 * s) * np.cos(phi)
    place = [r * np.cos(phi) + 0.3 * s, r * np.sin(phi), 2.5 * s + 0.1 * np.sin(2 * phi)]
    i, j = (x.ravel() for x in np.meshgrid(np.arange(around), np.arange(rows)))
    a, b = j * around + i, j * around + (i + 1) % around
    c, d = b + around, a + around
    flip = random.random(len(a)) < 0.5
    first = np.where(flip, np.stack([a, b, d]), np.stack([a, b, c]))
    second = np.where(flip, np.stack([b, c, d]), np.stack([a, c, d]))
    return SentMesh(
        np.stack(place, axis=1), Ragged.from_table(np.concatenate([first, second], axis=1).T.copy())
    )


def without(sent: SentMesh, left_out: Callable[[Any, Any], Any]) -> Surface:
    """The tower without the faces for which that holds, of places (k, 3) around and along it, from 0 to 1."""
    corners = sent.faces.values.reshape(-1, 3)
    around = round(np.sqrt(2.0 * len(sent.vertices)))
    place = [np.mod(corners, around) / around, corners // around / (corners.max() // around)]
    faces = corners[~left_out(*place)]
    used, faces = np.unique(faces, return_inverse=True)
    return surface_from_mesh(SentMesh(sent.vertices[used], Ragged.from_table(faces.reshape(-1, 3))))


def slit(sent: SentMesh) -> Surface:
    return without(sent, lambda around, along: np.ptp(around, axis=1) > 0.5)


def windows(sent: SentMesh) -> Surface:
    """Eight around in three storeys."""

    def inside(around: Any, along: Any) -> Any:
        inner = (
            (8 * around % 1 < 0.35) & (abs(4 * along - np.rint(4 * along)) < 0.2) & (abs(along - 0.5) < 0.3)
        )
        return inner.all(axis=1)

    return with_openings(without(sent, inside), "cut")


def best(run: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    """Least processor time in seconds, and the result."""
    least, result = np.inf, None
    for _ in range(repeats):
        start = time.process_time()
        result = run()
        least = min(least, time.process_time() - start)
    return least, result


def newton_steps(energy: Energy) -> int:
    """Steps of Newton's method with a fresh Hessian in each, down to the residual of ``minimise``."""
    goal = max(2 * minimise(energy).residual, 1e-12)
    factorisation = Factorisation(energy.points, energy.rows, energy.columns)
    x, steps = np.zeros(energy.n_dof), 0
    while True:
        corners = energy.corners(energy.scale_of(x))
        gradient = energy.gradient(corners)
        if np.abs(gradient).max() <= goal or steps == 20:
            return steps
        factorisation.factorise(*energy.hessian(corners))
        x -= factorisation.solve(gradient)
        steps += 1


def floors(energy: Energy, repeats: int) -> dict[str, tuple[float, float]]:
    """Per solver, seconds of one factorisation with two triangular solves (one solution), and of analysis
    with a first factorisation."""
    diagonal, off_diagonal = energy.hessian(energy.corners(np.zeros(energy.n)))
    right = np.random.default_rng(0).standard_normal(energy.n_dof)
    times = {}
    for name, measure in (("own", _own), ("CHOLMOD", _cholmod), ("PARDISO", _pardiso)):
        try:
            analyse, factorise, solve = measure(energy, diagonal, off_diagonal, right)
        except ImportError:
            print(f"  ({name} is not installed)", file=sys.stderr)
            continue
        analysis, _ = best(analyse, repeats)
        again, _ = best(factorise, repeats)
        times[name] = again + best(solve, repeats)[0], analysis + again
    return times


#: Analysis, factorisation with new values, one solution.
Steps = tuple[Callable[[], Any], Callable[[], Any], Callable[[], Any]]


def _own(energy: Energy, diagonal: Any, off_diagonal: Any, right: Any) -> Steps:
    def analyse() -> Factorisation:
        return Factorisation(energy.points, energy.rows, energy.columns)

    own = analyse()
    return analyse, lambda: own.factorise(diagonal, off_diagonal), lambda: own.solve(right)


def _cholmod(energy: Energy, diagonal: Any, off_diagonal: Any, right: Any) -> Steps:
    from cvxopt import cholmod, matrix, spmatrix

    n = energy.n_dof
    rows = np.concatenate([np.arange(n), energy.rows])
    columns = np.concatenate([np.arange(n), energy.columns])
    lower = spmatrix(np.concatenate([diagonal, off_diagonal]), rows, columns, (n, n))
    symbolic = cholmod.symbolic(lower)
    b = matrix(right)
    return (
        lambda: cholmod.symbolic(lower),
        lambda: cholmod.numeric(lower, symbolic),
        lambda: cholmod.solve(symbolic, b),
    )


def _pardiso(energy: Energy, diagonal: Any, off_diagonal: Any, right: Any) -> Steps:
    from pypardiso import PyPardisoSolver

    n = energy.n_dof
    upper = sparse.coo_matrix((off_diagonal, (energy.columns, energy.rows)), shape=(n, n))
    matrix = (upper + sparse.diags(diagonal)).tocsr()
    solver = PyPardisoSolver(mtype=2)

    def phase(number: int) -> None:
        solver.set_phase(number)
        solver._call_pardiso(matrix, right)

    phase(11)
    return lambda: phase(11), lambda: phase(22), lambda: phase(33)


def plain(n: int, repeats: int) -> float:
    """Prints one size; returns the map's seconds."""
    sent = tower(n)
    intake, surface = best(lambda: surface_from_mesh(sent), repeats)
    mapping, found = best(lambda: conformal_map(surface, BoundaryCondition()), repeats)
    energy = Energy(surface, boundary.straight(surface))
    steps = newton_steps(energy)
    print(
        f"{len(surface.vertices):>9,} vertices: intake {intake:.3f} s, map {mapping:.3f} s, "
        f"{steps} Newton steps, residual {found.residual:.1e}, peak {peak_gigabytes():.2f} GB"
    )
    for name, (seconds, first) in floors(energy, repeats).items():
        floor = steps * seconds
        print(
            f"{'':>20} floor with {name:<8} {floor:.3f} s: map {mapping / floor:.2f} ×, "
            f"intake to layout {(intake + mapping) / floor:.2f} ×; analysis and first {first:.3f} s"
        )
    return mapping


def flips(n: int, repeats: int) -> None:
    """The robust route beside the plain one, on the same mesh."""
    surface = surface_from_mesh(tower(n))
    ordinary, _ = best(lambda: conformal_map(surface, BoundaryCondition()), repeats)
    robust, found = best(lambda: solve_with_flips(surface, boundary.straight(surface)), repeats)
    print(
        f"{len(surface.vertices):>9,} vertices: with flips {robust:.3f} s, {found.flips} flips, "
        f"{robust / ordinary:.2f} × the plain route"
    )


def nets(n: int, repeats: int) -> None:
    """Other surfaces beside the tower that they were cut out of, in turn, isometric."""
    sent, seconds = tower(n), dict[str, list[float]]()
    surfaces = {"tower": surface_from_mesh(sent), "disk": slit(sent), "windows": windows(sent)}
    for _ in range(repeats):
        for name, surface in surfaces.items():
            took, _ = best(lambda s=surface: conformal_map(s, BoundaryCondition("isometric")), 1)
            seconds.setdefault(name, []).append(took)
    for name in ("disk", "windows"):
        ratio = np.median(np.divide(seconds[name], seconds["tower"]))
        took = np.median(seconds[name])
        print(f"{n:>9,} vertices: {name}, isometric, {took:.3f} s, {ratio:.2f} × the tower")


def hard_meshes(repeats: int) -> None:
    """Meshes that need flips, beside towers of as many vertices that need none."""
    generated = {name: make(np.random.default_rng(0)) for name, make in TORTURE.items()}
    for name, surface in {**{name: load(path) for name, path in MESHES.items()}, **generated}.items():
        seconds, found = best(lambda s=surface: conformal_map(s, BoundaryCondition()), repeats)
        if not found.flips:
            continue
        n = len(surface.vertices)
        smooth = surface_from_mesh(tower(n))
        ordinary, _ = best(lambda s=smooth: conformal_map(s, BoundaryCondition()), repeats)
        print(
            f"{n:>9,} vertices: {name} {seconds:.3f} s, {found.flips} flips, {found.inserted} inserted, "
            f"{seconds / ordinary:.2f} × a smooth tower"
        )


def peak_gigabytes() -> float:
    """Peak memory of this process so far."""
    try:
        import resource
    except ImportError:  # Windows
        return float("nan")
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--vertices", type=int, nargs="+", default=[2_000, 20_000, 200_000])
    parser.add_argument("--route", nargs="+", choices=ROUTES, default=ROUTES)
    parser.add_argument("--repeats", type=int, default=3)
    args = parser.parse_args()
    if "plain" in args.route:
        seconds = [plain(n, args.repeats) for n in args.vertices]
        for k in range(1, len(seconds)):
            n, m = args.vertices[k - 1 : k + 1]
            exponent = np.log(seconds[k] / seconds[k - 1]) / np.log(m / n)
            print(f"time grows with exponent {exponent:.2f} from {n:,} to {m:,} vertices")
    if "flips" in args.route:
        for n in args.vertices:
            flips(n, args.repeats)
    if "nets" in args.route:
        for n in args.vertices:
            nets(n, args.repeats)
    if "meshes" in args.route:
        hard_meshes(args.repeats)


if __name__ == "__main__":
    main()
