"""Tables of files and settings, checked against a model of their content.

What is wrong is one line, in a file as in Python: the key, what was wanted, what was given.

Dataclasses are written as plain JSON and read back, to the bit, by the types that their fields
state (:func:`to_plain`, :func:`from_plain`). A file names no class: the reader says what it wants,
and takes nothing else. Numbers keep every digit; infinity, which JSON lacks, is the text "inf". NaN
is refused both ways.
"""

import copy
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, fields, is_dataclass
from functools import lru_cache
from inspect import isabstract
from math import inf, isfinite, isnan
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mitt.core import checks
from mitt.core.errors import FileError, InputError
from mitt.core.fields import line

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass as _ModelMetaclass
else:
    _ModelMetaclass = type(BaseModel)

_Kind = TypeVar("_Kind")
_ENDLESS = {"inf": inf, "-inf": -inf}

Finite = Annotated[float, Field(allow_inf_nan=False, strict=True)]
"""A finite number, and no text or truth value that could be read as one."""


class OneLine(_ModelMetaclass):
    """What makes a model: wrong values given in Python are one line, as those of a file are."""

    def __call__(cls, *args: Any, **values: Any) -> Any:  # noqa: ANN401, N805 (as the model has them)
        """Make a model.

        Raises:
            InputError: A value cannot be used; the message names the field.
        """
        try:
            return super().__call__(*args, **values)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            field = ".".join(map(str, (cls.__name__, *first["loc"])))
            raise InputError(field, *_in_words(first)) from None


class FileSection(BaseModel, metaclass=OneLine):
    """Part of a file; unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class FileSettings(FileSection):
    """Settings: numbers are numbers, and finite."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    def __repr__(self) -> str:
        """Return one line: what differs from the settings that are left out."""
        own = [
            (name, getattr(self, name), field.get_default(call_default_factory=True))
            for name, field in type(self).model_fields.items()
        ]
        return line(type(self).__name__, [(x, value) for x, value, usual in own if value != usual])

    __str__ = __repr__


@contextmanager
def in_words_of(place: str, **keys: str) -> Iterator[None]:
    """Tell errors of settings that the keys of a file are translated to in the words of that file.

    Args:
        place: What an error calls the file.
        keys: By the name of a class of settings, the table of the file that it is made from.
    """
    try:
        yield
    except InputError as error:
        model, _, field = error.name.partition(".")
        if model not in keys or not field:
            raise
        name = f"{place} key {keys[model]}.{field}"
        raise InputError(name, error.wanted, error.given) from error


_Model = TypeVar("_Model", bound=BaseModel)


def merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Return two nested tables as one; where both have a value, that of ``above``."""
    out = copy.deepcopy(dict(below))
    for key, value in above.items():
        old = out.get(key)
        both = isinstance(old, dict) and isinstance(value, dict)
        out[key] = merged(old, value) if both and old is not None else copy.deepcopy(value)
    return out


def _in_words(error: Mapping[str, Any]) -> tuple[str, str]:
    """Return what a value should have been and what it is, for what Pydantic says of it."""
    if error["type"] == "missing":
        return "a value", "none"
    if error["type"] == "value_error":  # of a validator of ours: it says what was wanted
        return error["msg"].removeprefix("Value error, "), checks.shown(error["input"])
    message, given = error["msg"], checks.shown(error["input"])
    if error["type"] in ("model_type", "dict_type"):
        return "a table", given
    if error["type"] in ("list_type", "tuple_type"):
        return "a list", given
    message = re.sub(r", unable to .*| after validation, .*", "", message)
    found = re.fullmatch(r"(\w+) should (be|have|match) (.*)", message, re.DOTALL)
    if found is None:
        return message, given
    noun = {"Input": "value", "String": "text"}.get(found[1], found[1].lower())
    verb = {"be": "", "have": f"a {noun} that has ", "match": f"a {noun} that matches the "}
    return verb[found[2]] + found[3].replace("a valid ", "a "), given


def validated(model: type[_Model], raw: object, *, place: str) -> _Model:
    """Return settings from what a table says.

    Args:
        model: Class of the settings.
        raw: What the table says.
        place: What an error calls it: the file, and where in it.

    Raises:
        InputError: A key is unknown or its value cannot be used; the message names both.
    """
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key, (wanted, given) = _key(first) or "(all)", _in_words(first)
        if first["type"] == "extra_forbidden":
            wanted = f"one of the keys {_known(model, first['loc'])}"
        raise InputError(f"{place} key {key}", wanted, given) from None


def parsed(model: type[_Model], raw: object, *, place: str, wanted: str, do: str) -> _Model:
    """Return what a file says as a model.

    Args:
        model: Class of the content.
        raw: What the file says.
        place: What an error calls the file.
        wanted: What an error says was wanted where it is of the whole.
        do: What it says is to be done.

    Raises:
        FileError: A key is unknown, missing, or its value cannot be used.
    """
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key, said = _key(first) or "the file", _in_words(first)
        if first["type"] == "extra_forbidden":
            said = f"one of {_known(model, first['loc'])}", "another"
        elif not first["loc"]:
            said = wanted, first["msg"]
        raise FileError(f"{place} key {key!r}", *said, do=do) from None


def _key(error: Mapping[str, Any]) -> str:
    """Return the address of a wrong key; nothing where it is the whole."""
    return ".".join(map(str, error["loc"]))[:120]


def _known(model: type[BaseModel], at: tuple[int | str, ...]) -> str:
    """Return the keys that there may be in place of one that is unknown."""
    models: list[type[BaseModel]] = [model]
    for part in at[:-1]:
        models = _inner(models, str(part))
    return ", ".join(x.alias or name for name, x in models[0].model_fields.items())


def _inner(models: list[type[BaseModel]], part: str) -> list[type[BaseModel]]:
    """Return the models that a part of a key's address leads to: a kind, a field, a number."""
    for model in models:
        kind = model.model_fields.get("kind")
        if kind is not None and part in get_args(kind.annotation):
            return [model]
        if part in model.model_fields:
            return _models(model.model_fields[part].annotation) or [model]
    return models


def _models(annotation: object) -> list[type[BaseModel]]:
    """Return the models inside an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [inner for part in get_args(annotation) for inner in _models(part)]


def to_plain(value: object) -> Any:  # noqa: ANN401 (any JSON value)
    """Return a dataclass, and what it is made of, as values that JSON has."""
    if is_dataclass(value) and not isinstance(value, type):
        return {x.name: to_plain(getattr(value, x.name)) for x in fields(value) if x.init}
    if isinstance(value, np.ndarray):
        return to_plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(name): to_plain(x) for name, x in value.items()}
    if isinstance(value, tuple | list):
        return [to_plain(x) for x in value]
    if isinstance(value, float) and not isfinite(value):
        if isnan(value):
            raise InputError("a number to be written", "no NaN", "NaN")
        return "inf" if value > 0 else "-inf"
    return value.item() if isinstance(value, np.generic) else value


def from_plain(kind: type[_Kind], raw: object, *, place: str = "the file") -> _Kind:
    """Return a value of a class from what :func:`to_plain` made of it.

    Raises:
        MittError: It says something else; the class itself may refuse its numbers.
    """
    value: _Kind = _value(kind, raw, place)
    return value


@lru_cache(maxsize=64)
def _hints(kind: type) -> dict[str, Any]:
    """Return the types of a dataclass's fields."""
    return get_type_hints(kind)


def _value(kind: Any, raw: Any, place: str) -> Any:  # noqa: ANN401 (what a type states)
    """Return a value of a stated type."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return _one_of(inner, raw, place)
    if isabstract(kind):  # stands for what is made of it; slots make a class twice, the last counts
        return _one_of(tuple({x.__name__: x for x in kind.__subclasses__()}.values()), raw, place)
    if kind is NoneType and raw is None:
        return None
    if origin is np.ndarray or kind is np.ndarray:
        return _array(raw, place)
    if origin is tuple and isinstance(raw, list):
        kinds = inner[:1] * len(raw) if inner[-1] is ... else inner
        if len(kinds) == len(raw):
            pairs = zip(kinds, raw, strict=True)
            return tuple(_value(one, x, f"{place}[{k}]") for k, (one, x) in enumerate(pairs))
    if is_dataclass(kind) and isinstance(raw, dict):
        return _dataclass(kind, raw, place)
    if kind is float and (found := _number(raw)) is not None:
        return found
    if kind in (str, bool, int) and type(raw) is kind:
        return raw
    name = getattr(kind, "__name__", str(kind))
    raise InputError(place, f"a value of type {name}", type(raw).__name__)


def _one_of(kinds: tuple[Any, ...], raw: Any, place: str) -> Any:  # noqa: ANN401
    """Return a value of the first type that takes it."""
    if raw is None and NoneType in kinds:
        return None
    rest = [kind for kind in kinds if kind is not NoneType]
    for kind in rest[:-1]:
        try:
            return _value(kind, raw, place)
        except InputError:
            continue
    return _value(rest[-1], raw, place)


def _number(raw: object) -> float | None:
    """Return a number, infinity included; None where it is none."""
    if isinstance(raw, int | float) and not isinstance(raw, bool):
        return float(raw) if abs(raw) <= 1e300 else None
    return _ENDLESS.get(raw) if isinstance(raw, str) else None


def _array(raw: object, place: str) -> Any:  # noqa: ANN401
    """Return numbers in nested lists, a million at most, as an array."""
    flat: list[float] = []

    def walk(x: object, depth: int) -> object:
        if isinstance(x, list) and depth < 4:
            return [walk(y, depth + 1) for y in x]
        number = _number(x)
        if number is None or len(flat) >= 1_000_000:
            raise InputError(place, "numbers in lists", type(x).__name__)
        flat.append(number)
        return number

    try:
        return np.array(walk(raw, 0), dtype=np.float64)
    except ValueError as error:
        raise InputError(place, "lists of equal lengths", error) from None


def _dataclass(kind: Any, raw: dict[str, Any], place: str) -> Any:  # noqa: ANN401
    """Return a dataclass; a field that is missing takes its default."""
    known = {x.name: x for x in fields(kind) if x.init}
    for name in raw:
        if name not in known:
            raise InputError(f"{place}.{name[:60]}", f"one of {', '.join(known)}", "another")
    given = {}
    for name, x in known.items():
        if name in raw:
            given[name] = _value(_hints(kind)[name], raw[name], f"{place}.{name}")
        elif x.default is MISSING and x.default_factory is MISSING:
            raise InputError(f"{place}.{name}", "a value", "none")
    return kind(**given)
