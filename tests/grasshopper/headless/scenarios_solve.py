"""Send and everything after it, against a live server."""

from __future__ import print_function

import json
import math
import os
import random
import time

import Grasshopper
import Rhino
import world
from canvas import FREEZE, Component, pump, settle
from Rhino.Geometry import Brep, Circle, CircleCurve, Point3d, PolylineCurve, Surface
from System import Array

PORT = int(os.environ["HEXWRAP_PORT"])
SMALL = json.dumps({"pattern": {"around": 16}})
LARGE = json.dumps({"pattern": {"around": 240}})  # keeps the server busy for seconds


def array(points):
    return PolylineCurve(Array[Point3d]([Point3d(*p) for p in points]))


def sender(**values):
    settings = dict(Mesh=world.tube(), Pattern=SMALL, Run=True, Port=PORT, Name="scenario")
    settings.update(values)
    return Component("Send").set(**settings)


def busy_sender(pattern=LARGE, **values):
    """A component Send with work that this server has never done before."""
    return sender(Mesh=world.tube(waist=0.6 + 0.1 * random.random()), Pattern=pattern, **values)


def done(**values):
    """A component Send whose job is finished."""
    send = settle(sender(**values), 2)
    assert send.Job and not send.messages, (send.Job, send.messages)
    return send


def collected(name, **values):
    return settle(Component(name).set(**values), 2)


def running(port=PORT):
    return [job for job in world.ask(port, "GET", "/v1/jobs")[1]["jobs"] if job["status"] == "running"]


def until_running(send):
    pump([send], lambda: any(job["stage"] for job in running()))


def mean(values):
    return sum(values) / len(values)


# --- the plain way ---------------------------------------------------------------------------------------


def send_and_collect():
    send = sender()
    assert send.Job is None and "Run" not in send.Message
    settle(send, 2)
    assert send.solved == 2 and send.Message == "done", "one re-trigger per finished job"
    assert send.Job.startswith("http://127.0.0.1:%d/v1/jobs/" % PORT)
    assert "done in" in send.Status and "repair" in send.Status  # the unwelded seam
    collect = collected("Collect", Job=send.Job)
    assert collect.solved == 2 and collect.Message == "collected" and not collect.messages
    check_panels(collect)
    # whatever else makes the canvas solve again: nothing is fetched or sent anew
    panels = collect.Panels
    assert collect.solve().Panels is panels and not collect.document.scheduled
    assert send.solve().Message == "done" and not send.document.scheduled


def check_panels(collect):
    panels = collect.Panels.flat()
    rings = sorted(collect.Panels.branches)
    assert len(panels) > 50 and len(rings) > 3
    for name in (
        "Labels",
        "Sizes",
        "Colours",
        "Planes",
        "Outlines",
        "Planarity",
        "Gaps",
        "Convex",
        "Neighbours",
    ):
        tree = getattr(collect, name)
        assert sorted(tree.branches) == rings, name
        assert [len(tree.branches[p]) for p in rings] == [len(collect.Panels.branches[p]) for p in rings], (
            name
        )
    labels = collect.Labels.flat()
    assert len(set(labels)) == len(labels)
    for path in rings:
        assert all(int(label[1:3]) == path[0] for label in collect.Labels.branches[path])
    for panel, flat, plane in zip(panels, collect.Outlines.flat(), collect.Planes.flat()):
        assert panel.IsClosed and len(panel.points) == 7
        edges = [a.DistanceTo(b) for a, b in zip(panel.points, panel.points[1:])]
        assert max(edges) - min(edges) < 1e-9 * max(edges), "panels are equilateral"
        flat_edges = [a.DistanceTo(b) for a, b in zip(flat.points, flat.points[1:])]
        assert max(abs(a - b) for a, b in zip(edges, flat_edges)) < 1e-9
        assert all(p.Z == 0.0 for p in flat.points) and flat.points[0].xyz() == [0.0, 0.0, 0.0]
        x, y = plane.XAxis.xyz(), plane.YAxis.xyz()
        assert abs(sum(a * b for a, b in zip(x, y))) < 1e-12
        first = [(b - a) / edges[0] for a, b in zip(panel.points[0].xyz(), panel.points[1].xyz())]
        assert max(abs(a - b) for a, b in zip(first, x)) < 1e-9, "x runs along the first edge"
        outward = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2]]
        assert outward[0] * plane.Origin.X + outward[1] * plane.Origin.Y > 0, "z points outward"
    assert set(collect.Index.flat()) == set([0])
    counts = [collect.Sizes.flat().count(size) for size in sorted(set(collect.Sizes.flat()))]
    assert [mesh.Faces.Count for mesh in collect.Shapes] == [6 * n for n in counts]
    assert len(collect.ShapeColours) == len(counts)
    assert max(collect.Planarity.flat()) < 1e-9 and all(collect.Convex.flat())
    assert min(collect.Sizes.flat()) == 0 and max(collect.Sizes.flat()) < 11
    for words in collect.Neighbours.flat():
        assert len(words.split()) == 6
        assert all(word == "-" or word in labels for word in words.split())
    assert "%d panels" % len(panels) in collect.Report and "overlaps: 0" in collect.Report
    gaps = collect.Gaps.flat()
    worst = gaps.index(max(gaps))
    assert any(
        line.startswith("gap, greatest") and labels[worst] in line for line in collect.Report.split("\n")
    )
    assert len(collect.Widest) == 1
    assert collect.Widest[0].points[0].DistanceTo(panels[worst].points[0]) < 1e-12


def surfaces_are_meshed_as_rhino_does():
    spy = world.Spy(PORT)
    for geometry in (Brep([world.tube(normals=True)]), Surface([world.tube(normals=True)])):
        assert "done" in settle(sender(Mesh=geometry, Port=spy.port), 2).Status
    sent = json.loads(spy.bodies("POST", "/v1/surfaces")[0].decode("utf-8"))
    assert len(sent["normals"]) == len(sent["vertices"])
    spy.close()
    refused = settle(sender(Mesh=_Point()), 2)
    assert "must be a mesh or a surface" in refused.said("error")[0]


class _Point(Rhino.Geometry.GeometryBase):
    def DataCRC(self, start):
        return 1

    def Duplicate(self):
        return self


def sliders_send_settings_only():
    spy = world.Spy(PORT)
    send = sender(Port=spy.port, Mesh=world.tube(waist=0.5))
    settle(send, 2)
    first = send.Job
    send.set(Panels=json.dumps({"panels": {"sizes": 3}, "support": False}))
    assert send.Job == first, "the last good job is held while a new one runs"
    settle(send, 4)
    assert send.Job != first and send.solved == 4
    send.set(Pattern=json.dumps({"pattern": {"around": 18}}))
    settle(send, 6)
    assert spy.count("POST", "/v1/surfaces") == 1, "the mesh was sent again"
    bodies = spy.bodies("POST", "/v1/jobs")
    assert len(bodies) == 3 and max(len(body) for body in bodies) < 400
    assert json.loads(bodies[1].decode("utf-8"))["panels"] == {"sizes": 3}
    collected("Collect", Job=send.Job)
    parts = [path.partition("include=")[2] for _, path, _ in spy.seen if "/result" in path]
    assert parts == ["panels,pattern,sizes,quality"]
    moved = world.tube(waist=0.45)
    send.set(Mesh=moved)
    settle(send, 8)
    assert spy.count("POST", "/v1/surfaces") == 2
    spy.close()


def modes_reach_the_server():
    spy = world.Spy(PORT)
    for mode, expected in (
        ("auto", {"mode": "auto"}),
        ("straight", {"mode": "straight"}),
        ("isometric", {"mode": "isometric"}),
        ("isometric optimal", {"mode": "isometric", "spread": "optimal"}),
    ):
        settle(sender(Port=spy.port, Mode=mode), 2)
        assert json.loads(spy.bodies("POST", "/v1/jobs")[-1].decode("utf-8"))["boundary"] == expected
    assert "unit" not in json.loads(spy.bodies("POST", "/v1/jobs")[-1].decode("utf-8"))["surface"]
    document()
    settle(sender(Port=spy.port), 2)
    Rhino.RhinoDoc.ActiveDoc = None
    assert json.loads(spy.bodies("POST", "/v1/jobs")[-1].decode("utf-8"))["surface"]["unit"] == "mm"
    spy.close()
    assert "no angles came" in sender(Mode="angles").said("error")[0]
    assert "straight, angles" in sender(Mode="bent").said("error")[0]
    assert "of that name" in sender(Angles="60").said("error")[0]
    assert "of that name" in sender(Pattern=json.dumps({"panels": {}})).said("error")[0]


def a_list_of_meshes_runs_side_by_side():
    send = Component("Send")
    jobs = []
    for number, waist in ((1, 0.3), (2, 0.6)):
        send.RunCount = number
        send.set(Mesh=world.tube(waist=waist), Pattern=SMALL, Run=True, Port=PORT)
    slots = [send.scope["scriptcontext"].sticky["hexwrap/%s/%d" % (send.InstanceGuid, n)] for n in (1, 2)]
    pump([send], lambda: all(slot["result"] for slot in slots))
    for number, waist in ((1, 0.3), (2, 0.6)):
        send.RunCount = number
        jobs.append(send.set(Mesh=world.tube(waist=waist)).Job)
    assert jobs[0] and jobs[1] and jobs[0] != jobs[1]
    assert not any(slot["busy"] for slot in slots)


# --- stopping --------------------------------------------------------------------------------------------


def newer_sliders_cancel_older_requests():
    send = busy_sender()
    until_running(send)
    old = running()[0]["id"]
    for kind in ("hex", "quad", "triangle"):
        send.set(Pattern=json.dumps({"pattern": {"around": 17, "kind": kind}}))
    solved = send.solved
    settle(send, solved + 1)
    pump([send], lambda: world.ask(PORT, "GET", "/v1/jobs/" + old)[1].get("status") in ("cancelled", 404))
    assert send.solved == solved + 1, "superseded requests must not make the canvas solve"
    collect = collected("Collect", Job=send.Job)
    assert set(len(panel.points) for panel in collect.Panels.flat()) == set([4]), "not the newest request"


def run_off_cancels_on_the_server():
    send = done()
    good = send.Job
    send.set(Pattern=LARGE)
    until_running(send)
    job = running()[0]["id"]
    send.set(Run=False)
    assert send.Message == "Run is off" and send.Job == good
    pump([send], lambda: not running())
    assert world.ask(PORT, "GET", "/v1/jobs/" + job)[1]["status"] in ("cancelled", 404)
    solved = send.solved
    linger(send)
    assert send.solved == solved


def linger(component, seconds=0.7):
    end = time.time() + seconds
    pump([component], lambda: time.time() > end)


def escape_cancels_on_the_server():
    for press in (hold_escape, tap_escape):
        send = busy_sender()
        until_running(send)
        press(send)
        pump([send], lambda: not running())
        assert send.Message == "cancelled"
        send.solve()  # something else on the canvas: the same request does not start again by itself
        linger(send)
        assert not running() and send.Message == "cancelled"
        assert "Toggle Run" in send.said("remark")[0]
        send.set(Run=False)
        send.set(Run=True, Pattern=SMALL)
        settle(send, send.solved + 1)
        assert send.Job and send.Message == "done"


def hold_escape(send):
    Grasshopper.GH_Document.escape_is_down = True
    pump([send], lambda: send.Message == "cancelled")
    Grasshopper.GH_Document.escape_is_down = False


def tap_escape(send):
    Rhino.RhinoApp.EscapeKeyPressed.fire()


def deleted_components_cancel_their_job():
    send = busy_sender()
    until_running(send)
    send.document = None
    pump([send], lambda: not running())
    assert send.solved == 1


def time_out():
    send = settle(busy_sender(TimeOut=0.5), 2)
    assert "TimeOut" in send.said("error")[0] and send.Job is None
    pump([send], lambda: not running())


def slow_jobs_show_progress_and_do_not_freeze_the_canvas():
    send = busy_sender()
    pump([send], lambda: "%" in send.Message)  # pump refuses whatever holds the canvas
    send.solve()
    assert send.solved == 2 and "%" in send.Message and send.Job is None
    assert send.longest < FREEZE
    send.set(Run=False)


# --- refusals --------------------------------------------------------------------------------------------


def wrong_meshes_come_with_their_faults():
    good = world.tube()
    ring = settle(sender(Mesh=world.torus()), 2)
    assert len(ring.said("error")) == 1 and "handle" in ring.said("error")[0], ring.messages
    assert ring.Job is None and ring.Message == "failed"
    fin, edge = world.with_fin(good)
    send = settle(sender(Mesh=fin), 2)
    assert len(send.said("error")) == 1
    ends = [sorted((line.From.xyz(), line.To.xyz())) for line in send.FaultEdges]
    assert sorted(list(p) for p in edge) in ends, (edge, ends, send.messages)
    settle(send.set(Mesh=good), 4)  # repaired: everything is well again
    assert send.Job and send.FaultEdges == [] and send.Faults == [] and not send.messages


def refusals_keep_the_last_good_result():
    send = done()
    good = send.Job
    settle(send.set(Pattern=json.dumps({"pattern": {"around": 1000000}})), 4)
    assert len(send.said("error")) == 1 and send.Job == good
    settle(send.set(Pattern=json.dumps({"pattern": {"sides": 7}})), 6)
    assert "sides" in send.said("error")[0]


def unbalanced_angles_are_refused_with_figures():
    corner = [[2.75, 0.0, 0.0]]
    angles = {"mode": "angles", "angle_unit": "deg", "angles": [{"point": p, "angle": 240.0} for p in corner]}
    send = settle(sender(Angles=json.dumps({"boundary": angles})), 2)
    assert len(send.said("error")) == 1
    assert send.slot()["error"].problem["type"].endswith("gauss-bonnet")


def wrong_jobs_are_refused():
    for name in ("Collect", "Domain", "Support"):
        made = settle(Component(name).set(Job="tower"), 2)
        assert "output Job of the component Send" in made.said("error")[0]
        made = settle(Component(name).set(Job="http://127.0.0.1:%d/v1/jobs/unheard" % PORT), 2)
        assert len(made.said("error")) == 1 and "unheard" in made.said("error")[0]


def jobs_without_panels_are_told():
    send = done(Panels=json.dumps({"panels": None}))
    collect = collected("Collect", Job=send.Job)
    assert "no panels" in collect.said("error")[0] and collect.Panels is None
    support = collected("Support", Job=send.Job)
    assert "BeamDepth" in support.said("error")[0]


# --- looking ---------------------------------------------------------------------------------------------


def domain_of_a_cylinder():
    send = done()
    domain = collected("Domain", Job=send.Job)
    assert domain.Summary.startswith("cylinder") and domain.Message == "unrolled"
    assert domain.Corners == [] and domain.CornerAngles == []
    around = float(domain.Summary.split()[-1])
    for loop in domain.Boundary:
        points = loop.xyz()
        assert len(points) == 25, "24 edges once around"
        assert abs(points[0][0] - points[-1][0]) - around < 1e-5 * around
        assert max(p[1] for p in points) - min(p[1] for p in points) < 1e-8 * around, "straight boundaries"
    assert len(domain.Pattern.flat()) == len(collected("Collect", Job=send.Job).Panels.flat())
    for cell in domain.Pattern.flat():
        width = max(p.X for p in cell.points) - min(p.X for p in cell.points)
        assert cell.IsClosed and width < 0.2 * around, "a cell across the cut stays in one piece"
    assert domain.Cut and all(len(line.points) == 2 for line in domain.Cut)


def domain_of_a_net():
    """A pointed cup has one loop: its domain is a disk."""
    pattern = json.dumps({"pattern": {"edge_length": 1.0}})
    send = done(Mesh=world.with_lid(world.tube(), 2.0), Mode="isometric", Pattern=pattern)
    domain = collected("Domain", Job=send.Job)
    assert domain.Summary == "net with 1 loop" and domain.Cut == []
    (loop,) = domain.Boundary
    points = loop.xyz()
    assert len(points) == 25 and max(abs(a - b) for a, b in zip(points[0], points[-1])) < 1e-6
    cells = domain.Pattern.flat()
    assert len(cells) == len(collected("Collect", Job=send.Job).Panels.flat())
    assert all(cell.IsClosed for cell in cells)
    hexagons = [cell for cell in cells if len(cell.points) == 7]
    assert len(cells) / 2 < len(hexagons) < len(cells), "those on the fold between wall and lid are cut"


def domain_with_corners():
    rim = [Point3d(2.75, 0.0, 0.0), Point3d(-2.75, 0.0, 0.0)]
    angles = Component("BoundaryAngles").set(Points=rim, Angle=[240.0, 120.0], Mesh=world.tube())
    send = done(Angles=angles.Angles, Pattern=None)
    domain = collected("Domain", Job=send.Job)
    assert sorted(round(a, 6) for a in domain.CornerAngles) == [120.0, 240.0]
    assert len(domain.Corners) == 2 and all(p.Z == 0.0 for p in domain.Corners)


def curves_are_lifted_across_the_cut():
    send = done()
    domain = collected("Domain", Job=send.Job)
    low, high = domain.Boundary
    y = 0.5 * (low.points[0].Y + high.points[0].Y)
    around = low.points[-1].X - low.points[0].X
    left = min(p.X for p in low.points)
    ring = array([(left - 0.4 * around, y, 0.0), (left + 0.6 * around, y, 0.0)])
    circle = CircleCurve(left + 0.3 * around, y, 0.02 * around)
    outside = array([(left + 0.5 * around, y, 0.0), (left + 0.5 * around, y + 10 * around, 0.0)])
    lift = collected("Lift", Job=send.Job, Curves=[ring, circle, outside], Steps=60)
    (once,) = lift.Lifted.branches[(0,)]
    assert len(once.points) == 61
    assert once.points[0].DistanceTo(once.points[-1]) < 1e-6, "a full turn closes up on the surface"
    for p in once.points:
        assert 1.0 < math.hypot(p.X, p.Y) < 3.0
    (loop,) = lift.Lifted.branches[(1,)]
    assert loop.IsClosed and len(loop.points) == 61
    assert len(lift.Outside) > 0 and "outside" in lift.said("warning")[0]
    assert lift.Normals.flat()[0].X != 0.0
    assert lift.solve().Lifted.branches and not lift.document.scheduled


def circles_and_lines_are_lifted():
    """As wires carry them: structures, which the hint of Curves turns into curves."""
    send = done()
    low, high = collected("Domain", Job=send.Job).Boundary
    y = 0.5 * (low.points[0].Y + high.points[0].Y)
    left, around = min(p.X for p in low.points), abs(low.points[-1].X - low.points[0].X)
    circle = Circle(left + 0.3 * around, y, 0.02 * around)
    line = Rhino.Geometry.Line(Point3d(left, y, 0.0), Point3d(left + 0.5 * around, y, 0.0))
    lift = collected("Lift", Job=send.Job, Curves=[circle, line, None], Steps=40)
    assert not lift.messages, lift.messages
    (loop,), (piece,) = lift.Lifted.branches[(0,)], lift.Lifted.branches[(1,)]
    assert loop.IsClosed and len(piece.points) == 41


def curves_are_features():
    """A ring wired to Features becomes one that the pattern follows at its height; an empty wire is none."""
    angles = [2.0 * math.pi * k / 24 for k in range(25)]
    ring = array([(1.25 * math.cos(a), 1.25 * math.sin(a), 3.0) for a in angles])
    send = done(Features=[None, ring])
    path = send.Job[send.Job.index("/v1/") :]
    pattern = world.ask(PORT, "GET", path + "/result?include=pattern")[1]["pattern"]
    (chain,) = pattern["features"]
    assert pattern["along"][0]["straight"] and len(chain) >= 16
    assert max(abs(pattern["vertices"][v][2] - 3.0) for v in chain) < 1e-9  # along edges


def the_front_can_be_sent():
    send = done(Pattern=None)
    explore = Component("Explore").set(Job=send.Job, MaxSizes=2, Variants=3, Run=True)
    pump([explore], lambda: explore.Requests or explore.said("error"))
    assert not explore.said("error"), explore.messages
    numbers = (explore.Uncovered, explore.Types, explore.PanelCount, explore.Gap, explore.Cost)
    assert explore.Requests and all(len(list(row)) == len(list(explore.Requests)) for row in numbers)
    again = done(Pattern=list(explore.Requests)[0], Angles=None, Panels=None)
    request = world.ask(PORT, "GET", "/v1/jobs/%s/request" % again.Job.rpartition("/")[2])[1]
    assert request["panels"]["sizes"] <= 2
    explore.set(MaxSizes=0)
    assert "1 or more" in explore.said("error")[0]


def circles_sent_as_surfaces_are_refused():
    made = sender(Mesh=Circle(0.0, 0.0, 1.0))
    assert made.said("error") == ["Mesh must be a mesh or a surface, not Circle."] and made.Job is None


def umlauts_reach_the_server():
    spy = world.Spy(PORT)
    send = settle(sender(Port=spy.port, Name="S\u00fcdfassade \u2116 1"), 2)
    assert send.Job and not send.messages, send.messages
    name = json.loads(spy.bodies("POST", "/v1/jobs")[0].decode("utf-8"))["name"]
    assert name == "S\u00fcdfassade \u2116 1"
    assert world.ask(PORT, "GET", "/v1/jobs/" + send.Job.split("/")[-1])[1]["name"] == name
    spy.close()


def address_on_the_canvas():
    """Panels hand over texts, with a line's end perhaps."""
    send = settle(sender(IP="127.0.0.1\n", Port=str(PORT)), 2)
    assert send.Job and not send.messages, send.messages


# --- baking ----------------------------------------------------------------------------------------------


def document():
    Rhino.RhinoDoc.ActiveDoc = Rhino.DocObjects.Document()
    return Rhino.RhinoDoc.ActiveDoc


def pressed(bake, **values):
    """A button: down, and up again before the work is done."""
    solved = bake.solved
    bake.set(Bake=True, **values)
    bake.set(Bake=False)
    settle(bake, solved + 3)
    assert not bake.said("error"), bake.messages
    return bake


def baked_panels():
    send = done()
    model = document()
    collect = collected("Collect", Job=send.Job)
    bake = pressed(Component("Bake"), Job=send.Job, Layer="facade::panels")
    n = len(collect.Panels.flat())
    assert bake.Count == n == len(model.things) and "facade::panels" in bake.Status
    assert sorted(t.attributes.Name for t in model.things) == sorted(collect.Labels.flat())
    by_label = dict((t.attributes.Name, t) for t in model.things)
    for label, size, curve in zip(collect.Labels.flat(), collect.Sizes.flat(), collect.Panels.flat()):
        thing = by_label[label]
        path = model.Layers.path(thing.attributes.LayerIndex)
        assert path.startswith("facade::panels::size-%02d (" % size), path
        assert thing.geometry.xyz() == curve.xyz()
        assert thing.attributes.texts["label"] == label and thing.attributes.texts["size"] == str(size)
        assert len(thing.attributes.texts["neighbours"].split()) == 6
    assert len(model.Layers) == 2 + len(set(collect.Sizes.flat()))
    # once more, and from another number of panels: nothing is there twice
    first = list(model.things)
    pressed(bake)
    assert len(model.things) == n and not set(model.things) & set(first)
    other = done(Pattern=json.dumps({"pattern": {"around": 18}}))
    model.things[0].hidden = True
    pressed(bake, Job=other.Job)
    assert len(model.things) == bake.Count != n
    # a second component does not touch what the first one baked, and Undo takes back one bake each
    second = pressed(Component("Bake"), Job=send.Job)
    assert len(model.things) == bake.Count + second.Count
    model.undo()
    assert len(model.things) == bake.Count
    model.undo()
    assert len(model.things) == n and model.record is None and model.drawn == 4
    assert set(words for words, _ in model.history) == set(["hexwrap Bake"])


def panels_at_wide_gaps_are_shown():
    send = done(Panels=Component("Panels").set(Sizes=3, MaxGap=0.05).Panels)
    collect = collected("Collect", Job=send.Job)
    wide = sorted([gap for gap in collect.Gaps.flat() if gap > 0.05], reverse=True)
    assert 1 < len(wide) == len(collect.Widest) < len(collect.Panels.flat())
    assert "panels at wider gaps than MaxGap: %d" % len(wide) in collect.Report


def baked_blocks():
    panels = Component("Panels").set(Inset=0.02, Thickness=0.05, Sizes=4)
    send = done(Panels=panels.Panels)
    model = document()
    collect = collected("Collect", Job=send.Job)
    bake = pressed(Component("Bake"), Job=send.Job)
    blocks = model.InstanceDefinitions
    assert len(blocks) == len(set(collect.Sizes.flat())), "a block per size"
    assert all([type(part).__name__ for part in parts] == ["PolylineCurve", "Mesh"] for _, parts in blocks)
    by_label = dict((t.attributes.Name, t) for t in model.things)
    assert len(by_label) == bake.Count == len(collect.Panels.flat())
    for label, plane, panel in zip(collect.Labels.flat(), collect.Planes.flat(), collect.Panels.flat()):
        index, motion = by_label[label].geometry
        assert Point3d(*motion.moved([0.0, 0.0, 0.0])).DistanceTo(plane.Origin) < 1e-9
        corners = [Point3d(*motion.moved(p)) for p in blocks[index][1][0].xyz()]
        edge = panel.points[0].DistanceTo(panel.points[1])
        for a, b in zip(corners, panel.points):
            assert 0.01 < a.DistanceTo(b) < 0.05 + 0.01 * edge, "the inset outline lies beside the panel's"
    before = [name for name, _ in blocks]
    pressed(bake)
    assert [name for name, _ in blocks] == before, "blocks are redefined, not doubled"


def baking_keeps_in_step_with_a_toggle():
    send = done()
    model = document()
    bake = settle(Component("Bake").set(Job=send.Job, Bake=True), 2)
    count = len(model.things)
    assert count and bake.Message == "baked"
    bake.solve()
    assert len(model.history) == 1 and not bake.document.scheduled, "baked once per job"
    other = done(Pattern=json.dumps({"pattern": {"around": 18}}))
    settle(bake.set(Job=other.Job), bake.solved + 1)
    assert len(model.history) == 2 and len(model.things) == bake.Count != count


def faults_while_baking_are_one_sentence():
    send = done()
    Rhino.RhinoDoc.ActiveDoc = None
    bake = settle(Component("Bake").set(Job=send.Job, Bake=True), 2)
    (sentence,) = bake.said("error")
    assert "did not expect" in sentence and "Traceback" not in sentence


def support_of_a_tower():
    panels = Component("Panels").set(BeamDepth=0.3, Sizes=8)
    send = done(Panels=panels.Panels)
    support = collected("Support", Job=send.Job)
    assert not support.messages, support.messages
    assert len(support.Nodes) == len(support.Axes) == len(support.Tilt) > 100
    assert len(support.Beams) == len(support.Lines) == len(support.Torsion) > 100
    assert all(beam.IsClosed and len(beam.points) == 5 for beam in support.Beams)
    assert max(abs(t) for t in support.Torsion) < 1e-3


def a_decimal_comma_changes_nothing():
    set_german()
    try:
        assert abs(float("0.5") - 0.5) == 0
        spy = world.Spy(PORT)
        panels = Component("Panels").set(Joint=0.015, Increment=0.0005)
        angles = Component("BoundaryAngles").set(Points=[Point3d(0.125, -2.5, 0.0)], Angle=[0.5], Unit="60")
        assert json.loads(angles.Angles)["boundary"]["angles"][0] == {
            "point": [0.125, -2.5, 0.0],
            "angle": 30.0,
        }
        send = settle(sender(Port=spy.port, Panels=panels.Panels, Mesh=world.tube(waist=0.62)), 2)
        assert send.Job and not send.messages, send.messages
        surface = json.loads(spy.bodies("POST", "/v1/surfaces")[0].decode("utf-8"))
        assert [tuple(p) for p in surface["vertices"]] == world.tube(waist=0.62).Vertices.points
        assert json.loads(spy.bodies("POST", "/v1/jobs")[0].decode("utf-8"))["panels"]["joint"] == 0.015
        collect = collected("Collect", Job=send.Job)
        assert "." in collect.Report and "," not in collect.Report.splitlines()[1].replace(", ", " ")
        spy.close()
    finally:
        set_plain()


def set_german():
    try:
        from java.util import Locale

        Locale.setDefault(Locale.GERMANY)
    except ImportError:
        import locale

        for name in ("de_DE.UTF-8", "de_DE.utf8", "German_Germany.1252"):
            try:
                locale.setlocale(locale.LC_ALL, name)
                return
            except locale.Error:
                pass


def set_plain():
    try:
        from java.util import Locale

        Locale.setDefault(Locale.ROOT)
    except ImportError:
        import locale

        locale.setlocale(locale.LC_ALL, "C")


world.run([
    send_and_collect,
    surfaces_are_meshed_as_rhino_does,
    sliders_send_settings_only,
    modes_reach_the_server,
    a_list_of_meshes_runs_side_by_side,
    newer_sliders_cancel_older_requests,
    run_off_cancels_on_the_server,
    escape_cancels_on_the_server,
    deleted_components_cancel_their_job,
    time_out,
    slow_jobs_show_progress_and_do_not_freeze_the_canvas,
    wrong_meshes_come_with_their_faults,
    refusals_keep_the_last_good_result,
    unbalanced_angles_are_refused_with_figures,
    wrong_jobs_are_refused,
    jobs_without_panels_are_told,
    domain_of_a_cylinder,
    domain_of_a_net,
    domain_with_corners,
    curves_are_lifted_across_the_cut,
    circles_and_lines_are_lifted,
    curves_are_features,
    the_front_can_be_sent,
    circles_sent_as_surfaces_are_refused,
    umlauts_reach_the_server,
    address_on_the_canvas,
    baked_panels,
    panels_at_wide_gaps_are_shown,
    baked_blocks,
    baking_keeps_in_step_with_a_toggle,
    faults_while_baking_are_one_sentence,
    support_of_a_tower,
    a_decimal_comma_changes_nothing,
])  # fmt: skip
