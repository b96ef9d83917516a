"""The colours of panel sizes, the same in every file and answer."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.panels.polygons import convex, interior_angles
from hexwrap_solver.panels.types import Panels

#: From the shortest edge to the longest: cold and dark to warm, lightest in the middle.
ANCHORS = ("#34489c", "#3382c0", "#5dbcc0", "#b4dfb0", "#f6e6a2", "#f5b968", "#e6774d", "#b5304a")
#: Panels without a size class (cut at the boundary).
UNSIZED = "#b4b7bc"
#: Panels with another number of sides than all others, a class each.
SPECIAL = "#3a3550"

# Björn Ottosson's OKLab (2020), in which straight lines look like even steps.
_TO_CONE = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def from_hex(colours: list[str] | tuple[str, ...]) -> Floats:
    """(n, 3) sRGB in 0..1 of ``#rrggbb``."""
    return np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in colours]).reshape(-1, 3) / 255.0


def to_hex(rgb: Floats) -> list[str]:
    """``#rrggbb`` of (n, 3) sRGB in 0..1."""
    whole = np.clip(np.rint(rgb * 255), 0, 255).astype(int)
    return [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in whole.tolist()]


def linear(rgb: Floats) -> Floats:
    """sRGB → linear light."""
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def encoded(light: Floats) -> Floats:
    """Linear light → sRGB."""
    light = np.clip(light, 0.0, 1.0)
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)


def gradient(t: Floats) -> Floats:
    """(n, 3) sRGB at positions t in 0..1 along the anchors, interpolated in OKLab."""
    lab = np.cbrt(linear(from_hex(ANCHORS)) @ _TO_CONE.T) @ _TO_LAB.T
    places = np.linspace(0.0, 1.0, len(ANCHORS))
    at = np.stack([np.interp(t, places, lab[:, i]) for i in range(3)], axis=-1)
    cone = (at @ np.linalg.inv(_TO_LAB).T) ** 3
    return encoded(cone @ np.linalg.inv(_TO_CONE).T)


def size_colours(n: int) -> list[str]:
    """One colour per size class, ascending."""
    if n == 1:
        return to_hex(gradient(np.array([0.2])))
    return to_hex(gradient(np.linspace(0.0, 1.0, n)))


def class_colours(panels: Panels) -> list[str]:
    """One colour per size class; pieces along folds have that of the size nearest to theirs, single ones of
    them none, and all special panels one."""
    n = panels.n_sizes
    regular = size_colours(n)
    colours = regular + [SPECIAL] * (len(panels.class_length) - n)
    for k in np.flatnonzero(panels.divided).tolist():
        near = int(np.argmin(np.abs(panels.class_length[:n] - panels.class_length[k]))) if n else -1
        colours[k] = UNSIZED if near < 0 or panels.class_count[k] == 1 else regular[near]
    return colours


def shapes(panels: Panels) -> tuple[Ints, list[tuple[int, bool]], list[str]]:
    """Watertight panels by shape instead of size: (q,) shape of each (−1: cut at the boundary), per shape the
    number of its corners and whether it is convex, most corners first, and its colour. Convex ones are cold,
    others warm."""
    is_convex = convex(panels.polygons, interior_angles(panels.polygons, panels.normal))
    key = 2 * panels.polygons.lengths + is_convex
    found = sorted(set(key[panels.whole].tolist()), key=lambda k: (-(k % 2), -k))
    index = np.full(len(key), -1)
    for i, one in enumerate(found):
        index[panels.whole & (key == one)] = i
    ends = {True: (0.2, 0.48), False: (0.9, 0.62)}
    places = []
    for side in (True, False):
        n = sum(bool(k % 2) == side for k in found)
        places += np.linspace(*ends[side], max(n, 1))[:n].tolist()
    return index, [(k // 2, bool(k % 2)) for k in found], to_hex(gradient(np.array(places)))


def panel_colours(size: Ints, classes: list[str]) -> Floats:
    """(q, 3) sRGB of panels by their class (−1: none), whose colours are given."""
    table = from_hex([*classes, UNSIZED])
    return table[size]
