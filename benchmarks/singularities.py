"""What singularities bring on the samples and on public models: real panels, measured.

    python benchmarks/singularities.py [--write] [SURFACE …]
    python benchmarks/singularities.py --greedy [--write] [SAMPLE …]

Without names the whole table is made. ``--write`` puts the rows that were made into docs/results.md: those
of the surfaces named, the others stay. Public models are looked for in ``../shared/meshes`` and left out
where they are absent.

One row per surface and way to treat its ends: number of singularities, cells, uncovered part of the cells
with 3, 5 and 11 sizes and the gaps at 11, the share of the whole surface that is left open at 11, moves,
what is left of closing, processor seconds.

``--greedy`` compares with greedy placement (Springborn, Schröder and Pinkall 2008, section 5): u is held
constant on the loops and at the cones that there are, the vertex where it is furthest from that constant
becomes the next cone, and so on; what angles the cones have follows. So they are no multiples of 60° and no
lattice closes around them; how many are left after rounding, and the spread of u then, is told as well.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from hexwrap_server import samples
from hexwrap_server.input.requests import SentSurface
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.input.surface_files import sent_surface
from hexwrap_server.jobs.work import take_in
from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.fixed import minimise
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap, Targets
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.panels import measure, rationalize
from hexwrap_solver.panels.polygons import fan_areas
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from hexwrap_solver.singularities.linear import Responses, vertex_areas
from hexwrap_solver.singularities.search import Search, State, curve
from hexwrap_solver.singularities.solve import closed_map, frame_of, seated
from hexwrap_solver.singularities.types import SingularitySettings
from hexwrap_solver.surface import surface_from_mesh, with_openings
from hexwrap_solver.surface.types import FeatureSettings, SentMesh, Surface, SurfaceSettings
from hexwrap_solver.threads import one_blas_thread

sys.path.insert(0, str(Path(__file__).parents[1]))  # for tests.*, where this runs as a script

from tests.solver.singularities import shapes

SAMPLES = ("tower", "waist", "diagrid", "facade", "entrance", "cone", "isometric", "ring")
#: Beside the samples: a tower with a round door, the sample dome, a closed ellipsoid.
OTHERS = ("tower with a door", "dome", "ellipsoid")
MODELS = Path(__file__).parents[2] / "shared" / "meshes"
PUBLIC = (
    "slicer_simple_vase",
    "slicer_wavy_vase",
    "trimesh_reference",
    "compas_tubemesh",
    "bff_teapot_body",
    "conformallab_blownupC",
    "tileable_Igloo",
    "tileable_Arch",
    "tileable_SeaShell",
    "tileable_FreeHoles",
    "phcpf_metro",
    "phcpf_intersection",
    "phcpf_sphere2con_s0",
    "bounding_teapot",
    "libigl_decimated_max",
    "max_noisy",
    "libigl_camelhead",
    "keenan_ogre",
)
SIZES = (3, 5, 11)
#: Numbers of singularities that are compared, and of greedy ones.
MOST, GREEDY_MOST = 6, 16
GREEDY = (
    "sample",
    "spread of u with 0, 1, 2, … singularities",
    "with 0, 1, 2, … greedy cones of any angle",
    "these rounded to 60°: cones left, spread",
)
PAGE = Path(__file__).parent.parent / "docs" / "results.md"
MARKS = ("<!-- {}: made by their benchmark -->", "<!-- end of {} -->")
COLUMNS = (
    "surface",
    "ends",
    "singularities",
    "cells",
    *(f"uncovered, {k} sizes" for k in SIZES),
    "gap at 11, mm",
    "of the surface open at 11",
    "moved, cells",
    "left of closing, cells",
    "placing, closing, processor s",
)
#: Ends and cells at them, and how many singularities at most (None: no search).
WAYS = (
    ("straight, none", "straight", "whole", None),
    ("free", "isometric", "whole", "auto"),
    ("free, trimmed", "isometric", "trim", "auto"),
    ("both aligned", "straight", "whole", "auto"),
)
#: Of surfaces that are no tubes.
FREE = (("free, none", "isometric", "whole", None), *WAYS[1:3])
CLOSED = (("closed", "isometric", "whole", "auto"),)
OF_MODELS = (("free, none", "isometric", "whole", None), WAYS[1])


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="write the rows into docs/results.md")
    parser.add_argument("--greedy", action="store_true", help="compare with greedy placement")
    parser.add_argument("surfaces", nargs="*")
    asked = parser.parse_args()
    kind, columns, made, every = "singularities", COLUMNS, rows, (*SAMPLES, *OTHERS, *PUBLIC)
    if asked.greedy:
        kind, columns, made, every = "greedy cones", GREEDY, against_greedy, SAMPLES[:3]
    head = [line(columns), line(["---"] * len(columns))]
    table: dict[str, list[str]] = {}
    with one_blas_thread():
        for name in asked.surfaces or every:
            table[name] = []
            for row in made(name):
                print(row, flush=True)
                table[name].append(row)
            if asked.write:
                write(kind, head, table, every)


def write(kind: str, head: list[str], table: dict[str, list[str]], every: tuple[str, ...]) -> None:
    """Rows of other surfaces stay as they are."""
    text, (begin, end) = PAGE.read_text(encoding="utf-8"), (mark.format(kind) for mark in MARKS)
    before, rest = text.split(begin)
    old, after = rest.split(end)
    kept: dict[str, list[str]] = {}
    for row in old.strip().splitlines()[2:]:
        kept.setdefault(row.split("|")[1].strip(), []).append(row)
    found = kept | table
    order = [name for name in every if name in found]
    lines = [*head, *(row for name in order for row in found[name])]
    PAGE.write_text("\n".join([f"{before}{begin}", *lines, f"{end}{after}"]), encoding="utf-8")


def surface_of(name: str) -> tuple[Surface, PatternSettings]:
    """The surface of a name, and the pattern that its sample asks for."""
    if name in PUBLIC:
        file = next(MODELS.glob(f"{name}.*"))
        smooth = SurfaceSettings(features=FeatureSettings(angle=None))
        return take_in(sent_surface(file.read_bytes(), file.name, smooth).sent, smooth), PatternSettings()
    if name == "ellipsoid":
        return shapes.ellipsoid(6000, 10.0), PatternSettings()
    asked = parse_request(samples.load("tower" if name == OTHERS[0] else name), 10**7, 10**6)
    assert isinstance(asked.surface, SentSurface)
    surface = take_in(asked.surface, asked.wanted.surface)
    pattern = asked.wanted.pattern or PatternSettings()
    return (with_door(surface) if name == OTHERS[0] else surface), pattern


def with_door(surface: Surface, radius: float = 2.5) -> Surface:
    """A hole of that radius around the vertex nearest to the outermost one in x at a fifth of the height."""
    vertices = surface.vertices
    height = vertices[:, 2].max() / 5
    ring = np.flatnonzero(np.abs(vertices[:, 2] - height) < 1)
    centre = vertices[ring[vertices[ring, 0].argmax()]]
    kept = ~(np.linalg.norm(vertices - centre, axis=1) < radius)[surface.faces].any(axis=1)
    used = np.unique(surface.faces[kept])
    faces = Ragged.from_table(np.searchsorted(used, surface.faces[kept]))
    return with_openings(surface_from_mesh(SentMesh(vertices[used], faces)), "loop")


def against_greedy(name: str) -> Iterator[str]:
    """One row: ends free, spread of u with 0, 1, 2, … singularities, ours and greedily placed."""
    surface, shape = surface_of(name)
    shape = replace(shape, kind="hex", rotation="edge", align="none")
    condition = BoundaryCondition("isometric", quantum="hex")
    rules = frame_of(surface, condition, SingularitySettings(MOST), shape, max(SIZES)).rules
    known = Responses(surface, rules)
    ours = [one.spread for one in curve(Search(known.model(known.seats()), rules), refine=False)]
    free, rounded = [], []
    for cones, angles, spread in greedy(surface):
        free.append(spread)
        k = np.rint((2 * np.pi - angles) / rules.quantum).astype(int)
        cones, k = cones[k != 0], k[k != 0]
        search = Search(known.model(cones), rules)
        state = State.of([(i, int(one)) for i, one in enumerate(k)], (0,) * (len(search.model.free) - 1))
        rounded.append(f"{len(cones)}: {search.proposal(search.with_loops(state)).spread:.3f}")
    yield line([name, spreads(ours), spreads(free), " ".join(rounded)])


def greedy(surface: Surface) -> Iterator[tuple[Ints, Floats, float]]:
    """Cones, their angles and the spread of u, one more each time."""
    n, weight = len(surface.vertices), vertex_areas(surface) / vertex_areas(surface).sum()
    cones = np.zeros(0, dtype=np.int64)
    for _ in range(GREEDY_MOST + 1):
        angle, tie = np.full(n, 2 * np.pi), np.full(n, -1)
        tie[surface.boundary], tie[cones] = 0, 0
        energy = Energy(surface, Targets(angle, tie, np.zeros(1)))
        found = minimise(energy)
        if not found.converged or found.violating:
            break
        u = found.u
        yield cones, energy.angle_sums(found.corners)[cones], float(np.sqrt(weight @ (u - weight @ u) ** 2))
        cones = np.append(cones, np.abs(u).argmax())


def spreads(values: list[float]) -> str:
    return " ".join(f"{value:.3f}" for value in values)


def rows(name: str) -> Iterator[str]:
    """One row per way to treat the ends."""
    if name in PUBLIC and not list(MODELS.glob(f"{name}.*")):
        return
    surface, shape = surface_of(name)
    shape = replace(shape, kind="hex", rotation="edge")
    ways = OF_MODELS if name in PUBLIC else WAYS if len(surface.loops) == 2 else FREE
    for label, mode, cells, count in ways if surface.loops else CLOSED:
        condition = BoundaryCondition("straight" if mode == "straight" else "isometric", quantum="hex")
        pattern = replace(shape, boundary=cells, align="both" if mode == "straight" else "none")
        try:
            start = time.process_time()
            if count is None:
                cmap, took = conformal_map(surface, condition), (0.0, 0.0)
            else:
                seats = seated(surface, condition, SingularitySettings(count), pattern, max(SIZES))
                between = time.process_time()
                cmap = closed_map(surface, seats.frame, seats.placing, condition)
                took = (between - start, time.process_time() - between)
            yield measured(name, label, surface, cmap, lay_pattern(cmap, pattern), took)
        except HexwrapError as error:
            yield line([name, label, error.detail, *[""] * (len(COLUMNS) - 3)])


def measured(
    name: str, label: str, surface: Surface, cmap: ConformalMap, laid: Pattern, took: tuple[float, float]
) -> str:
    cells = [name, label, told(cmap), laid.n_cells]
    left, gap = 0.0, ""
    for sizes in SIZES:
        panels = rationalize(cmap, laid, PanelSettings(target="inscribed", sizes=sizes))
        quality = measure(cmap, laid, panels)
        cells.append(f"{1 - quality.coverage:.2%}")
        assert quality.gap_tangential is not None
        width = 1000 * quality.gap_tangential
        gap = f"{np.nanmean(width):.1f} / {np.nanmax(width):.0f}"
        left = 1 - float(fan_areas(panels.polygons).sum() / vertex_areas(surface).sum())
    width_of_cell = laid.edge_length * np.sqrt(3)
    moved = cmap.cones.moved.max(initial=0.0) / width_of_cell
    closed = re.search(r"closes around each to (\S+) cells", " ".join(cmap.notes))
    ends = [gap, f"{left:.1%}", f"{moved:.2f}", closed[1] if closed else "", f"{took[0]:.1f}, {took[1]:.1f}"]
    return line([*cells, *ends])


def told(cmap: ConformalMap) -> str:
    """Such as −1 −1 +1."""
    return " ".join(f"{k:+d}" for k in sorted(cmap.cones.index.tolist())) or "none"


def line(cells: object) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"  # type: ignore[call-overload]


if __name__ == "__main__":
    main()
