"""One BLAS thread for tests that call single stages; the pipeline sees to it itself. Long files first."""

import os
import sys

import pytest

from tests.server import forked

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
# Tests start some hundred processes. Each would compile the whole program again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
forked.fork_workers()


def pytest_sessionfinish() -> None:
    forked.TEMPLATE.stop()


#: Files that take a minute or more are begun first: begun last, one would keep the others' processes idle.
LONG_FILES = (
    "test_components.py",
    "test_tools.py",
    "test_viewer.py",
    "test_mutations.py",
    "test_jobs.py",
    "test_crash.py",
    "test_engine.py",
    "test_dask_engine.py",
    "test_choosing.py",
    "test_demo.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    rank = {name: i for i, name in enumerate(LONG_FILES)}
    items.sort(key=lambda item: rank.get(item.path.name, len(rank)))
