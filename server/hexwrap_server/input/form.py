"""The form of a request, derived from the annotated settings: what is accepted, its JSON Schema, the way
back.

Each dataclass of settings becomes a strict pydantic model, in which ``true`` is not a number and an unknown
field is a fault; what the model has accepted becomes the dataclass again.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass, replace
from functools import cache, partial
from math import inf, nextafter
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import pydantic
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, FiniteFloat, ValidationError

from hexwrap_server.errors import FormError
from hexwrap_server.input.faults import Path, faults, pointer
from hexwrap_server.input.requests import Exploration, Wanted
from hexwrap_solver.conformal.types import ANGLE_UNITS
from hexwrap_solver.setting import Setting
from hexwrap_solver.surface.checks import LARGEST, SMALLEST

T = TypeVar("T")


@dataclass(frozen=True)
class Body(Wanted):
    """Everything of a request but the arrays of its surface."""

    name: Annotated[str, Setting("name of the job, the title of pictures and drawings", most=200)] = ""


@dataclass(frozen=True)
class ExploreBody(Exploration):
    """The same of an exploration."""

    name: Annotated[str, Setting("name of the job", most=200)] = ""


@dataclass(frozen=True)
class Leaf:
    """A setting that is not a section. path: from the top. parts: the types of its values, null aside."""

    path: Path
    setting: Setting
    parts: tuple[Any, ...]
    default: Any

    @property
    def choices(self) -> tuple[str, ...]:
        """Words that are accepted."""
        return tuple(word for part in self.parts if get_origin(part) is Literal for word in get_args(part))

    @property
    def is_free(self) -> bool:
        """Whether there are other values than the choices."""
        return any(get_origin(part) is not Literal for part in self.parts)

    @property
    def is_text(self) -> bool:
        """Whether any text is a value."""
        return str in self.parts

    @property
    def is_list(self) -> bool:
        """Whether it is a list of sections."""
        return is_dataclass(self._row)

    @property
    def is_lines(self) -> bool:
        """Whether it is a list of polylines."""
        return get_args(self._row)[-1:] == (...,)

    @property
    def _row(self) -> Any:
        """The type of its entries, where it takes any number of them."""
        return next((get_args(part)[0] for part in self.parts if get_args(part)[-1:] == (...,)), None)

    @property
    def entry(self) -> tuple[str | None, str, str]:
        """Of the entries of such a list: the field that numbers their place, if any; the one that gives it by
        a point or a line of points; and the one that says what is wanted there."""
        hints = _hints(self._row)
        names = [f.name for f in fields(self._row) if f.default is None and int in _parts(hints[f.name])]
        number, points = next(iter(names), None), "line" if "line" in hints else "point"
        return number, points, next(name for name in hints if name not in (number, points))

    @property
    def numbers(self) -> int:
        """How many values it takes."""
        return max(len(get_args(part)) if get_origin(part) is tuple else 1 for part in self.parts)


def read(kind: type[T], given: object, root: str = "") -> T:
    """A JSON value as settings. root: JSON pointer to the value. Raises FormError, a pointer per fault."""
    model = model_of(kind)  # type: ignore[arg-type]
    try:
        found: T = _built(kind, model.model_validate(given))
    except ValidationError as error:
        raise FormError(faults(model, given, root, error)) from None
    except ValueError as error:
        raise FormError.at(root, str(error)) from None
    return _in_radians(found)


def document(settings: Any) -> dict[str, Any]:
    """A JSON object that reads as the same settings."""
    written: dict[str, Any] = _document(settings, 1.0, False)
    return written


#: The types of a dataclass's fields. Not to be written to.
_hints: Callable[[type], dict[str, Any]] = cache(partial(get_type_hints, include_extras=True))


@cache
def schema(kind: type) -> dict[str, Any]:
    """JSON Schema of the settings, with its definitions inside."""
    return _inlined(model_of(kind).model_json_schema())


@cache
def model_of(kind: type) -> type[BaseModel]:
    """The model that accepts these settings."""
    members: dict[str, Any] = {}
    for f, annotation, setting in _settings(kind):
        extra = {"unit": setting.unit or None, "rare": setting.rare or None}
        members[f.name] = (
            _accepted(annotation, setting),
            pydantic.Field(
                **_default(f),
                title=f.name.replace("_", " ").capitalize(),
                description=setting.help,
                json_schema_extra={name: value for name, value in extra.items() if value is not None},
            ),
        )
    return pydantic.create_model(kind.__name__, __config__=ConfigDict(strict=True, extra="forbid"), **members)


def leaves(kind: type, root: Path = ()) -> Iterator[Leaf]:
    """The settings that are not sections themselves, in order."""
    for f, annotation, setting in _settings(kind):
        path = (*root, f.name)
        section = next((part for part in _parts(annotation) if is_dataclass(part)), None)
        if section is not None:
            yield from leaves(section, path)  # type: ignore[arg-type]
        else:
            default = f.default if f.default is not MISSING else None
            parts = tuple(part for part in _parts(annotation) if part is not type(None))
            yield Leaf(path, setting, parts, default)


def values(settings: Any, root: tuple[str | int, ...] = ()) -> Iterator[tuple[str, Setting, Any]]:
    """JSON pointer, annotation and value of every setting, entries of lists included."""
    for f, _, setting in _settings(type(settings)):
        value, path = getattr(settings, f.name), (*root, f.name)
        rows = enumerate(value) if isinstance(value, tuple) else ()
        if is_dataclass(value):
            yield from values(value, path)
        elif value and isinstance(value, tuple) and is_dataclass(value[0]):
            for i, row in rows:
                yield from values(row, (*path, i))
        else:
            yield pointer(path), setting, value


def is_nullable(kind: type, name: str) -> bool:
    """Whether a field may be null."""
    return type(None) in _parts(_hints(kind)[name])


def setting_of(annotation: Any) -> Setting:
    """What an annotation says of its field."""
    return next(extra for extra in get_args(annotation) if isinstance(extra, Setting))


def _settings(kind: type) -> list[tuple[Field[Any], Any, Setting]]:
    """Field, annotation and setting of all that a request may set."""
    hints = _hints(kind)
    found = [(f, hints[f.name], setting_of(hints[f.name])) for f in fields(kind)]
    return [one for one in found if not one[2].limit]


def _parts(annotation: Any) -> tuple[Any, ...]:
    """The members of a union, or the one type."""
    if get_origin(annotation) is Annotated:
        return _parts(get_args(annotation)[0])
    return get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else (annotation,)


def _default(f: Field[Any]) -> dict[str, Any]:
    if f.default_factory is not MISSING:
        return {"default_factory": f.default_factory}
    if f.default is MISSING:
        return {}
    if is_dataclass(f.default):  # its own defaults say the same
        return {"default_factory": lambda: f.default}
    return {"default": list(f.default) if isinstance(f.default, tuple) else f.default}


def _accepted(annotation: Any, setting: Setting) -> Any:
    """The type of JSON values that are accepted for a field."""
    parts = _parts(annotation)
    if len(parts) > 1:
        return Union[tuple(_accepted(part, setting) for part in parts)]  # noqa: UP007
    (part,) = parts
    bounds = pydantic.Field(ge=setting.ge, gt=setting.gt, le=setting.le, lt=setting.lt)
    if is_dataclass(part):
        return Annotated[model_of(part), AfterValidator(lambda given: _built(part, given))]  # type: ignore[arg-type]
    if get_origin(part) is tuple:
        *_, last = of = get_args(part)
        rows = types.GenericAlias(list, (_accepted(of[0], setting),))
        least, most = (0, setting.most) if last is ... else (len(of), len(of))
        return Annotated[rows, pydantic.Field(min_length=least, max_length=most), AfterValidator(tuple)]
    if part is int:
        return Annotated[int, bounds, BeforeValidator(_whole_number)]
    if part is float:
        return Annotated[FiniteFloat, bounds, AfterValidator(_moderate)]
    if part is str:
        return Annotated[str, pydantic.Field(max_length=setting.most)]
    return part


def _moderate(value: float) -> float:
    """Neither so large nor so small that its square or inverse overflows."""
    if value and not SMALLEST <= abs(value) <= LARGEST:
        raise ValueError(f"must be 0, or between {SMALLEST:g} and {LARGEST:g} in size")
    return value


def _whole_number(value: object) -> object:
    """48.0 is a whole number too, as in JSON Schema."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _built(kind: Any, given: BaseModel) -> Any:
    """The dataclass of what a model has accepted. Raises SettingError, which is a ValueError."""
    found = {name: getattr(given, name) for name in type(given).model_fields}
    return kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in found.items()})


def _inlined(schema: dict[str, Any]) -> dict[str, Any]:
    definitions = schema.pop("$defs", {})

    def resolve(part: Any) -> Any:
        if isinstance(part, dict):
            if "$ref" in part:
                target = resolve(definitions[part["$ref"].rpartition("/")[2]])
                return target | {k: v for k, v in part.items() if k != "$ref"}
            return {k: resolve(v) for k, v in part.items()}
        return [resolve(p) for p in part] if isinstance(part, list) else part

    resolved: dict[str, Any] = resolve(schema)
    return resolved


def _in_radians(settings: T, factor: float = 1.0) -> T:
    """Angles in radians instead of the ``angle_unit`` beside or above them."""
    factor = ANGLE_UNITS[settings.angle_unit] if hasattr(settings, "angle_unit") else factor
    changes: dict[str, Any] = {}
    for f, _, setting in _settings(type(settings)):
        value = getattr(settings, f.name)
        if setting.unit == "angle" and value is not None:
            changes[f.name] = value * factor
        elif is_dataclass(value):
            changes[f.name] = _in_radians(value, factor)
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            changes[f.name] = tuple(_in_radians(row, factor) for row in value)
    return replace(settings, **changes) if changes else settings  # type: ignore[type-var]


def _document(settings: Any, factor: float, is_entry: bool) -> Any:
    """is_entry: of a list, where what is null is left out."""
    factor = ANGLE_UNITS[settings.angle_unit] if hasattr(settings, "angle_unit") else factor
    written: dict[str, Any] = {}
    for f, _, setting in _settings(type(settings)):
        value = getattr(settings, f.name)
        if value is None and is_entry:
            continue
        if setting.unit == "angle" and value is not None:
            value = _in_unit(value, factor)
        elif is_dataclass(value):
            value = _document(value, factor, False)
        written[f.name] = _rows(value, factor)
    return written


def _rows(value: Any, factor: float) -> Any:
    """A tuple as a list, all the way down."""
    if isinstance(value, tuple):
        return [_rows(row, factor) for row in value]
    return _document(value, factor, True) if is_dataclass(value) else value


def _in_unit(angle: float, unit: float) -> float:
    """The number that was asked for, or one that comes to the same radians."""
    near = angle / unit
    tries = (round(near, 9), near, nextafter(near, inf), nextafter(near, 0.0))
    return next((value for value in tries if value * unit == angle), near)
