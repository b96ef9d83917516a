"""Openings cut out of a map that was found with them filled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.surface.topology import boundary_loops, twins
from hexwrap_solver.surface.types import Surface


def cut_openings(found: ConformalMap, wall: Surface) -> ConformalMap:
    """The map of the wall alone. found: of ``fill_openings(wall)``, perhaps with inserted vertices. Loops
    keep the order that they have in ``wall``; singularities inside an opening fall away with it."""
    filled = found.surface
    assert filled.patch is not None
    keep = ~filled.patch
    used = np.zeros(len(filled.vertices), dtype=bool)
    used[filled.faces[keep].ravel()] = True
    new = np.cumsum(used) - 1
    whole = np.array_equal(filled.faces[keep], wall.faces)
    surface = wall if whole else _wall(filled, wall, keep, used)
    domain = found.domain
    if isinstance(domain, Net):
        domain = domain.restricted(keep)
    else:
        domain = replace(domain, uv=domain.uv[used], sheet=domain.sheet[keep])
    fitted = found.fitted
    if fitted is not None and fitted.chart is not None:
        fitted = replace(fitted, chart=fitted.chart.restricted(keep))
    cones = found.cones
    at_wall = used[cones.vertex]
    cones = replace(
        cones, vertex=new[cones.vertex[at_wall]], index=cones.index[at_wall], moved=cones.moved[at_wall]
    )
    count = len(wall.loops) - len(filled.loops)
    filling = "1 opening was filled smoothly, mapped as wall and cut out of it"
    if count > 1:
        filling = f"{count} openings were filled smoothly, mapped as wall and cut out of it"
    sentence = f"{filling} again (all boundary loops beyond the two longest)."
    cut = replace(
        found,
        surface=surface,
        log_scale=found.log_scale[used],
        domain=domain,
        fitted=fitted,
        cones=cones,
        inserted=len(surface.vertices) - len(wall.vertices),
        notes=(sentence, *found.notes),
    )
    return replace(cut, boundary_angles=(*found.boundary_angles, *_angles(cut, len(filled.loops))))


def _wall(filled: Surface, wall: Surface, keep: np.ndarray, used: np.ndarray) -> Surface:
    """The faces ``keep`` of a refined surface."""
    new = np.cumsum(used) - 1
    faces = new[filled.faces[keep]]
    stand = wall.vertex_of_input
    where = np.full(len(wall.vertices), -1, dtype=np.int64)
    there = np.flatnonzero(used[: len(wall.vertices)])
    where[there] = new[there]
    loops = boundary_loops(faces, twins(faces, int(used.sum())))
    order = [next(loop for loop in loops if where[old[0]] in loop) for old in wall.loops]
    return Surface(
        filled.vertices[used],
        faces,
        tuple(order),
        filled.input_vertex[used],
        np.where(stand >= 0, where[stand], -1),
        filled.normals[used],
        filled.repairs,
        features=tuple(
            replace(feature, vertices=new[feature.vertices])
            for feature in filled.features
            if used[feature.vertices].all()
        ),
    )


def _angles(cut: ConformalMap, first: int) -> tuple[Floats, ...]:
    """Angle sums on the loops from ``first`` on, as drawn."""
    z = cut.corners()
    angle = np.angle(np.conj(np.roll(z, -1, axis=1) - z) * (np.roll(z, 1, axis=1) - z))
    sums = np.bincount(cut.surface.faces.ravel(), angle.ravel(), len(cut.surface.vertices)).astype(np.float64)
    return tuple(sums[loop] for loop in cut.surface.loops[first:])
