"""The examples' networks, wired as in their files, against a live server."""

from __future__ import print_function

import io
import json
import os

import Rhino
import world
from canvas import BUILT, Component, pump
from Rhino.Geometry import Mesh, Point3d

PORT = int(os.environ["HEXWRAP_PORT"])


class Network(object):
    """What stands on the canvas, by nickname or component; each hands on its items."""

    def __init__(self, name, mesh):
        with io.open(os.path.join(BUILT, name, "network.json"), encoding="utf-8") as file:
            self.things = json.load(file)
        self.mesh = mesh
        self.pressed = set()
        self.made = {}
        for thing in self.things:
            if "script" in thing:
                self.made[thing["id"]] = Component(os.path.join(name, thing["script"]))
        document = next(iter(self.made.values())).document
        for component in self.made.values():
            component.document = document
        self.start = dict((start, thing) for thing in self.things for start in thing["starts"])

    def __getitem__(self, script):
        return next(self.made[t["id"]] for t in self.things if t.get("script") == script)

    def items(self, start):
        """The items that a wire from there carries."""
        thing = self.start[start]
        if "script" in thing:
            value = getattr(self.made[thing["id"]], thing["starts"][start], None)
            if hasattr(value, "flat"):
                return value.flat()
            return [] if value is None else list(value) if isinstance(value, (list, tuple)) else [value]
        if any(thing["wires"].values()):
            items = self.carried(thing["wires"][""])
            return [point(item) for item in items] if thing["name"] == "Point" else items
        if thing["name"] == "Mesh":
            return [self.mesh]
        if thing["nickname"] == "Port":
            return [str(PORT)]
        if thing["nickname"] in self.pressed:
            return [True]
        return thing["items"]

    def carried(self, wires):
        return [item for start in wires for item in self.items(start)]

    def solve(self, script):
        """One component with what its wires carry."""
        thing = next(t for t in self.things if t.get("script") == script)
        component, values = self.made[thing["id"]], {}
        for name, wires in thing["wires"].items():
            items = self.carried(wires)
            if name in component.lists:
                values[name] = items or None
            else:
                assert len(items) < 2, "%s of %s would solve it %d times" % (name, script, len(items))
                values[name] = items[0] if items else None
        component.wired = {}
        component.set(**values)
        assert not component.said("error"), (script, component.messages)
        return component

    def settled(self, script, ready):
        component = self.solve(script)
        pump([component], lambda: ready(component) or component.said("error"))
        assert not component.said("error"), (script, component.messages)
        return component


def point(text):
    """A panel's line as a parameter of points reads it."""
    return Point3d(*[float(c) for c in text.split(",")])


def sample(name):
    with io.open(os.path.join(os.environ["HEXWRAP_MESHES"], name + ".json"), encoding="utf-8") as file:
        surface = json.load(file)
    return Mesh(surface["vertices"], surface["faces"])


def solved(name, mesh):
    """The network with Run turned on, down to Collect, Domain and Explore."""
    network = Network(name, mesh)
    for script in ("StartServer", "BoundaryAngles", "Singularities", "Pattern", "Panels"):
        network.solve(script)
    assert network.solve("Send").Job is None, "Run is off when the file is opened"
    network.pressed.add("Run")
    send = network.settled("Send", lambda send: send.Message == "done")
    assert send.Job, send.messages
    collect = network.settled("Collect", lambda collect: collect.Message == "collected")
    assert not collect.said("warning"), collect.messages
    panels = collect.Panels.flat()
    assert len(panels) > 50 and len(collect.Labels.flat()) == len(panels)
    previewed = [t for t in network.things if t["name"] == "Custom Preview"]
    for wires in (thing["wires"] for thing in previewed):
        shapes, colours = (network.carried(wires[end]) for end in ("Geometry", "Material"))
        assert len(shapes) == len(colours) == len(set(collect.Sizes.flat()))
    assert previewed and "%d panels" % len(panels) in collect.Report and "overlaps: 0" in collect.Report
    domain = network.settled("Domain", lambda domain: domain.Summary)
    network.settled("Explore", lambda explore: True)
    return network, send, collect, domain


def request_of(send):
    return world.ask(PORT, "GET", "/v1/jobs/%s/request" % send.Job.rpartition("/")[2])[1]


def tower_and_bake():
    network, send, collect, _ = solved("example", world.tube())
    request = request_of(send)
    assert request["pattern"]["around"] == 24 and request["panels"]["sizes"] == 11
    Rhino.RhinoDoc.ActiveDoc = Rhino.DocObjects.Document()
    network.solve("Bake")
    network.pressed.add("Bake")
    bake = network.settled("Bake", lambda bake: bake.Count)
    assert bake.Count == len(collect.Panels.flat()) == len(Rhino.RhinoDoc.ActiveDoc.things)


def entrance_with_its_corners():
    network, send, _, _ = solved("entrance", sample("entrance"))
    assert "missing" not in network["BoundaryAngles"].Balance
    result = world.ask(PORT, "GET", "/v1/jobs/%s/result?include=map" % send.Job.rpartition("/")[2])[1]
    assert len(request_of(send)["boundary"]["angles"]) == 6
    assert result["map"]["closing_error"] < 1e-9


def dome_with_singularities():
    _, send, _, _ = solved("dome", sample("dome"))
    result = world.ask(PORT, "GET", "/v1/jobs/%s/result?include=map,pattern" % send.Job.rpartition("/")[2])[1]
    assert result["map"]["cones"] and sum(k != 0 for k in result["pattern"]["index"]) > 0


world.run([tower_and_bake, entrance_with_its_corners, dome_with_singularities])
