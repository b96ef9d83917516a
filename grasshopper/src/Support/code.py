"""The support structure below the panels: node axes, and beams between them that do not twist."""

# include: wire canvas meshes
import math


def support(token, url):
    """Work of the background thread."""
    found = finished(url, token, ["support"]).get("support")
    if not found:
        raise Refusal("This job has no support structure: give the component Panels a BeamDepth and send again.")
    return {
        "nodes": [point(p) for p in found["nodes"]],
        "axes": [vector(a) for a in found["axes"]],
        "beams": [closed_polyline(strip) for strip in found["strips"]],
        "lines": [
            Rhino.Geometry.Line(point(found["nodes"][a]), point(found["nodes"][b])) for a, b in found["edges"]
        ],
        "torsion": [math.degrees(t) for t in found["torsion"]],
        "tilt": [math.degrees(t) for t in found["tilt"]],
    }


def solve():
    return made_of_job(component, Job, support, "collected", ("nodes", "axes", "beams", "lines", "torsion", "tilt"))


component = ghenv.Component
Nodes, Axes, Beams, Lines, Torsion, Tilt = solved(component, solve, 6)
