"""Patterns that close up on every cylinder and cone (paper, definition 2; Figures 5–7)."""

from hexwrap_solver.pattern.lay_pattern import lay_pattern

__all__ = ["lay_pattern"]
