"""A NURBS surface without trims as a Brep of one face: sides are edges, seams shared, poles points."""

from __future__ import annotations

import numpy as np
import scipy

from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface.brep.curves import evaluate_curve
from hexwrap_solver.surface.brep.types import Brep, Edge, Face, NurbsCurve, Trim
from hexwrap_solver.surface.checks import check_extent, check_finite
from hexwrap_solver.surface.nurbs import domain
from hexwrap_solver.surface.nurbs_checks import check_data, closed_within, collapsed
from hexwrap_solver.surface.types import NurbsSurface, premultiplied


def check_brep(brep: Brep | NurbsSurface) -> None:
    """Raises NurbsDataError, NonFiniteError, FlatSurfaceError."""
    surfaces = [face.surface for face in brep.faces] if isinstance(brep, Brep) else [brep]
    for surface in surfaces:
        check_data(surface)
    for edge in brep.edges if isinstance(brep, Brep) else ():
        check_finite(edge.curve.control_points, "Control point of an edge")
    nets = [surface.control_points[..., :3].reshape(-1, 3) for surface in surfaces]
    if nets:
        check_extent(float(np.linalg.norm(np.ptp(np.concatenate(nets), axis=0))))


def brep_of_surface(nurbs: NurbsSurface, tolerance: float) -> Brep:
    """tolerance: ends closer than this are one seam, and a side shorter than this is a pole."""
    closed = closed_within(nurbs, tolerance)
    (u0, u1), (v0, v1) = domain(nurbs, 0), domain(nurbs, 1)
    # The sides counter-clockwise: at v0, u1, v1, u0; the last two run backwards through their curves.
    sides = [(1, v0), (0, u1), (1, v1), (0, u0)]
    curves = [isocurve(nurbs, d, x) for d, x in sides]
    pole = [collapsed(nurbs, d, k, tolerance) for d, k in ((1, 0), (0, 1), (1, 1), (0, 0))]
    name = [0, 1, 2, 3]
    for k in range(4):
        one, two = k, (k + 1) % 4
        if pole[k] or closed[k % 2]:
            low, high = sorted((name[one], name[two]))
            name = [low if x == high else x for x in name]
    points = np.array([_corner(curves, k) for k in range(4)])
    label = {old: new for new, old in enumerate(sorted(set(name)))}
    vertex = [label[x] for x in name]
    edges: list[Edge] = []
    trims = []
    index: dict[int, int] = {}
    for k, curve in enumerate(curves):
        start, end = vertex[k], vertex[(k + 1) % 4]
        if pole[k]:
            trims.append(Trim(-1, False, start, end))
            continue
        backwards = k >= 2
        seam = index.get(k - 2) if closed[1 - k % 2] else None
        if seam is None:
            index[k] = len(edges)
            ends = (end, start) if backwards else (start, end)
            edges.append(Edge(curve, curve.domain, *ends))
        trims.append(Trim(index[k] if seam is None else seam, backwards, start, end))
    used = sorted(label)
    return Brep(points[used], tuple(edges), (Face(nurbs, (tuple(trims),), False),), tolerance)


def isocurve(nurbs: NurbsSurface, direction: int, at: float) -> NurbsCurve:
    """The curve on which the parameter of direction is constant."""
    net = premultiplied(np.moveaxis(nurbs.control_points, direction, 0))
    made = np.asarray(scipy.interpolate.BSpline(nurbs.knots[direction], net, nurbs.degree[direction])(at))
    made[:, :3] /= made[:, 3:]
    return NurbsCurve(nurbs.degree[1 - direction], nurbs.knots[1 - direction], made)


def _corner(curves: list[NurbsCurve], k: int) -> Floats:
    low, high = curves[k].domain
    return np.asarray(evaluate_curve(curves[k], np.array([low if k < 2 else high]))[0][0])
