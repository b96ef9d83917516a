"""Values as Rhino's component Hops sends them: data trees whose items are JSON texts.

A tree is ``{"{0;3}": [{"type": "System.Double", "data": "1.5"}, …]}``; geometry is what rhino3dm encodes.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import rhino3dm

from hexwrap_server.errors import HopsError
from hexwrap_server.http.hops.components import RESULT_TYPES, Parameter


def read_inputs(parameters: tuple[Parameter, ...], values: object) -> tuple[dict[str, Any], list[int]]:
    """Value of every parameter, and the branch that the first one came from. Raises HopsError.

    An input that was left out, or whose tree holds no item but nulls, has its default.
    """
    trees = _trees(values)
    unknown = trees.keys() - {p.name for p in parameters}
    if unknown:
        raise HopsError(f"Unknown input {sorted(unknown)[0]!r}; place the Hops component anew.")
    found: dict[str, Any] = {}
    branch = [0]
    for number, parameter in enumerate(parameters):
        tree = trees.get(parameter.name, {})
        items = [(path, item) for path, row in tree.items() for item in row if not _is_null(item)]
        if not items:
            if parameter.required:
                raise HopsError(f"{parameter.name} is empty: {parameter.description}")
            found[parameter.name] = [] if parameter.many else parameter.default
            continue
        if not parameter.many and len(items) > 1:
            raise HopsError(f"{parameter.name} takes one item, not {len(items)}: graft the data.")
        read = [_read(parameter, item) for _, item in items]
        found[parameter.name] = read if parameter.many else read[0]
        if number == 0:
            branch = _branch(items[0][0])
    return found, branch


def _trees(values: object) -> dict[str, dict[str, list[Any]]]:
    if not isinstance(values, list):
        raise HopsError("'values' must be a list of parameters.")
    trees: dict[str, dict[str, list[Any]]] = {}
    for value in values:
        name = value.get("ParamName") if isinstance(value, dict) else None
        tree = value.get("InnerTree") if isinstance(value, dict) else None
        if not isinstance(name, str) or not isinstance(tree, dict):
            raise HopsError("Every entry of 'values' needs a 'ParamName' and an 'InnerTree'.")
        if not all(isinstance(row, list) for row in tree.values()):
            raise HopsError(f"{name}: every branch must be a list.")
        trees[name] = tree
    return trees


def _branch(path: str) -> list[int]:
    """``{0;3}`` → [0, 3]"""
    try:
        return [int(word) for word in path.strip("{} ").split(";")]
    except ValueError:
        raise HopsError(f"'{path[:40]}' is not a path of a data tree.") from None


def _is_null(item: Any) -> bool:
    return item is None or (isinstance(item, dict) and item.get("data") in (None, "", "null"))


def _read(parameter: Parameter, item: Any) -> Any:
    if not isinstance(item, dict) or not isinstance(item.get("data"), str):
        raise HopsError(f"{parameter.name}: every item needs its 'data' as a text of JSON.")
    try:
        value = json.loads(item["data"])
        match parameter.kind:
            case "Text":
                return str(value)
            case "Integer":
                return int(value)
            case "Number":
                return float(value)
            case "Point":
                return [float(value[axis]) for axis in "XYZ"]
        decoded = _decode(value)
    except (ValueError, TypeError, KeyError, RuntimeError, OverflowError):
        decoded = None
    if decoded is None:
        raise HopsError(f"{parameter.name}: an item cannot be read as a {parameter.kind.lower()}.")
    if not isinstance(decoded, _GEOMETRY[parameter.kind]):
        came, needed = type(decoded).__name__, _NEEDED[parameter.kind]
        raise HopsError(f"{parameter.name}: a {came} came, but {needed} is needed.")
    return decoded


def _decode(value: Any) -> Any:
    common: Any = rhino3dm.CommonObject
    return common.Decode(value)


def output(parameter: Parameter, branches: dict[tuple[int, ...], list[Any]]) -> dict[str, Any]:
    """A tree on its way back: branch → values, geometry as lists of numbers."""
    kind = RESULT_TYPES[parameter.kind]
    write: Callable[[Any], str] = _WRITE.get(parameter.kind, json.dumps)
    tree = {
        "{" + ";".join(map(str, path)) + "}": [{"type": kind, "data": write(value)} for value in row]
        for path, row in branches.items()
    }
    return {"ParamName": parameter.name, "InnerTree": tree}


def _curve(points: list[Any]) -> str:
    curve: Any = rhino3dm.PolylineCurve(rhino3dm.Point3dList([rhino3dm.Point3d(*p) for p in points]))
    return json.dumps(curve.Encode())


def _plane(frame: list[list[float]]) -> str:
    named = zip(("Origin", "XAxis", "YAxis", "ZAxis"), frame, strict=True)
    return json.dumps({name: dict(zip("XYZ", axis, strict=True)) for name, axis in named})


#: What an input of each kind takes: a surface is meshed by the server.
_GEOMETRY: dict[str, tuple[type, ...]] = {
    "Mesh": (rhino3dm.Mesh, rhino3dm.Brep, rhino3dm.Surface, rhino3dm.SubD),
    "Curve": (rhino3dm.Curve,),
}
_NEEDED = {"Mesh": "a mesh or a surface", "Curve": "a curve"}
_WRITE: dict[str, Callable[[Any], str]] = {"Curve": _curve, "Plane": _plane}
