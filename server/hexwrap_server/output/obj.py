"""``panels.obj``: every panel as one polygon, or as two where it is bent, grouped by size, each an object
named by its label.
"""

from __future__ import annotations

from hexwrap_server.output.layers import size_name
from hexwrap_server.output.meta import Meta, panels_of
from hexwrap_server.output.text import one_line
from hexwrap_solver.panels.folds import halves_of_ring, hinges_of
from hexwrap_solver.pipeline import Solution


def panels_obj(solution: Solution, meta: Meta) -> bytes:
    """Wavefront OBJ: all vertices, then the faces of each size. Coordinates keep 15 digits."""
    pattern, panels = panels_of(solution, "panels.obj")
    points = panels.polygons.values
    lines = [
        f"# {one_line(meta.name)}: {panels.n_panels} panels, {len(panels.class_length)} sizes, by hexwrap",
        ("v %.15g %.15g %.15g\n" * len(points) % tuple(points.ravel().tolist())).rstrip("\n"),
    ]
    labels = pattern.labels()
    starts, ends = (panels.polygons.offsets[:-1] + 1).tolist(), (panels.polygons.offsets[1:] + 1).tolist()
    hinges = hinges_of(panels).tolist()
    members: dict[int, list[int]] = {}
    for panel, size in enumerate(panels.size.tolist()):
        members.setdefault(size, []).append(panel)
    cell = panels.face.tolist()
    for size in sorted(members):
        lines.append(f"g {size_name(size)}")
        for panel in members[size]:
            lines.append(f"o {labels[cell[panel]]}")
            ring = range(starts[panel], ends[panel])
            for part in halves_of_ring(list(ring), hinges[panel]):
                lines.append("f " + " ".join(map(str, part)))
    return ("\n".join(lines) + "\n").encode()
