"""What processes of hexwrap say to each other through pipes: a length, then a pickle."""

from __future__ import annotations

import os
import pickle
import signal
import struct
import sys
from typing import IO, Any

_LENGTH = struct.Struct("<Q")


def pipes_of_child() -> tuple[IO[bytes], IO[bytes]]:
    """Where this process hears its parent, and where it answers: its standard input and output.

    Signals go to all processes of a console or a service at once; the parent decides, and its end is the end
    of the input.
    """
    for name in ("SIGINT", "SIGTERM", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    inlet = os.fdopen(os.dup(0), "rb")
    outlet = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print must not end up between the frames
    _leave_standard_input()
    return inlet, outlet


def _leave_standard_input() -> None:
    """Have nothing at standard input any more.

    On Windows libraries that look at it while they are loaded, as OpenBLAS's Fortran runtime does, would wait
    for the thread that reads from the pipe there (numpy, issue 24290).
    """
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    if sys.platform == "win32":
        import ctypes
        import msvcrt

        STD_INPUT_HANDLE = -10
        ctypes.windll.kernel32.SetStdHandle(STD_INPUT_HANDLE, ctypes.c_void_p(msvcrt.get_osfhandle(0)))


def write_frame(pipe: IO[bytes], message: object) -> None:
    data = pickle.dumps(message, protocol=5)
    pipe.write(_LENGTH.pack(len(data)))
    pipe.write(data)
    pipe.flush()


def read_frame(pipe: IO[bytes]) -> tuple[Any, ...] | None:
    try:
        head = pipe.read(_LENGTH.size)
        if len(head) < _LENGTH.size:
            return None
        (length,) = _LENGTH.unpack(head)
        data = pipe.read(length)
        return pickle.loads(data) if len(data) == length else None
    except (OSError, EOFError, ValueError):
        return None
