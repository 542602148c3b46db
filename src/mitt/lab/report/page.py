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
from typing import NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined

from mitt.clock import date
from mitt.lab.report.style import Plot
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


class Card(NamedTuple):
    """A figure that a page shows large.

    Attributes:
        title: What it is.
        value: The figure, as text.
        unit: Its unit.
        note: What is said below it.
    """

    title: str
    value: str
    unit: str = ""
    note: str = ""


class Shot(NamedTuple):
    """One picture of a strip.

    Attributes:
        t: Time from release [s].
        catch: Whether it shows the catch.
        png: PNG in base64.
    """

    t: float
    catch: bool
    png: str


class Strip(NamedTuple):
    """Pictures of one trial in a row.

    Attributes:
        name: Name of the figure in the page.
        shots: The pictures, in the order of time.
    """

    name: str
    shots: Sequence[Shot]


class Replay(NamedTuple):
    """A trial that plays in three dimensions.

    Attributes:
        name: Name of the figure in the page.
        document: A whole HTML page, which the figure frames.
        still: What shows until it plays: PNG in base64.
    """

    name: str
    document: str
    still: str


class OwnPicture(NamedTuple):
    """A picture that one task alone shows, in the section of its name.

    Attributes:
        section: The section.
        title: What it shows.
        words: What is said below it.
        drawing: What is shown; its name is that of the figure in the page.
    """

    section: str
    title: str
    words: str
    drawing: Plot | Strip | Replay


def page(
    template: str,
    sections: Sequence[Section],
    *,
    title: str,
    command: str,
    **values: object,
) -> str:
    """Return a page.

    Args:
        template: Name of the template; besides its sections it has blocks ``settings`` and
            ``footer``.
        sections: Sections in their order.
        title: Heading of the page.
        command: Command that made it.
        values: What the blocks show.
    """
    source = _environment().get_template(f"{template}.html")
    html = {
        name: "".join(source.blocks[name](source.new_context(values))).strip()
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


def in_print(words: str) -> str:
    """Return words with their powers raised: ``rad/s^2`` as it is printed."""
    return words.replace("^2", "\u00b2").replace("^3", "\u00b3")


def interval(ends: Sequence[float]) -> str:
    """Return an interval of rates in percent."""
    return f"{100.0 * ends[0]:.1f}{NONE}{100.0 * ends[1]:.1f}"
