"""The directive ``command-options NAME``: what ``mitt NAME --help-all`` says, and examples."""

import argparse
import re
import warnings
from typing import Any

import tyro
from docutils import nodes
from docutils.parsers.rst import Directive

from mitt.commands.help import EXAMPLES
from mitt.commands.line import COMMANDS

#: Lists of options that are the same for all.
_COMMON = ("--help",)
_OPTION = re.compile(r"(--[a-z][a-z-]*|<[a-z]+>)")
_DEFAULT = re.compile(r" \((?:default: None|required)\)")


def options_of(command: str) -> list[tuple[str, str]]:
    """Return the options of a command as its parser has them: how written, what they do."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        parser: argparse.ArgumentParser = tyro.extras.get_parser(COMMANDS[command])
    found = []
    for action in parser._actions:
        negated = {f"--no-{x[2:]}" for x in action.option_strings}
        written = [x for x in action.option_strings if x not in negated]
        if set(written) & set(_COMMON):
            continue
        value = str(action.metavar or action.dest) if action.nargs != 0 else ""
        name = written[-1] if written else ""
        found.append((f"{name} {value}".strip(), _DEFAULT.sub("", str(action.help or ""))))
    return found


def paragraph(text: str) -> nodes.paragraph:
    """Return a paragraph in which options are set as code."""
    parts = enumerate(_OPTION.split(" ".join(text.split())))
    return nodes.paragraph(
        "", "", *(nodes.literal(text=x) if k % 2 else nodes.Text(x) for k, x in parts)
    )


class CommandOptions(Directive):
    """A definition list of a command's options, with what it does before it."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the nodes of the list."""
        name = self.arguments[0]
        said = (COMMANDS[name].__doc__ or "").split("\n\n    Attributes:")[0]
        out: list[nodes.Node] = [paragraph(part) for part in said.split("\n\n")]
        examples = "\n".join(EXAMPLES[name])
        out.append(nodes.literal_block(examples, examples))
        entries = nodes.definition_list(classes=["options"])
        for written, does in options_of(name):
            term = nodes.term("", "", nodes.literal(text=written))
            entries += nodes.definition_list_item("", term, nodes.definition("", paragraph(does)))
        return [*out, entries]


def setup(app: Any) -> dict[str, bool]:  # noqa: ANN401
    """Add the directive."""
    app.add_directive("command-options", CommandOptions)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
