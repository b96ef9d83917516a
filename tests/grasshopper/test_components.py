"""Every component, run for real: under CPython and Jython 2.7, from the built files, on a headless canvas.

The scenarios themselves stand in ``headless/scenarios_*.py``, which both interpreters can read.
"""

from collections.abc import Callable
from pathlib import Path

import pytest

Runner = Callable[[str, dict[str, str]], None]


def test_settings(run_scenarios: Runner) -> None:
    run_scenarios("scenarios_settings", {})


@pytest.mark.parametrize(
    "run_scenarios", ["jython", pytest.param("cpython", marks=pytest.mark.long)], indirect=True
)
def test_against_a_live_server(run_scenarios: Runner, server_port: int) -> None:
    run_scenarios("scenarios_solve", {"HEXWRAP_PORT": str(server_port)})


@pytest.mark.parametrize(
    "run_scenarios", ["cpython", pytest.param("jython", marks=pytest.mark.long)], indirect=True
)
def test_examples_as_wired(run_scenarios: Runner, server_port: int, sample_meshes: Path) -> None:
    run_scenarios(
        "scenarios_examples", {"HEXWRAP_PORT": str(server_port), "HEXWRAP_MESHES": str(sample_meshes)}
    )


@pytest.mark.parametrize(
    "run_scenarios", ["jython", pytest.param("cpython", marks=pytest.mark.long)], indirect=True
)
def test_servers_in_trouble(run_scenarios: Runner, server_port: int) -> None:
    run_scenarios("scenarios_trouble", {"HEXWRAP_PORT": str(server_port)})
