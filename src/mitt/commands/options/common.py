"""What the options of several commands share."""

from pathlib import Path
from typing import Annotated

from tyro.conf import arg

Csv = Annotated[Path | None, arg(metavar="CSV")]
Toml = Annotated[Path | None, arg(metavar="TOML")]
Map = Annotated[Path | None, arg(metavar="MAP.json")]
Folder = Annotated[Path | None, arg(metavar="DIR")]
