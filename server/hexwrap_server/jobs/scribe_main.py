"""The scribe seen from inside: it writes what it is sent until its worker is gone.

When the worker dies, however it dies, the scribe reads the end of its input and leaves. It listens before it
loads anything large, which takes seconds on a busy machine: it is to leave with its worker even then.
"""

from __future__ import annotations

import logging
import os
import queue
import sys
import threading
from typing import IO, Any

from hexwrap_server import logs
from hexwrap_server.jobs import garbage
from hexwrap_server.jobs.pipes import pipes_of_child, read_frame, write_frame

#: What is to be done, about what, with what: see ``scribe.Desk``.
Order = tuple[str, Any, bytes]
log = logging.getLogger("hexwrap.scribe")


def main() -> None:
    """The life of a scribe."""
    inlet, outlet = pipes_of_child()
    orders: queue.SimpleQueue[Order] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(inlet, orders), daemon=True).start()
    logs.set_up_logging(sys.argv[1])
    from hexwrap_server.jobs.scribe import Desk

    garbage.look_no_more()
    write_frame(outlet, ("ready",))
    desk = Desk()
    while True:
        answer = desk.do(*orders.get())
        if answer is not None:
            write_frame(outlet, answer)


def _listen(inlet: IO[bytes], orders: queue.SimpleQueue[Order]) -> None:
    try:
        while (head := read_frame(inlet)) is not None:
            kind, name, size = head
            data = inlet.read(size)
            if len(data) < size:
                break
            orders.put((kind, name, data))
    except Exception:  # such as MemoryError: nothing that comes later can be understood
        log.exception("what the worker says cannot be read")
    finally:
        os._exit(0)
