"""Files with several objects: the one that is meant is taken, joined, told; the others can be named."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rhino3dm

from hexwrap_server.cli.main import main
from hexwrap_server.errors import FileTypeError, NoObjectError, SeveralObjectsError, UnreadableFileError
from hexwrap_server.input.choose import Chosen, choose
from hexwrap_server.input.object_words import listed
from hexwrap_server.input.readers.found import Found
from hexwrap_server.input.readers.rhino_brep import control_net
from hexwrap_server.input.requests import SentSurface
from hexwrap_server.input.surface_files import read_file, sent_surface
from hexwrap_server.input.surface_files import read_surface as read_chosen
from hexwrap_server.jobs.work import take_in
from hexwrap_solver.surface import NurbsSurface, SentMesh, surface_from_mesh
from hexwrap_solver.surface.brep import Brep
from hexwrap_solver.surface.errors import FlatSurfaceError, NonFiniteError
from hexwrap_solver.surface.types import SurfaceSettings
from tests.server.live import Live, running
from tests.server.test_reading import WRITERS, obj, rhino_mesh, stl
from tests.solver.surface.shapes import mesh, triangles, tube

CASES = Path(__file__).parents[3] / "shared" / "cases" / "rhino"
VERTICES, QUADS = tube()


class Model:
    """A Rhino file on its way."""

    def __init__(self, unit: str = "Meters") -> None:
        self.file = rhino3dm.File3dm()
        self.file.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, unit)
        self.file.Settings.ModelAbsoluteTolerance = 0.001
        self.layers: dict[str, int] = {}
        self.layer("Default")

    def layer(self, path: str, visible: bool = True, locked: bool = False) -> int:
        if path not in self.layers:
            layer = rhino3dm.Layer()
            layer.Name = path.rpartition("::")[2]
            layer.Visible, layer.Locked = visible, locked
            above = path.rpartition("::")[0]
            if above:
                number = self.layer(above)
                layer.ParentLayerId = next(x.Id for x in self.file.Layers if x.Index == number)
            self.layers[path] = self.file.Layers.Add(layer)
        return self.layers[path]

    def add(
        self, geometry: object, name: str = "", layer: str = "", mode: str = "Normal", **strings: str
    ) -> Model:
        self.file.Objects.Add(geometry, self.attributes(name, layer, mode, **strings))
        return self

    def attributes(
        self, name: str = "", layer: str = "", mode: str = "Normal", **strings: str
    ) -> rhino3dm.ObjectAttributes:
        attributes = rhino3dm.ObjectAttributes()
        attributes.Name = name
        attributes.Mode = getattr(rhino3dm.ObjectMode, mode)
        if layer:
            attributes.LayerIndex = self.layer(layer)
        for key, value in strings.items():
            attributes.SetUserString(key, value)
        return attributes

    def block(self, name: str, *geometry: object) -> object:
        plain = tuple(rhino3dm.ObjectAttributes() for _ in geometry)
        self.file.InstanceDefinitions.Add(name, "", "", "", origin(), geometry, plain)
        return next(d.Id for d in self.file.InstanceDefinitions if d.Name == name)

    def bytes(self) -> bytes:
        return base64.b64decode(self.file.Encode())

    def choose(self, object: str | None = None, layer: str | None = None) -> Chosen:
        return choose(read_file(self.bytes(), "a.3dm"), object, layer)


def origin() -> rhino3dm.Point3d:
    return rhino3dm.Point3d(0, 0, 0)


def mesh_at(x: float = 0.0, scale: float = 1.0) -> rhino3dm.Mesh:
    return rhino_mesh(VERTICES * scale + [x, 0, 0], QUADS.tolist())


def cylinder(x: float = 0.0, radius: float = 1.0, capped: bool = False) -> rhino3dm.Brep:
    circle = rhino3dm.Circle(rhino3dm.Point3d(x, 0, 0), radius)
    return rhino3dm.Brep.CreateFromCylinder(rhino3dm.Cylinder(circle, 4.0), capped, capped)


def plane(x: float, side: float, z: float = 0.0) -> rhino3dm.Mesh:
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]) * side + np.array([x, 0, z])
    return rhino_mesh(corners, [[0, 1, 2, 3]])


def names(chosen: Chosen) -> list[str]:
    return [found.name for found in chosen.used]


def two() -> Model:
    return Model().add(mesh_at(), "north", "Wall::Old").add(mesh_at(50), "south", "Wall::New")


def test_a_lone_object_is_taken_without_a_word() -> None:
    chosen = Model().add(mesh_at(), "tower").choose()
    assert isinstance(chosen.geometry, SentMesh)
    assert chosen.notes == ()


def test_the_only_tube_is_taken_and_told() -> None:
    model = (
        Model().add(mesh_at(), "tower").add(cylinder(30, capped=True), "context").add(plane(60, 500), "site")
    )
    chosen = model.choose()
    assert names(chosen) == ["tower"]
    (sentence,) = chosen.notes
    assert "Taken: 'tower' (mesh" in sentence
    assert "'context' (closed polysurface" in sentence
    assert "500 × 500 × 0 m" in sentence


def test_several_that_could_be_meant_are_listed() -> None:
    with pytest.raises(SeveralObjectsError, match=r"'north' \(mesh on layer Wall::Old, .*--object") as caught:
        two().choose()
    assert [row["name"] for row in caught.value.data["objects"]] == ["north", "south"]


@pytest.mark.parametrize(
    ("object", "layer", "found"),
    [
        ("north", None, "north"),
        ("SOUTH", None, "south"),
        ("n*", None, "north"),
        ("?outh", None, "south"),
        ("1", None, "south"),
        (None, "Wall::Old", "north"),
        (None, "new", "south"),
        (None, "*::N*", "south"),
        (None, "Model::Wall::Old", None),
        (None, "…::Wall::Old", "north"),
        ("*th", "Old", "north"),
        ("object 1", None, "south"),
        ("'north'", None, "north"),
    ],
)
def test_objects_and_layers_are_named(object: str | None, layer: str | None, found: str | None) -> None:
    if found is None:
        with pytest.raises(NoObjectError):
            two().choose(object, layer)
    else:
        assert names(two().choose(object, layer)) == [found]


def test_the_last_steps_of_a_path_name_a_layer() -> None:
    model = Model().add(mesh_at(), "a", "Site::North::Wall").add(mesh_at(50), "b", "Site::South::Wall")
    assert names(model.choose(layer="north::wall")) == ["a"]


def test_brackets_in_names_are_letters_and_accents_are_written_either_way() -> None:
    model = Model().add(mesh_at(), "wall [a] S\u00fcd").add(mesh_at(50), "wall b")
    assert names(model.choose("WALL [A]*")) == ["wall [a] S\u00fcd"]
    assert names(model.choose("wall [a] Su\u0308d")) == ["wall [a] S\u00fcd"]


@pytest.mark.parametrize(
    ("object", "layer"), [("North", None), ("tower", None), (None, "Facades"), ("skin", None)]
)
def test_what_a_block_holds_is_named_by_its_instances(object: str | None, layer: str | None) -> None:
    model = Model().add(mesh_at(80), "other")
    block = model.block("tower", mesh_at())
    instance = rhino3dm.InstanceReference(block, rhino3dm.Transform.Translation(1, 2, 3))
    model.file.Objects.AddInstanceObject(instance, model.attributes("North", "Facades", zone="3"))
    if object == "skin":
        with pytest.raises(NoObjectError):
            model.choose(object)
        return
    (used,) = model.choose(object, layer).used
    assert (used.name, used.attributes) == ("North", {"zone": "3"})


def test_vertices_of_a_part_are_those_of_its_own_objects() -> None:
    """So a vertex has one number, whether its object is named or found among others."""
    model = Model().add(mesh_at(200, 0.1), "lamp").add(mesh_at(), "tower").add(plane(60, 500), "site")
    found, named = model.choose().geometry, model.choose("tower").geometry
    assert isinstance(found, SentMesh)
    assert isinstance(named, SentMesh)
    np.testing.assert_array_equal(found.vertices, named.vertices)
    np.testing.assert_array_equal(found.faces.values, named.faces.values)


def test_objects_of_one_name_are_told_by_their_numbers() -> None:
    tower, other, hall = (
        Found(str(i), name, "mesh", (1.0, 1.0, 1.0), lambda: mesh(*tube()))
        for i, name in enumerate(["Tower", "Tower", "Hall"])
    )
    told = listed([other, hall], "m", [tower, other, hall])
    assert told == "'Tower' (object 1, mesh, 1 × 1 × 1 m), 'Hall' (mesh, 1 × 1 × 1 m)"


def test_an_id_is_a_name() -> None:
    content = read_file(two().bytes(), "a.3dm")
    assert [found.name for found in choose(content, content.objects[1].id.upper()).used] == ["south"]


def test_a_name_that_looks_like_a_number_goes_before_the_number() -> None:
    model = Model().add(mesh_at(), "1").add(mesh_at(50), "south")
    assert names(model.choose("1")) == ["1"]


@pytest.mark.parametrize(("object", "layer"), [("east", None), (None, "Roof"), ("north", "New")])
def test_names_that_nothing_has_are_told_with_what_there_is(object: str | None, layer: str | None) -> None:
    with pytest.raises(NoObjectError, match=r"there are 'north' .* 'south'"):
        two().choose(object, layer)


@pytest.mark.parametrize("how", ["Hidden", "Locked", "off", "locked", "above"])
def test_what_is_out_of_sight_counts_only_when_named(how: str) -> None:
    model = Model()
    model.layer("off", visible=False)
    model.layer("locked", locked=True)
    model.layer("off::above")
    layer = {"off": "off", "locked": "locked", "above": "off::above"}.get(how, "")
    mode = how if how in ("Hidden", "Locked") else "Normal"
    model.add(mesh_at(50), "old", layer, mode)
    with pytest.raises(
        NoObjectError, match=r"The only surface .* hidden, locked or on a layer that is off.*'old'"
    ):
        model.choose()
    model.add(mesh_at(), "new")
    assert names(model.choose()) == ["new"]
    assert names(model.choose("old")) == ["old"]


def test_copies_in_place_count_once_and_are_told() -> None:
    """Two copies of an open tube would be joined along both rims, to a torus."""
    chosen = Model().add(cylinder(), "a").add(cylinder(), "b").choose()
    assert names(chosen) == ["a"]
    assert "covers another one exactly" in chosen.notes[0]
    loops = take_in(
        sent_surface(Model().add(cylinder()).add(cylinder()).bytes(), "a.3dm", SurfaceSettings()).sent
    )
    assert len(loops.loops) == 2


def test_one_of_several_alike_is_taken_unless_their_names_differ() -> None:
    chosen = Model().add(mesh_at()).add(mesh_at(50)).add(mesh_at(100)).choose()
    assert len(chosen.used) == 1
    assert "Taken: object" in chosen.notes[-1]
    with pytest.raises(SeveralObjectsError):
        Model().add(mesh_at(), "a").add(mesh_at(50), "b").choose()


@pytest.mark.parametrize("side", [50, 500])
def test_neither_ground_nor_a_small_tube_stands_for_a_building(side: float) -> None:
    """A closed mass of 4 × 2 × 2 beside a railing, on flat ground."""
    model = (
        Model()
        .add(cylinder(30, capped=True), "mass")
        .add(mesh_at(60, 0.02), "railing")
        .add(plane(60, side), "site")
    )
    assert names(model.choose()) == ["mass"]


def test_a_file_without_surfaces_names_what_it_holds() -> None:
    line = rhino3dm.LineCurve(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(1, 0, 0))
    with pytest.raises(UnreadableFileError, match="curves: 1"):
        Model().add(line).choose()


def test_smaller_pieces_of_the_mesh_that_is_taken_are_told_with_their_place() -> None:
    n = len(VERTICES)
    far = np.array([500.0, 0, 0])
    model = Model().add(rhino_mesh(np.vstack([VERTICES, 0.4 * VERTICES + far]), [*QUADS, *(QUADS + n)]))
    assert "1 other piece of the same object left out, at (" in " ".join(model.choose().notes)


def test_strays_are_left_out_and_told_with_their_place() -> None:
    stray = np.array([[500.0, 500, 0], [500.2, 500, 0], [500, 500.2, 0]])
    n = len(VERTICES)
    model = Model().add(rhino_mesh(np.vstack([VERTICES, stray]), [*QUADS.tolist(), [n, n + 1, n + 2]]))
    chosen = model.choose()
    assert isinstance(chosen.geometry, SentMesh)
    assert len(surface_from_mesh(chosen.geometry).loops) == 2
    assert "1 stray piece of 1 face" in chosen.notes[0]
    assert "(500.1, 500.1, 0)" in chosen.notes[0]


@pytest.mark.parametrize("at", [0, len(VERTICES) // 2])
def test_a_fin_is_called_one(at: int) -> None:
    """It hangs at a vertex of the rim, or of the inside; its other corners touch nothing."""
    fin = VERTICES[at] + np.array([[0.05, 0, 0], [0, 0.05, 0]])
    n = len(VERTICES)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.vstack([VERTICES, fin]).tolist()]
    faces = [*QUADS.tolist(), [at, n, n + 1]]
    lines += ["f " + " ".join(str(v + 1) for v in face) for face in faces]
    sent = sent_surface("\n".join(lines).encode(), "fin.obj", SurfaceSettings(), 10_000).sent
    assert sent.mesh is not None
    assert len(surface_from_mesh(sent.mesh).loops) == 2
    assert sent.notes[0].startswith("1 fin of 1 face in all left out, at (")


def parts(shift: float) -> Model:
    """A tube in two meshes, the second moved."""
    at = VERTICES[QUADS].mean(axis=1)
    model = Model()
    for name, kept, move in (("a", at[:, 0] > 0, 0.0), ("b", at[:, 0] <= 0, shift)):
        model.add(rhino_mesh(VERTICES + np.array([move, 0, 0]), QUADS[kept].tolist()), name)
    return model


def test_meshes_whose_edges_meet_become_one() -> None:
    chosen = parts(4e-4).choose()
    assert isinstance(chosen.geometry, SentMesh)
    assert names(chosen) == ["a", "b"]
    assert len(surface_from_mesh(chosen.geometry).loops) == 2
    assert "2 objects were joined along their edges: the greatest gap closed was 0.0004" in chosen.notes[0]


def test_edges_that_nearly_meet_are_told_with_where_and_how_far() -> None:
    model = parts(4e-3)
    with pytest.raises(SeveralObjectsError, match=r"comes within 0.004 of the surface at .* not joined"):
        model.choose()
    told = model.add(mesh_at(80), "tower").choose("[at]*").notes
    assert any("'tower'" in sentence for sentence in told)
    ring = (
        Model()
        .add(mesh_at(), "tower")
        .add(plane(VERTICES[:, 0].max() + 0.02, 0.5, VERTICES[:, 2].max()), "sill")
    )
    (nearly, _) = ring.choose().notes
    assert "'sill' comes within 0.02" in nearly or "was not joined" in nearly


def ring(count: int, low: float, turned: float = 2 * np.pi) -> rhino3dm.Mesh:
    """A tube of that many faces around, two high, in double precision; its seam is not welded."""
    turn = np.linspace(0, turned, count + 1)
    points = np.concatenate([[(2 * np.cos(t), 2 * np.sin(t), low + z) for t in turn] for z in (0, 1, 2)])
    made = rhino3dm.Mesh()
    made.Vertices.UseDoublePrecisionVertices = True
    for x, y, z in points.tolist():
        made.Vertices.AddPoint3d(x, y, z)
    k = count + 1
    for at in range(2 * k):
        if at % k < count:
            made.Faces.AddFace(at, at + 1, at + 1 + k, at + k)
    return made


def test_the_gap_is_told_where_the_tolerance_is_less_than_rounding() -> None:
    """The tolerance is below a millionth of the size, within which vertices are one in any case."""
    model = Model().add(ring(24, 0), "a").add(ring(24, 2 + 1e-6), "b")
    model.file.Settings.ModelAbsoluteTolerance = 2e-6
    assert "the greatest gap closed was 1e-06" in model.choose().notes[0]


def test_edges_with_other_vertices_are_measured_between_these() -> None:
    """Every other vertex of the finer rim lies off the coarser one, by its chord height."""
    height = 2 * (1 - np.cos(np.pi / 24))
    with pytest.raises(SeveralObjectsError, match=rf"comes within {height:.3g} of .* MatchMeshEdge"):
        Model().add(ring(24, 0), "a").add(ring(48, 2), "b").choose()


def test_meshes_are_not_joined_with_surfaces_and_it_is_said() -> None:
    with pytest.raises(SeveralObjectsError, match=r"'b' meets the surface at .* Rhino's Mesh"):
        Model().add(cylinder(radius=2.0), "a").add(ring(96, 4), "b").choose()


@pytest.mark.parametrize("gap", [0.004, -0.004, 0.05])
def test_a_slit_is_told_whether_it_gapes_or_overlaps(gap: float) -> None:
    """Edges that cover each other are no two sides of a seam: joined, they would make a Möbius band."""
    chosen = Model().add(ring(24, 0, 2 * np.pi + gap / 2)).choose()
    assert f"Edges of the surface come within {abs(gap):g} of each other" in chosen.notes[0]
    assert isinstance(chosen.geometry, SentMesh)
    assert len(surface_from_mesh(chosen.geometry).loops) == 1


def test_surfaces_whose_edges_meet_become_one() -> None:
    arcs = []
    for start in (0.0, np.pi):
        line = rhino3dm.LineCurve(
            rhino3dm.Point3d(2 * np.cos(start), 2 * np.sin(start), 0),
            rhino3dm.Point3d(2 * np.cos(start), 2 * np.sin(start), 5),
        )
        axis = rhino3dm.Line(origin(), rhino3dm.Point3d(0, 0, 1))
        arcs.append(rhino3dm.RevSurface.Create(line, axis, 0.0, np.pi))
    chosen = Model().add(arcs[0], "a").add(arcs[1], "b").choose()
    assert isinstance(chosen.geometry, Brep)
    assert names(chosen) == ["a", "b"]
    assert "2 objects were joined" in chosen.notes[0]


def nested(*transforms: rhino3dm.Transform) -> SentMesh:
    """A mesh in blocks within blocks, each moved."""
    model = Model()
    content: object = mesh_at()
    for k, transform in enumerate(transforms):
        content = rhino3dm.InstanceReference(model.block(f"b{k}", content), transform)
    model.file.Objects.AddInstanceObject(content, model.attributes("tower"))
    geometry = model.choose().geometry
    assert isinstance(geometry, SentMesh)
    return geometry


def test_blocks_are_resolved_nested_scaled_and_mirrored() -> None:
    move = rhino3dm.Transform.Translation(1, 2, 3)
    scale = rhino3dm.Transform.Scale(origin(), 2.0)
    mirror = rhino3dm.Transform.Mirror(origin(), rhino3dm.Vector3d(1, 0, 0))
    plain = surface_from_mesh(mesh(VERTICES, QUADS))
    twice = nested(move, scale)
    np.testing.assert_allclose(twice.vertices, (VERTICES + np.array([1, 2, 3])) * 2, atol=1e-6)
    turned = surface_from_mesh(nested(move, mirror, scale))
    np.testing.assert_allclose(turned.vertices, (VERTICES + np.array([1, 2, 3])) * [-2, 2, 2], atol=1e-6)
    assert (turned.normals * plain.normals * [-1, 1, 1]).sum(axis=1).min() > 0.9  # still outside


@pytest.mark.parametrize(
    "content", [mesh_at(), cylinder(), cylinder(capped=True)], ids=["mesh", "tube", "mass"]
)
def test_blocks_that_flatten_their_content_are_refused(content: object) -> None:
    model = Model()
    flat = rhino3dm.Transform(1.0)
    flat.M22 = 0.0
    model.file.Objects.AddInstanceObject(
        rhino3dm.InstanceReference(model.block("b", content), flat), model.attributes("lost")
    )
    with pytest.raises(UnreadableFileError, match=r"flattens it.*ResetBlock"):
        model.choose()
    assert any("'lost' was left out" in note for note in model.add(mesh_at(), "tower").choose().notes)


@pytest.mark.parametrize("bad", [np.nan, 1e300])
def test_surfaces_with_impossible_numbers_are_refused(bad: float) -> None:
    surface = rhino3dm.NurbsSurface.CreateFromCylinder(rhino3dm.Cylinder(rhino3dm.Circle(origin(), 2.0), 5.0))
    surface.Points[1, 0] = rhino3dm.Point4d(bad, 0, 0, 1)
    with pytest.raises(NonFiniteError):
        Model().add(surface).choose()


def test_surfaces_without_area_are_refused() -> None:
    """A tube pressed into the circle that it stands on."""
    surface = rhino3dm.NurbsSurface.CreateFromCylinder(rhino3dm.Cylinder(rhino3dm.Circle(origin(), 2.0), 5.0))
    for i in range(surface.Points.CountU):
        for j in range(surface.Points.CountV):
            p = surface.Points[i, j]
            surface.Points[i, j] = rhino3dm.Point4d(p.X, p.Y, 0, p.W)
    with pytest.raises(FlatSurfaceError, match="shrunk to a curve"):
        take_in(sent_surface(Model().add(surface).bytes(), "a.3dm", SurfaceSettings()).sent)


def test_mirrored_surfaces_keep_their_outside() -> None:
    mirror = rhino3dm.Transform.Mirror(origin(), rhino3dm.Vector3d(0, 0, 1))
    model = Model()
    block = model.block("b", rhino3dm.NurbsSurface.CreateFromCylinder(
        rhino3dm.Cylinder(rhino3dm.Circle(origin(), 2.0), 5.0)))  # fmt: skip
    model.file.Objects.AddInstanceObject(rhino3dm.InstanceReference(block, mirror), model.attributes())
    read = sent_surface(model.bytes(), "a.3dm", SurfaceSettings())
    assert isinstance(read.sent.nurbs, NurbsSurface)
    surface = take_in(read.sent)
    assert np.ptp(surface.vertices[:, 2]) == pytest.approx(5)
    assert surface.vertices[:, 2].max() == pytest.approx(0)
    outward = (surface.normals[:, :2] * surface.vertices[:, :2]).sum(axis=1)
    assert np.all(outward > 0)


@pytest.mark.parametrize(
    ("unit", "word"),
    [("Meters", "m"), ("Millimeters", "mm"), ("Feet", "ft"), ("Inches", "in"), ("Miles", None)],
)
def test_units_and_names_come_along(unit: str, word: str | None) -> None:
    model = Model(unit).add(mesh_at(), "tower", "Facade::Outer", material="glass")
    surface = take_in(sent_surface(model.bytes(), "a.3dm", SurfaceSettings()).sent)
    assert surface.unit == word
    assert surface.origin.name == "tower"
    assert surface.origin.layer == "Facade::Outer"
    assert surface.origin.attributes == (("material", "glass"),)
    asked = sent_surface(model.bytes(), "a.3dm", SurfaceSettings(unit="cm")).sent
    assert take_in(asked).unit == "cm"
    assert sum("miles, is not carried" in note for note in surface.repairs) == (unit == "Miles")
    assert not any("is not carried" in note for note in asked.notes)


def test_a_seam_open_by_less_than_the_tolerance_closes() -> None:
    surface = rhino3dm.NurbsSurface.CreateFromCylinder(rhino3dm.Cylinder(rhino3dm.Circle(origin(), 2.0), 5.0))
    last = surface.Points.CountU - 1
    for j in range(surface.Points.CountV):
        point = surface.Points[last, j]
        surface.Points[last, j] = rhino3dm.Point4d(point.X + 5e-4, point.Y, point.Z, point.W)
    read = sent_surface(Model().add(surface).bytes(), "a.3dm", SurfaceSettings())
    assert len(take_in(read.sent).loops) == 2
    assert "up to 0.0005 apart" in read.sent.notes[0]


@pytest.mark.parametrize(("double", "told"), [(False, 1), (True, 0)])
def test_single_precision_far_from_the_origin_is_told(double: bool, told: int) -> None:
    far = rhino3dm.Mesh()
    far.Vertices.UseDoublePrecisionVertices = double
    points = VERTICES * 100 + np.array([5e6, 5e6, 0])
    for x, y, z in points.tolist():
        (far.Vertices.AddPoint3d if double else far.Vertices.Add)(x, y, z)
    for quad in QUADS.tolist():
        far.Faces.AddFace(*quad)
    chosen = Model().add(far, "tower").choose()
    assert len([x for x in chosen.notes if "single precision, exact to 0.5" in x]) == told
    assert isinstance(chosen.geometry, SentMesh)
    assert np.array_equal(chosen.geometry.vertices, points) == double


# Other formats


def test_groups_of_an_obj_are_chosen_and_keep_the_numbers_of_the_file() -> None:
    n = len(VERTICES)
    far = VERTICES + np.array([50, 0, 0])
    faces = [*QUADS.tolist(), *(QUADS + n).tolist()]
    lines = obj(np.vstack([VERTICES, far]), faces).decode().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("f "))
    lines = [
        *lines[:first],
        "g left",
        *lines[first : first + len(QUADS)],
        "g right",
        *lines[first + len(QUADS) :],
    ]
    content = read_file("\n".join(lines).replace("o tube\n", "").encode(), "a.obj")
    assert [found.name for found in content.objects] == ["left", "right"]
    with pytest.raises(SeveralObjectsError):
        choose(content)
    right = choose(content, "right").geometry
    assert isinstance(right, SentMesh)
    assert right.faces.values.min() == n
    np.testing.assert_array_equal(right.vertices, np.vstack([VERTICES, far]))


def test_groups_of_one_surface_are_joined_in_the_order_of_the_file() -> None:
    lines = obj(VERTICES, QUADS.tolist()).decode().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("f "))
    lines[first + 7 : first + 7] = ["g other"]
    chosen = choose(read_file("\n".join(lines).encode(), "a.obj"))
    assert isinstance(chosen.geometry, SentMesh)
    assert chosen.geometry.faces.to_lists() == QUADS.tolist()
    assert len(chosen.used) == 2


def test_pieces_of_a_ply_and_solids_of_an_stl_are_chosen() -> None:
    from tests.server.test_reading import ply

    n = len(VERTICES)
    both = ply(np.vstack([VERTICES, VERTICES * 0.9 + [50, 0, 0]]), [*QUADS.tolist(), *(QUADS + n).tolist()])
    content = read_file(both, "a.ply")
    assert [found.name for found in content.objects] == ["part 0", "part 1"]
    geometry = choose(content, "1").geometry
    assert isinstance(geometry, SentMesh)
    assert geometry.faces.values.min() == n

    def solid(name: str, move: float) -> str:
        facets = VERTICES[triangles(QUADS)] + [move, 0, 0]
        rows = ["\n".join("vertex " + " ".join(map(repr, p)) for p in facet) for facet in facets.tolist()]
        body = "".join(f"facet normal 0 0 0\nouter loop\n{row}\nendloop\nendfacet\n" for row in rows)
        return f"solid {name}\n{body}endsolid {name}\n"

    content = read_file((solid("east", 0) + solid("west", 50)).encode(), "a.stl")
    chosen = choose(content, "west")
    assert isinstance(chosen.geometry, SentMesh)
    used = chosen.geometry.vertices[chosen.geometry.faces.values]
    assert used[:, 0].min() > 20


def test_materials_are_objects_where_nothing_else_is_and_old_names_are_read() -> None:
    n = len(VERTICES)
    points = np.vstack([VERTICES, VERTICES * 0.9 + [50, 0, 0]])
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    for name, first in (("Glas", 0), ("D\u00e4mmung", n)):
        faces = (np.asarray(QUADS) + first + 1).tolist()
        lines += [f"usemtl {name}", *("f " + " ".join(map(str, face)) for face in faces)]
    content = read_file("\n".join(lines).encode("cp1252"), "a.obj")
    assert [found.name for found in content.objects] == ["Glas", "D\u00e4mmung"]


def test_files_with_the_ending_of_another_are_told_so() -> None:
    data = Model().add(mesh_at()).bytes()
    for name in ("a.obj", "a.ply", "a.stl"):
        with pytest.raises(UnreadableFileError, match=r"\.3dm file: it is one, so give it the ending \.3dm"):
            read_file(data, name)
    with pytest.raises(UnreadableFileError, match=r"\.obj file: it is one, so give it the ending \.obj"):
        read_file(obj(VERTICES, QUADS.tolist()), "a.stl")
    with pytest.raises(UnreadableFileError, match=r"\.html file: it is a web page"):
        read_file(b"<!DOCTYPE html><title>404</title>", "a.3dm")
    with pytest.raises(UnreadableFileError, match="is empty"):
        read_file(b"", "a.3dm")
    with pytest.raises(FileTypeError, match="unpack it first"):
        read_file(data, "a.3dm.zip")


def test_closed_masses_that_touch_are_to_be_united() -> None:
    floors = Model()
    for k in range(3):
        box = rhino3dm.BoundingBox(0, 0, 3 * k, 4, 4, 3 * k + 3)
        floors.add(rhino3dm.Brep.CreateFromBox(rhino3dm.Box(box)), f"floor {k}")
    with pytest.raises(SeveralObjectsError, match="BooleanUnion"):
        floors.choose()
    large = rhino3dm.BoundingBox(0, 0, 9, 4, 4, 30)
    taken = floors.add(rhino3dm.Brep.CreateFromBox(rhino3dm.Box(large)), "shaft").choose()
    assert names(taken) == ["shaft"]
    assert any("BooleanUnion" in note for note in taken.notes)


# Clients


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with running(tmp_path_factory.mktemp("choosing"), workers=1) as live:
        yield live


def test_uploads_choose_by_fields_of_the_form(client: Live) -> None:
    file = {"file": ("a.3dm", two().bytes())}
    refused = client.post("/v1/surfaces", files=file)
    assert refused.status_code == 422
    assert refused.json()["type"] == "/problems/several-objects"
    answer = client.post("/v1/surfaces", files=file, data={"object": "south", "unit": ""}).json()
    assert answer["unit"] == "m"
    assert [(row["name"], row["used"]) for row in answer["objects"]] == [("north", False), ("south", True)]
    assert set(answer["objects"][0]) == {"id", "name", "layer", "kind", "visible", "size", "used"}
    asked = client.post("/v1/surfaces", files=file, data={"layer": "Wall::Old", "unit": "mm"}).json()
    assert asked["unit"] == "mm"
    wrong = client.post("/v1/surfaces", files=file, data={"unit": "furlong"})
    assert wrong.status_code == 422
    assert "unit" in wrong.json()["detail"]
    assert client.post("/v1/surfaces", files=file, data={"colour": "red"}).status_code == 422


def test_inspect_prints_what_is_there_and_what_would_be_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "two.3dm"
    path.write_bytes(two().bytes())
    assert main(["inspect", str(path)]) == 1
    said = capsys.readouterr().out
    assert "unit m, tolerance 0.001" in said
    assert "Wall::Old" in said
    assert "to choose" in said
    assert main(["inspect", str(path), "--object", "north"]) == 0
    assert "taken" in capsys.readouterr().out
    assert main(["inspect", str(path), "--object", "1"]) == 0
    assert "Taken: 'south'" in capsys.readouterr().out
    assert main(["inspect", str(tmp_path / "none.3dm")]) == 2


def test_inspect_says_what_would_be_mapped_as_the_options_ask(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mass.3dm"
    base = [[0, 0], [4000, 0], [4000, 4000], [0, 4000]]
    corners = np.array([[*xy, z] for z in (0, 12000) for xy in base], dtype=float)
    sides = [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [3, 2, 1, 0], [4, 5, 6, 7]]
    path.write_bytes(Model("Millimeters").add(rhino_mesh(corners, sides)).bytes())
    for options, walls in (((), 2), (("--caps", "keep"), 0)):
        assert main(["inspect", str(path), *options]) == 0
        said = capsys.readouterr().out
        assert f"To be panelized: a surface of 4,000 × 4,000 × 12,000 mm with {walls} boundary curves" in said


def test_the_command_line_chooses(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "two.3dm"
    path.write_bytes(two().bytes())
    out = str(tmp_path / "out.json")
    assert main(["solve", str(path), "--pattern", "none", "-o", out]) == 1
    assert "--object" in capsys.readouterr().err
    assert main(["solve", str(path), "--pattern", "none", "--object", "0", "-q", "-o", out]) == 0


SHOWN = {
    "02_loft_mm": 2, "10_seam_gap_0p5mm": 2, "17_polysrf_4faces_nomesh": 2, "19_polysrf_rounded_nomesh": 2,
    "35_several_objects": 2, "36_others_hidden": 2, "39_block_instance": 2, "43_closed_top_1loop": 2,
    "43b_dome_hemisphere_nurbs": 1, "50_two_halves_not_joined": 2, "54_mesh_with_stray_piece": 2,
}  # fmt: skip


@pytest.mark.skipif(not CASES.is_dir(), reason="the files shown are not here")
@pytest.mark.parametrize("name", SHOWN)
def test_files_shown_are_taken_in(name: str) -> None:
    read = sent_surface((CASES / f"{name}.3dm").read_bytes(), "a.3dm", SurfaceSettings())
    assert len(take_in(read.sent).loops) == SHOWN[name]


def test_rhino3dm_meshes_a_subd_as_it_is_called() -> None:
    """Its arguments have changed between versions; SubDs themselves cannot be made without Rhino."""
    mesh = control_net(rhino3dm.SubD())
    assert mesh is None or len(mesh.Faces) == 0


def ifc(schema: str) -> bytes:
    return (
        f"ISO-10303-21;\nHEADER;\nFILE_NAME('a','',(''),(''),'','','');\nFILE_SCHEMA(('{schema}'));".encode()
    )


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (ifc("IFC4"), r"\.ifc file: export the surface alone from the program that made the model"),
        (ifc("AUTOMOTIVE_DESIGN"), r"\.step file: open or import it in Rhino"),
        (b"999\r\nmade by hand\r\n  0\r\nSECTION\r\n  2\r\nENTITIES\r\n", r"\.dxf file: curves and points"),
    ],
)
def test_files_of_another_kind_are_sent_where_they_are_read(data: bytes, told: str) -> None:
    with pytest.raises(UnreadableFileError, match=told):
        read_file(data, "a.obj")


@pytest.mark.parametrize(
    "comment", [b"999\nx\n", b"999\n999\n", b"999 \n", b"999\n\n", b"ISO-10303-21;FILE_SCHEMA( ("]
)
def test_what_a_file_is_is_told_in_a_time_that_its_size_bounds(comment: bytes) -> None:
    """A beginning that could be taken apart in many ways would be tried in all of them."""
    with pytest.raises(UnreadableFileError):
        read_file(comment * 2000, "a.obj")


@pytest.mark.parametrize("ending", [".obj", ".stl"])
def test_a_slit_is_told_in_files_without_a_tolerance(ending: str) -> None:
    vertices, quads = tube(9, 24)
    whole = WRITERS[ending](vertices, quads.tolist())
    seam = vertices[::24] + np.array([0, 2e-5, 0])  # wider than what is welded
    slit = np.where((quads % 24 == 0) & (quads[:, :1] % 24 == 23), 9 * 24 + quads // 24, quads)
    cut = WRITERS[ending](np.concatenate([vertices, seam]), slit.tolist())
    assert read_chosen(whole, "a" + ending).notes == ()
    assert any("come within 2e-05 of each other" in note for note in read_chosen(cut, "a" + ending).notes)


def test_faces_without_area_are_told_as_such() -> None:
    vertices, quads = tube()
    notes = read_chosen(obj(vertices, [*quads.tolist(), [7, 14, 14], [0, 0, 3]]), "a.obj").notes
    assert notes == ("2 faces without area left out.",)


def test_a_slit_is_told_in_a_mesh_of_a_request() -> None:
    vertices, quads = tube(9, 24)
    points = np.concatenate([vertices, vertices[::24] + np.array([0, 2e-5, 0])])
    slit = np.where((quads % 24 == 0) & (quads[:, :1] % 24 == 23), 9 * 24 + quads // 24, quads)
    whole, cut = (take_in(SentSurface(mesh=mesh(points, faces))).repairs for faces in (quads, slit))
    assert not any("of each other" in repair for repair in whole)
    assert any("come within 2e-05 of each other" in repair for repair in cut)


def test_coordinates_too_coarse_for_the_model_are_told() -> None:
    vertices, quads = tube()
    near, far = (read_chosen(stl(vertices + x, quads.tolist()), "a.stl").notes for x in (1e2, 5e5))
    assert near == ()
    assert "single precision, exact to 0.031 only, beside a size of" in far[0]
