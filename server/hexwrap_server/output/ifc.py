"""``panels.ifc``: a curtain wall of plates (IFC4, Reference View), each an instance of its size's type.

Every plate has a place of its own and shows the geometry of its type through a mapped item, so that a
facade of thousands of panels stays small. Cut cells carry their own geometry.
"""

from __future__ import annotations

import uuid

import numpy as np

from hexwrap_server.output.blocks import Blocks, Shape, colours_of
from hexwrap_server.output.layers import size_name
from hexwrap_server.output.meta import Meta, panels_of
from hexwrap_server.output.step import Lines, guid, listed, real, reals, text
from hexwrap_server.output.text import one_line
from hexwrap_server.output.units import UNITS
from hexwrap_solver.arrays import Ints
from hexwrap_solver.panels.types import Panels
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.pipeline import Solution

SPACE = uuid.UUID("5a3c9a0f-5c0f-4e0e-9d77-2d2f6a1c3b60")


def panels_ifc(solution: Solution, meta: Meta) -> bytes:
    """IFC4 as ASCII. Lengths in the model's unit, metres where it has none."""
    pattern, panels = panels_of(solution, "panels.ifc")
    title = one_line(meta.name) or "hexwrap"
    model = _Model(title, meta)
    blocks = Blocks.of(panels, solution.components)
    types = [model.plate_type(blocks, k, panels) for k in range(len(blocks.size))]
    plates = _plates(model, blocks, types, pattern, panels)
    for kind, reference in enumerate(types):
        model.define_type(kind, reference[0], [plates[i] for i in np.flatnonzero(blocks.block == kind)])
    storeys = storey_of(panels, meta.storey)
    for number in np.unique(storeys).tolist():
        inside = [plates[i] for i in np.flatnonzero(storeys == number)]
        model.curtain_wall(number, inside, panels, meta.storey)
    return model.file()


def storey_of(panels: Panels, height: float | None) -> Ints:
    """(q,) number of the storey in which a panel's centre lies, from the lowest corner on; 0 without
    storeys."""
    if height is None:
        return np.zeros(panels.n_panels, dtype=np.int64)
    lowest = np.asarray(panels.polygons.values)[:, 2].min()
    return np.asarray(np.floor((panels.center[:, 2] - lowest) / height), dtype=np.int64)


class _Model:
    """The file as it grows."""

    def __init__(self, title: str, meta: Meta) -> None:
        self.title, self.lines = title, Lines()
        add = self.lines.add
        self.zero = add("IFCCARTESIANPOINT", "(0.,0.,0.)")
        self.here = add("IFCAXIS2PLACEMENT3D", self.zero, "$", "$")
        self.place = add("IFCLOCALPLACEMENT", "$", self.here)
        self.as_it_is = add("IFCCARTESIANTRANSFORMATIONOPERATOR3D", "$", "$", self.zero, "1.", "$")
        context = add("IFCGEOMETRICREPRESENTATIONCONTEXT", "$", "'Model'", "3", "1.E-06", self.here, "$")
        self.body = add(
            "IFCGEOMETRICREPRESENTATIONSUBCONTEXT", "'Body'", "'Model'", "*", "*", "*", "*", context, "$",
            ".MODEL_VIEW.", "$",
        )  # fmt: skip
        project = add(
            "IFCPROJECT", self.guid("project"), "$", text(title), "$", "$", "$", "$", listed([context]),
            self.units(meta.unit),
        )  # fmt: skip
        self.building = add(
            "IFCBUILDING", self.guid("building"), "$", text(title), "$", "$", self.place, "$", "$",
            ".ELEMENT.", "$", "$", "$",
        )  # fmt: skip
        add("IFCRELAGGREGATES", self.guid("in project"), "$", "$", "$", project, listed([self.building]))
        self.shared: dict[tuple[str, str], str] = {}
        self.placed: list[str] = []

    def guid(self, name: str) -> str:
        return guid(SPACE, f"{self.title}/{name}")

    def units(self, name: str | None) -> str:
        add = self.lines.add
        metre = add("IFCSIUNIT", "*", ".LENGTHUNIT.", "$", ".METRE.")
        prefix = {"mm": ".MILLI.", "cm": ".CENTI."}.get(name or "")
        length = metre
        if prefix:
            length = add("IFCSIUNIT", "*", ".LENGTHUNIT.", prefix, ".METRE.")
        elif name in ("ft", "in"):
            factor = add("IFCMEASUREWITHUNIT", f"IFCLENGTHMEASURE({real(UNITS[name].metres)})", metre)
            size = add("IFCDIMENSIONALEXPONENTS", "1", "0", "0", "0", "0", "0", "0")
            word = "'FOOT'" if name == "ft" else "'INCH'"
            length = add("IFCCONVERSIONBASEDUNIT", size, ".LENGTHUNIT.", word, factor)
        area = add("IFCSIUNIT", "*", ".AREAUNIT.", "$", ".SQUARE_METRE.")
        volume = add("IFCSIUNIT", "*", ".VOLUMEUNIT.", "$", ".CUBIC_METRE.")
        angle = add("IFCSIUNIT", "*", ".PLANEANGLEUNIT.", "$", ".RADIAN.")
        return add("IFCUNITASSIGNMENT", listed([length, area, volume, angle]))

    def value(self, name: str, value: str) -> str:
        """A property; equal ones are written once."""
        if (name, value) not in self.shared:
            self.shared[name, value] = self.lines.add("IFCPROPERTYSINGLEVALUE", text(name), "$", value, "$")
        return self.shared[name, value]

    def properties(self, name: str, owner: str, values: dict[str, str]) -> str:
        every = listed(self.value(key, value) for key, value in values.items())
        return self.lines.add("IFCPROPERTYSET", self.guid(owner), "$", text(name), "$", every)

    def geometry(self, shape: Shape, size: str, colour: str) -> str:
        """A shape as a polygonal face set in its size's colour."""
        add = self.lines.add
        points = add("IFCCARTESIANPOINTLIST3D", f"({','.join(reals(p) for p in shape.points.tolist())})")
        faces = [
            add("IFCINDEXEDPOLYGONALFACE", f"({','.join(str(k + 1) for k in face)})") for face in shape.faces
        ]
        closed = ".T." if shape.closed else ".F."
        item = add("IFCPOLYGONALFACESET", points, closed, listed(faces), "$")
        if (size, colour) not in self.shared:
            parts = (real(int(colour[k : k + 2], 16) / 255) for k in (1, 3, 5))
            shade = add("IFCSURFACESTYLESHADING", add("IFCCOLOURRGB", "$", *parts), "0.")
            self.shared[size, colour] = add("IFCSURFACESTYLE", text(size), ".BOTH.", listed([shade]))
        add("IFCSTYLEDITEM", item, listed([self.shared[size, colour]]), "$")
        return add("IFCSHAPEREPRESENTATION", self.body, "'Body'", "'Tessellation'", listed([item]))

    def plate_type(self, blocks: Blocks, block: int, panels: Panels) -> tuple[str, str]:
        """(IfcPlateType, its IfcRepresentationMap) of a block."""
        size, name = int(blocks.size[block]), blocks.name(block)
        shape = self.geometry(blocks.shape(int(blocks.made_from[block])), name, colours_of(panels)[size])
        shown = self.lines.add("IFCREPRESENTATIONMAP", self.here, shape)
        facts = {
            "Size": f"IFCINTEGER({size})",
            "EdgeLength": f"IFCPOSITIVELENGTHMEASURE({real(float(panels.class_length[size]))})",
            "Sides": f"IFCINTEGER({len(blocks.outline[int(blocks.made_from[block])])})",
            "Count": f"IFCINTEGER({int(np.sum(panels.size == size))})",
        }
        known = self.properties("Hexwrap_Size", f"size {size} properties", facts)
        plate = self.lines.add(
            "IFCPLATETYPE", self.guid(f"size {size}"), "$", text(name), "$", "$", listed([known]),
            listed([shown]), "$", "$", ".CURTAIN_PANEL.",
        )  # fmt: skip
        return plate, shown

    def define_type(self, number: int, reference: str, plates: list[str]) -> None:
        self.lines.add(
            "IFCRELDEFINESBYTYPE", self.guid(f"of type {number}"), "$", "$", "$", listed(plates), reference
        )

    def plate(
        self, label: str, pose: tuple[list[float], list[float], list[float]], shape: str, kind: str
    ) -> str:
        """pose: origin, x, z. kind: '$' where a type says what kind of plate it is."""
        add = self.lines.add
        origin, x, z = pose
        corner = add("IFCCARTESIANPOINT", reals(origin))
        axes = add("IFCAXIS2PLACEMENT3D", corner, *(add("IFCDIRECTION", reals(axis)) for axis in (z, x)))
        place = add("IFCLOCALPLACEMENT", self.place, axes)
        whole = add("IFCPRODUCTDEFINITIONSHAPE", "$", "$", listed([shape]))
        return add("IFCPLATE", self.guid(label), "$", text(label), "$", "$", place, whole, "$", kind)

    def mapped(self, shown: str) -> str:
        if ("mapped", shown) not in self.shared:  # plates differ by their placement only
            self.shared["mapped", shown] = self.lines.add("IFCMAPPEDITEM", shown, self.as_it_is)
        item = self.shared["mapped", shown]
        return self.lines.add(
            "IFCSHAPEREPRESENTATION", self.body, "'Body'", "'MappedRepresentation'", listed([item])
        )

    def describe(self, label: str, plate: str, values: dict[str, str]) -> None:
        known = self.properties("Hexwrap", f"{label} properties", values)
        self.lines.add(
            "IFCRELDEFINESBYPROPERTIES",
            self.guid(f"{label} described"),
            "$",
            "$",
            "$",
            listed([plate]),
            known,
        )

    def curtain_wall(self, number: int, plates: list[str], panels: Panels, height: float | None) -> None:
        """One wall for the building, or one in each of its storeys."""
        add, name = self.lines.add, self.title
        where = self.building
        if height is not None:
            level = float(np.asarray(panels.polygons.values)[:, 2].min()) + number * height
            name = f"{self.title}, storey {number}"
            where = add(
                "IFCBUILDINGSTOREY", self.guid(f"storey {number}"), "$", text(f"Storey {number}"), "$", "$",
                self.place, "$", "$", ".ELEMENT.", real(level),
            )  # fmt: skip
            self.placed.append(where)
        wall = add(
            "IFCCURTAINWALL", self.guid(f"wall {number}"), "$", text(name), "$", "$", self.place, "$", "$",
            ".NOTDEFINED.",
        )  # fmt: skip
        add("IFCRELAGGREGATES", self.guid(f"in wall {number}"), "$", "$", "$", wall, listed(plates))
        held = self.guid(f"holds wall {number}")
        add("IFCRELCONTAINEDINSPATIALSTRUCTURE", held, "$", "$", "$", listed([wall]), where)

    def file(self) -> bytes:
        if self.placed:
            self.lines.add(
                "IFCRELAGGREGATES", self.guid("storeys"), "$", "$", "$", self.building, listed(self.placed)
            )
        return self.lines.file("IFC4", f"{self.title}.ifc", "ViewDefinition [ReferenceView_V1.2]", "hexwrap")


def _plates(
    model: _Model, blocks: Blocks, types: list[tuple[str, str]], pattern: Pattern, panels: Panels
) -> list[str]:
    """The plate of every panel, with what is known of it."""
    labels = pattern.labels()
    origins, axes = blocks.origin.tolist(), blocks.axes.tolist()
    kinds, sizes, faces = blocks.block.tolist(), panels.size.tolist(), panels.face.tolist()
    edges, whole = panels.edge_length.tolist(), panels.whole.tolist()
    rings = pattern.ring.tolist()
    plates = []
    for i, face in enumerate(faces):
        label = labels[face]
        if kinds[i] >= 0:
            shape, kind = model.mapped(types[kinds[i]][1]), "$"
        else:
            shape = model.geometry(blocks.shape(i), size_name(sizes[i]), colours_of(panels)[sizes[i]])
            kind = ".CURTAIN_PANEL."
        plate = model.plate(label, (origins[i], axes[i][0], axes[i][2]), shape, kind)
        values = {"Label": f"IFCLABEL({text(label)})", "Ring": f"IFCINTEGER({rings[face]})"}
        if not whole[i]:
            values["Cut"] = "IFCBOOLEAN(.T.)"
        if kinds[i] < 0:
            values["EdgeLength"] = f"IFCPOSITIVELENGTHMEASURE({real(edges[i])})"
        model.describe(label, plate, values)
        plates.append(plate)
    return plates
