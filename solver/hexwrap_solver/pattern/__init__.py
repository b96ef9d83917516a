"""Patterns that close up on every cylinder and cone (paper, definition 2; Figures 5–7)."""

from hexwrap_solver.pattern.edges import PatternEdges, edge_polylines, pattern_edges
from hexwrap_solver.pattern.lay import lay_pattern

__all__ = ["PatternEdges", "edge_polylines", "lay_pattern", "pattern_edges"]
