"""The companion server and the command line. It knows HTTP, files and jobs, and no mathematics."""

from hexwrap_solver import __version__

__all__ = ["__version__"]
