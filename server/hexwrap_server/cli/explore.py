"""``hexwrap explore``: the same exploration as the service's, with processes of its own."""

from __future__ import annotations

import argparse
import asyncio
import tempfile
from dataclasses import fields
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from hexwrap_server.cli.local import MAX_PANELS, MAX_VERTICES, Task, checked_task
from hexwrap_server.cli.options import asked_body
from hexwrap_server.errors import UsageError
from hexwrap_server.input.form import ExploreBody
from hexwrap_server.input.requests import CacheSettings, Exploration, Order, SentSurface
from hexwrap_server.input.schemas import Request, parse_exploration
from hexwrap_server.jobs import codec
from hexwrap_server.jobs.engine import ProcessEngine, nobody
from hexwrap_server.jobs.exploring import explore
from hexwrap_server.jobs.store import Work
from hexwrap_server.jobs.worker import Report
from hexwrap_server.output import explored, front_png
from hexwrap_server.output.text import length
from hexwrap_server.settings import MIB, Settings

#: Limits of a process: only the user waits here.
SECONDS, MEMORY_MIB = 86400.0, 65536.0
WRITERS = {".csv": explored.explore_csv, ".json": explored.result_json, ".png": front_png.front_png}


def check_outputs(outputs: list[str]) -> None:
    """Raises UsageError."""
    for out in outputs:
        if Path(out).suffix.lower() not in WRITERS:
            raise UsageError(f"-o {out}: the ending must be one of {', '.join(WRITERS)}.")


def asked(arguments: argparse.Namespace) -> Task[Exploration]:
    """What is to be explored. Raises UsageError, HexwrapError."""
    return checked_task(arguments.input, lambda body: _parsed(asked_body(arguments, body)))


def _parsed(whole: dict[str, Any]) -> Request[Exploration]:
    """The exploration in a body, which may be a request for one result: then its size is what varies."""
    body = {f.name: whole[f.name] for f in fields(ExploreBody) if f.name in whole}
    if isinstance(body.get("pattern"), dict):
        body["pattern"] = {k: v for k, v in body["pattern"].items() if k not in ("around", "edge_length")}
    return parse_exploration(body, MAX_VERTICES, MAX_PANELS)


class _Here:
    """Hands for an exploration: processes and a folder of its own."""

    def __init__(self, engine: ProcessEngine, folder: Path) -> None:
        self._engine = engine
        self._folder = folder
        (folder / "stages").mkdir()
        self.caching = CacheSettings(str(folder / "stages"), int(256 * MIB))

    @property
    def at_once(self) -> int:
        return self._engine.capacity

    async def call(self, function: str, *arguments: Any) -> Any:
        return await self._engine.run(function, *arguments, report=nobody, seconds=SECONDS, mib=MEMORY_MIB)

    errand = call

    async def solved(self, work: Work) -> str:
        paths = tuple(str(self._folder / f"{work.identity}.{name}") for name in ("json.gz", "solution"))
        surface = str(self._folder / "surface")
        order = Order(work.surface, surface, work.wanted, (paths[0], paths[1]))
        await self.call("hexwrap_server.jobs.work:solve", order, self.caching)
        return paths[1]


def explore_here(name: str, sent: SentSurface, wanted: Exploration, report: Report) -> dict[str, Any]:
    """The result, on as many processes as ``serve`` would use. Raises HexwrapError."""
    return asyncio.run(_explore(name, sent, wanted, report))


async def _explore(name: str, sent: SentSurface, wanted: Exploration, report: Report) -> dict[str, Any]:
    engine = ProcessEngine(Settings().workers)
    with tempfile.TemporaryDirectory(prefix="hexwrap-") as place:
        folder = Path(place)
        hands = _Here(engine, folder)
        (folder / "surface").write_bytes(codec.encode(sent))
        id = codec.digest(sent)
        files = str(folder / "explored.json.gz"), str(folder / "explored.solution")
        order = Order(id, str(folder / "surface"), wanted, files)
        await engine.start()
        try:
            await explore(
                hands,
                order,
                name,
                lambda one: Work(codec.digest(id, one), id, one),
                lambda stage, fraction: report(stage, fraction, ""),
                lambda i, variant: None,
            )
        finally:
            await engine.stop()
        found: dict[str, Any] = explored.kept(Path(files[1]).read_bytes())
        return found


def print_front(console: Console, name: str, result: dict[str, Any]) -> None:
    """The front as a table, the proposed one marked."""
    table = Table(title=name or "front", title_justify="left", title_style="bold", box=None)
    table.padding = (0, 1, 0, 0)
    choices = ("no.", "boundary", "sing.", "edge", "sizes")
    heads = (*choices, "uncovered", "bare", "panels", "types", "joint", "cost")
    for head in heads:
        table.add_column(head, justify="right", no_wrap=True)
    order = sorted(result["front"], key=lambda i: result["variants"][i]["measured"]["uncovered"])
    for i in order:
        one = result["variants"][i]
        found, (boundary, count, *_, around, edge, sizes, _) = (
            one["measured"],
            explored.choices(one["request"]),
        )
        size = f"{edge:g}" if edge != "" else f"{around} around" if around != "" else "default"
        gap = "" if found["gap_max"] is None else length(found["gap_max"])
        is_best = i == result["best"]
        row = [f"* {i}" if is_best else str(i), boundary, str(count), size, str(sizes)]
        row += [f"{found['uncovered']:.2%}", f"{found['bare']:.0%}"]
        row += [str(found["panels"]), str(found["types"]), gap]
        table.add_row(*row, f"{found['cost']:,.0f}", style="bold" if is_best else "")
    console.print(table)
    if result["best"] is not None:
        console.print(f"* no. {result['best']} is proposed", highlight=False)
    for note in result["notes"]:
        console.print(f"• {note}", highlight=False)
