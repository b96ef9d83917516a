"""Solution → the contract's Result. Arrays go into the text directly; what is not a number becomes null."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from hexwrap_server.output.colours import class_colours
from hexwrap_server.output.unrolled import piece_of_cells
from hexwrap_solver.arrays import Bools, Complexes, Floats, Ragged
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.domain.apart import apart
from hexwrap_solver.panels.folds import bend_angles
from hexwrap_solver.panels.types import Components, Panels, Support, TradeOff
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.pipeline import Solution
from hexwrap_solver.singularities.types import Choices
from hexwrap_solver.surface.types import Surface

#: The parts of a Result, in its order.
PARTS = ("unit", "mesh", "map", "pattern", "panels", "sizes", "quality", "components", "support", "timings")
#: Asked for beside parts: ``map`` then has ``corners`` on every kind of domain.
CORNERS = "corners"


def result_json(
    solution: Solution, timings: dict[str, float] | None = None, include: Sequence[str] = PARTS
) -> bytes:
    """The Result as JSON. include: the parts wanted; with CORNERS among them, ``map`` has ``corners``."""
    wanted = {*include, "map"} if CORNERS in include else include
    document = {name: part(solution, name, timings or {}) for name in PARTS if name in wanted}
    if CORNERS in include:
        document["map"]["corners"] = plane(solution.map.corners())
    return dump(document)


def part(solution: Solution, name: str, timings: dict[str, float]) -> Any:
    """One part of the Result as a structure that ``dump`` takes."""
    match name:
        case "mesh":
            return mesh(solution.map.surface)
        case "unit":
            return solution.map.surface.unit
        case "map":
            return conformal(solution.map) | {"apart": drawn_apart(solution)}
        case "pattern":
            return solution.pattern and pattern(solution.pattern)
        case "panels":
            return panels(solution)
        case "sizes":
            return sizes(solution.panels)
        case "quality":
            return quality(solution)
        case "components":
            return solution.components and components(solution.components)
        case "support":
            return solution.support and support(solution.support)
        case _:
            return timings


def dump(value: Any) -> bytes:
    """JSON, numpy arrays included."""
    return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)


def mesh(surface: Surface) -> dict[str, Any]:
    return {
        "vertices": flat(surface.vertices),
        "faces": flat(surface.faces),
        "input_vertex": flat(surface.input_vertex),
        "vertex_of_input": flat(surface.vertex_of_input),
        "loops": [flat(loop) for loop in surface.loops],
        "repairs": list(surface.repairs),
    }


def conformal(cmap: ConformalMap) -> dict[str, Any]:
    domain = cmap.domain
    if isinstance(domain, Net):
        sheets: dict[str, Any] = dict.fromkeys(("cone_angle", "uv", "sheet", "deck", "circumference", "apex"))
        sheets["corners"] = plane(domain.corners)
    else:
        apex, shift = None if cmap.kind == "cylinder" else domain.deck.apex, domain.deck.translation
        sheets = {
            "cone_angle": float(domain.deck.angle),
            "uv": plane(domain.uv),
            "sheet": flat(domain.sheet),
            "deck": {"angle": float(domain.deck.angle), "translation": [shift.real, shift.imag]},
            "circumference": float(domain.circumference),
            "apex": None if apex is None else [apex.real, apex.imag],
        }
    return {
        "kind": cmap.kind,
        **sheets,
        "cones": [
            {"vertex": int(vertex), "index": int(index), "moved": float(moved)}
            for vertex, index, moved in zip(
                cmap.cones.vertex, cmap.cones.index, cmap.cones.moved, strict=True
            )
        ],
        "log_scale": flat(cmap.log_scale),
        "boundary_angles": [flat(angles) for angles in cmap.boundary_angles],
        "iterations": int(cmap.iterations),
        "residual": float(cmap.residual),
        "flips": int(cmap.flips),
        "inserted": int(cmap.inserted),
        "closing_error": float(cmap.closing_error),
    }


def drawn_apart(solution: Solution) -> dict[str, Any] | None:
    """Of a domain that overlaps itself, the pieces to draw faces and cells in, and the shift of each."""
    pieces, laid = apart(solution.map), solution.pattern
    if pieces is None:
        return None
    return {
        "face": flat(pieces.piece),
        "cell": None if laid is None else flat(piece_of_cells(laid, pieces)),
        "shift": plane(pieces.shift),
    }


def pattern(laid: Pattern) -> dict[str, Any]:
    return {
        "kind": laid.kind,
        "vertices": flat(laid.vertices),
        "normals": flat(laid.normals),
        "uv": plane(laid.uv),
        "faces": rows(laid.faces),
        "sheet": None if laid.sheet is None else rows(Ragged(laid.sheet, laid.faces.offsets)),
        "corners": rows(Ragged(plane(laid.corners), laid.faces.offsets)) if laid.sheet is None else None,
        "whole": flat(laid.whole),
        "index": flat(laid.index),
        "neighbours": rows(laid.neighbours),
        "ring": flat(laid.ring),
        "place": flat(laid.place),
        "rings": int(laid.rings),
        "around": int(laid.around),
        "rotation": float(laid.rotation),
        "edge_length": float(laid.edge_length),
        "distortion": float(laid.distortion),
        "features": [flat(feature.vertices) for feature in laid.features],
        "along": [
            {
                "straight": feature.straight,
                "cut": feature.cut,
                "width": feature.width,
                "distortion": feature.distortion,
                "fold": feature.fold,
            }
            for feature in laid.features
        ],
    }


def panels(solution: Solution) -> dict[str, Any] | None:
    made, laid, measured = solution.panels, solution.pattern, solution.quality
    if made is None or laid is None:
        return None
    labels = laid.labels()
    return {
        "mode": made.mode,
        "polygons": rows(made.polygons),
        "face": flat(made.face),
        "label": [labels[i] for i in made.face.tolist()],
        "size": flat(made.size),
        "edge_length": flat(made.edge_length),
        "limit": flat(made.limit),
        "center": flat(made.center),
        "normal": flat(made.normal),
        "whole": flat(made.whole),
        "outside": flat(made.outside),
        "planarity": flat(measured.planarity),
        "edge_deviation": flat(measured.edge_deviation),
        "angle_deviation": flat(measured.angle_deviation),
        "surface_distance": flat(measured.surface_distance),
        "gap_tangential": _widest(measured.gap_tangential, laid.neighbours, made),
        "gap_normal": _widest(measured.gap_normal, laid.neighbours, made),
        "congruence": flat(measured.congruence),
        **bent(made),
    }


def bent(made: Panels) -> dict[str, Any]:
    """Of each panel the corners between which it is bent, the angle there, and the cell of its other half."""
    bends = made.bends
    corner: list[list[int] | None] = [None] * made.n_panels
    if bends is not None:
        for panel, hinge in zip(bends.panel.tolist(), bends.hinge.tolist(), strict=True):
            corner[panel] = [0, hinge]
    other = np.full(made.n_panels, -1)
    if bends is not None:
        other[bends.panel] = bends.other
    return {"bend": corner, "bend_angle": flat(bend_angles(made)), "other_face": flat(other)}


def sizes(made: Panels | None) -> list[dict[str, Any]]:
    if made is None:
        return []
    listed = zip(
        made.class_length.tolist(),
        made.class_count.tolist(),
        made.class_sides.tolist(),
        class_colours(made) if len(made.class_length) else [],
        made.divided.tolist(),
        strict=True,
    )
    return [
        {"size": i, "edge_length": length, "count": count, "sides": sides, "color": colour, "fold": fold}
        for i, (length, count, sides, colour, fold) in enumerate(listed)
    ]


def quality(solution: Solution) -> dict[str, Any]:
    measured = solution.quality
    made = solution.panels
    return {
        "scale_ratio": float(measured.scale_ratio),
        "quasi_conformal": {
            "mean": float(measured.quasi_conformal_mean),
            "max": float(measured.quasi_conformal_max),
        },
        "planarity": summary(measured.planarity, "max", "mean"),
        "edge_deviation": summary(measured.edge_deviation, "max"),
        "angle_deviation": summary(measured.angle_deviation, "max"),
        "surface_distance": summary(measured.surface_distance, "max", "mean"),
        "gap": {
            "tangential": summary(measured.gap_tangential, "min", "mean", "max"),
            "normal": summary(measured.gap_normal, "mean", "max"),
            "over": measured.gaps_over,
        },
        "kink": summary(measured.kink, "mean", "max"),
        "overlaps": None if made is None else int(measured.overlaps),
        "coverage": None if made is None else float(measured.coverage),
        "distinct_panels": 0 if measured.congruence is None else len(np.unique(measured.congruence)),
        "convex": summary(measured.convex, "mean")["mean"],
        "not_convex": 0 if measured.convex is None else int(np.sum(~measured.convex)),
        "movement": float(measured.movement),
        "trade_off": trade_off(made.trade_off) if made and made.trade_off else None,
        "singularity_curve": choices(measured.singularities) if measured.singularities else None,
        "notes": notes(solution),
    }


def choices(found: Choices) -> dict[str, Any]:
    return {
        "sizes": found.sizes,
        "taken": found.taken,
        "coarse": found.coarse,
        "number": flat(found.number),
        "uncovered": flat(found.uncovered),
        "scale_ratio": flat(found.ratio),
        "at": [
            [{"point": flat(point), "index": int(k)} for point, k in zip(points, index, strict=True)]
            for points, index in zip(found.places, found.index, strict=True)
        ],
    }


def trade_off(curve: TradeOff) -> dict[str, Any]:
    return {
        "sizes": flat(curve.sizes),
        "uncovered": flat(curve.uncovered),
        "worst_gap": flat(curve.worst_gap),
        "joint_mean": flat(curve.joint_mean),
        "joint_max": flat(curve.joint_max),
    }


def notes(solution: Solution) -> list[str]:
    """What every stage has to say to the user, each sentence once."""
    stages = (solution.map, solution.pattern, solution.panels, solution.quality)
    return list(dict.fromkeys(note for stage in stages if stage is not None for note in stage.notes))


def components(made: Components) -> dict[str, Any]:
    return {
        "outline": rows(made.outline),
        "origin": flat(made.origin),
        "x_axis": flat(made.x_axis),
        "y_axis": flat(made.y_axis),
        "z_axis": flat(made.z_axis),
        "solid_vertices": made.solid_vertices and rows(made.solid_vertices),
        "solid_faces": made.solid_faces and rows(made.solid_faces),
    }


def support(made: Support) -> dict[str, Any]:
    return {
        "nodes": flat(made.nodes),
        "axes": flat(made.axes),
        "edges": flat(made.edges),
        "strips": flat(made.strips),
        "torsion": flat(made.torsion),
        "tilt": flat(made.tilt),
    }


def summary(values: Floats | Bools | None, *wanted: str) -> dict[str, float | None]:
    """The named statistics of the finite values, null where there are none."""
    finite = np.zeros(0) if values is None else values[np.isfinite(values)]
    return {name: float(getattr(np, name)(finite)) if len(finite) else None for name in wanted}


def rows(ragged: Ragged) -> Any:
    """Rows of equal length as one array, others as lists."""
    lengths = ragged.lengths
    if len(lengths) == 0:
        return []
    if np.all(lengths == lengths[0]):
        return flat(ragged.values.reshape(len(lengths), int(lengths[0]), *ragged.values.shape[1:]))
    values, offsets = ragged.values.tolist(), ragged.offsets.tolist()
    return [values[a:b] for a, b in pairwise(offsets)]


def flat(array: NDArray[Any] | None) -> Any:
    """What orjson asks of an array: contiguous."""
    return None if array is None else np.ascontiguousarray(array)


def plane(z: Complexes) -> Floats:
    """(n, 2) of complex numbers."""
    return np.stack([z.real, z.imag], axis=-1)


def _widest(gap: Floats | None, neighbours: Ragged, made: Panels) -> Floats | None:
    """(q,) the greatest gap of each panel to its neighbours, NaN where it has none."""
    if gap is None or len(gap) != len(neighbours.values) or not neighbours.n_rows:
        return None
    widest: Floats = np.fmax.reduceat(gap, neighbours.offsets[:-1])
    return flat(widest[made.face])  # type: ignore[no-any-return]
