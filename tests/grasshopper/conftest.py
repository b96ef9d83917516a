"""The built components, unpacked once; interpreters that run them."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from grasshopper import archive

ROOT = Path(__file__).resolve().parents[2]
HEADLESS = Path(__file__).parent / "headless"
DIST = ROOT / "grasshopper" / "dist"

Runner = Callable[[str, dict[str, str]], None]


@pytest.fixture(scope="session")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the code and the parameter names out of every built ``.ghuser``."""
    folder = tmp_path_factory.mktemp("components")
    for path in DIST.glob("*.ghuser"):
        inner = archive.inflate(archive.inflate(path.read_bytes())["Object"])
        data = inner.find("ParameterData")
        name = path.stem.removeprefix("hexwrap-")
        (folder / f"{name}.py").write_text(inner["CodeInput"], encoding="ascii")
        names = {
            "inputs": [c["NickName"] for c in data.chunks if c.name == "InputParam"],
            "outputs": [c["NickName"] for c in data.chunks if c.name == "OutputParam"],
        }
        (folder / f"{name}.json").write_text(json.dumps(names), encoding="utf-8")
    return folder


@pytest.fixture(params=["cpython", "jython"])
def run_scenarios(request: pytest.FixtureRequest, unpacked: Path) -> Runner:
    """Runs a file of scenarios in another interpreter; its failures are this test's."""
    if request.param == "cpython":
        command = [sys.executable]
    else:
        found = shutil.which("jython")
        if found is None:
            pytest.skip(
                "Jython 2.7 is not installed here; '.ci/run' installs it, as does 'apt install jython'"
            )
        command = [found]

    def run(name: str, environment: dict[str, str]) -> None:
        paths = os.pathsep.join(str(ROOT / part) for part in ("solver", "server"))
        done = subprocess.run(
            [*command, str(HEADLESS / f"{name}.py")],
            env=os.environ
            | {"HEXWRAP_BUILT": str(unpacked), "HEXWRAP_PYTHON": sys.executable, "HEXWRAP_PATHS": paths}
            | environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, f"\n{done.stdout}"
        assert "passed" in done.stdout

    return run
