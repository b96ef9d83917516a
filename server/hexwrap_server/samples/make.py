"""Makes the bundled samples: ``python -m hexwrap_server.samples.make``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface.types import NurbsSurface

DEGREE = 3


def loft(rings: Floats) -> NurbsSurface:
    """Cubic surface, periodic around and clamped along, from (rings, around, 3) control points."""
    rows, around, _ = rings.shape
    wrapped = np.concatenate([rings, rings[:, :DEGREE]], axis=1).transpose(1, 0, 2)
    net = np.concatenate([wrapped, np.ones((*wrapped.shape[:2], 1))], axis=2)
    periodic = np.arange(-DEGREE, around + DEGREE + 1, dtype=float)
    inner = np.arange(rows - DEGREE + 1, dtype=float)
    clamped = np.concatenate([np.repeat(inner[:1], DEGREE), inner, np.repeat(inner[-1:], DEGREE)])
    return NurbsSurface((DEGREE, DEGREE), (periodic, clamped), net, (True, False))


def tower() -> NurbsSurface:
    """As Figure 1 of the paper: a twisted, waisted tower, 60 m high, whose plan turns from a rounded
    triangle into an oval."""
    around = 12
    t = np.linspace(0, 1, 8)[:, None]
    a = np.arange(around) / around * 2 * np.pi
    radius = np.interp(t, np.linspace(0, 1, 8), [17.0, 15.2, 11.0, 8.0, 7.4, 8.6, 10.6, 12.0])
    lobes = 1 + 0.22 * (1 - t) ** 2 * np.cos(3 * a) + 0.16 * t**2 * np.cos(2 * a)
    turn = a + 1.25 * t
    x = radius * lobes * np.cos(turn) + 7.0 * t**2
    y = radius * lobes * np.sin(turn) - 3.0 * np.sin(np.pi * t)
    z = 60.0 * t + 2.5 * t**3 * np.cos(turn - 0.6)
    return loft(np.stack([x, y, z], axis=2))


def body(name: str, surface: NurbsSurface, **request: Any) -> dict[str, Any]:
    """A request body with the surface inline; coordinates rounded to a tenth of a millimetre."""
    return {
        "name": name,
        "surface": {
            "nurbs": {
                "degree": list(surface.degree),
                "knots": [k.tolist() for k in surface.knots],
                "control_points": np.round(surface.control_points, 4).tolist(),
                "closed": list(surface.closed),
            },
        },
        **request,
    }


def bodies() -> list[dict[str, Any]]:
    """Every sample."""
    return [body("tower", tower(), pattern={"kind": "hex", "around": 48})]


def main() -> None:
    folder = Path(__file__).parent
    for request in bodies():
        text = json.dumps(request, separators=(",", ":")) + "\n"
        (folder / f"{request['name']}.json").write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
