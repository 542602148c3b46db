"""The end of a trial is the same in one compiled loop as tick by tick, byte for byte."""

from typing import Any

import numpy as np
import pytest

from mitt.generator.generators import Direct, Generator
from mitt.generator.learn import Learned
from mitt.records import BRAKE, Record
from mitt.rivals.quintic import make_quintic
from mitt.trials.ending import play_out
from mitt.trials.runner import LoggedTrial, TrialRunner
from mitt.trials.source import source_of
from mitt.world.faults.plan import Dropout, Encoder, Fault, Noise, Torque
from mitt.world.scene import Scene
from mitt.world.simulation import World

NOISE = Noise(kind="noise", magnitude=0.002)


def _run(runner: TrialRunner, learned: Learned) -> list[LoggedTrial]:
    """Throw three balls."""
    source = source_of(
        learned.map, seed=91, count=3, throws_file=None, flights_file=None, drag=0.04
    )
    return [runner.run(k, source.ball(k), seed=source.trial_seed(k), log=True) for k in range(3)]


@pytest.mark.parametrize("plans", [True, False])
def test_the_end_of_a_trial_is_that_of_tick_by_tick(
    learned: Learned, plans: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Score, ticks and true states of a map and of a rival, with a fault of the eyes."""
    f, scene = learned.map, Scene(faults=(NOISE,))
    generator: Generator = make_quintic(f) if plans else Direct(f)
    runner = TrialRunner(f.arm, generator, scene, pixels=False)
    mine = _run(runner, learned)
    with monkeypatch.context() as patch:
        patch.setattr(World, "ending", property(lambda _: None))
        theirs = _run(runner, learned)
    for a, b in zip(mine, theirs, strict=True):
        assert a.trial == b.trial
        assert a.log is not None
        assert b.log is not None
        assert np.count_nonzero(a.log.phase == BRAKE) > 100
        for name in ("t", "phase", "encoders", "ball", "command", "tau", "hand"):
            assert getattr(a.log, name).tobytes() == getattr(b.log, name).tobytes(), name
        assert np.array_equal(a.log.truth.qpos, b.log.truth.qpos)


@pytest.mark.parametrize(
    ("fault", "alone"),
    [
        (NOISE, True),
        (Dropout(kind="dropout", magnitude=0.5), True),
        (Torque(kind="torque", magnitude=0.7), False),
        (Encoder(kind="encoder", fault="step", magnitude=1e-3), False),
    ],
)
def test_what_stands_between_catcher_and_arm_forbids_the_loop(
    learned: Learned, fault: Fault, alone: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Weak motors and encoders that lie are met tick by tick; the eyes do not matter any more."""
    played = list[int]()

    def noted(*args: Any, **rules: Any) -> Record:  # noqa: ANN401 (what it is given)
        played.append(1)
        return play_out(*args, **rules)

    monkeypatch.setattr("mitt.trials.runner.play_out", noted)
    _run(
        TrialRunner(learned.map.arm, Direct(learned.map), Scene(faults=(fault,)), pixels=False),
        learned,
    )
    assert bool(played) == alone
