"""Drawings as spreadsheets, CAD programs and Rhino write them: each curve must arrive as it was drawn."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import rhino3dm
from ezdxf.document import Drawing as Document
from scipy.spatial import cKDTree

from hexwrap_server.errors import DrawingError
from hexwrap_server.input.curves import read_drawing
from hexwrap_server.input.readers import drawing_dxf, rhino_model
from hexwrap_server.input.readers.drawing import FLATNESS, Drawing
from hexwrap_server.input.readers.drawing_3dm import read_3dm_drawing
from hexwrap_server.input.readers.drawing_csv import read_csv
from hexwrap_server.input.readers.drawing_dxf import read_dxf
from hexwrap_server.input.readers.drawing_json import read_json

CASES = Path(__file__).parents[3] / "shared" / "cases" / "files"
SQUARE = [[-7.208, -3.922], [5.832, -3.922], [5.832, 9.118], [-7.208, 9.118]]


def points(drawing: Drawing) -> list[list[list[float]]]:
    return [curve.points.tolist() for curve in drawing.curves]


# Tables

GERMAN = "x;y\n-7,208;-3,922\n5,832;-3,922\n5,832;9,118\n-7,208;9,118\n"
TABLES = {
    "german": GERMAN,
    "tabulators": GERMAN.replace(";", "\t"),
    "blanks": GERMAN.replace(";", "  "),
    "points and semicolons": GERMAN.replace(",", "."),
    "points and commas": GERMAN.replace(",", ".").replace(";", ", "),
    "quoted": '"x","y"\n' + "".join(f'"{x}","{y}"\n' for x, y in SQUARE),
    "quoted german": "".join(f'"{x}","{y}"\n'.replace(".", ",") for x, y in SQUARE),
    "the word of a spreadsheet": "sep=;\n" + GERMAN,
    "empty cells behind": GERMAN.replace("\n", ";;\n"),
    "true minus": GERMAN.replace("-", "\N{MINUS SIGN}"),
    "comments": "# by hand\n" + GERMAN.replace("\n5", "\n# corner\n5", 1),
    "two headings": "# the square\nx [m];y [m]\n" + GERMAN.split("\n", 1)[1],
}


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_tables_of_every_country(table: str, encoding: str, line_end: str) -> None:
    text = TABLES[table].replace("\n", line_end)
    assert points(read_csv(text.encode(encoding))) == [SQUARE]


def test_thousands_and_latin_headings() -> None:
    assert points(read_csv("L\xe4nge;H\xf6he\n1.234,5;2.000.000,25\n".encode("latin-1"))) == [
        [[1234.5, 2000000.25]]
    ]
    assert points(read_csv(b"1,5 2,5\n3,5 4,5 5,5\n\n1 2".replace(b" 5,5", b""))) == [
        [[1.5, 2.5], [3.5, 4.5]],
        [[1.0, 2.0]],
    ]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("1,,3\n", "Line 1 .* empty cell"),
        ("x,y\n1,2\n1,,3\n", "Line 3 .* empty cell"),
        ("1,2x\n3,4\n", "Line 1 .* not made of numbers"),
        ("1o,2o\n3,4\n", "Line 1 .* not made of numbers"),
        (".5a,b\n3,4\n", "Line 1 .* not made of numbers"),
        ("x,y\nx,y\n3,4\n", "Line 2 .* not made of numbers"),
        ("1,5,2,5\n3,5,4,5\n", "separate the cells by ;"),
        ("1\n2\n", "holds 1 numbers"),
        ("1;2\n3;4;5\n", "as many in each curve"),
    ],
)
def test_tables_that_are_refused(text: str, word: str) -> None:
    with pytest.raises(DrawingError, match=word):
        read_csv(text.encode())


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_json_as_a_shell_writes_it(encoding: str) -> None:
    assert points(read_json('{"points": [[1, 2], [3, 4]]}'.encode(encoding))) == [[[1, 2]], [[3, 4]]]


@pytest.mark.parametrize("text", ["3", '{"points": 3}', "[3]", "[[]]", '{"curves": [3]}', '{"curves": [{}]}'])
def test_json_that_is_refused(text: str) -> None:
    with pytest.raises(DrawingError):
        read_json(text.encode())


# DXF


def dxf(draw: Callable[[Document], object], version: str = "R2010", form: str = "asc") -> bytes:
    document = ezdxf.new(version)
    draw(document)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.dxf"
        document.saveas(path, fmt=form)
        return path.read_bytes()


def square(document: Document) -> None:
    document.modelspace().add_lwpolyline(SQUARE, close=True)


def old_square(document: Document) -> None:
    document.modelspace().add_polyline2d(SQUARE, close=True)


FORMS: dict[str, Callable[[bytes], bytes]] = {
    "unix": lambda data: data,
    "windows": lambda data: data.replace(b"\n", b"\r\n"),
    "old mac": lambda data: data.replace(b"\n", b"\r"),
    "twice translated": lambda data: data.replace(b"\n", b"\r\r\n"),
    "mark": lambda data: b"\xef\xbb\xbf" + data,
    "utf-16": lambda data: data.decode().encode("utf-16"),
    "no line end behind": lambda data: data.rstrip(),
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("draw", "version"), [(old_square, "R12"), (square, "R2000"), (square, "R2018")])
def test_dxf_of_every_version_and_line_end(draw: Callable[[Document], None], version: str, form: str) -> None:
    text = dxf(draw, version).replace(b"\r\n", b"\n")
    read = read_dxf(FORMS[form](text))
    assert [curve.points[:, :2].tolist() for curve in read.curves] == [SQUARE]
    assert read.curves[0].closed
    assert not read.notes()


@pytest.mark.parametrize(("draw", "version"), [(old_square, "R12"), (square, "R2010")])
def test_binary_dxf(draw: Callable[[Document], None], version: str) -> None:
    read = read_dxf(dxf(draw, version, "bin"))
    assert [curve.points[:, :2].tolist() for curve in read.curves] == [SQUARE]


def test_blocks_are_resolved_nested_scaled_and_mirrored() -> None:
    def draw(document: Document) -> None:
        inner = document.blocks.new("inner")
        inner.add_line((0, 0), (1, 2))
        outer = document.blocks.new("outer")
        outer.add_blockref("inner", (10, 0), dxfattribs={"xscale": 2, "yscale": 2})
        space = document.modelspace()
        space.add_blockref("outer", (0, 100), dxfattribs={"xscale": -1})
        space.add_blockref("inner", (0, 0), dxfattribs={"column_count": 3, "column_spacing": 5})

    drawn = sorted(curve.points[:, :2].round(9).tolist() for curve in read_dxf(dxf(draw)).curves)
    assert drawn == [
        [[-10.0, 100.0], [-12.0, 104.0]],
        [[0.0, 0.0], [1.0, 2.0]],
        [[5.0, 0.0], [6.0, 2.0]],
        [[10.0, 0.0], [11.0, 2.0]],
    ]


def test_areas_are_their_outlines_and_multilines_their_lines() -> None:
    def draw(document: Document) -> None:
        space = document.modelspace()
        space.add_hatch().paths.add_polyline_path(SQUARE, is_closed=True)
        space.add_3dface([(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
        space.add_solid([(0, 0), (1, 0), (0, 1), (1, 1)])
        space.add_mline([(0, 0), (5, 0)])

    read = read_dxf(dxf(draw))
    assert sum(curve.closed for curve in read.curves) == 3
    assert sum(not curve.closed for curve in read.curves) >= 2
    assert not read.notes()


def test_what_is_left_out_is_told_with_count_and_kind() -> None:
    def draw(document: Document) -> None:
        space = document.modelspace()
        space.add_line((0, 0), (1, 1))
        space.add_polyline2d([(0, 0)])
        space.add_polymesh((3, 3))
        space.add_text("a")
        space.add_text("b")
        document.layers.add("off").off()
        space.add_circle((0, 0), 1, dxfattribs={"layer": "OFF"})

    read = read_dxf(dxf(draw))
    assert len(read.curves) == 1
    assert "2 POLYLINE, 2 TEXT, 1 hidden CIRCLE" in read.notes()[0]


@pytest.mark.parametrize("part", [0.3, 0.6, 0.9, 0.999])
@pytest.mark.parametrize("form", ["asc", "bin"])
def test_dxf_cut_short_is_refused(part: float, form: str) -> None:
    data = dxf(square, form=form)
    with pytest.raises(DrawingError, match=r"truncated|damaged"):
        read_dxf(data[: int(part * len(data))])


def test_blocks_that_multiply_without_end_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drawing_dxf, "MOST_OBJECTS", 1000)

    def doubled(document: Document) -> None:
        document.blocks.new("b0").add_line((0, 0), (1, 1))
        for k in range(20):
            block = document.blocks.new(f"b{k + 1}")
            block.add_blockref(f"b{k}", (0, 0))
            block.add_blockref(f"b{k}", (1, 0))
        document.modelspace().add_blockref("b20", (0, 0))

    def rows(document: Document) -> None:
        document.blocks.new("empty")
        grid = {"row_count": 32000, "column_count": 32000, "row_spacing": 1, "column_spacing": 1}
        document.modelspace().add_blockref("empty", (0, 0), dxfattribs=grid)

    for draw in (doubled, rows):
        with pytest.raises(DrawingError, match="more than"):
            read_dxf(dxf(draw))


def test_a_block_within_itself_ends() -> None:
    def draw(document: Document) -> None:
        block = document.blocks.new("snake")
        block.add_line((0, 0), (1, 1))
        block.add_blockref("snake", (1, 0))
        document.modelspace().add_blockref("snake", (0, 0))

    assert len(read_dxf(dxf(draw)).curves) >= 1


# Rhino


def rhino(*geometry: object, change: Callable[[rhino3dm.File3dm], object] | None = None) -> bytes:
    model = rhino3dm.File3dm()
    for item in geometry:
        model.Objects.Add(item)
    if change is not None:
        change(model)
    return base64.b64decode(model.Encode())


def p3(x: float, y: float, z: float = 0.0) -> rhino3dm.Point3d:
    return rhino3dm.Point3d(x, y, z)


def nurbs(degree: int, *control: Sequence[float]) -> rhino3dm.NurbsCurve:
    return rhino3dm.NurbsCurve.Create(False, degree, [p3(*c) for c in control])


def test_corners_of_a_curve_of_degree_1_are_exact() -> None:
    zigzag = [[0.1 * k, (-1.0) ** k, 0.0] for k in range(300)]
    assert points(read_3dm_drawing(rhino(nurbs(1, *zigzag)))) == [zigzag]


def test_corners_of_a_polycurve_are_exact_and_its_arcs_round() -> None:
    joined = rhino3dm.PolyCurve()
    joined.Append(rhino3dm.Line(p3(0, 0), p3(3, 0)))
    joined.Append(rhino3dm.Arc(p3(3, 0), p3(4, 1), p3(3, 2)))
    joined.Append(nurbs(1, (3, 2, 0), (3, 5, 0), (2.25, 5, 0), (2.25, 2, 0)))
    drawn = read_3dm_drawing(rhino(joined)).curves[0].points
    for corner in ([0, 0, 0], [3, 0, 0], [3, 2, 0], [3, 5, 0], [2.25, 5, 0], [2.25, 2, 0]):
        assert np.linalg.norm(drawn - corner, axis=1).min() < 1e-12
    arc = drawn[drawn[:, 0] > 3]
    middle = np.hypot(*((arc[1:] + arc[:-1]) / 2 - [3, 1, 0])[:, :2].T)
    assert len(arc) > 20
    np.testing.assert_allclose(middle, 1.0, atol=2 * FLATNESS * 5)


def test_kinks_at_knots_of_a_cubic_are_exact() -> None:
    curve = nurbs(3, (0, 0, 0), (1, 3, 0), (2, 3, 0), (3, 0, 0), (4, 3, 0), (5, 3, 0), (6, 0, 0))
    for k in range(3, 6):
        curve.Knots[k] = 1.0
    for k in range(6, 9):
        curve.Knots[k] = 2.0
    for k in range(3):
        curve.Knots[k] = 0.0
    assert curve.IsValid
    drawn = read_3dm_drawing(rhino(curve)).curves[0].points
    assert np.linalg.norm(drawn - [3, 0, 0], axis=1).min() < 1e-12


@pytest.mark.parametrize("turns", [3, 25])
def test_long_spirals_keep_their_shape(turns: int) -> None:
    """Between two points the polyline is as near to the curve as it says, however long the curve is."""
    t = np.linspace(0, turns * 2 * np.pi, 8 * turns + 1)
    through = np.stack([(1 + t / 9) * np.cos(t), (1 + t / 9) * np.sin(t), t / 5], axis=1)
    curve = nurbs(3, *through.tolist())
    drawn = read_3dm_drawing(rhino(curve)).curves[0].points
    fine = np.linspace(curve.Domain.T0, curve.Domain.T1, 5_000)
    true = np.array([[p.X, p.Y, p.Z] for p in map(curve.PointAt, fine.tolist())])
    near = cKDTree(drawn).query(true)[1]
    apart = []
    for a in (np.maximum(near - 1, 0), np.minimum(near, len(drawn) - 2)):  # the sides of the nearest corner
        along = drawn[a + 1] - drawn[a]
        share = ((true - drawn[a]) * along).sum(axis=1) / (along**2).sum(axis=1)
        foot = drawn[a] + np.clip(share, 0, 1)[:, None] * along
        apart.append(np.linalg.norm(true - foot, axis=1))
    worst = float(np.minimum(*apart).max())
    size = float(np.ptp(drawn, axis=0).max())
    assert worst <= 1.1 * FLATNESS * size


def test_circles_and_arcs_are_round() -> None:
    circle = rhino3dm.Circle(p3(1, 2), 3.0).ToNurbsCurve()
    joined = rhino3dm.PolyCurve()
    joined.Append(rhino3dm.Arc(rhino3dm.Circle(p3(1, 2), 3.0), 2 * np.pi))
    for geometry in (circle, joined, joined.SegmentCurve(0)):
        read = read_3dm_drawing(rhino(geometry)).curves[0]
        assert read.closed
        around = np.vstack([read.points, read.points[:1]])
        np.testing.assert_allclose(np.hypot(*(around - [1, 2, 0])[:, :2].T), 3.0, atol=1e-9)
        sagitta = 3 - np.hypot(*((around[1:] + around[:-1]) / 2 - [1, 2, 0])[:, :2].T)
        assert sagitta.max() <= FLATNESS * 6


def test_rhino_blocks_are_resolved_and_hidden_things_are_told() -> None:
    def change(model: rhino3dm.File3dm) -> None:
        line = rhino3dm.LineCurve(p3(0, 0), p3(1, 2))
        plain = [rhino3dm.ObjectAttributes()]
        model.InstanceDefinitions.Add("inner", "", "", "", p3(0, 0), (line,), tuple(plain))
        twice = rhino3dm.Transform.Scale(p3(0, 0), 2.0)
        first = rhino3dm.InstanceReference(next(d.Id for d in model.InstanceDefinitions), twice)
        model.InstanceDefinitions.Add("outer", "", "", "", p3(0, 0), (first,), tuple(plain))
        outer = next(d.Id for d in model.InstanceDefinitions if d.Name == "outer")
        mirror = rhino3dm.Transform.Mirror(p3(0, 0), rhino3dm.Vector3d(1, 0, 0))
        model.Objects.AddInstanceObject(rhino3dm.InstanceReference(outer, mirror), plain[0])
        hidden = rhino3dm.ObjectAttributes()
        hidden.Mode = rhino3dm.ObjectMode.Hidden
        model.Objects.AddCurve(line, hidden)
        model.Objects.AddTextDot("a", p3(0, 0))

    read = read_3dm_drawing(rhino(change=change))
    assert points(read) == [[[0.0, 0.0, 0.0], [-2.0, 4.0, 0.0]]]
    assert "1 TextDot, 1 hidden LineCurve" in read.notes()[0]


def test_rhino_blocks_that_multiply_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rhino_model, "MOST_OBJECTS", 100)

    def change(model: rhino3dm.File3dm) -> None:
        content: list[object] = [rhino3dm.LineCurve(p3(0, 0), p3(1, 2))]
        for k in range(12):
            plain = [rhino3dm.ObjectAttributes() for _ in content]
            model.InstanceDefinitions.Add(f"b{k}", "", "", "", p3(0, 0), tuple(content), tuple(plain))
            id = next(d.Id for d in model.InstanceDefinitions if d.Name == f"b{k}")
            content = [rhino3dm.InstanceReference(id, rhino3dm.Transform.Identity()) for _ in range(2)]
        model.Objects.AddInstanceObject(content[0], rhino3dm.ObjectAttributes())

    with pytest.raises(DrawingError, match="more than"):
        read_3dm_drawing(rhino(change=change))


# Files


def test_errors_name_the_file(tmp_path: Path) -> None:
    (tmp_path / "a.dxf").write_bytes(dxf(lambda document: document.modelspace().add_text("a")))
    with pytest.raises(DrawingError, match=r"a\.dxf holds no points and no curves; .*1 TEXT"):
        read_drawing(tmp_path / "a.dxf")


@pytest.mark.skipif(not CASES.is_dir(), reason="the files shown are not here")
def test_files_shown() -> None:
    assert points(read_drawing(CASES / "csv_german.csv")) == [SQUARE]
    assert points(read_drawing(CASES / "dxf_crlf.dxf")) == points(read_drawing(CASES / "dxf_lf.dxf"))
    one_vertex = read_drawing(CASES / "dxf_one_vertex_polyline.dxf")
    assert len(one_vertex.curves) == 1
    assert "1 POLYLINE" in one_vertex.notes()[0]
    assert len(read_drawing(CASES / "dxf_block_and_line.dxf").curves) == 2
    zigzag = rhino3dm.File3dm.Read(str(CASES / "curve_zigzag_degree1.3dm")).Objects[0].Geometry
    read = read_drawing(CASES / "curve_zigzag_degree1.3dm").curves[0].points
    control = [[p.X, p.Y, p.Z] for p in (zigzag.Points[i] for i in range(len(zigzag.Points)))]
    np.testing.assert_array_equal(read, control)
