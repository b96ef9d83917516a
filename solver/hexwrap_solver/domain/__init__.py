"""The domain of parameterization (paper, definition 1): places in the unrolled domain and on the surface."""

from hexwrap_solver.domain.flatten import Flattened, flatten
from hexwrap_solver.domain.lift import Lifted, lift

__all__ = ["Flattened", "Lifted", "flatten", "lift"]
