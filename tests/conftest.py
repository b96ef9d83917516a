"""Every test process, and what it starts, computes with one thread: there are as many processes as cores."""

from hexwrap_server import one_thread  # noqa: F401
