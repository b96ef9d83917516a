"""JSON text → document, with the place of a number that JSON cannot hold."""

from __future__ import annotations

import codecs
import gc
import json
import sys
from typing import Any

import orjson

from hexwrap_server.errors import FormError, NotJsonError
from hexwrap_server.input.faults import escaped
from hexwrap_solver.surface.errors import NonFiniteError


def loads(text: bytes) -> object:
    """The document.

    A byte order mark, which some editors put first, is passed over. Raises FormError where the text is not
    JSON, or holds a number that no float is.
    """
    text = text.removeprefix(codecs.BOM_UTF8)
    gc.disable()  # a body of a million numbers holds no cycles, but sets off many searches for them
    try:
        return orjson.loads(text)
    except orjson.JSONDecodeError as error:
        place = _not_finite(text)
        if place is not None:
            raise FormError.at(place, "must be a finite number", NonFiniteError) from None
        raise NotJsonError(
            f"The body is not JSON: {error.msg} at line {error.lineno}, column {error.colno}."
        ) from None
    finally:
        gc.enable()


def _not_finite(text: bytes) -> str | None:
    """JSON pointer to the first entry of a list that is NaN, infinite or too large for a float.

    None where something else is wrong with the text. Slow, and only for texts that were refused.
    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return None
    at: list[object] = []  # the steps to the list or object that is looked at
    todo: list[tuple[int, object, Any]] = [(0, None, document)]
    while todo:
        depth, step, value = todo.pop()
        at[depth:] = [step]
        if isinstance(value, dict):
            todo += [(depth + 1, name, inner) for name, inner in value.items()][::-1]
        elif isinstance(value, list):
            for i, entry in enumerate(value):
                if isinstance(entry, (int, float)) and not abs(entry) <= sys.float_info.max:
                    return "".join(f"/{escaped(str(step))}" for step in [*at[1:], i])
            todo += [(depth + 1, i, row) for i, row in enumerate(value) if isinstance(row, (list, dict))][
                ::-1
            ]
    return None
