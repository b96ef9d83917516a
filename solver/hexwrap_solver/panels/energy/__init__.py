"""The paper's functionals (section 5) and their minimisation, for single panels and for the shared mesh."""

from hexwrap_solver.panels.energy.single import minimise_singly
from hexwrap_solver.panels.energy.watertight import NEAREST, Aims, functionals, minimise_watertight

__all__ = ["NEAREST", "Aims", "functionals", "minimise_singly", "minimise_watertight"]
