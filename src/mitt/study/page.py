"""Pieces of an HTML page that stands alone: no piece loads anything from anywhere.

Arguments called ``text`` and the cells of tables are escaped here; those called ``html`` are
taken as they are and come from this package only.
"""

from collections.abc import Sequence
from html import escape
from importlib.resources import files

#: What the page may load: nothing but what it carries. The replay's frame inherits it.
_POLICY = (
    "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; font-src data:; "
    "script-src 'unsafe-inline' 'wasm-unsafe-eval' blob: data:; worker-src blob: data:; "
    "connect-src blob: data:; base-uri 'none'; form-action 'none'"
)


def page(title: str, *, header: str, sections: Sequence[str], footer: str) -> str:
    """Return the whole page from pieces of HTML."""
    style = files("mitt").joinpath("data/report.css").read_text(encoding="utf-8")
    body = "\n".join(sections)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        f"<header>\n{header}\n</header>\n<main>\n{body}\n</main>\n"
        f"<footer>{footer}</footer>\n</body>\n</html>\n"
    )


def section(name: str, title: str, html: str) -> str:
    """Return a section with its heading; ``name`` is its address in the page."""
    return f'<section id="{escape(name)}">\n<h2>{escape(title)}</h2>\n{html}\n</section>'


def navigation(entries: Sequence[tuple[str, str]]) -> str:
    """Return links to sections, given their names and what the links say."""
    links = "".join(f'<a href="#{escape(name)}">{escape(text)}</a>' for name, text in entries)
    return f"<nav>{links}</nav>"


def figure(name: str, html: str, *, title: str, caption: str) -> str:
    """Return a figure with its caption; ``caption`` is HTML."""
    label = f"<b>{escape(title)}.</b> "
    return (
        f'<figure id="{escape(name)}">\n{html}\n<figcaption>{label}{caption}</figcaption></figure>'
    )


def plotted(svg: str) -> str:
    """Return a drawing in a box that scrolls where the screen is narrow."""
    return f'<div class="plot">{svg}</div>'


def table(head: Sequence[str], rows: Sequence[Sequence[str]], *, numbers: int = 0) -> str:
    """Return a table; its last ``numbers`` columns are set to the right."""
    first = len(head) - numbers

    def row(cells: Sequence[str], tag: str) -> str:
        kinds = ('class="n"' if k >= first else "" for k in range(len(cells)))
        inner = "".join(
            f"<{tag} {kind}>{escape(text)}</{tag}>" if kind else f"<{tag}>{escape(text)}</{tag}>"
            for kind, text in zip(kinds, cells, strict=True)
        )
        return f"<tr>{inner}</tr>"

    body = "\n".join(row(cells, "td") for cells in rows)
    return (
        f'<div class="wide"><table>\n<thead>{row(head, "th")}</thead>\n'
        f"<tbody>{body}</tbody></table></div>"
    )


def card(title: str, value: str, *, unit: str = "", note: str = "") -> str:
    """Return one headline number."""
    small = f" <small>{escape(unit)}</small>" if unit else ""
    below = f'<span class="note" style="display:block">{escape(note)}</span>' if note else ""
    return f'<dl class="card"><dt>{escape(title)}</dt><dd>{escape(value)}{small}{below}</dd></dl>'


def frame(document: str, *, title: str) -> str:
    """Return a whole HTML document as a frame of its own; it starts when it is scrolled to."""
    inner = document.replace("&", "&amp;").replace('"', "&quot;")
    return (
        f'<iframe title="{escape(title)}" loading="lazy" sandbox="allow-scripts" '
        f'srcdoc="{inner}"></iframe>'
    )


def image(base64: str, *, text: str) -> str:
    """Return a PNG picture, given in base64."""
    return f'<img alt="{escape(text)}" src="data:image/png;base64,{base64}">'
