"""The directive ``settings NAME``: keys of a file, by the models and docstrings that read it."""

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from typing import Any, Literal, get_args, get_origin

import annotated_types
from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList
from pydantic import BaseModel
from pydantic.fields import FieldInfo

_ATTRIBUTE = re.compile(r"^    (\w+): (.*(?:\n     +.*)*)", re.MULTILINE)
#: What a key holds where no numbers and no words are listed.
_KINDS = {str: "text", bool: "true, false", int: "whole number", float: "number"}


def parts_of(model: type[BaseModel]) -> tuple[str, dict[str, str]]:
    """Return what a model's docstring says before its attributes, and of each of them."""
    text = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", inspect.cleandoc(model.__doc__ or ""))
    said, _, listed = text.partition("Attributes:")
    words = {name: " ".join(does.split()) for name, does in _ATTRIBUTE.findall(listed)}
    return " ".join(said.split()), words


def span_of(annotation: object, bounds: list[Any]) -> str:
    """Return what a value may be: a range, some words, or its kind."""
    args = get_args(annotation)
    if get_origin(annotation) is Literal:
        return ", ".join(str(x) for x in args)
    if get_origin(annotation) is list or ... in args:
        return "list"
    if get_origin(annotation) is tuple:
        each = [span_of(x, []).replace("[-1e+06, 1e+06]", "number") for x in args]
        return f"{len(each)} x {each[0]}" if len(set(each)) == 1 else ", ".join(each)
    if args and get_origin(annotation) is not dict:
        inner = [x for part in args if isinstance(part, FieldInfo) for x in part.metadata]
        kinds = [x for x in args if x is not type(None) and not isinstance(x, FieldInfo)]
        return ", ".join(dict.fromkeys(span_of(x, bounds + inner) for x in kinds))
    low, high = "", ""
    for bound in bounds:
        low = f"[{bound.ge:g}" if isinstance(bound, annotated_types.Ge) else low
        low = f"({bound.gt:g}" if isinstance(bound, annotated_types.Gt) else low
        high = f"{bound.le:g}]" if isinstance(bound, annotated_types.Le) else high
        high = f"{bound.lt:g})" if isinstance(bound, annotated_types.Lt) else high
    if (low or high) and annotation in (int, float):
        return f"{low or '(-inf'}, {high or 'inf)'}"
    return next((text for kind, text in _KINDS.items() if kind is annotation), "table")


def rows_of(model: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, str, str, str]]:
    """Yield key, default, range and meaning of each key of a model, inner tables with their own."""
    words = parts_of(model)[1]
    for name, field in model.model_fields.items():
        key = prefix + (field.alias or name)
        kinds = [field.annotation, *get_args(field.annotation)]
        inner = [x for x in kinds if isinstance(x, type) and issubclass(x, BaseModel)]
        if len(inner) == 1:
            if not isinstance(field.default, BaseModel):  # a table that may be left out, or a list
                left_out = "needed" if field.is_required() else ""
                yield key, left_out, span_of(field.annotation, []), words.get(name, "")
            yield from rows_of(inner[0], f"{key}.")
            continue
        value = "needed" if field.is_required() else field.get_default(call_default_factory=True)
        given = value not in (None, (), [], {})
        default = f"{value:g}" if isinstance(value, float) else str(value) if given else ""
        span = span_of(field.annotation, list(field.metadata))
        yield key, default, span, words.get(name, "")


def kinds_of(union: object) -> Iterator[tuple[str, str, str, str]]:
    """Yield kind, its own keys, range of its magnitude, and what it does, of a union's models."""
    models = [x for x in get_args(union) if isinstance(x, type) and issubclass(x, BaseModel)]
    for model in models:
        said = parts_of(model)[0]
        own = {"kind", "start", "later", "length", "magnitude"}
        rows = {key: (span, does) for key, _, span, does in rows_of(model)}
        more = [f"`{key}` ({rows[key][0]}): {rows[key][1]}" for key in rows if key not in own]
        keys = ", ".join(f"`{key}`" for key in rows if key not in own)
        kind = model.model_fields["kind"].default
        yield kind, keys, rows["magnitude"][0], " ".join([said, *more])


def rows_in(given: object) -> Iterator[tuple[str, str, str, str]]:
    """Yield the rows of a model, or of the kinds of a union."""
    return rows_of(given) if isinstance(given, type) else kinds_of(given)


class SettingsTable(Directive):
    """A table of the keys of a model, or of the kinds of a union of models."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        module, _, name = self.arguments[0].rpartition(".")
        given = vars(import_module(module))[name]
        model = "| key | left out | range | meaning |"
        union = "| kind | other keys | magnitude | what happens |"
        lines = [model if isinstance(given, type) else union, "|---|---|---|---|"]
        for first, second, span, does in rows_in(given):
            cells = (f"`{first}`", second, span, does.replace("``", "`").replace("|", "\\|"))
            lines.append(f"| {' | '.join(cells)} |")
        node = nodes.container()
        self.state.nested_parse(StringList(lines, source=self.arguments[0]), 0, node)
        return list(node.children)


def setup(app: Any) -> dict[str, bool]:  # noqa: ANN401
    """Add the directive."""
    app.add_directive("settings", SettingsTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
