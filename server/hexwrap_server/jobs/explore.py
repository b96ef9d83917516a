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
from hexwrap_solver.errors import RequestError
from hexwrap_solver.explore.foresee import Candidate, default_edge, foresee, measured
from hexwrap_solver.explore.front import NEARLY, to_solve, within
from hexwrap_solver.explore.types import Figures
from hexwrap_solver.explore.variants import Variant, variants
from hexwrap_solver.pipeline import SolveSettings

Json = dict[str, Any]


def plan(report: Report, order: Order, caching: CacheSettings) -> list[tuple[Variant, ...]]:
    """The variants, those of one frame together. Raises HexwrapError where the surface cannot be used."""
    logs.at_work_for(order.job)
    asked = _asked(order)
    runner = CachingRunner(stages(caching), report)
    source = (order.surface_id, asked.surface)
    edge = default_edge(lambda: take_in(sent_surface_of(order), asked.surface), asked, runner, source)
    groups: dict[Any, list[Variant]] = {}
    for variant in variants(asked, edge):
        groups.setdefault(variant.frame, []).append(variant)
    return [tuple(group) for group in groups.values()]


def look(
    report: Report, order: Order, caching: CacheSettings, listed: tuple[Variant, ...]
) -> tuple[Candidate, ...]:
    """What the variants of one frame will come to. Raises HexwrapError."""
    logs.at_work_for(order.job)
    asked = _asked(order)
    cache = stages(caching)
    found = foresee(
        lambda: take_in(sent_surface_of(order), asked.surface),
        asked,
        listed,
        lambda: CachingRunner(cache, report),
        source=(order.surface_id, asked.surface),
    )
    cache.weigh()
    return found


def begin(
    report: Report, order: Order, name: str, candidates: list[Candidate]
) -> tuple[list[Json], list[tuple[int, Wanted]], list[str]]:
    """The variants as the wire says them, which are worth solving (index and what is wanted), and why others
    cannot be made.

    Those that cannot be made are left out, and of those that come to the same request, all but one; of the
    others as many are taken as were asked for. Raises RequestError where nothing is left.
    """
    asked = _asked(order)
    listed: dict[str, tuple[Json, Candidate]] = {}
    refused = []
    for one in sorted(candidates, key=lambda one: one.place):
        if len(listed) == asked.variants:
            break
        if one.foreseen is None:
            refused.append(one.problem)
            continue
        request = _request(one.settings, name, order.surface_id, asked)
        listed.setdefault(json.dumps(request), (explored.variant(request, one.foreseen), one))
    if not listed:
        raise RequestError(f"None of the {len(candidates)} variants can be made: {candidates[0].problem}")
    documents = [document for document, _ in listed.values()]
    known = [(i, one) for i, (_, one) in enumerate(listed.values())]
    kept = [(i, one) for i, one in known if within(_figures(one), asked.limits, _sizes(one), NEARLY)] or known
    picked = to_solve([_figures(one) for _, one in kept])
    wanted = []
    for i in (kept[p][0] for p in picked):
        # exactly as somebody who sends it would be understood
        read = parse_request(documents[i]["request"], asked.max_vertices, asked.max_panels).wanted
        assert isinstance(read, Wanted)
        wanted.append((i, read))
    return documents, wanted, refused


def tell(report: Report, path: str, order: Order) -> Json:
    """What a variant came to, from its solution. Raises GoneError, StorageError."""
    return explored.figures(measured(solution_at(path), _asked(order)))


def finish(report: Report, order: Order, documents: list[Json], refused: list[str]) -> Outcome:
    """The result, its front and what is proposed. documents: of all variants, those that were solved with
    what was measured, or the problem. refused: why others cannot be made."""
    document = explored.summary(documents, _asked(order).limits, refused)
    return outcome_of(order, igzip.compress(explored.result_json(document)), [explored.packed(document)])


def write_table(report: Report, path: str) -> bytes:
    """``explore.csv``. Raises GoneError, StorageError."""
    return explored.explore_csv(json.loads(cast(dict[str, Any], solution_at(path))["explored"]))


def _asked(order: Order) -> Exploration:
    assert isinstance(order.wanted, Exploration)
    return order.wanted


def _figures(one: Candidate) -> Figures:
    assert one.foreseen is not None
    return one.foreseen


def _sizes(one: Candidate) -> int | None:
    assert one.settings.panels is not None
    sizes = one.settings.panels.sizes
    return sizes if isinstance(sizes, int) else None


def _request(settings: SolveSettings, name: str, surface: str, asked: Exploration) -> Json:
    beside = {} if asked.surface is None else form.document(asked.surface)
    return {"name": name, "surface": {"id": surface} | beside, **form.document(settings)}
