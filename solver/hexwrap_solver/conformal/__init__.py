"""Periodic discrete conformal maps (paper, section 3)."""

from hexwrap_solver.conformal.solve import conformal_map

__all__ = ["conformal_map"]
