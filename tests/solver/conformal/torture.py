"""Annuli that are hard on a conformal map: all valid and seeded, named after what is wrong with them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import Delaunay

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.surface import SentMesh, surface_from_mesh
from hexwrap_solver.surface.types import Surface
from tests.solver.conformal.annuli import bump, corners_at, grid, revolution

Random = np.random.Generator


def taken_in(vertices: Floats, faces: Ints) -> Surface:
    """Through the front door, repairs and all."""
    return surface_from_mesh(SentMesh(vertices=vertices, faces=Ragged.from_table(faces)))


def _insert(vertices: Floats, faces: Ints, chosen: Ints, weights: Floats) -> tuple[Floats, Ints]:
    """A vertex inside each chosen face, at barycentric weights (k, 3)."""
    new = len(vertices) + np.arange(len(chosen))
    corner = faces[chosen]
    points = np.einsum("kc,kcd->kd", weights, vertices[corner])
    parts = [np.stack([corner[:, c], corner[:, (c + 1) % 3], new], axis=1) for c in range(3)]
    kept = np.delete(faces, chosen, axis=0)
    return np.concatenate([vertices, points]), np.concatenate([kept, *parts])


def slivers(random: Random) -> Surface:
    """Caps and needles with angles of about 1e-4 degrees, some of them inside others."""
    tower = bump(32, 16)
    vertices, faces = tower.vertices, tower.faces
    for thin in (1e-6, 3e-6, 1e-5):
        chosen = random.choice(len(faces), 60, replace=False)
        s = random.uniform(0.2, 0.8, 60)
        weights = np.stack([s * (1 - thin), (1 - s) * (1 - thin), np.full(60, thin)], axis=1)
        weights = np.take_along_axis(weights, random.permuted(np.tile(np.arange(3), (60, 1)), axis=1), 1)
        vertices, faces = _insert(vertices, faces, chosen, weights)
    return taken_in(vertices, faces)


def graded(random: Random) -> Surface:
    """Edge lengths from 1 down to 1e-4 around random points, by splitting triangles at their centroids."""
    tower = bump(24, 12)
    vertices, faces = tower.vertices, tower.faces
    for _ in range(4):
        face = int(random.integers(len(faces)))
        for _ in range(9):
            vertices, faces = _insert(vertices, faces, np.array([face]), random.dirichlet([4, 4, 4], 1))
            face = len(faces) - 1 - int(random.integers(3))
    return taken_in(vertices, faces)


def graded_plane(random: Random) -> Surface:
    """A dished annulus, its points crowding with 1e4 : 1 to two places of the boundary and one inside."""
    ring = np.exp(2j * np.pi * np.arange(40) / 40)
    points = [2.0 * ring, ring]
    for centre, low in ((2.0, -4.0), (1.0j, -4.0), (-1.5, -4.0)):
        size = 10 ** random.uniform(low, -0.5, 300)
        points.append(centre + size * np.exp(2j * np.pi * random.uniform(size=300)))
    z = np.concatenate(points)
    inside = (np.abs(z) < 2 - 1e-9) & (np.abs(z) > 1 + 1e-9)
    # vertices of the loops come first, so that chords of the circles are their edges
    inside[:80] = True
    z = z[inside]
    polygon = np.cos(np.pi / 40)
    z = np.concatenate([z[:80], z[80:][(np.abs(z[80:]) < 2 * polygon - 1e-5) & (np.abs(z[80:]) > 1.0)]])
    faces = Delaunay(np.stack([z.real, z.imag], axis=1)).simplices.astype(np.int64)
    middle = z[faces].mean(axis=1)
    hole = (faces >= 40).all(axis=1) & (faces < 80).all(axis=1) & (np.abs(middle) < 1)
    faces = faces[~hole]
    a, b, c = z[faces].T
    back = ((b - a).conj() * (c - a)).imag < 0
    faces[back] = faces[back][:, ::-1]
    used, faces = np.unique(faces, return_inverse=True)
    z = z[used]
    return taken_in(np.stack([z.real, z.imag, 0.3 * np.abs(z) ** 2], axis=1), faces.reshape(-1, 3))


def valence(random: Random) -> Surface:
    """Fans instead of patches of a grid: an interior vertex of valence 200, one on the boundary of 100."""
    around, rows = 160, 60
    tower = bump(around, rows)
    vertices, faces = tower.vertices, tower.faces
    column, row = faces % around, faces // around
    shift = int(random.integers(20))

    def fan(low: int, high: int, bottom: int, top: int, centre: int | None) -> None:
        nonlocal vertices, faces, column, row
        c = (column - shift) % around
        inside = ((c >= low) & (c <= high) & (row >= bottom) & (row <= top)).all(axis=1)
        patch = faces[inside]
        half = {(a, b) for f in patch.tolist() for a, b in zip(f, f[1:] + f[:1], strict=True)}
        rim = np.array([e for e in half if (e[1], e[0]) not in half])
        if centre is None:
            centre = len(vertices)
            vertices = np.concatenate([vertices, vertices[np.unique(patch)].mean(axis=0)[None]])
        rim = rim[(rim != centre).all(axis=1)]
        faces = np.concatenate([faces[~inside], np.column_stack([rim, np.full(len(rim), centre)])])
        column, row = faces % around, faces // around
        late = faces >= around * (rows + 1)
        column[late], row[late] = -1000, -1000

    fan(0, 50, 5, 55, None)
    fan(60, 110, 0, 25, (85 + shift) % around)
    kept = np.unique(faces)
    renumber = np.zeros(len(vertices), dtype=np.int64)
    renumber[kept] = np.arange(len(kept))
    return taken_in(vertices[kept], renumber[faces])


def boundary_caps(random: Random) -> Surface:
    """A ring of vertices stands 1e-5 above the middles of the boundary edges, at both ends."""
    steps = np.concatenate([[0, 1e-5], np.linspace(0.1, 0.9, 9), [1 - 1e-5, 1]])

    def place(phi: Floats, s: Floats) -> Floats:
        row = np.rint(s * 12).astype(int)
        turned = phi + np.pi / 24 * (row % 2)
        height = steps[row]
        r = 1 + 0.3 * np.sin(3 * height)
        corner = (row == 0) | (row == 12)
        r = np.where((row == 1) | (row == 11), r * np.cos(np.pi / 24), r)
        jitter = np.where(corner, 0.0, random.uniform(-0.02, 0.02, len(phi)))
        return np.stack([r * np.cos(turned + jitter), r * np.sin(turned + jitter), 2 * height], axis=1)

    surface = grid(24, 12, place, alternate=False)
    return taken_in(surface.vertices, surface.faces)


def one_wide(random: Random) -> Surface:
    """One ring of triangles between loops of 5 and 90 vertices, unevenly spaced."""
    return band(np.sort(random.uniform(0, 2 * np.pi, 5)), np.sort(random.uniform(0, 2 * np.pi, 90)), random)


def one_wide_even(random: Random) -> Surface:
    """One ring of triangles between equal loops, in a random zigzag."""
    angles = np.arange(30) * 2 * np.pi / 30
    return band(angles, angles + 0.05, random)


def band(first: Floats, second: Floats, random: Random) -> Surface:
    """One ring of triangles in a random zigzag between loops with vertices at these angles."""
    n, m = len(first), len(second)
    lower = np.stack([np.cos(first), np.sin(first), np.zeros(n)], axis=1)
    upper = np.stack([1.5 * np.cos(second), 1.2 * np.sin(second), np.full(m, 0.4)], axis=1)
    steps = np.array([0] * n + [1] * m)
    random.shuffle(steps)
    i = j = 0
    faces = []
    for step in steps:
        a, b = i % n, n + j % m
        if step == 0:
            faces.append([a, (i + 1) % n, b])
            i += 1
        else:
            faces.append([a, n + (j + 1) % m, b])
            j += 1
    return taken_in(np.concatenate([lower, upper]), np.array(faces))


def three_vertex_loops(random: Random) -> Surface:
    """A tube of triangles' width: every ring, and so each loop, has three vertices."""
    shape = random.uniform(0.3, 1.5, 41)
    twist = random.uniform(-0.4, 0.4, 41).cumsum()

    def place(phi: Floats, s: Floats) -> Floats:
        row = np.rint(s * 40).astype(int)
        r, a = shape[row], phi + twist[row]
        return np.stack([r * np.cos(a), r * np.sin(a), 0.3 * row], axis=1)

    surface = grid(3, 40, place)
    return taken_in(surface.vertices, surface.faces)


def funnel(random: Random) -> Surface:
    """From a loop of 3 vertices to one of 192 in four bands that double and double again."""
    counts = [3, 12, 48, 192]
    rings, faces, start = [], [], 0
    for k, n in enumerate(counts):
        angle = 2 * np.pi * np.arange(n) / n
        r = 0.2 * 2.5**k * (1 + 0.1 * random.uniform(-1, 1, n))
        rings.append(np.stack([r * np.cos(angle), r * np.sin(angle), np.full(n, 0.5 * k)], axis=1))
        if k:
            m = counts[k - 1]
            below = start - m
            for i in range(n):
                a = below + (i // 4) % m
                faces.append([start + (i + 1) % n, start + i, a][::-1])
                if i % 4 == 3:
                    faces.append([a, below + (i // 4 + 1) % m, start + (i + 1) % n][::-1])
        start += n
    return taken_in(np.concatenate(rings), np.array(faces))


def long_tube(random: Random) -> Surface:
    """500 times as long as around, bent, in quads as wide as long."""
    rows = 6 * 500
    radius = 1 / (2 * np.pi)
    bend = random.uniform(0.5, 1.5)

    def place(phi: Floats, s: Floats) -> Floats:
        r = radius * (1 + 0.2 * np.sin(60 * s))
        return np.stack([r * np.cos(phi) + 30 * np.sin(bend * 3 * s), r * np.sin(phi), 500 * s], axis=1)

    surface = grid(6, rows, place)
    return taken_in(surface.vertices, surface.faces)


def long_tube_coarse(random: Random) -> Surface:
    """500 times as long as around, in 40 rows of long quads."""
    radius = 1 / (2 * np.pi)
    wave = random.uniform(-0.3, 0.3, 41)

    def place(phi: Floats, s: Floats) -> Floats:
        r = radius * (1 + wave[np.rint(40 * s).astype(int)])
        return np.stack([r * np.cos(phi), r * np.sin(phi), 500 * s], axis=1)

    surface = grid(12, 40, place)
    return taken_in(surface.vertices, surface.faces)


def retriangulated(random: Random) -> Surface:
    """A tower after thousands of random edge flips in space."""
    tower = bump(32, 16)
    return taken_in(tower.vertices, random_flips(tower.faces, len(tower.vertices), random, 4000))


def crooked_prism(sides: int, random: Random) -> Surface:
    """A prism of height 2: between neighbouring vertical edges, with vertices at random heights, triangles
    run up in a random zigzag. In its own metric it is a flat cylinder, triangulated far from Delaunay."""
    vertices, columns, faces = [], [], []
    for i in range(sides):
        heights = np.concatenate([[0.0], np.sort(random.uniform(0.05, 1.95, random.integers(5, 12))), [2.0]])
        columns.append(len(vertices) + np.arange(len(heights)))
        angle = 2 * np.pi * i / sides
        vertices += [[np.cos(angle), np.sin(angle), z] for z in heights]
    for left, right in zip(columns, [*columns[1:], columns[0]], strict=True):
        a, b = 0, 0
        for step in random.permutation([0] * (len(left) - 1) + [1] * (len(right) - 1)):
            if step == 0:
                faces.append([left[a], right[b], left[a + 1]])
                a += 1
            else:
                faces.append([left[a], right[b], right[b + 1]])
                b += 1
    return taken_in(np.array(vertices), np.array(faces))


def random_flips(faces: Ints, n: int, random: Random, tries: int) -> Ints:
    """Random edge flips that leave a simplicial surface."""
    rows = faces.tolist()
    face_of = {(a, b): i for i, f in enumerate(rows) for a, b in zip(f, f[1:] + f[:1], strict=True)}
    keys = list(face_of)
    for pick in random.integers(len(keys), size=tries):
        a, b = keys[pick]
        if (a, b) not in face_of or (b, a) not in face_of:
            continue
        one, two = face_of[a, b], face_of[b, a]
        c, d = (next(v for v in rows[f] if v not in (a, b)) for f in (one, two))
        if (c, d) in face_of or (d, c) in face_of or c == d:
            continue
        del face_of[a, b], face_of[b, a]
        rows[one], rows[two] = [a, d, c], [b, c, d]
        face_of.update({(a, d): one, (d, c): one, (c, a): one, (b, c): two, (c, d): two, (d, b): two})
    return np.array(rows)


def noisy(random: Random) -> Surface:
    """A tower whose vertices are off by a third of the edge length in every direction."""
    tower = bump(40, 20)
    return taken_in(tower.vertices + random.normal(scale=0.06, size=tower.vertices.shape), tower.faces)


def far_away(random: Random) -> Surface:
    """A tower of 3 m in millimetres, 1e6 from the origin."""
    tower = bump(40, 20)
    return taken_in(1000 * tower.vertices + random.uniform(0.8e6, 1e6, 3), tower.faces)


def eared(random: Random) -> Surface:
    """Triangles that hang on to the boundary by one edge, on a third of it, and ears on ears."""
    tower = bump(30, 10)
    vertices, faces = tower.vertices, tower.faces
    for _ in range(2):
        half = {(a, b) for f in faces.tolist() for a, b in zip(f, f[1:] + f[:1], strict=True)}
        rim = np.array(sorted(e for e in half if (e[1], e[0]) not in half))
        rim = rim[random.permutation(len(rim))[: len(rim) // 3]]
        a, b = vertices[rim[:, 0]], vertices[rim[:, 1]]
        tip = (a + b) / 2 + 0.1 * np.sign((a + b)[:, 2:] - 2.0) * [0, 0, 1]
        faces = np.concatenate([faces, np.column_stack([rim[:, ::-1], len(vertices) + np.arange(len(rim))])])
        vertices = np.concatenate([vertices, tip])
    return taken_in(vertices, faces)


def steep_cone(random: Random) -> Surface:
    """A plane ring with radii 1 : 1e-4, in even rows: scale factors as far apart."""
    wave = random.uniform(0.0, 0.2)
    place = revolution(lambda s: 1e-4 + (1 - 1e-4) * (1 - s) ** 4, lambda s: wave * np.sin(9 * s))
    surface = grid(16, 24, place)
    return taken_in(surface.vertices, surface.faces)


TORTURE: dict[str, Callable[[Random], Surface]] = {
    f.__name__: f
    for f in (
        slivers,
        graded,
        graded_plane,
        valence,
        boundary_caps,
        one_wide,
        one_wide_even,
        three_vertex_loops,
        funnel,
        long_tube,
        long_tube_coarse,
        retriangulated,
        noisy,
        far_away,
        eared,
        steep_cone,
    )
}


def straight(surface: Surface, random: Random) -> BoundaryCondition:
    return BoundaryCondition()


def entrance(surface: Surface, random: Random) -> BoundaryCondition:
    """4π/3, π/3, 4π/3 at three neighbours of loop 0, or as far apart as the loop allows; loop 1 straight."""
    loop = surface.loops[0]
    start, step = int(random.integers(len(loop))), int(random.integers(1, max(2, len(loop) // 3)))
    return _listed(surface, loop[(start + step * np.arange(3)) % len(loop)], np.array([4, 1, 4]) * np.pi / 3)


def corners(surface: Surface, random: Random) -> BoundaryCondition:
    """One corner of 2π/3 on loop 0, one of 4π/3 on loop 1: a cone of angle π/3."""
    pair = np.array([random.choice(loop) for loop in surface.loops])
    return _listed(surface, pair, np.array([2, 4]) * np.pi / 3)


def densified(surface: Surface, random: Random) -> BoundaryCondition:
    """A small angle of π/6 on loop 0 with 11π/6 next to it, the same on loop 1: figure 7's densification."""
    pairs = [np.roll(loop, -int(random.integers(len(loop))))[:2] for loop in surface.loops]
    return _listed(surface, np.concatenate(pairs), np.array([1, 11, 11, 1]) * np.pi / 6)


def extreme(surface: Surface, random: Random) -> BoundaryCondition:
    """Up to five angles from 0.1 to 6.5 rad per loop that happen to obey Gauss–Bonnet."""
    while True:
        chosen = [
            random.choice(loop, int(random.integers(1, min(6, len(loop)))), replace=False)
            for loop in surface.loops
        ]
        vertices = np.concatenate(chosen)
        angles = random.uniform(0.1, 6.5, len(vertices))
        angles[-1] += (np.pi - angles).sum()
        if 0.1 < angles[-1] < 6.5:
            return _listed(surface, vertices, angles)


def _listed(surface: Surface, vertices: Ints, angles: Floats) -> BoundaryCondition:
    return corners_at(surface.input_vertex[vertices], angles)


def isometric_even(surface: Surface, random: Random) -> BoundaryCondition:
    return BoundaryCondition("isometric", quantum="hex", spread="even")


def isometric_optimal(surface: Surface, random: Random) -> BoundaryCondition:
    return BoundaryCondition("isometric", quantum="hex", spread="optimal")


def isometric_free(surface: Surface, random: Random) -> BoundaryCondition:
    return BoundaryCondition("isometric")


MODES: dict[str, Callable[[Surface, Random], BoundaryCondition]] = {
    f.__name__: f
    for f in (straight, entrance, corners, densified, isometric_even, isometric_optimal, isometric_free)
}
