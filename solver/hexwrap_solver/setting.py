"""How a setting is written, once: as an annotated field of a frozen dataclass.

    around: Annotated[int | None, Setting("cells around the surface", ge=1)] = None

Type, choices (``Literal``) and default are the field's own; ``Setting`` says the rest. Whoever needs a form
of the settings (a document, a command line, a table) derives it from this. A field whose type is such a
dataclass is a section, a tuple of them a list. What several fields must agree on is checked in
``__post_init__``.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Setting:
    """What holds of one setting.

    help: one line, without a full stop. ge, gt, le, lt: bounds of every number in it. most: greatest number
    of entries or characters. unit: ``length`` (of the model), ``cells``, ``degrees``, ``vertex`` (an index of
    the sent mesh) or ``angle`` (radians, or what ``angle_unit`` says beside or above it). rare: seldom
    changed. limit: set by the program that calls, never by a request.
    """

    help: str
    ge: float | None = None
    gt: float | None = None
    le: float | None = None
    lt: float | None = None
    most: int | None = None
    unit: str = ""
    rare: bool = False
    limit: bool = False
