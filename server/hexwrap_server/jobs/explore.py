"""The steps of an exploration, as they run in worker processes. Plain, picklable data in and out."""

from __future__ import annotations

import json
from typing import Any, cast

from isal import igzip

from hexwrap_server import logs
from hexwrap_server.input import form
from hexwrap_server.input.requests import CacheSettings, Exploration, Order, Outcome, Wanted
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.cache import CachingRunner
from hexwrap_server.jobs.work import outcome_of, sent_surface_of, solution_at, stages, take_in
from hexwrap_server.jobs.worker import Report
from hexwrap_server.output import explored
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.explore.foresee import Seats, default_edge, foresee, measured, seated
from hexwrap_solver.explore.front import MOST_SOLVED, to_solve
from hexwrap_solver.explore.types import Figures
from hexwrap_solver.explore.variants import Variant, variants
from hexwrap_solver.pipeline import SolveSettings

Json = dict[str, Any]
#: Variants that share a map.
Part = tuple[Seats, tuple[Variant, ...]]


def plan(report: Report, order: Order, caching: CacheSettings) -> list[Variant]:
    """What is to be tried, in this order. Raises HexwrapError where the surface cannot be used."""
    logs.at_work_for(order.job)
    asked = _asked(order)
    runner = CachingRunner(stages(caching), report)
    source = (order.surface_id, asked.surface)
    edge = default_edge(lambda: take_in(sent_surface_of(order), asked.surface), asked, runner, source)
    return variants(asked, edge)


def seat(report: Report, order: Order, caching: CacheSettings, listed: list[Variant]) -> list[Part]:
    """Variants of one frame, those that share a map together. Raises HexwrapError."""
    logs.at_work_for(order.job)
    asked, cache = _asked(order), stages(caching)
    source = (order.surface_id, asked.surface)
    runner = CachingRunner(cache, report)
    found = seated(lambda: take_in(sent_surface_of(order), asked.surface), asked, listed, runner, source)
    cache.weigh()
    return found


def look(
    report: Report, order: Order, caching: CacheSettings, name: str, part: Part
) -> list[Json | HexwrapError]:
    """What variants that share a map will come to, as the wire says it, or why one cannot be made."""
    logs.at_work_for(order.job)
    asked, cache = _asked(order), stages(caching)
    source = (order.surface_id, asked.surface)
    runner = CachingRunner(cache, report)
    found = foresee(
        lambda: take_in(sent_surface_of(order), asked.surface), asked, *part, runner, source=source
    )
    cache.weigh()
    return [
        one.foreseen
        if isinstance(one.foreseen, HexwrapError)
        else explored.variant(_request(one.settings, name, order.surface_id, asked), one.foreseen)
        for one in found
    ]


def pick(report: Report, order: Order, documents: list[Json]) -> list[tuple[int, Wanted]]:
    """Which variants are worth solving next, index and what is wanted: none when one of those that were
    solved keeps the limits, or too many are."""
    asked = _asked(order)
    tried = [one for one in documents if one["measured"] or one["problem"]]
    if any(one["measured"] and not explored.beyond(one, asked.limits) for one in tried):
        return []
    left = [i for i, one in enumerate(documents) if not (one["measured"] or one["problem"])]
    figures = [Figures(**documents[i]["predicted"]) for i in left]
    picked = to_solve(
        figures, [explored.beyond(documents[i], asked.limits) for i in left], MOST_SOLVED - len(tried)
    )
    wanted = []
    for i in (left[p] for p in picked):
        # exactly as somebody who sends it would be understood
        read = parse_request(documents[i]["request"], asked.max_vertices, asked.max_panels).wanted
        assert isinstance(read, Wanted)
        wanted.append((i, read))
    return wanted


def tell(report: Report, path: str, order: Order) -> Json:
    """What a variant came to, from its solution. Raises GoneError, StorageError."""
    return explored.figures(measured(solution_at(path), _asked(order)))


def finish(report: Report, order: Order, documents: list[Json], refused: list[str]) -> Outcome:
    """The result, its front and what is proposed. documents: of all variants, those that were solved with
    what was measured, or the problem. refused: why others cannot be made."""
    document = explored.summary(documents, _asked(order).limits, refused)
    return outcome_of(order, [igzip.compress(explored.result_json(document))], [explored.packed(document)])


def write_table(report: Report, path: str) -> bytes:
    """``explore.csv``. Raises GoneError, StorageError."""
    return explored.explore_csv(json.loads(cast(dict[str, Any], solution_at(path))["explored"]))


def _asked(order: Order) -> Exploration:
    assert isinstance(order.wanted, Exploration)
    return order.wanted


def _request(settings: SolveSettings, name: str, surface: str, asked: Exploration) -> Json:
    beside = {} if asked.surface is None else form.document(asked.surface)
    return {"name": name, "surface": {"id": surface} | beside, **form.document(settings)}
