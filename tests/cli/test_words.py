"""Whatever words a command is given: one line of ours, status 2, and what was meant if near."""

import re
from pathlib import Path

import pytest

from mitt.cli.line import Option, options_of, parse
from mitt.cli.main import main
from mitt.cli.options import COMMANDS
from mitt.core.errors import InputError, UnknownNameError, meant

#: What libraries say; none of it is for a user of a command.
LEAKS = re.compile(
    r"tyro|pydantic|argparse|instantiated|type matching|invalid choice|Unrecognized|Expected|"
    r"Error parsing|Traceback|\{None\}|validation error|Input should|could not convert|literal"
)
ALL = [(name, option) for name, kind in COMMANDS.items() for option in options_of(kind)]
NAMES = [f"{name} {option.name}" for name, option in ALL]
#: Values that are no number of a kind.
WRONG = {
    int: ("five", "2.5", "", "None", "0x10", "1e3", "1_0", "nan"),
    float: ("five", "", "None", "1,5", "0x10", "1 m", "--"),
}


def base(name: str, but: Option | None = None) -> list[str]:
    """Return a command with all that is required, without one option."""
    words = [name]
    for option in options_of(COMMANDS[name]):
        if option.required and option is not but and option != but:
            value = str(option.choices[0]) if option.choices else "x.toml"
            words += [value] if option.place else [option.name, value]
    return words


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Return the one line by which words are refused."""
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1, err
    assert err.startswith("mitt: ")
    assert ": wanted " in err
    assert ", got " in err
    assert not LEAKS.search(err.partition(", got ")[0]), err
    return err


@pytest.mark.parametrize("name", COMMANDS)
def test_all_that_is_required_is_enough(name: str) -> None:
    assert parse(base(name))[0] == name


@pytest.mark.parametrize(("name", "option"), ALL, ids=NAMES)
def test_a_wrong_value_of_any_option_is_told_in_our_words(
    name: str, option: Option, capsys: pytest.CaptureFixture[str]
) -> None:
    words = base(name, option)
    if option.place:
        places = [x for x in options_of(COMMANDS[name]) if x.place]
        if not option.many:
            assert "'more' as well" in refused([name, *["x"] * len(places), "more"], capsys)
        return
    if option.kind is bool:
        assert "wanted no value" in refused([*words, f"{option.name}=yes"], capsys)
    else:
        for rest in ([], ["--check"]):
            assert "nothing after it" in refused([*words, option.name, *rest], capsys)
        for wrong in WRONG.get(option.kind, ()):
            assert option.name in refused([*words, option.name, wrong], capsys) or wrong == "--"
            assert option.name in refused([*words, f"{option.name}={wrong}"], capsys)
    for choice in (x for x in map(str, option.choices) if len(x) > 1):
        near = choice[:-1]
        said = refused([*words, option.name, near], capsys)
        assert option.name in said
        assert f"did you mean {meant(near, map(str, option.choices))[14:-2]!r}?" in said


@pytest.mark.parametrize(("name", "option"), ALL, ids=NAMES)
def test_an_option_that_is_nearly_one_is_meant(
    name: str, option: Option, capsys: pytest.CaptureFixture[str]
) -> None:
    """A letter left out, two that changed places; with underscores it is the option itself."""
    if option.place:
        return
    called = option.name
    others = {x.name for x in options_of(COMMANDS[name])}
    for k in range(2, len(called) - 1):
        for wrong in (
            called[:k] + called[k + 1 :],
            called[:k] + called[k + 1] + called[k] + called[k + 2 :],
        ):
            if wrong in (*others, "--help") or wrong.startswith("---"):
                continue
            said = refused([*base(name), wrong, "3"], capsys)
            assert "did you mean '--" in said or len(called) < 6, said
    least = str((option.arg.range or (1,))[0])
    value = [] if option.kind is bool else [str(option.choices[0]) if option.choices else least]
    assert parse([*base(name, option), called.replace("_", "-"), *value])[0] == name


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_that_is_nearly_one_is_meant(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for wrong in (name[:-1], name.upper(), f"{name}s", name[1:]):
        said = refused([wrong, "--throws", "3"], capsys)
        assert "command: wanted one of catch, " in said
    assert f"did you mean {name!r}?" in refused([name.upper()], capsys)
    assert "-x" in refused([name, "-x"], capsys)


@pytest.mark.parametrize(
    "name", [x for x, kind in COMMANDS.items() if any(o.required for o in options_of(kind))]
)
def test_all_that_is_missing_is_named_at_once(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refused([name], capsys)
    for option in options_of(COMMANDS[name]):
        assert (f"{option.name} {option.value}" in said) == (option.required and not option.place)
        assert option.name in said or not option.required
    assert f"see mitt {name} --help" in said


def test_a_negative_number_is_a_value() -> None:
    _, options = parse(["catch", "--q-catch", "-0.5", "--inward=-1"])
    assert (options.q_catch, options.inward) == (-0.5, -1.0)  # type: ignore[attr-defined]


def test_mitt_alone_is_its_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    alone = capsys.readouterr()
    assert main(["--help"]) == 0
    assert alone == capsys.readouterr()
    assert alone.out.startswith("usage: mitt COMMAND")
    assert alone.err == ""


@pytest.mark.parametrize(
    ("words", "near"),
    [
        (["catch", "--generator", "qintic"], "quintic"),
        (["catch", "--limits", "wam48v"], "wam-48v"),
        (["catch", "--limits", "ur5"], "ur5e"),
        (["catch", "--scene", "labb"], "lab"),
        (["catch", "--arm", "wamm"], "wam"),
        (["catch", "--joints", "j1,j2,j44"], "j4"),
        (["design", "wam", "--out", "x.toml", "--joints", "j1,j2,j44"], "j4"),
        (["run", "wam-simm"], "wam-sim"),
        (["sim", "wamsim"], "wam-sim"),
        (["study", "smok", "--out", "x"], "smoke"),
    ],
)
def test_a_name_that_is_nearly_one_is_meant(
    words: list[str],
    near: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert f"did you mean {near!r}?" in refused([*words, "--check"], capsys)


@pytest.mark.parametrize(
    ("words", "called"),
    [
        (["catch", "--q-catch", "9"], "--q-catch: "),
        (["catch", "--kappa", "0"], "--kappa: "),
        (["learn", "--inward", "nan", "--out", "m.json"], "--inward: "),
        (["design", "ARM.urdf", "--out", "x.toml"], "--tip: wanted the link or site of the palm"),
    ],
)
def test_an_input_is_called_as_it_is_said(
    words: list[str],
    called: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """By its option, not by the name of a field or of an argument in Python."""
    example = Path(__file__).parents[2] / "examples" / "own_arm.urdf"
    (tmp_path / "ARM.urdf").write_bytes(example.read_bytes())
    monkeypatch.chdir(tmp_path)
    assert refused([*words, "--check"], capsys).startswith(f"mitt: {called}")


def test_nothing_near_is_not_guessed() -> None:
    assert meant("xyz", ("catch", "learn")) == ""
    assert "did you mean" not in str(UnknownNameError("a", "xyz", ("catch", "learn")))
    both = UnknownNameError("a", "CATCH", ("catch", "learn"), do="or do that")
    assert str(both).endswith("got 'CATCH'; did you mean 'catch'? or do that")
    assert isinstance(both, InputError)


TEXTS = [(name, option) for name, option in ALL if option.kind in (str, Path)]


@pytest.mark.parametrize(
    ("name", "option"), TEXTS, ids=[f"{name} {option.name}" for name, option in TEXTS]
)
def test_an_empty_text_is_no_value(
    name: str, option: Option, capsys: pytest.CaptureFixture[str]
) -> None:
    """As a variable of a shell that is not set leaves it; as a path it would be this folder."""
    if option.place:
        places = [x for x in options_of(COMMANDS[name]) if x.place]
        words = [name, *("" if x == option else "x.toml" for x in places)]
    else:
        words = [*base(name, but=option), f"{option.name}="]
    said = refused(words, capsys)
    assert option.name in said


@pytest.mark.parametrize("folder", [".", "/", ".."])
@pytest.mark.parametrize(
    "words",
    [
        ["calibrate", "--left", ".", "--right", ".."],
        ["design", "wam"],
        ["learn"],
        ["track", "points.csv"],
    ],
    ids=lambda x: x[0],
)
def test_a_folder_is_no_file_of_output(
    words: list[str], folder: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nor has a folder as ``.`` a name that what is written beside it could be called by."""
    assert "--out: wanted a " in refused([*words, "--out", folder], capsys)
