"""One BLAS thread for tests that call single stages; the pipeline sees to it itself. Long files first."""

import gc
import os
import sys
from collections.abc import Generator
from pathlib import Path

import pytest

from tests.server import forked

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
# Tests start some hundred processes. Each would compile the whole program again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
forked.fork_workers()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Modules and tests live until the end: looking for garbage among them took a third of the collection."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_sessionfinish() -> None:
    forked.TEMPLATE.stop()


SOLVER = Path(__file__).parent / "solver"
#: Files that take long are begun first: begun last, one would keep the others' processes idle. Those that
#: mostly wait (for Java, a browser, machines) stand apart, or the processors would wait with them.
LONG_FILES = (
    "grasshopper/test_components.py",
    "server/test_viewer.py",
    "server/test_contract.py",
    "pattern/test_align.py",
    "server/test_dask_engine.py",
    "surface/test_brep.py",
    "server/test_demo.py",
    "pattern/test_pattern_theorems.py",
    "server/test_jobs.py",
    "singularities/test_solve.py",
    "server/test_choosing.py",
    "conformal/test_torture_nets.py",
    "server/test_crash.py",
    "panels/test_energy.py",
    "server/test_mutations.py",
    "pattern/test_strain.py",
    "server/test_openapi.py",
    "solver/test_pipeline.py",
    "server/test_bounds.py",
    "server/test_building_files.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """After the long files the solver's, which compute, and the others, which wait, by turns."""
    files = list(dict.fromkeys(item.path for item in items))
    long = {
        path: LONG_FILES.index(name)
        for path in files
        if (name := f"{path.parent.name}/{path.name}") in LONG_FILES
    }
    rest = [path for path in files if path not in long]
    halves = [[path for path in rest if (SOLVER in path.parents) == of_solver] for of_solver in (True, False)]
    turn = {path: len(LONG_FILES) + i / len(half) for half in halves for i, path in enumerate(half)} | long
    items.sort(key=lambda item: turn[item.path])
