"""Draws the network of a ``.ghx`` file as SVG, much as Grasshopper shows it.

Run ``python grasshopper/draw.py`` to draw the example for the README: nothing in that picture is made up.
"""

from __future__ import annotations

import base64
import sys
from dataclasses import dataclass, field
from pathlib import Path
from uuid import UUID
from xml.sax.saxutils import escape

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from grasshopper import components
from grasshopper.archive import Chunk, from_xml
from grasshopper.network import ICON

ROOT = Path(__file__).resolve().parents[1]
EXAMPLE = ROOT / "grasshopper" / "dist" / "hexwrap-example.ghx"
PICTURE = ROOT / "docs" / "grasshopper.svg"
MARGIN = 40.0

STYLE = """
text { font-family: 'Segoe UI', 'Helvetica Neue', 'DejaVu Sans', Arial, sans-serif; font-size: 11px;
  fill: #263238 }
.small { font-size: 10px }
.title { font-size: 12px; font-weight: 600; fill: #455a64 }
.wire { fill: none; stroke: #90a4ae; stroke-width: 2.2; stroke-linecap: round }
.box { fill: url(#body); stroke: #546e7a; stroke-width: 1 }
.core { fill: #37474f }
.core-text { fill: #ffffff; font-size: 10px; font-weight: 600 }
.plug { fill: #ffffff; stroke: #546e7a; stroke-width: 1 }
.note { fill: #fffbe0; stroke: #c9b458; stroke-width: 1 }
.value { fill: #ffffff; stroke: #78909c; stroke-width: 1 }
.groove { stroke: #90a4ae; stroke-width: 2 }
"""


@dataclass
class Drawing:
    """Layers of SVG, and where wires may start and end."""

    groups: list[str] = field(default_factory=list)
    wires: list[str] = field(default_factory=list)
    things: list[str] = field(default_factory=list)
    starts: dict[UUID, tuple[float, float]] = field(default_factory=dict)
    ends: list[tuple[UUID, tuple[float, float]]] = field(default_factory=list)
    boxes: dict[UUID, tuple[float, float, float, float]] = field(default_factory=dict)

    def rect(self, box: tuple[float, ...], kind: str, radius: float = 4) -> None:
        x, y, w, h = box
        self.things.append(
            f'<rect class="{kind}" x="{x:g}" y="{y:g}" width="{w:g}" height="{h:g}" rx="{radius:g}"/>'
        )

    def text(self, x: float, y: float, words: str, anchor: str = "start", kind: str = "") -> None:
        named = f' class="{kind}"' if kind else ""
        self.things.append(f'<text{named} x="{x:g}" y="{y:g}" text-anchor="{anchor}">{escape(words)}</text>')

    def plug(self, x: float, y: float) -> None:
        self.things.append(f'<circle class="plug" cx="{x:g}" cy="{y:g}" r="3.2"/>')


def picture(root: Chunk) -> str:
    """The definition as SVG text."""
    drawing = Drawing()
    objects = root.find("Definition", "DefinitionObjects").chunks
    for thing in objects:
        if thing["Name"] != "Group":
            _draw(drawing, thing["Name"], thing.find("Container"))
    for thing in objects:
        if thing["Name"] == "Group":
            _group(drawing, thing.find("Container"))
    for source, (x, y) in drawing.ends:
        _wire(drawing, drawing.starts[source], (x, y))
    return _page(drawing)


def _draw(drawing: Drawing, name: str, container: Chunk) -> None:
    box = container.find("Attributes")["Bounds"]
    drawing.boxes[container["InstanceGuid"]] = box
    if any(item.name == "CodeInput" for item in container.items):
        _component(drawing, container, box)
        return
    x, y, w, h = box
    middle = y + h / 2
    drawing.starts[container["InstanceGuid"]] = (x + w, middle)
    sources = [item.value for item in container.items if item.name == "Source"]
    drawing.ends += [(source, (x, middle)) for source in sources]
    if name == "Panel":
        _panel(drawing, container, box)
    elif name in ("Number Slider", "Value List", "Boolean Toggle"):
        _control(drawing, name, container, box)
    else:
        drawing.rect(box, "core", h / 2)
        drawing.text(x + w / 2, middle + 4, container["NickName"], "middle", "core-text")
    if sources:
        drawing.plug(x, middle)
    if name != "Panel" or not container["UserText"].count("\n"):
        drawing.plug(x + w, middle)


def _component(drawing: Drawing, container: Chunk, box: tuple[float, ...]) -> None:
    x, y, w, h = box
    drawing.rect(box, "box", 5)
    data = container.find("ParameterData")
    inputs = [c for c in data.chunks if c.name == "InputParam"]
    outputs = [c for c in data.chunks if c.name == "OutputParam"]
    left = inputs[0].find("Attributes")["Bounds"][2]
    drawing.rect((x + left + 2, y + 3, ICON, h - 6), "core", 4)
    icon = base64.b64encode(_icon(container["Name"])).decode("ascii")
    drawing.things.append(
        f'<image x="{x + left + 4:g}" y="{y + h / 2 - 10:g}" width="20" height="20" '
        f'href="data:image/png;base64,{icon}"/>'
    )
    for chunk in inputs:
        bx, by, bw, bh = chunk.find("Attributes")["Bounds"]
        middle = by + bh / 2
        drawing.text(bx + bw - 4, middle + 4, chunk["NickName"], "end")
        drawing.plug(x, middle)
        drawing.ends += [(item.value, (x, middle)) for item in chunk.items if item.name == "Source"]
    for chunk in outputs:
        bx, by, _, bh = chunk.find("Attributes")["Bounds"]
        middle = by + bh / 2
        drawing.text(bx + 8, middle + 4, chunk["NickName"])
        drawing.plug(x + w, middle)
        drawing.starts[chunk["InstanceGuid"]] = (x + w, middle)
    drawing.text(x + w / 2, y - 5, container["NickName"], "middle", "title")


def _icon(name: str) -> bytes:
    for folder in components.folders():
        component = components.load(folder)
        if component.metadata["name"] == name:
            return component.icon
    raise KeyError(name)


def _panel(drawing: Drawing, container: Chunk, box: tuple[float, ...]) -> None:
    x, y, _, _ = box
    drawing.rect(box, "note", 3)
    drawing.text(x + 7, y + 15, container["NickName"], kind="title")
    for k, line in enumerate(container["UserText"].split("\n")):
        drawing.text(x + 7, y + 33 + 15 * k, line, kind="small")


def _control(drawing: Drawing, name: str, container: Chunk, box: tuple[float, ...]) -> None:
    """A slider, a value list or a toggle: its name in the dark part, its value in the light one."""
    x, y, w, h = box
    label = min(w / 2, 6.4 * len(container["NickName"]) + 14)
    drawing.rect(box, "value", 4)
    drawing.rect((x, y, label, h), "core", 4)
    drawing.text(x + label / 2, y + h / 2 + 4, container["NickName"], "middle", "core-text")
    middle = y + h / 2
    if name == "Number Slider":
        slider = container.find("Slider")
        share = (slider["Value"] - slider["Min"]) / (slider["Max"] - slider["Min"])
        start, end = x + label + 34, x + w - 12
        drawing.things.append(
            f'<line class="groove" x1="{start:g}" y1="{middle:g}" x2="{end:g}" y2="{middle:g}"/>'
        )
        drawing.things.append(
            f'<circle class="core" cx="{start + share * (end - start):g}" cy="{middle:g}" r="4.5"/>'
        )
        drawing.text(x + label + 8, middle + 4, f"{slider['Value']:g}")
    elif name == "Value List":
        drawing.text(x + label + 8, middle + 4, container.find(("ListItem", 0))["Name"])
        drawing.text(x + w - 16, middle + 3, "\N{BLACK DOWN-POINTING SMALL TRIANGLE}", "middle")
    else:
        drawing.text(x + label + 8, middle + 4, str(container["ToggleValue"]))


def _group(drawing: Drawing, container: Chunk) -> None:
    boxes = [drawing.boxes[container["ID", k]] for k in range(container["ID_Count"])]
    x0, y0 = min(b[0] for b in boxes) - 14, min(b[1] for b in boxes) - 34
    x1, y1 = max(b[0] + b[2] for b in boxes) + 14, max(b[1] + b[3] for b in boxes) + 12
    alpha, red, green, blue = container["Colour"]
    drawing.groups.append(
        f'<rect x="{x0:g}" y="{y0:g}" width="{x1 - x0:g}" height="{y1 - y0:g}" rx="10" '
        f'fill="rgb({red},{green},{blue})" fill-opacity="{alpha / 255:.2f}"/>'
        f'<text class="title" x="{x0 + 10:g}" y="{y0 + 15:g}">{escape(container["NickName"])}</text>'
    )


def _wire(drawing: Drawing, start: tuple[float, float], end: tuple[float, float]) -> None:
    (x, y), (a, b) = start, end
    reach = max(30.0, abs(a - x) / 2)
    drawing.wires.append(
        f'<path class="wire" d="M {x:g} {y:g} C {x + reach:g} {y:g} {a - reach:g} {b:g} {a:g} {b:g}"/>'
    )


def _page(drawing: Drawing) -> str:
    boxes = list(drawing.boxes.values())
    x, y = min(b[0] for b in boxes) - MARGIN, min(b[1] for b in boxes) - MARGIN - 10
    w = max(b[0] + b[2] for b in boxes) + MARGIN - x
    h = max(b[1] + b[3] for b in boxes) + MARGIN - y
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{x:g} {y:g} {w:g} {h:g}" width="{w:g}" '
            f'height="{h:g}" role="img" aria-label="The example network on the Grasshopper canvas">',
            f"<style>{STYLE}</style>",
            '<defs><linearGradient id="body" x1="0" y1="0" x2="0" y2="1"><stop offset="0" '
            'stop-color="#fafafa"/><stop offset="1" stop-color="#d9e0e3"/></linearGradient>',
            '<pattern id="grid" width="50" height="50" patternUnits="userSpaceOnUse">'
            '<path d="M 50 0 H 0 V 50" fill="none" stroke="#c3ccc6" stroke-width="0.6"/></pattern></defs>',
            *(
                f'<rect x="{x:g}" y="{y:g}" width="{w:g}" height="{h:g}" fill="{fill}"/>'
                for fill in ("#dde3df", "url(#grid)")
            ),
            *drawing.groups,
            *drawing.wires,
            *drawing.things,
            "</svg>\n",
        ]
    )


def main() -> None:
    PICTURE.parent.mkdir(exist_ok=True)
    PICTURE.write_text(picture(from_xml(EXAMPLE.read_text(encoding="utf-8"))), encoding="utf-8", newline="\n")
    print(f"drew {PICTURE.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
