"""How long a slider takes: the number of sizes, or of cells around, changes on a surface solved before.

    python benchmarks/slider.py [--around 82] [--vertices 4000] [--rounds 7]

A tower with about 4,000 panels, over HTTP, on a server with one worker. Wall time until the answer is there,
as it is sent (gzip; to unpack it is the client's), and processor time of all processes of the server (Linux
only), the median of the rounds; parts: all, or some, which are those that the Grasshopper component asks for.
No request is sent twice.
"""

from __future__ import annotations

import argparse
import gzip
import os
import statistics
import time
from collections import defaultdict
from pathlib import Path

import httpx
import orjson
from service import server, tower

#: What the Grasshopper component draws.
PARTS = "?include=panels,pattern,sizes,quality"
#: On one core, from issue 20.
GOALS = {"sizes": 0.1, "around": 0.3}


def processor(above: int) -> float:
    """Seconds that the processes below this one have used."""
    below, used = defaultdict(list), {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:  # ended meanwhile
            continue
        below[int(fields[1])].append(int(folder.name))
        used[int(folder.name)] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    total, open_ones = 0.0, [above]
    while open_ones:
        children = below[open_ones.pop()]
        total += sum(used[one] for one in children)
        open_ones += children
    return total


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--around", type=int, default=82)
    asked.add_argument("--vertices", type=int, default=4000)
    asked.add_argument("--rounds", type=int, default=7)
    given = asked.parse_args()
    with server(workers=1) as client:
        surface = client.post("/v1/surfaces", json=tower(given.vertices)).raise_for_status().json()["id"]
        print(f"{'':12} {'parts':8} {'panels':>7} {'wall':>8} {'processor':>10} {'goal':>6}   stages, ms")
        solve(client, surface, {"around": given.around}, {"sizes": 11}, PARTS)
        for what, goal in GOALS.items():
            for late, parts in enumerate(("", PARTS)):
                rounds = []
                for k in range(given.rounds):
                    step = 1 + k + late * given.rounds  # none of them twice
                    sizes = 11 if what == "around" else 11 + step
                    aside = (step + 1) // 2 * (-1) ** step if what == "around" else 0
                    pattern = {"around": given.around + aside}
                    rounds.append(solve(client, surface, pattern, {"sizes": sizes}, parts))
                wall, used = (statistics.median(one[i] for one in rounds) for i in (0, 1))
                panels, timing = rounds[-1][2:]
                name = "some" if parts else "all"
                print(f"{what:12} {name:8} {panels:7} {wall:8.3f} {used:10.3f} {goal:6.1f}   {timing}")


def solve(
    client: httpx.Client, surface: str, pattern: dict[str, int], panels: dict[str, int], parts: str
) -> tuple[float, float, int, str]:
    """Wall and processor seconds, the number of panels, and what took more than a millisecond."""
    body = orjson.dumps({"surface": {"id": surface}, "pattern": pattern, "panels": panels})
    before, start = processor(os.getpid()), time.perf_counter()
    with client.stream("POST", f"/v1/solve{parts}", content=body) as answer:
        sent = b"".join(answer.raise_for_status().iter_raw())
    wall, used = time.perf_counter() - start, processor(os.getpid()) - before
    stages = [entry.split(";")[:2] for entry in answer.headers["server-timing"].split(", ")]
    slow = [(name, float(spent[4:])) for name, spent in stages if float(spent[4:]) > 1]
    panels = len(orjson.loads(gzip.decompress(sent))["panels"]["face"])
    return wall, used, panels, ", ".join(f"{a} {b:.0f}" for a, b in slow)


if __name__ == "__main__":
    main()
