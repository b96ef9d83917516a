"""Turning the pattern so that it follows a direction of the NURBS surface (paper, section 4)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Complexes
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.errors import PatternError
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.place.sheet import as_sheet
from hexwrap_solver.pattern.place.size import face_areas
from hexwrap_solver.pattern.place.target import boundary_direction
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.surface.projection import parameter_corners
from hexwrap_solver.surface.types import Surface

#: Directions whose mean is shorter than this (1: all agree) have none worth following.
AGREEMENT = 0.2

#: Nearer than this to running along the boundary, or across it, the pattern is taken to do so; rad.
NEARLY = np.deg2rad(1.0)


def with_rotation(
    cmap: ConformalMap, lattice: Lattice, settings: PatternSettings
) -> tuple[PatternSettings, list[str]]:
    """Settings with ``u`` and ``v`` turned into the angle that fits best over the surface.

    Raises PatternError where the surface is not a NURBS surface, or its tangents turn too much to follow.
    """
    if settings.rotation not in ("u", "v"):
        return settings, []
    along = parameter_directions(cmap, 0 if settings.rotation == "u" else 1)
    area, _ = face_areas(cmap)
    known = abs(along) > 0
    mean = complex((area * along**lattice.fold)[known].sum() / area[known].sum())
    if abs(mean) < AGREEMENT:
        raise PatternError(
            f"The {settings.rotation} direction of the surface turns too much in the domain to be followed "
            f"by the pattern (agreement {abs(mean):.2f} of 1): give rotation as edge, vertex or degrees.",
            field=("rotation",),
        )
    followed = np.exp(1j * np.angle(mean) / lattice.fold)
    boundary = boundary_direction(as_sheet(cmap), lattice)
    angle = float(np.angle(followed / boundary))
    angle -= lattice.quantum * round(angle / lattice.quantum)
    half = lattice.quantum / 2
    nearest = half * round(angle / half)
    if abs(angle - nearest) < NEARLY:
        angle = nearest
    sentence = (
        f"Edges follow the {settings.rotation} direction of the surface, at {np.rad2deg(angle):.2f}° to the "
        f"boundary (agreement {abs(mean):.2f} of 1)."
    )
    return replace(settings, rotation=float(np.rad2deg(angle))), [sentence]


def check_parameters(surface: Surface) -> None:
    """Raises PatternError where the surface is not a NURBS surface."""
    if surface.nurbs is None or surface.parameters is None:
        raise PatternError(
            "Only a NURBS surface has u and v directions to follow: give rotation as edge, vertex or "
            "degrees.",
            field=("rotation",),
        )


def parameter_directions(cmap: ConformalMap, direction: int) -> Complexes:
    """(m,) unit directions in the domain along which the parameter u (0) or v (1) grows, the other fixed."""
    surface = cmap.surface
    check_parameters(surface)
    parameters = parameter_corners(surface, np.arange(len(surface.faces)))
    other, own = parameters[..., 1 - direction], parameters[..., direction]
    z = cmap.corners()
    opposite = np.roll(z, -2, axis=1) - np.roll(z, -1, axis=1)
    along = (other * opposite).sum(axis=1)  # the level line of the other parameter, up to its sign
    grows = ((own * (1j * opposite)).sum(axis=1) * along.conj()).real
    along = along * np.sign(grows)
    return np.asarray(along / np.where(along == 0, 1.0, abs(along)))
