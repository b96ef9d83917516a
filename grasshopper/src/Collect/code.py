"""Collects the panels of a job: closed polylines as a tree by ring, and what belongs to each panel.

While a new job runs, the last good panels stay.
"""

# include: wire canvas meshes

PARTS = ["panels", "pattern", "sizes", "quality"]


def collect(token, url):
    """Work of the background thread: everything that is put out, built once."""
    result = finished(url, token, PARTS)
    if not result.get("panels"):
        raise Refusal("This job has no panels: it was sent without a pattern or without panels.")
    panels, pattern, sizes = result["panels"], result["pattern"], result["sizes"]
    token.say("%d panels" % len(panels["polygons"]))
    place = places(pattern, panels["face"])
    order = sorted(range(len(place)), key=lambda k: place[k])
    label_of = dict(zip(panels["face"], panels["label"]))

    def tree(value):
        branches = {}
        for k in order:
            branches.setdefault(place[k][0], []).append(value(k))
        return tree_of(branches)

    index = pattern.get("index") or [0] * len(pattern["faces"])
    groups = by_size(panels["size"])
    frames = [frame(points, panels["normal"][k]) for k, points in enumerate(panels["polygons"])]
    flat = [flattened(points, frames[k]) for k, points in enumerate(panels["polygons"])]
    return {
        "panels": tree(lambda k: closed_polyline(panels["polygons"][k])),
        "labels": tree(lambda k: panels["label"][k]),
        "sizes": tree(lambda k: panels["size"][k]),
        "colours": tree(lambda k: size_colour(sizes, panels["size"][k])),
        "planes": tree(lambda k: plane(panels["center"][k], frames[k])),
        "outlines": tree(lambda k: closed_polyline(flat[k])),
        "planarity": tree(lambda k: panels["planarity"][k]),
        "gaps": tree(lambda k: panels["gap_tangential"][k] if panels["gap_tangential"] else None),
        "convex": tree(lambda k: is_convex(flat[k])),
        "neighbours": tree(lambda k: neighbour_labels(pattern["neighbours"][panels["face"][k]], label_of)),
        "index": tree(lambda k: index[panels["face"][k]]),
        "shapes": [joined([panels["polygons"][k] for k in rows]) for _, rows in groups],
        "shape_colours": [size_colour(sizes, size) for size, _ in groups],
        "report": report(result),
        "widest": [closed_polyline(panels["polygons"][k]) for k in widest(panels, result["quality"])],
    }


def widest(panels, quality):
    """The panels at joints wider than asked for, or else the one at the widest; the widest first."""
    gaps = panels["gap_tangential"] or []
    known = [k for k in range(len(gaps)) if gaps[k] is not None]
    return sorted(known, key=lambda k: (-gaps[k], k))[: max(quality["gap"]["over"] or 0, 1)]


def places(pattern, cells):
    """(ring, place in it) of each panel; without rings everything is one ring."""
    rings, numbers = pattern.get("ring"), pattern.get("place")
    if not rings or not numbers:
        return [(0, k) for k in range(len(cells))]
    return [(rings[cell], numbers[cell]) for cell in cells]


def by_size(sizes):
    """(size, its panels), cut panels without a size last."""
    found = {}
    for k, size in enumerate(sizes):
        found.setdefault(size, []).append(k)
    return sorted(found.items(), key=lambda item: (item[0] < 0, item[0]))


def frame(points, normal):
    """Axes x along the first edge, y to its left seen from outside."""
    x = unit([points[1][i] - points[0][i] for i in range(3)])
    along = sum(x[i] * normal[i] for i in range(3))
    x = unit([x[i] - along * normal[i] for i in range(3)])
    y = [normal[i - 2] * x[i - 1] - normal[i - 1] * x[i - 2] for i in range(3)]
    return x, y


def unit(v):
    length = sum(c * c for c in v) ** 0.5
    return [c / length for c in v]


def plane(center, axes):
    return Rhino.Geometry.Plane(point(center), vector(axes[0]), vector(axes[1]))


def flattened(points, axes):
    """The outline laid into the plane, its first corner at the origin."""
    start = points[0]
    return [
        [sum((p[i] - start[i]) * axis[i] for i in range(3)) for axis in axes]
        for p in points
    ]


def is_convex(points):
    """Does the outline, run counter-clockwise, never turn right?"""
    n = len(points)
    scale = max(abs(c) for p in points for c in p) ** 2
    for k in range(n):
        (ax, ay), (bx, by), (cx, cy) = points[k - 1], points[k], points[(k + 1) % n]
        if (bx - ax) * (cy - by) - (by - ay) * (cx - bx) < -1e-9 * scale:
            return False
    return True


def size_colour(sizes, size):
    return colour(sizes[size]["color"] if 0 <= size < len(sizes) else "#b0b0b0")


def neighbour_labels(cells, label_of):
    """Labels across the edges, '-' where there is no panel."""
    return " ".join([label_of.get(cell, "-") for cell in cells])


def report(result):
    """The figures as flat text, one per line."""
    panels, quality = result["panels"], result["quality"]
    lines = ["%d panels, %d sizes" % (len(panels["polygons"]), len(result["sizes"]))]
    for row in result["sizes"]:
        lines.append("size %d: edge %.6g, %d panels" % (row["size"], row["edge_length"], row["count"]))
    gap = quality["gap"]["tangential"]
    at = "".join(" at " + panels["label"][k] for k in widest(panels, quality)[:1])
    for text, value in [
        ("covered: %.2f %%", percent(quality["coverage"])),
        ("overlaps: %d", quality["overlaps"]),
        ("gap, mean: %.4g", gap["mean"]),
        ("gap, greatest: %.4g" + at, gap["max"]),
        ("panels at wider gaps than MaxGap: %d", quality["gap"]["over"]),
        ("planarity, worst: %.2g of the edge", quality["planarity"]["max"]),
        ("convex: %.1f %%", percent(quality.get("convex"))),
        ("distance to the surface, greatest: %.4g", quality["surface_distance"]["max"]),
        ("largest over smallest scale: %.4g", quality["scale_ratio"]),
        ("distinct panels: %d", quality["distinct_panels"]),
    ]:
        if value is not None:
            lines.append(text % value)
    return "\n".join(lines + ["note: " + note for note in quality["notes"]])


def percent(fraction):
    return None if fraction is None else 100.0 * fraction


RESULTS = [
    "panels", "labels", "sizes", "colours", "planes", "outlines", "planarity",
    "gaps", "convex", "neighbours", "index", "shapes", "shape_colours", "report", "widest",
]  # fmt: skip


def solve():
    return made_of_job(component, Job, collect, "collected", RESULTS)


component = ghenv.Component
Panels, Labels, Sizes, Colours, Planes, Outlines, Planarity, \
    Gaps, Convex, Neighbours, Index, Shapes, ShapeColours, Report, Widest = solved(component, solve, len(RESULTS))
