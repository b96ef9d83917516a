"""Cells that the boundary cuts."""
