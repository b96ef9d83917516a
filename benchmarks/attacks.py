"""What attacks cost a server with its default settings: python benchmarks/attacks.py

Each row: the statuses answered, seconds, the highest memory in MiB of the server and of the largest of
its processes, and the slowest answer of /health meanwhile. Bodies unpack to 100 MiB.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import httpx

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "server"), str(ROOT / "solver")]

from tests.server.attacks import ATTACKS, Target, measured  # noqa: E402
from tests.server.process import free_port, longest_step, served  # noqa: E402
from tests.server.test_bounds import many_jobs  # noqa: E402


def main() -> None:
    print("| attack | answers | s | server, MiB | largest process, MiB | /health, s | longest step, s |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        data, port = Path(folder), free_port()
        many_jobs(data, 1000)
        options = {"base_url": f"http://127.0.0.1:{port}", "timeout": 300.0, "trust_env": False}
        with (
            served(data, port, workers=2) as process,
            httpx.Client(**options, limits=httpx.Limits(max_connections=None)) as client,
            httpx.Client(**options) as health,
        ):
            target = Target(process, client, health, data, bomb=100)
            for attack in ATTACKS:
                answers, cost = measured(target, attack)
                found = ", ".join(map(str, sorted({answer.status_code for answer in answers})))
                figures = f"{cost.seconds:.1f} | {cost.server:.0f} | {cost.child:.0f} | {cost.health:.2f}"
                step = longest_step(data)
                print(f"| {attack.__name__} | {found} | {figures} | {step:.3f} |", flush=True)


if __name__ == "__main__":
    main()
