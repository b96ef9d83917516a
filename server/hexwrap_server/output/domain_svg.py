"""``domain.svg``: the unrolled domain with mesh, boundary, pattern, corners and apex (paper, Figure 5)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from xml.sax.saxutils import escape

import numpy as np

from hexwrap_server.output.colours import class_colours
from hexwrap_server.output.flat import measures
from hexwrap_server.output.layers import size_name
from hexwrap_server.output.meta import Meta
from hexwrap_server.output.text import angle, length, one_line
from hexwrap_server.output.unrolled import Unrolled, cells, drawn, plane
from hexwrap_server.output.viewpoint import corners
from hexwrap_solver.arrays import Complexes, Floats, Ragged
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.pipeline import Solution

#: Drawing units: the longer side of the domain, and the room around it.
SIDE, MARGIN = 1400.0, 90.0
#: Larger meshes are left out: their lines would be a grey mass of many megabytes.
MAX_FACES = 30_000
#: More corners than this are marked, but not named.
MAX_NAMES = 40
#: Names of loops, pixels: openings up to five times ROOM take theirs in their middle, in letters from
#: SMALLEST to LARGEST, a letter being CHARACTER times as wide as high.
ROOM, SMALLEST, LARGEST, CHARACTER = 34, 8.0, 20.0, 0.6
#: Least cosine between the sides of a loop that one name runs along.
STRAIGHT = 0.94
#: The apex is shown where it is not further from the domain than this many times the domain's size.
APEX_REACH = 0.6

STYLE = """
text { font-family: "DejaVu Sans", "Segoe UI", Helvetica, Arial, sans-serif; fill: #23262b; }
.title { font-size: 26px; font-weight: bold; } .note { font-size: 18px; fill: #70757d; }
.mesh { fill: none; stroke: #c3c7cd; stroke-width: 0.5; }
.cells { stroke: #23262b; stroke-linejoin: round; }
.cut { fill: none; stroke: #e8781e; stroke-width: 2.2; stroke-dasharray: 9 6; }
.loop { fill: none; stroke: #16202e; stroke-width: 3.2; stroke-linecap: round; }
.cone { fill: #6a3fa0; stroke: #ffffff; stroke-width: 2; }
.corner { fill: #c8202f; stroke: #ffffff; stroke-width: 2; } .angle { fill: #c8202f; }
.halo { paint-order: stroke; stroke: #ffffff; stroke-width: 5; stroke-linejoin: round; }
.apex { fill: none; stroke: #6a3fa0; stroke-width: 2.5; } .named { font-size: 20px; }
"""


@dataclass(frozen=True)
class Frame:
    """Where the plane's points stand in the drawing: y runs down there."""

    low: Floats
    scale: float
    width: float
    height: float

    @classmethod
    def around(cls, points: Floats) -> Frame:
        extent = np.ptp(points, axis=0)
        scale = SIDE / float(extent.max())
        width, height = (extent * scale + 2 * MARGIN).tolist()
        return cls(points.min(axis=0), scale, width, height)

    def place(self, points: Floats) -> Floats:
        """(…, 2) drawing coordinates."""
        x = MARGIN + (points[..., 0] - self.low[0]) * self.scale
        y = self.height - MARGIN - (points[..., 1] - self.low[1]) * self.scale
        return np.stack([x, y], axis=-1)

    def at(self, z: complex) -> tuple[float, float]:
        """Drawing coordinates of one place."""
        x, y = self.place(np.array([z.real, z.imag])).tolist()
        return x, y


def domain_svg(solution: Solution, meta: Meta) -> bytes:
    """SVG 1.1, complete in itself. Cells across the cut are drawn in one piece, in a sheet of their own."""
    pattern = solution.pattern
    cmap, pieces = drawn(solution.map)
    unrolled = Unrolled.of(cmap)
    outlines = None if pattern is None else cells(pattern, pieces)
    points = [plane(unrolled.start)] if outlines is None else [plane(unrolled.start), outlines.values]
    frame = Frame.around(np.vstack([*points, *_apex(cmap)]))
    parts = []
    if len(cmap.surface.faces) <= MAX_FACES:
        corners_at = frame.place(plane(unrolled.start).reshape(-1, 3, 2))
        parts.append(_path(_outlines(Ragged.from_table(corners_at)), "mesh"))
    if pattern is not None and outlines is not None:
        parts += _cells(solution, pattern, Ragged(frame.place(np.asarray(outlines.values)), outlines.offsets))
    parts.append(_path(_polylines(frame, unrolled.lines(unrolled.cut)), "cut"))
    parts += _loops(cmap, frame, unrolled)
    parts += _corner_marks(cmap, frame, unrolled)
    parts += _apex_mark(cmap, frame)
    parts += _cone_marks(cmap, frame)
    caption = _caption(solution)
    if pieces is not None:
        caption += f"; overlaps itself, drawn in {len(pieces.shift)} pieces"
    return _page(frame, parts, caption, meta).encode()


def _page(frame: Frame, parts: list[str], caption: str, meta: Meta) -> str:
    head, foot = 74.0, 62.0
    width, height = max(frame.width, 620.0), frame.height + head + foot
    title = escape(one_line(meta.name))
    inside = "\n".join(parts)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}"
 viewBox="0 0 {width:.2f} {height:.2f}">
<title>{title}: unrolled domain</title>
<style>{STYLE}</style>
<rect width="100%" height="100%" fill="#ffffff"/>
<text class="title" x="{MARGIN}" y="58">{title}</text>
<g transform="translate({(width - frame.width) / 2:.2f} {head})">
{inside}
</g>
<text class="note" x="{MARGIN}" y="{height - 34:.2f}">{escape(caption)}</text>
</svg>
"""


def _caption(solution: Solution) -> str:
    cmap, pattern = solution.map, solution.pattern
    if cmap.kind == "net":
        loops = len(cmap.surface.loops)
        words = f"net with {loops} loop{'s' * (loops != 1)}"
        if len(cmap.cones):
            words += f" and {len(cmap.cones)} singularit{'ies' if len(cmap.cones) > 1 else 'y'}"
    else:
        turned = "" if cmap.kind == "cylinder" else f", cone angle {angle(cmap.deck.angle)}"
        words = f"{cmap.kind}{turned}, circumference {length(cmap.circumference)}"
    if pattern is not None:
        words += f"; {pattern.n_cells} cells"
    return words


def _apex(cmap: ConformalMap) -> Floats:
    """(1, 2) where it is near enough to be shown, else (0, 2)."""
    if cmap.kind == "net" or cmap.deck.apex is None:
        return np.zeros((0, 2))
    apex, uv = cmap.deck.apex, cmap.uv
    size = abs(complex(np.ptp(uv.real), np.ptp(uv.imag)))
    near = np.abs(uv - apex).min() < APEX_REACH * size
    return plane(np.array([apex] if near else [], dtype=complex))


def _cells(solution: Solution, pattern: Pattern, rows: Ragged) -> list[str]:
    """Cells filled with the colour of their panel's size, one path per size."""
    size = np.full(pattern.n_cells, -1)
    colours: list[str] = []
    if solution.panels is not None:
        size[solution.panels.face] = solution.panels.size
        colours = class_colours(solution.panels)
    outlines = _outlines(rows)
    members: dict[int, list[str]] = {}
    for outline, group in zip(outlines, size.tolist(), strict=True):
        members.setdefault(group, []).append(outline)
    thin = float(np.clip(0.02 * np.sqrt(np.median(measures(rows)[0])), 0.25, 1.6))
    return [
        f'<path class="cells {size_name(group)}" stroke-width="{thin:.2f}"'
        + f' fill="{colours[group] if group >= 0 else "none"}" fill-opacity="0.85"'
        + f' d="{"".join(members[group])}"/>'
        for group in sorted(members)
    ]


def _outlines(rows: Ragged) -> list[str]:
    """A closed path for each row of points."""
    numbers = np.asarray(rows.values).tolist()
    words = [f"L{x:.2f} {y:.2f}" for x, y in numbers]
    bounds = rows.offsets.tolist()
    return ["M" + "".join(words[a:b])[1:] + "Z" for a, b in pairwise(bounds)]


def _path(words: list[str], kind: str) -> str:
    return f'<path class="{kind}" d="{"".join(words)}"/>'


def _polylines(frame: Frame, lines: list[Complexes]) -> list[str]:
    """An open path for each line."""
    return [
        "M" + "L".join(f"{x:.2f} {y:.2f}" for x, y in frame.place(plane(line)).tolist()) for line in lines
    ]


def _loops(cmap: ConformalMap, frame: Frame, unrolled: Unrolled) -> list[str]:
    """Each loop's curve, its name and the way it runs."""
    parts = []
    marked = [vertex for vertex, _ in corners(cmap)]
    for number, (loop, sides) in enumerate(zip(cmap.surface.loops, unrolled.loops, strict=True)):
        parts.append(_path(_polylines(frame, unrolled.lines(sides)), f"loop loop{number}"))
        places = unrolled.start[sides]
        name = _name_inside(frame, places, unrolled.end[sides], f"loop {number}")
        if name:
            parts.append(name)
            continue
        # The name stands where no corner's angle does, and away from the cut.
        taken = np.append(places[np.isin(loop, marked)], unrolled.end[unrolled.cut])
        free = np.abs(places[:, None] - taken).min(axis=1, initial=np.inf)
        middle = sides[int(np.argmax(free)) if len(taken) else len(sides) // 2]
        place = int(np.flatnonzero(sides == middle)[0])
        first, last = _straight_piece(places, unrolled.end[sides], place, 1 / frame.scale)
        along = last - first
        size = float(
            np.clip(0.8 * abs(along) * frame.scale / (CHARACTER * len(f"loop {number} →")), SMALLEST, LARGEST)
        )
        at = (unrolled.start[middle] + unrolled.end[middle] if size == LARGEST else first + last) / 2
        away = along / abs(along) * -1j * ROOM / frame.scale
        x, y = frame.at(at + away)
        turn = -np.degrees(np.angle(along))
        arrow, turn = ("→", turn) if abs(turn) <= 90 else ("←", turn - np.copysign(180, turn))
        words = f"loop {number} {arrow}" if arrow == "→" else f"{arrow} loop {number}"
        parts.append(_words(words, "named", x, y, size, turn))
    return parts


def _straight_piece(start: Complexes, end: Complexes, side: int, near: float) -> tuple[complex, complex]:
    """Where the straight run of a loop's sides (k,) that holds one of them begins and ends. near: ends of
    sides that are not further apart are one; others the cut has parted."""
    first, last = np.roll(start, -side), np.roll(end, -side)
    heading = (last - first) / np.maximum(abs(last - first), 1e-300)
    straight = (np.conj(heading[0]) * heading).real > STRAIGHT
    joined = abs(last - np.roll(first, -1)) <= near  # each with the next
    ahead = int(np.cumprod((straight & np.roll(joined, 1))[1:]).sum())
    behind = int(np.cumprod((straight & joined)[:0:-1]).sum())
    return complex(first[-behind]), complex(last[ahead])


def _name_inside(frame: Frame, start: Complexes, end: Complexes, name: str) -> str:
    """The name in the middle of an opening that a name along its side would be too long for; else nothing.
    start, end: (k,) of the loop's sides."""
    middle = (start + end) / 2
    width, height = np.ptp(middle.real) * frame.scale, np.ptp(middle.imag) * frame.scale
    # where the cut reaches it, it may stand a little open
    closed = np.abs(end - np.roll(start, -1)).max() * frame.scale < 0.3 * max(width, height)
    inside_out = float((np.conj(start) * end).imag.sum()) < 0  # the domain lies around it
    if not (closed and inside_out and max(width, height) < 5 * ROOM):
        return ""
    x, y = frame.at(
        (middle.real.max() + middle.real.min() + 1j * (middle.imag.max() + middle.imag.min())) / 2
    )
    size = float(np.clip(0.9 * width / (CHARACTER * len(name)), SMALLEST, LARGEST))
    return _words(name, "named", x, y, size)


def _words(words: str, kind: str, x: float, y: float, size: float, turn: float = 0.0) -> str:
    """Words around a place. size: of the letters, pixels. turn: degrees."""
    return (
        f'<text class="{kind} halo" style="font-size:{size:.1f}px" text-anchor="middle" '
        f'dominant-baseline="central" transform="translate({x:.2f} {y:.2f}) rotate({turn:.2f})">'
        f"{words}</text>"
    )


def _corner_marks(cmap: ConformalMap, frame: Frame, unrolled: Unrolled) -> list[str]:
    """A dot at each corner of the domain, with its angle."""
    marked = dict(corners(cmap))
    parts = []
    for loop, sides in zip(cmap.surface.loops, unrolled.loops, strict=True):
        for vertex, side in zip(loop.tolist(), sides.tolist(), strict=True):
            if vertex not in marked:
                continue
            place = unrolled.start[side]
            x, y = frame.at(place)
            parts.append(f'<circle class="corner" cx="{x:.2f}" cy="{y:.2f}" r="8"/>')
            if len(marked) > MAX_NAMES:
                continue
            # The inside spans the angle to the left of the side that leaves the corner.
            along = unrolled.end[side] - place
            away = -along / abs(along) * np.exp(0.5j * marked[vertex]) * 30 / frame.scale
            x, y = frame.at(place + away)
            parts.append(_words(angle(marked[vertex]), "angle", x, y, LARGEST))
    return parts


def _cone_marks(cmap: ConformalMap, frame: Frame) -> list[str]:
    """A dot with its index wherever a singularity stands in the net, at each of its images."""
    faces, corners_at = cmap.surface.faces.ravel(), cmap.corners().ravel()
    parts = []
    for vertex, index in zip(cmap.cones.vertex.tolist(), cmap.cones.index.tolist(), strict=True):
        images = frame.place(plane(corners_at[faces == vertex]))
        for x, y in np.unique(np.round(images, 1), axis=0).tolist():
            parts.append(f'<circle class="cone" cx="{x:.2f}" cy="{y:.2f}" r="8"/>')
            parts.append(f'<text class="named halo" x="{x + 14:.2f}" y="{y - 10:.2f}">{index:+d}</text>')
    return parts


def _apex_mark(cmap: ConformalMap, frame: Frame) -> list[str]:
    parts = []
    for x, y in frame.place(_apex(cmap)).tolist():
        parts += [
            f'<path class="apex" d="M{x - 12:.2f} {y:.2f}h24M{x:.2f} {y - 12:.2f}v24"/>',
            f'<circle class="apex" cx="{x:.2f}" cy="{y:.2f}" r="7"/>',
            f'<text class="named halo" x="{x + 16:.2f}" y="{y - 12:.2f}">apex</text>',
        ]
    return parts
