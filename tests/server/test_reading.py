"""Real files, written and read back; broken ones refused."""

from __future__ import annotations

import base64
import io
import zipfile
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
import rhino3dm
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_server.errors import FileTypeError, SeveralObjectsError, UnreadableFileError
from hexwrap_server.input import surface_files
from hexwrap_server.input.readers.found import Geometry
from hexwrap_server.input.surface_files import READERS
from hexwrap_solver.errors import SurfaceError
from hexwrap_solver.surface import NurbsSurface, SentMesh, surface_from_mesh
from hexwrap_solver.surface.brep import Brep
from tests.solver.surface.shapes import mesh, triangles, tube


def by_trimesh(vertices: Any, faces: Any, **more: Any) -> Any:
    """Another library's mesh, where it is installed: the readers must do without."""
    return pytest.importorskip("trimesh").Trimesh(vertices, faces, process=False, **more)


def read_surface(data: bytes, name: str) -> Geometry:
    return surface_files.read_surface(data, name).geometry


def obj(vertices: np.ndarray, faces: list[list[int]]) -> bytes:
    lines = ["# a comment", "o tube", "vt 0 0", "vn 0 0 1"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += ["f " + " ".join(f"{v + 1}/1/1" for v in face) for face in faces]
    return "\n".join(lines).encode()


def off(vertices: np.ndarray, faces: list[list[int]]) -> bytes:
    lines = ["OFF # a comment", f"{len(vertices)} {len(faces)} 0"]
    lines += [f"{x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += [" ".join(map(str, [len(face), *face])) for face in faces]
    return "\n".join(lines).encode()


def ply(vertices: np.ndarray, faces: list[list[int]]) -> bytes:
    head = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    head += [f"property double {x}" for x in "xyz"]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    head += [f"{x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    head += [" ".join(map(str, [len(face), *face])) for face in faces]
    return ("\n".join(head) + "\n").encode()


def npz(vertices: np.ndarray, faces: list[list[int]]) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(
        stream, vertices=vertices, faces=np.array([f if len(f) == 4 else [*f, f[-1]] for f in faces])
    )
    return stream.getvalue()


def rhino(*geometry: object, names: tuple[str, ...] = ()) -> bytes:
    model = rhino3dm.File3dm()
    for k, item in enumerate(geometry):
        attributes = rhino3dm.ObjectAttributes()
        attributes.Name = names[k] if names else ""
        model.Objects.Add(item, attributes)
    return base64.b64decode(model.Encode())


def rhino_mesh(vertices: np.ndarray, faces: list[list[int]]) -> rhino3dm.Mesh:
    out = rhino3dm.Mesh()
    out.Vertices.UseDoublePrecisionVertices = True
    for x, y, z in vertices.tolist():
        out.Vertices.Add(x, y, z)
    for face in faces:
        out.Faces.AddFace(*face)
    return out


def rhino_file(vertices: np.ndarray, faces: list[list[int]]) -> bytes:
    return rhino(rhino_mesh(vertices, faces))


def stl(vertices: np.ndarray, faces: list[list[int]]) -> bytes:
    return by_trimesh(vertices, triangles(np.array(faces))).export(file_type="stl")


WRITERS: dict[str, Callable[[np.ndarray, list[list[int]]], bytes]] = {
    ".obj": obj,
    ".off": off,
    ".ply": ply,
    ".npz": npz,
    ".3dm": rhino_file,
    ".stl": stl,
}


@pytest.mark.parametrize("suffix", [".obj", ".off", ".npz", ".ply", ".3dm"])
def test_quads_are_read_back(suffix: str) -> None:
    vertices, quads = tube()
    sent = read_surface(WRITERS[suffix](vertices, quads.tolist()), "Tube" + suffix.upper())
    assert isinstance(sent, SentMesh)
    np.testing.assert_allclose(sent.vertices, vertices, atol=1e-6 if suffix == ".3dm" else 0)
    np.testing.assert_array_equal(sent.faces.values.reshape(-1, 4), quads)
    assert len(surface_from_mesh(sent).faces) == 2 * len(quads)


@pytest.mark.parametrize("suffix", [".obj", ".off", ".npz", ".ply", ".3dm"])
def test_mixed_faces_are_read_back(suffix: str) -> None:
    vertices, quads = tube()
    faces = [*quads[:5].tolist(), *triangles(quads[5:]).tolist()]
    sent = read_surface(WRITERS[suffix](vertices, faces), "tube" + suffix)
    assert isinstance(sent, SentMesh)
    assert sent.faces.to_lists() == faces


def test_every_format_has_a_writer_here() -> None:
    assert WRITERS.keys() == READERS.keys()


def test_stl_is_welded_by_the_intake() -> None:
    vertices, quads = tube()
    sent = read_surface(stl(vertices, quads.tolist()), "tube.stl")
    assert isinstance(sent, SentMesh)
    assert len(sent.vertices) == 6 * len(quads)
    assert len(surface_from_mesh(sent).vertices) == len(vertices)
    text = by_trimesh(vertices, triangles(quads)).export(file_type="stl_ascii")
    again = read_surface(text.encode(), "tube.stl")
    assert isinstance(again, SentMesh)
    assert len(surface_from_mesh(again).vertices) == len(vertices)


def test_binary_ply_with_normals() -> None:
    vertices, quads = tube()
    own = surface_from_mesh(mesh(vertices, quads)).normals
    solid = by_trimesh(vertices, triangles(quads), vertex_normals=own)
    sent = read_surface(solid.export(file_type="ply", vertex_normal=True), "tube.ply")
    assert isinstance(sent, SentMesh)
    np.testing.assert_allclose(sent.normals, own, atol=1e-6)


def test_negative_obj_indices_count_back_and_lines_may_continue() -> None:
    text = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 \\\n -2 -1\nv 2 0 0 0.5 0.5 0.5\nf 2 -1 3 # end\n"
    sent = read_surface(text, "a.obj")
    assert isinstance(sent, SentMesh)
    assert sent.faces.to_lists() == [[0, 1, 2, 3], [1, 4, 2]]
    assert sent.vertices.shape == (5, 3)


def test_npz_carries_normals() -> None:
    vertices, quads = tube()
    stream = io.BytesIO()
    np.savez(stream, vertices=vertices.astype(np.float32), faces=quads.astype(np.int32), normals=vertices)
    sent = read_surface(stream.getvalue(), "a.npz")
    assert isinstance(sent, SentMesh)
    np.testing.assert_array_equal(sent.normals, vertices)


def cylinder() -> rhino3dm.Cylinder:
    return rhino3dm.Cylinder(rhino3dm.Circle(rhino3dm.Point3d(0, 0, 0), 2.0), 5.0)


@pytest.mark.parametrize(
    "geometry",
    [
        rhino3dm.NurbsSurface.CreateFromCylinder(cylinder()),
        rhino3dm.Brep.CreateFromCylinder(cylinder(), False, False),
        rhino3dm.Extrusion.CreateCylinderExtrusion(cylinder(), False, False),
        rhino3dm.RevSurface.Create(
            rhino3dm.LineCurve(rhino3dm.Point3d(2, 0, 0), rhino3dm.Point3d(2, 0, 5)),
            rhino3dm.Line(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(0, 0, 1)),
            0.0,
            2 * np.pi,
        ),
    ],
    ids=["nurbs", "brep", "extrusion", "revolution"],
)
def test_rhino_surfaces_become_nurbs(geometry: object) -> None:
    surface = read_surface(rhino(geometry), "a.3dm")
    assert isinstance(surface, NurbsSurface)
    n, m = surface.control_points.shape[:2]
    assert [len(k) for k in surface.knots] == [n + surface.degree[0] + 1, m + surface.degree[1] + 1]
    assert sum(surface.closed) == 1
    radius = np.hypot(surface.control_points[..., 0], surface.control_points[..., 1])
    np.testing.assert_allclose(sorted(set(radius.ravel().round(9))), [2.0, np.sqrt(8)])
    np.testing.assert_allclose(np.ptp(surface.control_points[..., 2]), 5.0)


def test_curves_beside_the_surface_do_no_harm() -> None:
    line = rhino3dm.LineCurve(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(1, 0, 0))
    surface = rhino3dm.NurbsSurface.CreateFromCylinder(cylinder())
    assert isinstance(read_surface(rhino(line, surface), "a.3dm"), NurbsSurface)


def test_several_objects_are_named() -> None:
    vertices, quads = tube()
    parts = rhino_mesh(2.5 * vertices, quads.tolist()), rhino3dm.NurbsSurface.CreateFromCylinder(cylinder())
    with pytest.raises(
        SeveralObjectsError, match=r"'old' \(mesh.*'new' \(surface|'new' \(surface.*'old' \(mesh"
    ):
        read_surface(rhino(*parts, names=("old", "new")), "a.3dm")


def test_a_polysurface_needs_no_render_mesh() -> None:
    box = rhino3dm.Brep.CreateFromCylinder(cylinder(), True, True)
    read = read_surface(rhino(box), "a.3dm")
    assert isinstance(read, Brep)
    assert len(read.faces) == 3


def test_a_rhino_file_without_a_surface_is_refused() -> None:
    line = rhino3dm.LineCurve(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(1, 0, 0))
    with pytest.raises(UnreadableFileError, match=r"curves: 1.*ExtrudeCrv"):
        read_surface(rhino(line), "a.3dm")


@pytest.mark.parametrize("name", ["a.step", "a.dxf", "a", "obj"])
def test_other_types_are_refused(name: str) -> None:
    with pytest.raises(FileTypeError, match=r"\.3dm, \.npz, \.obj"):
        read_surface(b"", name)


@pytest.mark.parametrize("suffix", sorted(READERS))
@pytest.mark.parametrize(
    "data", [b"", b"\0" * 100, b"\xff\xfe garbage \x80" * 50, b"PK\x03\x04" * 30, b"solid\n"]
)
def test_garbage_is_refused(suffix: str, data: bytes) -> None:
    with pytest.raises(UnreadableFileError) as caught:
        read_surface(data, "a" + suffix)
    assert caught.value.slug == "unreadable-file"


FILES = {
    suffix: write(*[x if k == 0 else x.tolist() for k, x in enumerate(tube())])
    for suffix, write in WRITERS.items()
}


@given(st.sampled_from(sorted(FILES)), st.floats(0, 1), st.binary(max_size=4))
@settings(max_examples=150, deadline=None)
def test_broken_files_never_crash(suffix: str, where: float, junk: bytes) -> None:
    """Cut short, or with bytes overwritten: read, or refused as SurfaceError; nothing else."""
    data = FILES[suffix]
    at = int(where * len(data))
    for broken in (data[:at], data[:at] + junk + data[at + len(junk) :]):
        with suppress(SurfaceError):
            sent = read_surface(broken, "a" + suffix)
            if isinstance(sent, SentMesh):
                surface_from_mesh(sent)


def archive(**members: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as out:
        for name, data in members.items():
            out.writestr(f"{name}.npy", data)
    return stream.getvalue()


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def test_npz_that_lies_about_its_size_is_refused() -> None:
    vertices, quads = tube()
    huge = npy(vertices).replace(b"(35, 3), }           ", b"(3500000000000, 3), }", 1)
    assert b"3500000000000" in huge
    with pytest.raises(UnreadableFileError, match="truncated"):
        read_surface(archive(vertices=huge, faces=npy(quads)), "a.npz")


def test_npz_with_objects_is_not_unpickled() -> None:
    _, quads = tube()
    pickled = npy(np.array([{"a": 1}], dtype=object))
    with pytest.raises(UnreadableFileError, match="plain array"):
        read_surface(archive(vertices=pickled, faces=npy(quads)), "a.npz")


def test_npz_bomb_is_refused_before_it_is_unpacked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hexwrap_server.input.readers.npz.LARGEST", 10_000)
    with pytest.raises(UnreadableFileError, match="unpack"):
        read_surface(archive(vertices=b"\0" * 20_000), "a.npz")


@pytest.mark.parametrize("faces", [np.zeros((4, 5), int), np.zeros((4, 3)), np.zeros(4, int)])
def test_npz_with_faces_of_another_shape_is_refused(faces: np.ndarray) -> None:
    with pytest.raises(UnreadableFileError, match="shape"):
        read_surface(archive(vertices=npy(tube()[0]), faces=npy(faces)), "a.npz")


def test_npz_without_faces_is_refused() -> None:
    with pytest.raises(UnreadableFileError, match="'faces'"):
        read_surface(archive(vertices=npy(tube()[0])), "a.npz")


def test_decimal_commas_are_told() -> None:
    with pytest.raises(UnreadableFileError, match="decimal point instead of a comma"):
        read_surface(b"v 1,5 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "tower.obj")
