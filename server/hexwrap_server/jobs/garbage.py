"""What a process has loaded at its start is no garbage."""

from __future__ import annotations

import gc


def look_no_more() -> None:
    """Leave out everything that is there by now when garbage is looked for.

    Modules make half a million objects. Each full search among them held the interpreter for 80 ms, and many
    times that on a machine with other work; so long no answer left, or a stage of a job stood still.
    """
    gc.freeze()
