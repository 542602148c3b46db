"""Numbers that a user writes: read in one place, and refused in one line whatever they are."""

import ast
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mitt
from mitt.cli.line import options_of
from mitt.cli.main import main
from mitt.cli.options import COMMANDS
from mitt.core.errors import InputError
from mitt.io.reading import reals_of
from mitt.lab.trials.workers import check_engine
from mitt.numerals import real_of, whole_of
from mitt.robot.cameras.cameras import images_in
from mitt.robot.cell.dds import domain_id

PACKAGE = Path(mitt.__file__).parent
#: What looks like a number and is none, or more than any machine has.
ODD = ("²", "٣", "\uff11", "1_0", "0x10", "1e3", "", " ", "+", "--5", "½", "1" * 5000)


@given(st.one_of(st.text(max_size=20), st.integers().map(str), st.sampled_from(ODD)))
def test_whatever_a_text_is_it_is_a_number_or_none(text: str) -> None:
    """Never an exception; what is read is what Python reads of the same digits."""
    whole, real = whole_of(text), real_of(text)
    assert whole is None or text.strip(" \t").isascii()
    if whole is not None and len(text) < 100:
        assert whole == int(text)
        assert real == float(text)
    if real is not None and real == real:
        assert real == float(text)


@pytest.mark.parametrize("text", ODD)
def test_an_odd_number_is_refused_at_every_door(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The variable of the environment, the engine's port; a name of an image sorts anyhow."""
    if text.strip():
        monkeypatch.setenv("ROS_DOMAIN_ID", text)
        with pytest.raises(InputError, match=r"ROS_DOMAIN_ID: wanted a number in 0\.\.232"):
            domain_id()
    with pytest.raises(InputError, match="--engine: wanted local or dask"):
        check_engine(f"dask://x:{text}", None)
    with pytest.raises(InputError):
        reals_of("--target", f"{text},1" if text != "1e3" else "x,1", 2, most=100.0)
    for name in (f"{text[:20].replace('/', '')}a.png", "b2.png", "b10.png"):
        (tmp_path / name).touch()
    names = [x.name for x in images_in(tmp_path)]
    assert len(names) == 3
    assert names.index("b2.png") < names.index("b10.png")


@pytest.mark.parametrize("name", COMMANDS)
def test_an_odd_number_of_any_option_is_one_line(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of thousands of digits, too: what is wanted is said, never a fault of mitt."""
    for option in options_of(COMMANDS[name]):
        if option.place or option.kind not in (int, float):
            continue
        for text in (*ODD, "9" * 5000, f"-{'9' * 5000}"):
            if option.kind is float and (real_of(text) is not None or not text.strip("-9")):
                continue
            if option.arg.range is None and whole_of(text) is not None:
                continue  # held to what it is about by the command
            assert option.arg.range is None or option.arg.range[1] < 1e30 or option.kind is float
            assert main([name, f"{option.name}={text}", "--check"]) == 2
            err = capsys.readouterr().err
            assert err.startswith(f"mitt: {option.name}: wanted ")
            assert len(err) < 700


def test_numbers_with_commas_say_what_is_wrong() -> None:
    assert reals_of("--target", "1, 2,-3e0", 3, most=100.0) == (1.0, 2.0, -3.0)
    for text in ("1,2", "1,2,3,4", "1,2,x", "1,,3", "²,1,1"):
        with pytest.raises(InputError, match="3 numbers with commas"):
            reals_of("--target", text, 3, most=100.0)
    for text in ("1e308,0,0", "inf,0,0", "nan,0,0"):
        with pytest.raises(InputError, match="numbers from -100 to 100"):
            reals_of("--target", text, 3, most=100.0)


def test_no_other_module_asks_whether_a_text_is_digits() -> None:
    """``isdigit`` takes what ``int`` does not."""
    asked = [
        f"{path.name}: {ast.unparse(node)}"
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and node.attr in ("isdigit", "isdecimal", "isnumeric")
    ]
    assert asked == []
