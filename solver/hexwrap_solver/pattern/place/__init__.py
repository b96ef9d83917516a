"""Where the lattice lies on the unrolled domain (paper, definition 2)."""
