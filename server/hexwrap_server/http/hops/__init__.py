"""Hops: the same work for Rhino's own component."""
