"""Units as the formats name them."""

from __future__ import annotations

#: Rhino's unit systems.
RHINO = {"m": "Meters", "cm": "Centimeters", "mm": "Millimeters", "ft": "Feet", "in": "Inches", None: "None"}
#: Values of DXF's $INSUNITS.
DXF = {"in": 1, "ft": 2, "mm": 4, "cm": 5, "m": 6, None: 0}


def behind(unit: str | None) -> str:
    """The unit behind a number, with a blank before it, or nothing."""
    return f" {unit}" if unit else ""
