"""Public meshes for testing, where the folder with them stands beside the repository."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.surface import SentMesh, surface_from_mesh
from hexwrap_solver.surface.types import Surface

FOLDER = Path(__file__).resolve().parents[4] / "shared" / "meshes"
_ALL = sorted((*FOLDER.glob("*.obj"), *FOLDER.glob("*.off")))
#: Annuli; and the others: with one loop, with four, closed.
MESHES = {path.stem: path for path in _ALL if not path.stem.startswith(("tileable", "phcpf"))}
NETS = {path.stem: path for path in _ALL if path.stem not in MESHES}


def load(path: Path) -> Surface:
    """Vertices and faces of an OBJ or OFF file, nothing else."""
    words = [line.split("#")[0].split() for line in path.read_text().splitlines()]
    if path.suffix == ".off":
        words = [w for w in words if w and w != ["OFF"]]
        n = int(words[0][0])
        words = [["v", *w] for w in words[1 : n + 1]] + [
            ["f", *(str(int(c) + 1) for c in w[1:])] for w in words[n + 1 :]
        ]
    vertices = np.array([w[1:4] for w in words if w[:1] == ["v"]], dtype=float)
    faces = [[int(c.split("/")[0]) - 1 for c in w[1:]] for w in words if w[:1] == ["f"]]
    offsets = np.concatenate([[0], np.cumsum([len(f) for f in faces])])
    return surface_from_mesh(SentMesh(vertices=vertices, faces=Ragged(np.concatenate(faces), offsets)))
