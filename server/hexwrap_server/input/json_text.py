"""JSON text → document, with the place of a number that JSON cannot hold."""

from __future__ import annotations

import codecs
import gc
import json
import sys

import orjson

from hexwrap_server.errors import FormError, NotJsonError
from hexwrap_server.input.faults import pointer
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
        steps = _not_finite(text)
        if steps is None:
            raise NotJsonError(
                f"The body is not JSON: {error.msg} at line {error.lineno}, column {error.colno}."
            ) from None
        place, detail = pointer(tuple(steps)), "must be a finite number"
        if isinstance(steps[-1], str):
            raise NotJsonError.at(place, detail) from None
        raise FormError.at(place, detail, NonFiniteError) from None
    finally:
        gc.enable()


def _not_finite(text: bytes) -> list[str | int] | None:
    """The steps to the first number that is NaN, infinite or too large for a float.

    None where something else is wrong with the text. Slow, and only for texts that were refused.
    """
    try:
        return _place_of_infinite(json.loads(text)) or None
    except (ValueError, RecursionError):
        return None


def _place_of_infinite(value: object) -> list[str | int] | None:
    """The steps to it; pointers are not written for each list, whose names may be long."""
    pairs = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for step, inner in pairs:
        below = _place_of_infinite(inner)
        if below is not None:
            return [step, *below]
        if isinstance(inner, (int, float)) and not abs(inner) <= sys.float_info.max:
            return [step]
    return None
