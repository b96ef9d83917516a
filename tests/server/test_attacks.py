"""A server process withstands, one after the other, what was once sent to bring it down."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import httpx
import pytest

from tests.server import attacks
from tests.server.attacks import ATTACKS, Answers, Target, measured
from tests.server.patience import PATIENCE
from tests.server.process import free_port, longest_step, served
from tests.server.test_bounds import LONGEST_STEP, many_jobs

#: MiB that the server may grow to, bodies and remembered results included.
SERVER = 350.0
#: MiB that a reader may take, and how much further it gets before it is seen.
READ, UNSEEN = 500.0, 400.0


@pytest.fixture(scope="module")
def target(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Target]:
    data, port = tmp_path_factory.mktemp("data"), free_port()
    many_jobs(data, 1000)
    limits = {"read_mib": READ, "read_seconds": 2.0, "readers": 2}
    base, wide = f"http://127.0.0.1:{port}", httpx.Limits(max_connections=None)
    with (
        served(data, port, workers=1, **limits) as process,
        httpx.Client(base_url=base, timeout=PATIENCE, trust_env=False, limits=wide) as client,
        httpx.Client(base_url=base, timeout=PATIENCE, trust_env=False) as health,
    ):
        yield Target(process, client, health, data, bomb=24)


#: The others take many seconds; ``test_bounds`` and ``test_engine`` have them in small.
SHORT = (attacks.long_name, attacks.flipped_bit, attacks.overflowing, attacks.few_handles, attacks.shutdown)


@pytest.mark.parametrize(
    "attack",
    [pytest.param(one, id=one.__name__, marks=() if one in SHORT else pytest.mark.long) for one in ATTACKS],
)
def test_withstands(target: Target, attack: Callable[[Target], Answers]) -> None:
    answers, cost = measured(target, attack)
    assert {answer.status_code for answer in answers} <= ATTACKS[attack], answers[-1].text
    assert cost.server < SERVER
    assert cost.child < READ + UNSEEN
    assert longest_step(target.data) < LONGEST_STEP
