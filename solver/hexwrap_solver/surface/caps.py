"""Flat caps of closed masses: what a modeller closes a tower with, and a facade leaves open.

A cap is a flat or nearly flat region of faces, bounded by sharp folds all around, above whose rim nothing
else of the surface rises. A closed prism has many such regions: its walls are some, too. Ends of a tube do
not touch each other, and look in opposite directions; of several such pairs the upright one is taken, unless
the mass lies: is much longer in another direction than in all others, as a bar is and a slab is not. Slopes
that meet at a ridge are a roof, not caps: a house loses its floor alone. A plate, as a roof slab or a thick
wall, has two sides; of these one is left.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.geometry import angles_between, dot, face_normals, linked, normalize
from hexwrap_solver.surface.orient import is_inside_out
from hexwrap_solver.surface.topology import boundary_loops, face_graph, half_edges, sum_rows
from hexwrap_solver.surface.types import Triangles
from hexwrap_solver.words import length, place

#: Regions are bounded by folds sharper than this, radians …
SHARP = np.deg2rad(44.0)
#: … and are caps if no face of theirs leans more than this against the whole.
SHALLOW = np.deg2rad(15.0)
#: Others rise above the rim of a cap by no more than this part of the size.
ROUNDING = 1e-4
#: Ends look away from each other: the cosine between their normals is below the negative of this.
OPPOSITE = 0.5
#: A cap is upright whose normal is within 45° of the vertical.
UPRIGHT = np.sqrt(0.5)
#: Another pair is taken only if it is this many times longer than all others, the upright one included.
LONGER = 2.5
#: More flat regions than this make a faceted surface, not a mass with caps.
MOST = 60
#: A plate is thinner than this part of the root of its area; its sides are alike up to a factor, and their
#: area vectors cancel up to this part of their area. If each is smaller than that, the plate goes all around.
THIN, EQUAL, FACING = 0.04, 0.75, 0.2
#: Walls that fall apart into more tubes than this are not a building with courtyards.
MOST_TUBES = 20
#: Walls around a courtyard stand: they lean by no more than this, radians; else the block is a ring.
LEANING = np.deg2rad(25.0)
#: The open end opposite to a cap lies within this part of the height from the lower end.
END = 0.35


@dataclass(frozen=True)
class Cap:
    """faces: of the region, ascending. normal: outward, (3,). centre: (3,). area. vertices: it touches."""

    faces: Ints
    normal: Floats
    centre: Floats
    area: float
    vertices: Ints


def caps_of(mesh: Triangles) -> tuple[list[Cap], str]:
    """The caps to be taken off so that a tube or a dome is left, and a sentence about them; or none.

    The mesh must be oriented, with at most two faces per edge; one that is inside out has the same caps. With
    two boundary loops or more nothing is taken off: it is a tube already.
    """
    rim = np.flatnonzero(mesh.twin < 0)
    start, _ = half_edges(mesh.faces)
    if len(rim) and len(np.unique(start[rim])) < len(rim):
        return [], ""
    loops = boundary_loops(mesh.faces, mesh.twin) if len(rim) else []
    if len(loops) > 1:
        return [], ""
    if is_inside_out(mesh.vertices, mesh.faces, mesh.twin):
        mesh = Triangles(mesh.vertices, mesh.faces[:, [0, 2, 1]])
    region, total = _smooth(mesh)
    if not loops:
        plate, sentence = _plate(mesh, region, total)
        if plate:
            return plate, sentence
    found = _regions(mesh, region, total)
    pairs = [pair for pair in combinations(found, 2) if _is_pair(*pair)]
    upright = [pair for pair in pairs if all(abs(cap.normal[2]) > UPRIGHT for cap in pair)]
    chosen: list[Cap] = []
    if loops:
        if upright:
            chosen = list(max(upright, key=_length))
        else:
            chosen = _opposite(mesh, found, loops[0])
    else:
        low = [cap for cap in found if cap.normal[2] < -UPRIGHT]
        chosen = low[:1] if len(low) == 1 else found if len(found) == 1 else []
        if pairs:
            best, *others = sorted(pairs, key=_length, reverse=True)
            across = [_length(pair) for pair in others] or [np.sqrt(cap.area) for cap in low]
            lies = all(_length(best) > LONGER * x for x in across)
            if upright and not lies:
                chosen = [end for end in max(upright, key=_length) if not _is_roof(end, found)]
            elif lies or len(low) != 1:
                chosen = list(best)
    keep = kept(mesh, chosen)
    if not chosen or not keep.any():
        return [], ""
    label = _pieces(mesh, keep)
    if label.max() == 0:
        return chosen, _sentence(chosen, len(pairs))
    # Around a courtyard the walls fall apart into an outer and an inner tube, and nothing else.
    area = np.bincount(label, mesh.areas[keep])
    tubes = (_is_tube(mesh.faces[keep][label == k]) for k in range(len(area)))
    if len(area) > MOST_TUBES or not _stand(mesh, keep, chosen[0].normal) or not all(tubes):
        return [], ""
    outer = int(area.argmax())
    inner = np.flatnonzero(keep)[label != outer]
    points = mesh.vertices[mesh.faces[inner].ravel()]
    court = Cap(inner, np.zeros(3), (points.min(axis=0) + points.max(axis=0)) / 2, 0.0, inner[:0])
    walls = "walls of a courtyard" if len(area) == 2 else f"walls of {len(area) - 1} courtyards"
    sentence = f" The {walls} around {place(court.centre)} were left out: panelize them by themselves."
    return [*chosen, court], _sentence(chosen, len(pairs)) + sentence


def _smooth(mesh: Triangles) -> tuple[Ints, Floats]:
    """(m,) the region without sharp folds that each face is in, and (k, 3) twice their area vectors."""
    m = len(mesh.faces)
    area2 = face_normals(mesh.vertices, mesh.faces)
    normal = normalize(area2)
    h = np.flatnonzero(mesh.twin > np.arange(3 * m))
    one, two = h // 3, mesh.twin[h] // 3
    smooth = angles_between(normal[one], normal[two]) <= SHARP
    count, region = linked(one[smooth], two[smooth], m)
    return region, sum_rows(area2, region, count)


def _plate(mesh: Triangles, region: Ints, total: Floats) -> tuple[list[Cap], str]:
    """All of a plate but its upper side, or the larger one where it stands or goes around, and a sentence."""
    area = np.bincount(region, mesh.areas)
    one, two = np.argsort(-area, kind="stable")[[0, min(1, len(area) - 1)]]
    facing = np.linalg.norm(total, axis=1) / 2
    points = mesh.vertices[mesh.faces]
    points = points - points.mean(axis=(0, 1))
    volume = float(dot(points[:, 0], np.cross(points[:, 1], points[:, 2])).sum()) / 6
    both = area[one] + area[two]
    thick = 2 * volume / both
    if (
        thick > THIN * np.sqrt(area[two])
        or area[two] < EQUAL * area[one]
        or both < EQUAL * area.sum()
        or np.linalg.norm(total[one] + total[two]) / 2 > FACING * area[two]
    ):
        return [], ""
    is_open = facing[two] > FACING * area[two]
    side = two if is_open and total[two, 2] > 2 * UPRIGHT * facing[two] else one
    rest = np.flatnonzero(region != side)
    name = _side(total[side] / 2 / facing[side]) if is_open else "outside"
    what = f"The mass is a plate, {length(thick)} thick, of which the {name}"
    off = Cap(rest, np.zeros(3), np.zeros(3), 0.0, rest[:0])
    return [off], f'{what} is panelized; surface.caps "keep" leaves all of it.'


def _regions(mesh: Triangles, region: Ints, total: Floats) -> list[Cap]:
    """All flat regions that could be caps, the largest first."""
    area2 = face_normals(mesh.vertices, mesh.faces)
    normal = normalize(area2)
    count, size = len(total), np.linalg.norm(total, axis=1)
    lean = np.zeros(count)
    np.maximum.at(lean, region, angles_between(normal, total[region]) * (np.linalg.norm(area2, axis=1) > 0))
    likely = np.flatnonzero((lean <= SHALLOW) & (size > 1e-6 * size.sum()))
    if len(likely) > MOST:
        return []
    box = float(np.linalg.norm(np.ptp(mesh.vertices[mesh.faces.ravel()], axis=0)))
    out = []
    for k in likely[np.argsort(-size[likely], kind="stable")]:
        own = region == k
        if own.all():
            continue
        faces = np.flatnonzero(own)
        direction = total[k] / size[k]
        vertices = np.unique(mesh.faces[faces])
        others = np.unique(mesh.faces[~own])
        rim = np.intersect1d(vertices, others)
        if len(rim) == 0:
            continue
        height = mesh.vertices @ direction
        if height[others].max() > height[rim].max() + ROUNDING * box:
            continue
        weight = np.linalg.norm(area2[faces], axis=1)
        centre = np.average(mesh.vertices[mesh.faces[faces]].mean(axis=1), axis=0, weights=weight)
        centre = np.where(np.abs(centre) < 1e-6 * box, 0.0, centre)
        out.append(Cap(faces, direction, centre, float(size[k] / 2), vertices))
    return out


def _is_pair(one: Cap, two: Cap) -> bool:
    return _are_apart(one, two) and float(one.normal @ two.normal) < -OPPOSITE


def _is_roof(cap: Cap, found: list[Cap]) -> bool:
    """Whether another region that looks up, or down, as it does meets it."""
    return any(
        other is not cap
        and min(other.normal[2] * np.sign(cap.normal[2]), abs(cap.normal[2])) > UPRIGHT
        and not _are_apart(cap, other)
        for other in found
    )


def _are_apart(one: Cap, two: Cap) -> bool:
    return len(np.intersect1d(one.vertices, two.vertices)) == 0


def _length(pair: Iterable[Cap]) -> float:
    one, two = pair
    return float(np.linalg.norm(one.centre - two.centre))


def _opposite(mesh: Triangles, found: list[Cap], loop: Ints) -> list[Cap]:
    """The cap that closes the end opposite to a boundary loop, if there is just one."""
    rim = mesh.vertices[loop]
    out = []
    for cap in found:
        if len(np.intersect1d(cap.vertices, loop)) or 2 * cap.area > mesh.areas.sum():
            continue  # of a canopy the fascia alone would be left
        height = mesh.vertices[np.unique(mesh.faces)] @ cap.normal
        low, high = float(height.min()), float(height.max())
        away = cap.centre - rim.mean(axis=0)
        ends = (rim @ cap.normal).max() <= low + END * (high - low)
        cut_into = any(np.isin(loop, other.vertices).all() for other in found)
        if ends and not cut_into and float(away @ cap.normal) > UPRIGHT * float(np.linalg.norm(away)):
            out.append(cap)
    return out if len(out) == 1 else []


def _pieces(mesh: Triangles, keep: Bools) -> Ints:
    """(k,) the piece that each kept face belongs to."""
    graph = face_graph(mesh.twin)[keep][:, keep]
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _stand(mesh: Triangles, keep: Bools, axis: Floats) -> bool:
    """Whether the walls run along the axis, but for small parts of them such as ledges."""
    lean = np.abs(normalize(face_normals(mesh.vertices, mesh.faces[keep])) @ axis) > np.sin(LEANING)
    area = mesh.areas[keep]
    return bool(area[lean].sum() <= 0.1 * area.sum())


def _is_tube(faces: Ints) -> bool:
    """Whether these faces have two boundary loops and no handle."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges, uses = np.unique(edges, axis=0, return_counts=True)
    ends, at = np.unique(edges[uses == 1], return_inverse=True)
    at = at.reshape(-1, 2)
    loops = linked(at[:, 0], at[:, 1], len(ends))[0] if len(ends) else 0
    return bool(loops == 2 and len(np.unique(faces)) - len(edges) + len(faces) == 0)


def kept(mesh: Triangles, chosen: list[Cap]) -> Bools:
    """(m,) the faces that are left."""
    keep = np.ones(len(mesh.faces), dtype=bool)
    for cap in chosen:
        keep[cap.faces] = False
    return keep


def _sentence(chosen: list[Cap], pairs: int) -> str:
    chosen = sorted(chosen, key=lambda cap: cap.normal[2])
    places = " and ".join(
        f"the {_side(cap.normal)} (around {place(cap.centre)}, area {length(cap.area)})" for cap in chosen
    )
    what = f"A flat cap at {places} was" if len(chosen) == 1 else f"Flat caps at {places} were"
    if pairs > 1 and len(chosen) == 2:
        return (
            f"{what} taken off, one of {pairs} pairs of opposite flat sides. If another is meant, delete its "
            'two faces (in Rhino: ExtractSrf); surface.caps "keep" leaves all of them on.'
        )
    them = "it" if len(chosen) == 1 else "them"
    return f'{what} taken off; surface.caps "keep" leaves {them} on.'


def _side(normal: Floats) -> str:
    """The direction in words."""
    axis = int(np.abs(normal).argmax())
    if abs(normal[axis]) < 0.9 and abs(normal[2]) <= UPRIGHT:
        return f"side facing ({normal[0]:.2f}, {normal[1]:.2f}, {normal[2]:.2f})"
    if axis == 2 or abs(normal[2]) > UPRIGHT:
        return "top" if normal[2] > 0 else "bottom"
    return f"side facing {'−+'[int(normal[axis] > 0)]}{'xyz'[axis]}"
