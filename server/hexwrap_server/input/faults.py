"""What is wrong with the form of a request, in words: what was sent, and what would be right."""

from __future__ import annotations

import json
from collections.abc import Iterator
from difflib import get_close_matches
from functools import cache
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from hexwrap_server.errors import MOST_LISTED

#: Steps from the body to a field of it.
Path = tuple[str, ...]
#: Longer texts are not shown in problems.
MOST_SHOWN = 60


def pointer(path: tuple[str | int, ...]) -> str:
    """The JSON pointer of a path."""
    return "".join(f"/{escaped(str(step))}" for step in path)


def escaped(step: str) -> str:
    """A name as a step of a JSON pointer."""
    return step.replace("~", "~0").replace("/", "~1")


def faults(model: type[BaseModel], given: object, root: str, error: ValidationError) -> list[tuple[str, str]]:
    """Pointer and sentence of each fault; what the members of a union say of one value is one fault."""
    places: dict[str, list[ErrorDetails]] = {}
    for e in error.errors(include_url=False, include_context=False):
        places.setdefault(root + _place(given, e["loc"], e["type"]), []).append(e)
    return [
        (place, _sentence(model, found) if i < MOST_LISTED else found[0]["msg"])
        for i, (place, found) in enumerate(places.items())
    ]


def _sentence(model: type[BaseModel], errors: list[ErrorDetails]) -> str:
    """What is wrong, what was sent, and what would be right."""
    error = errors[0]
    if error["type"] == "extra_forbidden":
        return _unknown(model, error["loc"])
    first, *others = dict.fromkeys(_message(e) for e in errors)
    text = ", or ".join([first, *(other.removeprefix("Input should be ") for other in others)])
    sent = error["input"]
    if sent is not None and not isinstance(sent, (bool, int, float, str)):
        return text
    shown = json.dumps(sent, ensure_ascii=False)
    return f"{text}, not {shown}" if len(shown) <= MOST_SHOWN else text


def _message(error: ErrorDetails) -> str:
    if error["type"] == "model_type":
        return "Input should be an object"
    return error["msg"].removeprefix("Value error, ")


def _unknown(model: type[BaseModel], place: tuple[int | str, ...]) -> str:
    """A field that does not exist; but perhaps elsewhere, or under a name like it."""
    *above, name = (str(step) for step in place)
    sections = _sections(model)
    here = sections.get(tuple(step for step in above if not step.isdigit()), model)
    text = f"unknown field; known here: {', '.join(repr(known) for known in here.model_fields)}"
    homes = ["/".join(("", *path)) for path, section in sections.items() if name in section.model_fields]
    like = get_close_matches(name, here.model_fields, 1)
    if homes:
        return f"{text}; '{name}' belongs to {' or '.join(home or 'the body itself' for home in homes)}"
    return f"{text}; did you mean '{like[0]}'?" if like else text


@cache
def _sections(model: type[BaseModel]) -> dict[Path, type[BaseModel]]:
    """The model, and those of its fields that are models themselves or lists of them, by their paths."""
    found: dict[Path, type[BaseModel]] = {(): model}
    for name, field in model.model_fields.items():
        for kind in _kinds(field.annotation):
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                found |= {(name, *path): section for path, section in _sections(kind).items()}
    return found


def _kinds(annotation: Any) -> Iterator[Any]:
    """The types that an annotation is made of."""
    parts = get_args(annotation)
    if parts:
        for part in parts:
            yield from _kinds(part)
    else:
        yield annotation


def _place(given: object, place: tuple[int | str, ...], kind: str) -> str:
    """pydantic names the branches of unions in its paths; a JSON pointer holds only what was sent."""
    steps: list[str | int] = []
    at: Any = given
    for i, step in enumerate(place):
        try:
            at = at[step]
        except (KeyError, IndexError, TypeError):
            if not (kind == "missing" and i == len(place) - 1):
                continue
        steps.append(step)
    return pointer(tuple(steps))
