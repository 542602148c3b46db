"""What commands say on stderr besides their work."""

from pathlib import Path

import pytest

from mitt import jit
from mitt.commands.screen import tell_of_kernels
from mitt.interrupts import tell


class Full:
    """A stream that cannot be written to."""

    def write(self, text: str) -> int:
        """Refuse."""
        raise OSError(28, "No space left on device", None if text else "")

    def flush(self) -> None:
        """Do nothing."""


@pytest.mark.parametrize(
    ("folder", "cold", "said"),
    [
        (None, True, "NUMBA_CACHE_DIR"),
        (Path("kernels"), True, "compiling, once"),
        (Path("kernels"), False, ""),
    ],
)
def test_compiling_is_said_in_one_line_where_it_is_due(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    folder: Path | None, cold: bool, said: str,
) -> None:  # fmt: skip
    """That kernels cannot be kept and what to do, that they are compiled once, or nothing."""
    monkeypatch.setattr(jit, "cache_folder", lambda: folder)
    monkeypatch.setattr(jit, "is_cold", lambda: cold)
    tell_of_kernels()
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") == bool(said)


def test_nobody_who_hears_is_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk behind stderr does not end a run."""
    monkeypatch.setattr("sys.stderr", Full())
    tell("something")
