"""One orientation for all faces, that of most of the sent ones."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.geometry import face_normals, lengths
from hexwrap_solver.surface.topology import half_edges, spanning_tree
from hexwrap_solver.surface.types import Surface

#: A surface has an inside where it and the cones over its loops enclose more than this part of (their
#: area)^(3/2): a sphere encloses 0.094, a cylinder 100 times as long as it is wide 0.014, a flat ring 0.
ENCLOSING = 0.01
#: Its normals look all around: added up they come to less than this part of the area. Those of a cylinder
#: come to 0, of a hemisphere to 0.5, of a facade on a half circle to 0.64, whether it has a window or not.
ALL_AROUND = 0.6
INWARD = (
    "The surface's normals look inwards, and the panels with them: the outside is the side that most faces "
    "look to. Where the other one is meant, turn the surface over (Rhino: Flip)."
)


def flipped(faces: Ints, twin: Ints, weight: Floats) -> tuple[Bools, Ints]:
    """Which faces of a connected mesh are to be turned over, so that the fewest (by weight, (m,)) are.

    Also the edges, one half-edge each, across which no choice of orientations agrees: none, unless the
    surface is one-sided.
    """
    disagree = _disagreeing(faces, twin)
    odd = np.zeros(len(faces), dtype=bool)
    if not disagree.any():
        return odd, np.flatnonzero(disagree)
    odd = _parity(disagree, twin)
    if weight[odd].sum() > weight[~odd].sum():
        odd = ~odd
    inner = np.flatnonzero(twin >= 0)
    across = odd[inner // 3] ^ odd[twin[inner] // 3]
    clash = inner[across != disagree[inner]]
    return odd, clash[clash < twin[clash]]


def _disagreeing(faces: Ints, twin: Ints) -> Bools:
    """(3m,) half-edges that run the same way as their twin."""
    start, _ = half_edges(faces)
    return np.asarray((twin >= 0) & (start[twin] == start))


def _parity(disagree: Bools, twin: Ints) -> Bools:
    """(m,) number of disagreements, modulo 2, on the way from face 0 along a spanning tree; by pointer
    doubling."""
    _, before = spanning_tree(twin)
    root = before < 0
    before = np.where(root, np.arange(len(before)), before)
    towards = twin.reshape(-1, 3) // 3 == before[:, None]
    corner = np.argmax(towards, axis=1)
    odd: Bools = disagree.reshape(-1, 3)[np.arange(len(before)), corner] & ~root
    while np.any(before[before] != before):
        odd = odd ^ odd[before]
        before = before[before]
    return odd


def is_inside_out(vertices: Floats, faces: Ints, twin: Ints) -> bool:
    """Whether faces enclose a negative volume, a boundary loop counting as filled by a cone to its middle."""
    rim = np.unique(half_edges(faces)[0][twin < 0])
    middle = vertices[rim if len(rim) else np.unique(faces)].mean(axis=0)
    a, b, c = (vertices[corner] - middle for corner in faces.T)
    return float(np.einsum("kd,kd->", a, np.cross(b, c))) < 0


def inward_note(surface: Surface) -> tuple[str, ...]:
    """A sentence where a tube, a dome or a closed surface looks inwards beyond doubt; it is left as it was
    sent."""
    if -surface.enclosed <= ENCLOSING:
        return ()
    across = face_normals(surface.vertices, surface.faces)
    one_way = float(np.linalg.norm(across.sum(axis=0)) / lengths(across).sum())
    return (INWARD,) if one_way < ALL_AROUND else ()
