"""What is explored: which choices may vary, what a result costs, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from hexwrap_solver.errors import SettingError
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern.types import Kind, PatternSettings
from hexwrap_solver.setting import Setting

#: Variants of one exploration, at most.
MOST_VARIANTS = 1000


@dataclass(frozen=True)
class Vary:
    """Choices to try. Raises SettingError for ranges out of order, and for both kinds of size."""

    boundary: Annotated[
        tuple[Literal["straight", "isometric"], ...], Setting("boundary conditions to try", most=2)
    ] = ("straight", "isometric")
    singularities: Annotated[
        tuple[int, ...], Setting("numbers of singularities to try", ge=0, le=12, most=13)
    ] = (0, 2, 3, 4)
    around: Annotated[
        tuple[int, int] | None, Setting("cells around the surface, from … to", ge=1, le=1_000_000)
    ] = None
    edge_length: Annotated[
        tuple[float, float] | None,
        Setting(
            "instead: edge length of the cells, from … to; neither: about the default", gt=0, unit="length"
        ),
    ] = None
    kind: Annotated[
        tuple[Kind, ...] | None, Setting("kinds of cells to try; null: that of the pattern", most=3)
    ] = None
    rotation: Annotated[
        tuple[Literal["edge", "vertex"], ...] | None,
        Setting("rotations to try; null: that of the pattern", most=2),
    ] = None
    sizes: Annotated[tuple[int, int], Setting("number of edge lengths, from … to", ge=1, le=1000)] = (1, 12)
    joint: Annotated[
        tuple[float, float] | None,
        Setting("least width of the joints, from … to; null: that of panels", ge=0, unit="length"),
    ] = None

    def __post_init__(self) -> None:
        if self.around is not None and self.edge_length is not None:
            raise SettingError("give either 'around' or 'edge_length', not both")
        for name in ("around", "edge_length", "sizes", "joint"):
            given = getattr(self, name)
            if given is not None and given[0] > given[1]:
                raise SettingError(f"'{name}' must be [low, high] with low ≤ high")
        for name in ("boundary", "singularities", "kind", "rotation"):
            if getattr(self, name) == ():
                raise SettingError(f"'{name}' must list at least one choice")


@dataclass(frozen=True)
class Limits:
    """What a variant must keep to be on the front; null: anything."""

    sizes: Annotated[int | None, Setting("most edge lengths", ge=1)] = None
    max_gap: Annotated[float | None, Setting("widest joint", ge=0, unit="length")] = None
    panels: Annotated[int | None, Setting("most panels", ge=1)] = None


@dataclass(frozen=True)
class Costs:
    """Plain rates, in any currency. Lengths are metres where the unit of the model is known, and areas square
    metres; a model without a unit counts as one in metres.

    cost = types · per_type + panels · per_panel + area · (1 + sheet_waste) · per_area
         + perimeter · per_joint_length
    """

    per_type: Annotated[float, Setting("set-up of each different panel", ge=0)] = 400.0
    per_panel: Annotated[float, Setting("handling and mounting of a panel", ge=0)] = 40.0
    per_area: Annotated[float, Setting("sheet, per area", ge=0)] = 180.0
    per_joint_length: Annotated[float, Setting("edge and joint, per length of a panel's edges", ge=0)] = 12.0
    sheet_waste: Annotated[float, Setting("sheet that is cut off, per area of the panels", ge=0, le=10)] = (
        0.15
    )

    def of(self, types: int, panels: int, area: float, perimeter: float, metres: float = 1.0) -> float:
        """metres: length of the model's unit."""
        sheet = area * metres**2 * (1 + self.sheet_waste) * self.per_area
        return (
            types * self.per_type + panels * self.per_panel + sheet
            + perimeter * metres * self.per_joint_length
        )  # fmt: skip


@dataclass(frozen=True)
class ExploreSettings:
    """pattern, panels: what is the same for all variants."""

    vary: Annotated[Vary, Setting("choices to try")] = field(default_factory=Vary)
    limits: Annotated[Limits, Setting("what results must keep")] = field(default_factory=Limits)
    cost: Annotated[Costs, Setting("rates")] = field(default_factory=Costs)
    variants: Annotated[int, Setting("how many to foresee", ge=1, le=MOST_VARIANTS)] = 200
    seed: Annotated[int, Setting("another number tries others", ge=0, lt=2**31)] = 0
    pattern: Annotated[PatternSettings, Setting("of the pattern, what does not vary")] = field(
        default_factory=PatternSettings
    )
    panels: Annotated[PanelSettings, Setting("of the panels, what does not vary")] = field(
        default_factory=PanelSettings
    )

    def __post_init__(self) -> None:
        if self.panels.mode != "split":
            raise SettingError("'panels.mode' must be split: watertight panels have no sizes to choose")


@dataclass(frozen=True)
class Figures:
    """Of one variant, foreseen or measured. uncovered: share of the cells' area. gap_max: None where it is
    not known. bare: share of the surface without cells."""

    uncovered: float
    panels: int
    types: int
    cost: float
    gap_max: float | None = None
    bare: float = 0.0
