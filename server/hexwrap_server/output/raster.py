"""A small z-buffer rasterizer for planar polygons, in arrays: no display, no graphics library."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged

#: Samples drawn at a time; bounds the memory that fragments take.
CHUNK = 500_000
#: Polygons seen at a flatter angle than this (sine) cover no sample worth drawing.
EDGE_ON = 1e-4


@dataclass(frozen=True)
class Camera:
    """A pinhole. axes: rows right, down, forward (unit, world); focal: samples; center: principal point."""

    position: Floats
    axes: Floats
    focal: float
    center: tuple[float, float]
    width: int
    height: int

    def see(self, points: Floats) -> Floats:
        """(n, 3) camera coordinates: right, down, depth."""
        return np.asarray((points - self.position) @ self.axes.T)

    def project(self, seen: Floats) -> Floats:
        """(n, 2) image position of camera coordinates."""
        return np.asarray(seen[:, :2] * (self.focal / seen[:, 2:3]) + self.center)

    def rays(self, x: Floats, y: Floats) -> Floats:
        """(…, 3) directions in camera coordinates through image positions, with depth 1."""
        return np.stack(
            [(x - self.center[0]) / self.focal, (y - self.center[1]) / self.focal, np.ones_like(x)], axis=-1
        )


@dataclass(frozen=True)
class Polygons:
    """What is drawn: points in space, rows of points, and for each row a plane through ``anchor``."""

    outline: Ragged
    normal: Floats
    anchor: Floats

    @classmethod
    def of(cls, outline: Ragged) -> Polygons:
        """Planes by Newell's formula through each row's mean, which serves bent polygons too."""
        points, rows, n = np.asarray(outline.values, dtype=float), outline.row, outline.n_rows
        count = np.maximum(outline.lengths, 1)[:, None]
        anchor = np.stack([np.bincount(rows, points[:, i], n) for i in range(3)], axis=1) / count
        arms = points - anchor[rows]
        turn = np.cross(arms, arms[outline.next()])
        normal = np.stack([np.bincount(rows, turn[:, i], n) for i in range(3)], axis=1).astype(float)
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        return cls(outline, np.divide(normal, size, out=np.zeros_like(normal), where=size > 0), anchor)

    def take(self, rows: Bools) -> Polygons:
        """Only the rows that are True."""
        return Polygons(self.outline.take(rows), self.normal[rows], self.anchor[rows])

    def join(self, other: Polygons) -> Polygons:
        """These rows, then the other's."""
        outline = Ragged.chained([self.outline, other.outline])
        return Polygons(
            outline, np.vstack([self.normal, other.normal]), np.vstack([self.anchor, other.anchor])
        )


def planes(camera: Camera, polygons: Polygons) -> Floats:
    """(n, 3) coefficients a, b, c of 1/depth = a·x + b·y + c over the image, zero where seen edge-on."""
    normal = polygons.normal @ camera.axes.T
    anchor = camera.see(polygons.anchor)
    offset = np.sum(normal * anchor, axis=1)
    seen = np.abs(offset) > EDGE_ON * np.linalg.norm(anchor, axis=1)
    a, b = normal[:, 0] / camera.focal, normal[:, 1] / camera.focal
    c = normal[:, 2] - a * camera.center[0] - b * camera.center[1]
    return np.where(seen[:, None], np.stack([a, b, c], axis=1) / np.where(seen, offset, 1.0)[:, None], 0.0)


def draw(camera: Camera, polygons: Polygons) -> tuple[NDArray[np.int32], Floats]:
    """(height, width) row of the nearest polygon at each sample (−1: none), and 1/depth there (0: none).

    A sample belongs to a polygon when its middle lies inside (even–odd rule, so any simple polygon will do).
    All polygons must lie in front of the camera.
    """
    inverse = planes(camera, polygons)
    row, y, first, last = _spans(camera, polygons, np.flatnonzero(np.any(inverse != 0, axis=1)))
    nearest = np.zeros(camera.height * camera.width)
    owner = np.full(camera.height * camera.width, -1, dtype=np.int32)
    ends = np.cumsum(last - first)
    n_samples = int(ends[-1]) if len(ends) else 0
    cuts = np.searchsorted(ends, np.arange(CHUNK, n_samples, CHUNK)).tolist()
    for start, stop in pairwise(sorted({0, *cuts, len(ends)})):
        part = slice(start, stop)
        rows, lines, column = row[part], y[part], first[part]
        length = last[part] - column
        # What changes only from run to run is worked out once per run.
        a, b, c = inverse[rows].T
        start_depth = a * (column + 0.5) + b * (lines + 0.5) + c
        along = np.arange(int(length.sum())) - np.repeat(np.cumsum(length) - length, length)
        depth = np.repeat(start_depth, length) + np.repeat(a, length) * along
        at = np.repeat(lines * camera.width + column, length) + along
        np.maximum.at(nearest, at, depth)
        front = depth >= nearest[at]
        owner[at[front]] = np.repeat(rows, length)[front]
    shape = camera.height, camera.width
    return owner.reshape(shape), nearest.reshape(shape)


def _spans(camera: Camera, polygons: Polygons, rows: Ints) -> tuple[Ints, Ints, Ints, Ints]:
    """Runs of samples inside the given rows: row, line, first and one past the last column."""
    outline = polygons.outline
    flat = camera.project(camera.see(np.asarray(outline.values, dtype=float)))
    wanted = np.zeros(outline.n_rows, dtype=bool)
    wanted[rows] = True
    edge = np.flatnonzero(wanted[outline.row])
    p, q, owner = flat[edge], flat[outline.next()[edge]], outline.row[edge]
    # From the upper end, so that two polygons round the edge between them alike and leave no crack.
    upper = ((p[:, 1] < q[:, 1]) | ((p[:, 1] == q[:, 1]) & (p[:, 0] < q[:, 0])))[:, None]
    p, q = np.where(upper, p, q), np.where(upper, q, p)
    top, bottom = (np.clip(np.ceil(z[:, 1] - 0.5), 0, camera.height).astype(np.int64) for z in (p, q))
    count = bottom - top
    crossing = np.repeat(np.arange(len(edge)), count)
    line = np.arange(len(crossing)) - np.repeat(np.cumsum(count) - count - top, count)
    slope = np.divide(q[:, 0] - p[:, 0], q[:, 1] - p[:, 1], out=np.zeros(len(edge)), where=count > 0)
    x = p[crossing, 0] + slope[crossing] * (line + 0.5 - p[crossing, 1])
    column = np.clip(np.ceil(x - 0.5), 0, camera.width).astype(np.int64)
    # One sort brings the crossings of each row and line together, from left to right.
    reach = camera.width + 1
    slot, column = np.divmod(np.sort((owner[crossing] * camera.height + line) * reach + column), reach)
    slot, first, last = slot[::2], column[::2], column[1::2]
    there = last > first
    return (slot // camera.height)[there], (slot % camera.height)[there], first[there], last[there]
