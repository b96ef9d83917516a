"""The wire contract as a checker: what a stranger can verify about a Result from the JSON alone.

Nothing here imports the product. Each function returns sentences that say what is violated; none: it holds.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import Any

import numpy as np
import shapely

Json = dict[str, Any]


def _deck(result: Json):
    deck = result["map"]["deck"]
    rotation = np.exp(1j * deck["angle"])
    shift = complex(*deck["translation"])
    if abs(rotation - 1) < 1e-9:
        return lambda z, s: z + s * shift
    apex = shift / (1 - rotation)
    return lambda z, s: apex + np.exp(1j * deck["angle"] * np.asarray(s)) * (z - apex)


def corners(result: Json) -> np.ndarray:
    """(m, 3) complex places of the corners of every mesh face."""
    if result["map"]["kind"] == "net":
        z = np.array(result["map"]["corners"])
        return z[..., 0] + 1j * z[..., 1]
    uv = np.array(result["map"]["uv"])
    uv = uv[:, 0] + 1j * uv[:, 1]
    return _deck(result)(uv[np.array(result["mesh"]["faces"])], np.array(result["map"]["sheet"]))


def check_mesh(result: Json) -> list[str]:
    """An oriented surface of genus 0 with the loops as the contract describes them."""
    bad = []
    mesh = result["mesh"]
    faces = np.array(mesh["faces"])
    n = len(mesh["vertices"])
    half = Counter((a, b) for f in mesh["faces"] for a, b in zip(f, f[1:] + f[:1], strict=True))
    if max(half.values()) > 1:
        bad.append("an oriented edge occurs twice")
    edges = {(min(e), max(e)) for e in half}
    if n - len(edges) + len(faces) != 2 - len(mesh["loops"]):
        bad.append(f"Euler characteristic {n - len(edges) + len(faces)} with {len(mesh['loops'])} loops")
    boundary = {e for e in half if (e[1], e[0]) not in half}
    listed = {(a, b) for loop in mesh["loops"] for a, b in zip(loop, loop[1:] + loop[:1], strict=True)}
    if listed != boundary:
        bad.append("loops are not the boundary with the surface on their left")
    if len(mesh["loops"]) != 2:
        return bad
    sent = [mesh["input_vertex"][v] for loop in mesh["loops"] for v in loop]
    real = [s for s in sent if s >= 0]
    first = {mesh["input_vertex"][v] for v in mesh["loops"][0]}
    if real and min(real) not in first:
        bad.append("loop 0 does not hold the lowest sent vertex of the boundary")
    return bad


def check_map(result: Json) -> list[str]:
    """Positive faces, edges shared up to one power of g (on nets: up to a motion that turns by a multiple of
    the quantum), angle sums, Gauss–Bonnet, edge lengths."""
    bad = []
    m = result["map"]
    vertices = np.array(result["mesh"]["vertices"])
    faces = np.array(result["mesh"]["faces"])
    z = corners(result)
    area = ((z[:, 1] - z[:, 0]).conj() * (z[:, 2] - z[:, 0])).imag / 2
    if (area <= 0).any():
        bad.append(f"{int((area <= 0).sum())} faces are not positively oriented")
    where: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
    for f, face in enumerate(result["mesh"]["faces"]):
        for k in range(3):
            a, b = face[k], face[(k + 1) % 3]
            where[min(a, b), max(a, b)].append((f, k))
    net = m["kind"] == "net"
    if net:
        bad += _check_motions(z, faces, where, result["pattern"])
    sheet, of = None if net else m["sheet"], result["mesh"]["faces"]
    for (a, b), places in [] if net else where.items():
        if len(places) == 2:
            (f, k), (h, j) = places
            step = sheet[h][(j + 1) % 3] - sheet[f][k] if of[h][j] != of[f][k] else sheet[h][j] - sheet[f][k]
            other = (j, (j + 1) % 3) if of[h][j] != of[f][k] else ((j + 1) % 3, j)
            step2 = sheet[h][other[0]] - sheet[f][(k + 1) % 3]
            if step != step2:
                bad.append(f"faces {f} and {h} disagree on edge {a}–{b} by more than one power of g")
                break
    angle = np.angle((np.roll(z, -2, 1) - z) / (np.roll(z, -1, 1) - z))
    total = np.bincount(faces.ravel(), angle.ravel(), minlength=len(vertices))
    loops = [np.array(loop) for loop in result["mesh"]["loops"]]
    inside = np.setdiff1d(np.arange(len(vertices)), np.concatenate([*loops, []]))
    wanted = np.full(len(vertices), 2 * np.pi)
    for cone in m["cones"]:
        wanted[cone["vertex"]] -= cone["index"] * _quantum(result["pattern"])
    if len(inside) and (worst := np.abs(total - wanted)[inside].max()) > 1e-6:
        bad.append(f"interior angle sums miss 2π, or 2π − k·quantum at cones, by {worst:.2e}")
    for loop, angles in zip(loops, m["boundary_angles"], strict=True):
        if (worst := np.abs(total[loop] - np.array(angles)).max()) > 1e-6:
            bad.append(f"boundary angle sums differ from boundary_angles by {worst:.2e}")
    kappa = [float(np.sum(np.pi - np.array(a))) for a in m["boundary_angles"]]
    curved = sum(kappa) + sum(2 * np.pi - wanted)
    # Openings that were cut out of a wall have the angles that the wall has there.
    if abs(curved - 2 * np.pi * (2 - len(loops))) > 1e-6:
        bad.append(f"Gauss–Bonnet: loop sums {kappa}, cones {m['cones']}")
    if net:
        return bad + _check_lengths(m, vertices, faces, z)
    if abs(kappa[0] - m["cone_angle"]) > 1e-6 or abs(m["deck"]["angle"] - m["cone_angle"]) > 1e-9:
        bad.append(f"K is {m['cone_angle']}, loop 0 sums to {kappa[0]}, deck has {m['deck']['angle']}")
    bad += _check_lengths(m, vertices, faces, z)
    # one turn: a loop's edges add up to g
    boundary = {}
    for places in where.values():
        if len(places) == 1:
            f, k = places[0]
            boundary[int(faces[f][k])] = int(sheet[f][(k + 1) % 3] - sheet[f][k])
    turns = [sum(boundary[int(v)] for v in loop) for loop in loops]
    if sorted(turns[:2]) != [-1, 1] or any(turns[2:]):
        bad.append(f"the loops turn {turns} times, wanted ±1")
    return bad


def _quantum(pattern: Json | None) -> float:
    square = ("quad", "diamond", "truncated-square")
    return np.pi / 2 if pattern is not None and pattern["kind"] in square else np.pi / 3


def _check_motions(z: np.ndarray, faces: np.ndarray, where: dict, pattern: Json | None) -> list[str]:
    """Across an interior edge the two images differ by a motion that turns by a multiple of the quantum."""
    pairs = np.array([places for places in where.values() if len(places) == 2]).reshape(-1, 4)
    f, k, h, j = pairs.T
    here, there = z[f, (k + 1) % 3] - z[f, k], z[h, j] - z[h, (j + 1) % 3]
    bad = []
    if (faces[f, k] != faces[h, (j + 1) % 3]).any():
        bad.append("faces that share an edge do not run along it in opposite senses")
    if (worst := np.abs(np.abs(here) / np.abs(there) - 1).max()) > 1e-6:
        bad.append(f"the two images of an edge differ in length by {worst:.2e}")
    steps = np.angle(here / there) / _quantum(pattern)
    if (worst := np.abs(steps - np.rint(steps)).max()) > 1e-6:
        bad.append(f"a motion across an edge turns by {worst:.2e} quanta more than a multiple")
    return bad


def _check_lengths(m: Json, vertices: np.ndarray, faces: np.ndarray, z: np.ndarray) -> list[str]:
    """Edges have the length e^((u_i + u_j)/2)·l_ij where nothing was flipped."""
    u = np.array(m["log_scale"])
    for k in range(3) if m["flips"] == 0 else ():
        i, j = faces[:, k], faces[:, (k + 1) % 3]
        want = np.exp((u[i] + u[j]) / 2) * np.linalg.norm(vertices[i] - vertices[j], axis=1)
        have = np.abs(z[:, (k + 1) % 3] - z[:, k])
        if (worst := np.abs(have / want - 1).max()) > 1e-6:
            return [f"an edge's length differs from e^((u_i+u_j)/2)·l by {worst:.2e}"]
    return []


def check_pattern(result: Json, whole: bool = True) -> list[str]:
    """A closed mesh of cells, neighbours symmetric, counter-clockwise from outside."""
    bad = []
    p = result["pattern"]
    faces = p["faces"]
    half: dict[tuple[int, int], tuple[int, int]] = {}
    for f, face in enumerate(faces):
        for k, v in enumerate(face):
            key = (v, face[(k + 1) % len(face)])
            if key in half:
                bad.append(f"cells {half[key][0]} and {f} run along the same edge in the same sense")
                return bad
            half[key] = (f, k)
    for (a, b), (f, k) in half.items():
        other = half.get((b, a), (-1, -1))[0]
        if p["neighbours"][f][k] != other:
            bad.append(f"neighbours[{f}][{k}] is {p['neighbours'][f][k]}, the mesh says {other}")
            break
    used = {v for face in faces for v in face}
    degree = Counter(v for face in faces for v in face)
    rim = {v for (a, b) in half if (b, a) not in half for v in (a, b)}
    regular = {"hex": 3, "triangle": 6, "quad": 4}[p["kind"]]
    if all(p["whole"]) and any(degree[v] != regular for v in used - rim):
        bad.append(f"nodes inside that are not of degree {regular}")
    edges = {tuple(sorted(e)) for e in half}
    if used != set(range(len(p["vertices"]))):
        bad.append("vertices that belong to no cell")
    euler, loops = len(used) - len(edges) + len(faces), len(result["mesh"]["loops"])
    if whole and euler != 2 - loops:
        bad.append(f"the pattern's Euler characteristic is {euler}, the surface has {loops} loops")
    sides = {"hex": 6, "triangle": 3, "quad": 4}[p["kind"]]
    x = np.array(p["vertices"])
    n = np.array(p["normals"])
    against = 0
    for face, is_whole, index in zip(faces, p["whole"], p["index"], strict=True):
        if is_whole and len(face) != sides - index:
            bad.append(f"a whole cell of index {index} has {len(face)} corners")
            break
        q = x[face]
        area = np.cross(q - q[0], np.roll(q, -1, 0) - q[0]).sum(0)
        against += bool(area @ n[face].sum(0) <= 0)
    if against:
        bad.append(f"{against} cells do not run counter-clockwise seen from outside")
    return bad


def check_panels(result: Json, *, regular: bool = True, overlap_free: bool = True) -> list[str]:
    """Whole cells are planar and regular to 1e-9 ℓ, sizes are those listed, neighbours do not overlap."""
    bad = []
    p = result["panels"]
    table = {s["size"]: s["edge_length"] for s in result["sizes"]}
    lengths = np.array(p["edge_length"])
    inward, pattern_normals = 0, np.array(result["pattern"]["normals"])
    outward = np.array([pattern_normals[result["pattern"]["faces"][f]].sum(0) for f in p["face"]])
    for panel, q in by_corners(p["polygons"]):
        after, n = np.roll(q, -1, axis=1), np.array(p["normal"])[panel]
        area = np.cross(q - q[:, :1], after - q[:, :1]).sum(axis=1)
        is_out = ((area * n).sum(1) > 0) & ((n * outward[panel]).sum(1) > 0)
        inward += int((~is_out | (np.abs(np.linalg.norm(n, axis=1) - 1) > 1e-9)).sum())
        if not regular:
            continue
        length, spread = lengths[panel], np.abs(q).max(axis=(1, 2))
        edge = np.linalg.norm(after - q, axis=2)
        centred = q - q.mean(axis=1, keepdims=True)
        height = np.einsum("pci,pi->pc", centred, np.linalg.svd(centred)[2][:, 2])
        a, b = after - q, np.roll(q, 1, axis=1) - q
        cos = (a * b).sum(2) / (np.linalg.norm(a, axis=2) * np.linalg.norm(b, axis=2))
        off = np.abs(cos + np.cos(2 * np.pi / q.shape[1])).max(1)  # −cos of the exterior angle
        worst = np.max([np.abs(edge - length[:, None]).max(1), np.abs(height).max(1), length * off], axis=0)
        slack = 1e-9 * np.maximum(length, 1e-10 * spread) + 4e-16 * spread * 8
        for i in np.flatnonzero(np.array(p["whole"])[panel] & (worst > slack))[:1]:
            bad.append(f"panel {p['label'][panel[i]]} is off by {worst[i] / length[i]:.2e} ℓ")
    for label, size, length, whole in zip(p["label"], p["size"], p["edge_length"], p["whole"], strict=True):
        if regular and whole and size in table and abs(table[size] - length) > 1e-9 * length:
            bad.append(f"panel {label} has ℓ = {length}, its class {table[size]}")
            break
    if inward:
        bad.append(f"{inward} panels or their normals do not look outward")
    counts = Counter(p["size"])
    for s in result["sizes"]:
        if counts[s["size"]] != s["count"]:
            bad.append(f"size {s['size']} lists {s['count']} panels, {counts[s['size']]} have it")
    if len(set(p["label"])) != len(p["label"]):
        bad.append("labels repeat")
    if overlap_free:
        bad += overlaps(result)
    return bad


def by_corners(polygons: list[list[list[float]]]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Indices (k,) of the polygons with as many corners, and these (k, corners, 3)."""
    count = np.array([len(polygon) for polygon in polygons])
    groups = [np.flatnonzero(count == n) for n in np.unique(count)]
    return [(group, np.array([polygons[i] for i in group])) for group in groups]


def check_quality(result: Json) -> list[str]:
    """``quality`` against what the returned arrays themselves say."""
    p, pattern, said = result["panels"], result["pattern"], result["quality"]
    polygons = [np.array(polygon) for polygon in p["polygons"]]
    planarity, edges, angles = [], [], []
    for q in polygons:
        edge = np.roll(q, -1, 0) - q
        length = np.linalg.norm(edge, axis=1)
        normal = np.linalg.svd(q - q.mean(0))[2][2]
        planarity.append(np.abs((q - q.mean(0)) @ normal).max() / length.mean())
        edges.append(np.abs(length / length.mean() - 1).max())
        outward = np.cross(q - q[0], edge).sum(0)
        back = -np.roll(edge, 1, 0)
        turn = np.arctan2(np.cross(edge, back) @ outward / np.linalg.norm(outward), (edge * back).sum(1))
        angles.append(np.abs(turn % (2 * np.pi) - (len(q) - 2) * np.pi / len(q)).max())
    u = result["map"]["log_scale"]
    vertices = np.array(pattern["vertices"])
    cells = [vertices[face] for face in pattern["faces"]]
    found = {
        ("scale_ratio",): np.exp(max(u) - min(u)),
        ("planarity", "max"): max(planarity),
        ("planarity", "mean"): np.mean(planarity),
        ("edge_deviation", "max"): max(edges),
        ("angle_deviation", "max"): max(angles),
        ("coverage",): sum(map(_area, polygons)) / sum(map(_area, cells)),
        ("gap", "tangential", "min"): min(_gaps(result), default=None),
    }
    bad = []
    for path, mine in found.items():
        theirs: Any = said
        for name in path:
            theirs = theirs[name]
        if (mine is None) != (theirs is None) or (mine is not None and abs(mine - theirs) > 1e-6):
            bad.append(f"quality.{'.'.join(path)} is {theirs}, the panels say {mine}")
    if (said["overlaps"] > 0) != bool(overlaps(result)):
        bad.append(f"quality.overlaps is {said['overlaps']}, the panels say {overlaps(result) or 'none'}")
    return bad


def _area(q: np.ndarray) -> float:
    """Of the triangles around the middle."""
    middle = q.mean(0)
    return float(np.linalg.norm(np.cross(q - middle, np.roll(q, -1, 0) - middle), axis=1).sum() / 2)


def _gaps(result: Json) -> list[float]:
    """Widths between facing edges of neighbours that do not overlap, seen along the mean of their normals."""
    p, pattern = result["panels"], result["pattern"]
    of = {f: i for i, f in enumerate(p["face"])}
    widths = []
    for f, row in enumerate(pattern["neighbours"]):
        for k, h in enumerate(row):
            if h < f or f not in of or h not in of:
                continue
            face, other = pattern["faces"][f], pattern["faces"][h]
            a, b = face[k], face[(k + 1) % len(face)]
            j = next((j for j, v in enumerate(other) if v == b and other[(j + 1) % len(other)] == a), None)
            if j is None:  # no neighbour there, which check_pattern tells
                continue
            axis = np.array(p["normal"][of[f]]) + np.array(p["normal"][of[h]])
            axis /= np.linalg.norm(axis)
            e1 = np.linalg.svd(axis[None])[2][1]
            frame = np.stack([e1, np.cross(axis, e1)], axis=1)
            sides = []
            for panel, corner in ((of[f], k), (of[h], j)):
                q = np.array(p["polygons"][panel])
                sides.append(shapely.LineString(q[[corner, (corner + 1) % len(q)]] @ frame))
            widths.append(float(sides[0].distance(sides[1])))
    return widths


def overlaps(result: Json) -> list[str]:
    """Pairs of neighbours that share more than 1e-9 ℓ² seen along the mean of their normals."""
    p, pattern = result["panels"], result["pattern"]
    of = {f: i for i, f in enumerate(p["face"])}
    pairs = {
        tuple(sorted((of[f], of[h])))
        for f, row in enumerate(pattern["neighbours"])
        for h in row
        if h >= 0 and f in of and h in of and h != f
    }
    if not pairs:
        return []
    pair = np.array(sorted(pairs))
    normal, center, length = (np.array(p[name]) for name in ("normal", "center", "edge_length"))
    axis = normal[pair].sum(axis=1)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    e1 = np.cross(axis, np.where(np.abs(axis[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    frame, origin = np.stack([e1, np.cross(axis, e1)], axis=2), center[pair[:, 0]]
    flat = np.empty(pair.shape, dtype=object)
    for panel, q in by_corners(p["polygons"]):
        row = np.full(len(p["polygons"]), -1)
        row[panel] = np.arange(len(panel))
        at, side = np.nonzero(row[pair] >= 0)
        flat[at, side] = shapely.polygons((q[row[pair[at, side]]] - origin[at, None]) @ frame[at])
    shared = shapely.area(shapely.intersection(flat[:, 0], flat[:, 1]))
    count = int((shared > 1e-9 * length[pair].min(axis=1) ** 2).sum())
    return [f"{count} pairs of neighbours overlap"] if count else []
