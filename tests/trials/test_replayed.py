"""A recording through the catcher again commands the same to the bit; another choice does not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_trials import CASES, Case, map_for, recorded, replayed

from mitt.core.catcher.generators import Direct
from mitt.core.errors import FileError, InputError
from mitt.core.map.learn import Learned
from mitt.io.maps import save_map
from mitt.io.recordings import Recorded, write_recording
from mitt.lab.trials.explain import evidence_of, explain
from mitt.lab.trials.log import FIRST_CONTACT, recording_of
from mitt.lab.trials.replayed import changed, recorded_generator, replay
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.runs import simulate
from mitt.lab.trials.source import source_of
from mitt.lab.world.scene import Scene, read_scene
from mitt.lab.world.throws import Throw
from mitt.robot.cell.recorder import Recorder
from mitt.version import __version__

_SEED = 17
_QUICK = (
    "points",
    "behind the eyes",
    "images",
    "refined in flight",
    "turning cameras",
    "turning cameras, images",
    "late, doubled points",
    "NaN",
    "clock set back",
    "encoder silent",
    "carried, then thrown",
    "quintic",
)


@pytest.mark.parametrize(
    "case", [case for case in CASES if case.name in _QUICK], ids=lambda case: case.name
)
def test_a_replay_commands_the_same_to_the_bit(case: Case, tmp_path: Path) -> None:
    """Whatever the senses, the generator and the faults: no command differs, none is missing."""
    for _, path in recorded(case, tmp_path, throws=1, seed=_SEED):
        x = replayed(path)
        assert x.identical
        assert x.first_difference is None
        assert len(x.ticks.scalars) == len(x.recorded.ticks) > 100
        assert x.begins == (
            "images" if case.images else "eyes" if case.vision == "pixels" else "points"
        )


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded throw, seen as points."""
    folder = tmp_path_factory.mktemp("one")
    ((_, path),) = recorded(CASES[0], folder, throws=1, seed=_SEED)
    return path


def test_another_map_and_other_settings_act_differently_and_say_from_when(
    one: Path, tmp_path: Path
) -> None:
    """Another map, stricter settings, another generator: the first difference is near the start."""
    back = Recorded(one)
    f, t_0, map_file = map_for("paper"), replayed(one).t_0, tmp_path / "other.json"
    other = replace(f, alpha=0.9 * f.alpha)
    learned = Learned(map=other, maps=(other,), steps=(), flights=0, left_out=0, status="steps")
    save_map(map_file, learned, version=__version__)
    settings = tmp_path / "patient.toml"
    settings.write_text("sigma_ready = 0.004\n[flight]\ngate = 16.0\n")
    for about in (
        changed(back.about, map_file=map_file),
        changed(back.about, settings=settings),
        changed(back.about, generator="unoptimised"),
    ):
        x = replay(back, about)
        assert not x.identical
        first = x.first_difference
        assert first is not None
        assert x.ticks.scalars["t"][first] <= t_0 + 0.05
        assert np.array_equal(x.ticks.encoders[:first, 0], back.ticks["q"][:first])


def test_settings_that_no_catcher_has_are_refused(one: Path, tmp_path: Path) -> None:
    """An unknown key, a text for a number, no TOML: one line that names the file."""
    about, path = Recorded(one).about, tmp_path / "x.toml"
    for text in ("dance = 1\n", "watch = 'long'\n", "[flight]\nwings = 2\n", "watch = \n"):
        path.write_text(text)
        with pytest.raises(FileError, match=r"x\.toml"):
            changed(about, settings=path)
    with pytest.raises(InputError, match="clairvoyant"):
        replay(Recorded(one), changed(about, generator="clairvoyant"))


@pytest.mark.thorough
def test_stops_recoveries_and_further_throws_of_a_live_loop_replay(
    tmp_path: Path, learned: Learned
) -> None:
    """Stopped by a person, recovered, and another throw into the same file: the same commands."""
    f, scene = learned.map, read_scene("lab")
    runner = TrialRunner(f.arm, Direct(f), scene, pixels=False)
    source, path = (
        source_of(f.arm, seed=_SEED, count=2, drag=scene.ball.drag),
        tmp_path / "live.mcap",
    )
    with Recorder(path, runner.about("single", f)) as recorder:
        for throw in range(2):
            if throw:
                recorder.call("again")
            catcher = runner.release(source.ball(throw), seed=throw)
            stopped = recovered = False
            for k in range(900):
                if throw == 0 and k == 300:
                    recorder.call("stop")
                    catcher.stop()
                    stopped = True
                if stopped and not recovered and k == 800:
                    recorder.call("recover")
                    catcher.recover()
                    recovered = True
                senses = runner.world.sense(look=catcher.looking)
                command = catcher.step(senses)
                runner.world.apply(command)
                recorder.tick(senses, command, catcher.result)
                catcher.think()
    x = replayed(path)
    assert x.identical
    assert len(x.ticks.scalars) == 1800
    assert x.stopped_by is not None
    assert x.stopped_by.reason.value == "stop asked for"
    phases = x.ticks.scalars["phase"]
    assert phases[799] == 4
    assert phases[801] == 0
    assert 1 in phases[900:]


def test_a_recording_of_another_map_does_not_replay_as_its_own(one: Path) -> None:
    """One bit of one reading changed: the replay finds it, and nothing before it."""
    back = Recorded(one)
    rows = back.ticks.copy()
    rows["q"][400, 1] = np.nextafter(rows["q"][400, 1], 9.0)
    rows["q"][400, 1] += 1e-3
    back._rows = rows
    x = replay(back)
    assert x.first_difference is not None
    assert x.first_difference >= 400


_CAUSES = {
    "points": "caught",
    "encoder silent": "encoder silent of j4",
    "blind from 0.2 s": "",
    "wam-48v, 0.5 kg": "Refused before the arm moved",
    "clock set back": "stopped",
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", _CAUSES)
def test_the_first_cause_is_named(name: str, tmp_path: Path) -> None:
    """A stop, a refusal, a catch: said in words, with figures that are finite."""
    (case,) = (case for case in CASES if case.name == name)
    for status, path in recorded(case, tmp_path, throws=1, seed=_SEED):
        x = replayed(path)
        e = evidence_of(x)
        said = explain(x, e)
        assert said.status == status
        assert _CAUSES[name] in said.cause
        assert "nan" not in " ".join(value for _, value in said.facts)
        assert np.nanmax(e.torque) <= 1.0 + 1e-6
        touched = [t for t, _, text in x.recorded.notices if text == FIRST_CONTACT]
        after = e.t >= min(touched, default=np.inf)
        assert not np.any(np.isfinite(e.error[after]))  # the hand moves the ball from there on
        assert np.any(np.isfinite(e.sigma[after])) or name != "points"


def test_a_throw_that_ended_before_its_first_tick_replays(tmp_path: Path, learned: Learned) -> None:
    """A ball faster than the physics is trusted: no tick, and nothing that differs."""
    runner = TrialRunner(learned.map.arm, Direct(learned.map), Scene(), pixels=False)
    ball = Throw(r=np.array([3.0, 0.0, 0.5]), dr=np.array([-100.0, 0.0, 0.0]))
    outcome, path = runner.run(0, ball, seed=1, log=True), tmp_path / "x.mcap"
    assert outcome.log is not None
    about = runner.about("direct", learned.map)
    write_recording(path, recording_of(outcome.log, outcome.trial, about))
    x = replayed(path)
    assert x.identical
    assert len(x.ticks.scalars) == 0
    said = explain(x, evidence_of(x))
    assert said.status == "aborted"
    assert "never tracked" in said.cause


def test_what_simulate_records_replays(tmp_path: Path, learned: Learned) -> None:
    """From Python, images by the compiled loop: a file for each throw, identical to the bit."""
    trials = simulate(learned, throws=2, seed=_SEED, record=tmp_path)
    files = sorted(tmp_path.iterdir())
    assert len(files) == len(trials) == 2
    assert all(replayed(path).identical for path in files)


def test_a_recording_with_ticks_dropped_at_its_end_is_not_identical(one: Path) -> None:
    """What is there is the same, but not all is there."""
    x = replayed(one)
    assert x.identical
    x.recorded.dropped = 3
    assert not x.identical
    assert x.first_difference is None


@pytest.mark.parametrize("name", ["direct", "single"])
def test_what_was_refined_is_refined_again(one: Path, name: str) -> None:
    """Also in a recording of when the one map, refined, was called ``direct``."""
    about = Recorded(one).about
    about = replace(about, generator=name, maps=about.maps[:1], refines=True)
    generator = recorded_generator(about)
    assert isinstance(generator, Direct)
    assert generator.refines
    assert generator.learned is about.maps[0]
    assert not isinstance(recorded_generator(replace(about, refines=False)), Direct) or (
        name == "single"
    )
