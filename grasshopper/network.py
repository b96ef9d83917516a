"""The examples: the paper's Figure 12 (address and port, send, collect), grown by settings and views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from uuid import UUID, uuid5

from grasshopper import layout
from grasshopper.archive import Chunk
from grasshopper.components import Component, Form, offered, parameter_guid, parameters, script
from grasshopper.layout import ROW, Box

#: All instances of the examples hang on this one, so that every build gives them the same names.
EXAMPLE = UUID("0f6f4a0e-7c0b-4a58-9a43-54c7b6f0a6d2")
MESH = UUID("1e936df3-0eea-4246-8549-514cb8862b7a")
POINT = UUID("fbac3e32-f100-4292-8692-77240a42fd1a")
TOGGLE = UUID("2e78987b-9dfb-42a2-8b76-3923ac8bd91a")
BUTTON = UUID("a8b97322-2d53-47cd-905e-b932c3ccd74e")
PANEL = UUID("59e0b89a-e487-49f8-bab8-b5bab16be14c")
SLIDER = UUID("57da07bd-ecab-415d-9d86-af36d7073abc")
VALUE_LIST = UUID("00027467-0d24-4fa7-b178-8dc0ac5f42ec")
PREVIEW = UUID("537b0419-bbc2-4ff4-bf08-afe526367b2c")
GROUP = UUID("c552a431-af5b-46a9-a8a4-0fcbc27ef596")
#: .NET ticks of 2026-01-01: a real date would make every build differ.
DATE = 639_028_224_000_000_000
#: Width of the middle of a component that shows its name upright instead of an icon.
NAMED = 24.0


@dataclass(frozen=True)
class Example:
    """What differs between the examples. Corners and angles: one a line, for panels."""

    name: str
    title: str
    guide: str
    around: int = 24
    sizes: int = 11
    rims: tuple[str, ...] = ("whole", "trim")
    corners: str = ""
    angles: str = "240"
    singular: str = ""


EXAMPLES = (
    Example(
        "example",
        "Panels on a tower",
        "1  Set the Mesh: right-click, Set one Mesh.\n2  Turn Start on, then Run.\n"
        "Sliders may move while it works; the last\nvalue counts. Press Bake when you like it.",
    ),
    Example(
        "entrance",
        "A tower with an entrance",
        "1  Set the Mesh: for instance that of the\n   sample 'entrance'.\n2  Turn Start on, then Run.\n"
        "Corners: points on the boundary, one a line,\nand an angle for each. Balance tells what is\n"
        "missing while you change them.",
        around=68,
        corners="2.8025, 12.4499, 0\n0, 12.7149, 0\n-2.8025, 12.4499, 0\n"
        "-2.8025, -12.4499, 0\n0, -12.7149, 0\n2.8025, -12.4499, 0",
        angles="240\n60\n240\n240\n60\n240",
    ),
    Example(
        "dome",
        "A dome with openings",
        "1  Set the Mesh: a dome, with windows or\n   without.\n2  Turn Start on, then Run.\n"
        "A dome needs panels with five sides: 'auto'\nplaces as many as pay, a number at most so\n"
        "many. At openings, cells are cut.",
        around=48,
        rims=("trim", "whole"),
        singular="auto",
    ),
)


class Network:
    """A definition that grows object by object."""

    def __init__(self, all_components: Sequence[Component], form: Form, name: str) -> None:
        self.components = {component.folder: component for component in all_components}
        self.form = form
        self.id = uuid5(EXAMPLE, f"{form.name} {name}")
        self.objects = Chunk("DefinitionObjects")

    def guid(self, key: str) -> UUID:
        return uuid5(self.id, key)

    def output(self, key: str) -> UUID:
        """InstanceGuid that a wire starts from: ``Send.Job``, or the key of a parameter."""
        folder, _, name = key.partition(".")
        return parameter_guid(self.guid(folder), "output", name) if name else self.guid(key)

    def _object(self, kind: UUID, name: str, key: str, description: str, nickname: str) -> Chunk:
        chunk = self.objects.child("Object", len(self.objects.chunks))
        chunk.add("gh_guid", "GUID", kind).add("gh_string", "Name", name)
        container = chunk.child("Container")
        container.add("gh_string", "Description", description).add("gh_guid", "InstanceGuid", self.guid(key))
        return container.add("gh_string", "Name", name).add("gh_string", "NickName", nickname)

    def _parameter(
        self, kind: UUID, name: str, key: str, description: str, nickname: str, box: Box, source: str = ""
    ) -> Chunk:
        container = self._object(kind, name, key, description, nickname)
        container.add("gh_bool", "Optional", False)
        container.add("gh_int32", "SourceCount", 1 if source else 0)
        if source:
            container.add("gh_guid", "Source", self.output(source), index=0)
        offset = layout.label_width(nickname) if name == "Value List" else 0.0
        attributes(container, box, layout.pivot(name, box, offset))
        return container

    def geometry(
        self, kind: UUID, name: str, key: str, nickname: str, at: tuple[float, float], source: str = ""
    ) -> None:
        description = f"Contains a collection of {name.lower()} geometry"
        self._parameter(kind, name, key, description, nickname, (*at, 80.0, ROW), source)

    def toggle(self, key: str, nickname: str, x: float, y: float) -> None:
        box = (x, y, 120.0, 22.0)
        made = self._parameter(TOGGLE, "Boolean Toggle", key, "Boolean (true/false) toggle", nickname, box)
        made.add("gh_bool", "ToggleValue", False)

    def button(self, key: str, nickname: str, x: float, y: float) -> None:
        box = (x, y, 110.0, 22.0)
        made = self._parameter(BUTTON, "Button", key, "Button object with two values", nickname, box)
        made.add("gh_string", "ExpressionNormal", "False").add("gh_string", "ExpressionPressed", "True")

    def slider(self, key: str, nickname: str, value: int, low: int, high: int, x: float, y: float) -> None:
        box = (x, y, 200.0, ROW)
        made = self._parameter(
            SLIDER, "Number Slider", key, "Numeric slider for single values", nickname, box
        )
        slider = made.child("Slider")
        slider.add("gh_int32", "Digits", 0).add("gh_int32", "GripDisplay", 1).add("gh_int32", "Interval", 1)
        slider.add("gh_double", "Max", float(high)).add("gh_double", "Min", float(low))
        slider.add("gh_int32", "SnapCount", 0).add("gh_double", "Value", float(value))

    def value_list(self, key: str, nickname: str, words: Sequence[str], x: float, y: float) -> None:
        box = (x, y, layout.label_width(nickname) + 104.0, 22.0)
        description = "Provides a list of preset values to choose from"
        made = self._parameter(VALUE_LIST, "Value List", key, description, nickname, box)
        made.add("gh_int32", "ListCount", len(words)).add("gh_int32", "ListMode", 1)
        for i, word in enumerate(words):
            entry = made.child("ListItem", i)
            entry.add("gh_string", "Expression", f'"{word}"').add("gh_string", "Name", word)
            entry.add("gh_bool", "Selected", i == 0)

    def panel(
        self, key: str, nickname: str, box: Box, source: str = "", text: str = "", lines: bool = False
    ) -> None:
        """lines: every line of the text is an item of its own."""
        description = "A panel for custom notes and text values"
        made = self._parameter(PANEL, "Panel", key, description, nickname, box, source)
        made.add("gh_double", "ScrollRatio", 0.0).add("gh_string", "UserText", text)
        place = made.find("Attributes")
        for side in ("MarginLeft", "MarginRight", "MarginTop"):
            place.add("gh_int32", side, 0)
        look = made.child("PanelProperties").add("gh_drawing_color", "Colour", (255, 255, 250, 220))
        for name, value in [
            ("DrawIndices", False),
            ("DrawPaths", False),
            ("Multiline", not lines),
            ("SpecialCodes", False),
            ("Stream", False),
            ("Wrap", True),
        ]:
            look.add("gh_bool", name, value)

    def script(self, folder: str, x: float, y: float, wires: dict[str, str]) -> None:
        """A component, its inputs wired to the outputs named."""
        component, instance = self.components[folder], self.guid(folder)
        chunk = self.objects.child("Object", len(self.objects.chunks))
        chunk.add("gh_guid", "GUID", self.form.base).add("gh_string", "Name", component.metadata["name"])
        container = chunk.child("Container").add("gh_guid", "InstanceGuid", instance)
        script(container, component, self.form)
        made = layout.columns([s["name"] for s in component.inputs], [s["name"] for s in component.outputs])
        box = (x, y, made.width, made.height)
        place = Chunk("Attributes")
        _fill(place, box, layout.pivot("", box, made.left + made.middle / 2))
        sources = {name: [self.output(source)] for name, source in wires.items()}
        data = parameters(component, instance, self.form, sources)
        container.chunks[:0] = [place, data]
        rows(data, "InputParam", (x + 2, y + 2, made.left, made.height - 4))
        rows(data, "OutputParam", (x + made.left + made.middle, y + 2, made.right - 2, made.height - 4))

    def preview(self, key: str, x: float, y: float, wires: dict[str, str]) -> None:
        """Grasshopper's own Custom Preview: geometry shaded in the colours given."""
        container = self._object(
            PREVIEW, "Custom Preview", key, "Allows for customized geometry previews", "Preview"
        )
        made = layout.columns(["Geometry", "Material"], [], NAMED)
        box = (x, y, made.width, made.height)
        attributes(container, box, layout.pivot("", box, made.left + made.middle / 2))
        for i, (name, letter, words) in enumerate(
            [("Geometry", "G", "Geometry to preview"), ("Material", "M", "The material override")]
        ):
            chunk = container.child("param_input", i)
            chunk.add("gh_string", "Description", words).add("gh_string", "Name", name)
            chunk.add("gh_guid", "InstanceGuid", parameter_guid(self.guid(key), "input", name))
            chunk.add("gh_string", "NickName", letter).add("gh_bool", "Optional", False)
            chunk.add("gh_guid", "Source", self.output(wires[name]), index=0).add(
                "gh_int32", "SourceCount", 1
            )
        rows(container, "param_input", (x + 2, y + 2, made.left, made.height - 4))

    def group(self, name: str, colour: tuple[int, int, int, int], keys: Sequence[str]) -> None:
        container = self._object(GROUP, "Group", f"group {name}", "A group of Grasshopper objects", name)
        container.add("gh_int32", "Border", 1).add("gh_drawing_color", "Colour", colour)
        container.add("gh_int32", "ID_Count", len(keys))
        for i, key in enumerate(keys):
            container.add("gh_guid", "ID", self.guid(key), index=i)
        container.child("Attributes")

    def archive(self, name: str, title: str) -> Chunk:
        """The whole file."""
        root = Chunk("Root").add("gh_version", "ArchiveVersion", (0, 2, 2))
        definition = root.child("Definition").add("gh_version", "plugin_version", (1, 0, 7))
        header = definition.child("DocumentHeader").add("gh_guid", "DocumentID", self.id)
        header.add("gh_string", "Preview", "Shaded").add("gh_int32", "PreviewMeshType", 1)
        header.add("gh_drawing_color", "PreviewNormal", (100, 150, 0, 0))
        header.add("gh_drawing_color", "PreviewSelected", (100, 0, 150, 0))
        properties = definition.child("DefinitionProperties").add("gh_date", "Date", DATE)
        properties.add("gh_string", "Description", f"{title} with hexwrap")
        properties.add("gh_bool", "KeepOpen", False).add("gh_string", "Name", f"hexwrap-{name}.gh")
        properties.child("Revisions").add("gh_int32", "RevisionCount", 0)
        projection = properties.child("Projection").add("gh_drawing_point", "Target", (0, 0))
        projection.add("gh_single", "Zoom", 1.0)
        properties.child("Views").add("gh_int32", "ViewCount", 0)
        definition.child("RcpLayout").add("gh_int32", "GroupCount", 0)
        definition.child("GHALibraries").add("gh_int32", "Count", 0)
        self.objects.add("gh_int32", "ObjectCount", len(self.objects.chunks))
        definition.chunks.append(self.objects)
        return root


def attributes(chunk: Chunk, box: Box, pivot: tuple[float, float]) -> None:
    """Where an object lies on the canvas."""
    _fill(chunk.child("Attributes"), box, pivot)


def _fill(made: Chunk, box: Box, pivot: tuple[float, float]) -> None:
    made.add("gh_drawing_rectanglef", "Bounds", box).add("gh_drawing_pointf", "Pivot", pivot)


def rows(data: Chunk, name: str, column: Box) -> None:
    """Places of a component's parameters, one below the other in a column."""
    found = [chunk for chunk in data.chunks if chunk.name == name]
    x, y, width, height = column
    for i, chunk in enumerate(found):
        box = (x, y + i * height / len(found), width, height / len(found))
        attributes(chunk, box, layout.pivot("", box))


def example(all_components: Sequence[Component], form: Form, wanted: Example) -> Chunk:
    """The definition as a chunk tree: settings on the left, then Send, then what comes of it."""
    net = Network(all_components, form, wanted.name)
    server(net, wanted)
    corners(net, wanted)
    sizes(net, wanted)
    wires = {
        "Mesh": "Mesh", "Angles": "BoundaryAngles.Angles", "Pattern": "Pattern.Pattern", "IP": "IP",
        "Panels": "Panels.Panels", "Singularities": "Singularities.Singularities", "Run": "Run",
        "Port": "Port",
    }  # fmt: skip
    net.geometry(MESH, "Mesh", "Mesh", "Mesh", (200, -120))
    net.toggle("Run", "Run", 660, 96)
    net.script("Send", 800, -50, wires)
    net.panel("Status", "Status", (1050, -50, 170, 130), "Send.Status")
    net.slider("MaxSizes", "MaxSizes", 8, 1, 12, 560, 443)
    net.toggle("Try", "Explore", 640, 543)
    net.script("Explore", 800, 420, {"Job": "Send.Job", "MaxSizes": "MaxSizes", "Run": "Try"})
    net.panel("Requests", "Requests, best first", (1020, 420, 225, 84), "Explore.Requests")
    net.panel("Uncovered", "Uncovered", (1020, 514, 105, 70), "Explore.Uncovered")
    net.panel("Cost", "Cost", (1140, 514, 105, 70), "Explore.Cost")
    net.panel("Found", "Notes", (800, 594, 445, 54), "Explore.Notes")
    net.script("Collect", 1280, -50, {"Job": "Send.Job"})
    net.preview("Preview", 1530, 140, {"Geometry": "Collect.Shapes", "Material": "Collect.ShapeColours"})
    net.panel("Labels", "Labels", (1530, -50, 170, 90), "Collect.Labels")
    net.panel("Report", "Report", (1730, -50, 290, 284), "Collect.Report")
    net.button("Press", "Bake", 1290, 335)
    net.script("Bake", 1460, 310, {"Job": "Send.Job", "Bake": "Press"})
    net.panel("Baked", "Baked", (1650, 310, 250, 64), "Bake.Status")
    net.script("Domain", 1290, 470, {"Job": "Send.Job"})
    net.panel("Summary", "Summary", (1530, 505, 250, 54), "Domain.Summary")
    shape = ["Kind", "Around", "Boundary", "Pattern", "Sizes", "Target", "Panels"]
    net.group("1  Server", (90, 120, 144, 220), ["IP", "Port", "Start", "StartServer", "Answer"])
    corner = [
        "Corners",
        "Degrees",
        "Unit",
        "BoundaryAngles",
        "Balance",
        *(["Places"] if wanted.corners else []),
    ]
    net.group("The surface", (90, 160, 170, 175), ["Mesh"])
    net.group("2  Corners of the boundary", (90, 255, 183, 77), corner)
    net.group("3  Singularities", (90, 240, 150, 130), ["Singular", "Singularities"])
    net.group("4  Pattern and panels", (90, 255, 183, 77), shape)
    net.group("5  Send", (110, 102, 187, 160), ["Run", "Send", "Status"])
    net.group("6  Collect", (110, 100, 181, 246), ["Collect", "Preview", "Labels", "Report"])
    net.group("7  Bake", (90, 77, 182, 172), ["Press", "Bake", "Baked"])
    net.group("The unrolled domain", (90, 179, 157, 219), ["Domain", "Summary"])
    tried = ["MaxSizes", "Try", "Explore", "Requests", "Uncovered", "Cost", "Found"]
    net.group("What pays: one of Requests goes to Pattern of another Send", (110, 150, 150, 200), tried)
    return net.archive(wanted.name, wanted.title)


def server(net: Network, wanted: Example) -> None:
    """Address and port, what starts the server, and a word on how to begin."""
    net.panel("Guide", "Start here", (20, -290, 300, 130), text=wanted.guide)
    net.panel("IP", "IP", (400, -290, 110, 42), text="127.0.0.1")
    net.panel("Port", "Port", (400, -230, 110, 42), text="6789")
    net.toggle("Start", "Start", 560, -286)
    net.script("StartServer", 720, -286, {"Start": "Start", "Port": "Port"})
    net.panel("Answer", "Server", (940, -286, 290, 64), "StartServer.Status")


def corners(net: Network, wanted: Example) -> None:
    """Boundary corners, and singularities."""
    if wanted.corners:  # an empty panel would be no point
        net.panel("Places", "Corners", (20, -50, 150, 130), text=wanted.corners, lines=True)
    net.geometry(POINT, "Point", "Corners", "Points", (190, -50), "Places" if wanted.corners else "")
    net.panel("Degrees", "Angles", (190, -20, 80, 124), text=wanted.angles, lines=True)
    net.value_list("Unit", "Unit", ["deg", "60", "90", "rad"], 20, 112)
    wires = {"Points": "Corners", "Angle": "Degrees", "Unit": "Unit", "Mesh": "Mesh"}
    net.script("BoundaryAngles", 300, -50, wires)
    net.panel("Balance", "Balance", (455, -50, 165, 96), "BoundaryAngles.Balance")
    net.panel("Singular", "Count", (20, 204, 100, 42), text=wanted.singular, lines=True)
    net.script("Singularities", 180, 194, {"Count": "Singular"})


def sizes(net: Network, wanted: Example) -> None:
    """Pattern and panels."""
    net.value_list("Kind", "Kind", offered("Pattern", "KINDS"), 20, 310)
    net.slider("Around", "Around", wanted.around, 6, 200, 20, 346)
    net.value_list("Boundary", "Boundary", wanted.rims, 20, 380)
    net.script("Pattern", 275, 310, {"Kind": "Kind", "Around": "Around", "Boundary": "Boundary"})
    net.slider("Sizes", "Sizes", wanted.sizes, 1, 40, 20, 500)
    net.value_list("Target", "Target", ["inscribed", "best", "shortest", "mean"], 20, 534)
    net.script("Panels", 275, 500, {"Sizes": "Sizes", "Target": "Target"})
