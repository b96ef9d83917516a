"""Meshes broken in every way, sent at once: never a 5xx, never a hang, and the server stays awake."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from tests.server.bodies import tube
from tests.server.patience import PATIENCE
from tests.server.process import free_port, longest_step, served

Body = dict[str, Any]
Chance = np.random.Generator


def move_vertex(body: Body, r: Chance) -> None:
    v = body["surface"]["vertices"]
    v[r.integers(len(v))] = (r.normal(size=3) * 10.0 ** r.integers(-8, 9)).tolist()


def weld_vertices(body: Body, r: Chance) -> None:
    v = body["surface"]["vertices"]
    v[r.integers(len(v))] = list(v[r.integers(len(v))])


def drop_faces(body: Body, r: Chance) -> None:
    f = body["surface"]["faces"]
    for _ in range(r.integers(1, 4)):
        del f[r.integers(len(f))]


def repeat_face(body: Body, r: Chance) -> None:
    f = body["surface"]["faces"]
    f.append(list(f[r.integers(len(f))]))


def flip_face(body: Body, r: Chance) -> None:
    body["surface"]["faces"][r.integers(len(body["surface"]["faces"]))].reverse()


def rewire_corner(body: Body, r: Chance) -> None:
    f = body["surface"]["faces"][r.integers(len(body["surface"]["faces"]))]
    f[r.integers(len(f))] = int(r.integers(-2, len(body["surface"]["vertices"]) + 2))


def add_face(body: Body, r: Chance) -> None:
    n = len(body["surface"]["vertices"])
    body["surface"]["faces"].append(r.integers(n, size=r.integers(2, 6)).tolist())


def flatten_mesh(body: Body, r: Chance) -> None:
    for point in body["surface"]["vertices"]:
        point[r.integers(3)] *= 0.0


def scale_mesh(body: Body, r: Chance) -> None:
    factor = 10.0 ** int(r.integers(-150, 150))
    body["surface"]["vertices"] = [[x * factor for x in p] for p in body["surface"]["vertices"]]


def shift_mesh(body: Body, r: Chance) -> None:
    far = 10.0 ** int(r.integers(0, 12))
    body["surface"]["vertices"] = [[x + far for x in p] for p in body["surface"]["vertices"]]


def squash_mesh(body: Body, r: Chance) -> None:
    factor = 10.0 ** int(r.integers(-9, 0))
    body["surface"]["vertices"] = [[p[0], p[1], p[2] * factor] for p in body["surface"]["vertices"]]


def second_piece(body: Body, r: Chance) -> None:
    surface, n = body["surface"], len(body["surface"]["vertices"])
    surface["vertices"] += [[x + 100 for x in p] for p in surface["vertices"]]
    surface["faces"] += [[i + n for i in f] for f in surface["faces"]]


def cap(body: Body, r: Chance) -> None:
    surface = body["surface"]
    surface["vertices"].append([0.0, 0.0, 0.0])
    surface["faces"] += [[len(surface["vertices"]) - 1, (i + 1) % 12, i] for i in range(12)]


def foreign_value(body: Body, r: Chance) -> None:
    values = [None, True, "x", [], {}, 1e308, -1, 2**63, 0.5]
    place = body["surface"][str(r.choice(["vertices", "faces"]))]
    place[r.integers(len(place))][r.integers(3)] = values[r.integers(len(values))]


def odd_settings(body: Body, r: Chance) -> None:
    body["pattern"] = {
        "kind": str(r.choice(["hex", "quad", "triangle"])),
        "around": int(10 ** r.uniform(0, 4)),
        "rotation": ["edge", "vertex", 17.0, "u", -1e9][r.integers(5)],
        "align": str(r.choice(["none", "first", "both"])),
        "boundary": str(r.choice(["whole", "trim"])),
        "phase": r.normal(size=2).tolist(),
    }


def odd_length(body: Body, r: Chance) -> None:
    body["pattern"] = {"edge_length": 10.0 ** r.integers(-9, 9)}


def odd_panels(body: Body, r: Chance) -> None:
    body["panels"] = {
        "mode": str(r.choice(["split", "watertight"])),
        "target": str(r.choice(["shortest", "inscribed", "best", "mean"])),
        "method": str(r.choice(["exact", "energy"])),
        "orientation": str(r.choice(["fit", "tangent"])),
        "sizes": [None, 1, 3, 1000][r.integers(4)],
        "joint": [0.0, 1e-3, 10.0, 1e300][r.integers(4)],
        "increment": [0.0, 0.1, 1e6][r.integers(3)],
        "edge_range": [None, [0.0, 0.0], [0.1, 0.2], [1e6, 1e9]][r.integers(4)],
    }


def odd_boundary(body: Body, r: Chance) -> None:
    body["boundary"] = {
        "mode": str(r.choice(["straight", "angles", "isometric"])),
        "angles": [
            {"vertex": int(r.integers(60)), "angle": float(r.normal(3, 3))} for _ in range(r.integers(4))
        ],
        "quantum": str(r.choice(["auto", "hex", "quad", "none"])),
        "spread": str(r.choice(["even", "optimal"])),
    }


MUTATIONS: list[Callable[[Body, Chance], None]] = [
    move_vertex, weld_vertices, drop_faces, repeat_face, flip_face, rewire_corner, add_face, flatten_mesh,
    scale_mesh, shift_mesh, squash_mesh, second_piece, cap, foreign_value, odd_settings, odd_length,
    odd_panels, odd_boundary,
]  # fmt: skip


def mutated(seed: int) -> Body:
    """A small tube with one to three things wrong, the same for the same seed."""
    r = np.random.default_rng(seed)
    body: Body = {"surface": tube(12, 5), "pattern": {"around": 8}}
    for i in r.choice(len(MUTATIONS), size=r.integers(1, 4), replace=False):
        try:
            MUTATIONS[i](body, r)
        except (TypeError, IndexError, ValueError):  # an earlier change left nothing of that kind to break
            continue
    return body


#: How many meshes are sent at a time.
CLIENTS = 4
#: Seconds of processor time for which the server may answer nobody else, such as /health.
LONGEST_STEP = 0.5


def attack(client: httpx.Client, seeds: Iterable[int]) -> Counter[int]:
    """Statuses and how often they came."""
    with ThreadPoolExecutor(CLIENTS) as threads:
        return Counter(threads.map(lambda seed: answered(client, seed), seeds))


def answered(client: httpx.Client, seed: int) -> int:
    """The status of an answer that is one."""
    text = json.dumps(mutated(seed))
    assert client.get("/health").status_code == 200
    answer = client.post("/v1/solve", content=text)
    assert answer.status_code in (200, 422), (seed, answer.text)
    if answer.status_code == 422:
        problem = answer.json()
        assert problem["detail"]
        assert problem["type"] not in ("/problems/time-limit", "/problems/memory-limit"), (seed, problem)
        n = len(json.loads(text)["surface"]["vertices"])
        assert all(0 <= v < n for v in problem.get("vertices", [])), (seed, problem)
    return answer.status_code


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("data")


@pytest.fixture(scope="module")
def client(data: Path) -> Iterator[httpx.Client]:
    port = free_port()
    with (
        served(data, port, workers=2, job_seconds=PATIENCE, max_panels=20_000),
        httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=PATIENCE, trust_env=False) as client,
    ):
        yield client


def test_mutated_meshes_get_an_answer(client: httpx.Client, data: Path) -> None:
    counts = attack(client, range(100))
    assert longest_step(data) < LONGEST_STEP
    assert counts[200] > 20
    assert counts[422] > 20


def test_meshes_that_failed_once_get_an_answer(client: httpx.Client) -> None:
    """A step of the energy that overflows; a problem with a number of more than 64 bits; a line of the
    pattern that meets a vertex of the boundary with more than a full turn around it; an opening with a side
    of a hundred-millionth of the others; openings that are filled each by itself, but not together."""
    attack(client, [565, 610, 931, 5999, 9930])


@pytest.mark.long
@pytest.mark.parametrize("block", range(20))
def test_many_mutated_meshes_get_an_answer(client: httpx.Client, data: Path, block: int) -> None:
    attack(client, range(500 * block, 500 * (block + 1)))
    assert longest_step(data) < LONGEST_STEP
