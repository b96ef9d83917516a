"""One BLAS thread for tests that call single stages; the pipeline sees to it itself. Long files first."""

import gc
import os
import sys
from collections.abc import Generator

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


#: Files that take long are begun first, the longest before the others: begun last, one would keep the others'
#: processes idle.
LONG_FILES = (
    "test_components.py",
    "test_viewer.py",
    "test_dask_engine.py",
    "test_contract.py",
    "test_demo.py",
    "test_choosing.py",
    "test_jobs.py",
    "test_mutations.py",
    "test_crash.py",
    "test_align.py",
    "test_openapi.py",
    "test_bounds.py",
    "test_building_files.py",
    "test_brep.py",
    "test_torture_nets.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    rank = {name: i for i, name in enumerate(LONG_FILES)}
    items.sort(key=lambda item: rank.get(item.path.name, len(rank)))
