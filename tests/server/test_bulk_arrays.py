"""Arrays of a body: every validator is fed what it rejects, and names the place."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import orjson
import pytest

from hexwrap_server.errors import FormError, NotJsonError
from hexwrap_server.input.json_text import loads
from hexwrap_server.input.schemas import parse_points, parse_request
from hexwrap_server.problems import problem
from hexwrap_solver.conformal.types import BoundaryCondition
from tests.server.bodies import request, tube

VERTICES = [[0.0, 0.0, 0.0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
FACES = [[0, 1, 2], [1, 3, 2]]
ANGLE = "/boundary/angles/0/"
NET = [[[0, 0, 0]]]


def refused(body: object, **limits: int) -> dict[str, str]:
    with pytest.raises(FormError) as caught:
        parse_request(body, limits.get("max_vertices", 1000), 1000)
    return dict(caught.value.faults)


@pytest.mark.parametrize(
    ("surface", "pointer"),
    [
        (7, "/surface"),
        ({}, "/surface/vertices"),
        ({"vertices": VERTICES}, "/surface/faces"),
        ({"vertices": VERTICES, "faces": FACES, "colour": 1}, "/surface/colour"),
        ({"vertices": 3, "faces": FACES}, "/surface/vertices"),
        ({"vertices": [[0, 0, 0], 4], "faces": FACES}, "/surface/vertices/1"),
        ({"vertices": [[0, 0, 0], [1, 2]], "faces": FACES}, "/surface/vertices/1"),
        ({"vertices": [[0, 0, 0], [1, 2, None]], "faces": FACES}, "/surface/vertices/1/2"),
        ({"vertices": [[0, 0, 0], [1, True, 2]], "faces": FACES}, "/surface/vertices/1/1"),
        ({"vertices": [[0, 0, 0], [1, "2", 2]], "faces": FACES}, "/surface/vertices/1/1"),
        ({"vertices": [[0, 0, 0], [1, [2], 2]], "faces": FACES}, "/surface/vertices/1/1"),
        ({"vertices": [[0, 0, float("inf")]], "faces": FACES}, "/surface/vertices/0/2"),
        ({"vertices": VERTICES, "faces": [[0, 1, 2], [0, 1]]}, "/surface/faces/1"),
        ({"vertices": VERTICES, "faces": [[0, 1, 2, 3, 0]]}, "/surface/faces/0"),
        ({"vertices": VERTICES, "faces": [[0, 1, 4]]}, "/surface/faces/0/2"),
        ({"vertices": VERTICES, "faces": [[0, 1, 2], [0, -1, 2]]}, "/surface/faces/1/1"),
        ({"vertices": VERTICES, "faces": [[0, 1.5, 2]]}, "/surface/faces/0/1"),
        ({"vertices": VERTICES, "faces": [[0, False, 2]]}, "/surface/faces/0/1"),
        ({"vertices": VERTICES, "faces": [[0, 1, 2**64 - 1]]}, "/surface/faces/0/2"),
        ({"vertices": VERTICES, "faces": FACES, "normals": [[0, 0, 1]]}, "/surface/normals"),
        ({"id": 5}, "/surface/id"),
        ({"nurbs": 1}, "/surface/nurbs"),
        ({"nurbs": {"degree": [3, 3], "knots": [[0], [0]]}}, "/surface/nurbs/control_points"),
        ({"nurbs": {"degree": [3], "knots": [[0], [0]], "control_points": NET}}, "/surface/nurbs/degree"),
        (
            {"nurbs": {"degree": [3, 3], "knots": [[0], ["a"]], "control_points": [[[0, 0, 0]]]}},
            "/surface/nurbs/knots/1/0",
        ),
        (
            {"nurbs": {"degree": [3, 3], "knots": [[0], [1]], "control_points": [*NET, [[0, 0, 0, 1]]]}},
            "/surface/nurbs/control_points/1/0",
        ),
    ],
)  # fmt: skip
def test_faults_of_surfaces_are_pointed_at(surface: Any, pointer: str) -> None:
    assert pointer in refused({"surface": surface})


@pytest.mark.parametrize(
    ("changes", "pointer"),
    [
        ({"boundary": {"mode": "angles", "angles": [{"vertex": 999, "angle": 3}]}}, ANGLE + "vertex"),
        ({"name": 3}, "/name"),
        ({"surfaces": 3}, "/surfaces"),
        ({"boundary": {"mode": "curly"}}, "/boundary/mode"),
        ({"boundary": {"angles": [{"angle": 1}]}}, "/boundary/angles/0"),
        ({"boundary": {"angles": [{"vertex": 1, "point": [0, 0, 0], "angle": 1}]}}, "/boundary/angles/0"),
        ({"boundary": {"angles": [{"vertex": 1}]}}, "/boundary/angles/0/angle"),
        ({"boundary": {"angles": [{"vertex": True, "angle": 1}]}}, "/boundary/angles/0/vertex"),
        ({"boundary": {"angles": [{"vertex": 1, "angle": float("inf")}]}}, "/boundary/angles/0/angle"),
        ({"pattern": {"around": 12.5}}, "/pattern/around"),
        ({"pattern": {"around": "12"}}, "/pattern/around"),
        ({"pattern": {"around": 0}}, "/pattern/around"),
        ({"pattern": {"around": 12, "edge_length": 1.0}}, "/pattern"),
        ({"pattern": {"edge_length": -1.0}}, "/pattern/edge_length"),
        ({"pattern": {"rotation": "sideways"}}, "/pattern/rotation"),
        ({"pattern": {"rotation": True}}, "/pattern/rotation"),
        ({"pattern": {"phase": [0]}}, "/pattern/phase"),
        ({"pattern": {"a/b~c": 0}}, "/pattern/a~1b~0c"),
        ({"panels": {"sizes": 0}}, "/panels/sizes"),
        ({"panels": {"sizes": True}}, "/panels/sizes"),
        ({"panels": {"edge_range": [2, 1]}}, "/panels"),
        ({"panels": {"edge_range": [0, 0]}}, "/panels"),
        ({"panels": {"joint": -0.1}}, "/panels/joint"),
        ({"panels": {"weights": {"angle": -1}}}, "/panels/weights/angle"),
        ({"panels": {"components": {"inset": None}}}, "/panels/components/inset"),
    ],
)  # fmt: skip
def test_faults_of_settings_are_pointed_at(changes: dict[str, Any], pointer: str) -> None:
    assert pointer in refused(request(**changes))


def test_pointers_lead_to_the_fault() -> None:
    """Whatever is refused, its pointer resolves in the body, or names the member that is missing."""
    body = request(pattern={"around": "x", "phase": ["a", 0]}, panels={"weights": {"edge": "heavy"}})
    for pointer in refused(body):
        at: Any = body
        for step in pointer.split("/")[1:]:
            at = at[int(step) if isinstance(at, list) else step]
        assert at in ("x", "a", "heavy")


@pytest.mark.parametrize("body", [None, [], 3, "text", {"name": "x"}])
def test_bodies_without_a_surface_are_refused(body: object) -> None:
    assert refused(body)


def test_too_many_vertices_are_refused() -> None:
    assert "/surface/vertices" in refused(request(), max_vertices=100)


def test_defaults_are_those_of_the_contract() -> None:
    wanted = parse_request({"surface": tube()}, 1000, 500).wanted
    assert wanted.pattern is not None
    assert wanted.panels is not None
    assert (wanted.boundary.mode, wanted.boundary.quantum) == ("auto", "auto")
    assert (wanted.pattern.cell_kind, wanted.pattern.around, wanted.pattern.align) == ("hex", None, "both")
    assert (wanted.panels.mode, wanted.panels.sizes, wanted.panels.target) == ("split", 11, "inscribed")
    assert wanted.pattern.max_cells == 500


@pytest.mark.parametrize(("unit", "angle"), [("rad", np.pi / 3), ("deg", 60.0), ("pi", 1 / 3)])
def test_angles_are_understood_in_every_unit(unit: str, angle: float) -> None:
    boundary = {"mode": "angles", "angle_unit": unit, "angles": [{"vertex": 5, "angle": angle}]}
    read = parse_request(request(boundary=boundary), 1000, 1000).wanted.boundary
    assert [entry.angle for entry in read.angles] == pytest.approx([np.pi / 3])


def test_quantum_auto_is_that_of_the_pattern() -> None:
    def quantum(kind: str | None, name: str) -> str:
        return BoundaryCondition(quantum=name).adapted(kind).quantum  # type: ignore[arg-type]

    assert quantum("quad", "auto") == quantum("hex", "quad") == "quad"
    assert quantum("hex", "auto") == quantum("triangle", "auto") == quantum("quad", "triangle") == "hex"
    assert quantum(None, "auto") == quantum("hex", "none") == "none"


def test_whole_floats_are_whole_numbers() -> None:
    wanted = parse_request(request(pattern={"around": 48.0}), 1000, 1000).wanted
    assert wanted.pattern is not None
    assert wanted.pattern.around == 48


def test_mixed_triangles_and_quads_keep_their_order() -> None:
    surface = parse_request(
        {"surface": {"vertices": VERTICES, "faces": [[0, 1, 2], [0, 1, 3, 2]]}}, 9, 9
    ).surface
    assert not isinstance(surface, str)
    assert surface.mesh is not None
    assert surface.mesh.faces.to_lists() == [[0, 1, 2], [0, 1, 3, 2]]


def test_numbers_too_large_for_a_float_are_refused() -> None:
    text = json.dumps({"points": [[0, 1e308]]}).replace("1e+308", "1e999")
    with pytest.raises((FormError, orjson.JSONDecodeError)):
        parse_points(orjson.loads(text), 2, 10)


@pytest.mark.parametrize("number", ["1e999", "-1e400", "NaN", "-Infinity", "1" + 400 * "0"])
def test_numbers_that_no_float_is_are_named_by_vertex(number: str) -> None:
    sent = {"name": "[NaN", "surface": {"vertices": [[1, 0.125, 2], [1, 0.5, 3]], "faces": FACES}}
    text = json.dumps(sent).replace("0.5", number)
    with pytest.raises(FormError) as caught:
        loads(text.encode())
    assert caught.value.faults[0][0] == "/surface/vertices/1/1"
    told = problem(caught.value)
    assert (told["type"], told["status"], told["vertices"]) == ("/problems/not-finite", 422, [1])


@pytest.mark.parametrize("text", [b"[1e999", b'{"surface": NaN}', b"[" * 100_000, b"[[1, 2], x]", b"\xff["])
def test_other_broken_texts_are_no_json(text: bytes) -> None:
    with pytest.raises(NotJsonError):
        loads(text)


def test_a_setting_that_no_float_is_is_no_json_either_but_named() -> None:
    with pytest.raises(NotJsonError) as caught:
        loads(b'{"name": "x", "limits": {"sizes": 2, "max_gap": NaN}}')
    assert [fault["pointer"] for fault in problem(caught.value)["errors"]] == ["/limits/max_gap"]


def test_a_byte_order_mark_is_passed_over() -> None:
    assert loads(b'\xef\xbb\xbf{"points": []}') == {"points": []}


def test_too_many_points_are_refused() -> None:
    with pytest.raises(FormError, match="at most 1"):
        parse_points({"points": [[0, 1], [1, 2]]}, 2, 1)


@pytest.mark.parametrize(
    ("surface", "slug", "elements"),
    [
        ({"vertices": VERTICES, "faces": [[0, 1, 2], [0, 1, 9]]}, "index-out-of-range", (None, [1])),
        ({"vertices": VERTICES, "faces": [[0, 1]]}, "polygon-size", (None, [0])),
        ({"vertices": [[0, 0, float("inf")]], "faces": FACES}, "not-finite", ([0], None)),
        ({"vertices": 1, "faces": FACES}, "invalid-request", (None, None)),
    ],
)
def test_faults_that_the_solver_knows_have_its_slug(
    surface: Any, slug: str, elements: tuple[list[int] | None, list[int] | None]
) -> None:
    with pytest.raises(FormError) as caught:
        parse_request({"surface": surface}, 1000, 1000)
    assert caught.value.slug == slug
    named = problem(caught.value)
    assert (named.get("vertices"), named.get("faces")) == elements
