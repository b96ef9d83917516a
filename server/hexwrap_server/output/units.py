"""Units of length: how each is called in the files that name one."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Unit:
    """metres: length of one. rhino: name of rhino3dm's UnitSystem. dxf: value of $INSUNITS."""

    metres: float
    rhino: str
    dxf: int


#: The contract's ``surface.unit``.
UNITS = {
    "m": Unit(1.0, "Meters", 6),
    "cm": Unit(0.01, "Centimeters", 5),
    "mm": Unit(0.001, "Millimeters", 4),
    "ft": Unit(0.3048, "Feet", 2),
    "in": Unit(0.0254, "Inches", 1),
}
NO_UNIT = Unit(1.0, "None", 0)


def unit_of(name: str | None) -> Unit:
    """The unit of that name; None: lengths without a unit, which count as metres where a file needs one."""
    return UNITS[name] if name else NO_UNIT


def heading(name: str, unit: str | None, power: int = 1) -> str:
    """The heading of a column of lengths, areas (power 2) …, with the unit where there is one."""
    return name if unit is None else f"{name} [{unit}{'' if power == 1 else power}]"


def behind(unit: str | None) -> str:
    """The unit behind a number, with a blank before it, or nothing."""
    return f" {unit}" if unit else ""
