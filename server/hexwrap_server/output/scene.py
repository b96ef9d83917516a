"""Panels before their surface, in sun and sky light, with soft shadows and fine outlines, on white ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from hexwrap_server.output.colours import encoded, from_hex, linear
from hexwrap_server.output.raster import Camera, Polygons, draw, planes
from hexwrap_solver.arrays import Floats

#: Pixels: the model is fitted into this box, with room around it for its shadow on the ground.
HEIGHT, WIDTH, MARGIN = 1600, 1460, 100
#: Samples per pixel and direction.
FINE = 2
#: Degrees: small, so that parallels stay nearly parallel.
FIELD = 22.0
#: The sun, relative to the view: right, up, towards the viewer. Its distance in radii of the model.
SUN, SUN_DISTANCE = (-0.52, 0.62, 0.72), 40.0
#: Samples of the map of distances from the sun; how much nearer, in radii, a thing must be to cast a shadow.
SUN_MAP, BIAS = 700, 0.014
#: Places looked up for a shadow, and the blur of its edge in samples of the map: on the model, and on the
#: ground, where it is so soft that a coarser grid of pixels is enough.
TAPS, PENUMBRA = 6, 2.2
GROUND_TAPS, GROUND_BLUR, GROUND_STEP = 24, 15.0, 6
SUNLIGHT, SKYLIGHT, GLOSS, GLOSS_EXPONENT = 0.70, 0.52, 0.10, 40.0
#: The backs of the panels keep this much of their colour.
SHELL, BACK, BACK_COLOUR = "#4a4f58", "#b3b0ab", 0.25
#: How far behind the shell a panel is still seen, in parts of its radius.
DIP = 0.6
#: What is left of the light on an outline; the panel width in pixels from which outlines have full strength.
OUTLINE, OUTLINE_FULL = 0.40, 22.0
#: Steps of light that are distinguished before it becomes colour.
SHADES = 4096
#: Darkest shadow on the ground; it fades towards the rim of the picture over this many pixels.
GROUND_SHADOW, FADE = 0.32, 220.0


@dataclass(frozen=True)
class Scene:
    """panels: one sRGB colour each. shell: what is seen between them. view: unit vector towards the viewer.

    Coordinates are relative to the model's middle; z is up.
    """

    panels: Polygons
    colour: Floats
    shell: Polygons
    view: Floats


def render(scene: Scene) -> NDArray[np.uint8]:
    """(height, width, 3) sRGB on white."""
    points: Floats = np.vstack([scene.panels.outline.values, scene.shell.outline.values]).astype(float)
    radius = float(np.linalg.norm(points, axis=1).max())
    camera = _camera(points, radius, scene.view)
    # From inside one sees the backs of the panels; the shell shows only its outside.
    facing = np.sum(scene.shell.normal * (camera.position - scene.shell.anchor), axis=1) > 0
    shell = scene.shell.take(facing)
    drawn = scene.panels.join(shell)
    n_panels = scene.panels.outline.n_rows
    owner = _visible(camera, scene.panels, shell)
    sun = _sun(scene, points, radius)
    direct, sky = _light(scene, drawn, camera, sun)
    middle = owner[FINE // 2 :: FINE, FINE // 2 :: FINE]
    sunny = np.append(direct[:-1].any(axis=1), False)  # the last is for no polygon
    lit = _lit(camera, drawn, np.where(sunny[middle], middle, -1), sun, scene, points, radius)
    outline = _outline(owner, n_panels)
    ground = direct[-1, 0] * lit + sky[-1, 0]  # grey: one channel
    image = np.repeat(_shade(ground)[..., None], 3, axis=2)
    samples = [(slice(i, None, FINE), slice(j, None, FINE)) for i in range(FINE) for j in range(FINE)]
    shown = np.flatnonzero(np.maximum.reduce([owner[of] for of in samples]) >= 0)
    # Half the memory of the usual numbers, and twice the speed: these are millions of samples.
    tables = direct.astype(np.float32), sky.astype(np.float32)
    sun_there = lit.ravel()[shown, None].astype(np.float32)
    model = np.zeros((len(shown), 3), dtype=np.float32)
    for of in samples:
        row = owner[of].ravel()[shown]
        row[row < 0] = len(direct) - 1  # the ground
        light = tables[0].take(row, axis=0)
        light *= sun_there
        light += tables[1].take(row, axis=0)
        light *= outline[of].ravel()[shown, None]
        model += light
    image.reshape(-1, 3)[shown] = _shade(model / FINE**2)
    return image


def _shade(light: NDArray[Any]) -> NDArray[np.uint8]:
    """Linear light as 8-bit sRGB."""
    table = np.rint(255 * encoded(np.arange(SHADES + 1) / SHADES)).astype(np.uint8)
    return table.take((light * SHADES).astype(np.int32), mode="clip")


def _visible(camera: Camera, panels: Polygons, shell: Polygons) -> NDArray[np.int32]:
    """As ``draw`` of panels and shell together, but a panel may dip into the shell by part of its size."""
    owner, nearest = draw(camera, panels)
    behind, depth = draw(camera, shell)
    arms = np.asarray(panels.outline.values) - panels.anchor[panels.outline.row]
    reach = np.zeros(panels.outline.n_rows)
    np.maximum.at(reach, panels.outline.row, DIP * np.linalg.norm(arms, axis=1))
    there = np.flatnonzero(behind.ravel() >= 0)
    before, far = owner.ravel()[there], depth.ravel()[there]
    with np.errstate(divide="ignore"):  # nothing before the shell is infinitely far
        sunk = 1 / nearest.ravel()[there] - 1 / far
    # Where no panel stands the last row is read: nothing reaches that far.
    seen = there[sunk > reach[before]]
    owner.ravel()[seen] = behind.ravel()[seen] + panels.outline.n_rows
    return owner


def _camera(points: Floats, radius: float, view: Floats) -> Camera:
    """A pinhole that sees all points, with its image cut to them and the margin."""
    position = view * radius / np.sin(np.radians(FIELD / 2))
    return _aim(points, position, (WIDTH, HEIGHT), MARGIN, FINE)


def _aim(points: Floats, position: Floats, box: tuple[int, int], margin: int, fine: int) -> Camera:
    forward = -position / np.linalg.norm(position)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward])
    wide = Camera(position, axes, 1.0, (0.0, 0.0), 1, 1)
    flat = wide.project(wide.see(points))
    low, extent = flat.min(axis=0), np.ptp(flat, axis=0)
    scale = min((side - 2 * margin) / size for side, size in zip(box, extent.tolist(), strict=True))
    width, height = (int(np.ceil(size * scale)) + 2 * margin for size in extent.tolist())
    at = (fine * (margin - low * scale)).tolist()
    return Camera(position, axes, scale * fine, (at[0], at[1]), width * fine, height * fine)


@dataclass(frozen=True)
class Sun:
    """A far pinhole and how near the model comes to it at each sample; direction: unit, towards the sun."""

    camera: Camera
    nearest: Floats
    direction: Floats

    def reaches(self, points: Floats, blur: float, bias: float, taps: int) -> Floats:
        """(n,) share of the sun, 0..1, that reaches the points, with edges blurred over this many samples."""
        seen = self.camera.see(points)
        at, limit = self.camera.project(seen), 1.0 / (seen[:, 2] - bias)
        share = np.zeros(len(points))
        # A border without anything near stands for what lies beside the map.
        bordered, side = np.pad(self.nearest, 1).ravel(), self.camera.width + 2
        most = (self.camera.width + 1, self.camera.height + 1)
        for k in range(taps):  # Vogel's spiral: even over the disk
            turn, reach = k * np.pi * (3 - np.sqrt(5)), blur * np.sqrt((k + 0.5) / taps)
            x = np.clip(at[:, 0] + (reach * np.cos(turn) + 1), 0, most[0]).astype(np.int32)
            y = np.clip(at[:, 1] + (reach * np.sin(turn) + 1), 0, most[1]).astype(np.int32)
            share += bordered.take(y * side + x) < limit
        return share / taps


def _sun(scene: Scene, points: Floats, radius: float) -> Sun:
    up = np.array([0.0, 0.0, 1.0 if scene.view[2] >= 0 else -1.0])
    right = np.cross(up, scene.view)
    right /= np.linalg.norm(right)
    direction = SUN[0] * right + SUN[1] * up + SUN[2] * np.cross(right, up)
    direction /= np.linalg.norm(direction)
    camera = _aim(points, direction * radius * SUN_DISTANCE, (SUN_MAP, SUN_MAP), 8, 1)
    _, nearest = draw(camera, scene.panels)
    return Sun(camera, nearest, direction)


def _light(scene: Scene, drawn: Polygons, camera: Camera, sun: Sun) -> tuple[Floats, Floats]:
    """Linear light from sun and sky off each row, (n + 1, 3); the last row is the white ground."""
    viewer = camera.position - drawn.anchor
    viewer /= np.linalg.norm(viewer, axis=1, keepdims=True)
    side = np.where(np.sum(drawn.normal * viewer, axis=1) < 0, -1.0, 1.0)
    n_panels = scene.panels.outline.n_rows
    base = np.repeat(linear(from_hex([SHELL])), len(side), axis=0)
    base[:n_panels] = linear(scene.colour)
    backs = np.flatnonzero(side[:n_panels] < 0)
    base[backs] = BACK_COLOUR * base[backs] + (1 - BACK_COLOUR) * linear(from_hex([BACK]))
    normal = drawn.normal * side[:, None]
    half = viewer + sun.direction
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    gloss = GLOSS * np.clip(np.sum(normal * half, axis=1), 0, 1) ** GLOSS_EXPONENT
    gloss[n_panels:] = 0.0
    slope = np.clip(normal @ sun.direction, 0, 1)[:, None]
    direct = SUNLIGHT * base * slope + gloss[:, None] * (slope > 0)
    sky = SKYLIGHT * base * (0.8 + 0.2 * normal[:, 2:3])
    return np.vstack([direct, [[GROUND_SHADOW] * 3]]), np.vstack([sky, [[1 - GROUND_SHADOW] * 3]])


def _lit(
    camera: Camera,
    drawn: Polygons,
    owner: NDArray[np.int32],
    sun: Sun,
    scene: Scene,
    points: Floats,
    radius: float,
) -> Floats:
    """(h, w) share of the sun at each pixel, of the model and of the ground under it. owner: −1 where no
    polygon stands, or one that no sun could reach."""
    lit = np.ones(owner.shape)
    if scene.view[2] > 0:
        some = _on_the_ground(camera, owner.shape, sun, float(points[:, 2].min()))
        fine = Image.fromarray(some.astype(np.float32)).resize(owner.shape[::-1], Image.Resampling.BILINEAR)
        lit = 1 - (1 - np.asarray(fine, dtype=np.float64)) * _fade(owner.shape)
    hit = owner >= 0
    row, column = np.nonzero(hit)
    x, y = (np.asarray(FINE * (at + 0.5), dtype=np.float64) for at in (column, row))
    a, b, c = planes(camera, drawn)[owner[hit]].T
    depth = 1.0 / np.maximum(a * x + b * y + c, 1e-12 / radius)
    places = camera.rays(x, y) * depth[:, None] @ camera.axes + camera.position
    lit[hit] = sun.reaches(places, PENUMBRA, BIAS * radius, TAPS)
    return lit


def _on_the_ground(camera: Camera, shape: tuple[int, ...], sun: Sun, floor: float) -> Floats:
    """Share of the sun on the ground, one pixel in ``GROUND_STEP``; 1 where a ray does not meet it."""
    y, x = np.meshgrid(*(FINE * (np.arange(0, n, GROUND_STEP) + 0.5) for n in shape), indexing="ij")
    down = camera.rays(x, y) @ camera.axes
    meets = down[..., 2] < -1e-6
    depth = np.where(meets, (floor - camera.position[2]) / np.where(meets, down[..., 2], 1.0), 0.0)
    near = meets & (depth < 4 * np.linalg.norm(camera.position))
    share = np.ones(near.shape)
    places = down[near] * depth[near, None] + camera.position
    share[near] = sun.reaches(places, GROUND_BLUR, 0.0, GROUND_TAPS)
    return share


def _fade(shape: tuple[int, ...]) -> Floats:
    """(h, w) from 0 at the rim of the picture to 1 inside, smoothly."""
    rows, columns = (np.minimum(np.arange(n), n - 1 - np.arange(n)) for n in shape)
    t = np.clip(np.minimum(rows[:, None], columns) / FADE, 0, 1)
    return np.asarray(t * t * (3 - 2 * t))


def _outline(owner: NDArray[np.int32], n_panels: int) -> NDArray[np.float32]:
    """(h, w) what is left of the light at each sample: less along the edges of panels and of the model."""
    thing = np.minimum(owner, n_panels)  # the shell is one thing
    line = np.zeros(owner.shape, dtype=bool)
    across, down = thing[:, 1:] != thing[:, :-1], thing[1:] != thing[:-1]
    line[:, 1:] |= across
    line[:, :-1] |= across
    line[1:] |= down
    line[:-1] |= down
    line &= owner >= 0
    shown = np.bincount(thing[(thing >= 0) & (thing < n_panels)], minlength=1)
    width = float(np.sqrt(np.median(shown[shown > 0]))) / FINE if np.any(shown) else 0.0
    strength = (1 - OUTLINE) * min(1.0, width / OUTLINE_FULL)
    return np.where(line, np.float32(1 - strength), np.float32(1))
