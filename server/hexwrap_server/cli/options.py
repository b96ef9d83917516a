"""Every field of a request as an option of the command line. Options are data; the schemas check values."""

from __future__ import annotations

import argparse
import types
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel

from hexwrap_server.input.schemas import Body, Meshing, Path
from hexwrap_server.problems import FormError


@dataclass(frozen=True)
class Option:
    """flag: on the command line. path: of the field in the request. numbers: how many values it takes."""

    flag: str
    path: Path
    help: str
    metavar: str | tuple[str, ...] = "N"
    numbers: int | None = None


OPTIONS = (
    Option("--name", ("name",), "name of the job, the title of pictures and drawings", "TEXT"),
    Option("--boundary", ("boundary", "mode"), "what the boundary becomes in the domain"),
    Option("--angle-unit", ("boundary", "angle_unit"), "unit of --angle"),
    Option("--quantum", ("boundary", "quantum"), "what the cone angle is a multiple of"),
    Option("--spread", ("boundary", "spread"), "how an isometric boundary takes up the rounding"),
    Option("--pattern", ("pattern", "kind"), "kind of cells; 'none' stops after the map"),
    Option("--around", ("pattern", "around"), "cells around the surface"),
    Option(
        "--edge-length", ("pattern", "edge_length"), "mean edge length of the cells on the surface", "LENGTH"
    ),
    Option(
        "--rotation",
        ("pattern", "rotation"),
        "'edge' or 'vertex' along the boundary, 'u' or 'v' of a NURBS surface, or degrees",
        "WAY",
    ),
    Option("--align", ("pattern", "align"), "on which loops a line of the pattern lies exactly"),
    Option("--cells", ("pattern", "boundary"), "keep whole cells only, or trim cells at the boundary"),
    Option("--phase", ("pattern", "phase"), "shift of the pattern in cells, where it is free", ("A", "B"), 2),
    Option(
        "--panels",
        ("panels", "mode"),
        "individual panels or one watertight mesh; 'none' stops after the pattern",
    ),
    Option(
        "--sizes",
        ("panels", "sizes"),
        "number of edge lengths, fewer where some would be alike; 'none': one per panel",
    ),
    Option("--size-cost", ("panels", "size_cost"), "what the sizes are best for"),
    Option("--edge-range", ("panels", "edge_range"), "allowed edge lengths", ("MIN", "MAX"), 2),
    Option("--target", ("panels", "target"), "limit of a panel's size"),
    Option("--orientation", ("panels", "orientation"), "planes of best fit, or tangent to the surface"),
    Option("--joint", ("panels", "joint"), "least width left open between panels", "LENGTH"),
    Option("--method", ("panels", "method"), "closed forms, or minimised energies"),
    Option(
        "--weight-planarity", ("panels", "weights", "planarity"), "weight of planarity in the energy", "W"
    ),
    Option("--weight-angle", ("panels", "weights", "angle"), "weight of equal angles", "W"),
    Option("--weight-edge", ("panels", "weights", "edge"), "weight of equal edges", "W"),
    Option("--weight-surface", ("panels", "weights", "surface"), "weight of closeness to the surface", "W"),
    Option(
        "--increment", ("panels", "increment"), "edge lengths are rounded down to its multiples", "LENGTH"
    ),
    Option("--inset", ("panels", "components", "inset"), "components: outline moved inwards", "LENGTH"),
    Option(
        "--thickness", ("panels", "components", "thickness"), "components: thickness of the solids", "LENGTH"
    ),
    Option("--depth", ("panels", "components", "depth"), "depth of the support's beams", "LENGTH"),
)
MESHING = (
    Option("--max-edge", ("max_edge",), "NURBS surfaces: longest edge of the mesh", "LENGTH"),
    Option("--tolerance", ("tolerance",), "NURBS surfaces: greatest distance of the mesh", "LENGTH"),
)
ANGLES: Path = ("boundary", "angles")
SUPPORT: Path = ("support",)
#: Fields of which a request gives one.
SIZES: tuple[Path, Path] = (("pattern", "around"), ("pattern", "edge_length"))
ANGLE_HELP = (
    "target angle at a boundary vertex, for --boundary angles; PLACE is an index of the sent mesh or X,Y,Z "
    "(any number of times)"
)
SUPPORT_HELP = "add the torsion-free support structure, with beams where there is a --depth"
#: Sections of which 'none' makes null.
SECTIONS = (("pattern", "kind"), ("panels", "mode"))


def add_request_options(parser: argparse.ArgumentParser) -> None:
    """All of them, with the schema's choices and defaults in the help.

    What is not given leaves no attribute, because ``--sizes none`` is not the same as silence.
    """
    group = parser.add_argument_group("request (defaults as of the service, or what the request file says)")
    for option in OPTIONS:
        _add(group, option, Body)
    group.add_argument(
        "--angle",
        dest="angles",
        action="append",
        default=argparse.SUPPRESS,
        metavar="PLACE=ANGLE",
        help=ANGLE_HELP,
    )
    group.add_argument("--support", action="store_true", default=argparse.SUPPRESS, help=SUPPORT_HELP)
    for option in MESHING:
        _add(group, option, Meshing)


def asked_body(arguments: argparse.Namespace, body: dict[str, Any]) -> dict[str, Any]:
    """The request body with what was asked on the command line. Raises FormError for a malformed --angle."""
    asked = dict(body)
    given = {o.path: getattr(arguments, _name(o)) for o in OPTIONS if hasattr(arguments, _name(o))}
    for size, other in (SIZES, SIZES[::-1]):
        if given.get(size) is not None:  # takes the place of the size that the request may have
            _put(asked, other, None)
    for path, value in given.items():
        _put(asked, path, value)
    if hasattr(arguments, "angles"):
        _put(asked, ANGLES, [_angle(text) for text in arguments.angles])
        asked["boundary"].setdefault("mode", "angles")
    if hasattr(arguments, "support"):
        asked["support"] = True
    return asked


def asked_meshing(arguments: argparse.Namespace) -> dict[str, Any]:
    """The fields of ``surface.mesh`` that were asked for."""
    given = {option.path[0]: getattr(arguments, _name(option), None) for option in MESHING}
    return {name: value for name, value in given.items() if value is not None}


def is_option_at_fault(arguments: argparse.Namespace, pointers: Iterable[str]) -> bool:
    """Whether a fault that was found in the request came from an option."""
    given = _given(arguments)
    return any(_within(at, place) or (at and _within(place, at)) for at in pointers for place in given)


def as_options(arguments: argparse.Namespace, faults: Iterable[tuple[str, str]]) -> FormError:
    """The same faults, with options named where they came from one."""
    given = _given(arguments)

    def name(pointer: str) -> str:
        return next((flag for place, flag in given.items() if _within(pointer, place)), pointer)

    return FormError([(name(pointer), detail) for pointer, detail in faults])


def _given(arguments: argparse.Namespace) -> dict[str, str]:
    """Pointers to the fields that were asked for by options, and the options."""
    paths = [(o, "/".join(("", *o.path))) for o in OPTIONS]
    paths += [(o, f"/surface/mesh/{o.path[0]}") for o in MESHING]
    given = {pointer: o.flag for o, pointer in paths if hasattr(arguments, _name(o))}
    return given | ({"/boundary/angles": "--angle"} if hasattr(arguments, "angles") else {})


def readme_rows() -> str:
    """The options as rows of the README's table."""
    rows = [(o.flag, ".".join(o.path), _help(o, Body)) for o in OPTIONS]
    rows.append(("--angle", ".".join(ANGLES), ANGLE_HELP))
    rows.append(("--support", ".".join(SUPPORT), SUPPORT_HELP))
    rows += [(o.flag, f"surface.mesh.{o.path[0]}", _help(o, Meshing)) for o in MESHING]
    return "\n".join(f"| `{flag}` | `{path}` | {words} |" for flag, path, words in rows)


def _help(option: Option, model: type[BaseModel]) -> str:
    """What an option does, with choices and default."""
    choices, default = _field(model, option.path)
    words = f": {', '.join(choices)}" if choices else ""
    return option.help + words + ("" if default in (None, "") else f" (default: {_shown(default)})")


def _within(pointer: str, section: str) -> bool:
    return pointer == section or pointer.startswith(f"{section}/")


def field_paths(model: type[BaseModel] = Body, root: Path = ()) -> Iterator[Path]:
    """The fields of a request that are no sections themselves."""
    for name in model.model_fields:
        section = _section(model, name)
        if section is None:
            yield (*root, name)
        else:
            yield from field_paths(section, (*root, name))


def _add(group: argparse._ArgumentGroup, option: Option, model: type[BaseModel]) -> None:
    choices, default = _field(model, option.path)
    if option.path in SECTIONS:
        choices = (*choices, "none")
    shown = "" if default in (None, "") else f" (default: {_shown(default)})"
    group.add_argument(
        option.flag,
        dest=_name(option),
        default=argparse.SUPPRESS,
        nargs=option.numbers,
        choices=choices or None,
        type=_value if not choices and option.path != ("name",) else str,
        metavar=None if choices else option.metavar,
        help=option.help + shown,
    )


def _name(option: Option) -> str:
    return "option_" + "_".join(option.path)


def _shown(default: Any) -> str:
    return " ".join(f"{x:g}" for x in default) if isinstance(default, list) else str(default)


def _value(text: str) -> object:
    """A number where it reads as one, null for 'none', else the word; judging it is the schema's part."""
    if text.lower() in ("none", "null"):
        return None
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _angle(text: str) -> dict[str, object]:
    place, sign, angle = text.rpartition("=")
    parts = place.split(",")
    if not sign or len(parts) not in (1, 3):
        raise FormError.at(
            "/boundary/angles", f"--angle {text}: give VERTEX=ANGLE or X,Y,Z=ANGLE, such as --angle 12=2.0944"
        )
    where = {"vertex": _value(place)} if len(parts) == 1 else {"point": [_value(part) for part in parts]}
    return {**where, "angle": _value(angle)}


def _put(body: dict[str, Any], path: Path, value: object) -> None:
    """Set a field, without changing the sections of the body that was given."""
    if path in SECTIONS and value == "none":
        body[path[0]] = None
        return
    for step in path[:-1]:
        body[step] = dict(body.get(step) or {})
        body = body[step]
    body[path[-1]] = value


def _field(model: type[BaseModel], path: Path) -> tuple[tuple[str, ...], Any]:
    """Choices (none: free) and default of a field."""
    for step in path[:-1]:
        section = _section(model, step)
        assert section is not None, path
        model = section
    field = model.model_fields[path[-1]]
    words = get_args(field.annotation) if get_origin(field.annotation) is Literal else ()
    return words, field.get_default()


def _section(model: type[BaseModel], name: str) -> type[BaseModel] | None:
    """The model of a field that is a section, possibly null."""
    annotation = model.model_fields[name].annotation
    kinds = get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else (annotation,)
    return next((k for k in kinds if isinstance(k, type) and issubclass(k, BaseModel)), None)
