"""Every component, run for real: under CPython and Jython 2.7, from the built files, on a headless canvas.

The scenarios themselves stand in ``headless/scenarios_*.py``, which both interpreters can read.
"""

from collections.abc import Callable
from pathlib import Path

import pytest

Runner = Callable[[list[str], dict[str, str]], None]


@pytest.mark.parametrize(
    ("run_scenarios", "names"),
    [
        ("cpython", ["settings"]),
        ("jython", ["settings", "solve", "trouble"]),
        pytest.param("cpython", ["solve", "trouble"], marks=pytest.mark.long),
    ],
    indirect=["run_scenarios"],
    ids=["settings-cpython", "all-jython", "rest-cpython"],
)
def test_against_a_live_server(run_scenarios: Runner, names: list[str], server_port: int) -> None:
    run_scenarios([f"scenarios_{name}" for name in names], {"HEXWRAP_PORT": str(server_port)})


@pytest.mark.parametrize(
    "run_scenarios", ["cpython", pytest.param("jython", marks=pytest.mark.long)], indirect=True
)
def test_examples_as_wired(run_scenarios: Runner, server_port: int, sample_meshes: Path) -> None:
    settings = {"HEXWRAP_PORT": str(server_port), "HEXWRAP_MESHES": str(sample_meshes)}
    run_scenarios(["scenarios_examples"], settings)
