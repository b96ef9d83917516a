"""Every way in which a sent surface can fail to be one that can be mapped.

SurfaceError
├── of the data
│   ├── EmptySurfaceError        no vertices or no faces
│   ├── ShapeError               an array of the wrong shape
│   ├── NonFiniteError           NaN, infinity, or numbers too large to square
│   ├── IndexRangeError          a face points at a vertex that was not sent
│   ├── PolygonSizeError         a face with other than three or four corners
│   ├── DegeneratePolygonError   a face without area that could not be repaired
│   └── FlatSurfaceError         all vertices in one place or on one line
├── of the topology
│   ├── NonManifoldEdgeError     an edge with three or more faces
│   ├── SeveralComponentsError   more than one piece
│   ├── NotOrientableError       a Möbius band
│   └── HandlesError             a torus, or a surface with handles
├── of what is drawn on it
│   └── DrawnLineError           a line of features.lines that cannot be followed on the surface
└── of a NURBS surface
    ├── NurbsDataError           degree, knots, weights or control points that define no surface
    ├── NotClosedError           closed in no direction, or not where it claims to be
    ├── PoleError                a boundary that shrinks to a point
    ├── TrimError                a face whose boundary cannot be followed on its surface
    └── TooFineError             a mesh of more vertices than allowed
"""

from __future__ import annotations

from hexwrap_solver.errors import SurfaceError


class EmptySurfaceError(SurfaceError, slug="empty-surface", title="The surface is empty"): ...


class ShapeError(
    SurfaceError, slug="malformed-surface", title="The surface's arrays have the wrong shape"
): ...


class NonFiniteError(
    SurfaceError, slug="not-finite", title="The surface has coordinates that are not finite numbers"
): ...


class IndexRangeError(
    SurfaceError, slug="index-out-of-range", title="A face points at a vertex that was not sent"
): ...


class PolygonSizeError(SurfaceError, slug="polygon-size", title="A face is neither triangle nor quad"): ...


class DegeneratePolygonError(SurfaceError, slug="degenerate-face", title="A face has no area"): ...


class FlatSurfaceError(SurfaceError, slug="no-extent", title="The surface has no area"): ...


class NonManifoldEdgeError(
    SurfaceError, slug="non-manifold-edge", title="More than two faces share an edge"
): ...


class SeveralComponentsError(
    SurfaceError, slug="several-components", title="The surface is in several pieces"
): ...


class NotOrientableError(SurfaceError, slug="not-orientable", title="The surface has only one side"): ...


class HandlesError(SurfaceError, slug="handles", title="The surface has handles"):
    """edges: a loop to cut along; data: loops, Euler characteristic, genus and the loop's length."""


class DrawnLineError(
    SurfaceError, slug="feature-line", title="A line drawn on the surface cannot be followed"
):
    """data["line"], data["point"]: the numbers of the line and of its point."""


class NurbsDataError(SurfaceError, slug="nurbs-data", title="The NURBS data define no surface"): ...


class NotClosedError(SurfaceError, slug="nurbs-not-closed", title="The NURBS surface does not close up"): ...


class PoleError(SurfaceError, slug="nurbs-pole", title="The NURBS surface shrinks to a point"): ...


class TrimError(SurfaceError, slug="brep-trim", title="A face of the polysurface has a faulty boundary"):
    """data["face"] is the face's number in the Brep."""


class TooFineError(SurfaceError, slug="mesh-too-fine", title="The mesh would have too many vertices"): ...
