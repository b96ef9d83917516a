"""``result.npz``: every array of the result, for programs in Python."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexwrap_server.output.meta import Meta
from hexwrap_server.output.unrolled import in_pieces, plane
from hexwrap_server.output.wire import fields
from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.panels.folds import bend_angles, hinges_of
from hexwrap_solver.pipeline import Solution

Arrays = dict[str, NDArray[np.generic]]


def result_npz(solution: Solution, meta: Meta) -> bytes:
    """Compressed, without pickles. Keys are ``part.field`` as in the JSON result; ``unit`` is empty where it
    is not known.

    Rows of different lengths are two arrays: ``….values`` and ``….offsets``; row i is
    ``values[offsets[i]:offsets[i + 1]]``. Per-panel figures of the quality stand under ``quality``.
    """
    solution = in_pieces(solution)
    unit = solution.map.surface.unit or ""
    arrays = {"name": np.array(meta.name), "unit": np.array(unit), **_map(solution.map)}
    if solution.pattern is not None:
        names = "vertices normals triangle barycentric whole index ring place kind uv corners sheet faces"
        names += " neighbours rings around rotation edge_length distortion"
        arrays |= _named("pattern", fields(solution.pattern, names))
    if solution.panels is not None:
        names = "face size edge_length limit center normal whole energy polygons"
        arrays |= _named("panels", fields(solution.panels, names))
        bends = {"bend": hinges_of(solution.panels), "bend_angle": bend_angles(solution.panels)}
        arrays |= _named("panels", bends)
        sizes = {"edge_length": solution.panels.class_length, "count": solution.panels.class_count}
        arrays |= _named("sizes", sizes)
    if solution.components is not None:
        names = "origin x_axis y_axis z_axis outline solid_vertices solid_faces"
        arrays |= _named("components", fields(solution.components, names))
    if solution.support is not None:
        arrays |= _named("support", vars(solution.support))
    found = solution.quality.singularities
    if found is not None:
        arrays |= _named("quality.singularity_curve", fields(found, "number uncovered taken"))
    measured = {key: value for key, value in vars(solution.quality).items() if key != "singularities"}
    out = io.BytesIO()
    np.savez_compressed(out, allow_pickle=False, **arrays, **_named("quality", measured))
    return out.getvalue()


def _named(part: str, values: dict[str, Any]) -> Arrays:
    """``part.field`` → array; complex numbers as pairs, rows of different lengths as two arrays."""
    arrays: Arrays = {}
    for key, value in values.items():
        if isinstance(value, Ragged):
            arrays |= {f"{part}.{key}.values": value.values, f"{part}.{key}.offsets": value.offsets}
        elif value is not None:
            array = np.asarray(value)
            arrays[f"{part}.{key}"] = plane(array) if np.iscomplexobj(array) else array
    return arrays


def _map(cmap: ConformalMap) -> Arrays:
    surface = cmap.surface
    arrays = _named("mesh", fields(surface, "vertices faces normals input_vertex vertex_of_input"))
    arrays |= _named("map", fields(cmap, "log_scale residual flips"))
    if isinstance(cmap.domain, Net):
        arrays |= _named("map", {"corners": cmap.domain.corners})
        arrays |= _named("map.cones", fields(cmap.cones, "vertex index"))
    else:
        arrays |= _named("map", fields(cmap, "uv sheet circumference"))
        arrays |= _named("map.deck", fields(cmap.deck, "angle translation"))
    for number, (loop, angles) in enumerate(zip(surface.loops, cmap.boundary_angles, strict=True)):
        arrays |= {f"mesh.loops.{number}": loop, f"map.boundary_angles.{number}": angles}
    return arrays
