"""What the README says is so: its commands, options, links and pictures."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from hexwrap_server import samples
from hexwrap_server.cli.main import make_parser
from hexwrap_server.cli.options import table
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.work import run_stages
from hexwrap_server.output.writers import WRITERS
from hexwrap_solver.pipeline import PlainRunner

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
COMMANDS = [line for block in BLOCKS for line in block.splitlines() if line.startswith("hexwrap ")]
COMMANDS += [c for c in re.findall(r"`(hexwrap [^`]*)`", README) if " -o " in c or "--sample" in c]


def test_the_test_command_is_the_one_that_ci_runs() -> None:
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert f"`{ci[-1]}`" in README


def test_every_option_is_in_the_table() -> None:
    assert table() in README


def test_every_file_and_sample_is_named() -> None:
    assert all(f"`{name}`" in README for name in WRITERS)
    listed = re.search("<!-- samples -->(.*)<!-- end of samples -->", README)
    assert listed is not None
    assert listed[1] == ", ".join(f"`{name}`" for name in samples.names())


@pytest.mark.parametrize("command", COMMANDS)
def test_documented_commands_are_understood(command: str) -> None:
    words = shlex.split(command.removesuffix("&"))
    assert make_parser().parse_args(words[1:]).command


def test_links_and_pictures_exist() -> None:
    targets = re.findall(r'\]\(([^)]+)\)|src="([^"]+)"', README)
    local = [target for pair in targets for target in pair if target and not target.startswith("http")]
    assert len(local) > 10
    assert [target for target in local if not (ROOT / target).exists()] == []


def test_the_curl_example_is_solved() -> None:
    body = re.search(r"/v1/solve -o result.json -d '(\{.*?\})'", README, re.DOTALL)
    assert body is not None
    request = parse_request(json.loads(body[1]), 10**6, 10**6)
    assert not isinstance(request.surface, str)
    solution = run_stages(request.surface, request.wanted, PlainRunner())
    assert solution.panels is not None
    assert len(solution.panels.class_length) <= 5
    assert solution.quality.overlaps == 0
