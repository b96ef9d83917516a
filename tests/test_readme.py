"""What the README and the pages in docs say is so: commands, tables, links and pictures."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from docs import tables
from hexwrap_server.cli.main import make_parser
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.work import run_stages
from hexwrap_server.output.writers import WRITERS
from hexwrap_solver.pipeline import PlainRunner

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = {
    path: path.read_text(encoding="utf-8") for path in (ROOT / "README.md", *(ROOT / "docs").glob("*.md"))
}
SAID = "\n".join(PAGES.values())
BLOCKS = re.findall(r"^```\n(.*?)^```", SAID, re.MULTILINE | re.DOTALL)
COMMANDS = [line for block in BLOCKS for line in block.splitlines() if line.startswith("hexwrap ")]
COMMANDS += [c for c in re.findall(r"`(hexwrap [^`]*)`", SAID) if " -o " in c or "--sample" in c]


def test_the_test_command_is_the_one_that_ci_runs() -> None:
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert f"`{ci[-1]}`" in README


@pytest.mark.parametrize("name", tables.TABLES)
def test_tables_are_made_from_the_code(name: str) -> None:
    assert (ROOT / name).read_text(encoding="utf-8") == tables.filled(name), "run python docs/tables.py"


def test_every_file_is_named() -> None:
    page = PAGES[ROOT / "docs" / "files.md"]
    assert all(f"`{name}`" in page for name in WRITERS)


def test_the_readme_leads_to_every_page_and_is_short() -> None:
    assert all(f"docs/{path.name}" in README for path in PAGES if path.parent.name == "docs")
    assert len(README.splitlines()) < 120


@pytest.mark.parametrize("command", COMMANDS)
def test_documented_commands_are_understood(command: str) -> None:
    words = shlex.split(command.removesuffix("&"))
    assert make_parser().parse_args(words[1:]).command


def test_links_and_pictures_exist() -> None:
    found = [
        (path, target)
        for path, text in PAGES.items()
        for pair in re.findall(r'\]\(([^)]+)\)|src="([^"]+)"', text)
        for target in pair
        if target and not target.startswith("http")
    ]
    assert len(found) > 10
    assert [target for path, target in found if not (path.parent / target).exists()] == []


def test_the_curl_example_is_solved() -> None:
    body = re.search(r"/v1/solve -o result.json -d '(\{.*?\})'", README, re.DOTALL)
    assert body is not None
    request = parse_request(json.loads(body[1]), 10**6, 10**6)
    assert not isinstance(request.surface, str)
    solution = run_stages(request.surface, request.wanted, PlainRunner())
    assert solution.panels is not None
    assert solution.panels.n_sizes <= 5
    assert solution.quality.overlaps == 0
