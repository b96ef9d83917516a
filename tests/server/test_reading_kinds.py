"""Mesh files as programs in the wild write them: each must be read as the same tube, or refused in words."""

from __future__ import annotations

import io
import json
import os
import re
import struct
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hexwrap_server.errors import UnreadableFileError
from hexwrap_server.input.choose import choose
from hexwrap_server.input.surface_files import read_file
from hexwrap_solver.errors import SurfaceError
from hexwrap_solver.surface import SentMesh, surface_from_mesh
from hexwrap_solver.surface.errors import IndexRangeError
from tests.server.test_reading import obj, off, ply, read_surface
from tests.solver.surface.shapes import triangles, tube

CASES = Path(__file__).parents[3] / "shared" / "cases" / "files"
VERTICES, QUADS = tube()
MIXED = [*QUADS[:5].tolist(), *triangles(QUADS[5:]).tolist()]
OBJ, OFF, PLY = (write(VERTICES, MIXED) for write in (obj, off, ply))


def check(data: bytes, name: str, faces: list[list[int]] | None = MIXED, atol: float = 0.0) -> SentMesh:
    sent = read_surface(data, name)
    assert isinstance(sent, SentMesh)
    np.testing.assert_allclose(sent.vertices, VERTICES, rtol=0, atol=atol)
    assert sent.faces.to_lists() == faces
    return sent


TEXT_FORMS: dict[str, Callable[[bytes], bytes]] = {
    "windows": lambda text: text.replace(b"\n", b"\r\n"),
    "old mac": lambda text: text.replace(b"\n", b"\r"),
    "mark": lambda text: b"\xef\xbb\xbf" + text,
    "utf-16": lambda text: text.decode().encode("utf-16"),
    "utf-16 big": lambda text: text.decode().encode("utf-16-be"),
    "utf-16 little": lambda text: text.decode().encode("utf-16-le"),
    "utf-32": lambda text: text.decode().encode("utf-32"),
    "trailing blanks": lambda text: text.replace(b"\n", b" \t\n"),
    "empty lines": lambda text: text.replace(b"\n", b"\n\n"),
}


@pytest.mark.parametrize("form", TEXT_FORMS)
@pytest.mark.parametrize(("name", "text"), [("a.obj", OBJ), ("a.off", OFF)])
def test_every_line_end_and_encoding(name: str, text: bytes, form: str) -> None:
    check(TEXT_FORMS[form](text), name)


@pytest.mark.parametrize(("name", "write"), [("a.obj", obj), ("a.off", off), ("a.ply", ply)])
def test_polygons_are_cut_and_told(name: str, write: Callable[..., bytes]) -> None:
    vertices, quads = tube(around=8)
    pairs = zip(quads[::2].tolist(), quads[1::2].tolist(), strict=True)
    hexagons = [[a, b, f, g, e, d] for (a, b, e, d), (_, f, g, _) in pairs]
    data = write(vertices, hexagons)
    surface = surface_from_mesh(read_surface(data, name))
    assert len(surface.loops) == 2
    assert len(surface.faces) == 4 * len(hexagons)
    notes = choose(read_file(data, name)).notes
    assert notes == (f"{len(hexagons)} polygons with more than four corners were cut into triangles.",)


@pytest.mark.parametrize("form", ["windows", "old mac", "mark", "utf-16", "trailing blanks"])
def test_every_line_end_of_a_text_ply(form: str) -> None:
    check(TEXT_FORMS[form](PLY), "a.ply")


# OBJ


@pytest.mark.parametrize(
    "line", [b"# C:\\models\\", b"g wall\\", b"o tower\\", b"usemtl glass\\", b"mtllib C:\\", b"# end \\  "]
)
def test_a_backslash_continues_data_and_nothing_else(line: bytes) -> None:
    check(line + b"\n" + OBJ, "a.obj")
    at = OBJ.index(b"\nf ") + 1
    check(OBJ[:at] + line + b"\n" + OBJ[at:], "a.obj")


def test_continued_vertices_and_faces() -> None:
    broken = re.sub(rb"\n([vf]) (\S+) ", rb"\n\1 \\\n\2 \\\n ", OBJ)
    assert broken.count(b"\\\n") > 100
    check(broken, "a.obj")
    check(broken.replace(b"\n", b"\r\n"), "a.obj")


def test_comments_behind_data_do_not_continue_it() -> None:
    check(re.sub(rb"\n([vf] [^\n]*)", rb"\n\1 # see C:\\dir\\", OBJ), "a.obj")


def test_letters_of_any_size_and_old_face_lines() -> None:
    check(OBJ.replace(b"\nv ", b"\nV ").replace(b"\nf ", b"\nF "), "a.obj")
    check(OBJ.replace(b"\nf ", b"\nfo "), "a.obj")


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "counted from 1"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "names vertex 4"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", "names vertex -4"),
        (b"v 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "fewer than three"),
        (b"v 0 0 x\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "'x', which is not a number"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 c\n", "'c', which is not an integer"),
        (b"v 0 0 0\nv 1 0 0\nl 1 2\n", "holds lines"),
        (b"v 0 0 0\nv 1 0 0\ncstype bspline\nsurf 0 1 0 1 1 2\n", "holds NURBS surfaces"),
    ],
)
def test_obj_that_is_refused(text: bytes, word: str) -> None:
    with pytest.raises(UnreadableFileError, match=word):
        read_surface(text, "a.obj")


# OFF


def off_body(faces: list[list[int]] = MIXED) -> tuple[str, list[str]]:
    """The counts, and the lines below them."""
    lines = off(VERTICES, faces).decode().splitlines()
    return lines[1], lines[2:]


@pytest.mark.parametrize("named", [True, False])
def test_very_many_objects_are_told_apart_at_once(named: bool) -> None:
    """Separate triangles, each ten times the work of the file if each were cut out of the whole."""
    n = 20_000
    rng = np.random.default_rng(1)
    vertices = rng.random((n, 1, 3)) * 100 + np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    corners = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices.reshape(-1, 3).tolist()]
    lines = [f"o {i}\n" * named + f"f {3 * i + 1} {3 * i + 2} {3 * i + 3}" for i in range(n)]
    objects = read_file("\n".join(corners + lines).encode(), "many.obj").objects
    assert len(objects) == n
    for found in objects[:: n // 7]:
        part = found.read()
        assert isinstance(part, SentMesh)
        assert part.faces.n_rows == 1
        assert np.ptp(part.vertices[part.faces.values], axis=0) == pytest.approx(found.size, abs=1e-12)


@pytest.mark.parametrize("keyword", ["OFF\n", "OFF ", "OFF", "off\n", "", "# a comment\n\nOFF\n"])
def test_off_keywords(keyword: str) -> None:
    counts, lines = off_body()
    check("\n".join([keyword + counts, *lines]).encode(), "a.off")


def test_off_counts_on_several_lines_or_without_edges() -> None:
    counts, lines = off_body()
    for text in (counts.replace(" ", "\n"), " ".join(counts.split()[:2]), counts.replace(" ", "\t")):
        check("\n".join(["OFF", text, *lines]).encode(), "a.off")


def test_off_rows_over_several_lines_and_several_rows_in_one() -> None:
    counts, lines = off_body()
    wrapped = [word for line in lines for word in line.split()]
    by_row = "\n".join(line.replace(" ", "\n  ", 1) for line in lines)
    for body in ("\n".join(wrapped[:3]) + "\n" + "\n".join(lines[1:]), by_row, " ".join(wrapped)):
        check(f"OFF\n{counts}\n{body}".encode(), "a.off")


def test_off_that_counts_from_one_and_writes_edges_as_faces() -> None:
    counts, lines = off_body([[v + 1 for v in face] for face in MIXED])
    counts = counts.replace(str(len(MIXED)), str(len(MIXED) + 2), 1)
    check("\n".join(["OFF", counts, *lines, "2 1 2", "2 3 2"]).encode(), "a.off")
    notes = read_file("\n".join(["OFF", counts, *lines, "2 1 2", "2 3 2"]).encode(), "a.off").notes
    assert "count vertices from 1" in notes[0]
    assert notes[1] == "Faces with fewer than three corners were left out, 2 in all."


def test_off_with_an_edge_and_a_vertex_that_is_not_there() -> None:
    text = b"OFF\n4 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 9\n2 0 1\n"
    with pytest.raises(SurfaceError, match="corners"):
        read_file(text, "a.off")


@pytest.mark.parametrize("name", ["a.off", "a.ply"])
def test_a_face_at_no_vertex_is_named(name: str) -> None:
    data = (off if name == "a.off" else ply)(VERTICES, [*MIXED, [0, 1, len(VERTICES) + 3]])
    with pytest.raises(IndexRangeError, match=f"Face {len(MIXED)} points at vertex {len(VERTICES) + 3}, but"):
        read_file(data, name)


def test_off_with_colours_normals_and_a_fourth_coordinate() -> None:
    counts, lines = off_body()
    n = len(VERTICES)
    coloured = [line + " 0.5 0.5 1" for line in lines]
    check("\n".join(["OFF", counts, *coloured]).encode(), "a.off")
    check("\n".join(["COFF", counts, *(f"{x} 1 0 0 1" for x in lines[:n]), *lines[n:]]).encode(), "a.off")
    check("\n".join(["NOFF", counts, *(f"{x} 0 0 1" for x in lines[:n]), *lines[n:]]).encode(), "a.off")
    double = [f"{' '.join(str(2 * float(word)) for word in x.split())} 2" for x in lines[:n]]
    check("\n".join(["4OFF", counts, *double, *lines[n:]]).encode(), "a.off", atol=1e-15)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2\n3 0 2 3\n", "row of face 0 is '4 0 1 2'"),
        ("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2\n", "row of face 0"),
        ("OFF\n4 1 0\n0 0 0\n1 0\n1 1 0\n0 1 0\n3 0 1 2\n", "row of vertex 1"),
        ("OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n", "truncated"),
        ("OFF\n400000000000 2 0\n0 0 0\n", "truncated"),
        ("OFF\n4\n", "how many"),
        ("OFF BINARY\n\0\0", "binary"),
        ("nOFF\n4\n1 1 1\n", "dimension"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n1 1 0\n-3 0 1 2\n", "number of its entries"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n1 1 a\n3 0 1 2\n", "'a'"),
        ("solid", "neither"),
    ],
)
def test_off_that_is_refused(text: str, word: str) -> None:
    with pytest.raises(UnreadableFileError, match=word):
        read_surface(text.encode(), "a.off")


# PLY


def binary_ply(
    order: str,
    faces: list[list[int]] = MIXED,
    count: str = "uchar",
    index: str = "int",
    line: str = "\n",
    name: str = "vertex_indices",
    behind: bool = False,
    real: str = "double",
) -> bytes:
    codes = {
        "uchar": "B", "uint8": "B", "int": "i", "uint": "I", "ushort": "H", "short": "h", "float": "f",
        "double": "d", "float32": "f",
    }  # fmt: skip
    head = ["ply", f"format binary_{'little' if order == '<' else 'big'}_endian 1.0", "comment a\xe9"]
    head += [f"element vertex {len(VERTICES)}"] + [f"property {real} {axis}" for axis in "xyz"]
    head += ["property uchar red"] * behind
    head += [f"element face {len(faces)}"] + ["property uchar flags"] * behind
    head += [f"property list {count} {index} {name}"] + ["property list uchar float texcoord"] * behind
    head += ["element edge 1", "property int vertex1"] * behind
    head += ["end_header"]
    out = line.join([*head, ""]).encode("latin-1")
    for row in VERTICES.tolist():
        out += struct.pack(f"{order}3{codes[real]}", *row) + b"\x07" * behind
    for face in faces:
        out += b"\x01" * behind
        out += struct.pack(f"{order}{codes[count]}{len(face)}{codes[index]}", len(face), *face)
        out += struct.pack(f"{order}B{len(face)}f", len(face), *face) * behind
    return out + struct.pack(f"{order}i", 3) * behind


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("behind", [False, True])
def test_binary_ply_with_mixed_faces(order: str, behind: bool) -> None:
    check(binary_ply(order, behind=behind), "a.ply")
    check(binary_ply(order, behind=behind) + b"tail", "a.ply")


@pytest.mark.parametrize("line", ["\r\n", "\r"])
@pytest.mark.parametrize(("count", "index"), [("int", "uint"), ("ushort", "short"), ("uint8", "ushort")])
def test_binary_ply_of_other_types_and_line_ends(line: str, count: str, index: str) -> None:
    check(binary_ply("<", count=count, index=index, line=line, name="vertex_index"), "a.ply")


def test_a_header_of_old_mac_lines_before_a_first_byte_that_looks_like_a_line_end() -> None:
    data = binary_ply("<", line="\r")
    start = data.index(b"end_header\r") + len("end_header\r")
    moved = data[:start] + b"\n" + data[start + 1 :]
    sent = read_surface(moved, "a.ply")
    assert isinstance(sent, SentMesh)
    assert sent.faces.to_lists() == MIXED


def test_names_in_upper_case_and_single_precision() -> None:
    data = binary_ply("<", real="float32")
    end = data.index(b"end_header")
    check(data[:end].upper() + data[end:], "a.ply", atol=1e-6)


def test_ply_faces_before_vertices() -> None:
    lines = PLY.decode().splitlines()
    end = lines.index("end_header")
    n = len(VERTICES)
    at = lines.index(f"element face {len(MIXED)}")
    head = [*lines[:2], *lines[at:end], *lines[2:at], "end_header"]
    body = lines[end + 1 :]
    check("\n".join([*head, *body[n:], *body[:n]]).encode(), "a.ply")


@pytest.mark.parametrize("binary", [False, True])
def test_triangle_strips(binary: bool) -> None:
    """Two strips in one row, then one with a repeated corner."""
    strips = [[0, 1, 2, 3, -1, 4, 5, 6], [0, 1, 2, 2, 3, 4]]
    expected = [[0, 1, 2], [2, 1, 3], [4, 5, 6], [0, 1, 2], [3, 2, 4]]
    kind = "binary_little_endian" if binary else "ascii"
    head = ["ply", f"format {kind} 1.0", "element vertex 7", *(f"property float {x}" for x in "xyz")]
    head += ["element tristrips 2", "property list int int vertex_indices", "end_header", ""]
    points = np.arange(21.0).reshape(7, 3)
    if binary:
        body = points.astype("<f4").tobytes()
        body += b"".join(struct.pack(f"<{len(s) + 1}i", len(s), *s) for s in strips)
    else:
        rows = [*points.tolist(), *([len(s), *s] for s in strips)]
        body = "\n".join(" ".join(map(str, row)) for row in rows).encode()
    sent = read_file("\n".join(head).encode() + body, "a.ply").mesh
    assert sent is not None
    turned = [face[np.argmin(face) :] + face[: np.argmin(face)] for face in sent.faces.to_lists()]
    assert sorted(turned) == sorted(f[np.argmin(f) :] + f[: np.argmin(f)] for f in expected)


def without(text: bytes, word: bytes) -> bytes:
    assert word in text
    return text.replace(word, b"", 1)


@pytest.mark.parametrize(
    ("data", "word"),
    [
        (binary_ply("<")[:-3], "truncated"),
        (binary_ply(">")[:200], "truncated"),
        (PLY[:-40], "row of face|truncated"),
        (without(PLY, b"format ascii 1.0\n"), "text or binary"),
        (without(PLY, b"end_header\n"), "no header"),
        (without(PLY, b"property double z\n"), "x, y and z"),
        (PLY.replace(b"double x", b"decimal x"), "type 'decimal'"),
        (
            PLY.replace(b"element face 5", b"element fact 5").replace(b"element face", b"element fact"),
            "faces",
        ),
        (re.sub(rb"element vertex \d+", b"element vertex 99999999999", PLY), "truncated"),
        (re.sub(rb"element vertex \d+", b"element vertex 99999999999", binary_ply("<")), "truncated"),
        (b"ply\nformat ascii 1.0\nelement vertex x\nend_header\n", "cannot be read"),
    ],
)
def test_ply_that_is_refused(data: bytes, word: str) -> None:
    with pytest.raises(UnreadableFileError, match=word):
        read_surface(data, "a.ply")


# STL

FACETS = VERTICES[triangles(QUADS)]


def binary_stl(header: bytes = b"", count: int | None = None) -> bytes:
    out = header.ljust(80, b"\0") + struct.pack("<I", len(FACETS) if count is None else count)
    return out + b"".join(struct.pack("<12fH", 0, 0, 0, *facet.ravel(), 0) for facet in FACETS)


def text_stl(*names: str, end: bool = True) -> str:
    """As many solids as names."""
    out = []
    for name, facets in zip(names, np.array_split(FACETS, len(names)), strict=True):
        out.append(f"solid {name}".rstrip())
        for facet in facets.tolist():
            out += ["facet normal 0 0 0", "  outer loop"]
            out += ["    vertex " + " ".join(map(repr, point)) for point in facet]
            out += ["  endloop", "endfacet"]
        out += [f"endsolid {name}".rstrip()] * end
    return "\n".join(out) + "\n"


def check_stl(data: bytes, atol: float = 0.0) -> None:
    sent = read_surface(data, "a.stl")
    assert isinstance(sent, SentMesh)
    np.testing.assert_allclose(sent.vertices.reshape(-1, 3, 3), FACETS, rtol=0, atol=atol)
    assert len(surface_from_mesh(sent).vertices) == len(VERTICES)


@pytest.mark.parametrize("header", [b"", b"solid by a program", b"solid facet", b"COLOR=\xff\0\0\xff"])
@pytest.mark.parametrize("tail", [b"", b"extra bytes", b"\0" * 50])
def test_binary_stl_with_any_header_and_tail(header: bytes, tail: bytes) -> None:
    check_stl(binary_stl(header) + tail, 1e-6)


@pytest.mark.parametrize(
    "text",
    [
        text_stl("tube"),
        text_stl(""),
        text_stl("a", "b", "c"),
        text_stl("tube", end=False),
        text_stl("a", "b", end=False),
        text_stl("vertex 1 2 3", "facet"),
        text_stl("tube").upper(),
        " ".join(text_stl("tube").split()),
        text_stl("tube").replace("\n", "\r\n"),
        text_stl("tube").replace("\n", "\r"),
        "\n \n" + text_stl("tube"),
        text_stl("tube").split("\n", 1)[1],
    ],
)
def test_text_stl(text: str) -> None:
    check_stl(text.encode())


def test_text_stl_in_other_encodings() -> None:
    for encoding in ("latin-1", "utf-8", "utf-8-sig", "utf-16"):
        check_stl(text_stl("B\xfcro").encode(encoding))


@pytest.mark.parametrize(
    ("data", "word"),
    [
        (binary_stl()[:-10], "truncated"),
        (binary_stl(count=10**9), "announces 1000000000 triangles"),
        (binary_stl(count=0), "announces 0"),
        (binary_stl()[:50], "header"),
        (text_stl("tube").encode()[:-60], "incomplete"),
        (text_stl("tube").replace("  endloop\nendfacet\nendsolid tube\n", "").encode(), "incomplete"),
        (text_stl("tube").replace("vertex", "vertex ,", 1).encode(), "','"),
        (re.sub(rb"vertex \S+", b"vertex", text_stl("a").encode(), count=1), "fewer|not a number"),
        (b"solid nothing\nendsolid nothing\n", "no facets"),
    ],
)  # fmt: skip
def test_stl_that_is_refused(data: bytes, word: str) -> None:
    with pytest.raises(UnreadableFileError, match=word):
        read_surface(data, "a.stl")


# NPZ


def test_npz_pads_triangles_in_types_without_a_sign() -> None:
    table = np.array([face if len(face) == 4 else [*face, -1] for face in MIXED])
    for kind in (np.int32, np.uint32, np.uint64, ">i8"):
        stream = io.BytesIO()
        np.savez(stream, vertices=np.asfortranarray(VERTICES).astype(">f8"), faces=table.astype(kind))
        check(stream.getvalue(), "a.npz")


# Files shown


@pytest.mark.skipif(not CASES.is_dir(), reason="the files shown are not here")
def test_files_shown_are_the_tubes_they_were_made_from() -> None:
    def read(name: str) -> SentMesh:
        sent = read_surface((CASES / name).read_bytes(), name)
        assert isinstance(sent, SentMesh)
        return sent

    plain = surface_from_mesh(read("obj_plain.obj"))
    for name in (
        "obj_bom_spare.obj", "obj_comment_backslash_spare.obj", "obj_group_backslash.obj",
        "ply_latin1_comment.ply", "ply_mixed_ascii.ply", "ply_mixed_le.ply", "stl_tail.stl",
        "stl_latin1_name.stl", "stl_two_solids.stl",
    ):  # fmt: skip
        surface = surface_from_mesh(read(name))
        assert len(surface.faces) == len(plain.faces), name
        ours, theirs = (x.vertices[np.lexsort(x.vertices.round(4).T)] for x in (surface, plain))
        np.testing.assert_allclose(ours, theirs, atol=1e-4, err_msg=name)
    assert len(surface_from_mesh(read("off_glued.off")).vertices) == 312


#: Read every file in a process in which only what a plain installation brings can be imported.
PLAIN = """
import importlib.metadata as m, json, re, sys, importlib.abc
needs, files = map(json.loads, sys.argv[1:])
base, todo = set(), [re.match(r"[\\w.-]+", need)[0] for need in needs]
while todo:
    name = re.sub(r"[-_.]+", "-", todo.pop()).lower()
    if name in base:
        continue
    base.add(name)
    try:
        needed = m.requires(name) or []
    except m.PackageNotFoundError:
        continue
    todo += [re.match(r"[\\w.-]+", need)[0] for need in needed if "extra ==" not in need]
spelled = lambda name: re.sub(r"[-_.]+", "-", name).lower()
outside = {top for top, names in m.packages_distributions().items() if not base & set(map(spelled, names))}
class Blocker(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in outside:
            raise ImportError(f"{name} is not part of a plain installation")
sys.meta_path.insert(0, Blocker())
from pathlib import Path
from hexwrap_server.input.surface_files import read_surface
from hexwrap_server.input.curves import read_drawing
assert {"trimesh", "pytest"} <= outside, outside
for path in map(Path, files):
    read_drawing(path) if path.stem == "drawing" else read_surface(path.read_bytes(), path.name)
import hexwrap_server.cli.main, hexwrap_server.http.app, hexwrap_server.output.writers
print("read all")
"""


def test_a_plain_installation_reads_everything(tmp_path: Path) -> None:
    """The test extra must not hide a package that is missing."""
    from hexwrap_server.input.curves import WRITERS, write_curves
    from hexwrap_server.input.readers.drawing import Curve
    from tests.server.test_reading import WRITERS as SURFACES

    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))
    needs = json.dumps(project["project"]["dependencies"])
    paths = []
    for suffix, write in SURFACES.items():
        paths.append(tmp_path / f"tube{suffix}")
        paths[-1].write_bytes(write(VERTICES, MIXED if suffix != ".stl" else QUADS.tolist()))
    paths.append(tmp_path / "latin.stl")
    paths[-1].write_bytes(text_stl("B\xfcro").encode("latin-1"))
    for suffix in WRITERS:
        paths.append(tmp_path / f"drawing{suffix}")
        paths[-1].write_bytes(write_curves(suffix, [Curve(VERTICES[:5])]))
    ran = subprocess.run(
        [sys.executable, "-c", PLAIN, needs, json.dumps([str(path) for path in paths])],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(os.path.abspath(p or ".") for p in sys.path)},
        capture_output=True,
        text=True,
    )
    assert ran.stdout.strip() == "read all", ran.stderr
