"""The one program, ``hexwrap``: serve, solve, explore, inspect, lift, demo.

Exit status 0; 1 where the surface or the request cannot be solved (the problem's detail on stderr); 2 usage.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import Any

import httpx
import orjson
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from hexwrap_server import __version__, samples
from hexwrap_server.cli.demo import ALL, DemoError, run_demo
from hexwrap_server.cli.explore import WRITERS as FRONT_WRITERS
from hexwrap_server.cli.explore import asked as asked_exploration
from hexwrap_server.cli.explore import check_outputs, explore_here, print_front
from hexwrap_server.cli.inspect import print_content
from hexwrap_server.cli.local import Task, only_map, read_bytes, solve_here, surface_settings, task
from hexwrap_server.cli.options import (
    add_explore_options,
    add_request_options,
    as_options,
    is_option_at_fault,
)
from hexwrap_server.cli.summary import print_summary
from hexwrap_server.errors import FormError, StartError, UsageError
from hexwrap_server.input.curves import READERS, read_drawing, write_curves
from hexwrap_server.input.curves import WRITERS as CURVE_WRITERS
from hexwrap_server.input.finished_map import map_in_result
from hexwrap_server.input.requests import Wanted
from hexwrap_server.jobs.lift_curves import flatten_curves, lift_curves
from hexwrap_server.jobs.worker import Report
from hexwrap_server.output import wire
from hexwrap_server.output.meta import GROUPS
from hexwrap_server.output.text import length
from hexwrap_server.output.writers import WRITERS, Meta, check_wanted, write
from hexwrap_server.settings import Settings, add_arguments
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.pipeline import Solution

#: What an ending stands for where the name of the file says no more.
ENDINGS = {
    ".obj": "panels.obj", ".3dm": "panels.3dm", ".dxf": "panels.dxf", ".csv": "panels.csv",
    ".ifc": "panels.ifc", ".glb": "panels.glb", ".svg": "domain.svg",
    ".png": "panels.png", ".json": "result.json", ".npz": "result.npz",
}  # fmt: skip
INPUT = "a mesh (OBJ, PLY, STL, OFF, NPZ), a Rhino file (3DM), a request (JSON), or sample:NAME"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit status."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # consoles that lack a character show a stand-in
            stream.reconfigure(errors="replace")
    parser = make_parser()
    asked = parser.parse_args(arguments)
    try:
        return int(asked.command(asked))
    except UsageError as error:
        return _refuse(2, str(error))
    except FormError as error:
        status = 2 if is_option_at_fault(asked, [pointer for pointer, _ in error.faults]) else 1
        shown = as_options(asked, error.faults) if error.faults else error
        return _refuse(status, shown.detail, *(f"{place}: {detail}" for place, detail in shown.faults[1:]))
    except HexwrapError as error:
        return _refuse(1, error.detail)
    except KeyboardInterrupt:
        return _refuse(130, "stopped.")


def _refuse(status: int, *sentences: str) -> int:
    for sentence in sentences:
        print(f"hexwrap: {sentence}", file=sys.stderr)
    return status


class Parser(argparse.ArgumentParser):
    """Words that begin like a negative number are values, as in ``--angle -13,-4,0=120``."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self._negative_number_matcher = re.compile(r"-\.?\d")


def make_parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="hexwrap", description="Seamless hexagonal, quad and triangle panels on tube-like surfaces."
    )
    parser.add_argument("--version", action="version", version=f"hexwrap {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    quiet, reading = Parser(add_help=False), Parser(add_help=False)
    quiet.add_argument("-q", "--quiet", action="store_true", help="print nothing but errors")
    reading.add_argument("input", metavar="INPUT", help=INPUT)
    serve = commands.add_parser("serve", help="start the service on this machine")
    add_arguments(serve)
    serve.set_defaults(command=_serve)
    solve = commands.add_parser(
        "solve", help="panelize a surface and write files, without the service", parents=[quiet, reading]
    )
    _add_outputs(solve, f"file to write, any number of times; the ending picks what: {', '.join(kinds())}")
    solve.add_argument(
        "--sheet", type=float, nargs=2, metavar=("WIDTH", "HEIGHT"), help="size of the sheets of flat.dxf"
    )
    solve.add_argument(
        "--group", choices=GROUPS, default="size",
        help="what shares a sheet of flat.dxf: all sizes, a ring, or a side of the building (zone)",
    )  # fmt: skip
    solve.add_argument(
        "--storey", type=float, metavar="HEIGHT", help="height of the storeys of panels.ifc (default: none)"
    )
    add_request_options(solve)
    solve.set_defaults(command=_solve)
    explore = commands.add_parser(
        "explore",
        help="try many choices for a surface and write the front of the best",
        parents=[quiet, reading],
    )
    wanted = "file to write, any number of times: a table (.csv), a picture (.png) or everything (.json)"
    _add_outputs(explore, wanted)
    add_explore_options(explore)
    add_request_options(explore, "surface")
    explore.set_defaults(command=_explore)
    inspect = commands.add_parser("inspect", help="print what a file holds and what would be done with it")
    inspect.add_argument(
        "input", metavar="FILE", help="a mesh (OBJ, PLY, STL, OFF, NPZ) or a Rhino file (3DM)"
    )
    add_request_options(inspect, "surface")
    inspect.set_defaults(command=_inspect)
    lift = commands.add_parser(
        "lift", help="carry own points and curves from the domain onto the surface", parents=[quiet]
    )
    lift.add_argument(
        "input",
        metavar="INPUT",
        help=f"a finished result (JSON, NPZ); or {INPUT}, mapped as the boundary options say",
    )
    lift.add_argument(
        "points", metavar="POINTS", help=f"drawing in the unrolled domain ({', '.join(READERS)})"
    )
    lift.add_argument(
        "-o", "--output", required=True, metavar="OUT", help=f"file to write ({', '.join(CURVE_WRITERS)})"
    )
    lift.add_argument(
        "--flatten", action="store_true", help="the other way: from the surface into the domain"
    )
    lift.add_argument(
        "--step", type=float, metavar="LENGTH", help="how closely lines are followed, in units of the drawing"
    )
    add_request_options(lift)
    lift.set_defaults(command=_lift)
    demo = commands.add_parser(
        "demo", help="send a bundled sample through the service and show what comes out"
    )
    demo.add_argument(
        "--sample", choices=[*samples.names(), ALL], default="tower", help="which surface (default: tower)"
    )
    demo.add_argument(
        "--out", default="hexwrap-demo", metavar="DIR", help="folder for the files (default: %(default)s)"
    )
    demo.add_argument(
        "--port", type=int, default=Settings.port, help="port of the service (default: %(default)s)"
    )
    demo.set_defaults(command=_demo)
    return parser


def _add_outputs(parser: argparse.ArgumentParser, help: str) -> None:
    parser.add_argument(
        "-o", "--output", dest="outputs", metavar="OUT", action="append", required=True, help=help
    )


def kinds() -> list[str]:
    return [*ENDINGS, "flat.dxf", "domain.dxf", "cutting-list.csv"]


def _serve(asked: argparse.Namespace) -> int:
    from hexwrap_server.http.app import serve  # the web framework takes a second to import

    try:
        settings = Settings.from_arguments(asked)
    except ValueError as error:
        raise UsageError(str(error)) from None
    try:
        serve(settings)
    except (StartError, OSError) as error:
        return _refuse(1, str(error))
    return 0


def _solve(asked: argparse.Namespace) -> int:
    kinds = {out: file_kind(out) for out in asked.outputs}
    _check_folders(asked.outputs)
    if asked.sheet is not None and not all(0 < side < inf for side in asked.sheet):
        raise UsageError(
            f"--sheet {asked.sheet[0]:g} {asked.sheet[1]:g}: both sides must be finite and greater than 0."
        )
    if asked.storey is not None and not 0 < asked.storey < inf:
        raise UsageError(f"--storey {asked.storey:g}: must be finite and greater than 0.")
    todo = task(asked.input, asked)
    for kind in kinds.values():
        check_wanted(kind, todo.wanted)
    solution, timings = solve_with_progress(todo, asked.quiet)
    meta = Meta(
        todo.name or "hexwrap",
        timings,
        tuple(asked.sheet) if asked.sheet else None,
        group=asked.group,
        storey=asked.storey,
    )
    console = Console(quiet=asked.quiet, soft_wrap=True)
    parts = ("unit", "mesh", "map", "pattern", "panels", "sizes", "quality", "timings")
    print_summary(console, meta.name, orjson.loads(wire.result_json(solution, timings, parts)))
    for out, kind in kinds.items():
        save(out, write(kind, solution, meta))
        console.print(f"wrote {out}", highlight=False)
    return 0


def _explore(asked: argparse.Namespace) -> int:
    check_outputs(asked.outputs)
    _check_folders(asked.outputs)
    todo = asked_exploration(asked)
    with _progress(asked.quiet) as report:
        found = explore_here(todo.name, todo.surface, todo.wanted, report)
    console = Console(quiet=asked.quiet, soft_wrap=True)
    print_front(console, todo.name, found)
    for out in asked.outputs:
        save(out, FRONT_WRITERS[Path(out).suffix.lower()](found))
        console.print(f"wrote {out}", highlight=False)
    return 0


def _inspect(asked: argparse.Namespace) -> int:
    settings = surface_settings(asked)
    console = Console(soft_wrap=True, highlight=False, markup=False)
    return print_content(console, read_bytes(asked.input), Path(asked.input).name, settings)


def _lift(asked: argparse.Namespace) -> int:
    ending = Path(asked.output).suffix.lower()
    if ending not in CURVE_WRITERS:
        raise UsageError(f"-o {asked.output}: the ending must be one of {', '.join(CURVE_WRITERS)}.")
    if asked.step is not None and asked.step <= 0:
        raise UsageError(f"--step {asked.step:g}: must be greater than 0.")
    _check_folders([asked.output])
    if not Path(asked.points).is_file():
        raise UsageError(f"{asked.points}: no such file.")
    drawing = read_drawing(Path(asked.points))
    cmap = map_in_result(Path(asked.input))
    if cmap is None:
        cmap = solve_with_progress(only_map(task(asked.input, asked)), asked.quiet)[0].map
    carry = flatten_curves if asked.flatten else lift_curves
    carried = carry(cmap, drawing.curves, asked.step)
    if not carried.curves:
        return _refuse(1, "no point of the drawing lies in the domain, which domain.dxf shows.")
    unit = None if asked.flatten else cmap.surface.unit
    save(asked.output, write_curves(ending, carried.curves, unit))
    console = Console(quiet=asked.quiet, soft_wrap=True, highlight=False)
    for note in drawing.notes():
        console.print(note)
    if carried.outside:
        console.print(f"{carried.outside} points of the drawing lie outside the domain and were left out")
    if carried.farthest:
        console.print(f"points stood at most {length(carried.farthest)} off the surface")
    console.print(f"wrote {asked.output}")
    return 0


def _demo(asked: argparse.Namespace) -> int:
    if not 0 < asked.port < 65536:
        raise UsageError(f"--port {asked.port}: must be from 1 to 65535.")
    console = Console(soft_wrap=True)
    try:
        with _progress(quiet=False) as listen:
            run_demo(asked.sample, Path(asked.out), asked.port, console, listen)
    except (DemoError, httpx.HTTPError) as error:
        return _refuse(1, str(error))
    return 0


def solve_with_progress(todo: Task[Wanted], quiet: bool) -> tuple[Solution, dict[str, float]]:
    """Solve with a progress bar on stderr where that is a terminal."""
    with _progress(quiet) as report:
        return solve_here(todo, report)


@contextmanager
def _progress(quiet: bool) -> Iterator[Report]:
    columns = (
        TextColumn("{task.description:<8}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[what]}"),
    )
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=quiet or not console.is_terminal) as bar:
        row = bar.add_task("", total=1.0, what="")
        yield lambda stage, fraction, what: bar.update(row, completed=fraction, description=stage, what=what)


def file_kind(out: str) -> str:
    """Which of the service's files an output is. Raises UsageError."""
    path = Path(out)
    name = path.name.lower()
    for kind in WRITERS:
        if name.endswith(kind):
            return kind
    if path.suffix.lower() not in ENDINGS:
        raise UsageError(f"-o {out}: the ending must be one of {', '.join(kinds())}.")
    return ENDINGS[path.suffix.lower()]


def _check_folders(outputs: Sequence[str]) -> None:
    """Before the work, not after it."""
    for out in outputs:
        if not Path(out).resolve().parent.is_dir():
            raise UsageError(f"-o {out}: the folder {Path(out).resolve().parent} does not exist.")
        if Path(out).is_dir():
            raise UsageError(f"-o {out}: this is a folder; name a file.")


def save(out: str, data: bytes) -> None:
    """Raises UsageError where the file cannot be written."""
    try:
        Path(out).write_bytes(data)
    except OSError as error:
        raise UsageError(f"{out} cannot be written: {error.strerror or error}.") from None


if __name__ == "__main__":
    sys.exit(main())
