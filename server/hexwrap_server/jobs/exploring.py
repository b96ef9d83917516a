"""An exploration: one job that looks at many variants and has the promising ones solved.

It takes no worker itself. Its steps are calls of the engine, as any job's; the variants that are worth it are
ordinary works, known by what they are. Whoever sends one of their requests later finds it finished, and an
exploration that is taken up again after the server was down finds those that it had.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any, Protocol

from hexwrap_server.errors import ShuttingDownError
from hexwrap_server.input.requests import CacheSettings, Order, Outcome
from hexwrap_server.jobs.store import Work
from hexwrap_solver.errors import HexwrapError

#: Where the parts of the work begin, as shares of the whole.
LOOKING, SOLVING = 0.02, 0.5
STEPS = "hexwrap_server.jobs.explore:"


class Hands(Protocol):
    """What an exploration needs of the server."""

    @property
    def caching(self) -> CacheSettings: ...

    @property
    def at_once(self) -> int:
        """How many calls can run at once."""
        ...

    async def call(self, function: str, *arguments: Any) -> Any:
        """In a worker."""
        ...

    @property
    def errand(self) -> Callable[..., Awaitable[Any]]:
        """Has something short done on this machine, which sees the solutions."""
        ...

    async def solved(self, work: Work) -> str:
        """Where the solution of a work is, when it is finished. Raises what the work ended with."""
        ...


async def explore(
    hands: Hands,
    order: Order,
    name: str,
    identify: Callable[[Any], Work],
    report: Callable[[str, float], None],
    found: Callable[[int, dict[str, Any]], None],
) -> Outcome:
    """report: stage and share of the whole. found: number of a variant and its document, when it is foreseen
    and again when it is measured. Raises HexwrapError."""
    report("plan", 0.0)
    groups = await hands.call(STEPS + "plan", order, hands.caching)
    done = 0

    async def look(group: Any) -> Any:
        nonlocal done
        seen = await hands.call(STEPS + "look", order, hands.caching, group)
        done += 1
        report("foresee", LOOKING + (SOLVING - LOOKING) * done / len(groups))
        return seen

    report("foresee", LOOKING)
    looks = await _at_most(hands.at_once, [partial(look, group) for group in groups])
    candidates = [one for seen in looks for one in seen]
    documents, picked, refused = await hands.errand(STEPS + "begin", order, name, candidates)
    for i, document in enumerate(documents):
        found(i, document)
    done = 0

    async def measure(i: int, wanted: Any) -> None:
        nonlocal done
        try:
            path = await hands.solved(identify(wanted))
            documents[i] |= {"measured": await hands.errand(STEPS + "tell", path, order)}
        except ShuttingDownError:
            raise
        except HexwrapError as error:
            documents[i] |= {"problem": error.detail}
        done += 1
        report("solve", SOLVING + (1 - SOLVING) * done / len(picked))
        found(i, documents[i])

    report("solve", SOLVING)
    await _at_most(hands.at_once, [partial(measure, i, wanted) for i, wanted in picked])
    outcome: Outcome = await hands.errand(STEPS + "finish", order, documents, refused)
    return outcome


async def _at_most(number: int, calls: list[Callable[[], Awaitable[Any]]]) -> list[Any]:
    """What they answer, in their order, this many at once. The first error ends all."""
    places = asyncio.Semaphore(max(number, 1))

    async def placed(call: Callable[[], Awaitable[Any]]) -> Any:
        async with places:
            return await call()

    try:
        async with asyncio.TaskGroup() as together:
            tasks = [together.create_task(placed(call)) for call in calls]
    except BaseExceptionGroup as errors:
        raise errors.exceptions[0] from None
    return [task.result() for task in tasks]
