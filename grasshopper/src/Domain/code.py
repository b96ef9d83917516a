"""The unrolled domain, drawn in the plane: boundary, cut, corners and the pattern on it.

Curves drawn beside it in the same plane are put onto the surface by the component Lift.
"""

# include: wire canvas meshes
import cmath
import math

STRAIGHT = 1e-6  # radians by which a boundary vertex may differ from 180 degrees and still be no corner


class Deck(object):
    """One turn around the surface: z -> exp(i angle) z + translation."""

    def __init__(self, deck):
        self.turn = cmath.exp(1j * deck["angle"])
        self.shift = complex(*deck["translation"])

    def power(self, k, z):
        for _ in range(abs(k)):
            z = z * self.turn + self.shift if k > 0 else (z - self.shift) / self.turn
        return z


def domain(token, url):
    """Work of the background thread."""
    result = finished(url, token, ["mesh", "map", "pattern"])
    mesh, unrolled, pattern = result["mesh"], result["map"], result["pattern"]
    if unrolled["kind"] == "net":
        return net(mesh, unrolled, pattern)
    deck = Deck(unrolled["deck"])
    uv = [complex(x, y) for x, y in unrolled["uv"]]
    sheets = directed_edges(mesh["faces"], unrolled["sheet"])
    token.check()
    corners, angles = boundary_marks(mesh["loops"], unrolled["boundary_angles"], uv)
    return {
        "boundary": [flat_curve(run_around(loop, sheets, uv, deck)) for loop in mesh["loops"]],
        "cut": cut(mesh["faces"], unrolled["sheet"], uv, deck),
        "corners": corners,
        "angles": angles,
        "pattern": flat_pattern(pattern, deck) if pattern else None,
        "summary": summary(unrolled),
    }


def net(mesh, unrolled, pattern):
    """The same of a domain that is no cylinder or cone: triangles in the plane, glued across the cut."""
    sides = {}
    for corners, places in zip(mesh["faces"], unrolled["corners"]):
        for k in range(3):
            sides[corners[k - 1], corners[k]] = complex(*places[k - 1]), complex(*places[k])
    size = max(abs(end) for side in sides.values() for end in side) or 1.0
    banks = []
    for edge, (start, end) in sorted(sides.items()):
        beyond = sides.get(edge[::-1])
        if beyond and abs(beyond[0] - end) + abs(beyond[1] - start) > 1e-6 * size:
            banks.append(flat_curve([start, end]))
    boundary = []
    for loop in mesh["loops"]:
        pieces = []
        for k in range(len(loop)):
            start, end = sides[loop[k], loop[(k + 1) % len(loop)]]
            if not pieces or abs(pieces[-1][-1] - start) > 1e-6 * size:
                pieces.append([start])
            pieces[-1].append(end)
        boundary.extend(flat_curve(piece) for piece in pieces)
    points, degrees = [], []
    for loop, row in zip(mesh["loops"], unrolled["boundary_angles"]):
        for k, angle in enumerate(row):
            if abs(angle - math.pi) > STRAIGHT:
                start = sides[loop[k], loop[(k + 1) % len(loop)]][0]
                points.append(point([start.real, start.imag]))
                degrees.append(math.degrees(angle))
    branches = {}
    if pattern:
        for ring, cell in zip(pattern["ring"], pattern["corners"]):
            branches.setdefault(ring, []).append(closed_polyline(cell))
    text = "net with %d loop%s" % (len(mesh["loops"]), "" if len(mesh["loops"]) == 1 else "s")
    if unrolled["cones"]:
        text += ", singularities: %d" % len(unrolled["cones"])
    return {
        "boundary": boundary,
        "cut": banks,
        "corners": points,
        "angles": degrees,
        "pattern": tree_of(branches) if pattern else None,
        "summary": text,
    }


def flat_curve(numbers):
    return polyline([[z.real, z.imag] for z in numbers])


def directed_edges(faces, sheets):
    """Sheets of both ends, for each edge as its face runs through it."""
    found = {}
    for corners, levels in zip(faces, sheets):
        for k in range(3):
            found[corners[k - 1], corners[k]] = levels[k - 1], levels[k]
    return found


def run_around(loop, sheets, uv, deck):
    """A boundary loop from its first vertex once around, without a jump."""
    level, path = 0, [uv[loop[0]]]
    for k in range(len(loop)):
        start, end = loop[k], loop[(k + 1) % len(loop)]
        first, second = sheets[start, end]
        level += second - first
        path.append(deck.power(level, uv[end]))
    return path


def cut(faces, sheets, uv, deck):
    """Edges along which the sheet was cut open: both sides, as lines."""
    owners = {}
    for corners, levels in zip(faces, sheets):
        lowest = min(levels)
        placed = [(v, s - lowest) for v, s in zip(corners, levels)]
        for k in range(3):
            edge = tuple(sorted((placed[k - 1], placed[k])))
            owners[edge] = owners.get(edge, 0) + 1
    inner = set(e for e in counted_edges(faces) if e[1] == 2)
    return [
        flat_curve([deck.power(s, uv[v]) for v, s in edge])
        for edge, count in sorted(owners.items())
        if count == 1 and (tuple(sorted(v for v, _ in edge)), 2) in inner
    ]


def counted_edges(faces):
    count = {}
    for corners in faces:
        for k in range(3):
            edge = tuple(sorted((corners[k - 1], corners[k])))
            count[edge] = count.get(edge, 0) + 1
    return count.items()


def boundary_marks(loops, angles, uv):
    """Points and degrees of the corners of the domain."""
    points, degrees = [], []
    for loop, row in zip(loops, angles):
        for v, angle in zip(loop, row):
            if abs(angle - math.pi) > STRAIGHT:
                points.append(point([uv[v].real, uv[v].imag]))
                degrees.append(math.degrees(angle))
    return points, degrees


def flat_pattern(pattern, deck):
    """Closed outlines by ring; a cell across the cut stays in one piece."""
    uv = [complex(x, y) for x, y in pattern["uv"]]
    branches = {}
    for cell, ring, levels in zip(pattern["faces"], pattern["ring"], pattern["sheet"]):
        corners = [deck.power(s, uv[v]) for v, s in zip(cell, levels)]
        branches.setdefault(ring, []).append(closed_polyline([[z.real, z.imag] for z in corners]))
    return tree_of(branches)


def summary(unrolled):
    degrees = math.degrees(unrolled["cone_angle"])
    if unrolled["kind"] == "cylinder":
        return "cylinder, circumference %.6g" % unrolled["circumference"]
    return "cone of %.6g degrees" % degrees


def solve():
    return made_of_job(component, Job, domain, "unrolled", ("boundary", "cut", "corners", "angles", "pattern", "summary"))


component = ghenv.Component
Boundary, Cut, Corners, CornerAngles, Pattern, Summary = solved(component, solve, 6)
