"""The folder of a run of ``mitt meet`` or ``mitt bat``: claimed at first, its result kept whole.

``result.json`` is there from the start, so that the folder says whose it is, and holds the trials
that have ended up to some seconds ago, however the process ends.
"""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from mitt.clock import monotonic
from mitt.files.writing import Leaves, claim_folder, write_json
from mitt.interrupts import finally_do
from mitt.trials.result import PAGE, RESULT, kept_words

#: Time after which the result is written again while trials go on [s].
_AGAIN = 5.0

Result = Callable[[], dict[str, Any]]
"""Returns the result of the trials that have ended, which it holds as ``trials``."""


def leaves_of(command: str, schema: str) -> Leaves:
    """Return what a command leaves in its folder, by the schema of its result."""
    recordings = r"recordings/trial-\d{5,}\.mcap"
    return Leaves(
        command=command,
        schema=schema,
        manifests=(RESULT,),
        names=(*map(re.escape, (RESULT, PAGE)), recordings),
    )


MEETING: Final = leaves_of("mitt meet", "mitt.meet/1")
"""All that ``mitt meet`` leaves."""
BATTING: Final = leaves_of("mitt bat", "mitt.bat/1")
"""All that ``mitt bat`` leaves."""


def incomplete(done: int, wanted: int) -> dict[str, bool]:
    """Return what a result with fewer trials than wanted says besides."""
    return {"incomplete": True} if done < wanted else {}


@contextmanager
def kept_result(
    out: Path, leaves: Leaves, result: Result, wanted: int, *, overwrite: bool
) -> Iterator[Callable[[], None]]:
    """Claim the folder of a run, clear an earlier run's files, and keep its result.

    What is yielded is called whenever a trial has ended. A process that cannot be reached by a
    signal leaves the result of the trials that are done, as one that fails does.

    Args:
        out: The folder, locked.
        leaves: What the command leaves there.
        result: The result.
        wanted: How many trials there are to be.
        overwrite: Whether a folder with files in it may be used.

    Raises:
        InputError: Something in the folder is not ours.
        FileError: It cannot be written.
    """
    claim_folder(out, leaves, overwrite=overwrite)
    written = -_AGAIN

    def write() -> int:
        said = result()
        write_json(out / RESULT, said)
        return len(said["trials"])

    def keep() -> None:
        nonlocal written
        if monotonic() - written >= _AGAIN:
            write()
            written = monotonic()

    write()
    with finally_do(lambda: kept_words(write(), wanted, out)):
        try:
            yield keep
        finally:
            write()
