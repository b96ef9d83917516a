"""The demo starts a server of its own where none answers, uses one that does, and leaves nothing behind."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from hexwrap_server.cli import demo
from hexwrap_server.cli.main import main
from hexwrap_server.output.writers import WRITERS
from tests.server.live import running


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Other(BaseHTTPRequestHandler):
    """A program that is not hexwrap."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b'{"status": "fine"}')

    def log_message(self, format: str, *args: object) -> None:
        return


@pytest.fixture
def other_port() -> Iterator[int]:
    other = HTTPServer(("127.0.0.1", 0), Other)
    thread = threading.Thread(target=other.serve_forever)
    thread.start()
    yield other.server_port
    other.shutdown()
    thread.join()
    other.server_close()


def test_the_demo_on_a_fresh_machine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    port = free_port()
    assert main(["demo", "--port", str(port), "--out", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert f"started a hexwrap server on port {port}" in told
    assert "stopped the server" in told
    assert "overlaps 0" in told
    assert {file.name for file in (tmp_path / "tower").iterdir()} == set(WRITERS)
    assert demo.who_answers(port) == "nobody"


def test_another_program_on_the_port_is_left_alone(
    other_port: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []
    monkeypatch.setattr(demo, "START", 0.0)
    started = demo.start_server
    monkeypatch.setattr(demo, "start_server", lambda port, *rest: asked.append(port) or started(port, *rest))
    assert main(["demo", "--port", str(other_port), "--out", "unused"]) == 1
    told = capsys.readouterr()
    assert f"port {other_port} is used by another program" in told.out
    assert asked != [other_port]
    assert "did not answer within 0 s" in told.err


def test_a_running_server_is_used_and_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with running(tmp_path / "data", workers=1) as client:
        port = client.base_url.port
        assert port is not None
        refused = {
            "name": "three faces at an edge",
            "surface": {
                "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]],
                "faces": [[0, 1, 2], [1, 0, 3], [0, 1, 4]],
            },
        }
        with pytest.raises(demo.DemoError, match="more than two faces"):
            demo.finished(client, refused, lambda *said: None)
        with pytest.raises(demo.DemoError, match="'surface' is missing"):
            demo.finished(client, {}, lambda *said: None)
        assert demo.who_answers(port) == "hexwrap"


def test_a_server_that_cannot_start_says_why(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with (tmp_path / "log").open("wb") as log:
            process = demo.start_server(taken.getsockname()[1], tmp_path / "data", log.fileno())
        assert process.wait(60) == 1
    assert "port" in (tmp_path / "log").read_text()
