"""One layer per size, named and coloured alike in every drawing."""

from __future__ import annotations

from dataclasses import dataclass

from hexwrap_server.output.colours import UNSIZED, class_colours
from hexwrap_server.output.text import lengths
from hexwrap_solver.panels.types import Panels


@dataclass(frozen=True)
class Layer:
    """name: ASCII, with the size and its edge length. colour: 0..255 each."""

    name: str
    colour: tuple[int, int, int]


def size_name(size: int) -> str:
    """What a size class is called in files: ``size-03``, or ``no-size`` for panels without one."""
    return "no-size" if size < 0 else f"size-{size:02d}"


def size_layers(panels: Panels) -> dict[int, Layer]:
    """The layer of each size that has panels, and of panels without a size (−1)."""
    words = lengths(panels.class_length.tolist(), panels.class_sides.tolist())
    colours = class_colours(panels)
    used = set(panels.size.tolist())
    layers = {
        i: Layer(f"{size_name(i)} ({word})", _bytes(colour))
        for i, (word, colour) in enumerate(zip(words, colours, strict=True))
        if i in used
    }
    return layers | ({-1: Layer(size_name(-1), _bytes(UNSIZED))} if -1 in used else {})


def _bytes(colour: str) -> tuple[int, int, int]:
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
