"""The whole pipeline on files, as a user runs it: solved, refused, late, crashed, or wrong by the contract.

    python -m benchmarks.whole FILE ... [--asks default straight ...] [--seconds 120] [--gigabytes 4]

Each run is a process of its own with bounded time and memory; its result is judged by ``tests/contract.py``,
which knows nothing of the solver. Seconds are processor time.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from tests import contract

ASKS: dict[str, list[str]] = {
    "default": [],
    "straight": ["--boundary", "straight"],
    "isometric": ["--boundary", "isometric"],
    "optimal": ["--boundary", "isometric", "--spread", "optimal"],
    "trim": ["--cells", "trim"],
    "quad": ["--pattern", "quad"],
    "triangle": ["--pattern", "triangle"],
    "loops": ["--openings", "loop"],
    "singular": ["--singularities", "auto"],
    "coarse": ["--around", "9"],
    "watertight": ["--panels", "watertight"],
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--asks", nargs="*", default=["default", "straight", "isometric", "optimal"])
    parser.add_argument("--seconds", type=int, default=120)
    parser.add_argument("--gigabytes", type=float, default=4)
    options = parser.parse_args()
    counts: dict[str, int] = {}
    for path in options.files:
        for ask in options.asks:
            verdict, seconds, told = judge(path, ASKS[ask], options.seconds, options.gigabytes)
            counts[verdict] = counts.get(verdict, 0) + 1
            print(f"{path.stem:24s} {ask:10s} {verdict:8s} {seconds:7.1f} {told}", flush=True)
    print(", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items())))


def judge(path: Path, asked: list[str], seconds: int, gigabytes: float) -> tuple[str, float, str]:
    """Verdict, seconds of the processor, and what there is to say."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "result.json"
        command = [
            sys.executable,
            "-m",
            "hexwrap_server.cli",
            "solve",
            str(path),
            *asked,
            "-q",
            "-o",
            str(out),
        ]
        memory = int(gigabytes * 2**30)
        one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        run = subprocess.run(
            command,
            capture_output=True,
            text=True,
            env={**os.environ, **one},
            preexec_fn=lambda: (
                resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds)),
                resource.setrlimit(resource.RLIMIT_AS, (memory, memory)),
            ),
        )
        spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        said = run.stderr.strip().splitlines()
        if run.returncode == 1 and said and said[0].startswith("hexwrap: "):
            return "refused", spent, said[0].removeprefix("hexwrap: ")
        if run.returncode < 0:
            return "late", spent, f"signal {-run.returncode}"
        if run.returncode:
            return "crashed", spent, said[-1] if said else f"status {run.returncode}"
        wrong = violations(json.loads(out.read_text()))
    return ("wrong" if wrong else "solved"), spent, "; ".join(wrong)


def violations(result: contract.Json) -> list[str]:
    watertight = result["panels"]["mode"] == "watertight"
    return [
        *contract.check_mesh(result),
        *contract.check_map(result),
        *contract.check_pattern(result, whole=False),
        *([] if watertight else contract.check_panels(result, overlap_free=False)),
        *([f"{result['quality']['overlaps']} overlaps"] if result["quality"]["overlaps"] else []),
    ]


if __name__ == "__main__":
    main()
