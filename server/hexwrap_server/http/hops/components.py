"""The Hops components: what they take and what they give."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hexwrap_solver.pattern.lattice import LATTICES

#: What Hops takes for "as many as there are".
MANY = 2**31 - 1


@dataclass(frozen=True)
class Parameter:
    """One input or output. kind: Grasshopper's name of the type; many: a list instead of one item."""

    name: str
    kind: str
    description: str
    many: bool = False
    required: bool = False
    default: object = None

    def document(self) -> dict[str, Any]:
        """As Hops reads it when the component is placed."""
        described = {
            "Name": self.name,
            "Nickname": self.name,
            "Description": self.description,
            "ParamType": self.kind,
            "ResultType": RESULT_TYPES[self.kind],
            "AtLeast": 1 if self.required else 0,
            "AtMost": MANY if self.many else 1,
        }
        return described if self.default is None else described | {"Default": self.default}


RESULT_TYPES = {
    "Curve": "Rhino.Geometry.PolylineCurve",
    "Integer": "System.Int32",
    "Mesh": "Rhino.Geometry.Mesh",
    "Number": "System.Double",
    "Plane": "Rhino.Geometry.Plane",
    "Point": "Rhino.Geometry.Point3d",
    "Text": "System.String",
}


@dataclass(frozen=True)
class Component:
    """One Hops component."""

    description: str
    inputs: tuple[Parameter, ...]
    outputs: tuple[Parameter, ...]

    def document(self) -> dict[str, Any]:
        return {
            "Description": self.description,
            "Inputs": [p.document() for p in self.inputs],
            "Outputs": [p.document() for p in self.outputs],
        }


PANELS = "/hops/panels"
LIFT = "/hops/lift"
COMPONENTS = {
    PANELS: Component(
        "Flat, regular panels on a tube-like mesh (hexwrap)",
        (
            Parameter("Mesh", "Mesh", "a mesh like a tube, with two boundary loops", required=True),
            Parameter("Mode", "Text", "auto, straight, angles or isometric; angles where Points are given"),
            Parameter("Points", "Point", "corners on the boundary", many=True),
            Parameter("Angles", "Number", "degrees, one per point, or one for all", many=True),
            Parameter("Kind", "Text", ", ".join(LATTICES), default="hex"),
            Parameter("Around", "Integer", "cells around; 0 leaves it to the server", default=0),
            Parameter("Sizes", "Integer", "different panel sizes; 0 for one per panel", default=11),
            Parameter("Target", "Text", "inscribed, best, shortest or mean", default="inscribed"),
            Parameter("Unit", "Text", "of the model: m, cm, mm, ft or in; for messages and files"),
        ),
        (
            Parameter("Panels", "Curve", "closed outlines, one branch per ring", many=True),
            Parameter("Labels", "Text", "labels of the panels", many=True),
            Parameter("Size", "Integer", "size class of each panel", many=True),
            Parameter("Planes", "Plane", "plane of each panel: x along its first edge, z outward", many=True),
            Parameter("Flat", "Curve", "the cells of the pattern in the unrolled domain", many=True),
            Parameter("Report", "Text", "the figures"),
            Parameter("Job", "Text", "for the component /hops/lift"),
        ),
    ),
    LIFT: Component(
        "Curves drawn in the unrolled domain, put onto the surface (hexwrap)",
        (
            Parameter("Job", "Text", "output Job of /hops/panels", required=True),
            Parameter("Curves", "Curve", "curves drawn over the output Flat", many=True, required=True),
        ),
        (
            Parameter("Lifted", "Curve", "the curves on the surface, broken where they leave it", many=True),
            Parameter("Outside", "Integer", "how many points of the drawing have no place on the surface"),
        ),
    ),
}
