"""Faults of form say what was sent and what would be right."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal

import pytest

from hexwrap_server.errors import MOST_LISTED, FormError
from hexwrap_server.input import faults
from hexwrap_server.input.form import Body, document, read
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.problems import place_of, problem
from hexwrap_solver.errors import (
    BoundaryError,
    ConvergenceError,
    HexwrapError,
    PanelsError,
    RequestError,
    SettingError,
)
from hexwrap_solver.setting import Setting
from hexwrap_solver.surface.errors import NurbsDataError, ShapeError
from hexwrap_solver.surface.types import NurbsSurface

SURFACE = {"vertices": [[0, 0, 0]], "faces": []}


def refused(body: dict[str, Any]) -> dict[str, str]:
    with pytest.raises(FormError) as caught:
        parse_request({"surface": SURFACE, **body}, 10, 10)
    return dict(caught.value.faults)


@pytest.mark.parametrize(
    ("body", "pointer", "words"),
    [
        ({"patern": {}}, "/patern", "did you mean 'pattern'?"),
        ({"pattern": {"sizes": 5}}, "/pattern/sizes", "'sizes' belongs to /panels"),
        ({"panels": {"support": True}}, "/panels/support", "'support' belongs to the body itself"),
        ({"panels": {"size": 5}}, "/panels/size", "known here: 'mode', 'sizes', "),
        ({"boundary": {"angles": [{"angel": 1}]}}, "/boundary/angles/0/angel", "did you mean 'angle'?"),
        ({"panels": {"weights": {"surfaces": 1}}}, "/panels/weights/surfaces", "did you mean 'surface'?"),
        ({"panels": {"sizes": 0}}, "/panels/sizes", "greater than or equal to 1, or 'fewest', not 0"),
        ({"panels": {"sizes": 1.5}}, "/panels/sizes", "not 1.5"),
        ({"pattern": {"kind": "pentagon"}}, "/pattern/kind", "or 'rhombitrihexagonal', not \"pentagon\""),
        ({"panels": {"joint": None}}, "/panels/joint", "not null"),
        ({"panels": {"weights": {"edge": True}}}, "/panels/weights/edge", "not true"),
    ],
)
def test_what_was_sent_and_what_would_be_right(body: dict[str, Any], pointer: str, words: str) -> None:
    assert words in refused(body)[pointer]


def solver_errors(kind: type[HexwrapError] = HexwrapError) -> Iterator[type[HexwrapError]]:
    for child in kind.__subclasses__():
        if child.__module__.startswith("hexwrap_solver"):
            yield child
            yield from solver_errors(child)


def test_places_of_the_solvers_errors_are_in_a_request() -> None:
    sections = {"/surface", "/surface/vertices", "/surface/faces", "/surface/mesh", "/surface/nurbs"}
    sections |= {f"/surface/nurbs/{f.name}" for f in fields(NurbsSurface)}
    sections |= {f"/{f.name}" for f in fields(Body)}
    for kind in solver_errors():
        place = place_of(kind("…"))
        assert place in sections or (place is None and kind in (RequestError, SettingError, ConvergenceError))


@pytest.mark.parametrize(
    ("error", "place"),
    [
        (BoundaryError("…", field=("angles", 2, "angle")), "/boundary/angles/2/angle"),
        (PanelsError("…", field=("components", "inset")), "/panels/components/inset"),
        (NurbsDataError("…", field=("control_points", 1, 2, 3)), "/surface/nurbs/control_points/1/2/3"),
        (NurbsDataError("…", field=("max_edge",)), "/surface/mesh/max_edge"),
        (ShapeError("…", field=("normals",)), "/surface/normals"),
    ],
)
def test_fields_named_by_the_solver_are_found_in_the_request(error: HexwrapError, place: str) -> None:
    assert place_of(error) == place
    assert problem(error)["errors"] == [{"pointer": place, "detail": "…"}]


@dataclass(frozen=True)
class Place:
    at: Annotated[int | Literal["all"], Setting("where", ge=0)]


@dataclass(frozen=True)
class Future:
    """The kinds of settings that a request may come to hold."""

    count: Annotated[int | Literal["auto"] | None, Setting("how many", ge=0, le=8)] = None
    places: Annotated[tuple[Place, ...], Setting("where", most=2)] = ()
    lines: Annotated[tuple[tuple[tuple[float, float, float], ...], ...], Setting("polylines", most=3)] = ()
    angle: Annotated[float | None, Setting("an angle", unit="degrees", ge=0, lt=180)] = 30.0


def test_lists_of_lists_words_among_numbers_and_nested_sections() -> None:
    given = {
        "count": "auto",
        "places": [{"at": 3}, {"at": "all"}],
        "lines": [[[0, 0, 1], [1, 0, 0.5]]],
        "angle": None,
    }
    found = read(Future, given)
    assert found == Future("auto", (Place(3), Place("all")), (((0, 0, 1), (1, 0, 0.5)),), None)
    assert document(found) == given
    assert hash(found) is not None


@pytest.mark.parametrize(
    ("given", "pointer", "words"),
    [
        ({"count": 9}, "/count", "less than or equal to 8, or 'auto', not 9"),
        ({"count": True}, "/count", "a valid integer, or 'auto', not true"),
        ({"places": [{"at": 1}, {"at": -1}]}, "/places/1/at", "greater than or equal to 0, or 'all', not -1"),
        ({"places": [{"at": 1}] * 3}, "/places", "at most 2 items"),
        ({"lines": [[[0, 0, 1], [1, 0]]]}, "/lines/0/1", "at least 3 items"),
        ({"lines": [[[0, 0, float("nan")]]]}, "/lines/0/0/2", "a finite number"),
        ({"angle": 180}, "/angle", "less than 180"),
        ({"places": [5]}, "/places/0", "an object"),
    ],
)
def test_faults_in_lists_of_lists_and_unions(given: dict[str, Any], pointer: str, words: str) -> None:
    with pytest.raises(FormError) as caught:
        read(Future, given)
    [(place, detail)] = caught.value.faults
    assert place == pointer
    assert words in detail


def test_long_values_are_not_repeated() -> None:
    assert "xxx" not in refused({"name": "x" * 300})["/name"]
    assert "000" not in refused({"panels": {"sizes": 10**80}})["/panels/sizes"].replace("1000", "")


def test_only_faults_that_are_listed_are_put_into_words(monkeypatch: pytest.MonkeyPatch) -> None:
    """A body may hold a million names that there are not."""
    worded = []
    monkeypatch.setattr(faults, "_sentence", lambda model, errors: worded.append(errors) or errors[0]["msg"])
    with pytest.raises(FormError, match="1999 more faults") as caught:
        parse_request({"surface": SURFACE, "panels": {f"name{i}": 1 for i in range(2000)}}, 10, 10)
    assert len(worded) == len(caught.value.faults) == MOST_LISTED
