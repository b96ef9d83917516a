"""Everything that hexwrap refuses, and why.

    HexwrapError
    ├── SurfaceError            the surface is not one that can be mapped
    │   (its children, one per way to fail, stand in ``surface/errors.py``)
    ├── RequestError            the surface is fine, what is asked of it is not
    │   ├── SettingError        settings that contradict each other
    │   ├── GaussBonnetError    boundary angles that no surface can have, equation (1)
    │   ├── BoundaryError       a boundary vertex or angle that cannot be used
    │   ├── SingularitiesError   singularities that are missing, or that no such surface can have
    │   ├── NotAdaptedError     cone angle no multiple of the pattern's quantum, definition 2
    │   ├── PatternError        no pattern of that size, kind or place fits
    │   └── PanelsError         no panels under those conditions
    └── ConvergenceError        a computation did not reach its tolerance (figures in the sentence)

Each error is one clear sentence (what, where, figures, what to do) with the faulty elements as indices
of the mesh that was *sent*. ``slug`` never changes once published: programs test for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import ClassVar


class HexwrapError(Exception):
    """A refusal that a person can act on.

    detail: one sentence. vertices, faces: indices into the sent mesh; edges: pairs of sent vertices.
    field: which field is at fault, in the settings or data that the class of the error is about, such as
    ``("angles", 2, "angle")`` of a boundary condition; empty: all of them.
    data: further figures for a client, JSON-like.
    """

    slug: ClassVar[str] = "error"
    title: ClassVar[str] = "The request cannot be carried out"

    def __init_subclass__(cls, **facts: str | int) -> None:
        """facts: what holds of all errors of the class, such as its slug and title."""
        super().__init_subclass__()
        for name, value in facts.items():
            setattr(cls, name, value)

    def __init__(
        self,
        detail: str,
        *,
        vertices: Iterable[int] = (),
        faces: Iterable[int] = (),
        edges: Iterable[Sequence[int]] = (),
        field: tuple[str | int, ...] = (),
        data: dict[str, object] | None = None,
    ) -> None:
        super().__init__(detail)
        self.detail = detail
        self.vertices = [int(v) for v in vertices]
        self.faces = [int(f) for f in faces]
        self.edges = [[int(a), int(b)] for a, b in edges]
        self.field = field
        self.data = data or {}

    def __reduce__(self) -> tuple[object, ...]:  # the default loses keyword arguments between processes
        return _rebuild, (type(self), self.detail, self.__dict__)

    def reworded(self, detail: str) -> HexwrapError:
        """The same of the same place."""
        return _rebuild(type(self), detail, self.__dict__ | {"detail": detail})


def _rebuild(kind: type[HexwrapError], detail: str, state: dict[str, object]) -> HexwrapError:
    error = kind.__new__(kind, detail)  # other arguments of its constructor are in state
    error.__dict__.update(state)
    return error


class SurfaceError(HexwrapError, slug="surface", title="The surface cannot be used"): ...


class RequestError(HexwrapError, slug="request", title="The request cannot be met on this surface"): ...


class SettingError(RequestError, ValueError, slug="setting", title="Two settings contradict each other"): ...


class GaussBonnetError(RequestError, slug="gauss-bonnet", title="The boundary angles do not add up"): ...


class BoundaryError(RequestError, slug="boundary", title="A boundary condition cannot be used"): ...


class SingularitiesError(
    RequestError, slug="singularities", title="The singularities do not suit the surface"
): ...


class NotAdaptedError(RequestError, slug="not-adapted", title="The cone angle does not fit the pattern"): ...


class PatternError(RequestError, slug="pattern", title="The pattern does not fit"): ...


class PanelsError(RequestError, slug="panels", title="The panels cannot be made"): ...


class ConvergenceError(HexwrapError, slug="no-convergence", title="The computation did not converge"): ...
