"""Meshes that come in parts: what hangs together, what is joined along open edges, what lies apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged, positions
from hexwrap_solver.geometry import dot, face_areas, linked, normalize
from hexwrap_solver.surface.duplicates import equal_faces
from hexwrap_solver.surface.topology import face_graph, half_edges
from hexwrap_solver.surface.triangulate import triangulate
from hexwrap_solver.surface.types import SentMesh, Triangles
from hexwrap_solver.surface.weld import TOLERANCE, coincident, relabelled, weldings
from hexwrap_solver.tolerances import TINY

#: Open edges are divided again where a division has made new ones, at most so often.
ROUNDS = 16
#: Of edges at which more faces than these meet, none of them hang together.
MOST_AROUND = 16
#: Open edges in a heap, near which more open vertices lie than this many in all, are not divided at all.
MOST_NEAR = 20_000_000
#: So many open edges are looked at at a time.
BATCH = 4096
#: Edges lie along each other, and faces on the same side, with at least this cosine.
ALIGNED = 0.9


@dataclass(frozen=True)
class Piece:
    """Faces that hang together across edges, ascending; loops: the number of their boundary curves.

    boundary: (k, 2, 3) the edges on these. is_fin: whether it shares a vertex with a larger piece.
    """

    faces: Ints
    loops: int
    area: float
    low: Floats
    high: Floats
    boundary: Floats
    is_fin: bool = False


@dataclass(frozen=True)
class Joint:
    """What was joined: pairs of vertices, or vertices and edges, that were apart; the greatest distance and
    where it was (3,)."""

    count: int = 0
    gap: float = 0.0
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def worse(self, other: Joint) -> Joint:
        worst = max(self, other, key=lambda joint: joint.gap)
        return Joint(self.count + other.count, worst.gap, worst.place)


def pieces(mesh: SentMesh) -> list[Piece]:
    """The pieces of a mesh whose equal vertices count as one, the largest first. Raises SurfaceError.

    Faces that repeat others belong to the pieces of these. Where more than two faces meet at an edge, as at
    a floor, those two hang together that run straight on, if any do.
    """
    alone, same = np.unique(equal_faces(mesh.vertices, mesh.faces), return_inverse=True)
    triangles, polygon = triangulate(mesh.vertices, only(mesh, alone).faces)
    size = float(np.linalg.norm(np.ptp(mesh.vertices[triangles.ravel()], axis=0)))
    welded = Triangles(mesh.vertices, triangles)
    welded = relabelled(welded, weldings(welded, TOLERANCE * size)[0])
    twin = _straight_on(welded)
    _, piece = connected_components(face_graph(twin), directed=False)
    areas = face_areas(mesh.vertices, triangles)
    # A quad may fall apart where one of its triangles has no area, as at a pole: the other one counts.
    by_size = np.lexsort((-areas, polygon))
    first = by_size[np.flatnonzero(np.diff(polygon, prepend=-1))][same]
    count = int(piece.max()) + 1
    area = np.bincount(piece, areas, count)
    rim = np.flatnonzero(twin < 0)
    start, end = (side[rim] for side in half_edges(welded.faces))
    kept = start != end
    rim, start, end = rim[kept], start[kept], end[kept]
    n = len(mesh.vertices)
    _, loop = linked(start, end, n)
    rank = positions(np.argsort(-area, kind="stable"), count)
    largest = np.full(n, count)
    np.minimum.at(largest, welded.faces, rank[piece][:, None])
    attached = np.bincount(piece, (largest[welded.faces] < rank[piece][:, None]).any(axis=1), count) > 0
    by_piece = np.argsort(piece[first], kind="stable")
    ends = np.searchsorted(piece[first][by_piece], np.arange(count + 1))
    held = np.flatnonzero(np.diff(ends))
    points = mesh.vertices[triangles[first[by_piece]]]
    low = np.minimum.reduceat(points.min(axis=1), ends[held])
    high = np.maximum.reduceat(points.max(axis=1), ends[held])
    owner = piece[rim // 3].astype(np.int64)
    by_owner = np.argsort(owner, kind="stable")
    edges = mesh.vertices[np.stack([start, end], axis=1)[by_owner]]
    rims = np.split(edges, np.searchsorted(owner[by_owner], np.arange(1, count)))
    loops = np.bincount(np.unique(owner * n + loop[start]) // n, minlength=count)
    faces = np.split(by_piece, ends[1:-1])
    found = [
        Piece(faces[k], int(loops[k]), float(area[k]), low[i], high[i], rims[k], bool(attached[k]))
        for i, k in enumerate(held.tolist())
    ]
    return sorted(found, key=lambda piece: -piece.area)


def inner_pieces(mesh: SentMesh) -> list[Piece]:
    """The pieces whose whole boundary lies on others, as that of floors and inner walls does, the largest
    first. Raises SurfaceError."""
    found = pieces(mesh)
    size = float(np.linalg.norm(np.ptp(mesh.vertices[mesh.faces.values], axis=0)))
    where = coincident(mesh.vertices, TOLERANCE * size)
    piece_of = np.empty(mesh.faces.n_rows, dtype=np.int64)
    for k, piece in enumerate(found):
        piece_of[piece.faces] = k
    pairs = np.unique(np.stack([where[mesh.faces.values], piece_of[mesh.faces.row]]), axis=1)
    shared = np.bincount(pairs[0], minlength=len(where))[where] > 1
    tree = cKDTree(mesh.vertices)
    return [
        piece
        for piece in found
        if len(piece.boundary) and shared[tree.query(piece.boundary.reshape(-1, 3))[1]].all()
    ]


def _straight_on(mesh: Triangles) -> Ints:
    """The twins of the half-edges, with those of the two straightest faces where more than two meet."""
    order, first = mesh.edge_groups
    many = np.diff(first)
    twin = mesh.twin.copy()
    is_collapsed = (mesh.faces == mesh.faces[:, [1, 2, 0]]).any(axis=1)
    for size in np.unique(many[(many > 2) & (many <= MOST_AROUND)]).tolist():
        group = order[first[:-1][many == size][:, None] + np.arange(size)]
        inward = _inward(mesh.vertices, mesh.faces, group.ravel()).reshape(*group.shape, 3)
        inward[is_collapsed[group // 3]] = 0  # neither straight on from anything
        cosine = (inward @ inward.transpose(0, 2, 1)).reshape(len(group), -1)
        best, row = cosine.argmin(axis=1), np.arange(len(group))
        straight = cosine[row, best] < -ALIGNED
        one, two = group[row, best // size][straight], group[row, best % size][straight]
        twin[one], twin[two] = two, one
    return twin


def _inward(vertices: Floats, faces: Ints, h: Ints) -> Floats:
    """(k, 3) unit vectors square to half-edges, into their faces."""
    start, end = (side[h] for side in half_edges(faces))
    along = normalize(vertices[end] - vertices[start])
    across = vertices[faces[h // 3, (h + 2) % 3]] - vertices[start]
    return normalize(across - dot(across, along)[:, None] * along)


def only(mesh: SentMesh, faces: Ints) -> SentMesh:
    """Those faces of the mesh; vertices keep their numbers."""
    if len(faces) == mesh.faces.n_rows:
        return mesh
    keep = np.zeros(mesh.faces.n_rows, dtype=bool)
    keep[faces] = True
    return _with_faces(mesh, mesh.faces.take(keep))


def _with_faces(mesh: SentMesh, faces: Ragged) -> SentMesh:
    """The mesh with these faces instead; vertices that only its own ones use count as others'."""
    others = np.zeros(len(mesh.vertices), dtype=bool)
    others[mesh.faces.values] = True
    others[faces.values] = False
    if mesh.others is not None:
        others |= mesh.others
    return SentMesh(mesh.vertices, faces, mesh.normals, others=others)


def together(meshes: Sequence[SentMesh]) -> tuple[SentMesh, Ints]:
    """All of them as one, nothing joined, and which of them each face is from."""
    if len(meshes) == 1:
        return meshes[0], np.zeros(meshes[0].faces.n_rows, dtype=np.int64)
    shift = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    values = np.concatenate([m.faces.values + k for m, k in zip(meshes, shift, strict=False)])
    lengths = np.concatenate([mesh.faces.lengths for mesh in meshes])
    normals = [mesh.normals for mesh in meshes if mesh.normals is not None]
    whole = SentMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        Ragged.of(values.astype(np.int64), lengths),
        np.concatenate(normals) if len(normals) == len(meshes) else None,
    )
    return whole, np.repeat(np.arange(len(meshes)), [mesh.faces.n_rows for mesh in meshes])


def joined(mesh: SentMesh, tolerance: float) -> tuple[SentMesh, Ints, Joint]:
    """The mesh with open edges closed that lie within the tolerance of each other, the face that each of its
    faces comes from, and what was joined.

    Vertices on open edges that lie within the tolerance of each other become one; then open edges are
    divided at vertices on other open edges that lie on them. Raises SurfaceError.
    """
    triangles, polygon = triangulate(mesh.vertices, mesh.faces)
    exact = Triangles(mesh.vertices, triangles)
    size = float(np.linalg.norm(np.ptp(mesh.vertices[triangles.ravel()], axis=0)))
    label = weldings(exact, min(TOLERANCE * size, tolerance))[0]
    near = weldings(relabelled(exact, label), tolerance)[0][label]
    moved = np.flatnonzero(near != label)
    apart = np.linalg.norm(mesh.vertices - mesh.vertices[near], axis=1)
    worst = int(np.argmax(apart))
    joint = Joint(len(moved), float(apart[worst]), _place(mesh.vertices[worst]))
    whole, source, splits = divided(Triangles(mesh.vertices, near[triangles]), polygon, tolerance)
    if joint.count == 0 and splits.count == 0:
        return mesh, np.arange(mesh.faces.n_rows), joint
    faces = whole.faces
    m = mesh.faces.n_rows
    more = np.bincount(source, minlength=m) > np.bincount(polygon, minlength=m)
    kept, split = only(mesh, np.flatnonzero(~more)).faces, more[source]
    values = np.concatenate([near[np.asarray(kept.values, dtype=np.int64)], faces[split].ravel()])
    lengths = np.append(kept.lengths, np.full(int(split.sum()), 3))
    closed = _with_faces(mesh, Ragged.of(values, lengths))
    return closed, np.append(np.flatnonzero(~more), source[split]), joint.worse(splits)


def _place(point: Floats) -> tuple[float, float, float]:
    x, y, z = point.tolist()
    return x, y, z


def divided(mesh: Triangles, source: Ints, tolerance: float) -> tuple[Triangles, Ints, Joint]:
    """The mesh with open edges divided at open vertices that lie on them; source (m,) of its triangles."""
    vertices, joint = mesh.vertices, Joint()
    for _ in range(ROUNDS):
        faces = mesh.faces
        start, end = half_edges(faces)
        rim = np.flatnonzero((mesh.twin < 0) & (start != end))
        h, v, apart = _on_edges(vertices, start[rim], end[rim], tolerance)
        beside = ~_overlap(vertices, faces, rim, h, v) & (v != faces[rim[h] // 3, (rim[h] + 2) % 3])
        h, v, apart = h[beside], v[beside], apart[beside]
        if len(h) == 0:
            break
        one = np.unique(h, return_index=True)[1]
        h, v, apart = h[one], v[one], apart[one]
        joint = joint.worse(Joint(len(h), float(apart.max()), _place(vertices[v[int(np.argmax(apart))]])))
        h, one = rim[h], np.unique(rim[h] // 3, return_index=True)[1]  # one edge of a triangle at a time
        h, v = h[one], v[one]
        face, corner = h // 3, h % 3
        a, b, c = (faces[face, (corner + k) % 3] for k in range(3))
        first = np.stack([a, v, c], axis=1)
        second = np.stack([v, b, c], axis=1)
        faces = np.concatenate([faces, second])
        faces[face] = first
        mesh = Triangles(vertices, faces)
        source = np.concatenate([source, source[face]])
    return mesh, source, joint


def _overlap(vertices: Floats, faces: Ints, rim: Ints, h: Ints, v: Ints) -> Bools:
    """(k,) whether an open edge at the vertex v lies along the open edge h with its face on the same side of
    it: one covers the other, and they are no two sides of a seam."""
    start, end = (side[rim] for side in half_edges(faces))
    along, inward = normalize(vertices[end] - vertices[start]), _inward(vertices, faces, rim)
    covers = np.zeros(len(h), dtype=bool)
    for side in (start, end):
        other = positions(side, len(vertices))[v]
        parallel = np.abs(dot(along[other], along[h])) > ALIGNED
        covers |= (other >= 0) & parallel & (dot(inward[other], inward[h]) > ALIGNED)
    return covers


def _on_edges(vertices: Floats, start: Ints, end: Ints, tolerance: float) -> tuple[Ints, Ints, Floats]:
    """Edges that ends of others lie on, these vertices and their distances. Of each edge what is nearest to
    its middle comes first: divided there, and again, it takes rounds as the logarithm of their number."""
    none = (start[:0], start[:0], vertices[:0, 0])
    among = np.unique(np.concatenate([start, end]))
    if len(among) == 0:
        return none
    tree = cKDTree(vertices[among])
    total, found = 0, [none]
    for first in range(0, len(start), BATCH):
        edge = np.arange(first, min(first + BATCH, len(start)))
        a, along = vertices[start[edge]], vertices[end[edge]] - vertices[start[edge]]
        ball = (a + along / 2, np.linalg.norm(along, axis=1) / 2 + tolerance)
        counts = tree.query_ball_point(*ball, return_length=True)
        total += int(counts.sum())
        if total > MOST_NEAR:  # triangles at random, each across the others: nothing there is a seam
            return none
        near = np.fromiter(chain.from_iterable(tree.query_ball_point(*ball)), np.int64)
        row, v = np.repeat(edge - first, counts), among[near]
        length = np.linalg.norm(along, axis=1)[row]
        share = dot(vertices[v] - a[row], along[row]) / np.maximum(length**2, TINY)
        apart = np.linalg.norm(vertices[v] - a[row] - share[:, None] * along[row], axis=1)
        margin = np.minimum(share, 1 - share) * length
        hit = (apart <= tolerance) & (margin > tolerance) & (v != start[edge][row]) & (v != end[edge][row])
        order = np.flatnonzero(hit)
        order = order[np.lexsort((abs(share[order] - 0.5), row[order]))]
        found.append((edge[row[order]], v[order], apart[order]))
    h, v, apart = (np.concatenate(part) for part in zip(*found, strict=True))
    return h, v, apart
