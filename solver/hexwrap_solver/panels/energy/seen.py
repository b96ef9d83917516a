"""Cells seen along their normals: coordinates in a plane, and heights above it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.geometry import dot, normalize


@dataclass(frozen=True)
class Seen:
    """q cells of p corners. axes: (q, 3, 3) in rows two of the plane and the normal, from which the corners
    run counter-clockwise. x, y, z: (q, p) coordinates along them about the mean of the corners."""

    axes: Floats
    x: Floats
    y: Floats
    z: Floats

    @classmethod
    def of(cls, cells: Floats) -> Seen:
        """cells: (q, p, 3)."""
        spokes = cells - cells.mean(axis=1, keepdims=True)
        sx, sy, sz = np.moveaxis(spokes, 2, 0)
        tx, ty, tz = (np.roll(s, -1, axis=1) for s in (sx, sy, sz))
        normal = np.stack(
            [(sy * tz - sz * ty).sum(1), (sz * tx - sx * tz).sum(1), (sx * ty - sy * tx).sum(1)], axis=1
        )
        normal = normalize(normal)
        first = normalize(spokes[:, 0] - dot(spokes[:, 0], normal)[:, None] * normal)
        axes = np.stack([first, np.cross(normal, first), normal], axis=1)
        x, y, z = np.moveaxis(spokes @ axes.transpose(0, 2, 1), 2, 0)
        return cls(axes, x, y, z)

    @property
    def normal(self) -> Floats:
        return self.axes[:, 2]

    def take(self, cells: Ints) -> Seen:
        return Seen(self.axes[cells], self.x[cells], self.y[cells], self.z[cells])

    def fan(self) -> Floats:
        """(q, p) areas of the triangles from the mean of the corners to the edges."""
        return np.asarray((self.x * np.roll(self.y, -1, axis=1) - np.roll(self.x, -1, axis=1) * self.y) / 2)

    def ears(self) -> Floats:
        """(q, p) areas of the triangles that diagonals cut off at corners."""
        (xa, xb), (ya, yb) = (
            (np.roll(s, -1, axis=1) - s, s - np.roll(s, 1, axis=1)) for s in (self.x, self.y)
        )
        return np.asarray((xb * ya - xa * yb) / 2)

    def heights(self) -> Floats:
        """(q, p) above the plane that is nearest to the corners in the direction of the normal."""
        x, y, z = self.x, self.y, self.z
        xx, xy, yy, xz, yz = ((a * b).sum(axis=1) for a, b in ((x, x), (x, y), (y, y), (x, z), (y, z)))
        size = np.maximum(xx * yy - xy * xy, np.finfo(float).tiny)
        along, across = (yy * xz - xy * yz) / size, (xx * yz - xy * xz) / size
        return np.asarray(z - along[:, None] * x - across[:, None] * y)

    def basis(self) -> Floats:
        """(q, p, p − 3) orthonormal columns: what of heights no motion of a plane can make up for. The plane
        moves along with the corners (variable projection; Golub and Pereyra 1973)."""
        flat = np.stack([np.ones_like(self.x), self.x, self.y], axis=2)
        return np.linalg.qr(flat, mode="complete")[0][:, :, 3:]
