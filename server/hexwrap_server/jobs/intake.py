"""A request that is read here: its surface is on disk before anybody hears of it."""

from __future__ import annotations

from hexwrap_server.input.json_text import read_request
from hexwrap_server.input.requests import ParsedRequest
from hexwrap_server.jobs.engine import nobody
from hexwrap_server.jobs.store import Store


def read_and_keep(store: Store, text: bytes, max_vertices: int, max_panels: int) -> ParsedRequest:
    """JSON → request, in one go: each change of threads takes as long as writing the surface.

    Raises FormError, StorageError.
    """
    parsed = read_request(nobody, text, max_vertices, max_panels)
    keep(store, parsed)
    return parsed


def keep(store: Store, parsed: ParsedRequest) -> None:
    """Write the surface, where the request has one of its own. Raises StorageError."""
    if parsed.surface is not None:
        store.keep_surface(parsed.surface_id, parsed.surface)
