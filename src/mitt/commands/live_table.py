"""The live table of ``mitt run``, drawn by a process of its own: drawing takes milliseconds."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import get_context
from threading import Event
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from mitt.interrupts import end_with_parent

#: Time between two pictures [s].
_PERIOD = 0.25


@contextmanager
def live_table(shown: Any, said: Any, states: Sequence[str]) -> Iterator[None]:  # noqa: ANN401
    """Show the numbers of a session on stderr while it runs, where that is a terminal.

    Args:
        shown: Shared memory of as many numbers as :data:`mitt.cell.session.SHOWN` has.
        said: Shared memory of what is odd, in words.
        states: What the first of the numbers counts, in words.
    """
    if not sys.stderr.isatty():
        yield
        return
    drawer = get_context("spawn").Process(target=_draw, args=(shown, said, states), daemon=True)
    drawer.start()
    try:
        yield
    finally:
        drawer.terminate()
        drawer.join()


def _draw(shown: Any, said: Any, states: Sequence[str]) -> None:  # noqa: ANN401
    """Draw until ended."""
    end_with_parent()
    pause = Event()
    with Live(console=Console(stderr=True), auto_refresh=False, transient=True) as live:
        while True:
            odd = said.value.decode(errors="replace")
            live.update(picture(list(shown), states, odd), refresh=True)
            pause.wait(_PERIOD)


def picture(numbers: list[float], states: Sequence[str], odd: str = "") -> Table:
    """Return the table of some numbers, in the order of :data:`mitt.cell.session.SHOWN`.

    Args:
        numbers: The numbers.
        states: What the first of them counts, in words.
        odd: What is odd in what the robot and the ball's source send; nothing if nothing is.
    """
    mode, rate, age, late, lost, throws, caught, told = numbers
    table = Table(show_header=False, title="mitt run", title_justify="left")
    rows = {
        "state": states[int(mode)],
        "rate": f"{rate:.0f} Hz",
        "reading to command": f"{age:.0f} us",
        "late readings": f"{late:.0f}",
        "lost readings": f"{lost:.0f}",
        "throws": f"{throws:.0f}",
        "caught": f"{caught:.0f} of {told:.0f}" if told else "unknown",
        **({"odd": odd} if odd else {}),
    }
    for name, value in rows.items():
        table.add_row(name, Text(value))
    return table
