"""Puts curves drawn in the unrolled domain onto the surface, across the seam without a gap.

Where a curve leaves the domain it is broken off; Outside shows the points that were left out.
"""

# include: wire canvas meshes

STEPS = 100  # pieces per curve unless told otherwise


def samples(curve, steps):
    """Points [x, y] along a curve; the corners of a polyline stay corners."""
    found, drawn = curve.TryGetPolyline()
    if not found:
        parameters = curve.DivideByCount(steps, True)
        points = [curve.PointAt(t) for t in parameters]
        if curve.IsClosed:
            points.append(points[0])
        return [[p.X, p.Y] for p in points]
    corners = [(p.X, p.Y) for p in drawn]
    lengths = [((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2) ** 0.5 for a, b in zip(corners, corners[1:])]
    whole = sum(lengths) or 1.0
    points = [list(corners[0])]
    for a, b, length in zip(corners, corners[1:], lengths):
        pieces = max(1, int(round(steps * length / whole)))
        for k in range(1, pieces + 1):
            t = k / float(pieces)
            points.append([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])])
    return points


def lift(token, url, drawn):
    """Work of the background thread: all points in one request."""
    server, name = split_job(url)
    job = wait_for_job(server, name, token)
    if job["status"] != "done":
        raise Refusal("The job of this address did not finish well; nothing can be put onto its surface.")
    token.say("lifting")
    points = [p for row in drawn for p in row]
    answer = call_json(server, "POST", "/v1/jobs/%s/lift" % name, {"points": points}, timeout=SLOW)
    branches, normals, outside, start = {}, {}, [], 0
    for number, row in enumerate(drawn):
        end = start + len(row)
        pieces = runs(answer["inside"][start:end])
        branches[number] = [polyline(answer["points"][start + a : start + b]) for a, b in pieces]
        normals[number] = [vector(answer["normals"][start + a]) for a, b in pieces]
        outside += [point(p) for p, inside in zip(row, answer["inside"][start:end]) if not inside]
        start = end
    return {"curves": tree_of(branches), "normals": tree_of(normals), "outside": outside}


def runs(inside):
    """Stretches [a, b) of at least two points that lie inside."""
    found, start = [], None
    for k, flag in enumerate(list(inside) + [False]):
        if flag and start is None:
            start = k
        elif not flag and start is not None:
            if k - start > 1:
                found.append((start, k))
            start = None
    return found


def request(slot, curves):
    drawn = [samples(curve, int(Steps or STEPS)) for curve in curves]
    url = TEXT(Job)
    in_background(component, slot, (url, json_text(drawn)), lambda token: lift(token, url, drawn))


def solve():
    slot = slot_of(component)
    curves = [curve for curve in Curves or [] if curve is not None]
    if not Job or not curves:
        stop(slot)
        component.Message = "no curves" if Job else "no job yet"
    else:
        request(slot, curves)
        state_message(component, slot, "lifted")
    found = slot["result"] or {}
    if found.get("outside"):
        warning(
            component,
            "%d points lie outside of the unrolled domain and were left out." % len(found["outside"]),
        )
    return found.get("curves"), found.get("normals"), found.get("outside")


component = ghenv.Component
Lifted, Normals, Outside = solved(component, solve, 3)
