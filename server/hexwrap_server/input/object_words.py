"""Sentences about the objects of a file: what they are called, what was joined, what was left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from hexwrap_server.input.parts import COARSEST, size_of
from hexwrap_server.input.readers.found import FileContent, Found, Geometry
from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface import SentMesh
from hexwrap_solver.surface.pieces import Joint, Piece
from hexwrap_solver.words import box, place

#: Sentences name at most this many objects, problems list at most this many.
SHOWN, LISTED = 5, 200
#: A gap below this part of the tolerance is rounding.
NONE = 1e-6
#: A piece has no area if that is below this part of its box's greatest side squared.
THIN = 1e-9


def joint(joint: Joint, tolerance: float | None, objects: int) -> list[str]:
    is_exact = tolerance is None or joint.gap <= NONE * tolerance
    if objects == 1 and (joint.count == 0 or is_exact):
        return []
    what = f"{objects} objects were joined along their edges" if objects > 1 else "Open edges were joined"
    if is_exact:
        return [f"{what}."]
    return [
        f"{what}: the greatest gap closed was {joint.gap:.3g}, at {place(joint.place)}, within the file's "
        f"tolerance of {tolerance:g}."
    ]


def coarse_numbers(geometry: Geometry, tolerance: float | None) -> list[str]:
    """Whether a mesh has coordinates of single precision that are coarser than the file's tolerance, or where
    it has none, than what can be a tolerance at all."""
    if not isinstance(geometry, SentMesh):
        return []
    single = geometry.vertices.astype(np.float32)
    grain = float(np.spacing(np.abs(single).max(initial=0.0)))
    size = size_of(geometry.vertices[geometry.faces.values])
    if grain <= (tolerance or COARSEST * size) or not np.array_equal(single, geometry.vertices):
        return []
    than = (
        f"coarser than the file's tolerance of {tolerance:g}" if tolerance else f"beside a size of {size:.4g}"
    )
    return [
        f"The mesh is far from the origin and has coordinates of single precision, exact to {grain:.2g} "
        f"only, {than}: move it to the origin, then mesh it."
    ]


def odd_unit(content: FileContent, unit: str | None) -> tuple[str, ...]:
    if unit is not None or not content.odd_unit:
        return ()
    return (
        f"The file's unit, {content.odd_unit}, is not carried: lengths are given without one. Change it with "
        "Rhino's Units, or name the unit that is meant (--unit).",
    )


def spoilt(found: Sequence[tuple[int, str]], meant: Sequence[Found], content: FileContent) -> list[str]:
    """About objects that cannot be read."""
    number = {id(item): i for i, item in enumerate(content.objects)}
    names = [(label(meant[i], number[id(meant[i])]), reason) for i, reason in found]
    return [f"Of the objects, {name} was left out: {reason}" for name, reason in names[:SHOWN]]


def copies(count: int) -> tuple[str, ...]:
    what = "1 object covers another one exactly" if count == 1 else f"{count} objects cover others exactly"
    return (f"{what}: left out (Rhino's SelDup selects such).",) if count else ()


def apart_from(boxes: Sequence[Floats]) -> list[str]:
    """About further pieces of what was taken, by their boxes (2, 3)."""
    if not boxes:
        return []
    places = ", ".join(place(box.mean(axis=0)) for box in boxes[:SHOWN])
    more = f" and {len(boxes) - SHOWN} more" if len(boxes) > SHOWN else ""
    count = "1 other piece" if len(boxes) == 1 else f"{len(boxes)} other pieces"
    return [f"{count} of the same object left out, at {places}{more} (Rhino's SplitDisjointMesh parts them)."]


def strays(strays: Sequence[Piece]) -> list[str]:
    """A sentence for faces without area, one for small pieces that hang at a vertex or an edge of a larger
    one, another for the rest."""
    thin = [piece for piece in strays if piece.area <= THIN * float((piece.high - piece.low).max()) ** 2]
    count = sum(len(piece.faces) for piece in thin)
    words = [f"{count} face{'s' * (count > 1)} without area left out."] if thin else []
    thick = [piece for piece in strays if all(piece is not one for one in thin)]
    fins, others = ([piece for piece in thick if piece.is_fin is fin] for fin in (True, False))
    nouns = (("fin", fins), ("stray piece", others))
    return words + [_left_out(noun, some) for noun, some in nouns if some]


def _left_out(noun: str, some: Sequence[Piece]) -> str:
    places = ", ".join(place((piece.low + piece.high) / 2) for piece in some[:SHOWN])
    more = f" and {len(some) - SHOWN} more" if len(some) > SHOWN else ""
    faces = sum(len(piece.faces) for piece in some)
    count = f"{len(some)} {noun}{'s' * (len(some) > 1)} of {faces} face{'s' * (faces > 1)} in all"
    return f"{count} left out, at {places}{more}."


def others(content: FileContent, used: Sequence[Found]) -> tuple[str, ...]:
    """What was taken and what was not, where there was a choice."""
    kept = {id(found) for found in used}
    left = [found for found in content.objects if id(found) not in kept]
    if not left:
        return ()
    taken = listed(used, content.unit, content.objects)
    return (f"Taken: {taken}. Left out: {listed(left, content.unit, content.objects)}.",)


def listed(objects: Sequence[Found], unit: str | None, among: Sequence[Found] | None = None) -> str:
    number = {id(found): i for i, found in enumerate(among or objects)}
    names = Counter(found.name for found in among or objects)
    shown = ", ".join(
        described(found, number[id(found)], unit, alone=names[found.name] == 1) for found in objects[:SHOWN]
    )
    return shown + (f" and {len(objects) - SHOWN} more" if len(objects) > SHOWN else "")


def described(found: Found, number: int, unit: str | None, alone: bool = True) -> str:
    """Name, kind, layer and size in one phrase; with the number where others have the same name."""
    size = box(found.size)
    layer = f" on layer {found.layer}" if found.layer else ""
    which = "" if alone or not found.name else f"object {number}, "
    return f"{label(found, number)} ({which}{found.kind}{layer}, {size}{' ' + unit if unit else ''})"


def label(found: Found, number: int) -> str:
    return f"'{found.name}'" if found.name else f"object {number}"


def rows(objects: Sequence[Found], used: Sequence[Found] = ()) -> list[dict[str, Any]]:
    """As POST /v1/surfaces answers them."""
    kept = {id(found) for found in used}
    return [
        {
            "id": found.id,
            "name": found.name,
            "layer": found.layer,
            "kind": found.kind,
            "visible": found.visible and not found.locked,
            "size": list(found.size),
            "used": id(found) in kept,
        }
        for found in objects[:LISTED]
    ]
