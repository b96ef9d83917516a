"""The route that serves every annulus: intrinsic flips on the mirrored surface, refinement where needed."""

from hexwrap_solver.conformal.robust.solve import solve_with_flips, with_inserted

__all__ = ["solve_with_flips", "with_inserted"]
