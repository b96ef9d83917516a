"""The OpenAPI document, and ``/docs``: the same as a page for people, with nothing loaded from elsewhere."""

from __future__ import annotations

import asyncio
import json
from html import escape
from threading import Lock
from typing import Any

from fastapi import FastAPI, Request
from fastapi.utils import deep_dict_update
from starlette.responses import HTMLResponse, JSONResponse, Response

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 3rem auto; padding: 0 1.5rem; }
h1 { font-weight: 600; } h2 { font: 600 1rem/1.4 ui-monospace, monospace; margin: 2.2rem 0 .2rem; }
h2 b { display: inline-block; min-width: 4.5rem; color: #2f77a8; } p { margin: .2rem 0; }
table { border-collapse: collapse; margin: .4rem 0; } td { padding: .15rem 1.2rem .15rem 0; }
code, pre, td:first-child { font: .85rem/1.45 ui-monospace, monospace; } summary { cursor: pointer; }
pre { background: #f4f5f8; padding: 1rem; overflow: auto; max-height: 32rem; }
"""


class DocumentedApp(FastAPI):
    """Describes its routes when it is asked to: the schemas take half a second, which no start waits for."""

    _describing = Lock()

    def openapi(self) -> dict[str, Any]:
        with self._describing:
            if self.openapi_schema is None:
                from hexwrap_server.http.openapi import OPERATIONS

                for path, operations in super().openapi()["paths"].items():
                    for method, operation in operations.items():
                        deep_dict_update(operation, OPERATIONS[f"{method.upper()} {path}"])
            return super().openapi()


def add_docs(app: DocumentedApp) -> None:
    """Serves the document and the page; it is made beside the event loop."""

    @app.get("/openapi.json", include_in_schema=False)
    async def document(request: Request) -> Response:
        return JSONResponse(await asyncio.to_thread(app.openapi))

    @app.get("/docs", include_in_schema=False)
    async def docs(request: Request) -> Response:
        policy = {"Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'"}
        return HTMLResponse(page(await asyncio.to_thread(app.openapi)), headers=policy)


def page(document: dict[str, Any]) -> str:
    """The document as HTML."""
    title = f"{document['info']['title']} {document['info']['version']}"
    routes = "".join(
        _route(method, path, operation)
        for path, operations in document["paths"].items()
        for method, operation in operations.items()
    )
    return (
        f'<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{STYLE}</style><h1>{escape(title)}</h1><p>{escape(document['info'].get('summary', ''))}</p>"
        f'<p>For programs: <a href="/openapi.json">openapi.json</a></p>{routes}</html>'
    )


def _route(method: str, path: str, operation: dict[str, Any]) -> str:
    rows = "".join(
        _row(p["name"], p.get("description", ""), p["in"]) for p in operation.get("parameters", [])
    )
    answers = ", ".join(sorted(operation["responses"]))
    body = "".join(
        f"<details><summary>Body, {escape(kind)}</summary><pre>{_pretty(content['schema'])}</pre></details>"
        for kind, content in operation.get("requestBody", {}).get("content", {}).items()
    )
    return (
        f"<h2><b>{method.upper()}</b> {escape(path)}</h2><p>{escape(operation.get('description', ''))}</p>"
        f"<table>{rows}</table>{body}<p>Answers: {escape(answers)}</p>"
    )


def _row(*cells: str) -> str:
    return "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"


def _pretty(schema: dict[str, Any]) -> str:
    return escape(json.dumps(schema, indent=1, ensure_ascii=False))
