"""Where the two kinds of Rhino differ: IronPython 2.7 in Rhino 7, CPython with Python.NET in Rhino 8.

``HEXWRAP_RULES`` names the kind whose files run; the stand-ins refuse what that kind refuses.
"""

import json
import os

RHINO8 = os.environ["HEXWRAP_RULES"] == "rhino8"


def _as_ironpython(dumps):
    """IronPython's str holds any letter; its json takes those beyond ASCII for bytes when it escapes them."""

    def guarded(document, **settings):
        text = dumps(document, **dict(settings, ensure_ascii=False))
        if settings.get("ensure_ascii", True) and any(ord(c) > 127 for c in text):
            raise UnicodeError("unknown byte: the text is taken for UTF-8")
        return dumps(document, **settings)

    return guarded


if not RHINO8:
    json.dumps = _as_ironpython(json.dumps)


class Interface(object):
    """An object seen through IGH_Param: Python.NET shows what the interface has, and where the rest is."""

    def __init__(self, hidden):
        self.__implementation__ = hidden


def behind_interface(parameter):
    """A source of an input as Python gets it."""
    return Interface(parameter) if RHINO8 else parameter


def as_object(value):
    """A value handed to .NET as System.Object."""
    import System

    if RHINO8:
        assert type(value) is not int, "%r would arrive as Python's own number" % (value,)
        assert not isinstance(value, (list, tuple, dict)), "%r is nothing of .NET's" % (value,)
    return int(value) if isinstance(value, System.Int32) else value


def cast(value, hint):
    """What a type hint makes of something wired to an input; None where it can do nothing."""
    from Rhino import Geometry

    if value is None or hint == "none":
        return value
    if hint == "curve":
        return value if isinstance(value, Geometry.Curve) else getattr(value, "ToNurbsCurve", lambda: None)()
    if hint == "mesh":
        if isinstance(value, (Geometry.Brep, Geometry.Surface)):
            return value.meshed()
        return value if isinstance(value, Geometry.Mesh) else None
    if hint == "point":
        value = getattr(value, "Location", value)
        return value if isinstance(value, Geometry.Point3d) else None
    if hint == "int":
        return int(round(float(value)))
    if hint == "float":
        return float(value)
    if hint == "bool":
        return bool(value)
    assert hint == "str", hint
    return (
        value
        if isinstance(value, type(""))
        else (str(value) if str is type("") else str(value).decode("utf-8"))
    )
