"""Nodes, edges and cells of a lattice that has been placed on a domain."""
