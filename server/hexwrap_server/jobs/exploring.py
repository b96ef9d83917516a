"""An exploration: one job that looks at many variants and has the promising ones solved.

It takes no worker itself. Its steps are calls of the engine, as any job's; the variants that are worth it are
ordinary works, known by what they are. Whoever sends one of their requests later finds it finished, and an
exploration that is taken up again after the server was down finds those that it had. Variants are told and
numbered as they are foreseen, in an order that does not depend on which worker is the faster.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncGenerator, Awaitable, Callable, Coroutine
from contextlib import aclosing
from functools import partial
from typing import Any, Protocol

from hexwrap_server.errors import ShuttingDownError
from hexwrap_server.input.requests import CacheSettings, Exploration, Order, Outcome
from hexwrap_server.jobs.store import Work
from hexwrap_server.problems import place_of
from hexwrap_solver.errors import HexwrapError

#: Where the parts of the work begin, as shares of the whole.
LOOKING, SOLVING = 0.02, 0.5
STEPS = "hexwrap_server.jobs.explore:"
Calls = dict[tuple[int, ...], Callable[[], Coroutine[Any, Any, Any]]]


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
    assert isinstance(order.wanted, Exploration)
    planned = await hands.call(STEPS + "plan", order, hands.caching)
    wanted = min(order.wanted.variants, len(planned))
    documents: list[dict[str, Any]] = []
    known: set[str] = set()
    refused: list[HexwrapError] = []
    report("foresee", LOOKING)
    # Of those that come to the same request one is kept; for the others, and for those that cannot be made,
    # there are the next ones.
    while planned and len(documents) < wanted:
        missing = wanted - len(documents)
        listed, planned = planned[:missing], planned[missing:]
        async with aclosing(_foreseen(hands, order, name, listed)) as seen:
            async for one in seen:
                if isinstance(one, HexwrapError):
                    refused.append(one)
                    continue
                request = json.dumps(one["request"])
                if request in known:
                    continue
                known.add(request)
                documents.append(one)
                report("foresee", LOOKING + (SOLVING - LOOKING) * len(documents) / wanted)
                found(len(documents) - 1, one)
    if not documents:
        error = refused[0].reworded(f"None of the {len(refused)} variants can be made: {refused[0].detail}")
        place = place_of(error) or "/vary"
        vars(error)["place"] = place.replace("/boundary", "/vary/boundary", 1)  # where an exploration has it
        raise error
    share = done = expected = 0.0

    async def measure(i: int, wanted: Any) -> None:
        nonlocal share, done
        try:
            path = await hands.solved(identify(wanted))
            documents[i] = documents[i] | {"measured": await hands.errand(STEPS + "tell", path, order)}
        except ShuttingDownError:
            raise
        except HexwrapError as error:
            documents[i] = documents[i] | {"problem": error.detail}
        done += 1
        share = max(share, done / expected)
        report("solve", SOLVING + (1 - SOLVING) * share)
        found(i, documents[i])

    report("solve", SOLVING)
    while picked := await hands.errand(STEPS + "pick", order, documents):
        expected += len(picked)
        calls: Calls = {(i,): partial(measure, i, one) for i, one in picked}
        async with aclosing(_in_order(hands.at_once, calls)) as answers:
            async for _ in answers:
                pass
    outcome: Outcome = await hands.errand(
        STEPS + "finish", order, documents, [error.detail for error in refused]
    )
    return outcome


async def _foreseen(hands: Hands, order: Order, name: str, listed: list[Any]) -> AsyncGenerator[Any]:
    """Documents of variants, or why one cannot be made: first of those without singularities, which need no
    search for their places, then frame by frame and by the number of singularities."""
    frames: dict[Any, list[Any]] = {}
    for variant in listed:
        frames.setdefault(variant.frame, []).append(variant)
    calls: Calls = {}

    async def look(part: Any) -> Any:
        return await hands.call(STEPS + "look", order, hands.caching, name, part)

    async def seat(k: int, some: list[Any]) -> Any:
        for i, part in enumerate(await hands.call(STEPS + "seat", order, hands.caching, some)):
            calls[1, k, i] = partial(look, part)
        return []

    for k, variants in enumerate(frames.values()):
        plain = tuple(one for one in variants if not one.singularities)
        others = [one for one in variants if one.singularities]
        if plain:
            calls[0, k] = partial(look, ((), plain))
        if others:
            calls[1, k] = partial(seat, k, others)
    async with aclosing(_in_order(hands.at_once, calls)) as answers:
        async for some in answers:
            for one in some:
                yield one


async def _in_order(number: int, calls: Calls) -> AsyncGenerator[Any]:
    """What calls answer, this many at once, in the order of their keys: each as soon as those before it are
    there. A call may add others, whose keys come after its own. The first error ends all."""
    running: dict[asyncio.Task[Any], tuple[int, ...]] = {}
    answers: dict[tuple[int, ...], Any] = {}
    try:
        while calls or running:
            while calls and len(running) < max(number, 1):
                key = min(calls)
                running[asyncio.create_task(calls.pop(key)())] = key
            ended, _ = await asyncio.wait(running, return_when=asyncio.FIRST_COMPLETED)
            for task in ended:
                answers[running[task]] = task.result()
                del running[task]
            missing = min((*calls, *running.values()), default=None)
            for key in sorted(answers):
                if missing is None or key < missing:
                    yield answers.pop(key)
    finally:
        for task in running:
            task.cancel()
        await asyncio.gather(*running, return_exceptions=True)
