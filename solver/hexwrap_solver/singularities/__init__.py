"""Cells with more or fewer sides, where they make the sizes of all others more equal (beyond the paper).

A cone of angle 2π − k·quantum inside the surface is a cell with k sides fewer: k = 1 a pentagon among
hexagons, k = −1 a heptagon. ``place`` chooses where they stand, ``close`` moves them by less than a cell so
that the pattern closes up around each exactly.
"""
