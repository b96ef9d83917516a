"""Boundary corners: points and the angles that the unrolled domain gets there.

Everywhere else the boundary becomes straight (180 degrees). The angles must balance: the sum of
180 degrees - angle over all corners is zero (Gauss-Bonnet). Balance tells what is missing while one types.
"""

# include: wire canvas choices
import math

UNITS = ["deg", "rad", "60", "90"]
BALANCED = math.degrees(1e-3)  # the server spreads less than this over the rest of the boundary


def corner_angles(points, angles, unit):
    """One angle in degrees per point. Raises Refusal."""
    if len(angles) == 1:
        angles = angles * len(points)
    if len(angles) != len(points):
        raise Refusal(
            "%d points and %d angles: give one angle per point, or one for all." % (len(points), len(angles))
        )
    factor = {"deg": 1.0, "rad": 180.0 / math.pi, "60": 60.0, "90": 90.0}[unit]
    degrees = [factor * float(angle) for angle in angles]
    for k, angle in enumerate(degrees):
        if not angle > 0.0:
            raise Refusal("Angle %d is %g degrees: a corner needs more than 0." % (k, angle))
    return degrees


def boundary_of(mesh):
    """The boundary as Rhino's closed polylines, seams closed up."""
    welded = mesh.DuplicateMesh()
    welded.Vertices.CombineIdentical(True, True)
    return list(welded.GetNakedEdges() or [])


def snapped(points, loops):
    """(boundary vertex, number of its loop) nearest to each point."""
    found = []
    for p in points:
        nearest = None
        for number, loop in enumerate(loops):
            for corner in loop:
                distance = p.DistanceTo(corner)
                if nearest is None or distance < nearest[0]:
                    nearest = (distance, corner, number)
        found.append(nearest[1:])
    return found


def balance_text(degrees, loop_numbers):
    """(words, missing degrees): what equation (1) says about these angles."""
    missing = sum(180.0 - angle for angle in degrees)
    lines = []
    if loop_numbers:
        for number in sorted(set(loop_numbers)):
            bent = sum(180.0 - a for a, n in zip(degrees, loop_numbers) if n == number)
            lines.append("loop %d bends by %g degrees" % (number, round(bent, 6)))
    if abs(missing) <= BALANCED:
        lines.append("balanced: the angles close up")
        return "\n".join(lines), 0.0
    word = "small" if missing > 0 else "large"
    lines.append("not balanced: the angles are %g degrees too %s in total" % (round(abs(missing), 6), word))
    lines.append(example(degrees, missing))
    return "\n".join(lines), missing


def example(degrees, missing):
    """One change that would close the sum."""
    at = max(range(len(degrees)), key=lambda k: degrees[k] if missing < 0 else -degrees[k])
    repaired = degrees[at] + missing
    if repaired > 0:
        return "for example %g instead of %g degrees at corner %d" % (round(repaired, 6), degrees[at], at)
    corners = int(math.ceil(-missing / 90.0))
    return "for example %d more corners of %g degrees" % (corners, round(180.0 + missing / corners, 6))


def boundary_text(points, degrees, unit):
    """The boundary of a request, in the unit that was typed, so that no digit is lost."""
    wire_unit, factor = ("rad", math.pi / 180.0) if unit == "rad" else ("deg", 1.0)
    corners = [{"point": [p.X, p.Y, p.Z], "angle": a * factor} for p, a in zip(points, degrees)]
    return json_text({"boundary": {"mode": "angles", "angle_unit": wire_unit, "angles": corners}})


def solve():
    offer(component, {"Unit": UNITS})
    given = [p for p in Points or [] if p is not None]
    if not given:
        component.Message = "no corners"
        remark(component, "Points is empty: wire points on the boundary and an angle for each.")
        return None, None, None, []
    unit = choice(Unit, UNITS, "Unit") or "deg"
    degrees = corner_angles(given, list(Angle or []), unit)
    loops = boundary_of(Mesh) if Mesh is not None else []
    places = snapped(given, loops) if loops else []
    corners = [corner for corner, _ in places] or given
    balance, missing = balance_text(degrees, [number for _, number in places])
    component.Message = "balanced" if missing == 0.0 else "%+g deg missing" % round(missing, 3)
    if missing != 0.0:
        warning(component, balance)
    return boundary_text(corners, degrees, unit), balance, missing, corners


component = ghenv.Component
Angles, Balance, Missing, Corners = solved(component, solve, 4)
