"""How long a slider takes: the number of sizes, or of cells around, changes on a surface solved before.

    python benchmarks/slider.py [--around 82] [--vertices 4000] [--rounds 7]

A tower with about 4,000 panels, over HTTP, on a server with one worker. Wall time until the answer is there,
as it is sent (gzip; to unpack it is the client's), to a plain client (the httpx of the other benchmarks takes
up to 10 ms itself): the least and the median of the rounds, and the least outside of the stages.
Processor time of all processes of the server (Linux only), the median. Parts: all, or some, which are those
that the Grasshopper component asks for.
No request is sent twice.
"""

from __future__ import annotations

import argparse
import gzip
import http.client
import os
import statistics
import time
from collections import defaultdict
from pathlib import Path

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
        plain = http.client.HTTPConnection("127.0.0.1", client.base_url.port or 0)
        heads = ("parts", "panels", "least", "median", "outside", "processor", "goal")
        print(f"{'':8}", *(f"{head:>9}" for head in heads), "  stages, ms")
        solve(plain, surface, {"around": given.around}, {"sizes": 11}, PARTS)
        for what, goal in GOALS.items():
            for late, parts in enumerate(("", PARTS)):
                rounds = []
                for k in range(given.rounds):
                    step = 1 + k + late * given.rounds  # none of them twice
                    sizes = 11 if what == "around" else 11 + step
                    aside = (step + 1) // 2 * (-1) ** step if what == "around" else 0
                    pattern = {"around": given.around + aside}
                    rounds.append(solve(plain, surface, pattern, {"sizes": sizes}, parts))
                walls, used, outside, panels, stages = zip(*rounds, strict=True)
                best = walls.index(min(walls))
                figures = walls[best], statistics.median(walls), min(outside), statistics.median(used), goal
                name = "some" if parts else "all"
                print(
                    f"{what:8} {name:>9} {panels[best]:9}",
                    *(f"{f:9.3f}" for f in figures),
                    f"  {stages[best]}",
                )


def solve(
    client: http.client.HTTPConnection,
    surface: str,
    pattern: dict[str, int],
    panels: dict[str, int],
    parts: str,
) -> tuple[float, float, float, int, str]:
    """Wall and processor seconds, wall seconds outside the stages, the number of panels, and the stages that
    took more than a millisecond."""
    body = orjson.dumps({"surface": {"id": surface}, "pattern": pattern, "panels": panels})
    before, start = processor(os.getpid()), time.perf_counter()
    client.request("POST", f"/v1/solve{parts}", body, {"Accept-Encoding": "gzip"})
    answer = client.getresponse()
    sent = answer.read()
    wall, used = time.perf_counter() - start, processor(os.getpid()) - before
    assert answer.status == 200, sent[:1000]
    entries = [entry.split(";")[:2] for entry in answer.headers["server-timing"].split(", ")]
    stages = {name: float(spent[4:]) for name, spent in entries}
    n = len(orjson.loads(gzip.decompress(sent))["panels"]["face"])
    slow = ", ".join(f"{name} {spent:.0f}" for name, spent in stages.items() if spent > 1)
    return wall, used, wall - sum(stages.values()) / 1000, n, slow


if __name__ == "__main__":
    main()
