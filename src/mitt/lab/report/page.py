"""HTML pages that stand alone: a layout and templates of ``data/pages``, filled by Jinja2.

A page is a list of sections. Each is a block of the page's template, and is left out, with its
link, where the block comes out empty. Text is escaped by the templates; drawings and replays, which
come from this package, are not.
"""

import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined

from mitt.clock import date
from mitt.version import __version__

NONE = "\u2013"
"""A dash: where there is no value, and between the ends of an interval."""

Cell = str | Mapping[str, str]
"""A cell of a table: its text, or ``href`` and ``text`` where it leads somewhere."""


@dataclass(frozen=True, slots=True)
class Section:
    """A section of a page.

    Attributes:
        name: Its block in the template, and its address in the page with hyphens.
        link: What the link at the top says.
        title: Its heading.
    """

    name: str
    link: str
    title: str


def page(
    template: str,
    sections: Sequence[Section],
    *,
    title: str,
    command: str,
    frame: str | None = None,
    **values: object,
) -> str:
    """Return a page.

    Args:
        template: Name of the template; besides its sections it has blocks ``settings`` and
            ``footer``.
        sections: Sections in their order.
        title: Heading of the page.
        command: Command that made it.
        frame: Template of the blocks that it shares with other pages.
        values: What the blocks show.
    """
    sources = [_environment().get_template(f"{name}.html") for name in (frame, template) if name]
    blocks = {name: (x, block) for x in sources for name, block in x.blocks.items()}
    html = {
        name: "".join(blocks[name][1](blocks[name][0].new_context(values))).strip()
        for name in ("settings", "footer", *(s.name for s in sections))
    }
    parts = [
        {"name": s.name.replace("_", "-"), "link": s.link, "title": s.title, "html": html[s.name]}
        for s in sections
        if html[s.name]
    ]
    whole = (
        _environment()
        .get_template("layout.html")
        .render(
            title=title,
            command=command,
            settings=html["settings"],
            footer=html["footer"],
            sections=parts,
        )
    )
    return whole.encode(errors="backslashreplace").decode()  # a name may hold what UTF-8 has not


@cache
def _environment() -> Environment:
    """Return the templates with what all of them use."""
    environment = Environment(
        loader=PackageLoader("mitt", "data/pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    style = files("mitt").joinpath("data/pages/page.css").read_text(encoding="utf-8")
    environment.filters["num"] = shown_number
    environment.globals["style"] = style
    environment.globals["piece"] = environment.get_template("pieces.html").module
    return environment


def made_with() -> str:
    """Return date, versions and machine, as a line of a page."""
    return (
        f"{date()} with mitt {__version__}, Python {platform.python_version()},"
        f" MuJoCo {version('mujoco')}, NumPy {version('numpy')}, Numba {version('numba')},"
        f" {platform.system()} {platform.machine()}, {os.cpu_count()} cores"
    )


def shown_number(value: float | None, digits: int) -> str:
    """Return a number with so many digits, or a dash where there is none."""
    return NONE if value is None else f"{value:.{digits}f}"


def interval(ends: Sequence[float]) -> str:
    """Return an interval of rates in percent."""
    return f"{100.0 * ends[0]:.1f}{NONE}{100.0 * ends[1]:.1f}"
