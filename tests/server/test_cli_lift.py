"""Own drawings: read from every format, carried onto the surface and back, in one piece around it."""

from __future__ import annotations

import json
from pathlib import Path

import ezdxf
import numpy as np
import pytest

from hexwrap_server.cli.main import main
from hexwrap_server.errors import DrawingError
from hexwrap_server.input.curves import READERS, read_drawing, refined, write_curves
from hexwrap_server.input.finished_map import map_in_result
from hexwrap_server.input.readers.drawing import Curve
from hexwrap_server.jobs.lift_curves import flatten_curves, lift_curves, one_piece
from hexwrap_server.output.writers import Meta, write
from hexwrap_solver.conformal.types import Deck
from tests.server.analytic import cylinder

CURVES = [
    Curve(np.array([[1.0, 2.0, 0.5], [3.0, 4.0, 0.25], [5.0, 2.0, 0.125]])),
    Curve(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 1.0]]), closed=True),
    Curve(np.array([[7.0, 8.0, 9.0]])),
]


@pytest.mark.parametrize("kind", READERS)
def test_what_is_written_is_read(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"drawing{kind}"
    path.write_bytes(write_curves(kind, CURVES))
    read = sorted(read_drawing(path).curves, key=lambda curve: float(curve.points[0, 0]))
    for curve, expected in zip(read, (CURVES[1], CURVES[0], CURVES[2]), strict=True):
        points = expected.points
        if kind in (".csv", ".txt") and expected.closed:
            points = np.vstack([points, points[:1]])  # a table knows no closed curves
        else:
            assert curve.closed == expected.closed
        assert curve.points == pytest.approx(points, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.csv", "x,y\n1,2\n3,four"),
        ("b.csv", ""),
        ("c.csv", "1,2\n3,4,5"),
        ("d.json", '{"points": [[1]]}'),
        ("e.json", "{"),
        ("f.dxf", "no drawing"),
        ("g.3dm", "no drawing"),
        ("h.svg", "<svg/>"),
        ("i.csv", "1,nan"),
    ],
)
def test_drawings_that_cannot_be_read_are_told(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(DrawingError):
        read_drawing(tmp_path / name)


def test_arcs_and_splines_of_a_drawing_become_polylines(tmp_path: Path) -> None:
    document = ezdxf.new("R2010")
    space = document.modelspace()
    space.add_circle((1, 2), 3)
    space.add_line((0, 0), (1, 1))
    space.add_lwpolyline([(0, 0), (2, 0), (2, 2)], close=True)
    document.saveas(tmp_path / "arcs.dxf")
    curves = {len(c.points): c for c in read_drawing(tmp_path / "arcs.dxf").curves}
    assert not curves[2].closed
    assert curves[3].closed
    circle = curves[max(curves)]
    assert circle.closed
    assert np.hypot(*(circle.points[:, :2] - [1, 2]).T) == pytest.approx(
        3 * np.ones(len(circle.points)), rel=5e-4
    )


def test_refined_curves_keep_their_corners_and_leave_no_long_step() -> None:
    fine = refined(CURVES[1], 0.3)
    steps = np.linalg.norm(fine.points - np.roll(fine.points, 1, axis=0), axis=1)
    assert steps.max() <= 0.3
    assert all(np.abs(fine.points - corner).sum(axis=1).min() < 1e-12 for corner in CURVES[1].points)


def test_a_drawing_goes_onto_the_surface_and_back() -> None:
    cmap = cylinder().map
    drawn = Curve(np.array([[2.0, 3.0], [5.0, 4.0], [9.0, 8.0]]))
    lifted = lift_curves(cmap, [drawn], 0.1)
    back = flatten_curves(cmap, lifted.curves, None)
    assert lifted.outside == 0
    assert back.farthest < 1e-9
    assert back.curves[0].points == pytest.approx(refined(drawn, 0.1).points, abs=1e-9)


def test_a_turn_around_the_surface_is_one_line_of_the_circumference() -> None:
    cmap = cylinder(around=12).map
    t = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    radius = np.hypot(*cmap.surface.vertices[0, :2])
    ring = Curve(np.stack([radius * np.cos(t), radius * np.sin(t), 3 + 0 * t], axis=1), closed=True)
    flat = flatten_curves(cmap, [ring], None).curves[0]
    assert not flat.closed
    assert flat.points[-1] - flat.points[0] == pytest.approx([cmap.circumference, 0], abs=1e-9)
    assert np.all(np.diff(flat.points[:, 0]) > 0)


def test_what_leaves_the_domain_is_cut_there() -> None:
    cmap = cylinder().map
    through = Curve(np.array([[1.0, -1.0], [1.0, 100.0]]))
    carried = lift_curves(cmap, [through, Curve(np.array([[0.0, 200.0]]))], 0.05)
    assert len(carried.curves) == 1
    assert carried.outside > 1
    assert np.ptp(carried.curves[0].points[:, 2]) == pytest.approx(
        np.ptp(cmap.surface.vertices[:, 2]), abs=0.1
    )


def test_a_closed_curve_through_the_rim_stays_one_piece() -> None:
    cmap = cylinder().map
    box = Curve(np.array([[1.0, 1.0], [2.0, 1.0], [2.0, -1.0], [1.0, -1.0]]), closed=True)
    assert len(lift_curves(cmap, [box], 0.05).curves) == 1


@pytest.mark.parametrize("angle", [0.0, np.pi / 3, -2 * np.pi / 3, 2 * np.pi])
def test_one_piece_undoes_any_sheets(angle: float) -> None:
    deck = Deck(angle, 10 + 2j)
    path = 50 + np.cumsum(np.exp(1j * np.linspace(0, 3, 40)))
    sheets = np.random.default_rng(1).integers(-1, 2, 40)
    whole = one_piece(deck, deck.apply(path, sheets))
    assert whole == pytest.approx(deck.apply(path, np.full(40, sheets[0])), abs=1e-9)


@pytest.fixture
def tube(tmp_path: Path) -> Path:
    surface = cylinder().map.surface
    path = tmp_path / "tube.json"
    path.write_text(json.dumps({"vertices": surface.vertices.tolist(), "faces": surface.faces.tolist()}))
    return path


def test_the_command_there_and_back(tube: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drawn, there, back = tmp_path / "d.csv", tmp_path / "there.3dm", tmp_path / "back.json"
    result = tmp_path / "map.json"
    assert main(["solve", str(tube), "-q", "-o", str(result), "--pattern", "none"]) == 0
    middle = np.mean(json.loads(result.read_text(encoding="utf-8"))["map"]["uv"], axis=0)
    drawn.write_text("\n".join(f"{x},{y}" for x, y in (middle + np.array([[0, 0], [1, 0], [1, 1]])).tolist()))
    assert main(["lift", str(tube), str(drawn), "-o", str(there), "--step", "0.5"]) == 0
    assert main(["lift", str(tube), str(there), "-o", str(back), "--flatten"]) == 0
    assert "off the surface" in capsys.readouterr().out
    curve = json.loads(back.read_text())["curves"][0]
    assert curve["points"][0] == pytest.approx(middle.tolist(), abs=1e-6)
    assert len(curve["points"]) == 5


@pytest.mark.parametrize("name", ["result.json", "result.npz"])
def test_a_finished_result_lifts_as_its_map_does(name: str, tmp_path: Path) -> None:
    solution = cylinder()
    (tmp_path / name).write_bytes(write(name, solution, Meta()))
    found = map_in_result(tmp_path / name)
    assert found is not None
    drawn = [Curve(np.array([[2.0, 3.0], [17.0, 5.0], [25.0, 8.0]]))]
    ours, theirs = (lift_curves(cmap, drawn, 0.2).curves[0].points for cmap in (found, solution.map))
    assert ours == pytest.approx(theirs, abs=1e-12)
    assert np.array_equal(found.surface.loops[1], solution.map.surface.loops[1])


def test_a_result_without_its_mesh_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = json.loads(write("result.json", cylinder(), Meta()))
    (tmp_path / "part.json").write_text(json.dumps({"map": result["map"]}))
    (tmp_path / "d.csv").write_text("1,1")
    given = ["lift", str(tmp_path / "part.json"), str(tmp_path / "d.csv"), "-o", str(tmp_path / "x.csv")]
    assert main(given) == 2
    assert "the result is incomplete" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "status", "words"),
    [
        (["far.csv", "-o", "x.dxf"], 1, "no point of the drawing lies in the domain"),
        (["none.csv", "-o", "x.dxf"], 2, "no such file"),
        (["far.csv", "-o", "x.png"], 2, "the ending must be one of"),
        (["far.csv", "-o", "x.dxf", "--step", "0"], 2, "must be greater than 0"),
        (["far.csv", "-o", "x.dxf", "--flatten"], 2, "needs points in space"),
        (["tube.json", "-o", "x.dxf"], 1, "must hold 'points'"),
    ],
)
def test_refusals(
    tube: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
    status: int,
    words: str,
) -> None:
    monkeypatch.chdir(tube.parent)
    Path("far.csv").write_text("1e6,1e6\n")
    assert main(["lift", "tube.json", *options]) == status
    assert words in capsys.readouterr().err
