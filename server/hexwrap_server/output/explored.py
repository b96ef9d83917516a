"""An exploration as it goes over the wire, and as a table."""

from __future__ import annotations

from typing import Any

import numpy as np
import orjson

from hexwrap_server.jobs import codec
from hexwrap_server.output.text import csv_table
from hexwrap_solver.explore.front import by_cost, excess, front_of, limited
from hexwrap_solver.explore.types import Figures, Limits

Json = dict[str, Any]
#: Columns of ``explore.csv`` after the number of the variant.
CHOICES = ("boundary", "singularities", "kind", "rotation", "around", "edge_length", "sizes", "joint")
FORESEEN = ("uncovered", "panels", "types", "cost", "bare")
MEASURED = (*FORESEEN, "gap_max")


def variant(request: Json, seen: Figures) -> Json:
    """Before anything is measured. problem: why it could not be solved."""
    predicted = {name: getattr(seen, name) for name in FORESEEN}
    return {"request": request, "predicted": predicted, "measured": None, "front": False, "problem": None}


def figures(found: Figures) -> Json:
    return {name: getattr(found, name) for name in MEASURED}


def summary(documents: list[Json], limits: Limits, refused: list[str]) -> Json:
    """The whole result: which are on the front, which one is proposed, and what there is to say. ranking: all
    that were measured, those of the front first; within narrower limits the first that keeps them is to be
    proposed. refused: why further variants cannot be made."""
    solved = [i for i, one in enumerate(documents) if one["measured"] is not None]
    found = {i: Figures(**documents[i]["measured"]) for i in solved}
    over = {i: beyond(documents[i], limits) for i in solved}
    kept = [i for i in solved if not over[i]]
    notes = [f"{_number(len(documents))} foreseen from the map, {len(solved)} of them solved and measured."]
    front = [kept[p] for p in np.flatnonzero(front_of([found[i] for i in kept]))]
    for i in front:
        documents[i]["front"] = True
    others = [i for i in solved if i not in front]
    ranking = [part[p] for part in (front, others) for p in by_cost([found[i] for i in part])]
    best = None
    if front:
        best = ranking[0]
    elif solved:
        best = min(solved, key=over.__getitem__)
        notes.append(_exceeded({i: documents[i] for i in solved}, limits))
    problems = refused + [one["problem"] for one in documents if one["problem"]]
    if problems:
        notes.append(f"{_number(len(problems))} cannot be made. {max(problems, key=problems.count)}")
    return {"variants": documents, "front": front, "best": best, "ranking": ranking, "notes": notes}


def _number(variants: int) -> str:
    return "1 variant" if variants == 1 else f"{variants} variants"


def beyond(document: Json, limits: Limits) -> float:
    """``excess`` of what was measured, or else of what was foreseen."""
    return excess(Figures(**(document["measured"] or document["predicted"])), limits, _sizes(document))


def _sizes(document: Json) -> int:
    return int(document["request"]["panels"]["sizes"])


def _exceeded(solved: dict[int, Json], limits: Limits) -> str:
    """Which limits none of these variants keeps, and how near they come."""
    has = {i: limited(Figures(**one["measured"]), limits, _sizes(one)) for i, one in solved.items()}
    parts = []
    for name in dict.fromkeys(name for pairs in has.values() for name in pairs):
        least, i, most = min((pairs[name][0], i, pairs[name][1]) for i, pairs in has.items() if name in pairs)
        if least > most:
            parts.append(f"{name} is to be {most:.4g} at most, and {least:.4g} is the least (no. {i})")
    said = "; ".join(parts) or "each is kept by some, all by none"
    return f"No variant that was solved keeps all limits: {said}. The one proposed exceeds them least."


def packed(document: Json) -> bytes:
    """The result as a file of the store."""
    return codec.encode({"explored": result_json(document).decode()})


def kept(data: bytes) -> Json:
    """What ``packed`` has written. Raises CodecError."""
    found: Json = orjson.loads(codec.decode(data)["explored"])
    return found


def result_json(document: Json) -> bytes:
    return orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY)


def explore_csv(document: Json) -> bytes:
    """A row per variant: its choices, what was foreseen, what was measured (empty where nothing was)."""
    heads = [f"predicted_{name}" for name in FORESEEN] + [f"measured_{name}" for name in MEASURED]
    rows: list[list[Any]] = [["variant", *CHOICES, *heads, "front", "best", "problem"]]
    for i, one in enumerate(document["variants"]):
        predicted, measured = one["predicted"] or {}, one["measured"] or {}
        rows.append(
            [
                i,
                *choices(one["request"]),
                *(predicted.get(name, "") for name in FORESEEN),
                *("" if measured.get(name) is None else measured[name] for name in MEASURED),
                int(one["front"]),
                int(i == document["best"]),
                one["problem"] or "",
            ]
        )
    return csv_table(rows)


def choices(request: Json) -> list[Any]:
    """As ``CHOICES`` names them; empty text where nothing is asked."""
    pattern, panels = request["pattern"], request["panels"]
    asked = request["singularities"] or {}
    row = [request["boundary"]["mode"], len(asked.get("at", ())), pattern["kind"], pattern["rotation"]]
    row += [pattern["around"], pattern["edge_length"], panels["sizes"], panels["joint"]]
    return ["" if value is None else value for value in row]
