"""The live table of ``mitt run`` as a picture, while it catches at ``mitt sim`` in real time.

    python benchmarks/live_picture.py docs/img/live-table.svg

Both run as they do for a user, as two processes over DDS; the picture is made in the fourth catch.
"""

import argparse
import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

from rich import _export_format
from rich.console import Console

from mitt.cli.screen import picture
from mitt.clock import hurried, uncollected
from mitt.interrupts import tell
from mitt.io.cell import read_cell
from mitt.robot.cell.drivers import connect_robot
from mitt.robot.cell.live import Mode
from mitt.robot.cell.prepare import cell_map, prepare
from mitt.robot.cell.session import (
    SHOWN,
    STATES,
    Numbers,
    Person,
    Session,
    loop_of,
    rehearse,
    shared_numbers,
)

#: Domain of the two, throws, and number of the throw in which the picture is made, from 0.
DOMAIN = "174"
THROWS = 5
SHOT = 3


def save(shown: list[float], path: Path) -> None:
    """Write the table as SVG, in a font that each viewer has."""
    console = Console(record=True, width=44, file=Path(os.devnull).open("w"))  # noqa: SIM115
    console.print(picture(shown, STATES, ("throws", "caught")))
    plain = re.sub(r"@font-face \{\{.*?\}\}\s*", "", _export_format.CONSOLE_SVG_FORMAT, flags=re.S)
    plain = re.sub(r"<!--.*?-->", "", plain).replace("Fira Code", "monospace")
    text = console.export_svg(title="mitt run wam-sim", code_format=plain)
    path.write_text("\n".join(line.rstrip() for line in text.splitlines()) + "\n")


def watch(shown: Numbers, path: Path) -> None:
    """Make the picture while the catch is under way."""
    mode, thrown = SHOWN.index("mode"), SHOWN.index("told")
    while shown[thrown] < SHOT or shown[mode] != list(Mode).index(Mode.CATCHING):
        time.sleep(0.02)
    save(list(shown), path)


def main() -> None:
    """Catch, and make the picture."""
    parser = argparse.ArgumentParser()
    parser.add_argument("path", type=Path)
    path = parser.parse_args().path
    os.environ["ROS_DOMAIN_ID"] = DOMAIN
    words = ["-m", "mitt", "sim", "wam-sim", "--throws", str(THROWS), "--json"]
    sim = subprocess.Popen([sys.executable, *words], stdout=subprocess.DEVNULL)  # noqa: S603
    try:
        prepared, shown = prepare(read_cell("wam-sim")), shared_numbers()
        f = cell_map(prepared)
        rehearse(prepared, f)
        connection = connect_robot(prepared)
        loop = loop_of(prepared, f, connection)
        session = Session(
            loop, connection.robot, Person(yes=True), tell, throws=THROWS, shown=shown
        )
        threading.Thread(target=watch, args=(shown, path), daemon=True).start()
        with uncollected(), hurried():
            session.run()
    finally:
        sim.terminate()
        sim.wait()


if __name__ == "__main__":
    main()
