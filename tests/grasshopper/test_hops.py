"""Rhino's component Hops against the service: requests as Hops sends them, answers as it reads them."""

import json
from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest
import rhino3dm

from hexwrap_server.errors import HopsError
from hexwrap_server.http.hops.components import COMPONENTS, LIFT, PANELS
from hexwrap_server.http.hops.values import read_inputs
from tests.server.live import Live, running

Tree = dict[str, list[dict[str, str]]]


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with running(tmp_path_factory.mktemp("hops"), workers=1) as live:
        yield live


def tube(around: int = 24, high: int = 10) -> rhino3dm.Mesh:
    """Quads with an unwelded seam, as Rhino meshes a surface of revolution."""
    mesh = rhino3dm.Mesh()
    mesh.Vertices.UseDoublePrecisionVertices = True
    for z in np.linspace(0.0, 6.0, high + 1):
        radius = 2.0 + 0.7 * np.cos(2 * np.pi * z / 6.0)
        for k in range(around + 1):
            angle = 2 * np.pi * (k % around) / around
            mesh.Vertices.AddPoint3d(radius * np.cos(angle), radius * np.sin(angle), float(z))
    for row in range(high):
        for k in range(around):
            a = row * (around + 1) + k
            mesh.Faces.AddFace(a, a + 1, a + around + 2, a + around + 1)
    return mesh


def geometry(thing: Any, kind: str) -> dict[str, str]:
    return {"type": f"Rhino.Geometry.{kind}", "data": json.dumps(thing.Encode())}


def item(value: object, kind: str) -> dict[str, str]:
    return {"type": f"System.{kind}", "data": json.dumps(value)}


def value(name: str, tree: Tree) -> dict[str, Any]:
    return {"ParamName": name, "InnerTree": tree}


LINE = rhino3dm.LineCurve(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(1, 0, 0))
DOT = rhino3dm.TextDot("a", rhino3dm.Point3d(0, 0, 0))
#: An item that is null in Grasshopper.
NULL = {"type": "System.String", "data": "null"}


def solve(client: httpx.Client, pointer: str, *values: dict[str, Any]) -> httpx.Response:
    return client.post("/solve", json={"pointer": pointer, "values": list(values)})


def mesh_at(path: str = "{0}") -> dict[str, Any]:
    return value("Mesh", {path: [geometry(tube(), "Mesh")]})


def outputs(answer: httpx.Response) -> dict[str, Tree]:
    assert answer.status_code == 200, answer.text
    document = answer.json()
    assert document["errors"] == []
    return {v["ParamName"]: v["InnerTree"] for v in document["values"]}


def refused(answer: httpx.Response) -> str:
    """Hops keeps answers with status 200, so an error must not have it."""
    assert answer.status_code == 500
    document = answer.json()
    assert document["values"] == []
    assert len(document["errors"]) == 1
    return str(document["errors"][0])


def points(entry: dict[str, str]) -> np.ndarray[Any, np.dtype[np.float64]]:
    assert entry["type"] == "Rhino.Geometry.PolylineCurve"
    curve: Any = rhino3dm.CommonObject.Decode(json.loads(entry["data"]))
    assert isinstance(curve, rhino3dm.PolylineCurve)
    return np.array([[p.X, p.Y, p.Z] for p in (curve.Point(i) for i in range(curve.PointCount))])


@pytest.mark.parametrize("path", [PANELS, LIFT])
def test_components_describe_themselves(client: Live, path: str) -> None:
    document = client.get(path).json()
    assert document == COMPONENTS[path].document()
    for side in ("Inputs", "Outputs"):
        for parameter in document[side]:
            assert parameter.keys() >= {"Name", "Nickname", "Description", "ParamType", "AtLeast", "AtMost"}
    mesh = document["Inputs"][0]
    assert (mesh["AtLeast"], mesh["AtMost"]) == (1, 1)


def test_a_mesh_alone_gives_panels(client: Live) -> None:
    found = outputs(solve(client, PANELS, mesh_at()))
    assert list(found) == [p.name for p in COMPONENTS[PANELS].outputs]
    assert all(path.startswith("{0;") for path in found["Panels"])
    for name in ("Labels", "Size", "Planes", "Flat"):
        assert {k: len(v) for k, v in found[name].items()} == {k: len(v) for k, v in found["Panels"].items()}
    for path, row in found["Panels"].items():
        ring = int(path.strip("{}").split(";")[-1])
        labels = [json.loads(entry["data"]) for entry in found["Labels"][path]]
        assert labels == sorted(labels)
        assert all(label.startswith(f"R{ring:02d}-") for label in labels)
        for panel, plane in zip(row, found["Planes"][path], strict=True):
            outline = points(panel)
            assert np.array_equal(outline[0], outline[-1])
            edges = np.linalg.norm(np.diff(outline, axis=0), axis=1)
            assert np.ptp(edges) < 1e-9 * edges.mean()
            frame = {name: [axis[c] for c in "XYZ"] for name, axis in json.loads(plane["data"]).items()}
            axes = np.array([frame["XAxis"], frame["YAxis"], frame["ZAxis"]])
            assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-9)
            assert np.allclose((outline - frame["Origin"]) @ axes[2], 0.0, atol=1e-9)
            assert np.dot(frame["ZAxis"][:2], frame["Origin"][:2]) > 0
    assert "overlaps: 0" in json.loads(found["Report"]["{0}"][0]["data"])


def test_strays_are_left_out_and_told_as_those_of_a_file_are(client: Live) -> None:
    mesh = tube()
    far = [mesh.Vertices.Add(50 + x, 50 + y, 0) for x, y in ((0, 0), (0.1, 0), (0, 0.1))]
    mesh.Faces.AddFace(*far)
    sent = value("Mesh", {"{0}": [geometry(mesh, "Mesh")]})
    body = {"pointer": PANELS, "values": [sent], "absolutetolerance": 0.01, "modelunits": "Millimeters"}
    report = json.loads(outputs(client.post("/solve", json=body))["Report"]["{0}"][0]["data"])
    assert "note: 1 stray piece of 1 face in all left out, at (50.05, 50.05, 0)." in report


def test_branches_keep_their_path(client: Live) -> None:
    found = outputs(solve(client, PANELS, mesh_at("{0;3}"), value("Around", {"{0}": [item(16, "Int32")]})))
    assert all(path.startswith("{0;3;") for path in found["Panels"])
    assert list(found["Report"]) == ["{0;3}"]


def test_empty_branches_mean_the_default(client: Live) -> None:
    empty = [value(name, {"{0}": []}) for name in ("Around", "Kind", "Points")] + [value("Sizes", {})]
    with_empty, without = (outputs(solve(client, PANELS, mesh_at(), *extra)) for extra in (empty, []))
    assert with_empty.pop("Job") != without.pop("Job")
    assert with_empty == without


def test_settings_reach_the_solver(client: Live) -> None:
    settings = [
        value("Kind", {"{0}": [item("triangle", "String")]}),
        value("Sizes", {"{0;0}": [item(3.0, "Double")]}),
        value("Target", {"0": [item("shortest", "String")]}),
    ]
    found = outputs(solve(client, PANELS, mesh_at(), *settings))
    assert {len(points(entry)) for row in found["Panels"].values() for entry in row} == {4}


def test_corners_become_corners_of_the_domain(client: Live) -> None:
    places = [json.dumps({"X": x, "Y": 0.0, "Z": 0.0}) for x in (2.7, -2.7)]
    corners = value("Points", {"{0}": [{"type": "Rhino.Geometry.Point3d", "data": at} for at in places]})
    angles = [item(a, "Double") for a in (240.0, 120.0)]
    found = outputs(solve(client, PANELS, mesh_at(), corners, value("Angles", {"{0}": angles})))
    assert found["Panels"]
    problem = refused(solve(client, PANELS, mesh_at(), corners, value("Angles", {"{0}": angles[:1]})))
    assert "°" in problem or "rad" in problem or "degree" in problem


def test_drawings_are_lifted(client: Live) -> None:
    made = outputs(solve(client, PANELS, mesh_at()))
    middle = list(made["Flat"])[len(made["Flat"]) // 2]
    cell = made["Flat"][middle][0]
    job = made["Job"]["{0}"][0]
    far = rhino3dm.PolylineCurve(
        rhino3dm.Point3dList([rhino3dm.Point3d(0, 1e3, 0), rhino3dm.Point3d(1, 1e3, 0)])
    )
    drawn = value("Curves", {"{0}": [cell, geometry(far, "PolylineCurve")]})
    lifted = outputs(solve(client, LIFT, value("Job", {"{0}": [job]}), drawn))
    (piece,) = lifted["Lifted"]["{0;0}"]
    on_surface = points(piece)
    assert np.allclose(on_surface[0], on_surface[-1])
    panel = points(made["Panels"][middle][0])
    size = np.linalg.norm(panel[1] - panel[0])
    assert np.linalg.norm(on_surface.mean(axis=0) - panel[:-1].mean(axis=0)) < 0.2 * size
    assert lifted["Lifted"]["{0;1}"] == []
    assert json.loads(lifted["Outside"]["{0}"][0]["data"]) > 0


@pytest.mark.parametrize(
    ("pointer", "values", "word"),
    [
        ("/hops/unheard", [], "/hops/panels"),
        (PANELS, [], "Mesh is empty"),
        (PANELS, [value("Mesh", {"{0}": []})], "Mesh is empty"),
        (PANELS, [value("Mesh", {"{0}": [item("tower", "String")]})], "cannot be read as a mesh"),
        (PANELS, [value("Mesh", {"{0}": [geometry(tube(), "Mesh")] * 2})], "graft"),
        (PANELS, [mesh_at("{north}")], "is not a path"),
        (PANELS, [mesh_at(), value("Colour", {"{0}": [item("red", "String")]})], "Colour"),
        (PANELS, [mesh_at(), value("Kind", {"{0}": [item("pentagon", "String")]})], "kind"),
        (PANELS, [mesh_at(), value("Around", {"{0}": [item("many", "String")]})], "integer"),
        (PANELS, [mesh_at(), value("Around", {"{0}": [{"type": "System.Int32", "data": 12}]})], "JSON"),
        (PANELS, [{"InnerTree": {}}], "ParamName"),
        (PANELS, [value("Mesh", {"{0}": "x"})], "list"),  # type: ignore[dict-item]
        (LIFT, [value("Job", {"{0}": [item("unheard", "String")]})], "Curves is empty"),
        (PANELS, [value("Mesh", {"{0}": [geometry(LINE, "LineCurve")]})], "a LineCurve came, but a mesh or"),
        (PANELS, [value("Mesh", {"{0}": [geometry(DOT, "TextDot")]})], "a TextDot came, but a mesh or"),
        (
            LIFT,
            [
                value("Job", {"{0}": [item("unheard", "String")]}),
                value("Curves", {"{0}": [geometry(tube(), "Mesh")]}),
            ],
            "a Mesh came, but a curve",
        ),
        (PANELS, [value("Mesh", {"{0}": [NULL]})], "Mesh is empty"),
    ],
)
def test_wrong_calls_are_refused(client: Live, pointer: str, values: list[dict[str, Any]], word: str) -> None:
    assert word in refused(solve(client, pointer, *values))


def test_wrong_bodies_are_refused(client: Live) -> None:
    for body in (b"", b"[]", b'{"pointer": 3}', b'{"pointer": "/hops/panels", "values": 3}'):
        assert refused(client.post("/solve", content=body))


def test_unknown_jobs_are_refused(client: Live) -> None:
    line = rhino3dm.LineCurve(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(1, 0, 0))
    drawn = value("Curves", {"{0}": [geometry(line, "LineCurve")]})
    values = [value("Job", {"{0}": [item("unheard", "String")]}), drawn]
    assert "unheard" in refused(solve(client, LIFT, *values))


def test_surfaces_that_cannot_be_mapped_are_refused(client: Live) -> None:
    torus = rhino3dm.Mesh()
    for k, j in np.ndindex(12, 8):
        a, b = 2 * np.pi * k / 12, 2 * np.pi * j / 8
        radius = 3 + np.cos(b)
        torus.Vertices.AddPoint3d(radius * np.cos(a), radius * np.sin(a), np.sin(b))
        i, after, above = 8 * k + j, 8 * ((k + 1) % 12) + j, (j + 1) % 8 - j
        torus.Faces.AddFace(i, after, after + above, i + above)
    assert "handle" in refused(solve(client, PANELS, value("Mesh", {"{0}": [geometry(torus, "Mesh")]})))


def test_inputs_that_were_left_out_have_their_defaults() -> None:
    values, branch = read_inputs(COMPONENTS[PANELS].inputs[1:], [])
    expected = {"Mode": None, "Points": [], "Angles": [], "Kind": "hex"}
    assert values == expected | {"Around": 0, "Sizes": 11, "Target": "inscribed", "Unit": None}
    assert branch == [0]
    with pytest.raises(HopsError, match="list of parameters"):
        read_inputs(COMPONENTS[PANELS].inputs, "values")


@pytest.mark.parametrize("null", [NULL, None, {"type": "System.String", "data": None}])
def test_nulls_have_their_defaults(null: Any) -> None:
    given = [value(name, {"{0}": [null]}) for name in ("Mode", "Kind", "Around", "Points", "Target")]
    assert read_inputs(COMPONENTS[PANELS].inputs[1:], given) == read_inputs(COMPONENTS[PANELS].inputs[1:], [])
