"""What is compiled ahead of the first throw is what the throw needs, and no more is done."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from numba import typeof

from mitt.generator.generators import Direct
from mitt.generator.map_design import default_design
from mitt.generator.mapping import unlearned
from mitt.robot.arm import Arm
from mitt.trials import play as loop
from mitt.trials import runs
from mitt.trials.runner import TrialRunner
from mitt.world.scene import Scene
from mitt.world.throws import Throw


class Spy:
    """Stands in the place of a kernel and notes for which types it is compiled."""

    def __init__(self) -> None:
        """Start without any; what kernels call of it is noted too."""
        self.types: list[tuple[Any, ...]] = []
        self.inner = self

    def compile(self, types: tuple[Any, ...]) -> None:
        """Note them."""
        self.types.append(types)


@pytest.mark.parametrize("pixels", [True, False])
def test_the_types_are_those_of_a_throw(
    arm: Arm, throw: Throw, monkeypatch: pytest.MonkeyPatch, pixels: bool
) -> None:
    """Another type, and each kernel would be compiled twice without a word."""
    spies = {name: Spy() for name in ("perceive", "act", "refer", "undecided", "move")}
    for name, spy in spies.items():
        monkeypatch.setattr(runs, name, spy)
    f = unlearned(arm, default_design(arm))
    runs._compile_eyes(f, Scene(), throw, pixels)
    runs._compile_arm(f, Scene(), throw, pixels)
    given: dict[str, Any] = {}

    def play(plant: Any, sight: Any, parts: Any, kept: Any, *_: Any) -> int:  # noqa: ANN401
        given.update(sight._asdict(), plant=plant, parts=parts, rows=kept.trace)
        raise StopIteration

    monkeypatch.setattr(loop, "play", play)
    runner = TrialRunner(arm, Direct(f), Scene(), pixels=pixels)
    with pytest.raises(StopIteration):
        runner.run(0, throw, seed=0)
    brake, state, result = map(typeof, given["parts"])
    q, number, whole = typeof(given["encoders"][0]), typeof(0.0), typeof(0)
    nothing, grounds = typeof(given["nothing"]), typeof(given["backgrounds"])
    wanted = {
        "perceive": (nothing, grounds, whole, number, number, number, q, q, state, result),
        "act": (brake, state, result),
        "refer": (state, result),
        "undecided": (whole, state, result),
        "move": (typeof(given["plant"]), q, number, typeof(given["rows"])),
    }
    assert {name: spy.types for name, spy in spies.items()} == {k: [v] for k, v in wanted.items()}


@pytest.mark.parametrize(("folder", "cold"), [(None, True), (Path(), False)])
def test_nothing_is_done_where_it_is_done_or_cannot_be_kept(
    arm: Arm, throw: Throw, monkeypatch: pytest.MonkeyPatch, folder: Path | None, cold: bool
) -> None:
    """No second process, no bar."""
    monkeypatch.setattr(runs, "cache_folder", lambda: folder)
    monkeypatch.setattr(runs, "is_cold", lambda: cold)
    monkeypatch.setattr(runs, "get_context", _never)
    with runs.warming(
        arm, default_design(arm), Scene(), throw, pixels=True, progress=lambda *_: _never("bar")
    ):
        pass


def _never(what: str) -> None:
    """Fail."""
    raise AssertionError(what)


def test_the_bar_ends(arm: Arm, throw: Throw, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second process is waited for, and the last report is that all is done."""
    calls: list[tuple[str, int, int]] = []
    other = _Other()
    monkeypatch.setattr(runs, "cache_folder", Path)
    monkeypatch.setattr(runs, "is_cold", lambda: True)
    monkeypatch.setattr(runs, "get_context", lambda _: other)
    monkeypatch.setattr(runs, "_compile_arm", lambda *_: None)
    with runs.warming(
        arm, default_design(arm), Scene(), throw, pixels=True,
        progress=lambda *call: calls.append(call),
    ):  # fmt: skip
        assert other.did == ["start"]
    assert other.did == ["start", "join", "terminate"]
    assert calls[-1][1] == calls[-1][2] > 0


class _Other:
    """Stands in the place of processes and of one process."""

    def __init__(self) -> None:
        """Start without anything done."""
        self.did: list[str] = []

    def Process(self, **_: object) -> "_Other":  # noqa: N802 (its name)
        """Return the process."""
        return self

    def __getattr__(self, name: str) -> Callable[[], None]:
        """Note what is done."""
        return lambda: self.did.append(name)
