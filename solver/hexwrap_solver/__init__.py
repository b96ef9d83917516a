"""The paper in code: surface → conformal map → domain → pattern → panels.

Each stage is a function from frozen dataclasses of arrays to a frozen dataclass of arrays:

    surface_from_mesh, surface_from_nurbs   Figure 2     surface/
    conformal_map                           Section 3    conformal/
    lift, flatten                           Definition 1 domain/
    lay_pattern                             Definition 2 pattern/
    rationalize, measure, support           Section 5    panels/
"""

__version__ = "0.1.0"
