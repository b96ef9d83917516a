"""The route that serves every annulus: intrinsic flips on the mirrored surface, refinement where needed."""

from hexwrap_solver.conformal.robust.solve import (
    FlatMetric,
    metric_with_flips,
    solve_with_flips,
    with_inserted,
)

__all__ = ["FlatMetric", "metric_with_flips", "solve_with_flips", "with_inserted"]
