"""Processes of the program without the seconds of its imports: a template that has them is forked.

On Linux only, where a process can adopt its grandchildren; elsewhere processes start as ever. What a forked
process does is the program's own ``main``; how real ones start, ``test_start.py`` and the command line see.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import inspect
import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
from types import SimpleNamespace
from typing import Any

from hexwrap_server.jobs import worker
from hexwrap_server.jobs.worker import ONE_THREAD

PR_SET_NAME, PR_SET_CHILD_SUBREAPER = 15, 36
#: What psutil calls a template.
NAME = "template"
PROGRAM = """
import sys
import hexwrap_server.http.app, hexwrap_server.jobs.work, hexwrap_server.jobs.reading
import ezdxf.filemanagement, scipy.optimize
from tests.server import calls, forked
exec(forked.life_of_a_template(int(sys.argv[1])))
"""


def paths() -> str:
    """For PYTHONPATH: whence this process imports."""
    return os.pathsep.join(os.path.abspath(p or ".") for p in sys.path)


class Template:
    """Forks processes that are this process's own children."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._channel: socket.socket | None = None
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", PROGRAM, str(theirs.fileno())],
                env=os.environ | ONE_THREAD | {"PYTHONPATH": paths()},
                stdin=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
            )
        self._channel = ours

    def be_forked_from_here(self) -> None:
        """The template of this process, which has loaded everything and has no threads yet, is a copy."""
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        pid = os.fork()
        if not pid:
            ours.close()
            exec(life_of_a_template(theirs.detach()), {"__name__": "__main__"})
            sys.exit()
        theirs.close()
        self._channel = ours
        atexit.register(lambda: (ours.close(), os.waitpid(pid, 0)))

    def stop(self) -> None:
        if self._channel is not None and self._process is not None:
            self._channel.close()
            self._process.wait()
            self._channel = self._process = None

    def fork(self, task: Any, streams: list[int]) -> int:
        """Process id of a new child with these standard streams."""
        with self._lock:
            if self._channel is None:
                self.start()
            assert self._channel is not None
            adopt(True)  # only now: orphans of others go where they would go in use
            try:
                socket.send_fds(self._channel, [pickle.dumps(task)], streams)
                return int(self._channel.recv(64))
            finally:
                adopt(False)


def adopt(wanted: bool) -> None:
    """Whether processes that lose their parent become children of this one, if they descend from it."""
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, int(wanted), 0, 0, 0)


def life_of_a_template(channel: int) -> str:
    """Returns in forked processes only: the program that they have to run."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ctypes.CDLL(None).prctl(PR_SET_NAME, NAME.encode(), 0, 0, 0)
    gc.freeze()  # else the first look for garbage copies every page
    with socket.socket(fileno=channel) as asked:
        while True:
            task, streams, _, _ = socket.recv_fds(asked, 2**20, 3)
            if not task:
                os._exit(0)
            inlet, outlet = os.pipe()
            between = os.fork()
            if not between:
                if child := os.fork():
                    os.write(outlet, str(child).encode())
                    os._exit(0)  # and the child is an orphan, to be adopted
                for fd in (inlet, outlet):
                    os.close(fd)
                break
            os.waitpid(between, 0)
            asked.send(os.read(inlet, 64))
            for fd in (inlet, outlet, *streams):
                os.close(fd)
    return dressed(*pickle.loads(task), streams)


def dressed(
    program: str, argv: list[str], environment: dict[str, str], group: bool, streams: list[int]
) -> str:
    if group:
        os.setsid()
    for number, fd in enumerate(streams):
        os.dup2(fd, number)
        os.close(fd)
    os.environ.clear()
    os.environ.update(environment)
    ctypes.CDLL(None).prctl(PR_SET_NAME, b"python", 0, 0, 0)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.argv = ["-c", *argv]
    return program


class Forked(subprocess.Popen[bytes]):
    """``python -c program words``, forked."""

    def _execute_child(self, *told: Any) -> None:
        bound = inspect.signature(super()._execute_child).bind(*told).arguments  # type: ignore[misc]
        command, env = bound["args"], bound["env"]
        ends = [bound[name] for name in ("p2cread", "c2pwrite", "errwrite")]
        at = command.index("-c") + 1
        task = (
            command[at],
            command[at + 1 :],
            dict(os.environ if env is None else env),
            bound["start_new_session"],
        )
        self.pid = TEMPLATE.fork(task, [i if end == -1 else end for i, end in enumerate(ends)])
        self._child_created = True
        # Files are closed by whoever opened them.
        for end, other in zip(ends, ("p2cwrite", "c2pread", "errread"), strict=True):
            if end != -1 and bound[other] != -1:
                os.close(end)
        self._closed_child_pipe_fds = True


TEMPLATE = Template()
if sys.platform == "linux":
    popen: type[subprocess.Popen[bytes]] = Forked
else:
    popen = subprocess.Popen


def fork_workers() -> None:
    """Worker processes that this process starts are forked."""
    worker.subprocess = SimpleNamespace(Popen=popen, PIPE=subprocess.PIPE)  # type: ignore[assignment]


def fork_from_here() -> None:
    """The same, for a server that begins."""
    if sys.platform == "linux":
        TEMPLATE.be_forked_from_here()
    fork_workers()
