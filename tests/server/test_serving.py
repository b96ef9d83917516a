"""The server as a process: starting, signals, the port."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

from tests.server import forked
from tests.server.bodies import request, tube
from tests.server.patience import PATIENCE
from tests.server.process import PROGRAM, children, free_port, is_gone, served


def heavy(i: int) -> dict[str, object]:
    """A job that takes a while."""
    return request(surface=tube(200, 80, height=10 + i), pattern={"around": 60})


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_signals_end_it_cleanly_while_it_works(tmp_path: Path, number: signal.Signals) -> None:
    port = free_port()
    with served(tmp_path, port, workers=1) as process, httpx.Client(trust_env=False) as client:
        base = f"http://127.0.0.1:{port}"
        while client.get(f"{base}/ready").status_code != 200:
            time.sleep(0.05)
        ids = [client.post(f"{base}/v1/jobs", json=heavy(i)).json()["id"] for i in range(2)]
        workers = children(process)
        assert len(workers) >= 2  # one for jobs, one for errands, and who reads large bodies
        process.send_signal(number)
        assert process.wait(PATIENCE) == 0
        assert all(is_gone(worker) for worker in workers)
    log = (tmp_path / "log").read_text()
    assert "Traceback" not in log
    assert ids[0] in log


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signal_to_the_whole_group_costs_no_job(tmp_path: Path, number: signal.Signals) -> None:
    """As service managers and consoles send it: to the workers as well."""
    port = free_port()
    with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=PATIENCE, trust_env=False) as client:
        with served(tmp_path, port, workers=1, group=True) as process:
            ids = [client.post("/v1/jobs", json=heavy(i)).json()["id"] for i in range(2)]
            while not client.get(f"/v1/jobs/{ids[0]}").json()["stage"]:  # the worker is at it
                time.sleep(0.02)
            os.killpg(process.pid, number)
            assert process.wait(PATIENCE) == 0
        with served(tmp_path, port, workers=1):
            for id in ids:
                assert client.get(f"/v1/jobs/{id}?wait=50").json()["status"] == "done"


def test_taken_port_is_told_clearly(tmp_path: Path) -> None:
    port = free_port()
    with served(tmp_path, port, workers=1):
        (tmp_path / "other").mkdir()
        command = [sys.executable, "-c", PROGRAM, str(port), str(tmp_path / "other"), "1"]
        with forked.popen(command, stderr=subprocess.PIPE) as second:
            told = second.communicate(timeout=PATIENCE)[1]
    assert second.returncode != 0
    assert f"Cannot listen on 127.0.0.1:{port}" in told.decode()


BROKEN = """
import sys
from hexwrap_server.cli import main as cli
from hexwrap_server.jobs import engine
async def start(self):
    raise OSError("There is no machine.")
engine.ProcessEngine.start = start
sys.exit(cli.main(["serve", "--port", "0", "--data", sys.argv[1]]))
"""


def test_what_keeps_it_from_starting_is_told_in_a_sentence(tmp_path: Path) -> None:
    paths = os.pathsep.join(os.path.abspath(p or ".") for p in sys.path)
    command = [sys.executable, "-c", BROKEN, str(tmp_path)]
    environment = os.environ | {"PYTHONPATH": paths}
    told = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert told.returncode == 1
    assert told.stderr.endswith("hexwrap: There is no machine.\n")
    assert "Traceback" not in told.stderr
