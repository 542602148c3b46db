"""A run as ``mitt catch`` makes it: prepared without side effects, kept when interrupted."""

import json
from dataclasses import replace
from pathlib import Path
from signal import SIGHUP, SIGTERM

import numpy as np
import pytest

from mitt.commands.catching import prepare
from mitt.commands.options import CatchOptions
from mitt.errors import InputError, MittError
from mitt.files.arm_file import ArmSpec
from mitt.files.maps import save_map
from mitt.generator.generators import Direct, Unoptimised
from mitt.generator.learn import Learned
from mitt.interrupts import Interrupted
from mitt.trials.registry import make_generator
from mitt.trials.runs import (
    FinishedRun,
    Prepared,
    run,
)


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
    return prepare(job)


def quiet(_name: str, _done: int, _of: int) -> None:
    """Report nothing."""


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
    first, again = (run(prepared, progress=quiet) for _ in range(2))
    assert timeless(first) == timeless(again)
    bench_trials = first.trials
    alone = run(replace(prepared, source=replace(prepared.source, count=1)), progress=quiet)
    assert alone.trials == bench_trials[:1]
    assert first.status == 0


def test_progress_counts_up_to_the_end(prepared: Prepared) -> None:
    """Learning and throwing are told from 0 to all."""
    told: list[tuple[str, int, int]] = []
    run(prepared, progress=lambda *x: told.append(x))
    assert told == [
        ("learning", 0, 1), ("learning", 1, 1),
        ("throwing", 0, 2), ("throwing", 1, 2), ("throwing", 2, 2),
    ]  # fmt: skip


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

    finished = run(prepared, progress=stop)
    assert finished.status == status
    assert len(finished.trials) == 1
    assert finished.result["summary"]["throws"] == 1
    assert finished.result["incomplete"] is True


def test_throwing_again_gives_the_same_trial(prepared: Prepared) -> None:
    """A recording is made by throwing once more: it is the very same trial."""
    from mitt.trials.runs import make_runner  # noqa: PLC0415 (beside its use)

    finished = run(prepared, progress=quiet)
    bench = make_runner(prepared, finished.learned, generator="direct")
    assert bench.throw(prepared.source, 1, log=True).trial == finished.trials[1]
    assert bench.throw(prepared.source, 0, log=True).trial == finished.trials[0]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"throws": 0}, "--throws"),
        ({"throws": -3}, "--throws"),
        ({"throws": 10**9}, "--throws"),
        ({"seed": -1}, "--seed"),
        ({"seed": 2**63}, "--seed"),
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
        ({"adapt": "refine", "generator": "ik"}, "--generator direct"),
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
        prepare(replace(job, **change))  # type: ignore[arg-type]  # values of several types
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_design_follows_from_the_arm_where_it_is_silent() -> None:
    """The WAM's elbow at pi/2; fewer than three joints are refused."""
    design = ArmSpec().read().design
    assert (design.catch_joint, design.free) == (2, (0, 1, 2))
    assert design.q_catch == pytest.approx(np.pi / 2)


def test_generators_go_by_name(learned: Learned) -> None:
    """Each name has its type; alpha = 0 forgets what was learned."""
    assert isinstance(make_generator("direct", learned.map), Direct)
    plain = make_generator("unoptimised", learned.map)
    assert isinstance(plain, Unoptimised)
    assert not np.any(plain.map.alpha)
    with pytest.raises(InputError, match="direct, "):
        make_generator("magic", learned.map)
