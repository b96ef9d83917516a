"""Pages of the documentation site that are made from the code: ``mkdocs build`` calls ``on_files``."""

from __future__ import annotations

import argparse
import ast
import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("solver/hexwrap_solver", "server/hexwrap_server")


def on_files(files: Any, config: Any) -> Any:
    """Adds the reference."""
    from mkdocs.structure.files import File

    for name, made in pages().items():
        files.append(File.generated(config, f"reference/{name}", content=made))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Links to the source, which lies outside the site, become plain words."""
    if "/" in page.file.src_uri:
        return markdown
    return re.sub(r"\[([^\]]*)\]\(\.\./[^)]*\)", r"\1", markdown)


def pages() -> dict[str, str]:
    """File name → Markdown."""
    return {
        "command-line.md": command_line(),
        "http.md": http(),
        "components.md": components(),
        "modules.md": modules(),
    }


def command_line() -> str:
    """What ``--help`` says, of the program and of each of its commands."""
    from hexwrap_server.cli.main import make_parser

    parser = make_parser()
    lines = ["# Command line", "", "```text", parser.format_help().rstrip(), "```"]
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, command in action.choices.items():
                lines += ["", f"## hexwrap {name}", "", "```text", command.format_help().rstrip(), "```"]
    return "\n".join(lines) + "\n"


def http() -> str:
    """Every route, from the service's own OpenAPI."""
    from hexwrap_server.http.app import create_app
    from hexwrap_server.settings import Settings

    described = create_app(Settings()).openapi()
    lines = [
        "# HTTP routes",
        "",
        "The service's own description is at `/openapi.json`, to try at `/docs`.",
        "",
    ]
    lines += ["| route | what it does | in the address |", "|---|---|---|"]
    for path, methods in described["paths"].items():
        for method, route in methods.items():
            words = (route.get("description") or route.get("summary") or "").split("\n\n")[0]
            asked = [p["name"] for p in route.get("parameters", []) if p["in"] == "query"]
            told = ", ".join(f"`{name}`" for name in asked)
            lines.append(f"| `{method.upper()} {path}` | {' '.join(words.split())} | {told} |")
    return "\n".join(lines) + "\n"


def components() -> str:
    """The Grasshopper components with their inputs and outputs, from their metadata."""
    lines = ["# Grasshopper components", ""]
    for path in sorted((ROOT / "grasshopper" / "src").glob("*/metadata.json")):
        described = json.loads(path.read_text(encoding="utf-8"))
        lines += [f"## {described['nickname']}", "", described["description"], ""]
        lines += ["| | name | what |", "|---|---|---|"]
        for side, key in (("in", "inputParameters"), ("out", "outputParameters")):
            for spec in described["ghpython"][key]:
                lines.append(f"| {side} | {spec['name']} | {spec['description']} |")
        lines.append("")
    return "\n".join(lines)


def modules() -> str:
    """Each module of solver and server with the first sentence of its docstring."""
    lines = ["# Modules", ""]
    for package in PACKAGES:
        lines += [f"## {package}", "", "| module | what it is |", "|---|---|"]
        for path in sorted((ROOT / package).rglob("*.py")):
            words = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n\n")[0]
            if words:
                name = path.relative_to(ROOT / package).as_posix()
                lines.append(f"| `{name}` | {' '.join(words.split())} |")
        lines.append("")
    return "\n".join(lines)
