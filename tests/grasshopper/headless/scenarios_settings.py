"""Components that need no server."""

from __future__ import print_function

import json
import math

import world
from canvas import Component, ValueList, pump
from Rhino.Geometry import Brep, Circle, Point, Point3d, Surface

RIM = [Point3d(2.75, 0.0, 0.0), Point3d(-2.75, 0.0, 0.0), Point3d(0.0, 2.75, 0.0), Point3d(0.0, -2.75, 0.0)]


def balanced_angles():
    made = Component("BoundaryAngles").set(Points=RIM[:2], Angle=[240.0, 120.0])
    assert made.Missing == 0.0 and made.Message == "balanced" and not made.messages
    sent = json.loads(made.Angles)["boundary"]
    assert sent["mode"] == "angles" and sent["angle_unit"] == "deg"
    assert [corner["angle"] for corner in sent["angles"]] == [240.0, 120.0]
    assert sent["angles"][0]["point"] == [2.75, 0.0, 0.0]


def unbalanced_angles_are_told_while_one_types():
    made = Component("BoundaryAngles").set(Points=RIM, Angle=[4.0, 1.0, 4.0, 4.0], Unit="60")
    # (180 - 240) * 3 + (180 - 60) = -60: the angles are 60 degrees too large
    assert abs(made.Missing + 60.0) < 1e-9
    assert "60 degrees too large" in made.Balance and "180 instead of 240" in made.Balance
    assert made.said("warning") == [made.Balance] and "-60" in made.Message
    made.set(Angle=[4.0, 1.0, 4.0, 3.0])
    assert made.Missing == 0.0 and not made.messages


def the_example_closes_the_sum():
    for angles in ([240.0], [60.0, 60.0], [10.0], [300.0, 300.0, 300.0], [30.0, 200.0]):
        made = Component("BoundaryAngles").set(Points=RIM[: len(angles)], Angle=angles)
        words = made.Balance.splitlines()[-1].split()
        if "more" in words:
            repaired = angles + [float(words[words.index("of") + 1])] * int(words[2])
        else:
            at = int(words[-1])
            repaired = list(angles)
            repaired[at] = float(words[2])
        assert abs(sum(180.0 - a for a in repaired)) < 1e-3, (angles, made.Balance)
        assert min(repaired) > 0.0


def units_mean_what_they_say():
    for unit, angle in (("deg", 90.0), ("rad", math.pi / 2), ("90", 1.0), ("60", 1.5)):
        made = Component("BoundaryAngles").set(Points=RIM[:1], Angle=[angle], Unit=unit)
        assert abs(made.Missing - 90.0) < 1e-9, unit
    assert (
        json.loads(Component("BoundaryAngles").set(Points=RIM, Angle=[math.pi], Unit="rad").Angles)[
            "boundary"
        ]["angles"][3]["angle"]
        == math.pi
    )


def loops_and_corners_from_the_mesh():
    near = [Point3d(3.0, 0.1, 0.2), Point3d(-3.0, 0.0, 6.1)]
    made = Component("BoundaryAngles").set(Points=near, Angle=[240.0, 120.0], Mesh=world.tube())
    assert [p.xyz() for p in made.Corners] == [[2.75, 0.0, 0.0]] + [made.Corners[1].xyz()]
    assert made.Corners[1].Z == 6.0 and abs(made.Corners[1].X + 2.75) < 1e-9
    assert "loop 0 bends by -60 degrees" in made.Balance and "loop 1 bends by 60 degrees" in made.Balance


def wrong_angles_are_refused():
    for points, angles, word in (
        (RIM[:2], [1.0, 2.0, 3.0], "2 points and 3 angles"),
        (RIM[:2], [180.0, -5.0], "-5 degrees"),
        (RIM[:2], [float("nan"), 10.0], "nan degrees"),
    ):
        made = Component("BoundaryAngles").set(Points=points, Angle=angles)
        assert len(made.said("error")) == 1 and word in made.said("error")[0], made.messages
        assert made.Angles is None
    made = Component("BoundaryAngles").set(Points=RIM, Angle=[180.0], Unit="grad")
    assert "deg, rad, 60, 90" in made.said("error")[0]
    assert "empty" in Component("BoundaryAngles").solve().said("remark")[0]


def pattern_settings():
    assert json.loads(Component("Pattern").solve().Pattern) == {"pattern": {}}
    made = Component("Pattern").set(Kind="QUAD", Around=12, Align="first", Boundary="trim", PhaseX=0.25)
    assert json.loads(made.Pattern)["pattern"] == {
        "kind": "quad",
        "around": 12,
        "align": "first",
        "boundary": "trim",
        "phase": [0.25, 0.0],
    }
    assert json.loads(made.set(Rotation="vertex").Pattern)["pattern"]["rotation"] == "vertex"
    assert json.loads(made.set(Rotation="12,5").Pattern)["pattern"]["rotation"] == 12.5
    assert json.loads(made.set(Rotation="12.5").Pattern)["pattern"]["rotation"] == 12.5


def wrong_pattern_settings_are_refused():
    for values, word in (
        ({"Kind": "pentagon"}, "hex, triangle, quad"),
        ({"Around": 12, "EdgeLength": 0.5}, "either"),
        ({"Around": -3}, "positive"),
        ({"EdgeLength": -1.0}, "positive"),
        ({"Rotation": "sideways"}, "sideways"),
        ({"Align": "last"}, "none, first, both"),
    ):
        made = Component("Pattern").set(**values)
        assert len(made.said("error")) == 1 and word in made.said("error")[0], made.messages
        assert made.Pattern is None


def panel_settings():
    assert json.loads(Component("Panels").solve().Panels) == {"panels": {}, "support": False}
    made = Component("Panels").set(
        Sizes=5, Target="best", Joint=0.02, EdgeMin=0.5, EdgeMax=2.0, BeamDepth=0.3, Thickness=0.1
    )
    sent = json.loads(made.Panels)
    assert sent["support"] is True
    assert sent["panels"] == {
        "sizes": 5,
        "target": "best",
        "joint": 0.02,
        "edge_range": [0.5, 2.0],
        "components": {"thickness": 0.1, "depth": 0.3},
    }
    assert json.loads(made.set(Sizes=0).Panels)["panels"]["sizes"] is None
    fewest = json.loads(Component("Panels").set(MaxGap=0.03).Panels)
    assert fewest["panels"] == {"sizes": "fewest", "max_gap": 0.03}


def wrong_panel_settings_are_refused():
    for values, word in (
        ({"Sizes": -1}, "1 or more"),
        ({"EdgeMin": 2.0, "EdgeMax": 1.0}, "smaller"),
        ({"EdgeMin": 2.0}, "belong together"),
        ({"Joint": -0.1}, "Joint"),
        ({"Target": "largest"}, "shortest, inscribed, best, mean"),
        ({"Mode": "open"}, "split, watertight"),
        ({"Thickness": -1.0}, "Thickness"),
        ({"MaxGap": -0.1}, "MaxGap"),
    ):
        made = Component("Panels").set(**values)
        assert len(made.said("error")) == 1 and word in made.said("error")[0], made.messages
        assert made.Panels is None


def a_fresh_value_list_fills_itself_once():
    made = Component("Pattern")
    wired = ValueList()
    made.Params.Input[0].wired.append(wired)
    made.solve()
    pump([made], lambda: wired.expired == 1)
    offered = [item.Expression for item in wired.ListItems]
    assert offered[:3] == ['"hex"', '"triangle"', '"quad"'] and '"trihexagonal"' in offered
    made.solve()
    assert not made.document.scheduled
    assert json.loads(made.set(Kind='"quad"').Pattern)["pattern"]["kind"] == "quad"


def singularities():
    assert Component("Singularities").solve().Singularities is None
    for given, sent in (("auto", "auto"), ("4", 4), ('"8"', 8), ("0", 0)):
        made = Component("Singularities").set(Count=given)
        assert json.loads(made.Singularities) == {"singularities": {"count": sent}}
    for given, sent in (("auto", "auto"), ("3", 3)):
        made = Component("Pattern").set(Singularities=given)
        assert json.loads(made.Pattern) == {"pattern": {}, "singularities": {"count": sent}}
    refused = Component("Pattern").set(Singularities="-1")
    assert refused.Pattern is None
    assert "Singularities must be auto or a whole number" in refused.said("error")[0]
    made = Component("Singularities").set(Points=RIM[:2], Index=[-1])
    assert json.loads(made.Singularities)["singularities"]["at"] == [
        {"point": p.xyz(), "index": -1} for p in RIM[:2]
    ]
    made.set(Points=[Point(p) for p in RIM[:3]], Index=[1, -1, 1], Count="auto")
    assert [row["index"] for row in json.loads(made.Singularities)["singularities"]["at"]] == [1, -1, 1]


def wrong_singularities_are_refused():
    for values, word in (
        ({"Count": "many"}, "Count"),
        ({"Count": "1.5"}, "whole"),
        ({"Count": "-2"}, "negative"),
        ({"Points": RIM, "Index": [1, 1]}, "4 points and 2 indices"),
        ({"Points": RIM[:1], "Index": [0]}, "no singularity"),
    ):
        made = Component("Singularities").set(**values)
        assert len(made.said("error")) == 1 and word in made.said("error")[0], made.messages
        assert made.Singularities is None


def umlauts_in_refusals_and_settings():
    made = Component("Pattern").set(Kind="F\u00fcnfeck")
    assert "F\u00fcnfeck" in made.said("error")[0]
    made = Component("Panels").set(Target="gr\u00f6\u00dfte")
    assert "gr\u00f6\u00dfte" in made.said("error")[0]


def surfaces_and_points_wired_to_angles():
    """A Surface where a mesh is asked for, Point objects where points are: the hints see to it."""
    for surface in (Surface([world.tube()]), Brep([world.tube()])):
        made = Component("BoundaryAngles").set(
            Points=[Point(p) for p in RIM[:2]], Angle=[240, 120], Mesh=surface
        )
        assert not made.messages and "loop 0 bends by 0 degrees" in made.Balance, made.messages
    made = Component("BoundaryAngles").set(Points=RIM[:1], Angle=[180.0], Mesh=Circle(0.0, 0.0, 1.0))
    assert made.Missing == 0.0 and not made.said("error")  # nothing that the hint could make a mesh of
    made = Component("BoundaryAngles").set(Points=[Circle(0.0, 0.0, 1.0)], Angle=[180.0])
    assert "empty" in made.said("remark")[0] and not made.said("error")


def no_traceback_reaches_the_balloon():
    """What nobody thought of becomes one sentence, and nothing is put out."""

    class Broken(Point3d):
        def __init__(self):
            Point3d.__init__(self, 0.0, 0.0, 0.0)
            del self.X

    for name, values in (
        ("BoundaryAngles", {"Points": [Broken()], "Angle": [180.0]}),
        ("Singularities", {"Points": [Broken()]}),
    ):
        made = Component(name).set(**values)
        (sentence,) = made.said("error")
        assert "did not expect" in sentence and "AttributeError" in sentence, sentence
        assert "Traceback" not in sentence and "\n" not in sentence
        assert made.Message == "failed" and all(value is None for value in made.values.values())


def nothing_wired_is_told_without_an_error():
    for name, word in (
        ("Collect", "job"),
        ("Domain", "job"),
        ("Lift", "job"),
        ("Support", "job"),
        ("Bake", "job"),
        ("Send", "Run"),
    ):
        made = Component(name).solve()
        assert word in made.Message and not made.said("error"), name
    made = Component("Send").set(Run=True)
    assert "Mesh is empty" in made.said("warning")[0]
    assert Component("StartServer").solve().Running is False


world.run([
    balanced_angles,
    unbalanced_angles_are_told_while_one_types,
    the_example_closes_the_sum,
    units_mean_what_they_say,
    loops_and_corners_from_the_mesh,
    wrong_angles_are_refused,
    pattern_settings,
    wrong_pattern_settings_are_refused,
    panel_settings,
    wrong_panel_settings_are_refused,
    singularities,
    wrong_singularities_are_refused,
    umlauts_in_refusals_and_settings,
    surfaces_and_points_wired_to_angles,
    no_traceback_reaches_the_balloon,
    a_fresh_value_list_fills_itself_once,
    nothing_wired_is_told_without_an_error,
])  # fmt: skip
