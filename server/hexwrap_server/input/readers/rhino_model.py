"""A Rhino file as a list of objects: blocks resolved, layers by their paths, visible or not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import rhino3dm

from hexwrap_solver.arrays import Floats

#: Blocks within blocks, at most this deep, and this many objects in all.
DEEPEST, MOST_OBJECTS = 32, 200_000


def xyz(point: Any) -> list[float]:
    return [point.X, point.Y, point.Z]


class TooManyObjectsError(Exception):
    """The blocks of the file hold more than MOST_OBJECTS objects in all."""


@dataclass(frozen=True)
class Instance:
    """A block instance. block: the name of its block."""

    name: str
    layer: str
    block: str
    strings: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Placed:
    """An object where it stands. matrix: (4, 4), how its geometry is to be moved, None: not at all.

    id: the object's own, or that of the block instance it belongs to, with its own behind it.
    within: the block instances around it, outermost first.
    """

    geometry: Any
    attributes: Any
    id: str
    layer: str
    visible: bool
    locked: bool
    matrix: Floats | None = None
    within: tuple[Instance, ...] = ()

    @property
    def name(self) -> str:
        """Its own, or else that of the innermost instance or block that has one."""
        around = (name for one in reversed(self.within) for name in (one.name, one.block))
        return next(filter(None, (str(self.attributes.Name or ""), *around)), "")

    @property
    def strings(self) -> dict[str, str]:
        """User strings, of the instances around it, too; its own go before theirs."""
        found = dict(pair for one in self.within for pair in one.strings)
        return found | dict(_strings(self.attributes))


def _strings(attributes: Any) -> list[tuple[str, str]]:
    return [(str(key), str(value)) for key, value in attributes.GetUserStrings()]


@dataclass(frozen=True)
class Model:
    """file: as rhino3dm read it."""

    file: Any

    @classmethod
    def read(cls, data: bytes) -> Model | None:
        """None: not a Rhino file, or truncated."""
        file: Any = rhino3dm.File3dm.FromByteArray(data)
        return None if file is None else cls(file)

    @cached_property
    def _layers(self) -> dict[int, tuple[str, bool, bool]]:
        """By index: path, whether it and the layers above it are on, whether one of them is locked."""
        layers = {str(layer.Id): layer for layer in self.file.Layers}
        found = {}
        for layer in layers.values():
            visible, locked, above, seen = True, False, layer, set()
            while above is not None and str(above.Id) not in seen:
                seen.add(str(above.Id))
                visible, locked = visible and above.Visible, locked or above.Locked
                above = layers.get(str(above.ParentLayerId))
            found[int(layer.Index)] = (str(layer.FullPath or layer.Name), bool(visible), bool(locked))
        return found

    @cached_property
    def _blocks(self) -> dict[str, tuple[str, list[Any]]]:
        """By id of the definition: its name, and its objects."""
        members = {
            str(item.Attributes.Id): item
            for item in self.file.Objects
            if item.Attributes.IsInstanceDefinitionObject
        }
        return {
            str(block.Id): (
                str(block.Name),
                [members[id] for id in map(str, block.GetObjectIds()) if id in members],
            )
            for block in self.file.InstanceDefinitions
        }

    def objects(self) -> list[Placed]:
        """All objects of the model space. Raises TooManyObjectsError."""
        found = []
        for item in self.file.Objects:
            if item.Attributes.IsInstanceDefinitionObject:
                continue
            for placed in self._resolved(item, None):
                found.append(placed)
                if len(found) > MOST_OBJECTS:
                    raise TooManyObjectsError
        return found

    def _resolved(self, item: Any, around: Placed | None) -> Iterator[Placed]:
        attributes = item.Attributes
        layer, on, layer_locked = self._layers.get(attributes.LayerIndex, ("", True, False))
        visible = on and bool(attributes.Visible) and attributes.Mode != rhino3dm.ObjectMode.Hidden
        locked = layer_locked or attributes.Mode == rhino3dm.ObjectMode.Locked
        placed = Placed(item.Geometry, attributes, str(attributes.Id), layer, visible, locked)
        if around is not None:
            placed = replace(
                placed,
                id=f"{around.id}/{placed.id}",
                visible=visible and around.visible,
                locked=locked or around.locked,
                matrix=around.matrix,
                within=around.within,
            )
        if not isinstance(item.Geometry, rhino3dm.InstanceReference) or len(placed.within) == DEEPEST:
            yield placed
            return
        name, members = self._blocks.get(str(item.Geometry.ParentIdefId), ("", []))
        if not members:
            yield placed  # a linked file that was not saved with this one
            return
        own = np.array(item.Geometry.Xform.ToFloatArray(True), dtype=float).reshape(4, 4)
        matrix = own if placed.matrix is None else placed.matrix @ own
        one = Instance(str(attributes.Name or ""), layer, name, tuple(_strings(attributes)))
        inner = replace(placed, matrix=matrix, within=(*placed.within, one))
        for member in members:
            yield from self._resolved(member, inner)
