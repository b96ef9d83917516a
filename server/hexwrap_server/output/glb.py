"""``panels.glb``: one mesh per size, every panel a node that shows it (binary glTF 2.0).

glTF counts in metres with y up: a node above all panels turns and scales the model. Its panels keep their
labels as names, and size, edge length, ring and place as extras.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import orjson
from scipy.spatial.transform import Rotation

from hexwrap_server.output.blocks import Blocks, Shape, colours_of
from hexwrap_server.output.colours import from_hex, linear
from hexwrap_server.output.layers import size_name
from hexwrap_server.output.meta import Meta, panels_of
from hexwrap_server.output.text import one_line
from hexwrap_server.output.units import unit_of
from hexwrap_solver.arrays import Floats
from hexwrap_solver.pipeline import Solution

FLOAT, TRIANGLES, ARRAY_BUFFER = 5126, 4, 34962


def panels_glb(solution: Solution, meta: Meta) -> bytes:
    """Vertices are 4-byte floats in each panel's own plane, so far-off models lose nothing; places are
    double."""
    pattern, panels = panels_of(solution, "panels.glb")
    blocks = Blocks.of(panels, solution.components)
    colours = colours_of(panels)
    used = sorted({*panels.size.tolist()}, key=lambda size: (size < 0, size))
    material = {size: k for k, size in enumerate(used)}
    scene = _Scene()
    for panel, size in zip(blocks.made_from.tolist(), blocks.size.tolist(), strict=True):
        scene.mesh(size_name(size), blocks.shape(panel), material[size])
    labels = pattern.labels()
    mesh = blocks.block.copy()
    for panel in blocks.alone.tolist():
        size = int(panels.size[panel])
        mesh[panel] = scene.mesh(labels[panels.face[panel]], blocks.shape(panel), material[size])
    turned = Rotation.from_matrix(np.swapaxes(blocks.axes, 1, 2)).as_quat().tolist()
    nodes: list[dict[str, Any]] = [
        {
            "name": labels[face], "mesh": shown, "translation": place, "rotation": turn,
            "extras": {"size": size, "edge_length": edge, "ring": ring, "place": number},
        }
        for face, shown, place, turn, size, edge, ring, number in zip(
            panels.face.tolist(), mesh.tolist(), blocks.origin.tolist(), turned, panels.size.tolist(),
            panels.edge_length.tolist(), pattern.ring[panels.face].tolist(),
            pattern.place[panels.face].tolist(), strict=True,
        )
    ]  # fmt: skip
    scale = unit_of(meta.unit).metres
    half = float(np.sqrt(0.5))
    top = {
        "name": one_line(meta.name), "children": list(range(len(nodes))), "rotation": [-half, 0, 0, half],
        "scale": [scale] * 3,
    }  # fmt: skip
    document = {
        "asset": {"version": "2.0", "generator": "hexwrap"},
        "scene": 0,
        "scenes": [{"nodes": [len(nodes)]}],
        "nodes": [*nodes, top],
        "meshes": scene.meshes,
        "materials": [_material(size_name(size), colours[size]) for size in used],
        "accessors": scene.accessors,
        "bufferViews": scene.views,
        "buffers": [{"byteLength": len(scene.data)}],
    }
    return _container(orjson.dumps(document), bytes(scene.data))


class _Scene:
    """Meshes and the buffer that they lie in."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.meshes: list[dict[str, Any]] = []

    def mesh(self, name: str, shape: Shape, material: int) -> int:
        """Number of the mesh. Corners are repeated, so that every facet is shaded flat."""
        corner = shape.points[shape.triangles]
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        attributes = {
            "POSITION": self._array(corner.reshape(-1, 3), bounds=True),
            "NORMAL": self._array(np.repeat(normal, 3, axis=0)),
        }
        part = {"attributes": attributes, "mode": TRIANGLES, "material": material}
        self.meshes.append({"name": name, "primitives": [part]})
        return len(self.meshes) - 1

    def _array(self, values: Floats, bounds: bool = False) -> int:
        stored = values.astype("<f4")
        self.views.append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": stored.nbytes, "target": ARRAY_BUFFER}
        )
        self.data += stored.tobytes()
        made: dict[str, Any] = {
            "bufferView": len(self.views) - 1, "componentType": FLOAT, "count": len(stored), "type": "VEC3"
        }  # fmt: skip
        if bounds:
            made |= {"min": stored.min(axis=0).tolist(), "max": stored.max(axis=0).tolist()}
        self.accessors.append(made)
        return len(self.accessors) - 1


def _material(name: str, colour: str) -> dict[str, Any]:
    """glTF's colours are linear."""
    rgb = from_hex([colour])[0]
    look = {"baseColorFactor": [*linear(rgb).tolist(), 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.6}
    return {"name": name, "pbrMetallicRoughness": look, "doubleSided": True}


def _container(document: bytes, data: bytes) -> bytes:
    """Both chunks, padded to multiples of four bytes."""
    document += b" " * (-len(document) % 4)
    data += b"\x00" * (-len(data) % 4)
    total = 12 + 8 + len(document) + 8 + len(data)
    return b"".join(
        [
            struct.pack("<4sII", b"glTF", 2, total),
            struct.pack("<I4s", len(document), b"JSON"),
            document,
            struct.pack("<I4s", len(data), b"BIN\x00"),
            data,
        ]
    )
