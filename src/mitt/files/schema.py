"""JSON and TOML files of ours, checked against a model of their content."""

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mitt import checks
from mitt.errors import FileError, InputError

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass as _ModelMetaclass
else:
    _ModelMetaclass = type(BaseModel)

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
            field = ".".join(str(part) for part in (cls.__name__, *first["loc"]))
            raise InputError(field, *in_words(first)) from None


class Part(BaseModel, metaclass=OneLine):
    """Part of a file; unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


_Model = TypeVar("_Model", bound=Part)


def in_words(error: Mapping[str, Any]) -> tuple[str, str]:
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


def parsed(model: type[_Model], raw: Any, *, place: str, wanted: str, do: str) -> _Model:  # noqa: ANN401 (any JSON value)
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
        key = ".".join(str(part) for part in first["loc"]) or "the file"
        if first["type"] == "extra_forbidden":
            known = _known(model, first["loc"][:-1])
            raise FileError(f"{place} key {key[:120]!r}", f"one of {known}", "another",
                            do=do) from None  # fmt: skip
        if first["loc"]:
            raise FileError(f"{place} key {key[:120]!r}", *in_words(first), do=do) from None
        raise FileError(f"{place} key {key[:120]!r}", wanted, first["msg"], do=do) from None


def _known(model: type[Part], place: tuple[int | str, ...]) -> str:
    """Return the keys that a table of a file may have."""
    at: Any = model
    for key in place:
        found = at.model_fields.get(key)
        kinds = () if found is None else (found.annotation, *get_args(found.annotation))
        at = next((x for x in kinds if isinstance(x, type) and issubclass(x, Part)), at)
    return ", ".join(x.alias or name for name, x in at.model_fields.items())
