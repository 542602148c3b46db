"""What documents show on a console, and packages of tutorials; needs nothing but Python."""

import re
import tomllib
from pathlib import Path
from textwrap import indent

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```([^\n]*)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def blocks(path: Path, language: str) -> list[str]:
    """Return the blocks of a language in a document."""
    found = BLOCK.findall(path.read_text(encoding="utf-8"))
    return [text for name, text in found if name.strip() == language]


def is_part(text: str, path: Path) -> bool:
    """Say whether a block is a part of a file, or a part of a class in it."""
    whole = path.read_text(encoding="utf-8")
    return text in whole or indent(text, "    ") in whole


def lines_of(path: Path) -> list[str]:
    """Return the console lines of a document, joined commands apart, without comments."""
    text = BLOCK.sub("", path.read_text(encoding="utf-8"))
    out = re.findall(r"\n\n {4,}((?:mitt|python|make|pip) .*)", text)  # a block within a list
    for block in blocks(path, ""):
        if block.startswith("{"):  # what a command prints
            continue
        for line in block.splitlines():
            parts = re.split(r"&&?", line.split("#")[0])
            out += [part.strip() for part in parts if part.strip()]
    return out


def write_metadata(package: Path, into: Path) -> None:
    """Write what an installed package says of itself, its entry points among it.

    Args:
        package: Its folder, with pyproject.toml and modules.
        into: A folder.
    """
    table = tomllib.loads((package / "pyproject.toml").read_text())["project"]
    about = into / f"{table['name'].replace('-', '_')}-{table['version']}.dist-info"
    about.mkdir()
    about.joinpath("METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {table['name']}\nVersion: {table['version']}\n"
    )
    groups = [
        f"[{group}]\n" + "".join(f"{name} = {at}\n" for name, at in names.items())
        for group, names in table["entry-points"].items()
    ]
    about.joinpath("entry_points.txt").write_text("".join(groups))
