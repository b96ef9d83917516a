"""Makes the pictures of the README and of the documentation: python docs/make.py"""

from __future__ import annotations

import io
from pathlib import Path

import ezdxf
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from PIL import Image

from hexwrap_server import samples
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.work import run_stages, take_in
from hexwrap_server.output.colours import class_colours, panel_colours
from hexwrap_server.output.picture import panels_scene
from hexwrap_server.output.scene import render
from hexwrap_server.output.writers import Meta, write
from hexwrap_solver.pipeline import PlainRunner, Solution
from hexwrap_solver.singularities.solve import seated
from hexwrap_solver.singularities.types import SingularitySettings

HERE = Path(__file__).parent
#: Pixels of the front picture.
WIDTH = 900
#: Sample → what its picture shows.
CASES = {
    "tower": "straight cylinder (Figures 1 and 5, left)",
    "cone": "corners on a cone (Figures 5 and 6, middle)",
    "isometric": "isometric boundary (Figures 5 and 6, right)",
    "entrance": "entrances (Figure 7, left)",
    "diagrid": "concentration (Figure 7, right)",
    "ring": "a flat ring, cone angle 2π",
    "singular": "three heptagons: fewer sizes",
    "openings": "a door and windows",
    "dome": "a dome",
    "roof": "a roof along its four sides",
    "box": "the pattern folds at the corners",
    "patches": "three patches, two creases",
}


def solved(name: str) -> Solution:
    """A bundled sample, panelized."""
    request = parse_request(samples.load(name), 10**7, 10**6)
    assert not isinstance(request.surface, str)
    return run_stages(request.surface, request.wanted, PlainRunner())


def draw_domain(axes: Axes, solution: Solution) -> None:
    """The cells in the colours of their sizes, and the boundary of the unrolled domain."""
    cmap, pattern, panels = solution.map, solution.pattern, solution.panels
    assert pattern is not None
    assert panels is not None
    z = pattern.corners
    cells = np.split(np.stack([z.real, z.imag], axis=1), pattern.faces.offsets[1:-1])
    size = np.full(pattern.n_cells, -1)
    size[panels.face] = panels.size
    colours = panel_colours(size, class_colours(panels))
    axes.add_collection(PolyCollection(cells, facecolors=colours, edgecolors="#2a2e35", linewidths=0.25))
    at, faces = cmap.corners(), cmap.surface.faces
    tail, head = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    key = np.minimum(tail, head) * len(cmap.surface.vertices) + np.maximum(tail, head)
    _, index, count = np.unique(key, return_index=True, return_counts=True)
    rim = index[count == 1]
    ends = np.stack([at.ravel()[rim], at[:, [1, 2, 0]].ravel()[rim]], axis=1)
    axes.add_collection(
        LineCollection(np.stack([ends.real, ends.imag], -1), colors="#16202e", linewidths=1.1)
    )
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.set_axis_off()


def cases() -> None:
    """Domain and surface side by side, for every boundary condition."""
    rows = (len(CASES) + 1) // 2
    figure = Figure(figsize=(16, 3.9 * rows), dpi=100, facecolor="white")
    space = {"left": 0.01, "right": 0.99, "bottom": 0.01, "top": 0.95, "wspace": 0.05, "hspace": 0.14}
    grid = figure.subplots(rows, 4, gridspec_kw=space)
    for place, (name, title) in enumerate(CASES.items()):
        domain, surface = grid.reshape(-1, 2)[place]
        solution = solved(name)
        draw_domain(domain, solution)
        domain.set_title(title, fontsize=13, color="#23262b", loc="left", pad=10)
        surface.imshow(render(panels_scene(solution)), interpolation="lanczos")
        surface.set_axis_off()
    _save(figure, "cases.png")


def _save(figure: Figure, name: str) -> None:
    """In 256 colours, which takes a quarter of the space."""
    drawn = io.BytesIO()
    figure.savefig(drawn)
    _in_few_colours(Image.open(drawn), name)


def _in_few_colours(picture: Image.Image, name: str) -> None:
    few = picture.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    few.save(HERE / name, optimize=True)


def sheet() -> Figure:
    """The first sheet of ``flat.dxf``, drawn from the file itself."""
    document = ezdxf.read(
        io.StringIO(write("flat.dxf", solved("entrance"), Meta("entrance", unit="m")).decode())
    )
    space = document.modelspace()
    width, height = 3.0, 1.5
    figure = Figure(figsize=(10.0, 10.0 * (height + 0.22) / (width + 0.1)), dpi=110)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(-0.05, width + 0.05), ylim=(-0.05, height + 0.17))
    axes.set_axis_off()
    points = 10.0 * 72 / (width + 0.1)  # in a unit of the drawing
    for line in space.query("LWPOLYLINE"):
        corners = np.array([*line.get_points("xy"), *(line.get_points("xy")[:1] if line.closed else [])])
        if corners[:, 0].max() <= width * (1 + 1e-9):
            colour = [c / 255 for c in document.layers.get(line.dxf.layer).rgb or (0, 0, 0)]
            axes.plot(*corners.T, color=colour, lw=1.4)
    for word in space.query("TEXT"):
        middle = bool(word.dxf.halign)
        x, y, _ = (word.dxf.align_point if middle else word.dxf.insert).xyz
        if x < width:
            place = {"ha": "center", "va": "center"} if middle else {"ha": "left", "va": "bottom"}
            axes.text(
                x, y, word.dxf.text, fontsize=1.35 * points * word.dxf.height, rotation=word.dxf.rotation,
                rotation_mode="anchor", color="#4a4f58", **place,
            )  # fmt: skip
    return figure


def singularities() -> Figure:
    """The curve over their number for 3, 5 and 11 sizes beside the domain and the surface they lead to."""
    request = parse_request(samples.load("singular"), 10**7, 10**6)
    assert not isinstance(request.surface, str)
    wanted, surface = request.wanted, take_in(request.surface, request.wanted.surface)
    figure = Figure(figsize=(13, 4.2), dpi=100, facecolor="white")
    curve, domain, space = figure.subplots(1, 3, gridspec_kw={"width_ratios": [1.25, 1, 0.9], "wspace": 0.1})
    for sizes, colour in ((3, "#c2410c"), (5, "#b8860b"), (11, "#1f6f78")):
        seats = seated(surface, wanted.boundary.adapted("hex"), SingularitySettings(6), wanted.pattern, sizes)
        found = seats.placing.proposals
        curve.plot([one.count for one in found], [100 * one.uncovered for one in found], "o-", color=colour)
        curve.annotate(f"{sizes} sizes", (found[-1].count, 100 * found[-1].uncovered), xytext=(8, 0),
                       color=colour, textcoords="offset points", va="center", fontsize=11)  # fmt: skip
    curve.set(xlabel="singularities", ylabel="uncovered, %", ylim=(0, None), xlim=(-0.3, 7.4))
    curve.spines[["top", "right"]].set_visible(False)
    solution = solved("singular")
    draw_domain(domain, solution)
    space.imshow(render(panels_scene(solution)), interpolation="lanczos")
    space.set_axis_off()
    figure.subplots_adjust(left=0.05, right=0.99, bottom=0.12, top=0.97)
    return figure


def main() -> None:
    picture = Image.open(
        io.BytesIO(write("panels.png", solved("singular"), Meta("tower with three heptagons")))
    )
    size = (WIDTH, round(picture.height * WIDTH / picture.width))
    _in_few_colours(picture.convert("RGB").resize(size, Image.Resampling.LANCZOS), "tower.png")
    cases()
    (HERE / "domain.svg").write_bytes(write("domain.svg", solved("entrance"), Meta("entrance")))
    _save(sheet(), "sheet.png")
    _save(singularities(), "singularities.png")


if __name__ == "__main__":
    main()
