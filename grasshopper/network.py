"""The example definition: the paper's Figure 12 (send, collect), grown by angles and a view of the domain."""

from __future__ import annotations

from collections.abc import Sequence
from uuid import UUID, uuid5

from grasshopper.archive import Chunk
from grasshopper.components import GHPYTHON, Component, parameter_guid, parameters, script

#: All instances of the example hang on this one, so that every build gives them the same names.
EXAMPLE = UUID("0f6f4a0e-7c0b-4a58-9a43-54c7b6f0a6d2")
MESH = UUID("1e936df3-0eea-4246-8549-514cb8862b7a")
POINT = UUID("fbac3e32-f100-4292-8692-77240a42fd1a")
TOGGLE = UUID("2e78987b-9dfb-42a2-8b76-3923ac8bd91a")
PANEL = UUID("59e0b89a-e487-49f8-bab8-b5bab16be14c")
SLIDER = UUID("57da07bd-ecab-415d-9d86-af36d7073abc")
VALUE_LIST = UUID("00027467-0d24-4fa7-b178-8dc0ac5f42ec")
GROUP = UUID("c552a431-af5b-46a9-a8a4-0fcbc27ef596")
#: .NET ticks of 2026-01-01: a real date would make every build differ.
DATE = 639_028_224_000_000_000
ROW, ICON, LETTER = 20.0, 24.0, 6.9

Box = tuple[float, float, float, float]

GUIDE = """1  Start the server.
2  Set the Mesh (right-click: Set one Mesh), Run.
Sliders may move while it works.
Corners: set points on the boundary and give
each its angle; Balance tells what is missing."""


class Network:
    """A definition that grows object by object; ``outputs`` and ``boxes`` are known by the objects' keys."""

    def __init__(self, all_components: Sequence[Component]) -> None:
        self.components = {component.folder: component for component in all_components}
        self.objects = Chunk("DefinitionObjects")

    def guid(self, key: str) -> UUID:
        return uuid5(EXAMPLE, key)

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
        attributes(container, box)
        return container

    def geometry(self, kind: UUID, name: str, key: str, nickname: str, x: float, y: float) -> None:
        description = f"Contains a collection of {name.lower()} geometry"
        self._parameter(kind, name, key, description, nickname, (x, y, 80.0, ROW))

    def toggle(self, key: str, nickname: str, x: float, y: float) -> None:
        box = (x, y, 120.0, 22.0)
        made = self._parameter(TOGGLE, "Boolean Toggle", key, "Boolean (true/false) toggle", nickname, box)
        made.add("gh_bool", "ToggleValue", False)

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
        box = (x, y, 160.0, 22.0)
        description = "Provides a list of preset values to choose from"
        made = self._parameter(VALUE_LIST, "Value List", key, description, nickname, box)
        made.add("gh_int32", "ListCount", len(words)).add("gh_int32", "ListMode", 1)
        for i, word in enumerate(words):
            entry = made.child("ListItem", i)
            entry.add("gh_string", "Expression", f'"{word}"').add("gh_string", "Name", word)
            entry.add("gh_bool", "Selected", i == 0)

    def panel(self, key: str, nickname: str, box: Box, source: str = "", text: str = "") -> None:
        description = "A panel for custom notes and text values"
        made = self._parameter(PANEL, "Panel", key, description, nickname, box, source)
        made.add("gh_double", "ScrollRatio", 0.0).add("gh_string", "UserText", text)
        look = made.child("PanelProperties").add("gh_drawing_color", "Colour", (255, 255, 250, 220))
        for name, value in [
            ("DrawIndices", False),
            ("DrawPaths", False),
            ("Multiline", bool(source) or key == "Guide"),
            ("SpecialCodes", False),
            ("Stream", False),
            ("Wrap", True),
        ]:
            look.add("gh_bool", name, value)

    def script(self, folder: str, x: float, y: float, wires: dict[str, str]) -> None:
        """A component, its inputs wired to the outputs named."""
        component, instance = self.components[folder], self.guid(folder)
        chunk = self.objects.child("Object", len(self.objects.chunks))
        chunk.add("gh_guid", "GUID", GHPYTHON).add("gh_string", "Name", component.metadata["name"])
        container = chunk.child("Container").add("gh_guid", "InstanceGuid", instance)
        script(container, component)
        left, right = (
            max(len(spec["name"]) for spec in specs) * LETTER + 10
            for specs in (component.inputs, component.outputs)
        )
        height = ROW * max(len(component.inputs), len(component.outputs)) + 4
        attributes(container, (x, y, left + ICON + right, height))
        sources = {name: [self.output(source)] for name, source in wires.items()}
        data = parameters(component, instance, sources)
        container.chunks.append(data)
        n_in, n_out = len(component.inputs), len(component.outputs)
        for i in range(n_in):
            box = (x + 2, y + 2 + i * (height - 4) / n_in, left, (height - 4) / n_in)
            attributes(data.find(("InputParam", i)), box)
        for i in range(n_out):
            box = (x + left + ICON, y + 2 + i * (height - 4) / n_out, right - 2, (height - 4) / n_out)
            attributes(data.find(("OutputParam", i)), box)

    def group(self, name: str, colour: tuple[int, int, int, int], keys: Sequence[str]) -> None:
        container = self._object(GROUP, "Group", f"group {name}", "A group of Grasshopper objects", name)
        container.add("gh_int32", "Border", 1).add("gh_drawing_color", "Colour", colour)
        container.add("gh_int32", "ID_Count", len(keys))
        for i, key in enumerate(keys):
            container.add("gh_guid", "ID", self.guid(key), index=i)
        container.child("Attributes")

    def archive(self) -> Chunk:
        """The whole file."""
        root = Chunk("Root").add("gh_version", "ArchiveVersion", (0, 2, 2))
        definition = root.child("Definition").add("gh_version", "plugin_version", (1, 0, 7))
        header = definition.child("DocumentHeader").add("gh_guid", "DocumentID", EXAMPLE)
        header.add("gh_string", "Preview", "Shaded").add("gh_int32", "PreviewMeshType", 1)
        header.add("gh_drawing_color", "PreviewNormal", (100, 150, 0, 0))
        header.add("gh_drawing_color", "PreviewSelected", (100, 0, 150, 0))
        properties = definition.child("DefinitionProperties").add("gh_date", "Date", DATE)
        properties.add("gh_string", "Description", "Panels on a tube-like surface with hexwrap")
        properties.add("gh_bool", "KeepOpen", False).add("gh_string", "Name", "hexwrap-example.ghx")
        properties.child("Revisions").add("gh_int32", "RevisionCount", 0)
        projection = properties.child("Projection").add("gh_drawing_point", "Target", (0, 0))
        projection.add("gh_single", "Zoom", 1.0)
        properties.child("Views").add("gh_int32", "ViewCount", 0)
        definition.child("RcpLayout").add("gh_int32", "GroupCount", 0)
        definition.child("GHALibraries").add("gh_int32", "Count", 0)
        self.objects.add("gh_int32", "ObjectCount", len(self.objects.chunks))
        definition.chunks.append(self.objects)
        return root


def attributes(chunk: Chunk, box: Box) -> None:
    """Where an object lies on the canvas."""
    made = chunk.child("Attributes").add("gh_drawing_rectanglef", "Bounds", box)
    made.add("gh_drawing_pointf", "Pivot", (box[0] + box[2] / 2, box[1] + box[3] / 2))


def example(all_components: Sequence[Component]) -> Chunk:
    """The definition as a chunk tree."""
    net = Network(all_components)
    server(net)
    settings(net)
    net.geometry(MESH, "Mesh", "Mesh", "Mesh", 40, -70)
    net.toggle("Run", "Run", 440, 480)
    wires = {"Mesh": "Mesh", "Angles": "BoundaryAngles.Angles", "Run": "Run"}
    net.script("Send", 650, -30, wires | {"Pattern": "Pattern.Pattern", "Panels": "Panels.Panels"})
    net.panel("Status", "Status", (866, 60, 150, 120), "Send.Status")
    net.script("Collect", 1070, -105, {"Job": "Send.Job"})
    net.panel("Labels", "Labels", (1300, -105, 150, 100), "Collect.Labels")
    net.panel("Report", "Report", (1300, 20, 270, 99), "Collect.Report")
    net.script("Domain", 1070, 210, {"Job": "Send.Job"})
    net.panel("Summary", "Summary", (1300, 280, 210, 54), "Domain.Summary")
    corners = ["Mesh", "Corners", "Degrees", "Unit", "BoundaryAngles", "Balance"]
    shape = ["Kind", "Around", "Pattern", "Sizes", "Target", "Panels", "Run"]
    net.group("1  Server", (90, 120, 144, 220), ["Start", "StartServer", "Answer"])
    net.group("2  Surface and settings", (90, 255, 183, 77), [*corners, *shape])
    net.group("3  Send", (110, 102, 187, 160), ["Send", "Status"])
    net.group("4  Collect", (110, 100, 181, 246), ["Collect", "Labels", "Report"])
    net.group("The unrolled domain", (90, 179, 157, 219), ["Domain", "Summary"])
    return net.archive()


def server(net: Network) -> None:
    """What starts the server, and a word on how to begin."""
    net.panel("Guide", "Start here", (20, -290, 290, 130), text=GUIDE)
    net.toggle("Start", "Start", 370, -262)
    net.script("StartServer", 530, -276, {"Start": "Start"})
    net.panel("Answer", "Server", (740, -276, 270, 64), "StartServer.Status")


def settings(net: Network) -> None:
    """Boundary corners, pattern and panels."""
    net.geometry(POINT, "Point", "Corners", "Corners", 40, 0)
    net.panel("Degrees", "Angles", (30, 34, 100, 46), text="240")
    net.value_list("Unit", "Unit", ["deg", "60", "90", "rad"], 30, 96)
    wires = {"Points": "Corners", "Angle": "Degrees", "Unit": "Unit", "Mesh": "Mesh"}
    net.script("BoundaryAngles", 225, 0, wires)
    net.panel("Balance", "Balance", (420, 40, 170, 64), "BoundaryAngles.Balance")
    net.value_list("Kind", "Kind", ["hex", "triangle", "quad"], 30, 158)
    net.slider("Around", "Around", 24, 6, 96, 30, 194)
    net.script("Pattern", 265, 150, {"Kind": "Kind", "Around": "Around"})
    net.slider("Sizes", "Sizes", 11, 1, 40, 30, 356)
    net.value_list("Target", "Target", ["inscribed", "best", "shortest", "mean"], 30, 390)
    net.script("Panels", 265, 350, {"Sizes": "Sizes", "Target": "Target"})
