"""Part 21 of STEP (ISO 10303-21): the clear text that IFC files are written in."""

from __future__ import annotations

import math
import uuid
from collections.abc import Iterable
from datetime import UTC, datetime

#: The letters of IFC's short form of a GUID.
LETTERS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_$"
#: Significant digits of lengths and directions.
DIGITS = 9


class Lines:
    """Instances, numbered as they come."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def add(self, kind: str, *values: str) -> str:
        """Adds an instance; returns the reference to it (``#12``)."""
        self.lines.append(f"{kind}({','.join(values)})")
        return f"#{len(self.lines)}"

    def file(self, schema: str, name: str, view: str, program: str) -> bytes:
        """The whole file."""
        now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S")
        head = [
            "ISO-10303-21;",
            "HEADER;",
            f"FILE_DESCRIPTION(({text(view)}),'2;1');",
            f"FILE_NAME({text(name)},'{now}',(''),(''),{text(program)},{text(program)},'');",
            f"FILE_SCHEMA(('{schema}'));",
            "ENDSEC;",
            "DATA;",
        ]
        body = [f"#{k}={line};" for k, line in enumerate(self.lines, 1)]
        return "\n".join([*head, *body, "ENDSEC;", "END-ISO-10303-21;", ""]).encode("ascii")


def real(value: float) -> str:
    """A number with the decimal point that Part 21 asks for."""
    if not math.isfinite(value):
        raise ValueError(f"{value} cannot be written to a STEP file.")
    digits = f"{value:.{DIGITS}g}"
    mantissa, e, exponent = digits.partition("e")
    return (mantissa if "." in mantissa else mantissa + ".") + (f"E{exponent}" if e else "")


def reals(values: Iterable[float]) -> str:
    return f"({','.join(real(v) for v in values)})"


def text(words: str) -> str:
    """A string: quotes and backslashes doubled, letters beyond ASCII by number."""
    out = []
    for letter in words:
        if letter in "'\\":
            out.append(letter * 2)
        elif " " <= letter <= "~":
            out.append(letter)
        else:
            wide = letter.encode("utf-32-be").hex().upper()
            out.append(f"\\X4\\{wide}\\X0\\" if ord(letter) > 0xFFFF else f"\\X2\\{wide[4:]}\\X0\\")
    return f"'{''.join(out)}'"


def listed(references: Iterable[str]) -> str:
    return f"({','.join(references)})"


def guid(space: uuid.UUID, name: str) -> str:
    """IFC's 22 letters for a name, the same whenever the same name is written."""
    number = uuid.uuid5(space, name).int
    letters = [LETTERS[number >> 6 * k & 63] for k in range(22)]
    return f"'{''.join(reversed(letters))}'"
