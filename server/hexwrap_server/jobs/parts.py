"""The parts of a Result, and how its text is taken apart and put together without being parsed."""

from __future__ import annotations

#: Names that ``?include=`` takes, in the order of the Result.
PARTS = ("mesh", "map", "pattern", "panels", "sizes", "quality", "components", "support", "timings")

#: Asked for beside parts: ``map`` then has ``corners``, whatever its kind.
CORNERS = "corners"

#: Where each part stands in the text of a Result.
Places = dict[str, tuple[int, int]]


def names(include: str) -> tuple[list[str], list[str]]:
    """The parts named in ``a,b,c``, and the words that name none."""
    wanted = [name.strip() for name in include.split(",") if name.strip()]
    known = (*PARTS, CORNERS)
    return [name for name in known if name in wanted], [name for name in wanted if name not in known]


def join_parts(parts: dict[str, bytes]) -> bytes:
    """One JSON object from the JSON of its members."""
    return b"{" + b",".join(b'"%s":%s' % (name.encode(), text) for name, text in parts.items()) + b"}"


def chosen(text: bytes, where: Places, include: list[str]) -> bytes:
    """The Result with only the named parts."""
    return join_parts({name: text[slice(*where[name])] for name in include if name in where})
