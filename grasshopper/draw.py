"""Draws the network of a ``.gh`` file as SVG, much as Grasshopper lays it out on opening.

Run ``python grasshopper/draw.py`` to draw the examples for README and docs. Places come from each object's
Pivot, as in Grasshopper; of the Bounds in the file only the size of panels, sliders and the like counts.
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

from grasshopper import layout, network
from grasshopper.archive import Chunk, inflate
from grasshopper.layout import Box

ROOT = Path(__file__).resolve().parents[1]
#: Example → its picture.
PICTURES = {
    ROOT / "grasshopper" / "dist" / "rhino7" / f"hexwrap-{example.name}.gh": ROOT
    / "docs"
    / ("grasshopper.svg" if example.name == "example" else f"grasshopper-{example.name}.svg")
    for example in network.EXAMPLES
}
MARGIN = 40.0
#: From one line of a panel to the next.
LINE = 15.0

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
.groove { fill: #eceff1; stroke: #90a4ae; stroke-width: 2 }
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


def place(name: str, container: Chunk) -> Box:
    """The box in which Grasshopper draws an object of the canvas. name: of its kind."""
    kept = container.find("Attributes")
    made = _columns(container)
    if made is not None:
        return layout.box(name, kept["Pivot"], (made.width, made.height), made.left + made.middle / 2)
    offset = layout.label_width(container["NickName"]) if name == "Value List" else 0.0
    return layout.box(name, kept["Pivot"], kept["Bounds"][2:], offset)


def _columns(container: Chunk) -> layout.Columns | None:
    """None for objects without parameters of their own."""
    inputs, outputs = _sides(container)
    if not inputs and not outputs:
        return None
    shown = "NickName" if any(chunk.name == "ParameterData" for chunk in container.chunks) else "Name"
    return layout.columns([c[shown] for c in inputs], [c[shown] for c in outputs])


def _sides(container: Chunk) -> tuple[list[Chunk], list[Chunk]]:
    data = [chunk for chunk in container.chunks if chunk.name == "ParameterData"]
    held = data[0].chunks if data else container.chunks
    return [c for c in held if c.name in ("InputParam", "param_input")], [
        c for c in held if c.name == "OutputParam"
    ]


def _draw(drawing: Drawing, name: str, container: Chunk) -> None:
    box = place(name, container)
    drawing.boxes[container["InstanceGuid"]] = box
    made = _columns(container)
    if made is not None:
        _component(drawing, container, box, made)
        return
    x, y, w, h = box
    middle = y + h / 2
    drawing.starts[container["InstanceGuid"]] = (x + w, middle)
    sources = [item.value for item in container.items if item.name == "Source"]
    drawing.ends += [(source, (x, middle)) for source in sources]
    if name == "Panel":
        _panel(drawing, container, box)
    elif name in ("Number Slider", "Value List", "Boolean Toggle", "Button"):
        _control(drawing, name, container, box)
    else:
        drawing.rect(box, "core", h / 2)
        drawing.text(x + w / 2, middle + 4, container["NickName"], "middle", "core-text")
    if sources:
        drawing.plug(x, middle)
    if name != "Panel" or container["NickName"] != "Start here":
        drawing.plug(x + w, middle)


def _component(drawing: Drawing, container: Chunk, box: Box, made: layout.Columns) -> None:
    x, y, w, h = box
    drawing.rect(box, "box", 5)
    drawing.rect((x + made.left + 2, y + 3, made.middle, h - 6), "core", 4)
    drawing.things.append(_middle(container, x + made.left + 2 + made.middle / 2, y + h / 2))
    inputs, outputs = _sides(container)
    script = any(chunk.name == "ParameterData" for chunk in container.chunks)
    for k, chunk in enumerate(inputs):
        middle = y + 2 + (k + 0.5) * (h - 4) / len(inputs)
        words = chunk["NickName"] if script else chunk["Name"]
        drawing.text(x + made.left - 2, middle + 4, words, "end")
        drawing.plug(x, middle)
        drawing.ends += [(item.value, (x, middle)) for item in chunk.items if item.name == "Source"]
    for k, chunk in enumerate(outputs):
        middle = y + 2 + (k + 0.5) * (h - 4) / len(outputs)
        drawing.text(x + made.left + made.middle + 8, middle + 4, chunk["NickName"])
        drawing.plug(x + w, middle)
        drawing.starts[chunk["InstanceGuid"]] = (x + w, middle)
    if script:
        drawing.text(x + w / 2, y - 5, container["NickName"], "middle", "title")


def _middle(container: Chunk, x: float, y: float) -> str:
    """A component's icon, or its name upright where it has none of its own."""
    icons = [item.value for item in container.items if item.name == "IconOverride"]
    if not icons:
        return (
            f'<text class="core-text" x="{x:g}" y="{y:g}" text-anchor="middle" dominant-baseline="central" '
            f'transform="rotate(-90 {x:g} {y:g})" font-size="9">{escape(container["NickName"])}</text>'
        )
    data = base64.b64encode(icons[0]).decode("ascii")
    return (
        f'<image x="{x - 10:g}" y="{y - 10:g}" width="20" height="20" href="data:image/png;base64,{data}"/>'
    )


def _panel(drawing: Drawing, container: Chunk, box: tuple[float, ...]) -> None:
    x, y = box[:2]
    drawing.rect(box, "note", 3)
    drawing.text(x + 7, y + 15, container["NickName"], kind="title")
    height = box[3]
    words = container["UserText"].split("\n") if container["UserText"] else []
    room = int((height - 24) // LINE) if len(words) > (height - 24) // LINE else len(words)
    for k, line in enumerate(words[:room]):
        drawing.text(
            x + 7, y + 33 + LINE * k, line if k + 1 < room or room == len(words) else "…", kind="small"
        )


def _control(drawing: Drawing, name: str, container: Chunk, box: tuple[float, ...]) -> None:
    """A slider, a value list or a toggle: its name in the dark part, its value in the light one."""
    x, y, w, h = box
    label = layout.label_width(container["NickName"])
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
    elif name == "Boolean Toggle":
        drawing.text(x + label + 8, middle + 4, str(container["ToggleValue"]))
    else:
        drawing.rect((x + label + 4, y + 4, w - label - 8, h - 8), "groove", 3)


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
    for source, target in PICTURES.items():
        drawn = picture(inflate(source.read_bytes()))
        target.write_text(drawn, encoding="utf-8", newline="\n")
        print(f"drew {target.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
