"""The command line: every field has an option, every ending a writer, every refusal its exit status."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import rhino3dm

from hexwrap_server import __version__, samples
from hexwrap_server.cli.local import task
from hexwrap_server.cli.main import ENDINGS, file_kind, main, make_parser
from hexwrap_server.cli.options import OPTIONS
from hexwrap_server.input.form import Body, leaves
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.output.writers import WRITERS

TUBE_ROWS, TUBE_COLUMNS = 9, 24
#: Files that share their ending with another one.
NAMED = {"flat.dxf", "domain.dxf", "cutting-list.csv"}
#: Corners of three triangles on one edge.
FINS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0]]


@pytest.fixture
def tube(tmp_path: Path) -> Path:
    """An OBJ file of a waisted tube of quads."""
    t, z = np.meshgrid(np.arange(TUBE_COLUMNS) * 2 * np.pi / TUBE_COLUMNS, np.linspace(-1, 1, TUBE_ROWS))
    r = 1 + 0.2 * z**2
    points = np.stack([r * np.cos(t), r * np.sin(t), 1.5 * z], axis=-1).reshape(-1, 3)
    lines = [f"v {x} {y} {z}" for x, y, z in points.tolist()]
    for j in range(TUBE_ROWS - 1):
        for i in range(TUBE_COLUMNS):
            a, b = j * TUBE_COLUMNS + i, j * TUBE_COLUMNS + (i + 1) % TUBE_COLUMNS
            lines.append(f"f {a + 1} {b + 1} {b + TUBE_COLUMNS + 1} {a + TUBE_COLUMNS + 1}")
    path = tmp_path / "Röhre.obj"
    path.write_text("\n".join(lines))
    return path


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"hexwrap {__version__}\n"


def test_every_field_of_a_request_has_an_option() -> None:
    assert [option.path for option in OPTIONS] == [leaf.path for leaf in leaves(Body)]
    assert len({option.flag for option in OPTIONS}) == len(OPTIONS)


def test_every_file_of_the_service_has_an_ending() -> None:
    assert {file_kind(f"x/{name}") for name in WRITERS} == set(WRITERS)
    assert {file_kind(f"x{ending.upper()}") for ending in ENDINGS} == {*WRITERS} - NAMED


def test_solve_writes_every_file(tube: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outs = [str(tmp_path / f"tube {name}") for name in WRITERS]
    arguments = ["solve", str(tube), "--around", "12", "--sizes", "3"]
    for out in outs:
        arguments += ["-o", out]
    assert main(arguments) == 0
    assert all(Path(out).stat().st_size > 0 for out in outs)
    result = json.loads(Path(outs[[*WRITERS].index("result.json")]).read_text(encoding="utf-8"))
    assert len(result["sizes"]) == 3
    assert result["pattern"]["around"] == 12
    told = capsys.readouterr().out
    assert told.startswith("Röhre\n")
    assert all(f"wrote {out}" in told for out in outs)


def test_options_reach_the_request(tube: Path, tmp_path: Path) -> None:
    out = tmp_path / "r.json"
    options = "--pattern quad --around 10 --sizes none --cells trim --boundary isometric -q"
    assert main(["solve", str(tube), "-o", str(out), *options.split()]) == 0
    result = json.loads(out.read_text(encoding="utf-8"))
    assert result["pattern"]["kind"] == "quad"
    assert result["map"]["cone_angle"] == pytest.approx(0, abs=1e-9)


def test_support_is_made_with_and_without_a_depth(tube: Path, tmp_path: Path) -> None:
    for options, beams in ((["--support"], False), (["--support", "--depth", "0.1"], True)):
        out, model = tmp_path / "s.json", tmp_path / "s.3dm"
        given = ["solve", str(tube), "--around", "8", "-q", "-o", str(out), "-o", str(model)]
        assert main([*given, *options]) == 0
        assert len(json.loads(out.read_text(encoding="utf-8"))["support"]["axes"]) > 0
        layers = {layer.Index: layer.FullPath for layer in rhino3dm.File3dm.Read(str(model)).Layers}
        assert "support::axes" in layers.values()
        assert ("support::beams" in layers.values()) == beams


def test_a_request_file_and_a_bare_surface_are_both_inputs(tube: Path, tmp_path: Path) -> None:
    points = [line.split()[1:] for line in tube.read_text().splitlines() if line.startswith("v ")]
    faces = [line.split()[1:] for line in tube.read_text().splitlines() if line.startswith("f ")]
    surface = {
        "vertices": [[float(x) for x in point] for point in points],
        "faces": [[int(i) - 1 for i in face] for face in faces],
    }
    request = {"surface": surface, "name": "named", "pattern": {"around": 14}, "panels": None}
    for name, body, around in (("request", request, 14), ("surface", surface, 8)):
        path, out = tmp_path / f"{name}.json", tmp_path / f"{name}.out.json"
        path.write_text(json.dumps(body))
        options = [] if around == 14 else ["--around", "8"]
        assert main(["solve", str(path), "-q", "-o", str(out), *options]) == 0
        assert json.loads(out.read_text(encoding="utf-8"))["pattern"]["around"] == around


@pytest.mark.parametrize("name", samples.names())
def test_samples_are_requests_that_the_service_takes(name: str) -> None:
    assert parse_request(samples.load(name), 10**6, 10**6).name == name


def refusal(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    status = main(arguments)
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("hexwrap: ")
    return status, told.err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--around", "0"], "--around"),
        (["--around", "many"], "--around"),
        (["--edge-range", "2", "1"], "min ≤ max"),
        (["--angle", "12"], "give VERTEX=ANGLE or X,Y,Z=ANGLE"),
        (["--at", "1,2=1"], "give VERTEX=INDEX or X,Y,Z=INDEX"),
        (["--only", "3=1"], "give X,Y,Z=RADIUS"),
        (["--keep-off", "1,2,3;4=1"], "give X,Y,Z;X,Y,Z=DISTANCE"),
        (["--around", "8", "--edge-length", "2"], "give either 'around' or 'edge_length'"),
        (["-o", "x.docx"], "ending must be one of"),
        (["-o", "no/such/folder/x.obj"], "does not exist"),
        (["--sheet", "0", "1"], "greater than 0"),
        (["--sheet", "inf", "1"], "finite"),
        (["--sheet", "1", "nan"], "finite"),
    ],
)
def test_usage_is_status_2(
    tube: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], words: str
) -> None:
    status, told = refusal(["solve", str(tube), "-o", str(tmp_path / "x.obj"), *options], capsys)
    assert status == 2
    assert words in told


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        ({"pattern": "hex"}, ["--around", "12"], "Input should be an object"),
        ({"panels": {"weights": 3}}, ["--weight-edge", "2"], "Input should be an object, not 3"),
        ({"boundary": []}, ["--angle", "3=2"], "Input should be an object"),
        ({"surface": 5}, ["--max-edge", "1"], "must be an object"),
    ],
)
def test_options_beside_sections_of_the_wrong_form_are_refused(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    change: dict[str, object],
    options: list[str],
    words: str,
) -> None:
    path = tmp_path / "request.json"
    path.write_text(json.dumps(samples.load("tower") | change))
    assert words in refusal(["solve", str(path), "-o", str(tmp_path / "x.obj"), *options], capsys)[1]


def test_sizes_of_the_mesh_go_beside_a_nurbs_surface_only(tmp_path: Path) -> None:
    path = tmp_path / "nurbs.json"
    net = [[[np.cos(t), np.sin(t), z, 1] for z in (0, 1)] for t in np.linspace(0, 2 * np.pi, 9).tolist()]
    nurbs = {"degree": [1, 1], "knots": [[0, *range(9), 8], [0, 0, 1, 1]], "control_points": net}
    path.write_text(json.dumps({"surface": {"nurbs": nurbs, "mesh": None}}))
    asked = make_parser().parse_args(["solve", "x", "-o", "x.obj", "--max-edge", "0.25"])
    found = task(str(path), asked).wanted.surface
    assert found is not None
    assert found.mesh is not None
    assert found.mesh.max_edge == 0.25
    path.write_text(json.dumps({"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}))
    assert task(str(path), asked).wanted.surface is None  # a mesh is as fine as it is


def test_values_may_begin_with_a_minus() -> None:
    words = [
        "--loop",
        "1=isometric",
        "--angle",
        "-13,-4,0=120",
        "--angle",
        "-.5,1,2=60",
        "--angle-unit",
        "deg",
        "--phase",
        "-1e-3",
        "-2",
    ]
    asked = task("sample:tower", make_parser().parse_args(["solve", "sample:tower", "-o", "x.obj", *words]))
    assert [entry.point for entry in asked.wanted.boundary.angles] == [(-13, -4, 0), (-0.5, 1, 2)]
    assert asked.wanted.boundary.mode == "angles"
    assert [(entry.loop, entry.mode) for entry in asked.wanted.boundary.loops] == [(1, "isometric")]
    assert asked.wanted.pattern is not None
    assert asked.wanted.pattern.phase == (-1e-3, -2)


def test_rules_for_singularities() -> None:
    words = ["--singularities", "3", "--at", "17=-1", "--at", "-1,2,3=1", "--symmetric"]
    words += ["--keep-off", "-1,0,0;1,0,2.5;1,1,1=1.5", "--keep-off", "4,4,4=3", "--only", "0,0,1=2"]
    asked = task("sample:tower", make_parser().parse_args(["solve", "sample:tower", "-o", "x.obj", *words]))
    found = asked.wanted.singularities
    assert found is not None
    assert (found.count, found.symmetric) == (3, True)
    assert [(one.vertex, one.point, one.index) for one in found.at] == [(17, None, -1), (None, (-1, 2, 3), 1)]
    lines = [(one.line, one.distance) for one in found.keep_off]
    assert lines == [(((-1, 0, 0), (1, 0, 2.5), (1, 1, 1)), 1.5), (((4, 4, 4),), 3)]
    assert [(one.point, one.radius) for one in found.only] == [((0, 0, 1), 2)]


def test_an_output_that_is_a_folder_is_refused_before_the_work(
    tube: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "x.obj").mkdir()
    status, told = refusal(["solve", str(tube), "-o", str(tmp_path / "x.obj")], capsys)
    assert status == 2
    assert "this is a folder" in told


def test_a_size_asked_for_takes_the_place_of_the_requests(tmp_path: Path) -> None:
    given = samples.load("facade")
    assert given["pattern"]["edge_length"] is not None
    path = tmp_path / "facade.json"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(given).encode())  # as some editors save it
    asked = make_parser().parse_args(["solve", str(path), "-o", "x.obj", "--around", "60"])
    wanted = task(str(path), asked).wanted.pattern
    assert wanted is not None
    assert (wanted.around, wanted.edge_length) == (60, None)


@pytest.mark.parametrize("port", ["0", "-1", "70000"])
def test_ports_that_there_are_not_are_status_2(port: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, told = refusal(["demo", "--port", port], capsys)
    assert status == 2
    assert "from 1 to 65535" in told


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("none.obj", "cannot be read"),
        ("sample:no", "unknown sample 'no'; choose one of"),
        (".", "cannot be read"),
    ],
)
def test_inputs_that_do_not_exist_are_status_2(
    given: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, told = refusal(["solve", given, "-o", str(tmp_path / "x.obj")], capsys)
    assert status == 2
    assert words in told


def test_unknown_options_are_status_2() -> None:
    with pytest.raises(SystemExit) as ended:
        main(["solve", "sample:tower", "-o", "x.obj", "--boundary", "round"])
    assert ended.value.code == 2


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        (
            "fins.json",
            json.dumps({"vertices": FINS, "faces": [[0, 1, 2], [0, 1, 3], [0, 1, 4]]}),
            "two faces",
        ),
        ("broken.json", '{"surface": ', "not JSON"),
        ("field.json", '{"surface": {"vertices": [], "faces": []}, "patern": {}}', "/patern"),
        ("surface.xyz", "0 0 0", ".xyz"),
        ("noise.ply", "ply?", "not a PLY file"),
    ],
)
def test_what_cannot_be_solved_is_status_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, text: str, words: str
) -> None:
    (tmp_path / name).write_text(text)
    status, told = refusal(["solve", str(tmp_path / name), "-o", str(tmp_path / "x.obj")], capsys)
    assert status == 1
    assert words in told


def test_a_file_of_a_stage_that_was_left_out_is_status_1(
    tube: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["solve", str(tube), "-q", "-o", str(tmp_path / "x.obj"), "--panels", "none"]
    status, told = refusal(arguments, capsys)
    assert status == 1
    assert '"panels": null' in told


@pytest.mark.parametrize(
    ("option", "words"), [("--panels", '"panels": null'), ("--pattern", '"pattern": null')]
)
def test_a_file_that_cannot_come_of_the_request_is_refused_before_the_work(
    tube: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    option: str,
    words: str,
) -> None:
    monkeypatch.setattr(
        "hexwrap_server.cli.main.solve_with_progress", lambda *_: pytest.fail("solved all the same")
    )
    arguments = ["solve", str(tube), "-q", "-o", str(tmp_path / "x.json"), "-o", str(tmp_path / "x.png")]
    status, told = refusal([*arguments, option, "none"], capsys)
    assert status == 1
    assert f"panels.png shows panels, but the request has {words}" in told


def test_faults_of_options_name_the_option(
    tube: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["solve", str(tube), "-o", str(tmp_path / "x.json"), "--sizes", "0", "--around", "0"]
    status, told = refusal(arguments, capsys)
    assert status == 2
    assert "--sizes: " in told
    assert "--around: " in told
    assert "/panels" not in told
    arguments = ["solve", str(tube), "-o", str(tmp_path / "x.json"), "--edge-range", "1", "nan"]
    assert "--edge-range: " in refusal(arguments, capsys)[1]  # the fault is in one of its numbers


def test_repairs_are_told(tube: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = tube.read_text().splitlines()
    turned = lines[-1].split()
    lines[-1] = " ".join([turned[0], *turned[:0:-1]])
    tube.write_text("\n".join(lines))
    assert main(["solve", str(tube), "--around", "12", "-o", str(tmp_path / "x.obj")]) == 0
    told = capsys.readouterr().out
    assert "• 1 face was turned over" in told
    assert re.search(r"at most \S+ at R\d+-P\d+\)", told)  # where the widest joint is


def test_explore_writes_the_front(tube: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outs = [tmp_path / f"front.{ending}" for ending in ("csv", "png", "json")]
    wanted = [
        "--variants",
        "4",
        "--around",
        "10",
        "12",
        "--singularities",
        "0",
        "--sizes",
        "2",
        "3",
        "--per-type",
        "9",
    ]
    assert main(["explore", str(tube), *wanted, *(f"-o{out}" for out in outs)]) == 0
    rows = outs[0].read_text().splitlines()
    result = json.loads(outs[2].read_text())
    assert len(rows) == 1 + len(result["variants"]) > 2
    assert outs[1].read_bytes().startswith(b"\x89PNG")
    told = capsys.readouterr().out
    assert "proposed" in told
    assert all(note in told for note in result["notes"])


@pytest.mark.parametrize(
    ("options", "words"),
    [(["-o", "x.obj"], ".csv, .json, .png"), (["-o", "x.csv", "--variants", "0"], "variants")],
)
def test_explore_refuses(
    tube: Path, capsys: pytest.CaptureFixture[str], options: list[str], words: str
) -> None:
    assert main(["explore", str(tube), *options]) in (1, 2)
    assert words in capsys.readouterr().err
