"""Files of panels that are bent along folds: each one object, unfolded where it is laid flat."""

from __future__ import annotations

import csv
import io
import json

import ezdxf
import numpy as np
import pytest
import rhino3dm

from hexwrap_server.output.writers import Meta, write
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.pipeline import Solution, SolveSettings, solve
from tests.solver.pattern.folded import prism

META = Meta(name="box", unit="m")


@pytest.fixture(scope="module")
def box() -> Solution:
    settings = SolveSettings(
        BoundaryCondition("straight"), PatternSettings(around=20), PanelSettings(fold="folded", sizes=2)
    )
    return solve(lambda: prism(edge=4.0, twist=0.2), settings)


def test_flat_dxf_has_blanks_with_their_bend_lines(box: Solution) -> None:
    """Each line joins two corners of the outline around it, which has the size of the panel in space."""
    space = ezdxf.read(io.StringIO(write("flat.dxf", box, META).decode())).modelspace()
    lines = [np.array(e.get_points("xy")) for e in space.query('LWPOLYLINE[layer=="bend"]')]
    cut = [np.array(e.get_points("xy")) for e in space.query('LWPOLYLINE[layer ? "cut.*"]')]
    hinge = box.panels.bends
    assert len(lines) == len(hinge.panel) > 20
    assert len(cut) == box.panels.n_panels
    corners = np.concatenate(cut)
    for line, row, end in zip(lines, hinge.panel, hinge.hinge, strict=True):
        for point in line:
            assert np.linalg.norm(corners - point, axis=1).min() < 1e-9
        points = box.panels.polygons[row]
        assert np.linalg.norm(line[1] - line[0]) == pytest.approx(
            np.linalg.norm(points[0] - points[end]), rel=1e-9
        )


def test_json_table_and_models_have_one_object_for_each(box: Solution) -> None:
    panels = json.loads(write("result.json", box, META))["panels"]
    bent = [k for k, bend in enumerate(panels["bend"]) if bend]
    assert len(bent) == len(box.panels.bends.panel)
    for k in bent:
        assert panels["bend"][k][0] == 0
        assert panels["other_face"][k] >= 0
        assert panels["bend_angle"][k] == pytest.approx(np.pi / 2, abs=0.1)
    rows = list(csv.DictReader(io.StringIO(write("panels.csv", box, META).decode())))
    assert len(rows) == box.panels.n_panels
    assert [k for k, row in enumerate(rows) if row["bend_angle"]] == bent
    assert all(len(row["neighbours"].split()) == int(row["corners"]) for row in rows)
    model = rhino3dm.File3dm.FromByteArray(write("panels.3dm", box, META))
    kinds = [type(o.Geometry).__name__ for o in model.Objects]
    assert kinds.count("PolylineCurve") == box.panels.n_panels
    assert kinds.count("LineCurve") == len(bent)


def test_building_models_show_both_halves(box: Solution) -> None:
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.load(io.BytesIO(write("panels.glb", box, META)), file_type="glb")
    area = sum(
        scene.geometry[name].area * np.linalg.det(transform[:3, :3]) ** (2 / 3)
        for transform, name in (scene.graph[node] for node in scene.graph.nodes_geometry)
    )
    assert area == pytest.approx(box.quality.coverage * 6000, rel=0.1)
    ifc = write("panels.ifc", box, META).decode()
    assert ifc.count("=IFCPLATE(") == box.panels.n_panels
    assert ifc.count("=IFCINDEXEDPOLYGONALFACE(") > ifc.count("=IFCPLATETYPE(")
    faces = [line for line in write("panels.obj", box, META).decode().splitlines() if line.startswith("f ")]
    assert len(faces) == box.panels.n_panels + len(box.panels.bends.panel)
