"""Settings that come from TOML files: how they are read, checked and refused."""

import copy
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from mitt.errors import InputError
from mitt.fields import line
from mitt.files.schema import OneLine, in_words


class Settings(BaseModel, metaclass=OneLine):
    """Frozen settings that know no other keys than their own."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    def __repr__(self) -> str:
        """Return one line: what differs from the settings that are left out."""
        own = [(name, getattr(self, name), field.get_default(call_default_factory=True))
               for name, field in type(self).model_fields.items()]  # fmt: skip
        return line(type(self).__name__, [(x, value) for x, value, usual in own if value != usual])

    __str__ = __repr__


_Model = TypeVar("_Model", bound=BaseModel)


def merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Return two nested tables as one; where both have a value, that of ``above``."""
    out = copy.deepcopy(below)
    for key, value in above.items():
        old = out.get(key)
        if isinstance(old, dict) and isinstance(value, dict):
            out[key] = merged(old, value)
        else:
            out[key] = copy.deepcopy(value)
    return out


def validated(model: type[_Model], data: object, *, place: str) -> _Model:
    """Return settings from what a file says.

    Args:
        model: Class of the settings.
        data: What the file says.
        place: What an error calls it: the file, and where in it.

    Raises:
        InputError: A key is unknown or its value cannot be used; the message names both.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"]) or "(all)"
        wanted, given = in_words(first)
        if first["type"] == "extra_forbidden":
            wanted = f"one of the keys {', '.join(_known(model, first['loc']))}"
        raise InputError(f"{place} key {key[:120]}", wanted, given) from None


def _known(model: type[BaseModel], at: tuple[int | str, ...]) -> list[str]:
    """Return the keys that there may be in place of one that is unknown."""
    models: list[type[BaseModel]] = [model]
    for part in at[:-1]:
        models = _inner(models, str(part))
    return list(models[0].model_fields)


def _inner(models: list[type[BaseModel]], part: str) -> list[type[BaseModel]]:
    """Return the settings that a part of a key's address leads to: a kind, a field, a number."""
    for model in models:
        kind = model.model_fields.get("kind")
        if kind is not None and part in get_args(kind.annotation):
            return [model]
        if part in model.model_fields:
            return _models(model.model_fields[part].annotation) or [model]
    return models


def _models(annotation: object) -> list[type[BaseModel]]:
    """Return the classes of settings inside an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [inner for part in get_args(annotation) for inner in _models(part)]
