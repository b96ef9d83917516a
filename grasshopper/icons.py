"""The components' icons, 24 × 24, drawn from hexagons. Written by ``build.py`` to ``src/<Name>/icon.png``.

Shapes live in a square of 24 units, x to the right and y down; each pixel is the mean of 64 samples.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Points = Sequence[tuple[float, float]]
Colour = tuple[int, int, int]
Mask = NDArray[np.bool_]

SIZE, FINE = 24, 8
INK: Colour = (38, 50, 56)
TEAL: Colour = (0, 137, 123)
SKY: Colour = (79, 195, 247)
AMBER: Colour = (255, 179, 0)
CORAL: Colour = (244, 81, 30)
PALE: Colour = (224, 242, 241)
WHITE: Colour = (255, 255, 255)


class Canvas:
    """Layers of flat colour, later ones on top."""

    def __init__(self) -> None:
        n = SIZE * FINE
        # The samples stand off the lines that shapes are drawn along, so no rounding decides a pixel.
        ticks = (np.arange(n) + 0.5037) / FINE
        self.x, self.y = np.meshgrid(ticks, ticks)
        self.rgb = np.zeros((n, n, 3))
        self.alpha = np.zeros((n, n), dtype=bool)

    def paint(self, mask: Mask, colour: Colour) -> None:
        self.rgb[mask] = colour
        self.alpha |= mask

    def polygon(self, points: Points, colour: Colour) -> None:
        """A polygon, filled; it need not be convex."""
        inside = np.zeros(self.x.shape, dtype=bool)
        for (ax, ay), (bx, by) in zip(points, [*points[1:], points[0]], strict=True):
            if ay != by:
                crossing = (ay > self.y) != (by > self.y)
                inside ^= crossing & (self.x < (bx - ax) * (self.y - ay) / (by - ay) + ax)
        self.paint(inside, colour)

    def line(self, points: Points, width: float, colour: Colour) -> None:
        """A polyline with round joins and ends."""
        near = np.zeros(self.x.shape, dtype=bool)
        for (ax, ay), (bx, by) in pairwise(points):
            dx, dy = bx - ax, by - ay
            t = np.clip(((self.x - ax) * dx + (self.y - ay) * dy) / (dx * dx + dy * dy), 0.0, 1.0)
            near |= (self.x - ax - t * dx) ** 2 + (self.y - ay - t * dy) ** 2 < (width / 2) ** 2
        self.paint(near, colour)

    def ring(self, points: Points, width: float, colour: Colour) -> None:
        self.line([*points, points[0]], width, colour)

    def dot(self, x: float, y: float, radius: float, colour: Colour) -> None:
        self.paint((self.x - x) ** 2 + (self.y - y) ** 2 < radius**2, colour)

    def pixels(self) -> NDArray[np.uint8]:
        """(24, 24, 4) red, green, blue, opacity."""
        blocks = (SIZE, FINE, SIZE, FINE)
        weight = self.alpha.reshape(blocks).sum(axis=(1, 3))
        total = (self.rgb * self.alpha[..., None]).reshape(*blocks, 3).sum(axis=(1, 3))
        colour = np.rint(total / np.maximum(weight, 1)[..., None])
        opacity = np.rint(weight * 255 / FINE**2)
        return np.concatenate([colour, opacity[..., None]], axis=2).astype(np.uint8)


def png(pixels: NDArray[np.uint8]) -> bytes:
    """A PNG file of (rows, columns, 4) bytes."""
    rows, columns, _ = pixels.shape
    lines = b"".join(b"\x00" + row.tobytes() for row in pixels)
    header = struct.pack(">2I5B", columns, rows, 8, 6, 0, 0, 0)
    parts = [(b"IHDR", header), (b"IDAT", zlib.compress(lines, 9)), (b"IEND", b"")]
    chunks = [
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def hexagon(x: float, y: float, radius: float, turn: float = 0.0) -> list[tuple[float, float]]:
    """Corners; without a turn one of them points upward."""
    angles = np.deg2rad(np.arange(6) * 60 - 90 + turn)
    return [(float(x + radius * np.cos(a)), float(y + radius * np.sin(a))) for a in angles]


def arc(x: float, y: float, radius: float, start: float, end: float) -> list[tuple[float, float]]:
    angles = np.deg2rad(np.linspace(start, end, 25))
    return [(float(x + radius * np.cos(a)), float(y + radius * np.sin(a))) for a in angles]


def _tile(canvas: Canvas, colour: Colour) -> None:
    canvas.polygon(hexagon(12, 12, 11.4), INK)
    canvas.polygon(hexagon(12, 12, 9.9), colour)


def _send(c: Canvas) -> None:
    _tile(c, TEAL)
    c.line([(6.2, 12), (14.5, 12)], 2.6, WHITE)
    c.polygon([(12.6, 6.6), (18.8, 12), (12.6, 17.4)], WHITE)


def _collect(c: Canvas) -> None:
    for (x, y), colour in zip([(12, 6.2), (6.9, 15.4), (17.1, 15.4)], [AMBER, TEAL, SKY], strict=True):
        c.polygon(hexagon(x, y, 5.9), INK)
        c.polygon(hexagon(x, y, 4.6), colour)


def _angles(c: Canvas) -> None:
    c.polygon([(3.0, 20.6), (21.0, 20.6), (12.2, 5.4)], PALE)
    wedge = (c.x - 3) ** 2 + (c.y - 20.6) ** 2 < 8.6**2
    c.paint(wedge & (c.y < 20.6) & (c.y - 20.6 > -1.7273 * (c.x - 3)), AMBER)
    c.line(arc(3.0, 20.6, 8.6, -60, 0), 1.5, CORAL)
    c.line([(12.6, 4.0), (3.0, 20.6), (21.4, 20.6)], 2.0, INK)
    c.polygon(hexagon(3.0 + 1.2, 20.6 - 0.9, 3.2), INK)
    c.polygon(hexagon(3.0 + 1.2, 20.6 - 0.9, 1.9), CORAL)


def _pattern(c: Canvas) -> None:
    step = 7.4
    centres = [(12.0, 12.0), *hexagon(12, 12, step, 30)]
    for x, y in centres:
        c.polygon(hexagon(x, y, step / 1.7320508), PALE)
    c.polygon(hexagon(12, 12, step / 1.7320508), TEAL)
    for x, y in centres:
        c.ring(hexagon(x, y, step / 1.7320508), 1.2, INK)


def _panels(c: Canvas) -> None:
    rows = [(6.4, 6.6, 5.6, AMBER), (16.9, 6.0, 4.9, SKY), (12.0, 15.3, 5.2, TEAL)]
    rows += [(21.2, 14.9, 2.4, CORAL), (3.7, 16.2, 2.7, CORAL)]
    for x, y, radius, colour in rows:
        c.polygon(hexagon(x, y, radius), INK)
        c.polygon(hexagon(x, y, radius - 1.2), colour)
    c.polygon(hexagon(20.0, 20.9, 2.4), INK)
    c.polygon(hexagon(20.0, 20.9, 1.3), AMBER)


def _domain(c: Canvas) -> None:
    outer, inner = arc(12, 27.5, 24, -118, -62), arc(12, 27.5, 9.5, -62, -118)
    c.polygon([*outer, *inner], PALE)
    c.polygon(hexagon(12, 10.7, 4.4, 30), SKY)
    c.ring(hexagon(12, 10.7, 4.4, 30), 1.2, INK)
    c.line([(16.4, 10.7), (20.2, 9.6)], 1.2, INK)
    c.line([(7.6, 10.7), (3.8, 9.6)], 1.2, INK)
    c.ring([*outer, *inner], 1.7, INK)


def _lift(c: Canvas) -> None:
    c.polygon([(1.2, 22.4), (6.0, 15.8), (22.8, 15.8), (18.0, 22.4)], PALE)
    c.ring([(1.2, 22.4), (6.0, 15.8), (22.8, 15.8), (18.0, 22.4)], 1.3, INK)
    c.line(arc(12, 19.1, 3.6, 0, 360), 1.3, CORAL)
    c.line([(12, 17.6), (12, 9.6)], 2.0, INK)
    c.polygon([(8.4, 10.8), (12, 5.6), (15.6, 10.8)], INK)
    c.line(arc(12, 15.5, 13.2, -140, -40), 2.4, TEAL)


def _support(c: Canvas) -> None:
    c.polygon(hexagon(12, 12, 11.4), INK)
    c.polygon(hexagon(12, 12, 9.9), PALE)
    for x, y in hexagon(12, 12, 9.2)[1::2]:
        c.line([(12, 12), (x, y)], 4.2, INK)
    for x, y in hexagon(12, 12, 9.0)[1::2]:
        c.line([(12, 12), (x, y)], 2.0, AMBER)
    c.dot(12, 12, 3.4, INK)
    c.dot(12, 12, 2.1, CORAL)


def _server(c: Canvas) -> None:
    _tile(c, PALE)
    c.line(arc(12, 12.4, 5.3, -50, 230), 2.2, CORAL)
    c.line([(12, 5.6), (12, 11.8)], 2.4, INK)


def _bake(c: Canvas) -> None:
    c.polygon(hexagon(12, 7.6, 6.6, 30), TEAL)
    c.ring(hexagon(12, 7.6, 6.6, 30), 1.5, INK)
    c.line([(12, 6.2), (12, 16.2)], 2.2, WHITE)
    c.polygon([(7.8, 13.6), (12, 19.2), (16.2, 13.6)], AMBER)
    c.ring([(7.8, 13.6), (12, 19.2), (16.2, 13.6)], 1.0, INK)
    c.line([(2.2, 17.2), (2.2, 22.2), (21.8, 22.2), (21.8, 17.2)], 2.0, INK)


def _singularities(c: Canvas) -> None:
    five = [(12 + 5.6 * np.cos(a), 12.4 + 5.6 * np.sin(a)) for a in np.deg2rad(np.arange(5) * 72 - 90)]
    out = [(12 + 11.0 * np.cos(a), 12.4 + 11.0 * np.sin(a)) for a in np.deg2rad(np.arange(5) * 72 - 90)]
    c.polygon(out, PALE)
    c.ring(out, 1.5, INK)
    for a, b in zip(five, out, strict=True):
        c.line([a, b], 1.5, INK)
    c.polygon(five, CORAL)
    c.ring(five, 1.5, INK)


def _explore(c: Canvas) -> None:
    c.line([(3.5, 3), (3.5, 20.5), (21.5, 20.5)], 1.6, INK)
    for x, y, colour in ((7, 6, SKY), (9.5, 11.5, SKY), (14, 14.5, AMBER), (19, 16.5, SKY)):
        corner = [(x + 2.9 * np.cos(a), y + 2.9 * np.sin(a)) for a in np.deg2rad(np.arange(6) * 60)]
        c.polygon(corner, colour)
        c.ring(corner, 1.1, INK)


DRAWINGS = {
    "Bake": _bake,
    "BoundaryAngles": _angles,
    "Collect": _collect,
    "Domain": _domain,
    "Explore": _explore,
    "Lift": _lift,
    "Panels": _panels,
    "Pattern": _pattern,
    "Send": _send,
    "Singularities": _singularities,
    "StartServer": _server,
    "Support": _support,
}


def icon(name: str) -> bytes:
    """The PNG file of a component; KeyError for a component without a drawing."""
    canvas = Canvas()
    DRAWINGS[name](canvas)
    return png(canvas.pixels())
