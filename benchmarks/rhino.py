"""What becomes of Rhino files: solved, without a surface, to be chosen, refused, late, crashed, or wrong.

    python -m benchmarks.rhino FOLDER ... [--only surface] [--seconds 90] [--out table.json] [--pictures DIR]
    python -m benchmarks.rhino --write table.json ...

Takes every .3dm in the folders through the pipeline with default settings, each in a process of its own with
bounded time and memory; results are judged by ``tests/contract.py``. Seconds are processor time; covered is
the area of the panels over that of the surface. With ``--pictures`` the panels of what is solved are drawn;
``--write`` puts tables into docs/results.md.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sys
import time
import traceback
from collections import Counter
from pathlib import Path
from typing import Any

from benchmarks.whole import violations
from hexwrap_server.cli.local import Task, solve_here, task
from hexwrap_server.cli.main import make_parser
from hexwrap_server.errors import NoObjectError, SeveralObjectsError
from hexwrap_server.jobs.work import take_in
from hexwrap_server.output import wire
from hexwrap_server.output.writers import Meta, write
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.panels.polygons import fan_areas

NO_SURFACE = "holds no mesh, surface"
PAGE = Path(__file__).parent.parent / "docs" / "results.md"
BEGIN, END = "<!-- Rhino files: made by their benchmark -->", "<!-- end of Rhino files -->"
#: Letters of what is told that stand in the table.
TOLD = 110


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("places", nargs="*", type=Path)
    parser.add_argument("--write", nargs="+", type=Path)
    parser.add_argument("--only", choices=["surface", "all"], default="all")
    parser.add_argument("--seconds", type=int, default=90)
    parser.add_argument("--gigabytes", type=float, default=4)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--pictures", type=Path)
    options = parser.parse_args()
    if options.write:
        write_page([row for table in options.write for row in json.loads(table.read_text())])
        return
    files = sorted(
        file
        for place in options.places
        for file in ([place] if place.is_file() else place.rglob("*"))
        if file.suffix.lower() == ".3dm"
    )
    rows, counts = [], dict[str, int]()
    for file in files:
        row = apart(file, options)
        rows.append(row)
        counts[row["verdict"]] = counts.get(row["verdict"], 0) + 1
        print(f"{row['file']:60.60s} {row['verdict']:10s} {row['seconds']:5.1f} {row['told']}", flush=True)
    print(", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items())))
    if options.out:
        options.out.write_text(json.dumps(rows, indent=1, ensure_ascii=False))


def write_page(rows: list[dict[str, Any]]) -> None:
    lines = ["| file | | panels | covered | loops | s | told |", "|---|---|---|---|---|---|---|"]
    for row in rows:
        covered = f"{100 * row['covered']:.0f} %" if "covered" in row else ""
        told = row["told"].partition(" | ")[2] if row["verdict"] == "solved" else row["told"]
        told = (told[:TOLD].rpartition(" ")[0] + " …" if len(told) > TOLD else told).replace("|", "/")
        name = row["file"].removesuffix(".3dm").replace("__", "/").rpartition("/")[2]
        cells = (
            name,
            row["verdict"],
            row.get("panels", ""),
            covered,
            row.get("loops", ""),
            row["seconds"],
            told,
        )
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    counts = Counter(row["verdict"] for row in rows)
    total = ", ".join(f"{count} {verdict}" for verdict, count in counts.most_common())
    before, _, rest = PAGE.read_text().partition(BEGIN)
    _, _, after = rest.partition(END)
    text = "\n".join([BEGIN, "", f"{len(rows)} files: {total}.", "", *lines, ""])
    PAGE.write_text(before + text + END + after)


def apart(file: Path, options: argparse.Namespace) -> dict[str, Any]:
    """One file in a process of its own."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        memory = int(options.gigabytes * 2**30)
        resource.setrlimit(resource.RLIMIT_CPU, (options.seconds, options.seconds))
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        row = one(file, options)
        with os.fdopen(writing, "w") as pipe:
            pipe.write(json.dumps(row))
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        said = pipe.read()
    _, status = os.waitpid(child, 0)
    if said:
        return json.loads(said)
    late = f"signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else f"status {status}"
    return {"file": file.name, "verdict": "late", "seconds": options.seconds, "told": late}


def one(file: Path, options: argparse.Namespace) -> dict[str, Any]:
    before = time.process_time()
    sys.setrecursionlimit(2000)
    more: dict[str, Any] = {}
    try:
        asked = task(str(file), make_parser().parse_args(["solve", str(file), "-o", "result.json"]))
        more = surface_row(asked) if options.only == "surface" else whole_row(asked, file, options)
        verdict, told = more.pop("verdict"), more.pop("told")
    except NoObjectError as error:
        verdict, told = "refused", error.detail
    except SeveralObjectsError as error:
        verdict, told = "choose", error.detail
    except HexwrapError as error:
        verdict, told = "refused", error.detail
        if NO_SURFACE in told:
            verdict = "none"
    except Exception:
        verdict, told = "crashed", traceback.format_exc()
    return {
        "file": file.name,
        "verdict": verdict,
        "seconds": round(time.process_time() - before, 2),
        "told": told,
        **more,
    }


def surface_row(asked: Task) -> dict[str, Any]:
    surface = take_in(asked.surface, asked.wanted.surface)
    loops = f"{len(surface.loops)} loops, {surface.openings} openings, {len(surface.vertices)} vertices"
    return {"verdict": "solved", "told": f"{loops} | {' '.join(surface.repairs)}"}


def whole_row(asked: Task, file: Path, options: argparse.Namespace) -> dict[str, Any]:
    solution, timings = solve_here(asked, lambda *_: None)
    result = json.loads(wire.result_json(solution, timings))
    wrong = violations(result)
    cells = solution.pattern
    area = float(solution.map.surface.areas.sum())
    covered = result["quality"]["coverage"] * float(fan_areas(cells.cells).sum()) / area if cells else 0.0
    if options.pictures:
        options.pictures.mkdir(parents=True, exist_ok=True)
        picture = write("panels.png", solution, Meta(file.stem, timings))
        (options.pictures / f"{file.stem}.png").write_bytes(picture)
    return {
        "verdict": "wrong" if wrong else "solved",
        "told": "; ".join(wrong)
        or f"{len(result['panels']['polygons'])} panels, {100 * covered:.0f} % covered, "
        f"{len(result['mesh']['loops'])} loops | "
        + " ".join(result["mesh"]["repairs"]),
        "panels": len(result["panels"]["polygons"]),
        "covered": covered,
        "loops": len(result["mesh"]["loops"]),
        "notes": result["quality"]["notes"],
    }


if __name__ == "__main__":
    main()
