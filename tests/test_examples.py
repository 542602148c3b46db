"""Every numbered example runs in an empty folder, and what it prints is true."""

import ast
import re
import runpy
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples"
EXAMPLES = sorted(FOLDER.glob("[0-9][0-9]_*.py"))

#: Longest example, in lines.
LONGEST = 55

_NUMBER = r"([-+.\de]+)"

#: What each example prints: a pattern with one number, and the range that the number must be in.
CLAIMS: dict[str, list[tuple[str, float, float]]] = {
    "01_arm": [
        (rf"catch point \[m\]: \[{_NUMBER}", 0.784, 0.786),
        (rf"against differences: {_NUMBER} m/rad", 0.0, 1e-8),
        (rf"tau - g - M ddq: {_NUMBER} N m", 0.0, 1e-9),
        (rf"meets a 6 m/s ball: {_NUMBER} rad/s", 12.6, 12.8),
    ],
    "02_own_loop": [
        (rf"start: {_NUMBER} rad from", 0.0, 1e-9),
        (rf"last tick: {_NUMBER} um apart", 0.0, 50.0),
        (rf"um apart, {_NUMBER} m/s relative", 0.0, 0.1),
    ],
    "03_catch_rate": [
        (rf"caught {_NUMBER} of 20", 18.0, 20.0),
        (rf"95 % interval {_NUMBER} to", 69.0, 84.0),
        (rf"first contact: {_NUMBER} mm", 0.0, 25.0),
    ],
    "04_own_arm": [
        (rf"share of a limit {_NUMBER}", 0.0, 1.05),
        (rf"at most {_NUMBER} m and", 0.0, 1e-8),
        (rf" m and {_NUMBER} m/s at the catch", 0.0, 1e-6),
    ],
    "05_vision": [
        (rf"seen True, {_NUMBER} mm off", 0.0, 8.0),
        (rf"position {_NUMBER} mm off", 0.0, 1.0),
        (rf"velocity {_NUMBER} m/s off", 0.0, 0.03),
        (rf"ahead: {_NUMBER} mm off", 0.0, 40.0),
    ],
    "06_recorded_flight": [
        (rf", {_NUMBER} flights", 44.0, 44.0),
        (rf"this flight: median {_NUMBER} mm", 0.0, 10.0),
        (rf"all flights: median {_NUMBER} mm", 0.0, 5.0),
    ],
    "07_two_cameras": [
        (rf"fit to {_NUMBER} px", 0.0, 0.03),
        (rf"cameras {_NUMBER} mm off", 0.0, 5.0),
        (rf"turned by {_NUMBER} mrad", 0.0, 1.0),
    ],
}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_what_it_prints_holds(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Run from an empty folder, an example prints its numbers, in range, and leaves no file."""
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(path), run_name="__main__")
    printed = capsys.readouterr().out
    for pattern, low, high in CLAIMS[path.stem]:
        found = re.search(pattern, printed)
        assert found, f"{pattern!r} is not in:\n{printed}"
        assert low <= float(found.group(1)) <= high, found.group(0)
    assert list(tmp_path.iterdir()) == []


def test_examples_are_numbered_short_and_explained() -> None:
    """Numbers run from 01 without a gap, and each file is short and says what it shows."""
    assert [path.stem for path in EXAMPLES] == sorted(CLAIMS)
    assert [int(path.stem[:2]) for path in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))
    for path in EXAMPLES:
        text = path.read_text(encoding="utf-8")
        assert len(text.splitlines()) <= LONGEST, path.name
        assert ast.get_docstring(ast.parse(text)), path.name
