"""Panels from a pattern: rationalization and what it reached (paper, section 5)."""

from hexwrap_solver.arrays import Progress, no_progress
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.panels.components import make_components
from hexwrap_solver.panels.fit import fit_panels
from hexwrap_solver.panels.quality import measure
from hexwrap_solver.panels.quantize import quantize
from hexwrap_solver.panels.support import support
from hexwrap_solver.panels.types import Panels, PanelSettings
from hexwrap_solver.pattern.types import Pattern

__all__ = ["fit_panels", "make_components", "measure", "quantize", "rationalize", "support"]


def rationalize(
    cmap: ConformalMap, pattern: Pattern, settings: PanelSettings, progress: Progress = no_progress
) -> Panels:
    """Pattern → finished panels, in one step. Raises PanelsError."""
    return quantize(fit_panels(cmap, pattern, settings, progress), settings)
