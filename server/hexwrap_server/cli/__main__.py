"""``python -m hexwrap_server.cli``: the program ``hexwrap``."""

import sys

from hexwrap_server.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
