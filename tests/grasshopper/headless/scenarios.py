"""Runs files of scenarios one after the other in one interpreter, since Java takes seconds to begin."""

import io
import os
import sys

names, sys.argv[1:] = sys.argv[1:], []  # the files choose among their scenarios by what is left
failed = 0
for name in names:
    with io.open(os.path.join(os.path.dirname(os.path.abspath(__file__)), name + ".py"), "rb") as file:
        code = compile(file.read(), name, "exec")
    try:
        exec(code, {"__name__": "__main__"})  # not imported: other threads could import nothing meanwhile
    except SystemExit as end:
        failed += end.code
sys.exit(min(failed, 1))
