"""Meshing of NURBS surfaces."""

from __future__ import annotations

import numpy as np

from hexwrap_server import samples
from hexwrap_solver.arrays import Ragged
from hexwrap_solver.surface import NurbsSurface, SentMesh, surface_from_mesh, surface_from_nurbs


def tower() -> NurbsSurface:
    sent = samples.load("tower")["surface"]["nurbs"]
    return NurbsSurface(
        tuple(sent["degree"]),
        tuple(np.array(k) for k in sent["knots"]),
        np.array(sent["control_points"]),
        tuple(sent["closed"]),
    )


def test_tower_is_meshed_without_a_seam() -> None:
    surface = surface_from_nurbs(tower())
    n, m = len(surface.vertices), len(surface.faces)
    assert len(np.unique(np.sort(surface.faces, axis=1), axis=0)) == m
    assert len(np.unique(surface.vertices.round(6), axis=0)) == n
    again = surface_from_mesh(SentMesh(surface.vertices, Ragged.from_table(surface.faces)))
    assert [len(loop) for loop in again.loops] == [len(loop) for loop in surface.loops]
    assert np.einsum("ij,ij->i", again.normals, surface.normals).min() > 0.9
