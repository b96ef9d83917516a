"""What would come out under other conditions, foreseen from the map alone (beyond the paper)."""

from hexwrap_solver.explore.boundary import best_boundary_map, foreseen

__all__ = ["best_boundary_map", "foreseen"]
