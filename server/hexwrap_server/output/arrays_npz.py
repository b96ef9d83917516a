"""``result.npz``: every array of the result, for programs in Python."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray

from hexwrap_server.output.meta import Meta
from hexwrap_solver.arrays import Complexes, Floats, Ragged
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.panels.folds import bend_angles, hinges_of
from hexwrap_solver.panels.types import Components, Panels, Support
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.pipeline import Solution

Arrays = dict[str, NDArray[np.generic]]


def result_npz(solution: Solution, meta: Meta) -> bytes:
    """Compressed, without pickles. Keys are ``part.field`` as in the JSON result; ``unit`` is empty where it
    is not known.

    Rows of different lengths are two arrays: ``….values`` and ``….offsets``; row i is
    ``values[offsets[i]:offsets[i + 1]]``. Per-panel figures of the quality stand under ``quality``.
    """
    unit = solution.map.surface.unit or ""
    arrays = {"name": np.array(meta.name), "unit": np.array(unit), **_map(solution.map)}
    if solution.pattern is not None:
        arrays |= _pattern(solution.pattern)
    if solution.panels is not None:
        arrays |= _panels(solution.panels)
    if solution.components is not None:
        arrays |= _components(solution.components)
    if solution.support is not None:
        arrays |= _support(solution.support)
    found = solution.quality.singularities
    if found is not None:
        curve = {"number": found.number, "uncovered": found.uncovered, "taken": np.array(found.taken)}
        arrays |= {f"quality.singularity_curve.{key}": value for key, value in curve.items()}
    for key, value in vars(solution.quality).items():
        if value is not None and value is not found:
            arrays[f"quality.{key}"] = np.asarray(value)
    out = io.BytesIO()
    np.savez_compressed(out, allow_pickle=False, **arrays)
    return out.getvalue()


def _plane(z: Complexes) -> Floats:
    return np.stack([z.real, z.imag], axis=-1)


def _ragged(key: str, rows: Ragged) -> Arrays:
    return {f"{key}.values": rows.values, f"{key}.offsets": rows.offsets}


def _map(cmap: ConformalMap) -> Arrays:
    surface = cmap.surface
    arrays: Arrays = {
        "mesh.vertices": surface.vertices,
        "mesh.faces": surface.faces,
        "mesh.normals": surface.normals,
        "mesh.input_vertex": surface.input_vertex,
        "mesh.vertex_of_input": surface.vertex_of_input,
        "map.log_scale": cmap.log_scale,
        "map.residual": np.array(cmap.residual),
        "map.flips": np.array(cmap.flips),
    }
    if isinstance(cmap.domain, Net):
        arrays["map.corners"] = _plane(cmap.domain.corners)
        arrays |= {"map.cones.vertex": cmap.cones.vertex, "map.cones.index": cmap.cones.index}
    else:
        arrays |= {
            "map.uv": _plane(cmap.uv),
            "map.sheet": cmap.sheet,
            "map.deck.angle": np.array(cmap.deck.angle),
            "map.deck.translation": _plane(np.array(cmap.deck.translation)),
            "map.circumference": np.array(cmap.circumference),
        }
    for number, (loop, angles) in enumerate(zip(surface.loops, cmap.boundary_angles, strict=True)):
        arrays |= {f"mesh.loops.{number}": loop, f"map.boundary_angles.{number}": angles}
    return arrays


def _pattern(pattern: Pattern) -> Arrays:
    arrays: Arrays = {
        f"pattern.{key}": getattr(pattern, key)
        for key in ("vertices", "normals", "triangle", "barycentric", "whole", "index", "ring", "place")
    }
    arrays |= {"pattern.kind": np.array(pattern.kind), "pattern.uv": _plane(pattern.uv)}
    arrays["pattern.corners"] = _plane(pattern.corners)
    if pattern.sheet is not None:
        arrays["pattern.sheet"] = pattern.sheet
    for key in ("rings", "around", "rotation", "edge_length", "distortion"):
        arrays[f"pattern.{key}"] = np.array(getattr(pattern, key))
    return (
        arrays | _ragged("pattern.faces", pattern.faces) | _ragged("pattern.neighbours", pattern.neighbours)
    )


def _panels(panels: Panels) -> Arrays:
    arrays: Arrays = {
        f"panels.{key}": getattr(panels, key)
        for key in ("face", "size", "edge_length", "limit", "center", "normal", "whole")
    }
    arrays |= {"sizes.edge_length": panels.class_length, "sizes.count": panels.class_count}
    arrays |= {"panels.bend": hinges_of(panels), "panels.bend_angle": bend_angles(panels)}
    if panels.energy is not None:
        arrays["panels.energy"] = panels.energy
    return arrays | _ragged("panels.polygons", panels.polygons)


def _components(components: Components) -> Arrays:
    arrays: Arrays = {
        f"components.{key}": getattr(components, key) for key in ("origin", "x_axis", "y_axis", "z_axis")
    }
    for key in ("outline", "solid_vertices", "solid_faces"):
        rows = getattr(components, key)
        if rows is not None:
            arrays |= _ragged(f"components.{key}", rows)
    return arrays


def _support(support: Support) -> Arrays:
    return {f"support.{key}": value for key, value in vars(support).items()}
