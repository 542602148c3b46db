"""A run of throws: what is chosen, what is kept, and what is compiled before the first ball."""

import json
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from signal import SIGHUP, SIGTERM
from typing import Any

import numpy as np
import pytest
from numba import typeof, types

from mitt.cli.catching import prepare_run
from mitt.cli.options import CatchOptions
from mitt.core.arm.arm import Arm
from mitt.core.catcher.family import Family
from mitt.core.catcher.generators import Direct, Unoptimised
from mitt.core.errors import InputError, MittError
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import default_design
from mitt.core.map.mapping import unlearned
from mitt.interrupts import Interrupted
from mitt.io.arm_file import ArmSpec
from mitt.io.maps import save_map
from mitt.lab.trials import play as loop
from mitt.lab.trials import runs
from mitt.lab.trials.registry import make_generator
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.runs import Prepared
from mitt.lab.trials.task_run import FinishedRun, run_trials
from mitt.lab.world.scene import Scene
from mitt.lab.world.throws import Throw


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory, learned: Learned) -> CatchOptions:
    """Two throws with a map of its own, seen as points."""
    folder = tmp_path_factory.mktemp("job")
    save_map(folder / "map.json", learned, version="0.1.0")
    return CatchOptions(
        throws=2, seed=5, map=folder / "map.json", vision="points", out=folder / "out"
    )


@pytest.fixture(scope="module")
def prepared(job: CatchOptions) -> Prepared:
    """The same, prepared."""
    return prepare_run(job)


def quiet(_name: str, _done: int, _of: int) -> None:
    """Report nothing."""


def nothing(*_: object) -> AbstractContextManager[Callable[[object], None]]:
    """Keep nothing."""
    return nullcontext(lambda _: None)


def timeless(finished: FinishedRun) -> str:
    """Return the result as JSON without wall-clock figures."""
    result = finished.result
    for name in ("tick_us", "deadline_misses"):
        result["summary"].pop(name)
    return json.dumps(result, sort_keys=True)


def test_preparing_writes_nothing(job: CatchOptions, prepared: Prepared) -> None:
    """All input is read and checked, and the output folder does not exist yet."""
    assert prepared.source.count == 2
    assert job.out is not None
    assert not job.out.exists()


def test_a_run_repeats_itself_and_each_throw_stands_alone(prepared: Prepared) -> None:
    """Twice the same result; the second throw alone is the second throw of the run."""
    first, again = (run_trials(prepared, progress=quiet, keeps=nothing) for _ in range(2))
    assert timeless(first) == timeless(again)
    bench_trials = first.trials
    alone = run_trials(
        replace(prepared, source=replace(prepared.source, count=1)), progress=quiet, keeps=nothing
    )
    assert alone.trials == bench_trials[:1]
    assert first.status == 0


def test_progress_counts_up_to_the_end(prepared: Prepared) -> None:
    """Learning and throwing are told from 0 to all."""
    told: list[tuple[str, int, int]] = []
    run_trials(prepared, progress=lambda *x: told.append(x), keeps=nothing)
    assert told == [
        ("learning", 0, 1),
        ("learning", 1, 1),
        ("throwing", 0, 2),
        ("throwing", 1, 2),
        ("throwing", 2, 2),
    ]


@pytest.mark.parametrize(
    ("signal", "status"),
    [(KeyboardInterrupt(), 130), (Interrupted(SIGTERM), 143), (Interrupted(SIGHUP), 129)],
)
def test_an_interrupt_keeps_what_is_finished(
    prepared: Prepared, signal: KeyboardInterrupt, status: int
) -> None:
    """After the first throw the run stops with the status of the signal and one trial."""

    def stop(name: str, done: int, _of: int) -> None:
        if (name, done) == ("throwing", 1):
            raise signal

    finished = run_trials(prepared, progress=stop, keeps=nothing)
    assert finished.status == status
    assert len(finished.trials) == 1
    assert finished.result["summary"]["throws"] == 1
    assert finished.result["incomplete"] is True


def test_throwing_again_gives_the_same_trial(prepared: Prepared) -> None:
    """A recording is made by throwing once more: it is the very same trial."""
    from mitt.lab.trials.runs import make_runner  # noqa: PLC0415 (beside its use)

    finished = run_trials(prepared, progress=quiet, keeps=nothing)
    assert isinstance(finished.runner, runs.ThrownBalls)
    bench = make_runner(prepared, finished.runner.learned, generator="direct")
    assert bench.throw(prepared.source, 1, log=True).trial == finished.trials[1]
    assert bench.throw(prepared.source, 0, log=True).trial == finished.trials[0]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"arm": "kuka"}, "arm"),
        ({"arm": "wam", "tip": "x"}, "arm wam"),
        ({"limits": "model"}, "limits"),
        ({"map": Path("missing.json")}, "missing.json"),
        ({"scene": Path("missing.toml")}, "missing.toml"),
        ({"throws_file": Path("missing.csv")}, "missing.csv"),
        ({"flights": Path("missing.csv")}, "missing.csv"),
        ({"throws_file": Path("a"), "flights": Path("b")}, "one of them"),
        ({"map": None, "kappa": 0.5}, "kappa"),
        ({"map": None, "kappa": float("nan")}, "kappa"),
        ({"map": None, "q_catch": 4.0}, "q_catch"),
        ({"map": None, "q_catch": float("nan")}, "q_catch"),
        ({"map": None, "catch_joint": 3}, "--catch-joint"),
        ({"map": None, "order": 1}, "order"),
        ({"adapt": "refine", "generator": "ik"}, "--generator single"),
        ({"map": None, "order": 1000}, "order"),
        ({"arm": "arm.urdf", "tip": "t", "joints": "a,b,c"}, "arm.urdf"),
        ({"arm": "arm.urdf"}, "arm.urdf: wanted a readable"),
    ],
)
def test_bad_options_are_refused_with_their_name(
    job: CatchOptions, change: dict[str, object], said: str
) -> None:
    """Each raises a MittError of one line before anything is learned or written."""
    with pytest.raises(MittError) as caught:
        prepare_run(replace(job, **change))  # type: ignore[arg-type]  # values of several types
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_design_follows_from_the_arm_where_it_is_silent() -> None:
    """The WAM's elbow at pi/2; fewer than three joints are refused."""
    design = ArmSpec().read().design
    assert (design.catch_joint, design.free) == (2, (0, 1, 2))
    assert design.q_catch == pytest.approx(np.pi / 2)


def test_generators_go_by_name(learned: Learned) -> None:
    """Each name has its type; alpha = 0 forgets what was learned."""
    assert isinstance(make_generator("direct", learned.map), Family)
    assert isinstance(make_generator("single", learned.map), Direct)
    plain = make_generator("unoptimised", learned.map)
    assert isinstance(plain, Unoptimised)
    assert not np.any(plain.map.alpha)
    with pytest.raises(InputError, match="direct, "):
        make_generator("magic", learned.map)


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
    spies = {
        name: Spy() for name in ("perceive", "act", "refer", "undecided", "move_motors", "capture")
    }
    for name, spy in spies.items():
        monkeypatch.setattr(runs, name, spy)
    f = unlearned(arm, default_design(arm))
    begun, done = (get_context("spawn").Value("i") for _ in range(2))
    runs._compile_parts(f, Scene(), throw, pixels, begun, done)
    assert done.value == begun.value - 1
    given: dict[str, Any] = {}

    def play(plant: Any, sight: Any, parts: Any, kept: Any, *others: Any) -> int:  # noqa: ANN401
        given.update(sight._asdict(), plant=plant, parts=parts, rows=kept.trace, sight=sight)
        given["path"] = others[-1]
        raise StopIteration

    monkeypatch.setattr(loop, "play", play)
    runner = TrialRunner(arm, Direct(f), Scene(), pixels=pixels)
    with pytest.raises(StopIteration):
        runner.run(0, throw, seed=0)
    brake, state, result = map(typeof, given["parts"])
    q, number, whole = typeof(given["encoders"][0]), typeof(0.0), typeof(0)
    nothing, grounds = typeof(given["nothing"]), typeof(given["backgrounds"])
    seen, read = (
        types.BaseTuple.from_types(x)
        for x in ((nothing, grounds, whole, number), (number, number, q, q))
    )
    wanted = {
        "perceive": (seen, read, state, result),
        "act": (brake, state, result),
        "refer": (state, result),
        "undecided": (whole, state, result),
        "move_motors": (
            typeof(given["plant"]),
            q,
            number,
            typeof(given["rows"]),
            typeof(given["path"]),
        ),
        "capture": (typeof(given["plant"]), typeof(given["sight"]), state, whole, typeof(True)),
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
    monkeypatch.setattr(runs, "_compile_parts", lambda *_: None)
    with runs.warming(
        arm,
        default_design(arm),
        Scene(),
        throw,
        pixels=True,
        progress=lambda *call: calls.append(call),
    ):
        assert other.did == ["start"]
    assert other.did == ["start", "join", "terminate"]
    assert calls[-1][1] == calls[-1][2] > 0


class _Other:
    """Stands in the place of processes and of one process."""

    def __init__(self) -> None:
        """Start without anything done."""
        self.did: list[str] = []

    def Value(self, kind: str) -> Any:  # noqa: N802, ANN401 (its name, and type)
        """Return a number that processes share."""
        return get_context("spawn").Value(kind)

    def Process(self, **_: object) -> "_Other":  # noqa: N802 (its name)
        """Return the process."""
        return self

    def __getattr__(self, name: str) -> Callable[[], None]:
        """Note what is done."""
        return lambda: self.did.append(name)
