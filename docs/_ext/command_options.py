"""The directive ``command-options NAME``: what ``mitt NAME --help`` says, and examples."""

import re
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive

from mitt.cli.line import options_of, paragraphs, text_of
from mitt.cli.options import COMMANDS

_OPTION = re.compile(r"(--[a-z][a-z-]*|<[a-z]+>)")


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
        command = COMMANDS[self.arguments[0]]
        out: list[nodes.Node] = [paragraph(part) for part in paragraphs(command)]
        examples = "\n".join(command.examples)
        out.append(nodes.literal_block(examples, examples))
        entries = nodes.definition_list(classes=["options"])
        for option in options_of(command):
            term = nodes.term("", "", nodes.literal(text=option.called))
            does = nodes.definition("", paragraph(text_of(option)))
            entries += nodes.definition_list_item("", term, does)
        return [*out, entries]


def setup(app: Any) -> dict[str, bool]:  # noqa: ANN401
    """Add the directive."""
    app.add_directive("command-options", CommandOptions)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
