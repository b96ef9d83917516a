"""Is a triangle mesh an annulus: connected, orientable, manifold, two boundary loops, χ = 0?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Ints
from hexwrap_solver.surface.checks import LISTED
from hexwrap_solver.surface.errors import (
    NonManifoldEdgeError,
    NonManifoldVertexError,
    NotAnnulusError,
    NotOrientableError,
    SeveralComponentsError,
)
from hexwrap_solver.surface.topology import (
    boundary_loops,
    face_graph,
    half_edges,
    next_half_edge,
    spanning_tree,
)


@dataclass(frozen=True)
class SentNames:
    """Sent indices of the working mesh's elements: vertex (n,), face (m,)."""

    vertex: Ints
    face: Ints

    def edges(self, faces: Ints, h: Ints) -> list[list[int]]:
        """Half-edges as pairs of sent vertices."""
        start, end = half_edges(faces)
        pairs: list[list[int]] = self.vertex[np.stack([start[h], end[h]], axis=1)].tolist()
        return pairs


def check_edges(faces: Ints, order: Ints, first: Ints, names: SentNames) -> None:
    """At most two faces per edge. Raises NonManifoldEdgeError."""
    crowded = np.flatnonzero(np.diff(first) > 2)
    if len(crowded) == 0:
        return
    h = order[first[crowded]]
    edges = names.edges(faces, h[:LISTED])
    touching = np.concatenate([order[first[k] : first[k + 1]] for k in crowded[:LISTED]])
    raise NonManifoldEdgeError(
        f"{_count(len(h), 'edge')} of the surface {'has' if len(h) == 1 else 'have'} more than two faces, "
        f"the first, between vertices {edges[0][0]} and {edges[0][1]}, has {np.diff(first)[crowded[0]]}: "
        "remove inner walls, double faces and fins, so that every edge has one or two faces.",
        edges=edges,
        faces=np.unique(names.face[touching // 3])[:LISTED],
    )


def check_connected(twin: Ints, names: SentNames) -> None:
    """One piece, across edges. Raises SeveralComponentsError."""
    m = len(twin) // 3
    order, _ = spanning_tree(twin)
    if len(order) == m:
        return
    count, label = connected_components(face_graph(twin), directed=False)
    size = np.bincount(label)
    largest = int(np.argmax(size))
    others = np.unique(names.face[label != largest])
    raise SeveralComponentsError(
        f"The surface is in {count} pieces, of {_enumerate(np.sort(size)[::-1].tolist())} triangles: send "
        "one piece, or join them so that they share vertices to within 1e-6 of the model's size.",
        faces=others[:LISTED],
        data={"components": count, "sizes": np.sort(size)[::-1][:LISTED].tolist()},
    )


def not_orientable(faces: Ints, h: Ints, names: SentNames) -> NotOrientableError:
    """The error for a surface in which the sides do not match across the half-edges h."""
    edges = names.edges(faces, h[:LISTED])
    return NotOrientableError(
        f"The surface has only one side, like a Möbius band: its sides do not match across the edge between "
        f"vertices {edges[0][0]} and {edges[0][1]}, whichever way faces are turned; a tube-like surface has "
        "two sides, so rejoin the seam without the half twist.",
        edges=edges,
    )


def annulus_loops(faces: Ints, twin: Ints, n: int, names: SentNames) -> tuple[Ints, Ints]:
    """The two boundary loops of a connected, oriented mesh without crowded edges.

    With two loops, χ = V − E + F = 0 leaves room neither for handles nor for vertices in which the surface
    touches itself: separating those would add vertices, and no orientable surface with two loops has χ > 0.
    Raises NonManifoldVertexError, NotAnnulusError.
    """
    start, _ = half_edges(faces)
    rim = np.flatnonzero(twin < 0)
    if np.bincount(start[rim], minlength=1).max(initial=0) > 1:
        raise _pinched(faces, twin, n, names)
    loops = boundary_loops(faces, twin) if len(rim) else []
    euler = n - (len(twin) + len(rim)) // 2 + len(faces)
    if len(loops) == 2 and euler == 0:
        return loops[0], loops[1]
    if _umbrellas(faces, twin)[0] > n:
        raise _pinched(faces, twin, n, names)
    raise _wrong_topology(loops, euler, names)


def _umbrellas(faces: Ints, twin: Ints) -> tuple[int, Ints]:
    """Fans of faces around vertices: their number, and the fan of every corner."""
    h = np.flatnonzero(twin >= 0)
    k = len(twin)
    joined = coo_array((np.ones(len(h), dtype=np.int8), (h, next_half_edge(twin[h]))), shape=(k, k))
    count, label = connected_components(joined, directed=False)
    return int(count), label.astype(np.int64)


def _pinched(faces: Ints, twin: Ints, n: int, names: SentNames) -> NonManifoldVertexError:
    _, fan = _umbrellas(faces, twin)
    fans = np.unique(np.stack([faces.ravel(), fan], axis=1), axis=0)[:, 0]
    vertices = names.vertex[np.flatnonzero(np.bincount(fans, minlength=n) > 1)]
    return NonManifoldVertexError(
        f"The surface touches itself in {_count(len(vertices), 'single vertex', 'single vertices')}, the "
        f"first is vertex {vertices[0]}: faces must surround every vertex in one fan, so pull the parts "
        "apart there or join them along an edge.",
        vertices=vertices[:LISTED],
    )


def _wrong_topology(loops: list[Ints], euler: int, names: SentNames) -> NotAnnulusError:
    genus = (2 - len(loops) - euler) // 2
    data: dict[str, object] = {
        "loops": len(loops),
        "euler_characteristic": euler,
        "genus": genus,
        "loop_vertices": [int(names.vertex[loop[0]]) for loop in loops[:LISTED]],
        "loop_lengths": [len(loop) for loop in loops[:LISTED]],
    }
    lengths = _enumerate([f"{len(loop)} edges at vertex {names.vertex[loop[0]]}" for loop in loops])
    if not loops:
        data["reason"] = "closed"
        cut = {0: "cut two openings into it", 1: "cut it once all the way around its tube"}
        many = f"cut or fill its {genus} handles until a tube with two ends is left"
        text = (
            f"The surface is closed: it has no boundary (Euler characteristic {euler}); a tube has two open "
            f"ends, so {cut.get(genus, many)}."
        )
    elif len(loops) != 2:
        data["reason"] = "loops"
        advice = (
            "open a second end; or, if it is a tube whose seam is open, join the seam to within 1e-6 of the "
            "model's size"
            if len(loops) == 1
            else "fill the other holes"
        )
        text = (
            f"The surface has {_count(len(loops), 'boundary loop')} ({lengths}), but a tube has two, one at "
            f"each end: {advice}."
        )
    else:
        data["reason"] = "handle"
        text = (
            f"The surface has two boundary loops ({lengths}) but Euler characteristic {euler} instead of 0, "
            f"so it has {_count(genus, 'handle')} besides: fill or cut {'it' if genus == 1 else 'them'}."
        )
    surplus = sorted(loops, key=len)[: max(len(loops) - 2, 0)] if len(loops) > 2 else loops
    vertices = names.vertex[np.concatenate(surplus)] if surplus else names.vertex[:0]
    return NotAnnulusError(text, vertices=vertices[:LISTED], data=data)


def _count(k: int, one: str, many: str | None = None) -> str:
    return f"{k} {one if k == 1 else many or one + 's'}"


def _enumerate(items: Sequence[object], most: int = 4) -> str:
    """A few of them, and how many more there are."""
    shown = ", ".join(str(item) for item in items[:most])
    return shown + (f" and {len(items) - most} more" if len(items) > most else "")
