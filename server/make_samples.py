"""Makes the bundled samples: ``python server/make_samples.py``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import rhino3dm

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.surface import NurbsSurface
from hexwrap_solver.surface.nurbs import domain, evaluate_points

DEGREE = 3
#: Coordinates are kept to a tenth of a millimetre, lengths being in metres.
DIGITS = 4
#: Half the width of an entrance, as a fraction of a turn.
ENTRANCE = 0.0325


def loft(rings: Floats) -> NurbsSurface:
    """Cubic surface, periodic around and clamped along, from (rings, around, 3) control points."""
    rows, around, _ = rings.shape
    wrapped = np.concatenate([rings, rings[:, :DEGREE]], axis=1).transpose(1, 0, 2).round(DIGITS)
    net = np.concatenate([wrapped, np.ones((*wrapped.shape[:2], 1))], axis=2)
    periodic = np.arange(-DEGREE, around + DEGREE + 1, dtype=float)
    inner = np.arange(rows - DEGREE + 1, dtype=float)
    clamped = np.concatenate([np.repeat(inner[:1], DEGREE), inner, np.repeat(inner[-1:], DEGREE)])
    return NurbsSurface((DEGREE, DEGREE), (periodic, clamped), net, (True, False))


def _angles(around: int) -> Floats:
    """Of the control points; a cubic periodic curve begins at its second one, so the seam is at angle 0."""
    return (np.arange(around) - 1) / around * 2 * np.pi


def tower() -> NurbsSurface:
    """As in Figure 1: 60 m high, its plan turning from a rounded triangle into an oval, its girth halved at
    the waist, its roof cut aslant."""
    t = np.linspace(0, 1, 8)[:, None]
    a = _angles(12)
    radius = np.array([17.0, 15.6, 12.2, 8.6, 7.2, 7.8, 9.6, 11.2])[:, None]
    lobes = 1 + 0.2 * (1 - t) ** 2 * np.cos(3 * a) + 0.16 * t**2 * np.cos(2 * a)
    turn = a + 1.25 * t
    x = radius * lobes * np.cos(turn) + 7.0 * t**2
    y = radius * lobes * np.sin(turn) - 3.0 * np.sin(np.pi * t)
    z = 60.0 * t + 2.5 * t**3 * np.cos(turn - 0.6)
    return loft(np.stack([x, y, z], axis=2))


def facade() -> NurbsSurface:
    """As in the case study: an exhibition hall of 60 m × 40 m × 20 m, nearly an extrusion of a rounded plan,
    its walls leaning out a little and its eaves rising and falling."""
    t = np.linspace(0, 1, 6)[:, None]
    a = _angles(24)
    power = 2 / 3.4  # superellipse
    x = 30.6 * np.sign(np.cos(a)) * np.abs(np.cos(a)) ** power
    y = 20.4 * np.sign(np.sin(a)) * np.abs(np.sin(a)) ** power
    lean = 1 + 0.05 * np.sin(np.pi * t * 0.75) + 0.02 * t * np.cos(2 * a)
    z = 20.0 * t + 0.9 * t**2 * np.cos(2 * a)
    return loft(np.stack([x * lean, y * lean, z + 0 * a], axis=2))


def waist() -> NurbsSurface:
    """A hyperboloid of one sheet with elliptic plan, exact: negatively curved everywhere, 44 m high."""
    rim = np.arccosh(2.0)  # ends twice as wide as the waist
    circle = np.array(
        [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float
    )
    weights = np.array([1, np.sqrt(0.5)] * 4 + [1])
    radius, height = np.array([2.0, 0.5, 2.0]), np.array([-1.0, 0.0, 1.0]) * np.sinh(rim)
    net = np.zeros((9, 3, 4))
    net[..., 0] = 9.0 * circle[:, :1] * radius
    net[..., 1] = 7.5 * circle[:, 1:] * radius
    net[..., 2] = 22.0 * (1 + height / np.sinh(rim))
    net[..., 3] = weights[:, None] * np.array([1.0, 2.0, 1.0])
    net[..., :3] = net[..., :3].round(DIGITS)
    around = np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], dtype=float)
    along = np.array([0, 0, 0, 1, 1, 1], dtype=float)
    return NurbsSurface((2, 2), (around, along), net, (True, False))


def tent() -> NurbsSurface:
    """A hall like a tent, 30 m high, on three rounded feet, rising steeply to an eye in the roof."""
    t = np.linspace(0, 1, 8)[:, None]
    a = _angles(18)
    radius = np.array([24.0, 21.4, 18.4, 15.4, 12.6, 10.2, 8.3, 7.0])[:, None]
    radius = radius * (1 + 0.15 * (1 - t) ** 1.5 * np.cos(3 * a))
    z = 30.0 * t**0.9 + 1.2 * t**2 * np.cos(3 * a)
    return loft(np.stack([radius * np.cos(a), radius * np.sin(a), z], axis=2))


def pavilion() -> NurbsSurface:
    """A round hall of 28 m that swells between ground and roof, 13.35 m high: so that 22 rows of the cells
    of ``entrance`` fill it nearly without a stretch."""
    t = np.linspace(0, 1, 6)[:, None]
    a = _angles(16)
    radius = 13.0 + 2.6 * np.sin(np.pi * (0.15 + 0.7 * t)) + 0.5 * np.cos(2 * a) * t
    z = 13.35 * t + 0.7 * t**2 * np.cos(2 * a)
    return loft(np.stack([radius * np.cos(a), 0.92 * radius * np.sin(a), z], axis=2))


def trunk() -> NurbsSurface:
    """A column of 24 m that opens like a trumpet towards the roof it carries."""
    t = np.linspace(0, 1, 8)[:, None]
    a = _angles(16)
    radius = np.array([6.4, 5.6, 4.8, 4.4, 4.5, 5.4, 7.4, 9.6])[:, None]
    radius = radius * (1 + 0.1 * t**2 * np.cos(4 * a))
    return loft(np.stack([radius * np.cos(a), radius * np.sin(a), 24.0 * t + 0 * a], axis=2))


def canopy() -> NurbsSurface:
    """A ring-shaped roof over a court, 64 m across, gently waved, with the court off its centre."""
    t = np.linspace(0, 1, 7)[:, None]
    a = _angles(20)
    radius = 32.0 - 19.0 * t + 1.2 * (1 - t) * np.cos(3 * a + 0.4)
    x = radius * np.cos(a) + 4.0 * t
    y = 0.82 * radius * np.sin(a) + 1.5 * t
    z = 6.0 + 1.6 * (1 - t) ** 2 * np.cos(3 * a) + 2.4 * np.sin(np.pi * t) * 0.5
    return loft(np.stack([x, y, z], axis=2))


def at(surface: NurbsSurface, end: int, turns: Sequence[float]) -> list[list[float]]:
    """Points of the first (end 0) or last boundary, at fractions of one turn in the parameter."""
    (low, high), along = domain(surface, 0), domain(surface, 1)[end]
    parameters = [[low + (high - low) * turn, along] for turn in turns]
    points: list[list[float]] = evaluate_points(surface, np.array(parameters)).round(DIGITS).tolist()
    return points


def corners(points: list[list[float]], angle: float) -> list[dict[str, Any]]:
    """Boundary angles, in multiples of π."""
    return [{"point": point, "angle": angle} for point in points]


def body(name: str, surface: NurbsSurface, max_edge: float | None = None, **request: Any) -> dict[str, Any]:
    """A request body with the surface inline. max_edge: of its mesh, where the default is not fine enough."""
    nurbs = {
        "degree": list(surface.degree),
        "knots": [k.tolist() for k in surface.knots],
        "control_points": surface.control_points.tolist(),
        "closed": list(surface.closed),
    }
    mesh = {} if max_edge is None else {"mesh": {"max_edge": max_edge}}
    return {"name": name, "surface": {"nurbs": nurbs, **mesh}, **request}


@dataclass(frozen=True)
class Facets:
    """A mesh as it is sent. points: (n, 3). faces: (m, 4) quads, or triangles whose last corner comes twice,
    as Rhino keeps them."""

    points: Floats
    faces: Ints

    def rows(self) -> list[list[int]]:
        """Three corners of triangles, four of quads."""
        return [row[:3] if row[2] == row[3] else row for row in self.faces.tolist()]


def _quads(around: int, rows: int) -> Ints:
    """(rows, around, 4) faces between closed rings of vertices, row after row."""
    row, column = np.indices((rows, around))
    a, b = column + around * row, (column + 1) % around + around * row
    return np.stack([a, b, b + around, a + around], axis=-1)


def shell() -> Facets:
    """The roof of a market hall, 42 m × 28 m: vaulted between four straight eaves, higher at one end."""
    n, m = 60, 40
    u, v = (t.ravel() for t in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1)))
    rise = (4 * u * (1 - u)) ** 0.8 * (4 * v * (1 - v)) ** 0.8
    points = np.stack([42 * u, 28 * v, 6 + (4.6 + 2.2 * u) * rise], axis=1)
    return Facets(points.round(DIGITS), _quads(n + 1, m)[:, :n].reshape(-1, 4))


def cupola() -> Facets:
    """An oval dome, 40 m × 32 m and 13 m high: rings of 6, 12, 18 … vertices around the crown."""
    rings = 36
    start = np.cumsum([0, 1, *(6 * r for r in range(1, rings + 1))])
    points, faces = [np.zeros((1, 2))], []
    for r in range(1, rings + 1):
        turn = 2 * np.pi * np.arange(6 * r) / (6 * r)
        points.append(np.sin(r / rings * np.pi / 2.2) * np.stack([np.cos(turn), np.sin(turn)], axis=1))
        sector, k = (t.ravel() for t in np.meshgrid(np.arange(6), np.arange(r), indexing="ij"))
        outer = start[r] + np.stack([sector * r + k, (sector * r + k + 1) % (6 * r)], axis=1)
        inner = (sector * (r - 1) + k)[:, None] + [0, 1]
        inner = start[r - 1] + inner % max(6 * (r - 1), 1)
        faces.append(np.stack([outer[:, 0], outer[:, 1], inner[:, 0], inner[:, 0]], axis=1))
        full = k < r - 1
        faces.append(np.stack([inner[:, 0], outer[:, 1], inner[:, 1], inner[:, 1]], axis=1)[full])
    xy = np.concatenate(points)
    height = 13 * (np.sqrt(np.maximum(1 - (xy**2).sum(axis=1), 0)) - np.cos(np.pi / 2.2))
    return Facets(
        np.column_stack([20 * xy[:, 0], 16 * xy[:, 1], height]).round(DIGITS), np.concatenate(faces)
    )


def house() -> Facets:
    """A round tower of 27 m with a door and twelve windows."""
    n, m = 96, 72
    turn, t = 2 * np.pi * np.arange(n) / n, np.linspace(0, 1, m + 1)[:, None]
    radius = (7.2 + 1.5 * np.cos(2.6 * t - 0.3)) * (1 + 0.06 * t * np.cos(2 * turn))
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn), 27 * t + 0 * turn], axis=2).reshape(
        -1, 3
    )
    openings = [(77, 83, 2, 10)]  # the door: columns, then rows
    for floor, row in enumerate((18, 33, 48)):
        openings += [(24 * k + 5 + 8 * floor, 24 * k + 10 + 8 * floor, row, row + 7) for k in range(4)]
    j, i = np.indices((m, n))
    wall = np.ones((m, n), dtype=bool)
    for left, right, low, high in openings:
        column = (i - left) % n
        wall &= ~((column < right - left) & (j >= low) & (j < high))
    used, faces = np.unique(_quads(n, m)[wall], return_inverse=True)
    return Facets(points[used].round(DIGITS), faces.reshape(-1, 4))


@dataclass(frozen=True)
class Patches:
    """A tube of several surfaces that meet at creases, and its mesh."""

    surfaces: tuple[NurbsSurface, ...]
    mesh: Facets


def _flat(corners: Floats) -> NurbsSurface:
    """The bilinear surface of (2, 2, 3) corners."""
    net = np.concatenate([corners, np.ones((2, 2, 1))], axis=2)
    knots = np.array([0.0, 0.0, 1.0, 1.0])
    return NurbsSurface((1, 1), (knots, knots), net, (False, False))


def _between(rings: Floats) -> Facets:
    """Quads between closed rings (rows, around, 3)."""
    rows, around, _ = rings.shape
    return Facets(rings.reshape(-1, 3).round(DIGITS), _quads(around, rows - 1).reshape(-1, 4))


def box() -> Patches:
    """A tower of 30 m × 20 m × 60 m, its four walls flat."""
    plan = np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 20.0], [0.0, 20.0]])
    walls, ring = [], []
    for a, b in zip(plan, np.roll(plan, -1, axis=0), strict=True):
        low = np.column_stack([[a, b], [0.0, 0.0]])
        walls.append(_flat(np.stack([low, low + np.array([0.0, 0.0, 60.0])], axis=1)))
        pieces = round(float(np.linalg.norm(b - a)) / 1.25)
        ring.append(a + np.arange(pieces)[:, None] / pieces * (b - a))
    around = np.concatenate(ring)
    height = np.linspace(0, 60, 49)
    rings = np.stack([np.column_stack([around, np.full(len(around), z)]) for z in height])
    return Patches(tuple(walls), _between(rings))


def patches() -> Patches:
    """A pavilion of 32 m × 28 m in three rings: upright, then leaning out from a level crease on, and in
    again from one that rises and falls by 5 m."""
    a = _angles(12)
    wave = 2.5 * np.cos(2 * a)
    size = [(11.0, 0.0 * wave), (11.0, 9.0 + 0.0 * wave), (16.0, 17.0 + wave), (7.5, 27.0 + 0.6 * wave)]
    rings = [np.stack([1.15 * r * np.cos(a), r * np.sin(a), z], axis=1) for r, z in size]
    surfaces = tuple(
        loft(np.stack([low + t * (high - low) for t in (0, 1 / 3, 2 / 3, 1)]))
        for low, high in pairwise(rings)
    )
    rows = [np.zeros((0, 96, 3))]
    for k, surface in enumerate(surfaces):
        (u0, u1), (v0, v1) = domain(surface, 0), domain(surface, 1)
        u, v = u0 + (u1 - u0) * np.arange(96) / 96, np.linspace(v0, v1, 13)[(k > 0) :]
        grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        rows.append(evaluate_points(surface, grid).reshape(len(v), 96, 3))
    return Patches(surfaces, _between(np.concatenate(rows)))


def requests() -> list[tuple[NurbsSurface | Facets | Patches, dict[str, Any]]]:
    """Every sample: its surface and its request body."""
    tubes = [_tower(), _facade(), _waist(), _cone(), _isometric(), _entrance(), _diagrid(), _ring()]
    return [*tubes, _singular(), _roof(), _dome(), _openings(), *_folded()]


def _folded() -> list[tuple[Patches, dict[str, Any]]]:
    """The pattern folds where the building does."""
    made = []
    for name, shape, around in (("box", box(), 60), ("patches", patches(), 54)):
        pattern = {"kind": "hex", "around": around, "boundary": "trim"}
        _, request = _of_mesh(name, shape.mesh, pattern=pattern)
        request["surface"]["features"] = {"angle": 20.0}
        made.append((shape, request))
    return made


def _of_mesh(name: str, mesh: Facets, **request: Any) -> tuple[Facets, dict[str, Any]]:
    surface = {"vertices": mesh.points.tolist(), "faces": mesh.rows()}
    return mesh, {"name": name, "surface": surface, **request}


def _roof() -> tuple[Facets, dict[str, Any]]:
    """A rectangle, four corners of π/2: quads fit all four sides."""
    corners = [{"vertex": v, "angle": 0.5} for v in (0, 60, 61 * 41 - 1, 61 * 40)]
    return _of_mesh(
        "roof",
        shell(),
        boundary={"mode": "angles", "angles": corners, "angle_unit": "pi"},
        pattern={"kind": "quad", "edge_length": 1.25},
    )


def _dome() -> tuple[Facets, dict[str, Any]]:
    """One loop, whose length is kept; cells at the ground are cut."""
    return _of_mesh(
        "dome",
        cupola(),
        boundary={"mode": "isometric"},
        pattern={"kind": "hex", "edge_length": 0.85, "boundary": "trim"},
    )


def _openings() -> tuple[Facets, dict[str, Any]]:
    """The pattern runs past door and windows, and is cut there."""
    return _of_mesh("openings", house(), pattern={"kind": "hex", "around": 54, "boundary": "trim"})


def _tower() -> tuple[NurbsSurface, dict[str, Any]]:
    """Figures 1 and 5, left: a straight cylinder."""
    surface = tower()
    return surface, body("tower", surface, pattern={"kind": "hex", "around": 48})


def _facade() -> tuple[NurbsSurface, dict[str, Any]]:
    """The case study: panels with edges between 1.5 and 2 m."""
    surface = facade()
    return surface, body(
        "facade",
        surface,
        pattern={"kind": "hex", "edge_length": 1.78},
        panels={"sizes": 11, "edge_range": [1.5, 2.0]},
    )


def _waist() -> tuple[NurbsSurface, dict[str, Any]]:
    surface = waist()
    return surface, body("waist", surface, pattern={"kind": "hex", "around": 48})


def _cone() -> tuple[NurbsSurface, dict[str, Any]]:
    """Figure 5, middle: three corners of 2π/3 below and three of 4π/3 above, on a cone."""
    surface = tent()
    thirds = [0.0, 1 / 3, 2 / 3]
    angles = corners(at(surface, 0, thirds), 2 / 3) + corners(at(surface, 1, thirds), 4 / 3)
    return surface, body(
        "cone",
        surface,
        boundary={"mode": "angles", "angles": angles, "angle_unit": "pi"},
        pattern={"kind": "hex", "around": 52},
    )


def _isometric() -> tuple[NurbsSurface, dict[str, Any]]:
    """Figure 5, right: boundary lengths kept, on the nearest cone that fits hexagons."""
    surface = tent()
    return surface, body(
        "isometric", surface, boundary={"mode": "isometric"}, pattern={"kind": "hex", "around": 52}
    )


def _entrance() -> tuple[NurbsSurface, dict[str, Any]]:
    """Figure 7, left: two entrances, each of 4π/3, π/3, 4π/3 on the ground, on a straight cylinder.

    As wide as 12 cells' edges are long in the domain. Cells beside a corner of 4π/3 are not larger than a few
    triangles of the default mesh, on which they would come out uneven.
    """
    surface = pavilion()
    angles = []
    for middle in (0.25, 0.75):
        left, tip, right = at(surface, 0, [middle - ENTRANCE, middle, middle + ENTRANCE])
        angles += [*corners([left], 4 / 3), *corners([tip], 1 / 3), *corners([right], 4 / 3)]
    return surface, body(
        "entrance",
        surface,
        max_edge=0.3,
        boundary={"mode": "angles", "angles": angles, "angle_unit": "pi"},
        pattern={"kind": "hex", "edge_length": 0.7},
    )


def _diagrid() -> tuple[NurbsSurface, dict[str, Any]]:
    """Figure 7, right: a diagrid that thickens towards four feet with small angles on the ground."""
    surface = trunk()
    angles = []
    for middle in np.arange(4) / 4 + 0.125:
        outer, inner = 0.09, 0.025
        places = at(surface, 0, [middle - outer, middle - inner, middle + inner, middle + outer])
        for place, angle in zip(places, (4 / 3, 2 / 3, 2 / 3, 4 / 3), strict=True):
            angles += corners([place], angle)
    return surface, body(
        "diagrid",
        surface,
        boundary={"mode": "angles", "angles": angles, "angle_unit": "pi"},
        pattern={"kind": "triangle", "around": 64},
    )


def _ring() -> tuple[NurbsSurface, dict[str, Any]]:
    """A flat ring: its cone angle is a full turn, and its deck transformation a translation again."""
    surface = canopy()
    return surface, body(
        "ring", surface, boundary={"mode": "isometric"}, pattern={"kind": "hex", "around": 72}
    )


def _singular() -> tuple[NurbsSurface, dict[str, Any]]:
    """The tower again, with three heptagons that make its hexagons nearly equal."""
    surface = tower()
    return surface, body(
        "singular",
        surface,
        boundary={"mode": "isometric"},
        singularities={"count": "auto"},
        pattern={"kind": "hex", "around": 48, "boundary": "trim"},
    )


def rhino_model(name: str, *surfaces: NurbsSurface) -> rhino3dm.File3dm:
    """The surfaces as Rhino keeps them: no first and last knot, control points times their weights."""
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Meters
    attributes = rhino3dm.ObjectAttributes()
    attributes.Name = name
    for surface in surfaces:
        n, m = surface.control_points.shape[:2]
        rational = bool(np.ptp(surface.control_points[..., 3]) > 0)
        out = rhino3dm.NurbsSurface.Create(3, rational, surface.degree[0] + 1, surface.degree[1] + 1, n, m)
        for knots, place in zip(surface.knots, (out.KnotsU, out.KnotsV), strict=True):
            for i, knot in enumerate(knots[1:-1].tolist()):
                place[i] = knot
        for i, row in enumerate(surface.control_points.tolist()):
            for j, (x, y, z, w) in enumerate(row):
                out.Points[i, j] = rhino3dm.Point4d(x * w, y * w, z * w, w)
        model.Objects.Add(out, attributes)
    return model


def mesh_model(name: str, mesh: Facets) -> rhino3dm.File3dm:
    """The mesh as Rhino keeps it."""
    out = rhino3dm.Mesh()
    for x, y, z in mesh.points.tolist():
        out.Vertices.Add(x, y, z)
    for face in mesh.faces.tolist():
        out.Faces.AddFace(*face)
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Meters
    attributes = rhino3dm.ObjectAttributes()
    attributes.Name = name
    model.Objects.Add(out, attributes)
    return model


def make(folder: Path) -> None:
    """Writes NAME.json and NAME.3dm of every sample."""
    for surface, request in requests():
        name = request["name"]
        text = json.dumps(request, separators=(",", ":")) + "\n"
        (folder / f"{name}.json").write_text(text, encoding="utf-8", newline="\n")
        if isinstance(surface, Facets):
            model = mesh_model(name, surface)
        else:
            model = rhino_model(name, *(surface.surfaces if isinstance(surface, Patches) else (surface,)))
        model.Write(str(folder / f"{name}.3dm"), 7)


if __name__ == "__main__":
    make(Path(__file__).parent / "hexwrap_server" / "samples")
