"""JSON Schema in few words, for what OpenAPI says."""

from __future__ import annotations

from typing import Any


def listed(items: dict[str, Any], length: int | None = None) -> dict[str, Any]:
    """A list of such items."""
    sized = {"minItems": length, "maxItems": length} if length is not None else {}
    return {"type": "array", "items": items} | sized


def record(required: tuple[str, ...] = (), more: bool = True, **properties: Any) -> dict[str, Any]:
    """An object. more: whether it may have properties that are not named here."""
    closed = {} if more else {"additionalProperties": False}
    return {"type": "object", "properties": properties, "required": list(required)} | closed


def nullable(schema: dict[str, Any]) -> dict[str, Any]:
    return {"anyOf": [schema, {"type": "null"}]}


NUMBER = {"type": "number"}
POINT = listed(NUMBER, 3)
PLANE = listed(NUMBER, 2)
