"""Solution → the contract's Result. Arrays go into the text directly; what is not a number becomes null."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import orjson

from hexwrap_server.output.colours import class_colours
from hexwrap_server.output.unrolled import in_pieces, piece_of_cells, plane
from hexwrap_solver.arrays import Bools, Floats, Ragged
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.domain.apart import apart
from hexwrap_solver.panels.folds import bend_angles
from hexwrap_solver.panels.types import Panels
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.pipeline import Solution
from hexwrap_solver.singularities.types import Choices

#: The parts of a Result, in its order.
PARTS = ("unit", "mesh", "map", "pattern", "panels", "sizes", "quality", "components", "support", "timings")
#: Asked for beside parts: ``map`` then has ``corners`` on every kind of domain.
CORNERS = "corners"


def result_json(
    solution: Solution, timings: dict[str, float] | None = None, include: Sequence[str] = PARTS
) -> bytes:
    """The Result as JSON. include: the parts wanted; with CORNERS among them, ``map`` has ``corners``."""
    solution = in_pieces(solution)
    wanted = {*include, "map"} if CORNERS in include else include
    document = {name: part(solution, name, timings or {}) for name in PARTS if name in wanted}
    if CORNERS in include:
        document["map"]["corners"] = solution.map.corners()
    return dump(document)


def part(solution: Solution, name: str, timings: dict[str, float]) -> Any:
    """One part of the Result as a structure that ``dump`` takes. A net is given as it is, see
    ``unrolled.in_pieces``."""
    match name:
        case "mesh":
            names = "vertices faces input_vertex vertex_of_input loops repairs"
            surface = solution.map.surface
            return fields(surface, names) | {"features": [line.vertices for line in surface.features]}
        case "unit":
            return solution.map.surface.unit
        case "map":
            return conformal(solution.map) | {"apart": drawn_apart(solution)}
        case "pattern":
            return solution.pattern and pattern(solution.pattern)
        case "panels":
            return solution.panels and placed(solution) | sized(solution)
        case "sizes":
            return sizes(solution.panels)
        case "quality":
            return quality(solution)
        case "components":
            names = "outline origin x_axis y_axis z_axis solid_vertices solid_faces"
            return solution.components and fields(solution.components, names)
        case "support":
            return solution.support and fields(solution.support, "nodes axes edges strips torsion tilt")
        case _:
            return timings


def fields(of: object, names: str) -> dict[str, Any]:
    """The named attributes, by their names."""
    return {name: getattr(of, name) for name in names.split()}


def dump(value: Any) -> bytes:
    """JSON; arrays as lists, complex numbers as pairs, Ragged as its rows."""
    options = orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_PASSTHROUGH_DATACLASS
    return orjson.dumps(value, _listed, options)


def _listed(value: Any) -> Any:
    """What orjson does not know by itself."""
    if isinstance(value, Ragged):
        lengths = value.lengths
        if len(lengths) and np.all(lengths == lengths[0]):
            return value.values.reshape(len(lengths), int(lengths[0]), *value.values.shape[1:])
        values = np.ascontiguousarray(value.values)
        return [values[a:b] for a, b in pairwise(value.offsets.tolist())]
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, np.ndarray):
        return plane(value) if np.iscomplexobj(value) else np.ascontiguousarray(value)
    raise TypeError(f"{type(value).__name__} has no place in JSON")


def conformal(cmap: ConformalMap) -> dict[str, Any]:
    domain = cmap.domain
    if isinstance(domain, Net):
        sheets: dict[str, Any] = dict.fromkeys(("cone_angle", "uv", "sheet", "deck", "circumference", "apex"))
        sheets["corners"] = domain.corners
    else:
        sheets = {"cone_angle": domain.deck.angle, **fields(domain, "uv sheet")}
        sheets["deck"] = fields(domain.deck, "angle translation")
        sheets["circumference"] = domain.circumference
        sheets["apex"] = None if cmap.kind == "cylinder" else domain.deck.apex
    cones = zip(*(getattr(cmap.cones, name).tolist() for name in ("vertex", "index", "moved")), strict=True)
    return {
        "kind": cmap.kind,
        **sheets,
        "cones": [{"vertex": vertex, "index": index, "moved": moved} for vertex, index, moved in cones],
        **fields(cmap, "log_scale boundary_angles iterations residual flips inserted closing_error"),
    }


def drawn_apart(solution: Solution) -> dict[str, Any] | None:
    """Of a cylinder or cone that overlaps itself, the pieces to draw faces and cells in, and the shift of
    each. The places on a net are those in its pieces."""
    pieces, laid = None if solution.map.kind == "net" else apart(solution.map), solution.pattern
    if pieces is None:
        return None
    cell = None if laid is None else piece_of_cells(laid, pieces)
    return {"face": pieces.piece, "cell": cell, "shift": pieces.shift}


def pattern(laid: Pattern) -> dict[str, Any]:
    offsets, sheet = laid.faces.offsets, laid.sheet
    return {
        **fields(laid, "kind vertices normals uv faces"),
        "sheet": None if sheet is None else Ragged(sheet, offsets),
        "corners": Ragged(plane(laid.corners), offsets) if sheet is None else None,
        **fields(laid, "whole index neighbours ring place rings around rotation edge_length distortion"),
        "features": [feature.vertices for feature in laid.features],
        "along": [fields(feature, "straight cut width distortion fold") for feature in laid.features],
    }


def placed(solution: Solution) -> dict[str, Any]:
    """Of the panels, what depends on nothing else than the pattern, where they lie, and their limits."""
    made, laid = solution.panels, solution.pattern
    assert made is not None
    assert laid is not None
    labels = laid.labels()
    return {
        **fields(made, "mode face"),
        "label": [labels[i] for i in made.face.tolist()],
        **fields(made, "limit center normal whole"),
    }


def sized(solution: Solution) -> dict[str, Any]:
    """The rest, which their lengths change."""
    made, laid, measured = solution.panels, solution.pattern, solution.quality
    assert made is not None
    assert laid is not None
    return {
        **fields(made, "polygons size edge_length outside"),
        **fields(measured, "planarity edge_deviation angle_deviation surface_distance"),
        "gap_tangential": _widest(measured.gap_tangential, laid.neighbours, made),
        "gap_normal": _widest(measured.gap_normal, laid.neighbours, made),
        "congruence": measured.congruence,
        **bent(made),
    }


def bent(made: Panels) -> dict[str, Any]:
    """Of each panel the corners between which it is bent, the angle there, and the cell of its other half."""
    corner: list[list[int] | None] = [None] * made.n_panels
    other = np.full(made.n_panels, -1)
    if made.bends is not None:
        other[made.bends.panel] = made.bends.other
        for panel, hinge in zip(made.bends.panel.tolist(), made.bends.hinge.tolist(), strict=True):
            corner[panel] = [0, hinge]
    return {"bend": corner, "bend_angle": bend_angles(made), "other_face": other}


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
    measured, made = solution.quality, solution.panels
    curve = made and made.trade_off
    return {
        "scale_ratio": measured.scale_ratio,
        "quasi_conformal": {"mean": measured.quasi_conformal_mean, "max": measured.quasi_conformal_max},
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
        "overlaps": None if made is None else measured.overlaps,
        "coverage": None if made is None else measured.coverage,
        "bare": None if made is None else measured.bare,
        "distinct_panels": 0 if measured.congruence is None else len(np.unique(measured.congruence)),
        "convex": summary(measured.convex, "mean")["mean"],
        "not_convex": 0 if measured.convex is None else int(np.sum(~measured.convex)),
        "movement": measured.movement,
        "trade_off": curve and fields(curve, "sizes uncovered worst_gap joint_mean joint_max taken"),
        "singularity_curve": measured.singularities and choices(measured.singularities),
        "notes": notes(solution),
    }


def choices(found: Choices) -> dict[str, Any]:
    return {
        **fields(found, "sizes taken coarse number uncovered"),
        "scale_ratio": found.ratio,
        "at": [
            [{"point": point, "index": k} for point, k in zip(points, index, strict=True)]
            for points, index in zip(found.places, found.index, strict=True)
        ],
    }


def notes(solution: Solution) -> list[str]:
    """What every stage has to say to the user, each sentence once."""
    stages = (solution.map, solution.pattern, solution.panels, solution.quality)
    return list(dict.fromkeys(note for stage in stages if stage is not None for note in stage.notes))


def summary(values: Floats | Bools | None, *wanted: str) -> dict[str, float | None]:
    """The named statistics of the finite values, null where there are none."""
    finite = np.zeros(0) if values is None else values[np.isfinite(values)]
    return {name: float(getattr(np, name)(finite)) if len(finite) else None for name in wanted}


def _widest(gap: Floats | None, neighbours: Ragged, made: Panels) -> Floats | None:
    """(q,) the greatest gap of each panel to its neighbours, NaN where it has none."""
    if gap is None or len(gap) != len(neighbours.values) or not neighbours.n_rows:
        return None
    widest: Floats = np.fmax.reduceat(gap, neighbours.offsets[:-1])
    return widest[made.face]
