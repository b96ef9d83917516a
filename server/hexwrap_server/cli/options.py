"""Every setting of a request as an option of the command line. What values mean is for ``form`` to judge."""

from __future__ import annotations

import argparse
import pathlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from hexwrap_server.errors import FormError
from hexwrap_server.input.curves import READERS, drawn, read_drawing
from hexwrap_server.input.faults import Path, pointer
from hexwrap_server.input.form import Body, ExploreBody, Leaf, is_nullable, leaves

#: Flags that are neither the setting's name nor, for the first setting of a section, the section's.
FLAGS: dict[Path, str] = {
    ("boundary", "angles"): "--angle",
    ("boundary", "loops"): "--loop",
    ("pattern", "boundary"): "--cells",
    ("panels", "weights", "planarity"): "--weight-planarity",
    ("panels", "weights", "angle"): "--weight-angle",
    ("panels", "weights", "edge"): "--weight-edge",
    ("panels", "weights", "surface"): "--weight-surface",
    ("panels", "fold"): "--at-folds",
    ("surface", "features", "angle"): "--fold",
    ("surface", "features", "lines"): "--feature-lines",
    ("surface", "features", "without"): "--without-features",
}
#: Sections of the body of an exploration that are options of ``hexwrap explore``.
EXPLORE = {"vary": "--{}", "limits": "--max-{}", "cost": "--{}", "variants": "--{}", "seed": "--{}"}
#: Settings of which a request gives one.
SIZES: tuple[Path, Path] = (("pattern", "around"), ("pattern", "edge_length"))


@dataclass(frozen=True)
class Option:
    """flag: on the command line. is_first: of a section that may be null, which 'none' makes it."""

    flag: str
    leaf: Leaf
    is_first: bool

    @property
    def path(self) -> Path:
        return self.leaf.path

    @property
    def name(self) -> str:
        """In the namespace of parsed arguments."""
        return "option_" + "_".join(self.path)

    @property
    def words(self) -> tuple[str, ...]:
        """Words that are accepted, where nothing else is."""
        if self.leaf.is_free:
            return ()
        return (*self.leaf.choices, "none") if self.is_first else self.leaf.choices

    @property
    def help(self) -> str:
        """What it does, with its default."""
        text, default = self.leaf.setting.help, self.leaf.default
        if self.leaf.is_list:
            return f"{text}; PLACE is {_places(self.leaf)} (any number of times)"
        if self.leaf.is_lines:
            return f"{text}: a {', '.join(READERS)} file, or X,Y,Z;X,Y,Z;… (any number of times)"
        if self.is_first:
            text += "; 'none' leaves it out"
        if default is None or default is False or default == "":
            return text
        shown = default if isinstance(default, tuple) else (default,)
        return f"{text} (default: {' '.join(f'{x:g}' if isinstance(x, float) else str(x) for x in shown)})"


def _options() -> Iterator[Option]:
    seen = set()
    for leaf in leaves(Body):
        section, name = leaf.path[0], leaf.path[-1]
        is_first = len(leaf.path) == 2 and section != "surface" and section not in seen
        seen.add(section)
        flag = FLAGS.get(leaf.path, f"--{section if is_first else name}".replace("_", "-"))
        yield Option(flag, leaf, is_first and is_nullable(Body, section))


def _explore_options() -> Iterator[Option]:
    for leaf in leaves(ExploreBody):
        if leaf.path[0] in EXPLORE:
            name = leaf.path[-1].removeprefix("max_").replace("_", "-")
            yield Option(EXPLORE[leaf.path[0]].format(name), leaf, False)


OPTIONS = tuple(_options())
EXPLORE_OPTIONS = tuple(_explore_options())


def add_explore_options(parser: argparse.ArgumentParser) -> None:
    """Those that only ``hexwrap explore`` has."""
    group = parser.add_argument_group("exploration")
    for option in EXPLORE_OPTIONS:
        group.add_argument(
            option.flag,
            dest=option.name,
            nargs="+" if option.path[0] == "vary" else None,
            type=_word,
            default=argparse.SUPPRESS,
            metavar="X",
            help=option.help.replace("%", "%%"),
        )


def add_request_options(parser: argparse.ArgumentParser, section: str = "") -> None:
    """All of them, or those of one section, with choices and defaults in the help.

    What is not given leaves no attribute, because ``--sizes none`` is not the same as silence.
    """
    group = parser.add_argument_group("request (defaults as of the service, or what the request file says)")
    for option in (one for one in OPTIONS if section in ("", one.path[0])):
        leaf, word = option.leaf, _metavar(option.leaf)
        how: dict[str, Any] = {"dest": option.name, "default": argparse.SUPPRESS, "help": option.help}
        if leaf.is_list:
            how |= {"action": "append", "metavar": f"PLACE={leaf.entry[-1].upper()}"}
        elif leaf.is_lines:
            how |= {"action": "append", "metavar": "FILE"}
        elif leaf.default is False:
            how |= {"action": "store_true"}
        elif option.words:
            how |= {"choices": option.words}
        else:
            how |= {"type": str if leaf.is_text else _value, "metavar": word}
            if leaf.numbers > 1:
                how |= {"nargs": leaf.numbers, "metavar": (word,) * leaf.numbers}
        group.add_argument(option.flag, **how)


def asked_body(arguments: argparse.Namespace, body: dict[str, Any]) -> dict[str, Any]:
    """The request body with what was asked on the command line. Raises FormError for a malformed --angle."""
    asked = dict(body)
    given = {o.path: (o, getattr(arguments, o.name)) for o in _given(arguments) if _fits(o, body)}
    for size, other in (SIZES, SIZES[::-1]):
        if (
            size in given and given[size][1] is not None
        ):  # takes the place of the size that the request may have
            _put(asked, other, None)
    for path, (option, value) in given.items():
        if option.is_first and value in ("none", None):
            asked[path[0]] = None
        elif option.leaf.is_list:
            _put(asked, path, [_entry(option, text) for text in value])
        elif option.leaf.is_lines:
            _put(asked, path, [line for text in value for line in _lines(option, text)])
        else:
            _put(asked, path, value)
    if ("boundary", "angles") in given and isinstance(asked["boundary"], dict):
        asked["boundary"].setdefault("mode", "angles")
    return asked


def _fits(option: Option, body: dict[str, Any]) -> bool:
    """Sizes of meshes are for surfaces that are not meshes already."""
    surface = body.get("surface")
    return (
        option.path[:2] != ("surface", "mesh") or not isinstance(surface, dict) or "vertices" not in surface
    )


def is_option_at_fault(arguments: argparse.Namespace, pointers: Iterable[str]) -> bool:
    """Whether a fault that was found in the request came from an option."""
    given = [pointer(option.path) for option in _given(arguments)]
    return any(_within(at, place) or (at and _within(place, at)) for at in pointers for place in given)


def as_options(arguments: argparse.Namespace, faults: Iterable[tuple[str, str]]) -> FormError:
    """The same faults, with options named where they came from one."""
    given = {pointer(option.path): option.flag for option in _given(arguments)}

    def name(at: str) -> str:
        return next((flag for place, flag in given.items() if _within(at, place)), at)

    return FormError([(name(at), detail) for at, detail in faults])


def table() -> str:
    """The options as rows of the documentation's table."""
    rows = []
    for option in OPTIONS:
        words = "" if option.leaf.is_free else ", ".join(f"`{word}`" for word in option.leaf.choices)
        rows.append(f"| `{option.flag}` | `{'.'.join(option.path)}` | {option.help} | {words} |")
    return "\n".join(rows)


def explore_table() -> str:
    """Those that only ``hexwrap explore`` has as rows of the documentation's table."""
    return "\n".join(f"| `{one.flag}` | `{'.'.join(one.path)}` | {one.help} |" for one in EXPLORE_OPTIONS)


def _given(arguments: argparse.Namespace) -> list[Option]:
    return [option for option in (*OPTIONS, *EXPLORE_OPTIONS) if hasattr(arguments, option.name)]


def _within(at: str, section: str) -> bool:
    return at == section or at.startswith(f"{section}/")


def _metavar(leaf: Leaf) -> str:
    if leaf.is_text:
        return "TEXT"
    return "LENGTH" if leaf.setting.unit == "length" else "VALUE" if leaf.choices else "N"


def _value(text: str) -> object:
    """A number where it reads as one, null for 'none', else the word."""
    if text.lower() in ("none", "null"):
        return None
    return _word(text)


def _word(text: str) -> object:
    """A number where it reads as one, else the word."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _places(leaf: Leaf) -> str:
    """How an entry of a list names its place."""
    number, points, _ = leaf.entry
    ways = [] if number is None else [f"the number of a {number}"]
    return " or ".join([*ways, "X,Y,Z;X,Y,Z;…" if points == "line" else "X,Y,Z"])


def _entry(option: Option, text: str) -> dict[str, object]:
    """An entry of a list: a place, and what is wanted there."""
    number, points, wanted = option.leaf.entry
    place, sign, value = text.rpartition("=")
    parts = [part.split(",") for part in place.split(";")]
    asked = {wanted: _value(value)}
    if sign and number is not None and len(parts) == 1 and len(parts[0]) == 1:
        return {number: _value(place), **asked}
    if not sign or any(len(part) != 3 for part in parts) or (len(parts) > 1 and points != "line"):
        ways = [] if number is None else [number.upper()]
        ways.append("X,Y,Z;X,Y,Z" if points == "line" else "X,Y,Z")
        raise FormError.at(
            pointer(option.path),
            f"{option.flag} {text}: give {' or '.join(f'{way}={wanted.upper()}' for way in ways)}",
        )
    line = [[_value(x) for x in part] for part in parts]
    return {points: line if points == "line" else line[0], **asked}


def _lines(option: Option, text: str) -> list[list[list[Any]]]:
    """The curves of a drawing, or one line of points. Raises FormError, DrawingError."""
    points = [part.split(",") for part in text.split(";")]
    if len(points) > 1 and all(len(point) == 3 for point in points):
        return [[[_value(x) for x in point] for point in points]]
    curves = [drawn(curve) for curve in read_drawing(pathlib.Path(text)).curves if len(curve.points) > 1]
    if not curves or any(points.shape[1] != 3 for points in curves):
        raise FormError.at(pointer(option.path), f"{option.flag} {text}: no curves of points x, y, z in it")
    return [points.tolist() for points in curves]


def _put(body: dict[str, Any], path: Path, value: object) -> None:
    """Set a field without changing the sections of the given body; a section of the wrong type stays, to be
    refused."""
    for step in path[:-1]:
        section = body.get(step)
        if not isinstance(section, dict | None):
            return
        body[step] = dict(section or {})
        body = body[step]
    body[path[-1]] = value
